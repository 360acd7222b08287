"""Normal maps: the tangent frame, mirrored texture coordinates, normals that point below."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import probe_material
from usdmlt import closures
from usdmlt.native import core
from usdmlt.scene import Conductor, Diffuse, Material, Scene, Texture, TextureInput

# Corners (0,0), (1,0), (0,1) of the triangle, counter-clockwise about +z.
ST = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
MIRRORED = ST * [1.0, -1.0]  # t runs against y


def mapped(normal, st=ST, tangent=(1.0, 0.0, 0.0), **where) -> np.ndarray:
    """The shading normal that a map of one constant tangent-space normal makes."""
    image = Texture((np.array(normal, np.float32) / 2 + 0.5).reshape(1, 1, 3))
    texture = TextureInput(0, scale=(2.0,) * 4, bias=(-1.0,) * 4)
    material = Material(Diffuse(), normal=texture)
    return np.array(
        probe_material(material, [image], {"st": st}, tangent=tangent, **where).shading_normal
    )


def test_a_flat_map_changes_nothing():
    tilted = np.array([0.6, 0.0, 0.8])
    assert_allclose(mapped((0, 0, 1)), (0, 0, 1), atol=1e-6)
    assert_allclose(mapped((0, 0, 1), shading_normal=tuple(tilted)), tilted, atol=1e-6)


def test_x_tilts_along_s_and_y_along_t():
    assert_allclose(mapped((0.6, 0, 0.8)), (0.6, 0, 0.8), atol=1e-6)
    assert_allclose(mapped((0, 0.6, 0.8)), (0, 0.6, 0.8), atol=1e-6)
    turned = {"tangent": (0.0, 2.0, 0.0)}  # +s along y, so +t along −x
    assert_allclose(mapped((0.6, 0, 0.8), **turned), (0, 0.6, 0.8), atol=1e-6)
    assert_allclose(mapped((0, 0.6, 0.8), **turned), (-0.6, 0, 0.8), atol=1e-6)


def test_t_runs_the_other_way_where_the_texture_is_mirrored():
    """Catches dents that turn into bumps on the mirrored half of a symmetric model."""
    assert_allclose(mapped((0, 0.6, 0.8), st=MIRRORED), (0, -0.6, 0.8), atol=1e-6)
    assert_allclose(mapped((0, 0.6, 0.8), mirrored=True), (0, -0.6, 0.8), atol=1e-6)
    both = mapped((0, 0.6, 0.8), st=MIRRORED, mirrored=True)
    assert_allclose(both, (0, 0.6, 0.8), atol=1e-6)


def test_the_normal_is_normalised_and_the_tangent_made_perpendicular():
    assert_allclose(mapped((0.3, 0.0, 0.4)), (0.6, 0, 0.8), atol=1e-6)
    assert_allclose(mapped((0.6, 0, 0.8), tangent=(3.0, 0.0, 5.0)), (0.6, 0, 0.8), atol=1e-6)


@pytest.mark.parametrize("normal", [(0.9, 0, -0.4), (0, 0, -1), (1, 0, 0)])
def test_a_normal_below_the_surface_is_bent_back_above_it(normal):
    """The contract of closures: the shading normal is on the geometric normal's side."""
    n = mapped(normal)
    assert 0 < n[2] < 0.1 or n[2] == pytest.approx(1)
    assert np.linalg.norm(n) == pytest.approx(1, abs=1e-6)
    tilted = {"shading_normal": (0.6, 0.0, 0.8), "geometric_normal": (0.0, 0.0, 1.0)}
    assert mapped((1, 0, 0.1), **tilted)[2] > 0


@pytest.mark.parametrize("normal", [(0, 0, 0), (np.nan, 0, 1)])
def test_a_map_that_is_no_normal_leaves_the_surfaces(normal):
    assert_allclose(mapped(normal), (0, 0, 1), atol=1e-6)


def test_without_texture_coordinates_a_flat_map_still_changes_nothing():
    assert_allclose(mapped((0, 0, 1), st=np.zeros((3, 2)), tangent=(0, 0, 0)), (0, 0, 1))


def test_a_map_without_an_image_is_none():
    material = Material(Diffuse(), normal=TextureInput(None))
    assert_allclose(probe_material(material).shading_normal, (0, 0, 1))


def test_only_materials_that_need_a_tangent_ask_for_one():
    image = Texture(np.full((1, 1, 3), 0.5, np.float32))
    materials = [
        Material(Diffuse()),
        Material(Conductor(roughness=(0.1, 0.1))),
        Material(Conductor(roughness=(0.1, 0.4))),
        Material(Diffuse(), normal=TextureInput(0, primvar="bumps")),
    ]
    compiled, slots = closures.compile_materials(Scene(materials=materials, textures=[image]))
    assert [m["tangent_primvar"] for m in compiled] == [None, None, slots["st"], slots["bumps"]]


def test_the_tangent_is_the_derivative_of_the_position_along_s():
    rng = np.random.default_rng(4)
    for _ in range(20):
        points, st = rng.normal(size=(3, 3)), rng.normal(size=(3, 2))
        edges = np.stack([points[1] - points[0], points[2] - points[0]])
        steps = np.stack([st[1] - st[0], st[2] - st[0]])
        expected = np.linalg.solve(steps, edges)[0]
        assert_allclose(core().tangent_along_s(points, st), expected, rtol=2e-3, atol=1e-4)


def test_degenerate_texture_coordinates_have_no_tangent():
    points = np.eye(3)
    assert core().tangent_along_s(points, np.ones((3, 2))) == [0, 0, 0]
    assert core().tangent_along_s(points, np.array([[0, 0], [1, 1], [2, 2]])) == [0, 0, 0]
