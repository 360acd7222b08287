"""Motion while the shutter is open: what is read of a stage, at the right times, in few steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from support.coverage import VIEW, covered, pixels
from usdmlt.scene import Instances, Mesh, Scene

FROM_1_TO_2 = "startTimeCode = 1\nendTimeCode = 9\ntimeCodesPerSecond = 10"


def camera(opening: float = 0.0, closing: float = 1.0, extra: str = "") -> str:
    """Sees a square of 4 units from z = 10."""
    return f"""
def Camera "camera" {{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 40
    double shutter:open = {opening}
    double shutter:close = {closing}
    {extra or "double3 xformOp:translate = (0, 0, 10)"}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


def moves(values: str, op: str = "double3 xformOp:translate") -> str:
    """Samples of a transform."""
    name = op.split()[1]
    return f'{op}.timeSamples = {{ {values} }}\nuniform token[] xformOpOrder = ["{name}"]'


def at(mesh: Mesh, time: float) -> np.ndarray:
    """World points of a mesh at a time in [0, 1], as the core has them."""
    steps = [mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3]]
    steps += [s.points @ s.transform[:3, :3] + s.transform[3, :3] for s in mesh.motion]
    whole = min(int(time * (len(steps) - 1)), len(steps) - 2)
    part = time * (len(steps) - 1) - whole
    return steps[whole] * (1 - part) + steps[whole + 1] * part


def matrices(instances: Instances, time: float) -> np.ndarray:
    """(count, 4, 4) at a time in [0, 1]."""
    steps = [instances.transforms, *instances.motion]
    whole = min(int(time * (len(steps) - 1)), len(steps) - 2)
    part = time * (len(steps) - 1) - whole
    return steps[whole] * (1 - part) + steps[whole + 1] * part


def origin_at(mesh: Mesh, time: float) -> np.ndarray:
    return at(mesh, time)[0]


QUAD_THAT_MOVES = 'def Mesh "m" { QUAD ' + moves("0: (0, 0, 0), 10: (10, 0, 0)") + "}"


# ---------------------------------------------------------------------------------------------
# The shutter


def test_the_shutter_opens_and_closes_relative_to_the_frame(read) -> None:
    mesh = read(camera(-0.25, 0.5) + QUAD_THAT_MOVES, FROM_1_TO_2, frame=4).meshes[0]
    assert len(mesh.motion) == 1
    for time in (0, 0.5, 1):
        np.testing.assert_allclose(origin_at(mesh, time), (3.75 + 0.75 * time, 0, 0), atol=1e-6)


@pytest.mark.parametrize(("opening", "closing"), [(0, 0), (0.5, -0.5), (0.25, 0.25)])
def test_a_shutter_that_closes_no_later_than_it_opens_blurs_nothing(
    read, opening: float, closing: float
) -> None:
    mesh = read(camera(opening, closing) + QUAD_THAT_MOVES, FROM_1_TO_2, frame=4).meshes[0]
    assert mesh.motion == []
    assert mesh.transform[3, 0] == 4


@pytest.mark.parametrize("name", ["disableMotionBlur", "instantaneousShutter"])
def test_settings_that_disable_motion_blur_are_followed(read, name: str) -> None:
    settings = f'def RenderSettings "r" {{ rel camera = </camera>\nuniform bool {name} = 1 }}'
    metadata = FROM_1_TO_2 + '\nrenderSettingsPrimPath = "/r"'
    blurred = read(camera() + QUAD_THAT_MOVES, FROM_1_TO_2, frame=4)
    sharp = read(settings + camera() + QUAD_THAT_MOVES, metadata, frame=4)
    assert blurred.meshes[0].motion
    assert sharp.meshes[0].motion == []
    assert sharp.meshes[0].transform[3, 0] == 4


def test_without_a_frame_the_stage_starts_and_without_a_start_nothing_blurs(examine, read) -> None:
    mesh = read(camera() + QUAD_THAT_MOVES, FROM_1_TO_2).meshes[0]
    np.testing.assert_allclose(origin_at(mesh, 1), (2, 0, 0), atol=1e-6)
    assert read(camera() + QUAD_THAT_MOVES).meshes[0].motion == []


def test_what_stays_has_no_motion(read) -> None:
    still = 'def Mesh "m" { QUAD ' + moves("0: (1, 0, 0), 10: (1, 0, 0)") + "}"
    scene = read(camera() + still + 'def Sphere "s" {}', FROM_1_TO_2)
    assert all(mesh.motion == [] for mesh in scene.meshes)
    assert scene.camera.motion == []


# ---------------------------------------------------------------------------------------------
# Transforms


def test_a_path_with_corners_is_followed(read) -> None:
    """Samples a quarter of the shutter's interval apart; held values jump."""
    samples = "1: (0, 0, 0), 1.25: (1, 0, 0), 1.5: (1, 1, 0), 1.75: (0, 1, 0), 2: (0, 0, 0)"
    mesh = read(camera() + f'def Mesh "m" {{ QUAD {moves(samples)} }}', FROM_1_TO_2).meshes[0]
    assert len(mesh.motion) == 4
    np.testing.assert_allclose(origin_at(mesh, 0.375), (1, 0.5, 0), atol=1e-6)
    np.testing.assert_allclose(origin_at(mesh, 0.875), (0, 0.5, 0), atol=1e-6)


def test_turns_take_as_many_steps_as_they_need(read) -> None:
    """A wheel turns by 120 degrees: its rim is never closer to the hub than it is."""
    wheel = 'def Mesh "m" { QUAD ' + moves("1: 0, 2: 120", "double xformOp:rotateZ") + "}"
    mesh = read(camera() + wheel, FROM_1_TO_2).meshes[0]
    assert 8 <= len(mesh.motion) <= 16
    for time in np.linspace(0, 1, 41):
        angle = math.radians(120 * time)
        rim = at(mesh, time)[1]
        np.testing.assert_allclose(rim, (math.cos(angle), math.sin(angle), 0), atol=3e-3)


def test_parents_carry_their_children_and_resets_do_not(read) -> None:
    body = (
        'def Xform "up" {' + moves("1: (0, 0, 0), 2: (0, 2, 0)") + """
        def Mesh "carried" { QUAD """ + moves("1: (0, 0, 0), 2: (1, 0, 0)") + """ }
        def Mesh "free" { QUAD uniform token[] xformOpOrder = ["!resetXformStack!"] }
    }"""
    )  # fmt: skip
    carried, free = read(camera() + body, FROM_1_TO_2).meshes
    np.testing.assert_allclose(origin_at(carried, 0.5), (0.5, 1, 0), atol=1e-6)
    assert free.motion == []


def test_the_camera_moves_and_its_lens_stays(read) -> None:
    moving = camera(
        extra="double3 xformOp:translate.timeSamples = { 1: (0, 0, 10), 2: (3, 0, 10) }"
    )
    scene = read(moving + 'def Mesh "m" { QUAD }', FROM_1_TO_2)
    assert [pose[3, 0] for pose in (scene.camera.transform, *scene.camera.motion)] == [0, 3]
    assert read(camera() + 'def Mesh "m" { QUAD }', FROM_1_TO_2).camera.motion == []


def light_at(light, time: float) -> np.ndarray:
    steps = [light.transform, *light.motion]
    whole = min(int(time * (len(steps) - 1)), len(steps) - 2)
    part = time * (len(steps) - 1) - whole
    return steps[whole] * (1 - part) + steps[whole + 1] * part


TURNING = """
def Xform "up" {{ {parent}
    def {kind} "l" {{
        float3 xformOp:scale = (2, 1, 1)
        {spin}
        uniform token[] xformOpOrder = ["xformOp:rotateZ", "xformOp:scale"] }} }}
def Sphere "s" {{}}"""


def test_lights_are_carried_by_their_parents_and_turn(read) -> None:
    """By 90 degrees about z while the parent goes 3 units along x; the scale stays."""
    body = TURNING.format(
        kind="RectLight",
        parent=moves("1: (0, 0, 5), 2: (3, 0, 5)"),
        spin="double xformOp:rotateZ.timeSamples = { 1: 0, 2: 90 }",
    )
    light = read(camera() + body, FROM_1_TO_2).lights[0]
    for time in (0, 0.25, 0.5, 1):
        m, angle = light_at(light, time), math.radians(90 * time)
        np.testing.assert_allclose(m[3, :3], (3 * time, 0, 5), atol=2e-3)
        np.testing.assert_allclose(m[0, :2], (2 * math.cos(angle), 2 * math.sin(angle)), atol=5e-3)
        np.testing.assert_allclose(m[1, :2], (-math.sin(angle), math.cos(angle)), atol=5e-3)


def test_lights_keep_their_size_with_a_warning(read, examine) -> None:
    """The scale of the frame, which is not the one when the shutter opens."""
    light = """def SphereLight "l" {
        float3 xformOp:scale.timeSamples = { 1: (1, 1, 1), 2: (2, 2, 2) }
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 5), 2: (4, 0, 5) }
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"] }"""
    body = camera(-1.0, 0.0) + light + 'def Sphere "s" {}'
    kept = read(body, FROM_1_TO_2, frame=2).lights[0]
    assert len(kept.motion) == 1
    for time, x in ((0, 0), (0.5, 2), (1, 4)):
        np.testing.assert_allclose(light_at(kept, time)[:3, :3], 2 * np.eye(3), atol=1e-12)
        np.testing.assert_allclose(light_at(kept, time)[3, :3], (x, 0, 5), atol=1e-12)
    found = examine(body, FROM_1_TO_2, frame=2).warnings
    assert [w.paths for w in found if "keep the size" in w.kind] == [["/l"]]


def test_lights_at_infinity_turn_and_do_not_move(read) -> None:
    for kind in ("DomeLight", "DistantLight"):
        still = TURNING.format(
            kind=kind, parent=moves("1: (0, 0, 5), 2: (3, 0, 5)"), spin="double xformOp:rotateZ = 0"
        ).replace("(2, 1, 1)", "(1, 1, 1)")
        assert read(camera() + still, FROM_1_TO_2).lights[0].motion == []
        turns = still.replace("rotateZ = 0", "rotateZ.timeSamples = { 1: 0, 2: 90 }")
        light = read(camera() + turns, FROM_1_TO_2).lights[0]
        np.testing.assert_allclose(light_at(light, 1)[0, :3], (0, 1, 0), atol=1e-9)


def test_the_pole_of_a_dome_turns_with_it(read) -> None:
    body = """def DomeLight_1 "l" { uniform token poleAxis = "Z"
        double xformOp:rotateX.timeSamples = { 1: 0, 2: 90 }
        uniform token[] xformOpOrder = ["xformOp:rotateX"] }
    def Sphere "s" {}"""
    light = read(camera() + body, FROM_1_TO_2).lights[0]
    pole = [light_at(light, time)[1, :3] for time in (0, 1)]  # the description's poles are y
    np.testing.assert_allclose(pole, [(0, 0, 1), (0, -1, 0)], atol=1e-9)


def test_lights_fly_with_their_instances(read) -> None:
    body = """
    def PointInstancer "i" {
        rel prototypes = </i/lamp>
        int[] protoIndices = [0, 0]
        point3f[] positions.timeSamples = { 1: [(0, 0, 0), (0, 5, 0)] }
        vector3f[] velocities.timeSamples = { 1: [(10, 0, 0), (0, 0, 0)] }
        def SphereLight "lamp" { double3 xformOp:translate = (0, 0, 1)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
    }
    def Sphere "s" {}"""
    flying, still = read(camera() + body, FROM_1_TO_2).lights
    np.testing.assert_allclose(light_at(flying, 0.5)[3, :3], (0.5, 0, 1), atol=1e-9)
    assert still.motion == []
    np.testing.assert_allclose(still.transform[3, :3], (0, 5, 1), atol=1e-9)


BLUR = """
def Xform "a" {{ {outer}
    def Xform "b" (prepend apiSchemas = ["MotionAPI"]) {{ float motion:blurScale = {scale}
        {inner}
        def Mesh "m" {{ QUAD }}
        def Mesh "points" {{ QUAD {points} }}
        def Xform "c" (prepend apiSchemas = ["MotionAPI"]) {{ float motion:blurScale = 1
            def Mesh "m" {{ QUAD }} }}
        def SphereLight "l" {{}}
        def PointInstancer "i" {{
            rel prototypes = </a/b/i/p>
            int[] protoIndices = [0, 0]
            point3f[] positions.timeSamples = {{ 1: [(0, 0, 0), (5, 0, 0)] }}
            vector3f[] velocities.timeSamples = {{ 1: [(0, 0, 10), (0, 0, 10)] }}
            def Mesh "p" {{ QUAD }} }} }} }}
"""


@pytest.mark.parametrize("scale", [0.0, 0.5, 2.0])
def test_blur_scale_counts_for_all_below_about_the_frame(read, scale: float) -> None:
    """At frame 5; per frame all goes 2 along x with its parent and 1 along y by itself, points that
    far again, instances 1 along z."""
    quad = "[(0, {0}, 0), (1, {0}, 0), (1, {1}, 0), (0, {1}, 0)]"
    body = BLUR.format(
        scale=scale,
        outer=moves("0: (-2, 0, 0), 10: (18, 0, 0)"),
        inner=moves("0: (0, -1, 0), 10: (0, 9, 0)"),
        points=f"point3f[] points.timeSamples = {{ 0: {quad.format(-1, 0)}, "
        f"10: {quad.format(9, 10)} }}",
    )
    scene = read(camera(-0.5, 0.5) + body, FROM_1_TO_2, frame=5)
    meshes = {mesh.name: mesh for mesh in scene.meshes}
    at_frame = {"/a/b/m": (8, 4, 0), "/a/b/points": (8, 8, 0), "/a/b/c/m": (8, 4, 0)}
    per_frame = {"/a/b/m": (2, 1, 0), "/a/b/points": (2, 2, 0), "/a/b/c/m": (2, 1, 0)}
    (placed,), (light,) = scene.instances, scene.lights
    for time in (0, 0.5, 1):
        for name, place in at_frame.items():
            frames = (time - 0.5) * (1 if name == "/a/b/c/m" else scale)
            found = at(meshes[name], time)[0] if meshes[name].motion else at_rest(meshes[name])
            np.testing.assert_allclose(found, place + frames * np.array(per_frame[name]), atol=1e-5)
        frames = (time - 0.5) * scale
        found = matrices(placed, time) if len(placed.motion) else placed.transforms
        np.testing.assert_allclose(
            found[0, 3, :3], (8, 4, 4) + frames * np.array((2, 1, 1)), atol=1e-5
        )
        found = light_at(light, time) if light.motion else light.transform
        np.testing.assert_allclose(found[3, :3], (8, 4, 0) + frames * np.array((2, 1, 0)))
    if scale == 0:
        assert not meshes["/a/b/m"].motion
        assert not meshes["/a/b/points"].motion
        assert not light.motion
        assert not len(placed.motion)


def at_rest(mesh: Mesh) -> np.ndarray:
    return (mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3])[0]


