"""How often mistakes are found: by the test of batches, and by idiff as others use it.

    python tests/benchmarks/check_power.py [PAIRS [ROW…]]

A reference is made by the plugin's default budget, written and read; the changed stage is rendered
as `assert_render` does, and compared. That is done with the reference's random numbers, as a test
does, and with others, as where a change takes them out of step. For idiff the pictures are 8-bit
sRGB ones; its settings are those of most tests of OpenUSD (usdImagingGL: fail 1, failpercent 1),
the default of Arnold's USD plugin (fail 1e-5, failpercent 33.334, hardfail 0.0157) and that of
Blender (fail 0.016, failpercent 1).
"""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade

from usdmlt import views
from usdmlt.rendering import no_warnings
from usdmlt.stage import load
from usdmlt.testing import comparison, references
from usdmlt.testing.batches import Batches, bits_of, render_batches
from usdmlt.testing.checks import as_before
from usdmlt.testing.metrics import Thresholds, difference

SCENES = Path(__file__).parents[2] / "scenes"
WIDTH, SAMPLES = 96, 72
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


def swung(path: str, degrees: float) -> Change:
    """A lamp to the side, about where it points to on the table at y = 0."""

    def change(stage: Usd.Stage) -> None:
        lamp = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        matrix = lamp.GetLocalTransformation()
        place, towards = matrix.ExtractTranslation(), matrix.TransformDir(Gf.Vec3d(0, 0, -1))
        pivot = place - towards * (place[1] / towards[1])
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 1, 0), degrees))
        about = Gf.Matrix4d().SetTranslate(-pivot) * turn * Gf.Matrix4d().SetTranslate(pivot)
        lamp.MakeMatrixXform().Set(matrix * about)

    return change


def ball(radius: float, x: float, y: float, z: float) -> Change:
    """A grey ball more."""

    def change(stage: Usd.Stage) -> None:
        material = stage.DefinePrim("/World/Materials/Ball")
        material.GetReferences().AddInternalReference("/World/Materials/White")
        coloured("Ball", 0.5, 0.5, 0.5)(stage)
        sphere = UsdGeom.Sphere.Define(stage, "/World/Ball")
        sphere.CreateRadiusAttr(radius)
        sphere.AddTranslateOp().Set(Gf.Vec3d(x, y, z))
        UsdShade.MaterialBindingAPI.Apply(sphere.GetPrim()).Bind(UsdShade.Material(material))

    return change


def coloured(material: str, *colour: float) -> Change:
    """A diffuse material of another colour."""
    name = f"/World/Materials/{material}/diffuse.inputs:color"
    return lambda stage: stage.GetAttributeAtPath(name).Set(Gf.Vec3f(*colour))


def camera_shifted(pixels: float) -> Change:
    """The picture further to the right by so much, of WIDTH pixels."""

    def change(stage: Usd.Stage) -> None:
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/main_cam"))
        pixel = camera.GetHorizontalApertureAttr().Get() / WIDTH
        camera.GetHorizontalApertureOffsetAttr().Set(-pixels * pixel)

    return change


def gamma(pictures: np.ndarray) -> np.ndarray:
    """An exponent of 1.02, about that between sRGB's curve and a power of 2.2, of the mean."""
    mean = pictures[..., :3].mean(axis=0)
    factor = np.where(mean > 0, np.maximum(mean, 1e-9) ** 0.02, 1)
    return np.concatenate([pictures[..., :3] * factor, pictures[..., 3:]], axis=-1)


class Case(NamedTuple):
    """A scene, how its stage differs from the reference's, and how its picture does besides."""

    scene: str
    change: Change | None = None
    edit: Callable[[np.ndarray], np.ndarray] | None = None
    both: Change | None = None  # of both stages
    kept: str | None = None  # a prim whose own pixels stay as they are


