"""Displacement: points moved along the normal by what a material's input says there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdmlt import closures, native
from usdmlt.errors import Report
from usdmlt.scene import Material, Mesh, Primvar, Texture
from usdmlt.stage.networks import is_zero
from usdmlt.stage.normals import area_vectors, smooth_normals


def displaced(
    mesh: Mesh, materials: list[Material], textures: list[Texture], report: Report
) -> Mesh:
    """A mesh in its own space, displaced by its materials; its transform is not looked at.

    Every vertex moves as a whole, by the mean of what its corners say, so that seams of texture
    coordinates do not tear. Normals are made again, apart where they were apart.
    """
    indices = [mesh.materials]
    if isinstance(mesh.materials, np.ndarray):
        indices = np.unique(mesh.materials).tolist()
    used = [i for i in indices if not is_zero(materials[i].displacement)]
    if not used:
        return mesh
    heights = np.zeros(mesh.triangles.shape)
    for index in used:
        own = np.broadcast_to(mesh.materials == index, len(heights))
        heights[own] = _heights(mesh, materials[index], textures)[own]
    if not np.isfinite(heights).all():
        report.warn("displacement that is not finite is left out", mesh.name)
        heights = np.nan_to_num(heights, nan=0.0, posinf=0.0, neginf=0.0)

    vertex = mesh.triangles.ravel()
    corners = np.maximum(np.bincount(vertex, minlength=len(mesh.points)), 1)
    height = np.bincount(vertex, heights.ravel(), minlength=len(mesh.points)) / corners
    points = mesh.points + height[:, None] * _vertex_normals(mesh)
    points = points.astype(np.float32)
    return replace(mesh, points=points, normals=_normals_again(mesh, points))


def _heights(mesh: Mesh, material: Material, textures: list[Texture]) -> np.ndarray:
    """(triangles, 3) values of the displacement input at the corners."""
    if isinstance(material.displacement, (int, float)):
        return np.full(mesh.triangles.shape, float(material.displacement))
    slots = closures.PrimvarSlots()
    probe = Material(None, opacity=material.displacement, name=material.name)
    compiled = closures.compile_material(probe, slots, len(textures))
    local = replace(mesh, transform=np.eye(4), materials=0)
    return native.core().coverage_at_corners(textures, compiled, slots.slots, local)


def _vertex_normals(mesh: Mesh) -> np.ndarray:
    """(n, 3) unit normals: the mean of those of the corners, or of the faces of a flat mesh."""
    if mesh.normals is None:
        return smooth_normals(mesh.points, mesh.triangles).values.astype(np.float64)
    corners = mesh.triangles if mesh.normals.corners is None else mesh.normals.corners
    at_corners = mesh.normals.values[corners.ravel()]
    total = np.zeros(mesh.points.shape)
    for axis in range(3):
        total[:, axis] = np.bincount(mesh.triangles.ravel(), at_corners[:, axis], len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0)


def _normals_again(mesh: Mesh, points: np.ndarray) -> Primvar | None:
    """Smooth normals of the moved points, for the same corners as before; None for flat meshes."""
    if mesh.normals is None:
        return None
    corners = mesh.triangles if mesh.normals.corners is None else mesh.normals.corners
    weighted = np.repeat(area_vectors(points, mesh.triangles), 3, axis=0)
    total = np.zeros(mesh.normals.values.shape)
    for axis in range(3):
        total[:, axis] = np.bincount(corners.ravel(), weighted[:, axis], len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    unit = np.divide(total, length, out=mesh.normals.values.astype(float), where=length > 0)
    return Primvar(unit.astype(np.float32), mesh.normals.corners)
