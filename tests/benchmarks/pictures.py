"""The README's pictures: four scenes by three integrators in the same processor time.

    python tests/benchmarks/pictures.py [--seconds S] [--width W] [--output FILE]

Rows are scenes, columns integrators; plain sRGB views, as the scenes are exposed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from usdmlt import equal_time, views
from usdmlt.stage import load

ROOT = Path(__file__).parents[2]
SCENES = ("door_ajar", "caustics", "pool", "small_aperture")
INTEGRATORS = {
    "path": "path tracing",
    "bdpt": "bidirectional path tracing",
    "mlt": "Metropolis light transport",
}
DEPTH = 12
LABEL = 22  # pixels, of the strip below a picture
MARGIN = 4


def row_of_pictures(name: str, seconds: float, width: int) -> np.ndarray:
    """Labelled sRGB pictures of a scene side by side, uint8."""
    scene = load(str(ROOT / f"scenes/{name}.usda"), width=width)
    cells = []
    for integrator, label in INTEGRATORS.items():
        samples = equal_time.samples_for(scene, integrator, seconds, DEPTH)
        timed = equal_time.render(scene, integrator, samples, DEPTH, seed=0)
        if timed.seconds < 0.9 * seconds:  # plans of chains differ between seeds
            samples = round(samples * seconds / timed.seconds)
            timed = equal_time.render(scene, integrator, samples, DEPTH, seed=0)
        print(f"{name}, {integrator}: {samples} per pixel, {timed.seconds:.1f} s", flush=True)
        view = views.encode(timed.picture.astype(np.float32))
        cells.append(np.concatenate([view, text(f"{label}, {seconds:g} s", width)]))
        cells.append(np.full((len(cells[0]), MARGIN, 3), 255, np.uint8))
    return np.concatenate(cells[:-1], axis=1)


def text(line: str, width: int) -> np.ndarray:
    """Black on white."""
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, LABEL, 3, "uint8"))
    oiio.ImageBufAlgo.fill(buffer, (1.0, 1.0, 1.0))
    oiio.ImageBufAlgo.render_text(buffer, 2, LABEL - 7, line, 13, "", (0.2, 0.2, 0.2))
    return buffer.get_pixels(oiio.UINT8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of processor time, each")
    parser.add_argument("--width", type=int, default=320, help="of a picture, in pixels")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images/equal_time.jpg")
    arguments = parser.parse_args()
    rows = [row_of_pictures(name, arguments.seconds, arguments.width) for name in SCENES]
    montage = np.ascontiguousarray(np.concatenate(rows))
    spec = oiio.ImageSpec(montage.shape[1], montage.shape[0], 3, "uint8")
    spec.attribute("Compression", "jpeg:88")
    buffer = oiio.ImageBuf(spec)
    buffer.set_pixels(oiio.ROI.All, montage)
    if not buffer.write(str(arguments.output)):
        raise SystemExit(buffer.geterror())


if __name__ == "__main__":
    main()