BLOCK = "/World/ShortBlock"
REDDER = coloured("Ball", 0.55, 0.5, 0.5)
# Either ball has half a per cent of the pixels.
CASES = {
    "nothing": Case("cornell_box"),
    "lights 1 % brighter": Case("cornell_box", lights(1.01)),
    "a ball in the light: red +10 %": Case("cornell_box", REDDER, both=ball(33, 368, 363.5, 351)),
    "a ball in the shade: red +10 %": Case("cornell_box", REDDER, both=ball(27.5, 350, 28, 150)),
    "a lamp swung, its caustics by 2 pixels": Case("caustics", swung("/World/Lights/Lamp", 13)),
    "a block is missing, and its shadow": Case("cornell_box", without(BLOCK)),
    "a shadow is missing": Case("cornell_box", without(BLOCK), kept=BLOCK),
    "gamma 1.02": Case("cornell_box", edit=gamma),
    "camera shifted by half a pixel": Case("cornell_box", camera_shifted(0.5)),
}


def opened(case: Case, changed: bool) -> Usd.Stage:
    """A case's stage, edited in the session layer."""
    stage = Usd.Stage.Open(str(SCENES / f"{case.scene}.usda"))
    stage.SetEditTarget(stage.GetSessionLayer())
    for change in (case.both, case.change if changed else None):
        if change is not None:
            change(stage)
    return stage


@functools.cache
def coverage(case: Case, width: int) -> np.ndarray:
    """(rows, columns, 1): of each pixel the part in which the kept prim is seen, alone."""
    stage = opened(case, changed=False)
    alone = ("/World/Materials", "/World/Lights", "/World/main_cam", case.kept)
    for prim in stage.GetPrimAtPath("/World").GetChildren():
        if str(prim.GetPath()) not in alone:
            prim.SetActive(False)
    picture = render_batches(load(stage, width=width), integrator="path", samples=256)
    return picture["alpha"][..., None]


@functools.lru_cache(maxsize=32)  # of one pair rows share some
def rendered(case: Case, changed: bool, width: int, options: str) -> Batches:
    """Of a case without edits."""
    return render_batches(load(opened(case, changed), width=width), **json.loads(options))


def render(case: Case, *, changed: bool, width: int = WIDTH, **options: Any) -> Batches:
    """A case's picture."""
    given = json.dumps({"samples": SAMPLES} | options)
    plain = Case(case.scene, case.change if changed else None, both=case.both)
    made = rendered(plain, plain.change is not None, width, given)
    pictures = made.pictures
    if changed and case.kept is not None:
        before = rendered(plain._replace(change=None), False, width, given).pictures
        pictures = pictures + coverage(case, width) * (before - pictures)
    if changed and case.edit is not None:
        pictures = case.edit(pictures)
    if pictures is made.pictures:
        return made
    pictures = pictures.astype(np.float32)
    mean = pictures.mean(axis=0)
    channels = made.channels | {"color": mean[..., :3], "alpha": mean[..., 3]}
    return replace(made, channels=channels, pictures=pictures, bits=bits_of(pictures))


@functools.cache
def reference(scene: str, both: Change | None, seed: int) -> Batches:
    """Of the rows that have it in common; as it comes back from its file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "reference.exr"
        references.write(path, render(Case(scene, both=both), changed=False, seed=seed))
        return references.read(path)


def view(picture: Batches) -> np.ndarray:
    """As a PNG has it, 0 to 1."""
    return views.encode(picture["color"]).astype(np.float32) / 255


def found(case: Case, seed: int, stream: int) -> list[bool]:
    """By the test, and by each setting of idiff."""
    before = reference(case.scene, case.both, seed)
    options = as_before(before, update=False)
    after = render(case, changed=True, **options, stream=stream)
    out = [comparison.compare(before, after).different]
    for limits in IDIFF.values():
        out.append(difference(view(after), view(before), limits.fail).exceeds(limits))
    return out


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    print(f"{count} pairs of {WIDTH} pixels across, {SAMPLES} samples per pixel")
    print(f"{'':<40}{'the same random numbers':^36}{'others':^36}")
    print(f"{'':<40}" + 2 * "".join(f"{name:>9}" for name in ("test", *IDIFF)), flush=True)
    names = sys.argv[2:] or list(CASES)
    with no_warnings():
        seen = np.array(
            [
                [found(CASES[name], seed, 0) + found(CASES[name], seed, 1) for name in names]
                for seed in range(count)
            ]
        )
    for name, rates in zip(names, seen.mean(axis=0), strict=True):
        print(f"{name:<40}" + "".join(f"{x:>9.0%}" for x in rates))


if __name__ == "__main__":
    main()
