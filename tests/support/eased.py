"""The scenes that ship, some with changes that make their light easier to find.

Path tracing finds some of these lights once in thousands of samples or less: where it has to run
into a small light through glass or water, and where next-event estimation aims at lights behind
walls. Then a quick comparison would be one of luck, so it is made with a larger light or hole, all
else being equal.
"""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

FOLDER = Path(__file__).parents[2] / "scenes"

EASED: dict[str, dict[str, float | bool]] = {
    "cornell_box": {},
    "caustics": {"/World/Lights/Lamp.inputs:radius": 5.0},
    "door_ajar": {},
    "gallery": {},
    "keyhole": {  # a large lamp that can be aimed at, and no door
        "/World/Bulb": False,
        "/World/Door": False,
        "/World/Lights/Lamp.inputs:radius": 0.4,
        "/World/Lights/Lamp.inputs:intensity": 1.0,
    },
    "pool": {"/World/Lights/Sun.inputs:angle": 20.0},
    "small_aperture": {"/World/Shutter/Left": False},  # a slit instead of a hole
    "snow_globe": {"/World/Lights/Lamp.inputs:radius": 6.0},
}


def open_scene(name: str, changes: dict | None = None, boxes: tuple = ()) -> Usd.Stage:
    """Open a scene by name.

    ``changes``: values of attributes by their path; False by a prim's path leaves the prim out.
    ``boxes``: (centre, size) of boxes to add.
    """
    stage = Usd.Stage.Open(str(FOLDER / f"{name}.usda"))
    stage.SetEditTarget(stage.GetSessionLayer())
    for key, value in (changes or {}).items():
        path = Sdf.Path(key)
        if path.IsPropertyPath():
            attribute = stage.GetAttributeAtPath(path)
            assert attribute, f"{name} has no {path}"
            attribute.Set(value)
        else:
            assert stage.GetPrimAtPath(path), f"{name} has no {path}"
            stage.GetPrimAtPath(path).SetActive(value)
    for number, (centre, size) in enumerate(boxes):
        box = UsdGeom.Cube.Define(stage, f"/World/Box{number}")
        box.CreateSizeAttr(1.0)
        box.AddTranslateOp().Set(centre)
        box.AddScaleOp().Set(size)
    return stage