def test_blur_scale_that_cannot_be_is_warned_of(examine) -> None:
    body = BLUR.format(scale=-1, outer="", inner="", points="")
    found = examine(camera() + body, FROM_1_TO_2).warnings
    assert [w.paths for w in found if "blurScale" in w.kind] == [["/a/b"]]


# ---------------------------------------------------------------------------------------------
# Shapes

TRIANGLE = """
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
"""
ONE = "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]"


def test_points_move_between_their_samples(read) -> None:
    body = f"""def Mesh "m" {{ {TRIANGLE}
        point3f[] points.timeSamples = {{ 1: {ONE}, 3: [(0, 0, 0), (3, 0, 0), (0, 5, 0)] }} }}"""
    mesh = read(camera() + body, FROM_1_TO_2).meshes[0]
    assert len(mesh.motion) == 1
    np.testing.assert_allclose(at(mesh, 1), [(0, 0, 0), (2, 0, 0), (0, 3, 0)], atol=1e-6)


def test_velocities_are_per_second_and_accelerations_bend(read) -> None:
    """x += v t + a t²/2, with t = time codes / timeCodesPerSecond."""
    body = f"""def Mesh "m" {{ {TRIANGLE}
        point3f[] points.timeSamples = {{ 1: {ONE} }}
        vector3f[] velocities.timeSamples = {{ 1: [(20, 0, 0), (20, 0, 0), (0, 10, 0)] }} }}"""
    mesh = read(camera(-0.5, 0.5) + body, FROM_1_TO_2).meshes[0]
    np.testing.assert_allclose(at(mesh, 0), [(-1, 0, 0), (0, 0, 0), (0, 0.5, 0)], atol=1e-6)
    np.testing.assert_allclose(at(mesh, 1), [(1, 0, 0), (2, 0, 0), (0, 1.5, 0)], atol=1e-6)

    bent = body.replace("} }", "}\n    vector3f[] accelerations.timeSamples = "
                        "{ 1: [(0, 400, 0), (0, 400, 0), (0, 0, 0)] } }")  # fmt: skip
    mesh = read(camera(-0.5, 0.5) + bent, FROM_1_TO_2).meshes[0]
    for time in np.linspace(0, 1, 9):
        t = (time - 0.5) / 10
        expected = (20 * t, 200 * t * t, 0)
        np.testing.assert_allclose(at(mesh, time)[0], expected, atol=5e-3)


