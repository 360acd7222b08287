"""Assets made to show at a glance whether materials are read right, looked at by number.

Set USDMLT_ASSETS to a folder with the USD working group's assets to run these.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import probe_material
from usdmlt.scene import Mesh, Scene
from usdmlt.stage import load

TESTS = Path(os.environ.get("USDMLT_ASSETS", "/nonexistent")) / "usd-wg" / "test_assets"
pytestmark = pytest.mark.skipif(
    not TESTS.exists(), reason="USDMLT_ASSETS names no folder of assets"
)


def mesh_of(scene: Scene, name: str) -> Mesh:
    """The mesh that a prim of this name is, or is below."""
    return next(mesh for mesh in scene.meshes if f"/{name}/" in f"{mesh.name}/")


def lobes_at(scene: Scene, mesh: Mesh, st) -> list[dict]:
    material = scene.materials[mesh.materials]
    names = {name: np.tile(st, (3, 1)) for name in mesh.primvars}
    return probe_material(material, scene.textures, names).lobes


def diffuse_at(scene: Scene, mesh: Mesh, st) -> np.ndarray:
    weights = [x["weight"] for x in lobes_at(scene, mesh, st) if x["type"] == "diffuse"]
    return np.array(weights[0] if weights else (0, 0, 0))


def affine_of(mesh: Mesh) -> np.ndarray:
    """(3, 4): from (s, t, 1) of a flat panel to its points in the world."""
    st = mesh.primvars["st"]
    corners = mesh.triangles if st.corners is None else st.corners
    s = np.column_stack([st.values[corners.ravel()], np.ones(corners.size)])
    p = np.column_stack([mesh.points[mesh.triangles.ravel()], np.ones(mesh.triangles.size)])
    return np.linalg.lstsq(s, p @ mesh.transform, rcond=None)[0]


@pytest.fixture(scope="module")
def transforms() -> Scene:
    return load(TESTS / "TextureTransformTest" / "TextureTransformTest.usd")


@pytest.mark.parametrize(
    ("name", "row", "column"), [("Offset_U", 0, 1), ("Offset_V", 1, 0), ("Offset_UV", 1, 1)]
)
def test_offsets_show_the_quarter_of_the_image_with_the_check_mark(transforms, name, row, column):
    mesh = mesh_of(transforms, name)
    picture = next(t for t in transforms.textures if " UV_" in t.name).linear()
    for i, j in np.random.default_rng(1).integers(8, 120, (40, 2)):
        st = (
            (j + 0.5) / 256,
            1 - (i + 0.5) / 256,
        )  # of the first quarter, which says "not supported"
        expected = picture[i + 128 * row, j + 128 * column, :3]
        assert_allclose(diffuse_at(transforms, mesh, st), expected, atol=2e-3)


TIP = np.array([0.69, 0.31])  # where the arrow's picture points to


@pytest.mark.parametrize("name", ["Rotation", "Scale", "All"])
def test_arrows_point_at_the_check_mark(transforms, name):
    """Order and signs of UsdTransform2d: the tip is over the mark that says so, and no other."""
    panel = mesh_of(transforms, name)
    transform = transforms.materials[panel.materials].closure.diffuseColor.transform
    st = np.linalg.solve(transform[:, :2], TIP - transform[:, 2])
    # The marks are placed relative to their panel, though the file has them beside it.
    tip = (np.append(st, 1.0) @ affine_of(panel))[:2] - panel.transform[3, :2]
    distances = {}
    for end in ("Correct", "Not_Supported", "Error"):
        marks = [m for m in transforms.meshes if m.name.endswith(f"/{name}___{end}")]
        if marks:
            corners = np.column_stack([marks[0].points, np.ones(len(marks[0].points))])
            box = (corners @ marks[0].transform)[:, :2]
            distances[end] = np.linalg.norm(tip - box.mean(axis=0)) / np.ptp(box, axis=0).max()
    assert distances["Correct"] < 0.9  # in sizes of the mark: they touch
    assert min(distances, key=distances.get) == "Correct"
    assert all(distance > 1.5 for end, distance in distances.items() if end != "Correct")
    # The arrow is black just before its tip and the paper white just after it.
    for step, dark in ((-0.04, True), (0.03, False)):
        place = np.linalg.solve(transform[:, :2], TIP + step * np.array([1, -1]) - transform[:, 2])
        assert (diffuse_at(transforms, panel, place).mean() < 0.2) == dark


def srgb(stored: int) -> float:
    return ((stored / 255 + 0.055) / 1.055) ** 2.4 if stored > 10 else stored / 255 / 12.92


@pytest.mark.parametrize(
    ("name", "stored"), [("000", srgb(0)), ("033", 153 / 255), ("066", srgb(211))]
)
def test_textured_roughness_is_what_the_file_says(name, stored):
    """The picture holds sRGB codes of about 0, 0.33 and 0.66. The material of the second declares
    it raw, so its half differs by the file's own word; the others agree within the 8 bits."""
    scene = load(TESTS / "RoughnessTest" / "RoughnessTest.usdz")
    constant, textured = (
        lobes_at(scene, mesh_of(scene, f"{kind}{name}"), (0.4, 0.6)) for kind in ("Const", "Tex")
    )
    assert [x["type"] for x in constant] == [x["type"] for x in textured]
    alphas = [
        next(x["alpha"][0] for x in lobes if x["type"] == "schlick")
        for lobes in (constant, textured)
    ]
    assert alphas[0] == pytest.approx((int(name) / 100) ** 2, abs=1e-6)
    assert alphas[1] == pytest.approx(stored**2, abs=1e-6)
    if name != "033":
        assert alphas[1] == pytest.approx(alphas[0], abs=0.012)


