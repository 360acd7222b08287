"""Meshes that change their shape while the shutter is open: points, velocities, joints, sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pxr import Gf, Usd, UsdGeom

from usdmlt.errors import Report
from usdmlt.scene import Mesh, MeshStep, Primvar
from usdmlt.stage import tessellated
from usdmlt.stage.attributes import Attributes
from usdmlt.stage.detail import SteadyDetail
from usdmlt.stage.gprims import read_gprim
from usdmlt.stage.motion import Shutter, every, fewest_steps, straight
from usdmlt.stage.normals import authored_normals, normals_at_corners
from usdmlt.stage.primvars import Spreads, Topology, as_floats
from usdmlt.stage.skinning import Skin, Skinning
from usdmlt.stage.subdivided import Subdivided
from usdmlt.stage.transforms import singular
from usdmlt.stage.traversal import Group, Placed

# Attributes that do not change a shape, by how their names begin; widths and normals do.
SHAPELESS = ("xformOp", "visibility", "purpose", "primvars:", "extent", "material:")
SHAPING = ("primvars:widths", "primvars:normals")


class Deformation:
    """Reads the shapes of gprims at the times of a shutter."""

    def __init__(self, shutter: Shutter, skinning: Skinning, report: Report):
        self.shutter = shutter
        self.report = report
        self._skinning = [skinning.at(code) for code in shutter.codes]
        self._xforms = [UsdGeom.XformCache(code) for code in shutter.codes]

    def moving(
        self,
        group: Group,
        placed: Placed,
        mesh: Mesh,
        topology: Spreads,
        skin: Skin | None,
        detail: SteadyDetail,
        displace: Callable[[Mesh], Mesh],
    ) -> Mesh:
        """A mesh, displaced, with its motion in its group: the opening first; empty if it stays.

        ``mesh``, ``topology``: as they are at the frame, before they are displaced.
        """
        still = displace(mesh)
        deforms = skin is not None or self._deforms(placed.prim)
        if placed.motion is None and not deforms:
            return still
        transforms = self._transforms(group, placed, mesh, skin)
        count = fewest_steps(transforms)
        if singular(transforms).any():
            self.report.warn(
                "motion through transforms that are singular is not rendered", mesh.name
            )
            return still
        shapes: list[Mesh] = []
        if deforms:
            shapes = self._shapes(placed, mesh, topology, detail, displace, count)
        count = max(count, len(shapes) - 1)
        if not count:
            return still
        shapes = shapes or [still] * (count + 1)
        motion = [
            MeshStep(shape.points, None if shape.normals is None else shape.normals.values, matrix)
            for shape, matrix in zip(shapes, every(transforms, count), strict=True)
        ]
        return replace(still, normals=shapes[0].normals, motion=motion)

    def _transforms(
        self, group: Group, placed: Placed, mesh: Mesh, skin: Skin | None
    ) -> np.ndarray:
        """(times, 4, 4) to the space of the group; skinned points are in that of the skeleton."""
        if skin is not None:
            return np.array(
                [
                    np.array(cache.GetLocalToWorldTransform(skin.skeleton) * group.from_world)
                    for cache in self._xforms
                ]
            )
        if placed.motion is not None:
            return placed.motion
        return np.repeat(mesh.transform[None], len(self.shutter.times), axis=0)

    def _deforms(self, prim: Usd.Prim) -> bool:
        """Whether attributes of a gprim may change its shape over time."""
        if self._skinning[0].may_deform(prim):
            return True
        for attribute in prim.GetAuthoredAttributes():
            name = attribute.GetName()
            if name in ("velocities", "accelerations"):
                return True
            if name.startswith(SHAPELESS) and not name.startswith(SHAPING):
                continue
            if attribute.ValueMightBeTimeVarying():
                return True
        return False

    def _shapes(
        self,
        placed: Placed,
        mesh: Mesh,
        topology: Spreads,
        detail: SteadyDetail,
        displace: Callable[[Mesh], Mesh],
        count: int,
    ) -> list[Mesh]:
        """The shapes at as few times as needed, at least ``count`` + 1; empty if they are all the
        same, or, with a warning, not of the same triangles."""
        last = len(self.shutter.times) - 1
        count = max(count, self._samples(placed.prim, last))
        found: dict[int, Mesh] = {}
        while True:
            finer = min(2 * count, last)
            for index in range(0, last + 1, last // finer):
                if index in found:
                    continue
                shape = self._shape(placed, mesh, topology, detail, index)
                if shape is None:
                    self.report.warn(
                        "motion that changes the number of points or faces is not rendered",
                        mesh.name,
                    )
                    return []
                found[index] = displace(shape)
            if count == last:
                break
            values = np.array([found[i].points for i in range(0, last + 1, last // finer)])
            if straight(values.astype(np.float64), count):
                break
            count = finer
        shapes = [found[i] for i in range(0, last + 1, last // count)]
        if all(np.array_equal(shape.points, shapes[0].points) for shape in shapes[1:]):
            if not isinstance(topology, (Topology, Subdivided)):
                self._warn_of_velocities(placed.prim)
            return []
        return _alike(shapes)

    def _warn_of_velocities(self, prim: Usd.Prim) -> None:
        velocities = prim.GetAttribute("velocities")
        if velocities and velocities.HasAuthoredValue():
            self.report.warn("velocities of curves and patches are not rendered", prim.GetPath())

    def _samples(self, prim: Usd.Prim, last: int) -> int:
        """Steps enough for the samples that are authored while the shutter is open."""
        times = self.shutter.times
        inside = Gf.Interval(float(times[0]), float(times[-1]), False, False)
        points = prim.GetAttribute("points")
        samples = len(points.GetTimeSamplesInInterval(inside)) if points else 0
        count = 1
        while count < min(samples + 1, last):
            count *= 2
        return count

    def _shape(
        self, placed: Placed, mesh: Mesh, topology: Spreads, detail: SteadyDetail, index: int
    ) -> Mesh | None:
        prim, time = placed.prim, self.shutter.codes[index]
        if placed.kind == "Mesh" or prim.IsA(UsdGeom.Mesh):
            return self._polygons(prim, mesh, topology, index)
        if placed.kind in tessellated.READERS:
            detail.again()
            read = tessellated.READERS[placed.kind](prim, time, detail, Report())
        else:
            read = read_gprim(Attributes(prim, time), placed.kind, Report())
        if read is None or not np.array_equal(read[0].triangles, mesh.triangles):
            return None
        return replace(mesh, points=read[0].points, normals=read[0].normals)

    def _polygons(self, prim: Usd.Prim, mesh: Mesh, topology: Spreads, index: int) -> Mesh | None:
        """The same triangles of other points."""
        time, schema = self.shutter.codes[index], UsdGeom.Mesh(prim)
        points = as_floats(schema.ComputePointsAtTime(time, self.shutter.frame))
        if points is None or points.shape != (topology.point_count, 3):
            return None
        if not np.isfinite(points).all():
            return None
        points, skin = self._skinning[index].skin(prim, points)
        if isinstance(topology, Subdivided):
            refined, limit = topology.smooth(points)
            return replace(
                mesh,
                points=limit.astype(np.float32),
                normals=topology.normals(refined, limit),
            )
        if mesh.normals is None:
            return replace(mesh, points=points)
        authored = authored_normals(Attributes(prim, time), topology, Report())
        normals = authored and normals_at_corners(*authored, topology, points)
        if normals is None:
            return None
        if skin is not None:
            normals = skin.primvar(normals, topology)
        return replace(mesh, points=points, normals=normals)


def _alike(shapes: list[Mesh]) -> list[Mesh]:
    """Shapes whose normals have the same corners: where they have not, one each for every corner
    of every triangle."""
    normals = [shape.normals for shape in shapes]
    first = normals[0]
    if any(n is None for n in normals):
        return [replace(shape, normals=None) for shape in shapes]
    if all(
        n.values.shape == first.values.shape
        and (n.corners is first.corners or np.array_equal(n.corners, first.corners))
        for n in normals
    ):
        return shapes
    result = []
    for shape in shapes:
        n = shape.normals
        corners = shape.triangles if n.corners is None else n.corners
        order = np.arange(corners.size, dtype=np.int32).reshape(-1, 3)
        result.append(replace(shape, normals=Primvar(n.values[corners.ravel()], order)))
    return result