def test_subdivision_surfaces_keep_their_triangles(read) -> None:
    """The limit surface of a cube that grows, at a level of its own choice."""
    cube = """
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0,1,3,2, 2,3,5,4, 4,5,7,6, 6,7,1,0, 1,7,5,3, 6,0,2,4]
    """
    corners = [(x, y, z) for y, z in ((-1, 1), (1, 1), (1, -1), (-1, -1)) for x in (-1, 1)]
    small, large = (
        "[" + ", ".join(str(tuple(size * c / 2 for c in corner)) for corner in corners) + "]"
        for size in (1, 3)
    )
    body = f'def Mesh "m" {{ {cube} point3f[] points.timeSamples = {{ 1: {small}, 2: {large} }} }}'
    mesh = read(camera() + body, FROM_1_TO_2).meshes[0]
    assert len(mesh.motion) == 1
    assert len(mesh.triangles) > 12
    np.testing.assert_allclose(at(mesh, 1), 3 * at(mesh, 0), atol=1e-5)
    assert mesh.motion[0].normals.shape == mesh.normals.values.shape


def test_sizes_of_shapes_and_widths_of_curves_move(read) -> None:
    body = """
    def Sphere "s" { double radius.timeSamples = { 1: 1, 2: 2 } }
    def BasisCurves "c" {
        uniform token type = "linear"
        int[] curveVertexCounts = [2]
        point3f[] points = [(0, 0, 0), (0, 1, 0)]
        float[] widths ( interpolation = "constant" )
        float[] widths.timeSamples = { 1: [0.1], 2: [0.3] }
    }"""
    sphere, curve = read(camera() + body, FROM_1_TO_2).meshes
    radii = [np.linalg.norm(at(sphere, t), axis=1).max() for t in (0, 1)]
    assert radii[1] == pytest.approx(2 * radii[0], rel=1e-5)
    widths = [np.ptp(at(curve, t)[:, 0]) for t in (0, 1)]
    assert widths[1] == pytest.approx(3 * widths[0], rel=1e-4)


