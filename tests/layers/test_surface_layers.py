"""Layers of what the camera sees: positions, normals, depths, ids, motion, albedo, coverage.

Against analytic values on simple shapes, against the picture's own matrices in all small scenes,
and against pictures: of albedos by a furnace, of coverages by ids at a higher resolution.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import usdmlt
from support import scenes
from support.rendering import build
from support.shapes import box, floor, orthographic, perspective, quad, scale, sphere, translate
from usdmlt import scene as s
from usdmlt.cryptomatte import identifier
from usdmlt.native import core

GREY = s.Material(s.Diffuse((0.5, 0.5, 0.5)))


def layers_of(scene: s.Scene, *asked: str, **settings) -> usdmlt.Image:
    settings = {"integrator": "path", "samples": 1, "filter": "box", **settings}
    return usdmlt.render(scene, aovs=asked, **settings)


def transformed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """By USD's and EXR's row-vector matrices, divided by w."""
    homogeneous = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ matrix
    return homogeneous[..., :3] / homogeneous[..., 3:]


@pytest.mark.parametrize("name", scenes.SCENES)
def test_positions_land_on_their_own_pixels(name):
    """By worldToNDC; worldToCamera gives the depth; normals look at the camera."""
    scene = scenes.build(name)
    image = layers_of(scene, "P", "Z", "N", "Ng")
    seen = np.isfinite(image["Z"])
    assert seen.any()
    size = np.array([image.width, image.height])
    y, x = np.mgrid[: image.height, : image.width]
    centres = np.stack([x, y], axis=-1)[seen] + 0.5
    position = image["P"][seen].astype(np.float64)
    landed = transformed(position, image.metadata["worldToNDC"])[..., :2] * size
    np.testing.assert_allclose(landed, centres, atol=2e-3)
    in_camera = transformed(position, image.metadata["worldToCamera"])
    np.testing.assert_allclose(in_camera[:, 2], image["Z"][seen], rtol=1e-4, atol=1e-4)
    for normal in (image["N"][seen], image["Ng"][seen]):
        np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, atol=1e-5)
    eye = scene.camera.transform[3, :3]
    to_eye = eye - position if scene.camera.projection == "perspective" else None
    if to_eye is not None:
        assert (np.sum(image["Ng"][seen] * to_eye, axis=-1) > -1e-4).all()
    assert not image["P"][~seen].any() and not image["N"][~seen].any()


def test_a_window_of_the_picture_has_the_positions_of_the_whole(tmp_path):
    stage = tmp_path / "stage.usda"
    stage.write_text(
        '#usda 1.0\ndef Cube "cube" {}\n'
        'def Camera "c" {\ndouble3 xformOp:translate = (0.3, 0.2, 9)\n'
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    options = {"width": 40, "samples": 1, "aovs": ["P", "Z", "objectId"], "integrator": "path"}
    whole = usdmlt.render(str(stage), **options)
    part = usdmlt.render(str(stage), crop=(0.25, 0.25, 0.75, 0.75), **options)
    window = part.metadata["data_window"]
    rows = slice(window["y"], window["y"] + part.height)
    columns = slice(window["x"], window["x"] + part.width)
    assert np.isfinite(part["Z"]).any()
    for name in ("P", "Z", "objectId"):
        np.testing.assert_allclose(part[name], whole[name][rows, columns], rtol=1e-5, atol=1e-5)


def test_a_plane_has_its_normal_depth_and_coordinates():
    """Tilted, and mirrored by its transform, which turns its triangles over."""
    st = s.Primvar(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32))
    for mirror in (1.0, -1.0):
        plane = quad((-2 * mirror, -1, 0.5), (4 * mirror, 0, 0), (0, 2, -1.0))
        plane.primvars = {"st": st, "tint": s.Primvar(np.array([[2.0]] * 4, np.float32))}
        plane.transform = scale(mirror, 1, 1)
        scene = s.Scene(perspective((0, 0, 6), (0, 0, 0), 30), 32, 16, [plane], materials=[GREY])
        image = layers_of(scene, "N", "Ng", "P", "Z", "uv", "primvars:tint")
        seen = np.isfinite(image["Z"])
        assert 0.2 < seen.mean() < 0.9
        normal = np.array([0, 1, 2]) / np.sqrt(5)
        for name in ("N", "Ng"):
            np.testing.assert_allclose(
                image[name][seen], np.tile(normal, (seen.sum(), 1)), atol=1e-5
            )
        x, y, z = image["P"][seen].T
        np.testing.assert_allclose(z, -y / 2, atol=1e-5)
        np.testing.assert_allclose(image["Z"][seen], 6 - z, atol=1e-5)
        np.testing.assert_allclose(
            image["uv"][seen], np.stack([x / 4 + 0.5, y / 2 + 0.5], -1), atol=1e-5
        )
        np.testing.assert_allclose(image["primvars:tint"][seen], 2, rtol=1e-6)
        for name in ("N", "P", "uv", "primvars:tint"):
            assert not image[name][~seen].any()


def test_a_sphere_has_the_normals_of_a_sphere_from_inside_too():
    ball = sphere(1.0, 0, rings=64, smooth=True)
    scene = s.Scene(perspective((0, 0, 4), (0, 0, 0), 30), 32, 32, [ball], materials=[GREY])
    outside = layers_of(scene, "N", "P")
    seen = outside["N"].any(axis=-1)
    np.testing.assert_allclose(outside["N"][seen], outside["P"][seen], atol=0.01)
    scene.camera = perspective((0, 0, 0.2), (0, 0, -1), 60)
    inside = layers_of(scene, "N", "P")
    np.testing.assert_allclose(inside["N"], -inside["P"], atol=0.01)


def test_the_shape_of_a_light_is_a_surface_too():
    lamp = s.SphereLight((1.0, 1.0, 1.0), 1.0, name="/lamp")
    scene = s.Scene(perspective((0, 0, 4), (0, 0, 0), 30), 32, 32, lights=[lamp])
    image = layers_of(scene, "N", "P", "objectId", "materialId", "CryptoObject", "albedo")
    seen = image["objectId"] > 0
    np.testing.assert_allclose(image["N"][seen], image["P"][seen], atol=1e-4)
    assert json.loads(image.metadata["objectIds"]) == {"/lamp": 1}
    assert not image["materialId"].any() and not image["albedo"].any()
    assert image["CryptoObject00"][..., 1].max() == 1


# ---------------------------------------------------------------------------------------------
# Motion


def expected_motion(image: usdmlt.Image, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Pixels to the right and up between two world points, by the camera's matrix."""
    size = np.array([image.width, image.height])
    moved = [transformed(p, image.metadata["worldToNDC"])[..., :2] * size for p in (before, after)]
    return (moved[1] - moved[0]) * [1, -1]


