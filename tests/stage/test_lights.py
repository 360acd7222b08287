"""Lights: radiance from intensity, exposure, colour, temperature and normalisation; shapes."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import UsdLux
from scipy import integrate

from usdmlt.errors import Error
from usdmlt.stage.light_sizes import (
    cylinder_area,
    disk_area,
    distant_size,
    rect_area,
    sphere_area,
)

COLOR = "color3f inputs:color = (0.5, 0.25, 1)"
SCALED = """
    float3 xformOp:scale = (2, 3, 5)
    uniform token[] xformOpOrder = ["xformOp:scale"]
"""


@pytest.fixture
def only_light(read):
    """The one light of a stage with the given body."""

    def read_light(body: str, metadata: str = "", **options):
        scene = read(body, metadata, **options)
        assert len(scene.lights) == 1
        return scene.lights[0]

    return read_light


def test_radiance_is_intensity_times_color_in_stops_of_exposure(only_light):
    light = only_light(f"""def RectLight "l" {{ {COLOR}
        float inputs:intensity = 3
        float inputs:exposure = 2 }}""")
    assert light.radiance == pytest.approx((6, 3, 12))


def test_the_schema_defaults_apply(only_light):
    assert only_light('def SphereLight "l" {}').radiance == (1, 1, 1)
    sun = only_light('def DistantLight "l" {}')
    assert sun.radiance == (50000, 50000, 50000)
    assert sun.angle_degrees == pytest.approx(0.53)


@pytest.mark.parametrize("kelvin", [1000, 2700, 6500, 10000])
def test_color_temperature_tints_the_color(only_light, kelvin):
    light = only_light(f"""def SphereLight "l" {{ {COLOR}
        bool inputs:enableColorTemperature = true
        float inputs:colorTemperature = {kelvin} }}""")
    tint = np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
    assert light.radiance == pytest.approx(tuple(tint * (0.5, 0.25, 1)))
    # Normalised to the luminance of white.
    assert tint @ (0.2126, 0.7152, 0.0722) == pytest.approx(1, abs=1e-3)


def test_color_temperature_counts_only_when_enabled(only_light):
    light = only_light('def SphereLight "l" { float inputs:colorTemperature = 2000 }')
    assert light.radiance == (1, 1, 1)


@pytest.mark.parametrize(
    ("body", "area"),
    [
        ('def RectLight "l" { float inputs:width = 4\nfloat inputs:height = 7', 4 * 7 * 6),
        ('def DiskLight "l" { float inputs:radius = 2', np.pi * 4 * 6),
        (
            'def CylinderLight "l" { float inputs:radius = 2\nfloat inputs:length = 9',
            # the perimeter of an ellipse of semi-axes 6 and 10, by elliptic integral
            9 * 2 * 51.05399772679,
        ),
    ],
)
def test_normalize_divides_by_the_area_in_the_world(only_light, body, area):
    light = only_light(f"{body}\nbool inputs:normalize = true\n{SCALED} }}")
    assert light.radiance == pytest.approx((1 / area,) * 3, rel=1e-6)


def test_the_area_of_a_sphere_is_exact_and_of_an_ellipsoid_nearly():
    assert sphere_area(3 * np.eye(3), 2.0) == pytest.approx(4 * np.pi * 36)
    a, b, c = 2.0, 3.0, 5.0

    def element(phi, theta):
        s, k = np.sin(theta), np.cos(theta)
        return s * np.sqrt(
            (b * c * s * np.cos(phi)) ** 2 + (a * c * s * np.sin(phi)) ** 2 + (a * b * k) ** 2
        )

    exact, _ = integrate.dblquad(element, 0, np.pi, 0, 2 * np.pi)
    assert sphere_area(np.diag([a, b, c]), 1.0) == pytest.approx(exact, rel=0.0106)


def test_areas_do_not_depend_on_rotation():
    q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    scale = np.diag([2.0, 3.0, 5.0])
    for area in (
        lambda m: rect_area(m, 4, 7),
        lambda m: disk_area(m, 2),
        lambda m: sphere_area(m, 2),
        lambda m: cylinder_area(m, 2, 9),
    ):
        assert area(scale @ q) == pytest.approx(area(scale))


@pytest.mark.parametrize("angle", [0.0, 0.53, 60.0, 180.0, 270.0, 360.0])
def test_a_normalized_distant_light_gives_its_intensity_in_lux(angle):
    half = np.radians(angle) / 2
    exact = 1.0
    if angle > 0:
        exact, _ = integrate.quad(lambda t: abs(np.cos(t)) * np.sin(t) * 2 * np.pi, 0, half)
    assert distant_size(angle) == pytest.approx(exact)


def test_a_dome_ignores_normalize(only_light):
    light = only_light('def DomeLight "l" { bool inputs:normalize = true\n' + SCALED + "}")
    assert light.radiance == (1, 1, 1)


def test_attributes_of_old_files_count_where_new_ones_are_not_authored(only_light):
    light = only_light("""def RectLight "l" {
        float intensity = 5
        color3f color = (1, 0, 0)
        float width = 3
        float inputs:height = 2
        float height = 9 }""")
    assert light.radiance == (5, 0, 0)
    assert (light.width, light.height) == (3, 2)


def test_shapes_and_sizes(read):
    scene = read("""
        def RectLight "r" { float inputs:width = 2\nfloat inputs:height = 3 }
        def DiskLight "d" { float inputs:radius = 4 }
        def SphereLight "s" { float inputs:radius = 5 }
        def CylinderLight "c" { float inputs:radius = 6\nfloat inputs:length = 7 }""")
    rect, disk, sphere, cylinder = scene.lights
    assert (rect.width, rect.height, disk.radius, sphere.radius) == (2, 3, 4, 5)
    assert (cylinder.radius, cylinder.length) == (6, 7)


def test_lights_are_where_their_transform_puts_them(only_light):
    light = only_light("""def Xform "x" {
        double3 xformOp:translate = (1, 2, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def DiskLight "l" { float xformOp:rotateX = -90
            uniform token[] xformOpOrder = ["xformOp:rotateX"] } }""")
    assert light.transform[3, :3].tolist() == [1, 2, 3]
    # A disk emits along -z; turned by -90° about x that is down.
    assert np.array([0, 0, -1, 0]) @ light.transform == pytest.approx([0, -1, 0, 0], abs=1e-12)


def test_shaping_applies_with_its_schema_and_its_defaults(only_light):
    assert only_light('def SphereLight "l" {}').shaping is None
    shaping = only_light("""def SphereLight "l" (prepend apiSchemas = ["ShapingAPI"]) {
        float inputs:shaping:focus = 3
        float inputs:shaping:cone:softness = 0.25 }""").shaping
    assert (shaping.focus, shaping.cone_softness) == (3, 0.25)
    assert (shaping.cone_angle_degrees, shaping.focus_tint) == (90, (0, 0, 0))


def test_dome_poles(only_light):
    def directions(body, metadata=""):
        """Where the top row and the centre column of the texture point."""
        transform = only_light(body, metadata).transform
        return (np.array([[0, 1, 0, 0], [0, 0, 1, 0]]) @ transform)[:, :3].round(9).tolist()

    y_pole, z_pole = [[0, 1, 0], [0, 0, 1]], [[0, 0, 1], [0, -1, 0]]
    up = 'upAxis = "Z"'
    assert directions('def DomeLight "l" {}') == y_pole
    assert directions('def DomeLight "l" {}', up) == y_pole
    assert directions('def DomeLight_1 "l" { token poleAxis = "scene" }') == y_pole
    assert directions('def DomeLight_1 "l" { token poleAxis = "scene" }', up) == z_pole
    assert directions('def DomeLight_1 "l" { token poleAxis = "Z" }') == z_pole
    assert directions('def DomeLight_1 "l" { token poleAxis = "Y" }', up) == y_pole


def test_the_pole_is_turned_before_the_light_is(only_light):
    light = only_light("""def DomeLight_1 "l" { token poleAxis = "Z"
        float xformOp:rotateY = 90
        uniform token[] xformOpOrder = ["xformOp:rotateY"] }""")
    # The pole goes to +z, and the light's own rotation takes that to +x.
    assert np.array([0, 1, 0, 0]) @ light.transform == pytest.approx([1, 0, 0, 0], abs=1e-12)


def test_a_distant_light_at_no_place_names_its_path(read):
    with pytest.raises(Error, match=r"^/l: the light's transform is not finite"):
        read("""def DistantLight "l" { double3 xformOp:translate = (inf, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }""")


def test_invisible_lights_are_off(examine):
    found = examine("""def RectLight "l" { token visibility = "invisible" }
        def SphereLight "s" {}""")
    assert found.lights == [("SphereLight", "/s")]


def test_a_stage_without_lights_gets_a_white_dome_and_says_so(read, examine):
    scene = read('def Cube "c" {}')
    assert [light.radiance for light in scene.lights] == [(1, 1, 1)]
    assert scene.lights[0].texture is None
    assert any("no lights" in w.kind for w in examine('def Cube "c" {}').warnings)


def test_the_white_dome_is_no_error_when_strict(read):
    assert len(read('def Cube "c" {}', strict=True).lights) == 1


def test_emissive_materials_are_lights_enough(read):
    scene = read("""
        def Material "M" {
            token outputs:surface.connect = </M/s.outputs:surface>
            def Shader "s" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:emissiveColor = (1, 1, 1)
                token outputs:surface
            }
        }
        def Cube "c" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </M> }""")
    assert scene.lights == []


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ('def RectLight "l" { float inputs:width = -1 }', "/l: width of the light is -1"),
        ('def RectLight "l" { float inputs:height = 0 }', "/l: height of the light is 0"),
        ('def DiskLight "l" { float inputs:radius = 0 }', "/l: radius of the light is 0"),
        ('def SphereLight "l" { float inputs:radius = -2 }', "/l: radius of the light is -2"),
        ('def CylinderLight "l" { float inputs:length = 0 }', "/l: length of the light is 0"),
        ('def DistantLight "l" { float inputs:angle = -1 }', "/l: angle of the light is -1"),
        ('def SphereLight "l" { float inputs:intensity = nan }', "/l: intensity is nan"),
        (
            'def RectLight "l" { float3 xformOp:scale = (1, 0, 1)\n'
            'uniform token[] xformOpOrder = ["xformOp:scale"] }',
            "/l: the light's transform is singular",
        ),
    ],
)
def test_lights_that_cannot_be_name_their_path(read, body, says):
    with pytest.raises(Error, match=says):
        read(body)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("float inputs:diffuse = 0.5", "multipliers"),
        ("rel light:filters = </f>", "light filters"),
        ("rel collection:shadowLink:excludes = </c>", "shadow linking"),
        ("bool inputs:shadow:enable = false", "cast shadows"),
        ("rel portals = </p>", "portals"),
        ("float inputs:intensity = -1", "negative intensity"),
    ],
)
def test_what_lights_cannot_do_is_warned_of(examine, content, says):
    found = examine(f"""def SphereLight "l" (
        prepend apiSchemas = ["ShadowAPI", "ShapingAPI"]
    ) {{ {content} }}""")
    assert [w.paths for w in found.warnings if says in w.kind] == [["/l"]]


@pytest.mark.parametrize("kind", ["PortalLight", "GeometryLight"])
def test_other_lights_are_warned_of(examine, kind):
    found = examine(f'def {kind} "l" {{}}')
    assert [w.paths for w in found.warnings if kind in w.kind] == [["/l"]]


@pytest.mark.parametrize(
    ("body", "area"),
    [
        ('SphereLight "l" { bool treatAsPoint = true', 4 * np.pi * 0.1**2),
        (
            'CylinderLight "l" { bool treatAsLine = true\nfloat inputs:length = 3',
            2 * np.pi * 0.1 * 3,
        ),
    ],
)
def test_a_point_or_line_of_no_radius_is_a_millimetre_thick_and_as_if_normalized(
    only_light, body, area
):
    """The scene's unit is a centimetre."""
    light = only_light(f"def {body}\nfloat inputs:radius = 0 }}", "metersPerUnit = 0.01")
    assert light.radius == pytest.approx(0.1)
    assert light.radiance == pytest.approx((1 / area,) * 3, rel=1e-6)