def test_points_that_come_and_go_stay_as_they_are_at_the_frame(read) -> None:
    body = f"""def Mesh "m" {{ {TRIANGLE}
        point3f[] points.timeSamples = {{ 1: {ONE}, 1.5: {ONE.replace("]", ", (5, 5, 5)]")} }} }}"""
    assert read(camera() + body, FROM_1_TO_2).meshes[0].motion == []


def test_curves_that_come_and_go_are_warned_of(examine) -> None:
    body = """def BasisCurves "c" {
        uniform token type = "linear"
        int[] curveVertexCounts.timeSamples = { 1: [2], 1.5: [3] }
        point3f[] points.timeSamples = {
            1: [(0, 0, 0), (0, 1, 0)], 1.5: [(0, 0, 0), (0, 1, 0), (1, 1, 0)] }
        float[] widths = [0.1] ( interpolation = "constant" )
    }"""
    found = examine(camera() + body, FROM_1_TO_2).warnings
    assert [w.paths for w in found if "number of points" in w.kind] == [["/c"]]


# ---------------------------------------------------------------------------------------------
# Instances


def instancer(values: str) -> str:
    return f"""
def PointInstancer "i" {{
    rel prototypes = </i/p>
    int[] protoIndices = [0, 0]
    {values}
    def Mesh "p" {{ QUAD }}
}}"""


