"""Media of materials: MaterialX's volumes, what transparent surfaces are filled with, which meshes
hold a medium, and the one that fills the world."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest

from support.rendering import picture
from support.usda import CUBE, connect, instance, mtlx_material, node
from usdmlt.errors import Error
from usdmlt.media import is_closed
from usdmlt.scene import Medium, Scene
from usdmlt.stage import load

BOUND = 'def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }'
GLASS = connect("bsdf", "glass")
GLASS_NODE = node("glass", "ND_dielectric_bsdf", 'string inputs:scatter_mode = "RT"')
FOG = node("vdf", "ND_anisotropic_vdf", "float3 inputs:scattering = (1, 2, 3)")


def volume_material(nodes: str, inputs: str = connect("vdf", "vdf"), name: str = "M") -> str:
    """A material that is only a volume."""
    text = f"""
def Material "M" {{
    token outputs:mtlx:volume.connect = </M/volume.outputs:out>
    {node("volume", "ND_volume", inputs)}
    {nodes}
}}
"""
    return text.replace("/M/", f"/{name}/").replace('"M"', f'"{name}"')


def anisotropic(name: str, scattering: str, absorption: str = "(0, 0, 0)", g: float = 0.0) -> str:
    return node(
        name,
        "ND_anisotropic_vdf",
        f"float3 inputs:scattering = {scattering}\nfloat3 inputs:absorption = {absorption}\n"
        f"float inputs:anisotropy = {g}",
    )


@pytest.fixture
def medium(read):
    """The medium of a material that is only a volume."""

    def read_medium(nodes: str, inputs: str = connect("vdf", "vdf")) -> Medium:
        (found,) = read(volume_material(nodes, inputs) + BOUND).media
        return found

    return read_medium


@pytest.fixture
def interior(read):
    """The medium inside of a cube of a surface model; None if there is none."""

    def read_interior(kind: str, inputs: str) -> Medium | None:
        scene: Scene = read(mtlx_material("", inputs, f"ND_{kind}_surfaceshader") + BOUND)
        (mesh,) = scene.meshes
        return None if mesh.medium is None else scene.media[mesh.medium]

    return read_interior


def kinds(found) -> list[str]:
    return [w.kind for w in found.warnings if "no lights" not in w.kind]


# ---------------------------------------------------------------------------------------------
# MaterialX's volumes


def test_a_volume_has_the_coefficients_of_its_nodes(medium):
    found = medium(
        anisotropic("vdf", "(1, 2, 3)", "(0.25, 0.5, 0.75)", 0.5)
        + node("edf", "ND_uniform_edf", "color3f inputs:color = (4, 5, 6)"),
        connect("vdf", "vdf") + connect("edf", "edf"),
    )
    assert found == Medium((1, 2, 3), (0.25, 0.5, 0.75), (4, 5, 6), anisotropy=0.5, name="/M")


def test_absorption_alone_does_not_scatter(medium):
    found = medium(node("vdf", "ND_absorption_vdf", "float3 inputs:absorption = (1, 2, 3)"))
    assert found == Medium(absorption=(1, 2, 3), name="/M")


def test_volumes_add(medium):
    nodes = anisotropic("a", "(1, 1, 1)", "(2, 2, 2)", 0.5) + anisotropic("b", "(3, 3, 3)", g=0.5)
    found = medium(nodes + node("vdf", "ND_add_vdf", connect("in1", "a") + connect("in2", "b")))
    assert found == Medium((4, 4, 4), (2, 2, 2), anisotropy=0.5, name="/M")


def test_volumes_mix(medium):
    mixed = connect("fg", "a") + connect("bg", "b") + "float inputs:mix = 0.25"
    nodes = anisotropic("a", "(4, 4, 4)") + anisotropic("b", "(0, 8, 0)", "(1, 1, 1)")
    found = medium(nodes + node("vdf", "ND_mix_vdf", mixed))
    assert found == Medium((1, 7, 1), (0.75, 0.75, 0.75), name="/M")


@pytest.mark.parametrize(
    ("kind", "factor"), [("F", "float inputs:in2 = 2"), ("C", "color3f inputs:in2 = (2, 2, 2)")]
)
def test_volumes_are_scaled(medium, kind, factor):
    nodes = anisotropic("a", "(1, 2, 3)", "(1, 0, 0)", -0.5)
    found = medium(nodes + node("vdf", f"ND_multiply_vdf{kind}", connect("in1", "a") + factor))
    assert found == Medium((2, 4, 6), (2, 0, 0), anisotropy=-0.5, name="/M")


def test_sums_of_phase_functions_have_their_mean_cosine_and_say_so(examine, read):
    nodes = anisotropic("a", "(1, 1, 1)", g=0.5) + anisotropic("b", "(3, 3, 3)", g=-0.5)
    nodes += node("vdf", "ND_add_vdf", connect("in1", "a") + connect("in2", "b"))
    body = volume_material(nodes) + BOUND
    assert read(body).media[0].anisotropy == pytest.approx(0.25 * 0.5 - 0.75 * 0.5)
    assert kinds(examine(body)) == [
        "mixed phase functions are rendered as the one of their mean cosine"
    ]


def test_coefficients_may_come_through_constant_nodes_and_others_are_named(examine, read):
    double = node(
        "double", "ND_multiply_vector3FA", "float3 inputs:in1 = (1, 2, 3)\nfloat inputs:in2 = 2"
    )
    vdf = node("vdf", "ND_anisotropic_vdf", connect("scattering", "double", "float3"))
    assert read(volume_material(double + vdf) + BOUND).media[0].scattering == (2, 4, 6)
    noise = node("double", "ND_noise3d_float")
    body = volume_material(noise + vdf) + BOUND
    assert read(body).media[0].scattering == (0, 0, 0)
    (warning,) = (w for w in examine(body).warnings if "vary" in w.kind)
    assert warning.paths == ["/M/vdf"]


def test_colors_of_media_are_those_of_the_rendering_space(read):
    edf = node("edf", "ND_uniform_edf", "color3f inputs:color = (0, 1, 0)")
    body = volume_material(FOG + edf, connect("vdf", "vdf") + connect("edf", "edf")) + BOUND
    found = read(body, color_space="lin_ap1_scene").media[0]
    assert found.emission == pytest.approx((0.3395, 0.9164, 0.1096), abs=1e-3)  # of Rec.709's green
    assert found.scattering == (1, 2, 3)  # a vector is no colour


def test_unknown_closures_leave_the_volume_out(examine):
    found = examine(volume_material(node("vdf", "ND_fancy_vdf")) + BOUND)
    assert found.media == []
    assert "MaterialX volumes of type ND_fancy_vdf are not rendered" in kinds(found)


def test_volumes_that_go_round_in_a_circle_are_left_out(examine):
    found = examine(volume_material(node("vdf", "ND_add_vdf", connect("in1", "vdf"))) + BOUND)
    assert found.media == []
    assert any("circle" in kind for kind in kinds(found))


# ---------------------------------------------------------------------------------------------
# What surfaces are filled with


def test_a_bsdf_over_a_volume_is_filled_with_it(read):
    layer = node("layer", "ND_layer_vdf", connect("top", "glass") + connect("base", "vdf"))
    scene = read(mtlx_material(GLASS_NODE + FOG + layer, connect("bsdf", "layer")) + BOUND)
    (mesh,) = scene.meshes
    assert scene.media[mesh.medium].scattering == (1, 2, 3)


MODELS = {"standard_surface": "transmission", "open_pbr_surface": "transmission_weight"}


@pytest.mark.parametrize("model", MODELS)
def test_light_has_the_transmission_color_after_the_depth(interior, read, model):
    inputs = f"""float inputs:{MODELS[model]} = 1
        float inputs:transmission_depth = 2
        color3f inputs:transmission_color = (0.5, 0.25, 1)
        float inputs:transmission_scatter_anisotropy = 0.25"""
    found = interior(model, inputs)
    assert np.exp(-2 * np.array(found.absorption)) == pytest.approx((0.5, 0.25, 1), rel=1e-6)
    assert (found.scattering, found.anisotropy) == ((0, 0, 0), 0.25)
    surface = read(mtlx_material("", inputs, f"ND_{model}_surfaceshader") + BOUND).materials[0]
    assert surface.closure.transmission_tint == (1, 1, 1)


@pytest.mark.parametrize("model", MODELS)
def test_scattering_is_taken_from_the_extinction_and_what_lacks_is_grey(interior, model):
    inputs = f"""float inputs:{MODELS[model]} = 1
        float inputs:transmission_depth = 4
        color3f inputs:transmission_color = (0.5, 0.5, 0.25)
        color3f inputs:transmission_scatter = (1, 0.5, 0.5)"""
    found = interior(model, inputs)
    assert found.scattering == (0.25, 0.125, 0.125)
    bare = np.array([math.log(2) - 1, math.log(2) - 0.5, math.log(4) - 0.5]) / 4
    assert found.absorption == pytest.approx(bare - bare.min(), rel=1e-6)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "inputs",
    [
        "WEIGHT = 1",  # a tint at the surface
        "float inputs:transmission_depth = 2",  # nothing is transmitted
        "WEIGHT = 1\nfloat inputs:transmission_depth = 2\nbool inputs:THIN = 1",
    ],
)
def test_without_depth_weight_or_inside_there_is_no_medium(interior, model, inputs):
    thin = "geometry_thin_walled" if "pbr" in model else "thin_walled"
    inputs = inputs.replace("WEIGHT", f"float inputs:{MODELS[model]}").replace("THIN", thin)
    assert interior(model, inputs) is None


def test_a_black_transmission_color_absorbs_all_but_nothing(interior):
    inputs = """float inputs:transmission_weight = 1
        float inputs:transmission_depth = 1
        color3f inputs:transmission_color = (0, 0, 0)"""
    assert np.isfinite(interior("open_pbr_surface", inputs).absorption).all()


# ---------------------------------------------------------------------------------------------
# Bodies


def test_a_mesh_that_is_only_a_volume_has_no_surface(read):
    scene = read(volume_material(FOG) + BOUND)
    assert scene.meshes == []
    (volume,) = scene.volumes
    assert (volume.name, scene.media[volume.medium].name) == ("/c", "/M")


@pytest.mark.parametrize("shape", ["Cube", "Sphere", "Cylinder", "Cone", "Capsule"])
def test_shapes_are_closed(read, shape):
    (mesh,) = read(f'def {shape} "c" {{}}').meshes
    assert is_closed(mesh)


def test_vertices_that_are_split_are_one_point(only_mesh):
    mesh = only_mesh(f'def Mesh "m" {{ {CUBE} uniform token subdivisionScheme = "none" }}')
    assert is_closed(mesh)
    mesh.points = mesh.points[mesh.triangles.ravel()]
    mesh.triangles = np.arange(len(mesh.points), dtype=np.int32).reshape(-1, 3)
    assert is_closed(mesh)
    mesh.points += np.random.default_rng(1).uniform(-1e-7, 1e-7, mesh.points.shape)
    assert is_closed(mesh)
    mesh.triangles = mesh.triangles[1:]
    assert not is_closed(mesh)


def test_a_mesh_that_is_not_closed_holds_no_medium_and_says_so(examine, read):
    body = """
        float inputs:transmission_weight = 1
        float inputs:transmission_depth = 2
        color3f inputs:transmission_color = (0.5, 0.5, 0.5)"""
    body = mtlx_material("", body, "ND_open_pbr_surface_surfaceshader")
    body += """def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        QUAD
        rel material:binding = </M>
    }"""
    assert read(body).meshes[0].medium is None
    (warning,) = (w for w in examine(body).warnings if "closed" in w.kind)
    assert (warning.kind, warning.paths) == ("meshes that are not closed hold no medium", ["/m"])


def test_glass_is_clear_inside_as_soon_as_there_is_fog(read):
    glass = mtlx_material(GLASS_NODE, GLASS) + BOUND
    assert read(glass).meshes[0].medium is None
    fog = volume_material(FOG, name="F").replace("/M/", "/F/")
    fog += """def Cube "f" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        rel material:binding = </F>
    }"""
    scene = read(glass + fog)
    (mesh,) = scene.meshes
    assert scene.media[mesh.medium] == Medium(name="clear")


def test_priorities_are_read_and_whole(read):
    body = volume_material(FOG) + BOUND.replace("{ rel", "{ int usdmlt:mediumPriority = 7\nrel")
    assert read(body).volumes[0].medium_priority == 7
    with pytest.raises(Error, match=r"/c: usdmlt:mediumPriority is 0.5"):
        read(body.replace("int usdmlt:mediumPriority = 7", "float usdmlt:mediumPriority = 0.5"))


@pytest.mark.parametrize(
    ("offset", "radius", "priority", "named"),
    [
        (1.0, 1.0, 0, True),  # half in, half out
        (1.0, 1.0, 1, False),
        (0.0, 0.5, 0, False),  # one holds the other
        (0.0, 0.99, 0, False),
        (1.8, 0.9, 0, False),  # the boxes overlap, the balls do not
    ],
)
def test_media_that_overlap_in_part_without_priority_are_named(
    examine, offset, radius, priority, named
):
    balls = f"""
    def Sphere "a" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ rel material:binding = </M> }}
    def Sphere "b" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        rel material:binding = </N>
        int usdmlt:mediumPriority = {priority}
        double radius = {radius}
        double3 xformOp:translate = ({offset}, {offset * 0.7}, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""
    media = volume_material(FOG) + volume_material(FOG, name="N").replace("/M/", "/N/")
    paths = [w.paths for w in examine(media + balls).warnings if "overlap" in w.kind]
    assert paths == ([["/a and /b"]] if named else [])


def test_subsets_count_by_their_triangles(read):
    """A cube of two materials: five faces hold one medium, the sixth another."""
    one = volume_material(anisotropic("vdf", "(1, 1, 1)"))
    two = volume_material(anisotropic("vdf", "(2, 2, 2)"), name="N").replace("/M/", "/N/")
    body = f"""def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        {CUBE}
        uniform token subdivisionScheme = "none"
        rel material:binding = </M>
        def GeomSubset "s" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [2]
            rel material:binding = </N>
        }}
    }}"""
    scene = read(one + two + body)
    assert scene.media[scene.volumes[0].medium].name == "/M"


def test_instances_are_bodies_each(read):
    """Of glass with a medium the prototype is; without a surface every instance is a volume."""
    asset = 'def Xform "asset" {' + BOUND + "}"
    surface = mtlx_material(
        "",
        "float inputs:transmission_weight = 1\nfloat inputs:transmission_depth = 1\n"
        "color3f inputs:transmission_color = (0.5, 0.5, 0.5)",
        "ND_open_pbr_surface_surfaceshader",
    )
    scene = read(surface + asset + instance("a") + instance("b"))
    assert [mesh.medium for mesh in scene.prototypes[0].meshes] == [0]
    scene = read(volume_material(FOG) + asset + instance("a") + instance("b"))
    assert len(scene.volumes) == 3  # the asset itself is drawn too
    assert scene.prototypes == []


def test_coefficients_below_0_count_as_0(examine, read):
    body = volume_material(anisotropic("vdf", "(-1, 2, 3)")) + BOUND
    assert read(body).media[0].scattering == (0, 2, 3)
    (warning,) = (w for w in examine(body).warnings if "below 0" in w.kind)
    assert warning.paths == ["/M/vdf"]
    with pytest.raises(Error, match="/M/vdf: coefficients of media below 0 count as 0"):
        read(body, strict=True)


@pytest.mark.parametrize("g", [1, -1, 5])
def test_anisotropies_that_cannot_be_count_as_nearly_1(examine, read, g):
    body = volume_material(anisotropic("vdf", "(1, 1, 1)", g=g)) + BOUND
    assert read(body).media[0].anisotropy == pytest.approx(0.999 * np.sign(g))
    assert any(w.paths == ["/M/vdf"] for w in examine(body).warnings if "anisotrop" in w.kind)


def test_coefficients_that_are_not_finite_are_an_error_with_their_path(read):
    with pytest.raises(Error, match=r"/M/vdf\.inputs:scattering: not a finite value"):
        read(volume_material(anisotropic("vdf", "(1, inf, 1)")) + BOUND)


# ---------------------------------------------------------------------------------------------
# The medium that fills the world

SETTINGS = 'def RenderSettings "r" { rel usdmlt:worldMedium = </M> }\n'


def test_the_render_settings_name_a_medium_that_fills_the_world(read, examine):
    body = volume_material(FOG) + SETTINGS + 'def SphereLight "l" {}'
    scene = read(body)
    assert scene.media[scene.world_medium].scattering == (1, 2, 3)
    found = examine(body)
    assert (found.world_medium, kinds(found)) == ("/M", [])


@pytest.mark.parametrize("target", ["/nowhere", "/l"])
def test_a_world_medium_that_is_none_is_warned_of(examine, target):
    body = volume_material(FOG) + SETTINGS.replace("</M>", f"<{target}>")
    found = examine(body + 'def SphereLight "l" {}')
    assert found.world_medium is None
    assert kinds(found) == ["usdmlt:worldMedium names no material with a volume"]


def test_lights_at_infinity_are_lost_in_it_and_said_once(write, caplog):
    body = volume_material(FOG) + SETTINGS
    body += 'def DomeLight "d" {}\ndef DistantLight "s" {}\ndef SphereLight "l" {}'
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        load(write(body))
    assert [record.getMessage() for record in caplog.records] == [
        "lights at infinity give no light where a medium fills the world: /d, /s"
    ]


# ---------------------------------------------------------------------------------------------
# Pictures


def test_a_slab_lets_through_what_beer_says(read):
    """Before a glowing wall, from a camera that sees nothing else: e^(-σ d)."""
    absorbing = node("vdf", "ND_absorption_vdf", "float3 inputs:absorption = (0.25, 0.5, 1)")
    wall = mtlx_material(
        node("edf", "ND_uniform_edf", "color3f inputs:color = (1, 1, 1)"), connect("edf", "edf")
    )
    wall = wall.replace("/M", "/W").replace('"M"', '"W"')
    scene = read(
        volume_material(absorbing)
        + wall
        + BOUND
        + """
        def Cube "wall" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </W>
            double size = 20
            double3 xformOp:translate = (0, 0, -20)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        def Camera "main_cam" {
            float focalLength = 200
            double3 xformOp:translate = (0, 0, 10)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }""",
        width=8,
    )
    got = picture(scene, samples=64)[..., :3].mean(axis=(0, 1))
    assert got == pytest.approx(np.exp(-2 * np.array([0.25, 0.5, 1])), rel=1e-2)
