"""How often mistakes are found: by the test of batches, and by idiff as others use it.

    python tests/benchmarks/check_power.py [PAIRS]

Every pair is a reference and a changed picture by independent random numbers, with the plugin's
default budget. For idiff they are 8-bit sRGB pictures; its settings are those of most tests of
OpenUSD (usdImagingGL: fail 1, failpercent 1), the default of Arnold's USD plugin (fail 1e-5,
failpercent 33.334, hardfail 0.0157) and that of Blender (fail 0.016, failpercent 1).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pxr import Usd

from usdmlt import color
from usdmlt.equal_time import no_warnings
from usdmlt.stage import load
from usdmlt.testing.batches import render_batches
from usdmlt.testing.metrics import Thresholds, difference
from usdmlt.testing.statistics import compare_batches

SCENES = Path(__file__).parents[2] / "scenes"
WIDTH, SAMPLES = 128, 72
IDIFF = {
    "OpenUSD": Thresholds(fail=1, failpercent=1),
    "Arnold": Thresholds(fail=1e-5, failpercent=33.334, hardfail=0.0157),
    "Blender": Thresholds(fail=0.016, failpercent=1),
}
Change = Callable[[Usd.Stage], None]


def lights(factor: float) -> Change:
    """All lights brighter by a factor."""

    def change(stage: Usd.Stage) -> None:
        for prim in stage.Traverse():
            attribute = prim.GetAttribute("inputs:intensity")
            if attribute:
                attribute.Set((attribute.Get() or 1.0) * factor)

    return change


def without(path: str) -> Change:
    """A prim less."""
    return lambda stage: stage.GetPrimAtPath(path).SetActive(False)


def colour_of_a_patch(pictures: np.ndarray) -> np.ndarray:
    """Ten per cent more red in half a per cent of the pixels."""
    out = pictures.copy()
    side = round(np.sqrt(0.005 * out.shape[1] * out.shape[2]))
    y, x = out.shape[1] * 2 // 3, out.shape[2] // 2
    out[:, y : y + side, x : x + side, 0] *= 1.1
    return out


def gamma(pictures: np.ndarray) -> np.ndarray:
    """An exponent of 1.02, about that between sRGB's curve and a power of 2.2, of the mean."""
    mean = pictures[..., :3].mean(axis=0)
    factor = np.where(mean > 0, np.maximum(mean, 1e-9) ** 0.02, 1)
    return np.concatenate([pictures[..., :3] * factor, pictures[..., 3:]], axis=-1)


def half_a_pixel(pictures: np.ndarray) -> np.ndarray:
    """To the right."""
    return (pictures + np.roll(pictures, 1, axis=2)) / 2


def moved_caustic(pictures: np.ndarray) -> np.ndarray:
    """The middle of the floor, two pixels to the right."""
    out = pictures.copy()
    rows, columns = out.shape[1:3]
    place = np.s_[:, rows // 2 : rows, columns // 4 : 3 * columns // 4]
    out[place] = np.roll(pictures, 2, axis=2)[place]
    return out


# Name: scene, change of the stage, change of the batches.
CHANGES = {
    "nothing": ("cornell_box", None, None),
    "lights 1 % brighter": ("cornell_box", lights(1.01), None),
    "red +10 % in 0.5 % of pixels": ("cornell_box", None, colour_of_a_patch),
    "caustic moved by 2 pixels": ("caustics", None, moved_caustic),
    "a block is missing, and its shadow": ("cornell_box", without("/World/ShortBlock"), None),
    "gamma 1.02": ("cornell_box", None, gamma),
    "shift by half a pixel": ("cornell_box", None, half_a_pixel),
}


def pictures(name: str, change: Change | None, stream: int) -> np.ndarray:
    """Batches of a scene, changed in the session layer."""
    stage = Usd.Stage.Open(str(SCENES / f"{name}.usda"))
    stage.SetEditTarget(stage.GetSessionLayer())
    if change is not None:
        change(stage)
    scene = load(stage, width=WIDTH)
    return render_batches(scene, integrator="path", samples=SAMPLES, stream=stream).pictures


def view(batches: np.ndarray) -> np.ndarray:
    """The mean as a PNG has it, 0 to 1."""
    return color.srgb_view(batches.mean(axis=0)[..., :3]).astype(np.float32) / 255


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(f"{count} pairs of {WIDTH} pixels across, {SAMPLES} samples per pixel, by path tracing")
    print(f"{'':<32}{'test':>8}" + "".join(f"{name:>10}" for name in IDIFF), flush=True)
    with no_warnings():
        for name, (scene, change, edit) in CHANGES.items():
            found = dict.fromkeys(("test", *IDIFF), 0)
            for pair in range(count):
                a = pictures(scene, None, 2 * pair)
                b = pictures(scene, change, 2 * pair + 1)
                b = b if edit is None else edit(b).astype(np.float32)
                found["test"] += compare_batches(a, b).different
                for tool, limits in IDIFF.items():
                    seen = difference(view(b), view(a), limits.fail)
                    found[tool] += seen.exceeds(limits)
            rates = [f"{n / count:.0%}" for n in found.values()]
            print(f"{name:<32}{rates[0]:>8}" + "".join(f"{r:>10}" for r in rates[1:]), flush=True)


if __name__ == "__main__":
    main()