def test_motion_is_that_of_the_point_in_pixels():
    """A turning, growing quad, and the same as an instance."""
    board = quad((-0.8, -0.8, 0), (1.6, 0, 0), (0, 1.6, 0))
    later = np.diag([1.3, 0.8, 1, 1.0]) @ translate(0.4, -0.3, 0.5)
    camera = perspective((0, 0.5, 5), (0, 0, 0), 40)
    moving = replace(board, motion=[s.MeshStep(board.points, transform=later)])
    placed = s.Instances(0, np.stack([np.eye(4)]), motion=np.stack([[later]]))
    for content in (
        {"meshes": [moving]},
        {"prototypes": [s.Prototype([board])], "instances": [placed]},
    ):
        scene = s.Scene(camera, 32, 24, materials=[GREY], **content)
        image = layers_of(scene, "P", "motionvector", "Z")
        seen = np.isfinite(image["Z"])
        assert 0.05 < seen.mean() < 0.9
        before = image["P"][seen].astype(np.float64)
        wanted = expected_motion(image, before, transformed(before, later))
        assert np.abs(wanted).max() > 2
        np.testing.assert_allclose(image["motionvector"][seen], wanted, atol=5e-3)
        assert not image["motionvector"][~seen].any()


def test_a_camera_that_moves_moves_what_stands_still():
    camera = perspective((0, 0, 5), (0, 0, 0), 40)
    camera.motion = [camera.transform @ translate(0.25, 0.1, 0)]
    scene = s.Scene(camera, 32, 24, [quad((-9, -9, 0), (18, 0, 0), (0, 18, 0))], materials=[GREY])
    image = layers_of(scene, "motionvector", "P")
    before = image["P"].astype(np.float64)
    wanted = expected_motion(image, before, before - [0.25, 0.1, 0])
    np.testing.assert_allclose(image["motionvector"], wanted, atol=5e-3)
    assert wanted[..., 0].max() < 0 and wanted[..., 1].max() < 0


