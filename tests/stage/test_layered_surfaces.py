"""standard_surface and OpenPBR: against MaterialX's graphs of them, each other, and furnaces."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import albedo, draw, polar, probe_material, random_directions
from support.usda import connect, mtlx_material, node
from usdmlt.scene import Conductor, Diffuse, Layer, Sheen, TextureInput
from usdmlt.stage import load
from usdmlt.stage.open_pbr_surface import DEFAULTS as OPEN_PBR
from usdmlt.stage.standard_surface import DEFAULTS as STANDARD
from usdmlt.stage.standard_surface import VERSION_100

MODELS = {"standard_surface": STANDARD, "open_pbr_surface": OPEN_PBR}
MESH = """
def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) { QUAD
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    rel material:binding = </M> }
"""
TYPES = {float: "float", tuple: "color3f", bool: "bool"}


def shown(model: str, inputs: str, nodes: str = "") -> str:
    """A stage with a mesh of one surface; ``inputs`` as text."""
    return mtlx_material(nodes, inputs, f"ND_{model}_surfaceshader") + MESH


def authored(model: str, inputs: dict[str, object]) -> str:
    """The inputs of a surface as text."""
    lines = [
        f"{TYPES[type(MODELS[model][name])]} inputs:{name} = {str(value).lower()}"
        for name, value in inputs.items()
    ]
    return "\n".join(lines)


@pytest.fixture
def surface(read):
    """The material of one surface with the given inputs."""

    def read_surface(model: str, **inputs: object):
        return read(shown(model, authored(model, inputs))).materials[0]

    return read_surface


# ---------------------------------------------------------------------------------------------
# Definitions


@cache
def library():
    """MaterialX's own definitions of all nodes."""
    mx = pytest.importorskip("MaterialX", reason="the extra `materialx` is not installed")
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    return document


def authored_default(source) -> object:
    value = source.getValue()
    return value if isinstance(value, (bool, int, float)) else tuple(value)


@pytest.mark.parametrize(
    ("definition", "defaults"),
    [
        ("ND_standard_surface_surfaceshader", STANDARD),
        ("ND_standard_surface_surfaceshader_100", STANDARD | VERSION_100),
        ("ND_open_pbr_surface_surfaceshader", OPEN_PBR),
    ],
)
def test_the_defaults_are_those_of_the_definitions(definition, defaults):
    node = library().getNodeDef(definition)
    found = {name: authored_default(node.getActiveInput(name)) for name in defaults}
    for name, value in defaults.items():
        assert found[name] == pytest.approx(value), name


# ---------------------------------------------------------------------------------------------
# Against MaterialX's graphs

PLASTIC = {"base_color": (0.7, 0.3, 0.2), "specular_roughness": 0.4}
CASES = {
    "default": ("standard_surface", {}),
    "plastic": ("standard_surface", PLASTIC | {"specular_color": (0.9, 0.8, 0.7)}),
    "chalk": ("standard_surface", PLASTIC | {"specular": 0.0, "diffuse_roughness": 0.6}),
    "metal": ("standard_surface", PLASTIC | {"metalness": 1.0, "specular_color": (0.9, 0.5, 0.3)}),
    "half metal": ("standard_surface", PLASTIC | {"metalness": 0.4, "specular": 0.6}),
    "brushed": ("standard_surface", PLASTIC | {"metalness": 1.0, "specular_anisotropy": 0.7}),
    "velvet": ("standard_surface", PLASTIC | {"sheen": 0.7, "sheen_color": (0.9, 0.2, 0.1)}),
    "skin": ("standard_surface", PLASTIC | {"subsurface": 0.6, "subsurface_color": (1, 0.2, 0.1)}),
    "lacquer": (
        "standard_surface",
        PLASTIC
        | {"coat": 0.8, "coat_color": (0.5, 0.9, 0.4), "coat_roughness": 0.3}
        | {"coat_affect_color": 0.5, "coat_affect_roughness": 0.7},
    ),
    "OpenPBR": ("open_pbr_surface", {}),
    "OpenPBR chalk": ("open_pbr_surface", PLASTIC | {"base_diffuse_roughness": 0.7}),
    "OpenPBR metal": (
        "open_pbr_surface",
        PLASTIC | {"base_metalness": 1.0, "specular_color": (0.9, 0.5, 0.3)},
    ),
    "OpenPBR half metal": ("open_pbr_surface", PLASTIC | {"base_metalness": 0.4}),
    "OpenPBR brushed": (
        "open_pbr_surface",
        PLASTIC | {"base_metalness": 1.0, "specular_roughness_anisotropy": 0.7},
    ),
    "OpenPBR dull": ("open_pbr_surface", PLASTIC | {"specular_weight": 0.4, "specular_ior": 1.9}),
    "OpenPBR skin": ("open_pbr_surface", PLASTIC | {"subsurface_weight": 0.6}),
    "OpenPBR fuzz": ("open_pbr_surface", PLASTIC | {"fuzz_weight": 0.5, "fuzz_roughness": 0.6}),
    "OpenPBR lacquer": (
        "open_pbr_surface",
        PLASTIC | {"coat_weight": 0.8, "coat_color": (0.5, 0.9, 0.4), "coat_roughness": 0.3},
    ),
}


