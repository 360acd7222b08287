"""Cameras: which one, its window, lens and exposure, and the size of the image."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from support.rendering import rgba
from usdmlt.errors import Error
from usdmlt.stage import load
from usdmlt.stage.cameras import exposure_scale

CAMERA = """def Camera "{name}" {{
    float focalLength = 40
    float horizontalAperture = 20
    float verticalAperture = 10
    {extra}
}}
"""


def camera(name: str = "c", extra: str = "") -> str:
    return CAMERA.format(name=name, extra=extra)


def test_the_window_is_aperture_over_focal_length(read):
    scene = read(camera())
    assert scene.camera.window == pytest.approx((-0.25, 0.25, -0.125, 0.125))
    assert (scene.width, scene.height) == (960, 480)


def test_offsets_shift_the_window(read):
    extra = "float horizontalApertureOffset = 4\nfloat verticalApertureOffset = -2"
    scene = read(camera(extra=extra))
    assert scene.camera.window == pytest.approx((-0.15, 0.35, -0.175, 0.075))


def test_the_window_is_that_of_usds_frustum(write):
    extra = """
        float horizontalApertureOffset = 3
        float verticalApertureOffset = 1.5
    """
    stage = Usd.Stage.Open(str(write(camera(extra=extra))))
    frustum = UsdGeom.Camera.Get(stage, "/c").GetCamera(Usd.TimeCode.Default()).frustum
    low, high = frustum.window.min, frustum.window.max
    window = load(stage).camera.window
    assert window == pytest.approx((low[0], high[0], low[1], high[1]))


def test_an_orthographic_window_is_in_scene_units(read):
    scene = read(camera(extra='token projection = "orthographic"\nfloat fStop = 2'))
    assert scene.camera.projection == "orthographic"
    assert scene.camera.window == pytest.approx((-1, 1, -0.5, 0.5))
    assert scene.camera.lens_radius == 0


def test_the_lens_radius_follows_from_the_f_number(read):
    lens = read(camera(extra="float fStop = 2.8\nfloat focusDistance = 7")).camera
    # 40 tenths of a unit over 2 f-numbers
    assert lens.lens_radius == pytest.approx(4 / (2 * 2.8))
    assert lens.focus_distance == 7


def test_an_f_number_of_0_is_a_pinhole(read):
    assert read(camera(extra="float fStop = 0\nfloat focusDistance = 7")).camera.lens_radius == 0


def test_a_lens_without_focus_distance_is_in_focus_everywhere(examine, read):
    body = camera(extra="float fStop = 2")
    assert read(body).camera.lens_radius == 0
    assert any("focusDistance" in w.kind for w in examine(body).warnings)


def test_the_transform_and_the_clipping_range(read):
    lens = read(
        camera(
            extra="""float2 clippingRange = (0.5, 200)
            double3 xformOp:translate = (1, 2, 3)
            uniform token[] xformOpOrder = ["xformOp:translate"]"""
        )
    ).camera
    assert lens.clipping == (0.5, 200)
    assert lens.transform[3, :3].tolist() == [1, 2, 3]


def test_scale_and_mirroring_leave_a_camera_rigid_as_usds_frustum_does(write):
    extra = """
        float fStop = 2
        float focusDistance = 7
        double3 xformOp:translate = (1, 2, 3)
        float3 xformOp:rotateXYZ = (10, 20, 30)
        float3 xformOp:scale = (-2, 2, 2)
        uniform token[] xformOpOrder = [
            "xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
    """
    stage = Usd.Stage.Open(str(write(camera(extra=extra))))
    frustum = UsdGeom.Camera.Get(stage, "/c").GetCamera(Usd.TimeCode.Default()).frustum
    lens = load(stage).camera
    assert lens.transform == pytest.approx(np.array(frustum.ComputeViewInverse()), abs=1e-6)
    assert (lens.lens_radius, lens.focus_distance) == (1, 7)


EXPOSURE = """
    float exposure = 1
    float exposure:iso = 400
    float exposure:time = 0.5
    float exposure:fStop = 2
    float exposure:responsivity = 3
"""


def test_the_exposure_scale_is_the_physical_one(write):
    # 3 · 0.5 · 400 / 100 · 2^1 / 2²
    stage = Usd.Stage.Open(str(write(camera(extra=EXPOSURE))))
    assert load(stage).camera.exposure == pytest.approx(3.0)

    class Old:
        """A camera of a USD that does not know the formula."""

        def GetPrim(self):
            return stage.GetPrimAtPath("/c")

    assert exposure_scale(Old(), Usd.TimeCode.Default()) == pytest.approx(3.0)


def test_the_default_exposure_is_1(read):
    assert read(camera()).camera.exposure == 1


# ---------------------------------------------------------------------------------------------
# Which camera

SETTINGS = 'def RenderSettings "settings" { rel camera = </b> }\n'
THREE = camera("a") + camera("b") + camera("main_cam")


@pytest.mark.parametrize(
    ("body", "asked", "expected"),
    [
        (SETTINGS + THREE, "a", "/a"),
        (SETTINGS + THREE, "/a", "/a"),
        (SETTINGS + THREE, None, "/b"),
        (THREE, None, "/main_cam"),
        (camera("only"), None, "/only"),
        (camera("a") + camera("b"), None, ""),
    ],
)
def test_the_camera_is_chosen_in_order(read, body, asked, expected):
    assert read(body, camera=asked).camera.name == expected


def test_cameras_below_other_prims_are_found_by_name_or_path(read):
    body = 'def Xform "x" { ' + camera("deep") + " }"
    assert read(body, camera="deep").camera.name == "/x/deep"
    assert read(body, camera="x/deep").camera.name == "/x/deep"


def test_a_missing_camera_lists_those_there_are(read):
    with pytest.raises(Error, match="none: no such camera; there are /a, /b, /main_cam"):
        read(THREE, camera="none")
    with pytest.raises(Error, match="there is none"):
        read('def Cube "c" {}', camera="/c")


def test_an_ambiguous_name_lists_the_candidates(read):
    body = f'def "x" {{ {camera("c")} }}\ndef "y" {{ {camera("c")} }}'
    with pytest.raises(Error, match="several cameras have that name: /x/c, /y/c"):
        read(body, camera="c")


def test_missing_cameras_of_the_settings_are_warned_of(examine):
    found = examine('def RenderSettings "settings" { rel camera = </gone> }\n' + camera("only"))
    assert found.camera == "/only"
    assert any(w.paths == ["/gone"] for w in found.warnings)


def test_the_stage_names_its_render_settings(read):
    body = """def RenderSettings "first" { int2 resolution = (10, 10) }
        def RenderSettings "chosen" { int2 resolution = (20, 30) }"""
    assert read(body).width == 10
    assert read(body, 'renderSettingsPrimPath = "/chosen"').height == 30


@pytest.mark.parametrize(
    ("extra", "says"),
    [
        ("float focalLength = 0", "/c: the camera's focalLength"),
        ("float horizontalAperture = -1", "/c: the camera's apertures"),
        ("float verticalApertureOffset = -1e30", "/c: the camera's apertures are nothing"),
        ("float horizontalApertureOffset = 3e9", "/c: the camera's apertures are nothing"),
        ("float verticalAperture = nan", "/c: verticalAperture is nan"),
        (
            'float3 xformOp:scale = (0, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]',
            "/c: the camera's transform is singular",
        ),
        (
            "matrix4d xformOp:transform = ((1, 0, 0, 5), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 0))"
            '\nuniform token[] xformOpOrder = ["xformOp:transform"]',
            "/c: the camera's transform is singular",
        ),
    ],
)
def test_cameras_that_cannot_see_name_their_path(read, extra, says):
    body = f'def Camera "c" {{ {extra} }}'
    with pytest.raises(Error, match=says):
        read(body)


# ---------------------------------------------------------------------------------------------
# Size


@pytest.mark.parametrize(
    ("width", "height", "expected"),
    [(None, None, (960, 480)), (100, None, (100, 50)), (None, 100, (200, 100)), (7, 9, (7, 9))],
)
def test_the_size_follows_the_camera(read, width, height, expected):
    scene = read(camera(), width=width, height=height)
    assert (scene.width, scene.height) == expected


def test_the_height_is_truncated_as_usdrecord_does(read):
    scene = read('def Cube "c" {}', width=960)
    assert scene.height == int(960 / (20.955 / 15.2908))


@pytest.mark.parametrize(
    ("width", "height", "expected"),
    [(None, None, (640, 480)), (320, None, (320, 240)), (None, 96, (128, 96)), (50, 60, (50, 60))],
)
def test_the_resolution_of_the_settings_counts(read, width, height, expected):
    body = camera() + 'def RenderSettings "settings" { int2 resolution = (640, 480) }'
    scene = read(body, width=width, height=height)
    assert (scene.width, scene.height) == expected


@pytest.mark.parametrize(
    ("policy", "tall", "wide"),
    [
        # The camera's window is 0.5 x 0.25; images of aspect 1 and 4.
        ("expandAperture", (0.5, 0.5), (1.0, 0.25)),
        ("cropAperture", (0.25, 0.25), (0.5, 0.125)),
        ("adjustApertureWidth", (0.25, 0.25), (1.0, 0.25)),
        ("adjustApertureHeight", (0.5, 0.5), (0.5, 0.125)),
        ("adjustPixelAspectRatio", (0.5, 0.25), (0.5, 0.25)),
    ],
)
def test_the_window_conforms_to_the_aspect_by_policy(read, policy, tall, wide):
    settings = f'def RenderSettings "settings" {{ token aspectRatioConformPolicy = "{policy}" }}'
    body = camera(extra="float horizontalApertureOffset = 8") + settings
    for (width, height), expected in (((100, 100), tall), ((400, 100), wide)):
        left, right, bottom, top = read(body, width=width, height=height).camera.window
        assert (right - left, top - bottom) == pytest.approx(expected)
        # About the window's centre, offset included.
        assert ((left + right) / 2, (bottom + top) / 2) == pytest.approx((0.2, 0))


@pytest.mark.parametrize("value", [0, -3, 2.5, True])
def test_images_of_no_pixels_are_a_wrong_value(read, value):
    with pytest.raises(ValueError, match="width must be"):
        read(camera(), width=value)


# ---------------------------------------------------------------------------------------------
# Framing


@pytest.mark.parametrize(
    ("up", "size", "distance_axis", "sign"), [("Y", (3, 2, 4), 2, 1), ("Z", (3, 4, 2), 1, -1)]
)
def test_a_stage_without_camera_is_framed_as_usdrecord_does(read, up, size, distance_axis, sign):
    scale = tuple(float(s) for s in size)
    scene = read(
        f"""def Cube "c" {{ double size = 1
            double3 xformOp:translate = (10, 20, 30)
            float3 xformOp:scale = {scale}
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"] }}""",
        f'upAxis = "{up}"',
    )
    # Half the diagonal of the 3 x 2 front over tan of half the field of view of a 50 mm lens with
    # an aperture of 20.955 mm, and half the depth of 4.
    distance = np.hypot(3, 2) / 2 / (20.955 / 2 / 50) + 2
    expected = np.array([10.0, 20.0, 30.0])
    expected[distance_axis] += sign * distance
    assert scene.camera.transform[3, :3] == pytest.approx(expected, rel=1e-5)
    looks = np.array([0, 0, -1, 0]) @ scene.camera.transform
    assert looks[distance_axis] == pytest.approx(-sign)
    assert (np.array([0, 1, 0, 0]) @ scene.camera.transform)["XYZ".index(up)] == pytest.approx(1)
    left, right, bottom, top = scene.camera.window
    assert top == -bottom == pytest.approx(15.2908 / 50 / 2, rel=1e-5)
    # The height of the image is a whole number; its pixels are square nevertheless.
    assert (right - left) / (top - bottom) == pytest.approx(960 / 700)


@pytest.mark.parametrize(("up", "size"), [("Y", (2, 9, 4)), ("Z", (2, 4, 9))])
def test_the_automatic_camera_does_not_cut_off_what_is_tall(read, up, size):
    scene = read(
        f"""def Cube "c" {{ double size = 1
            float3 xformOp:scale = {tuple(float(s) for s in size)}
            uniform token[] xformOpOrder = ["xformOp:scale"] }}""",
        f'upAxis = "{up}"',
    )
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T / 2 * size
    seen = np.c_[corners, np.ones(8)] @ np.linalg.inv(scene.camera.transform)
    on_window = seen[:, :2] / -seen[:, 2:3]
    assert scene.camera.window[2] < on_window[:, 1].min()
    assert on_window[:, 1].max() < scene.camera.window[3]


def test_small_things_are_framed_from_behind_the_near_plane(read):
    scene = read(
        """def Cube "c" { double size = 0.02
            float3 xformOp:scale = (1, 0.5, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }"""
    )
    distance = np.hypot(0.02, 0.01) / 2 / (20.955 / 2 / 50) + 0.01
    assert distance < 1
    assert scene.camera.transform[3, 2] == pytest.approx(distance + 1, rel=1e-5)


def test_wrong_extents_are_not_framed(read):
    body = 'def Mesh "m" { QUAD float3[] extent = [(1, 1, 1), (-1, -1, -1)] }'
    center = read(body).camera.transform[3, :2]
    assert center == pytest.approx([0.5, 0.5], abs=1e-6)


def test_an_empty_stage_has_a_camera_too(read):
    scene = read("")
    assert np.isfinite(scene.camera.transform).all()


def test_clipping_planes_are_read(read, examine):
    body = camera(extra="float4[] clippingPlanes = [(1, 0, 0, 0.5), (0, -1, 0, 2)]")
    assert read(body).camera.clipping_planes.tolist() == [[1, 0, 0, 0.5], [0, -1, 0, 2]]
    assert not any("lipping" in w.kind for w in examine(body).warnings)
    with pytest.raises(Error, match="/c: clippingPlanes are not finite"):
        read(camera(extra="float4[] clippingPlanes = [(1, 0, 0, inf)]"))


def test_an_orthographic_camera_has_no_depth_of_field(read):
    extra = """token projection = "orthographic"
        float fStop = 2
        float focusDistance = 7"""
    assert read(camera(extra=extra)).camera.lens_radius == 0


def test_either_camera_of_a_stereo_pair_is_rendered_by_name(read):
    """Each has an offset of its own; being stereo changes nothing else."""
    pair = "".join(
        f"""def Camera "{name}" {{
            uniform token stereoRole = "{name}"
            float horizontalAperture = 20
            float verticalAperture = 10
            float horizontalApertureOffset = {offset}
            float focalLength = 10
            double3 xformOp:translate = ({x}, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}\n"""
        for name, x, offset in (("left", -0.03, 1), ("right", 0.03, -1))
    )
    left, right = (read(pair, camera=name).camera for name in ("left", "right"))
    assert left.window[:2] == pytest.approx((-0.9, 1.1))
    assert right.window[:2] == pytest.approx((-1.1, 0.9))
    assert right.transform[3, 0] - left.transform[3, 0] == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("visibility", "expected"), [("solo", ["/c (sky)"]), ("mute", []), (None, ["/c (sky)"])]
)
def test_back_plates_are_warned_of(examine, visibility, expected):
    """Of the camera that is rendered."""
    authored = f'token backPlate:sky:plateVisibility = "{visibility}"' if visibility else ""
    plate = '(prepend apiSchemas = ["BackPlateAPI:sky"])'
    body = f'def Camera "c" {plate} {{ {authored} }} def Camera "other" {plate} {{}}'
    found = examine(body, camera="/c").warnings
    assert [path for w in found if "back plates" in w.kind for path in w.paths] == expected


def test_an_edge_out_of_focus_is_as_soft_as_its_circle_of_confusion(read):
    """A lens of radius 0.1 · 50 / (2 · 2.5) = 1, in focus at 10, sees the edge x = 0 of a wall at
    20: the ray of a lens point (u, v) and the direction t meets it at x = 20 t - u."""
    scene = read(
        """
        def Camera "c" {
            float focalLength = 50
            float fStop = 2.5
            float focusDistance = 10
            float horizontalAperture = 10
            float verticalAperture = 10
        }
        def Mesh "wall" { uniform token subdivisionScheme = "none"
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(0, -9, -20), (9, -9, -20), (9, 9, -20), (0, 9, -20)]
        }""",
        width=16,
        height=16,
    )
    covered = rgba(scene, "path", samples=256, depth=1)[..., 3].mean(axis=0)
    edges = np.linspace(-2, 2, 16 * 8 + 1)  # 20 t, as the window is 0.2 wide
    s = np.clip((edges[1:] + edges[:-1]) / 2, -1, 1)
    below = 0.5 + (s * np.sqrt(1 - s * s) + np.arcsin(s)) / np.pi  # of the lens, u < s
    assert covered == pytest.approx(below.reshape(16, 8).mean(axis=1), abs=0.02)