# ---------------------------------------------------------------------------------------------
# Averages

CLOSURES = {
    "matt": s.Diffuse((0.2, 0.5, 0.8)),
    "metal": s.Conductor(roughness=0.3),
    "mirror": s.Conductor(roughness=0.0),
    "varnish": s.Layer(s.Dielectric(1.5, 0.2), s.Diffuse((0.2, 0.5, 0.8))),
    "mixture": s.Mix(s.Conductor(roughness=0.5), s.Diffuse((0.9, 0.1, 0.1)), 0.3),
}


@pytest.mark.parametrize("name", CLOSURES)
def test_the_albedo_is_what_a_furnace_shows(name):
    """Under a sky of radiance 1 a convex surface is as bright as its albedo: within the tables'
    0.01 (0.03 of layers), which the picture's noise, 1e-3 in the mean, does not hide."""
    scene = s.Scene(
        perspective((0, 0, 4), (0, 0, 0), 25),
        24,
        24,
        [sphere(1.0, 0, rings=32, smooth=True)],
        materials=[s.Material(CLOSURES[name])],
        lights=[s.DomeLight((1.0, 1.0, 1.0))],
        background=False,
    )
    image = layers_of(scene, "albedo", samples=256, depth=2)
    inner = image["alpha"] == 1
    assert inner.mean() > 0.5
    bright, albedo = image["color"][inner], image["albedo"][inner]
    within = 0.03 if name == "varnish" else 0.01
    np.testing.assert_allclose(albedo.mean(axis=0), bright.mean(axis=0), atol=within)
    assert np.abs(albedo - bright).max() < 0.15
    assert (image["albedo"][image["alpha"] == 0] == 0).all()


def coverage_of(image: usdmlt.Image, name: str) -> np.ndarray:
    """An object's mask, as compositors rebuild it."""
    wanted = np.uint32(identifier(name))
    total = np.zeros((image.height, image.width))
    for layer in ("CryptoObject00", "CryptoObject01", "CryptoObject02"):
        for rank in (0, 2):
            ids = np.ascontiguousarray(image[layer][..., rank]).view(np.uint32)
            total += np.where(ids == wanted, image[layer][..., rank + 1], 0)
    return total


def crowd() -> s.Scene:
    """Objects that overlap, among them instances, and a light."""
    ball = replace(sphere(0.5, 1, rings=12, smooth=True), name="/ball")
    stalk = replace(box((-0.1, 0.4, -0.1), (0.1, 0.9, 0.1)), name="/stalk")
    places = np.stack([translate(x, 0.4, 0.3 * x) for x in (-1.2, 0.0, 1.2)])
    return s.Scene(
        perspective((0, 1.2, 5), (0, 0.4, 0), 35),
        24,
        16,
        [
            replace(floor(0), name="/floor"),
            replace(quad((-2, 0, -1), (2.2, 0.3, 0), (0, 1.5, 0), 0), name="/wall"),
        ],
        [s.Prototype([ball, stalk])],
        [s.Instances(0, places, name="/balls")],
        [GREY, s.Material(s.Diffuse((0.7, 0.2, 0.1)))],
        lights=[s.SphereLight((3.0, 3.0, 3.0), 0.3, translate(0.9, 1.4, 0), name="/lamp")],
    )