@pytest.fixture
def graph(tmp_path, write):
    """The material of MaterialX's graph of a surface, of BSDF nodes only."""

    def read_graph(model: str, inputs: dict[str, object]):
        mx = pytest.importorskip("MaterialX", reason="the extra `materialx` is not installed")
        document = mx.createDocument()
        document.setDataLibrary(library())
        shader = document.addNode(model, "s", "surfaceshader")
        shader.addInputsFromNodeDef()
        for name, value in inputs.items():
            text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
            shader.getInput(name).setValueString(text)
        document.addMaterialNode("M", shader)
        document.flattenSubgraphs("", lambda node: node.getCategory().startswith(model))
        assert document.getNode("M").getInput("surfaceshader").getConnectedNode().getCategory() == (
            "surface"
        )
        mx.writeToXmlFile(document, str(tmp_path / "m.mtlx"))
        body = """
            def Scope "MaterialX" ( references = @m.mtlx@</MaterialX> ) { }
            def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"])
            { rel material:binding = </MaterialX/Materials/M> }
        """
        return load(write(body)).materials[0]

    return read_graph


@pytest.mark.parametrize("case", CASES)
def test_surfaces_scatter_as_materialxs_graphs_of_them(surface, graph, case):
    """The same closures, read from the library's definition node by node."""
    model, inputs = CASES[case]
    ours, theirs = (
        probe_material(material) for material in (surface(model, **inputs), graph(model, inputs))
    )
    light, eye = random_directions(2000, seed=3), random_directions(2000, seed=4)
    light[:, 2], eye[:, 2] = np.abs(light[:, 2]), np.abs(eye[:, 2])
    expected = theirs.evaluate(light, eye)
    assert expected.max() > 0.05
    assert_allclose(ours.evaluate(light, eye), expected, rtol=2e-4, atol=1e-6)


def test_clear_surfaces_reflect_as_materialxs_graphs_and_refract_all_else(surface, graph):
    """Beneath a reflecting layer, MaterialX's refracting node loses Fresnel's share once more."""
    for model, weight in (
        ("standard_surface", "transmission"),
        ("open_pbr_surface", "transmission_weight"),
    ):
        inputs = {weight: 1.0, "specular_roughness": 0.5}
        glass = probe_material(surface(model, **inputs))
        theirs = probe_material(graph(model, inputs))
        light, eye = random_directions(500, seed=5), random_directions(500, seed=6)
        light[:, 2], eye[:, 2] = np.abs(light[:, 2]), np.abs(eye[:, 2])
        assert_allclose(glass.evaluate(light, eye), theirs.evaluate(light, eye), rtol=1e-4)
        smooth = probe_material(surface(model, **inputs | {"specular_roughness": 0.0}))
        for cosine in (0.9, 0.3, -0.5, -0.9):
            share = draw(smooth, polar(cosine), "light", 20_000).throughput().mean(axis=0)
            assert share == pytest.approx(1.0, abs=5e-3)


# ---------------------------------------------------------------------------------------------
# Parts

WHITE_PARTS = {
    "standard_surface": {
        "metal": {"metalness": 1.0},
        "velvet": {"sheen": 1.0, "sheen_roughness": 0.1},
        "leaf": {"subsurface": 0.5, "thin_walled": True},
        "pane": {"transmission": 1.0, "thin_walled": True},
        "glass": {"transmission": 1.0},
        "half clear": {"transmission": 0.5, "coat": 1.0},
        "all": {
            "metalness": 0.3,
            "sheen": 0.5,
            "subsurface": 0.3,
            "transmission": 0.3,
            "coat": 0.5,
            "specular_anisotropy": 0.5,
            "diffuse_roughness": 0.0,
        },
    },
    "open_pbr_surface": {
        "metal": {"base_metalness": 1.0},
        "rough": {"base_diffuse_roughness": 1.0},
        "fuzz": {"fuzz_weight": 1.0, "fuzz_roughness": 0.1},
        "leaf": {"subsurface_weight": 1.0, "geometry_thin_walled": True},
        "pane": {"transmission_weight": 1.0, "geometry_thin_walled": True},
        "glass": {"transmission_weight": 1.0},
        "coat": {"coat_weight": 1.0, "coat_roughness": 0.2},
        "all": {
            "base_metalness": 0.3,
            "fuzz_weight": 0.5,
            "subsurface_weight": 0.3,
            "transmission_weight": 0.3,
            "coat_weight": 0.5,
            "base_diffuse_roughness": 0.5,
        },
    },
}