def test_a_light_of_some_radius_is_rendered_with_it_though_it_may_be_a_point(only_light):
    light = only_light('def SphereLight "l" { bool treatAsPoint = true }')
    assert (light.radius, light.radiance) == (0.5, (1, 1, 1))


def test_no_radius_without_the_hint_is_an_error(read):
    with pytest.raises(Error, match="radius of the light is 0"):
        read('def SphereLight "l" { float inputs:radius = 0 }')


@pytest.mark.parametrize("kind", ["SphereLight", "DomeLight", "DistantLight"])
def test_invisible_lights_give_no_light(read, kind):
    body = f'def {kind} "l" {{ token visibility = "invisible" }}'
    assert read(body, default_light=False).lights == []
    assert len(read(body.replace("invisible", "inherited")).lights) == 1


@pytest.mark.parametrize(
    ("attribute", "says"),
    [
        ("float inputs:exposure = 2000", "/l: exposure of the light is 2000"),
        ("float inputs:shaping:focus = nan", "/l: shaping:focus is nan, not a number"),
        ("float inputs:shaping:cone:angle = inf", "/l: shaping:cone:angle is inf"),
        ("float inputs:intensity = nan", "/l: intensity is nan"),
    ],
)
def test_numbers_that_cannot_be_name_the_light(read, attribute, says):
    with pytest.raises(Error, match=says):
        read(f"""def SphereLight "l" (prepend apiSchemas = ["ShapingAPI"]) {{ {attribute} }}""")