def test_names_and_coverages_rebuild_the_masks_of_a_picture_of_ids():
    """Ids at 12 x 12 centres in each pixel; 64 stratified samples are within 0.1 of their mean."""
    scene = crowd()
    image = layers_of(scene, "CryptoObject")
    key = f"{identifier('CryptoObject'):08x}"[:7]
    manifest = json.loads(image.metadata[f"cryptomatte/{key}/manifest"])
    instances = {f"{name}[{i}]" for name in ("/ball", "/stalk") for i in range(3)}
    assert set(manifest) == {"/floor", "/wall", "/lamp", *instances}
    assert all(int(bits, 16) == identifier(name) for name, bits in manifest.items())
    fine = 12
    large = layers_of(replace(scene, width=24 * fine, height=16 * fine), "objectId", "instanceId")
    numbers = json.loads(large.metadata["objectIds"])
    total = np.zeros((16, 24))
    for name in manifest:
        plain, bracket, instance = name.rstrip("]").partition("[")
        there = large["objectId"] == numbers[plain]
        if bracket:
            there &= large["instanceId"] == int(instance) + 1
        mask = there.reshape(16, fine, 24, fine).mean(axis=(1, 3))
        rebuilt = coverage_of(image, name)
        assert np.abs(rebuilt - mask).max() < 0.1, name
        assert abs(rebuilt.mean() - mask.mean()) < 2e-3, name
        total += rebuilt
    np.testing.assert_allclose(
        total, (large["objectId"] > 0).reshape(16, fine, 24, fine).mean((1, 3)), atol=0.1
    )


def test_coverages_are_averages_by_the_pixel_filter():
    """A Gaussian spreads an edge further than a box."""
    half = replace(quad((-4, -4, 0), (4.03, 0, 0), (0, 8, 0)), name="/half")
    scene = s.Scene(orthographic((0, 0, 4), (0, 0, 0), 4.0), 16, 16, [half], materials=[GREY])
    widths = {}
    for filter in ("box", "gaussian"):
        coverage = coverage_of(layers_of(scene, "CryptoObject", filter=filter), "/half")
        widths[filter] = ((coverage > 0) & (coverage < 1)).sum(axis=1).mean()
        np.testing.assert_allclose(coverage.sum(axis=1), coverage.sum(axis=1).mean(), atol=0.2)
    assert widths["box"] == 1 and widths["gaussian"] > 1.5


def test_what_is_partly_opaque_has_its_share():
    """Of two panes before a wall: a centre shows the surface that takes more than half."""
    panes = [
        replace(quad((-9, -9, z), (18, 0, 0), (0, 18, 0), i), name=f"/pane{i}")
        for i, z in enumerate((2.0, 1.0, 0.0))
    ]
    materials = [replace(GREY, opacity=opacity) for opacity in (0.25, 0.5, 1.0)]
    scene = s.Scene(perspective((0, 0, 5), (0, 0, 0), 40), 8, 8, panes, materials=materials)
    image = layers_of(scene, "CryptoObject", "CryptoMaterial", "objectId", "albedo")
    for name, share in {"/pane0": 0.25, "/pane1": 0.375, "/pane2": 0.375}.items():
        np.testing.assert_allclose(coverage_of(image, name), share, atol=1e-5)
    assert (image["objectId"] == 2).all()
    np.testing.assert_allclose(image["albedo"], 0.5, atol=1e-5)


def test_surfaces_seen_from_one_side_only_are_looked_through():
    back = replace(quad((-9, -9, 1), (0, 18, 0), (18, 0, 0)), double_sided=False, name="/back")
    wall = replace(quad((-9, -9, 0), (18, 0, 0), (0, 18, 0)), name="/wall")
    scene = s.Scene(perspective((0, 0, 5), (0, 0, 0), 40), 4, 4, [back, wall], materials=[GREY])
    image = layers_of(scene, "objectId", "CryptoObject")
    assert (image["objectId"] == 2).all()
    assert (coverage_of(image, "/wall") == 1).all()


def test_layers_change_neither_the_picture_nor_with_threads():
    scene = crowd()
    asked = ("albedo", "CryptoObject", "N", "objectId")
    plain = usdmlt.render(scene, integrator="path", samples=2, filter="box")
    one, four = (layers_of(scene, *asked, samples=2, threads=threads) for threads in (1, 4))
    np.testing.assert_array_equal(one["color"], plain["color"])
    for name in one.channels:
        np.testing.assert_array_equal(one[name], four[name])


def test_a_pass_that_is_stopped_is_coarse_but_whole():
    built = build(replace(crowd(), width=300, height=200))
    asked = {"coverage", "Z"}
    stopped = core().surface_layers(built, asked, samples=4096, ranks=6, poll=lambda _: True)
    coverage = stopped["object_coverage"].reshape(200, 300, 6)
    assert np.isin(coverage[-1].sum(axis=-1), (0, 1)).all() and coverage[-1].any()
    assert np.isfinite(stopped["Z"]).any()