@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.8])
@pytest.mark.parametrize(("model", "part"), [(m, p) for m in WHITE_PARTS for p in WHITE_PARTS[m]])
def test_white_surfaces_never_scatter_more_than_they_receive(surface, model, part, roughness):
    white = {"base_color": (1, 1, 1), "subsurface_color": (1, 1, 1)}
    inputs = white | {"specular_roughness": roughness} | WHITE_PARTS[model][part]
    closure = probe_material(surface(model, **inputs))
    for cosine in (0.98, 0.6, 0.2, -0.3, -0.9):
        carried = draw(closure, polar(cosine, 0.4), "light", 10_000).throughput()
        error = carried.std(axis=0) / 100
        assert (carried.mean(axis=0) < 1.02 + 4.5 * error).all(), cosine


def test_thin_walls_pass_light_straight_on(surface):
    pane = probe_material(surface("standard_surface", transmission=1.0, thin_walled=True))
    for cosine in (0.9, 0.4, -0.4):
        samples = draw(pane, polar(cosine), "eye", 4000)
        through = samples.valid & (samples.directions[:, 2] * cosine < 0)
        assert through.mean() > 0.5
        assert_allclose(
            samples.directions[through], -polar(cosine)[None].repeat(through.sum(), 0), atol=1e-5
        )


def test_weights_of_zero_leave_no_lobes(surface):
    assert surface("standard_surface").closure.base == Diffuse((0.8, 0.8, 0.8), 1.0, 0.0)
    metal = surface("standard_surface", metalness=1.0).closure
    assert isinstance(metal, Conductor)
    velvet = surface("standard_surface", sheen=1.0, specular=0.0).closure
    assert isinstance(velvet, Layer) and isinstance(velvet.top, Sheen)


def test_anisotropy_runs_along_the_rotated_tangent(surface):
    """A quarter turn exchanges the axes."""
    inputs = {"metalness": 1.0, "specular_anisotropy": 0.8, "specular_roughness": 0.5}
    directions = random_directions(200, seed=8)
    directions[:, 2] = np.abs(directions[:, 2])
    turned = np.stack([directions[:, 1], -directions[:, 0], directions[:, 2]], axis=1)
    st = {"st": np.array([(0, 0), (1, 0), (0, 1)])}
    tangent = (1.0, 0.0, 0.0)
    plain = probe_material(surface("standard_surface", **inputs), primvars=st, tangent=tangent)
    rotated = probe_material(
        surface("standard_surface", **inputs, specular_rotation=0.25), primvars=st, tangent=tangent
    )
    eye = np.tile((0.3, 0.1, 0.9486833), (200, 1))
    turned_eye = np.tile((0.1, -0.3, 0.9486833), (200, 1))
    assert_allclose(
        rotated.evaluate(directions, eye), plain.evaluate(turned, turned_eye), rtol=2e-3, atol=1e-6
    )
    assert np.ptp(plain.evaluate(directions, eye) / rotated.evaluate(directions, eye)) > 1


@pytest.mark.parametrize(
    ("model", "inputs", "expected"),
    [
        ("standard_surface", {"emission": 2.0, "emission_color": (0.5, 1.0, 0.0)}, (1, 2, 0)),
        ("open_pbr_surface", {"emission_luminance": 300.0}, (300, 300, 300)),
        # Through a coat of index 1.5: tinted, and less what is reflected at normal incidence.
        (
            "standard_surface",
            {"emission": 1.0, "coat": 1.0, "coat_color": (0.5, 1.0, 1.0)},
            (0.48, 0.96, 0.96),
        ),
    ],
)
def test_emission(surface, model, inputs, expected):
    assert probe_material(surface(model, **inputs)).emission == pytest.approx(expected)


def test_opacity_is_a_coverage(surface):
    assert surface("open_pbr_surface", geometry_opacity=0.25).opacity == 0.25
    half = surface("standard_surface", opacity=(0.4, 0.4, 0.4)).opacity
    assert half == pytest.approx(0.4, rel=1e-6)


