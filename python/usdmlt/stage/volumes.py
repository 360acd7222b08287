"""UsdVol volumes: fields of density and temperature as media, in boxes without a surface.

The medium is that of the volume output of the material that is bound, whose coefficients are of
density 1; without a material, scattering alone, of coefficient 1. What glows does so by its
temperature: a blackbody's radiance by Planck's law, per scene unit of density 1, scaled to the
luminance ``usdmlt:emission`` at 2000 kelvin.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pxr import Usd, UsdGeom, UsdShade, UsdVol

from usdmlt.errors import Error, Report
from usdmlt.media import blackbody_emission, check_grid
from usdmlt.scene import Grid, Medium, Mesh, Volume
from usdmlt.stage.bodies import priority
from usdmlt.stage.color import ColorSpaces
from usdmlt.stage.fields import Field, extent, read_field
from usdmlt.stage.gprims import cube
from usdmlt.stage.materials import Materials, bound_materials
from usdmlt.stage.motion import settled
from usdmlt.stage.numbers import finite_number
from usdmlt.stage.transforms import singular
from usdmlt.stage.traversal import Group, Placed

DENSITY, TEMPERATURE = "density", "temperature"
EMISSION, SCALE = "usdmlt:emission", "usdmlt:temperatureScale"
STILL = "volumes of fields stand still while the shutter is open"


class VolumeReader:
    """Reads the volumes of groups; ``materials`` takes their media."""

    def __init__(
        self,
        time: Usd.TimeCode,
        colors: ColorSpaces,
        materials: Materials,
        material_purpose: str,
        report: Report,
    ):
        self.time = time
        self.colors = colors
        self.materials = materials
        self.material_purpose = material_purpose
        self.report = report
        self._xforms = UsdGeom.XformCache(time)

    def read(self, group: Group) -> list[Mesh]:
        """The boxes of a group's volumes, in its space, each filled with its medium."""
        prims = [placed.prim for placed in group.volumes]
        bound = bound_materials(prims, self.material_purpose, self.report)
        read = (self._read_one(group, *item) for item in zip(group.volumes, bound, strict=True))
        return [mesh for mesh in read if mesh is not None]

    def _read_one(
        self, group: Group, placed: Placed, material: UsdShade.Material | None
    ) -> Mesh | None:
        prim = placed.prim
        path = prim.GetPath()
        fields = UsdVol.Volume(prim).GetFieldPaths()
        unread = sorted(str(name) for name in set(fields) - {DENSITY, TEMPERATURE})
        if unread:
            self.report.warn(f"fields other than density are left out: {', '.join(unread)}", path)
        if DENSITY not in fields:
            self.report.warn("volumes without a field of density are not rendered", path)
            return None
        source, density = self._field(prim, fields, DENSITY)
        if density is None:
            return None
        box, transform = density.box, density.transform @ self._to_group(source, group)
        if box is None:
            box, transform = extent(prim, self.time), placed.matrix
        if box is None:
            self.report.warn("volumes without an extent are not rendered", path)
            return None
        if singular(transform):
            raise Error(f"{path}: the transform is singular")
        if placed.motion is not None:
            self.report.warn(STILL, path)
        grid = Grid(_floats(density.values), *box, transform)
        self._check(grid, source)
        self._heat(grid, density, prim, fields)
        lower, upper = np.array(box)
        around = cube(1.0)  # about the origin
        return Mesh(
            (lower + (around.points + 0.5) * (upper - lower)).astype(np.float32),
            around.triangles,
            transform=transform,
            name=str(path),
            medium=self.materials.add_medium(self._medium(prim, material, grid)),
            medium_priority=priority(prim),
        )

    def _field(self, prim: Usd.Prim, fields: dict, name: str) -> tuple[Usd.Prim, Field | None]:
        source = prim.GetStage().GetPrimAtPath(fields[name])
        if not source:
            self.report.warn("fields of volumes are missing", f"{prim.GetPath()} ({fields[name]})")
            return source, None
        return source, read_field(source, name, self.time, self.report)

    def _to_group(self, prim: Usd.Prim, group: Group) -> np.ndarray:
        to_world = self._xforms.GetLocalToWorldTransform(prim)
        return np.array(to_world * group.from_world, dtype=np.float64)

    def _check(self, grid: Grid, source: Usd.Prim) -> None:
        try:
            check_grid(grid)
        except ValueError as reason:
            raise Error(f"{source.GetPath()}: {reason}") from None

    def _medium(self, prim: Usd.Prim, material: UsdShade.Material | None, grid: Grid) -> Medium:
        medium = self.materials.volume(material, DENSITY) if material is not None else None
        if medium is None:
            medium = Medium(scattering=(1.0, 1.0, 1.0), name=str(prim.GetPath()))
        return replace(medium, grid=grid)

    def _heat(self, grid: Grid, density: Field, prim: Usd.Prim, fields: dict) -> None:
        """The emission of a grid, from the field of its temperature."""
        if TEMPERATURE not in fields:
            return
        source, temperature = self._field(prim, fields, TEMPERATURE)
        if temperature is None:
            return
        try:
            kelvin = _floats(temperature.like(density).values)
        except ValueError as reason:
            raise Error(f"{source.GetPath()}: {reason}") from None
        if kelvin.shape != grid.values.shape:
            raise Error(
                f"{source.GetPath()}: the temperature is {kelvin.shape}, which does not fit the "
                f"density, {grid.values.shape}"
            )
        self._check(replace(grid, values=kelvin), source)
        strength, scale = self._number(prim, EMISSION), self._number(prim, SCALE)
        glow = blackbody_emission(scale * kelvin, self.colors.rendering)
        emission = (strength * glow * grid.values[..., None]).astype(np.float32)
        if emission.any():
            grid.emission = emission
            self._check(grid, source)

    def _number(self, prim: Usd.Prim, name: str) -> float:
        """An attribute of at least 0; 1 where it is not authored."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get(self.time) if attribute and attribute.HasAuthoredValue() else 1.0
        number = finite_number(prim, name, value)
        if number < 0:
            raise Error(f"{prim.GetPath()}: {name} is {number:g}; it must be at least 0")
        return number


def place(
    mesh: Mesh,
    transforms: np.ndarray,
    motion: np.ndarray | None,
    media: list[Medium],
    report: Report,
) -> list[Volume]:
    """A body without a surface in each of the placements of its group.

    Grids are placed with their boxes, each a medium of its own; they stand still.
    """
    volumes = []
    medium = media[mesh.medium]
    if motion is not None and medium.grid is not None:
        report.warn(STILL, mesh.name)
    for index, transform in enumerate(transforms):
        own = None if motion is None or medium.grid is not None else motion[:, index]
        placed = settled(mesh, transform, own)
        number = mesh.medium
        if medium.grid is not None and not np.array_equal(transform, np.eye(4)):
            grid = replace(medium.grid, transform=medium.grid.transform @ transform)
            media.append(replace(medium, grid=grid))
            number = len(media) - 1
        volumes.append(
            Volume(
                placed.points,
                placed.triangles,
                number,
                placed.transform,
                placed.name,
                placed.motion,
                placed.medium_priority,
            )
        )
    return volumes


def _floats(values: np.ndarray) -> np.ndarray:
    """As float32 where they are numbers at all."""
    return values.astype(np.float32) if values.dtype.kind in "fiu" else values
