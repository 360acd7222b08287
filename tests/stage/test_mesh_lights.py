"""MeshLightAPI: what a mesh that is a light emits, and what else its material does."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import picture
from support.usda import connect, mtlx_material, node
from usdmlt.errors import Error
from usdmlt.scene import (
    Add,
    Diffuse,
    Layer,
    Material,
    Mix,
    Multiply,
    PreviewSurface,
    UniformEmission,
)
from usdmlt.stage.mesh_lights import lit, separated


def diffuse(color: str) -> str:
    return node("bsdf", "ND_oren_nayar_diffuse_bsdf", f"color3f inputs:color = {color}")


def glowing(color: str) -> str:
    """Diffuse grey that glows."""
    return mtlx_material(
        diffuse("(0.5, 0.5, 0.5)")
        + node("edf", "ND_uniform_edf", f"color3f inputs:color = {color}"),
        connect("bsdf", "bsdf") + connect("edf", "edf"),
    )


STAGE = """
def Mesh "m" (prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"]) {
    BINDING
    float inputs:intensity = 3
    MORE
    QUAD
}
def Camera "main_cam" {
    float horizontalAperture = 0.5
    float verticalAperture = 0.5
    float focalLength = 10
    double3 xformOp:translate = (0.5, 0.5, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
BOUND = "rel material:binding = </M>"
GLOW = np.array([0.2, 0.4, 0.6])


@pytest.fixture
def seen(read):
    """The mean colour of the mesh, in front of which is nothing or a white sky."""

    def render(more: str = "", binding: str = BOUND, sky: bool = False) -> np.ndarray:
        text = glowing("(0.2, 0.4, 0.6)") + STAGE.replace("MORE", more).replace("BINDING", binding)
        scene = read(text + ('def DomeLight "sky" {}' if sky else ""), width=4)
        return picture(scene, "path", samples=256, depth=2).mean(axis=(0, 1))

    return render


@pytest.mark.parametrize(
    ("mode", "emitted", "reflects"),
    [
        ("materialGlowTintsLight", 3 * GLOW, True),
        ("independent", np.full(3, 3.0), True),
        ("noMaterialResponse", np.full(3, 3.0), False),
    ],
)
def test_what_a_mode_emits_and_reflects(seen, mode, emitted, reflects):
    """A white sky all around lets a surface of albedo 1/2 look 1/2 brighter."""
    more = f'uniform token light:materialSyncMode = "{mode}"'
    np.testing.assert_allclose(seen(more), emitted, rtol=1e-5)
    np.testing.assert_allclose(seen(more, sky=True), emitted + 0.5 * reflects, rtol=5e-3)


def test_the_default_mode_tints(seen):
    np.testing.assert_allclose(seen(), 3 * GLOW, rtol=1e-5)


def test_without_material_the_light_is_all_there_is(seen):
    np.testing.assert_allclose(seen(binding=""), 3, rtol=1e-5)
    np.testing.assert_allclose(seen(binding="", sky=True), 3, rtol=1e-5)


def test_all_light_attributes_count(seen):
    more = """float inputs:exposure = 1
    color3f inputs:color = (1, 0.5, 0.25)
    bool inputs:normalize = true
    float3 xformOp:scale = (2, 3, 1)
    uniform token[] xformOpOrder = ["xformOp:scale"]"""
    # The quad of side 1 is 2 by 3 in the world.
    np.testing.assert_allclose(seen(more, binding=""), np.array([6, 3, 1.5]) / 6, rtol=1e-5)


def test_a_mesh_light_lights_the_others(read):
    """The floor under a square of side 1 at height 4, on its axis: E = L·(form factor)·π."""
    text = """
def Mesh "m" (prepend apiSchemas = ["MeshLightAPI"]) {
    float inputs:intensity = 3
    QUAD
}
def Mesh "floor" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = </M>
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, -9, -4), (9, -9, -4), (9, 9, -4), (-9, 9, -4)]
    uniform token subdivisionScheme = "none"
}
def Camera "main_cam" {
    token projection = "orthographic"
    float horizontalAperture = 0.1
    float verticalAperture = 0.1
    double3 xformOp:translate = (0.5, 0.5, -1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    white = mtlx_material(diffuse("(1, 1, 1)"), connect("bsdf", "bsdf"))
    scene = read(white + text, width=2)
    # Lambert: four quarters of a parallel square, with a = half the side over the distance.
    a = 0.5 / 4
    root = np.sqrt(1 + a * a)
    form_factor = 4 * (2 * a / root * np.arctan(a / root)) / (2 * np.pi)
    for integrator in ("path", "bdpt"):
        got = picture(scene, integrator, samples=4096, depth=2).mean()
        assert got == pytest.approx(3 * form_factor, rel=5e-3), integrator


def test_a_material_that_does_not_glow_makes_a_dark_light_and_a_warning(examine):
    text = glowing("(0, 0, 0)") + STAGE.replace("MORE", "").replace("BINDING", BOUND)
    warnings = {w.kind: w.paths for w in examine(text).warnings}
    assert warnings["mesh lights are dark: their materials do not glow"] == ["/m"]


def test_subsets_keep_their_own_materials(read):
    text = """
def Mesh "m" (prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"]) {
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    uniform token light:materialSyncMode = "independent"
    def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        int[] indices = [1]
        uniform token familyName = "materialBind"
        rel material:binding = </M>
    }
}
def Material "M" {
    token outputs:surface.connect = </M/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        token outputs:surface
    }
}
"""
    scene = read(text)
    first, second = (scene.materials[i].closure for i in scene.meshes[0].materials)
    assert isinstance(first, Add) and isinstance(first.a, Diffuse)
    assert isinstance(second, Add) and isinstance(second.a, PreviewSurface)
    assert first.b == second.b == UniformEmission((1, 1, 1))


def test_emission_is_taken_apart_from_everything_else():
    glow, diffuse = UniformEmission((1, 2, 3)), Diffuse()
    assert separated(Add(diffuse, glow)) == (glow, diffuse)
    assert separated(Layer(diffuse, Add(glow, diffuse))) == (glow, Layer(diffuse, diffuse))
    assert separated(Multiply(Add(glow, diffuse), 0.5)) == (
        Multiply(glow, 0.5),
        Multiply(diffuse, 0.5),
    )
    emission, response = separated(Mix(glow, diffuse, 0.25))
    assert emission == Mix(glow, UniformEmission((0, 0, 0)), 0.25)
    assert response == Mix(UniformEmission((0, 0, 0)), diffuse, 0.25)
    assert separated(None) == (None, None)


def test_coverage_stays_with_the_material_and_goes_without_it():
    material = Material(Diffuse(), opacity=0.5, name="m")
    assert lit(material, (1, 1, 1), "independent").opacity == 0.5
    assert lit(material, (1, 1, 1), "noMaterialResponse").opacity == 1


def test_a_normalized_mesh_of_hardly_any_area_is_too_bright_for_floats(read):
    text = """def Mesh "m" (prepend apiSchemas = ["MeshLightAPI"]) {
        bool inputs:normalize = true
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1e-30, 0, 0), (0, 1e-30, 0)]
        uniform token subdivisionScheme = "none"
    }"""
    with pytest.raises(Error, match="/m: the light's radiance is 2e\\+60"):
        read(text)