@pytest.mark.parametrize(
    ("model", "inputs", "says"),
    [
        ("standard_surface", {"transmission": 1.0, "transmission_dispersion": 9.0}, "dispersion"),
        ("standard_surface", {"thin_film_thickness": 500.0}, "thin films"),
        ("open_pbr_surface", {"thin_film_weight": 1.0}, "thin films"),
        ("standard_surface", {"subsurface": 1.0}, "subsurface scattering is rendered as diffuse"),
        ("open_pbr_surface", {"transmission_depth": 2.0}, None),  # nothing is transmitted
        ("standard_surface", {}, None),
    ],
)
def test_what_is_left_out_is_said_once(examine, model, inputs, says):
    warnings = examine(shown(model, authored(model, inputs))).warnings
    kinds = [w.kind for w in warnings if "lights" not in w.kind]
    assert len(kinds) == (1 if says else 0)
    assert says is None or says in kinds[0]


def test_any_input_may_be_textured_and_the_same_as_the_constant(read, tmp_path):
    """A texture of 0.5 and the number 0.5 make the same lobes, also through arithmetic."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(2, 2, 1, "float")
    output = oiio.ImageOutput.create(str(tmp_path / "half.exr"))
    output.open(str(tmp_path / "half.exr"), spec)
    output.write_image(np.full((2, 2, 1), 0.5, np.float32))
    output.close()
    image = node("image", "ND_image_float", "asset inputs:file = @half.exr@")
    names = ["metalness", "specular_roughness", "specular", "coat", "coat_roughness", "sheen"]
    names += ["transmission", "specular_anisotropy", "subsurface", "specular_IOR", "emission"]
    for name in names:
        others = "" if name == "coat" else "float inputs:coat = 0.5\nfloat inputs:metalness = 0.3\n"
        others = others if name != "metalness" else "float inputs:coat = 0.5\n"
        constant = read(shown("standard_surface", f"{others}float inputs:{name} = 0.5"))
        fed = others + connect(name, "image", "float")
        textured = read(shown("standard_surface", fed, image))
        where = {"primvars": {"st": np.full((3, 2), 0.5)}, "tangent": (1.0, 0.0, 0.0)}
        a = probe_material(constant.materials[0], **where)
        b = probe_material(textured.materials[0], textured.textures, **where)
        light, eye = random_directions(300, seed=1), random_directions(300, seed=2)
        assert_allclose(b.evaluate(light, eye), a.evaluate(light, eye), rtol=1e-4, atol=1e-6), name
        assert_allclose(b.emission, a.emission, rtol=1e-5)


def test_normal_maps_are_read_from_normalmap_nodes(read, tmp_path):
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(1, 1, 3, "float")
    output = oiio.ImageOutput.create(str(tmp_path / "n.exr"))
    output.open(str(tmp_path / "n.exr"), spec)
    output.write_image(np.array([[[0.8, 0.5, 0.9]]], np.float32))
    output.close()
    scale = connect("in", "image", "float3") + "float inputs:scale = 0.5"
    nodes = node("map", "ND_normalmap_float", scale)
    nodes += node("image", "ND_image_vector3", "asset inputs:file = @n.exr@")
    scene = read(shown("standard_surface", connect("normal", "map", "float3"), nodes))
    material = scene.materials[0]
    assert isinstance(material.normal, TextureInput)
    found = probe_material(
        material, scene.textures, {"st": [(0, 0), (1, 0), (0, 1)]}, tangent=(1.0, 0.0, 0.0)
    ).shading_normal
    expected = np.array([0.3, 0.0, 0.8])
    assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-5)


def test_the_two_models_agree_where_they_mean_the_same(surface):
    """Plastic and glass are equal; metals differ by Gulbrandsen's and Hoffman's curves only."""
    for shared, ours, other, tolerance in (
        ({"specular_roughness": 0.3}, {}, {}, 1e-3),
        ({"specular_roughness": 0.3}, {"metalness": 1.0}, {"base_metalness": 1.0}, 0.08),
        ({"specular_roughness": 0.3}, {"transmission": 1.0}, {"transmission_weight": 1.0}, 1e-3),
    ):
        a = probe_material(surface("standard_surface", **shared, **ours))
        b = probe_material(surface("open_pbr_surface", **shared, **other))
        for cosine in (0.95, 0.5, 0.2):
            assert_allclose(
                albedo(a, polar(cosine), "eye"), albedo(b, polar(cosine), "eye"), atol=tolerance
            )
