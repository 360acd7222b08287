"""UsdSkel: blend shapes and skinned points and normals, at one time."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdSkel, Vt

from usdmlt.scene import Primvar
from usdmlt.stage.primvars import Spreads


class Skinning:
    """Knows the skeletons of the skeleton roots met so far, and whether anything was skinned."""

    def __init__(self, time: Usd.TimeCode):
        self.time = time
        self.has_skins = False
        self._cache = UsdSkel.Cache()
        self._roots: list[Usd.Prim] = []

    def at(self, time: Usd.TimeCode) -> Skinning:
        """The same skeletons at another time."""
        other = Skinning(time)
        other._cache, other._roots = self._cache, self._roots
        return other

    def may_deform(self, prim: Usd.Prim) -> bool:
        """Whether a skeleton moves the points of a prim, or may."""
        return bool(self._cache.GetSkinningQuery(prim))

    def add_root(self, prim: Usd.Prim) -> None:
        """Learn of the skeletons and skinned prims below a SkelRoot."""
        self._roots.append(prim)
        self._cache.Populate(UsdSkel.Root(prim), Usd.TraverseInstanceProxies())

    def skin(self, prim: Usd.Prim, points: np.ndarray) -> tuple[np.ndarray, Skin | None]:
        """The deformed points, (n, 3) float32, and the skin; None if there are no joints."""
        query = self._cache.GetSkinningQuery(prim) if self._roots else None
        if not query:
            return points, None
        skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
        skeleton_query = skeleton and self._cache.GetSkelQuery(skeleton)
        if not skeleton_query:
            return points, None
        deformed = Vt.Vec3fArray.FromNumpy(points)
        if query.HasBlendShapes():
            self._blend(prim, query, skeleton_query, deformed)
        skin = None
        if query.HasJointInfluences():
            transforms = skeleton_query.ComputeSkinningTransforms(self.time)
            if query.ComputeSkinnedPoints(transforms, deformed, self.time):
                self.has_skins = True
                skin = Skin(skeleton.GetPrim(), query, transforms, self.time)
        return np.array(deformed, dtype=np.float32), skin

    def _blend(self, prim, query, skeleton_query, points: Vt.Vec3fArray) -> None:
        animation = skeleton_query.GetAnimQuery()
        if not animation:
            return
        weights = animation.ComputeBlendShapeWeights(self.time)
        mapper = query.GetBlendShapeMapper()
        if mapper is not None and not mapper.IsNull():
            weights = mapper.Remap(weights)
        shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
        sub_weights, shape_indices, sub_indices = shapes.ComputeSubShapeWeights(weights)
        shapes.ComputeDeformedPoints(
            sub_weights,
            shape_indices,
            sub_indices,
            shapes.ComputeBlendShapePointIndices(),
            shapes.ComputeSubShapePointOffsets(),
            points,
        )


class Skin:
    """How one mesh is skinned: its points are in the space of ``skeleton``."""

    def __init__(self, skeleton: Usd.Prim, query, transforms, time: Usd.TimeCode):
        self.skeleton = skeleton
        self._query = query
        self._transforms = transforms
        self._time = time

    def primvar(self, normals: Primvar, topology: Spreads) -> Primvar:
        """Unit normals of a polygon mesh, skinned: one for every corner of every triangle."""
        corners = topology.vertices if normals.corners is None else normals.corners
        skinned = self.normals(
            normals.values[corners.ravel()], topology.vertices.ravel(), topology.point_count
        )
        order = np.arange(corners.size, dtype=np.int32).reshape(-1, 3)
        return Primvar(skinned, order)

    def normals(self, normals: np.ndarray, vertices: np.ndarray, point_count: int) -> np.ndarray:
        """(count, 3) normals of the points ``vertices`` (count,), skinned.

        Linear blending of the joints' inverse transposes, as UsdSkel skins normals.
        """
        indices, weights = self._query.ComputeVaryingJointInfluences(point_count, self._time)
        per_point = self._query.GetNumInfluencesPerComponent()
        indices = np.asarray(indices).reshape(point_count, per_point)[vertices]
        weights = np.asarray(weights).reshape(point_count, per_point)[vertices]
        mapper, transforms = self._query.GetJointMapper(), self._transforms
        if mapper is not None and not mapper.IsNull():
            transforms = mapper.RemapTransforms(transforms)
        joints = np.linalg.inv(np.array(transforms, dtype=np.float64)[:, :3, :3]).transpose(0, 2, 1)
        bind = np.array(self._query.GetGeomBindTransform(self._time))[:3, :3]
        at_bind = normals.astype(np.float64) @ np.linalg.inv(bind).T
        skinned = np.zeros_like(at_bind)
        for influence in range(per_point):
            moved = np.einsum("ni,nij->nj", at_bind, joints[indices[:, influence]])
            skinned += weights[:, influence, None] * moved
        return skinned.astype(np.float32)