def test_instances_fly_with_their_velocities(read) -> None:
    body = instancer("""
    point3f[] positions.timeSamples = { 1: [(0, 0, 0), (0, 5, 0)] }
    vector3f[] velocities.timeSamples = { 1: [(10, 0, 0), (0, -10, 0)] }""")
    (placed,) = read(camera(-0.5, 0.5) + body, FROM_1_TO_2).instances
    assert placed.motion.shape == (1, 2, 4, 4)
    np.testing.assert_allclose(matrices(placed, 0)[:, 3, :3], [(-0.5, 0, 0), (0, 5.5, 0)])
    np.testing.assert_allclose(matrices(placed, 1)[:, 3, :3], [(0.5, 0, 0), (0, 4.5, 0)])


def test_instances_spin_with_their_angular_velocities(read) -> None:
    """900 degrees per second are 90 in a frame of 0.1 s; one of the two does not spin."""
    body = instancer("""
    point3f[] positions.timeSamples = { 1: [(1, 0, 0), (0, 5, 0)] }
    quath[] orientations.timeSamples = { 1: [(1, 0, 0, 0), (1, 0, 0, 0)] }
    vector3f[] angularVelocities.timeSamples = { 1: [(0, 0, 900), (0, 0, 0)] }""")
    still, placed = read(camera() + body, FROM_1_TO_2).instances
    assert still.motion.size == 0
    assert 8 <= len(placed.motion) <= 16
    for time in np.linspace(0, 1, 21):
        angle = math.radians(90 * time)
        (matrix,) = matrices(placed, time)
        np.testing.assert_allclose(matrix[0, :2], (math.cos(angle), math.sin(angle)), atol=2e-3)
        np.testing.assert_allclose(matrix[3, :3], (1, 0, 0), atol=1e-6)


