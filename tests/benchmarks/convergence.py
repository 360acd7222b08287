"""How fast the error of mlt falls: error² against mutations, on a logarithmic scale.

    python tests/benchmarks/convergence.py [--scene SCENE] [--width W] [--seeds N] [--output FILE]

relMSE against a reference of bidirectional path tracing (see usdmlt.equal_time), so that an error
that does not fall, of whatever cause, bends the line. Independent errors give a slope of -1:
twice the mutations, half the error².
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from usdmlt import equal_time
from usdmlt.scene import Scene
from usdmlt.stage import load

ROOT = Path(__file__).parents[2]
MUTATIONS = (8, 16, 32, 64, 128, 256)  # per pixel
DEPTH = 8


def renders(
    scene: Scene, lengths: Sequence[int], seeds: int
) -> Iterator[tuple[float, list[np.ndarray]]]:
    """Mutations per pixel as they were spent, and pictures (height, width, 3) of so many seeds, for
    every length; all of them are independent."""
    for number, mutations in enumerate(lengths):
        timed = [
            equal_time.render(scene, "mlt", mutations, DEPTH, seed=seeds * number + i)
            for i in range(seeds)
        ]
        spent = float(np.mean([t.stats["samples_per_pixel"] for t in timed]))
        yield spent, [t.picture for t in timed]


def measure(scene_path: Path, width: int, seeds: int, reference_seconds: float) -> np.ndarray:
    """Rows of mutations per pixel, relMSE and its standard error, (lengths, 3)."""
    scene = load(str(scene_path), width=width)
    reference = equal_time.make_reference(scene, reference_seconds, DEPTH)
    print(f"reference: {reference.integrator}, relMSE of a half {reference.rel_mse:.2g}")
    rows = []
    for spent, pictures in renders(scene, MUTATIONS, seeds):
        errors = [equal_time.relative_error(picture, reference.parts) for picture in pictures]
        rows.append((spent, *equal_time.mean_and_error(errors)))
        print(
            f"{spent:6.0f} mutations per pixel: {rows[-1][1]:.4g} ± {rows[-1][2]:.2g}", flush=True
        )
    return np.array(rows)


def fit(rows: np.ndarray) -> tuple[float, float, float]:
    """Slope, its standard error, and intercept of ln relMSE over ln mutations.

    All points count the same: weights from errors that few seeds estimate would favour low ones.
    """
    x, y, deviation = np.log(rows[:, 0]), np.log(rows[:, 1]), rows[:, 2] / rows[:, 1]
    shares = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    slope = float(shares @ y)
    return slope, float(np.hypot.reduce(shares * deviation)), float(y.mean() - slope * x.mean())


def plot(rows: np.ndarray, slope: float, error: float, intercept: float, title: str) -> str:
    """The measured errors and the line through them, as SVG."""
    width, height, left, top, right, bottom = 480, 320, 64, 34, 16, 44
    low_x, high_x = rows[0, 0] / 1.3, rows[-1, 0] * 1.3
    low_y, high_y = np.min(rows[:, 1]) / 1.6, np.max(rows[:, 1]) * 1.6

    def x(value: float) -> float:
        share = np.log(value / low_x) / np.log(high_x / low_x)
        return float(left + share * (width - left - right))

    def y(value: float) -> float:
        share = np.log(value / low_y) / np.log(high_y / low_y)
        return float(height - bottom - share * (height - top - bottom))

    def line(x0: float, y0: float, x1: float, y1: float, style: str) -> str:
        return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" {style}/>'

    def label(px: float, py: float, words: str, anchor: str = "middle") -> str:
        return f'<text x="{px:.1f}" y="{py:.1f}" text-anchor="{anchor}">{words}</text>'

    grid, ink, mark = 'stroke="#ddd"', 'stroke="#b33" stroke-width="1.5"', 'stroke="#222"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="sans-serif" font-size="12" fill="#222">',
        '<rect width="100%" height="100%" fill="#fff"/>',
        label(width / 2, 20, title),
        label(width / 2, height - 8, "mutations per pixel"),
        label(left - 6, top - 4, "relMSE", "end"),
    ]
    for value in rows[:, 0]:
        parts.append(line(x(value), top, x(value), height - bottom, grid))
        parts.append(label(x(value), height - bottom + 16, f"{value:.0f}"))
    for power in range(-12, 13):
        for value in (10.0**power, 2 * 10.0**power, 5 * 10.0**power):
            if low_y < value < high_y:
                parts.append(line(left, y(value), width - right, y(value), grid))
                parts.append(label(left - 6, y(value) + 4, f"{value:g}", "end"))
    ends = [np.exp(intercept) * value**slope for value in (low_x, high_x)]
    parts.append(line(x(low_x), y(ends[0]), x(high_x), y(ends[1]), ink))
    for spent, mean, deviation in rows:
        parts.append(f'<circle cx="{x(spent):.1f}" cy="{y(mean):.1f}" r="3"/>')
        parts.append(
            line(x(spent), y(max(mean - deviation, low_y)), x(spent), y(mean + deviation), mark)
        )
    parts.append(label(width - right - 8, top + 18, f"slope {slope:.3f} ± {error:.3f}", "end"))
    return "\n".join([*parts, "</svg>"]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes/door_ajar.usda")
    parser.add_argument("--width", type=int, default=128, help="in pixels")
    parser.add_argument("--seeds", type=int, default=8, help="for every length")
    parser.add_argument("--reference-time", type=float, default=60.0, help="processor seconds")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images/convergence.svg")
    options = parser.parse_args()
    rows = measure(options.scene, options.width, options.seeds, options.reference_time)
    slope, error, intercept = fit(rows)
    print(f"slope {slope:.3f} ± {error:.3f}")
    title = f"{options.scene.stem}: error² of mlt"
    options.output.write_text(plot(rows, slope, error, intercept, title), encoding="utf-8")


if __name__ == "__main__":
    main()
