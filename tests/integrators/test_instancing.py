"""Instances are the same as their meshes placed one by one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from support import scenes
from support.rendering import BOTH, build, pictures
from support.statistics import agreement
from usdmlt import scene as s


def expanded(scene: s.Scene) -> s.Scene:
    meshes = list(scene.meshes)
    for group in scene.instances:
        for m in group.transforms:
            meshes += [
                dataclasses.replace(mesh, transform=mesh.transform @ m)
                for mesh in scene.prototypes[group.prototype].meshes
            ]
    return dataclasses.replace(scene, meshes=meshes, prototypes=[], instances=[])


def test_rays_meet_the_same_surfaces() -> None:
    """Distances and normals of rays in all directions, from around and from among the instances."""
    scene = scenes.build("instances")
    rng = np.random.default_rng(11)
    origins = rng.uniform((-2.5, 0.1, -2), (2.5, 3, 2), (20000, 3))
    directions = rng.normal(size=(20000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    one, other = (build(x).intersect(origins, directions) for x in (scene, expanded(scene)))
    # A ray along an edge may pass on one side or on the other.
    same = np.isclose(one["distance"], other["distance"], rtol=1e-4, atol=1e-5)
    assert np.isfinite(one["distance"]).mean() > 0.3
    assert same.mean() > 0.9995
    # Both sides of a surface are seen: the normal is that of the outside.
    hit = same & np.isfinite(one["distance"])
    turned = (one["normal"][hit] * other["normal"][hit]).sum(1)
    assert (turned > 0.999).mean() > 0.9995
    assert (one["instance"][hit] >= 0).any()
    assert (other["instance"] == -1).all()


@pytest.mark.parametrize("integrator", BOTH)
def test_the_same_picture(integrator: str) -> None:
    """Sees normals and areas that take a transform wrongly, and lamps that are lost or doubled.

    Welch's t-tests between 24 independent seeds, significance 10⁻³.
    """
    scene = scenes.build("instances")
    one = pictures(scene, integrator, 24, samples=24, depth=4)
    other = pictures(expanded(scene), integrator, range(100, 124), samples=24, depth=4)
    agreement(one, other).require(resolution=0.01)