def test_native_instances_that_move_are_apart_from_those_that_stay(read) -> None:
    body = (
        'class "_p" { def Mesh "m" { QUAD ' + moves("1: (0, 0, 0), 2: (0, 0, 1)") + "} }"
        'def "a" (instanceable = true\ninherits = </_p>) {}'
        'def Xform "b" (instanceable = true\ninherits = </_p>) {'
        + moves("1: (5, 0, 0), 2: (7, 0, 0)")
        + "}"
    )
    scene = read(camera() + body, FROM_1_TO_2)
    still, moving = scene.instances
    assert still.motion.size == 0
    np.testing.assert_allclose(matrices(moving, 0.5)[0, 3, :3], (6, 0, 0))
    # The prototype moves inside of itself, too.
    np.testing.assert_allclose(origin_at(scene.prototypes[0].meshes[0], 0.5), (0, 0, 0.5))


def test_spheres_of_points_fly(read) -> None:
    body = """def Points "p" {
        point3f[] points.timeSamples = { 1: [(0, 0, 0), (3, 0, 0)] }
        vector3f[] velocities.timeSamples = { 1: [(0, 10, 0), (0, 20, 0)] }
        float[] widths = [1, 2] }"""
    (placed,) = read(camera() + body, FROM_1_TO_2).instances
    np.testing.assert_allclose(matrices(placed, 1)[:, 3, :3], [(0, 1, 0), (3, 2, 0)], atol=1e-6)


# ---------------------------------------------------------------------------------------------
# Pictures


def test_a_sphere_that_crosses_the_view_leaves_its_share_in_every_column(read) -> None:
    """A ball of radius r moves from x = −1 to 1: a column that it passes all of is covered as long
    as it is in it."""
    body = 'def Sphere "s" { double radius = 0.5\n' + moves("1: (-1, 0, 0), 2: (1, 0, 0)") + "}"
    scene: Scene = read(camera() + body, FROM_1_TO_2, width=32, height=32)
    assert covered(scene, 256) == pytest.approx(math.pi / 4, rel=0.01)
    columns = pixels(scene, 256).mean(axis=0) * VIEW
    x = (np.arange(32) + 0.5) / 32 * VIEW - VIEW / 2
    # The integral over y of the overlap of chords: the disk's area between x − 1 and x + 1, halved.
    area = lambda u: u * math.sqrt(max(0.25 - u * u, 0)) + 0.25 * math.asin(2 * u)  # noqa: E731
    expected = [(area(min(x + 1, 0.5)) - area(max(x - 1, -0.5))) / 2 if abs(x) < 1.5 else 0
                for x in x]  # fmt: skip
    np.testing.assert_allclose(columns, expected, atol=0.02)