def test_blended_opacity_is_the_textures_alpha_times_its_scale():
    scene = load(TESTS / "AlphaBlendSortTest" / "AlphaBlendSortTest.usda")
    seen = []
    for name, scale in (("Shadow1_23", 0.50980395), ("Shadow3_22", 0.29803923)):
        mesh = mesh_of(scene, name)
        texture = scene.textures[scene.materials[mesh.materials].closure.opacity.texture]
        alpha = texture.linear()[..., 3]
        height, width = alpha.shape
        for row, column in np.random.default_rng(2).integers(1, min(height, width) - 1, (30, 2)):
            st = (column + 0.5) / width, 1 - (row + 0.5) / height
            through = sum(x["weight"][0] for x in lobes_at(scene, mesh, st) if x["transmits"])
            assert through == pytest.approx(1 - scale * alpha[row, column], abs=2e-3)
            seen.append(through)
    assert min(seen) < 0.7 < 0.95 < max(seen)


@pytest.mark.parametrize("name", ["jpeg_rgb_8-bit", "png_rgb_8-bit", "png_rgb_16-bit"])
def test_formats_of_colours_agree(name):
    """The same picture, 8 bits of sRGB; 16 bits count as linear by the specification's rule."""
    scene = load(TESTS / "TextureFileFormatTests" / f"{name}.usda")
    depth = {"8": np.uint8, "16": np.uint16}[name.split("_")[-1].removesuffix("-bit")]
    assert {texture.pixels.dtype.type for texture in scene.textures} == {depth}
    assert all((t.decode is not None) == (depth is np.uint8) for t in scene.textures)


def test_normals_of_any_type_are_those_of_the_boxes():
    """NormalsTypes: authored normals of every type, also of none of normals, are those of faces.
    As subdivision surfaces, which the file has, all are the same."""
    path = TESTS / "schemaTests" / "usdGeom" / "meshes" / "normals_types" / "normalsTypes.usda"
    first, *others = load(path).meshes
    assert len(others) == 16
    for mesh in others:
        assert_allclose(mesh.points, first.points)
        assert_allclose(mesh.normals.values, first.normals.values)
    flat = {f"{mesh.name}.subdivisionScheme": "none" for mesh in (first, *others)}
    with_normals = 0
    for mesh in load(path, overrides=flat).meshes:
        a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
        across = np.cross(b - a, c - a)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        if mesh.normals is None:  # as triangles are
            continue
        corners = mesh.triangles if mesh.normals.corners is None else mesh.normals.corners
        assert_allclose(mesh.normals.values[corners], across[:, None].repeat(3, axis=1), atol=1e-6)
        with_normals += 1
    assert with_normals == 8
