"""Curves: where they run, how wide they look, and what primvars do on them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from support.coverage import CAMERA, covered
from usdmlt.errors import Error
from usdmlt.scene import Mesh
from usdmlt.stage.curve_samples import sample_curves, sample_hermite, sample_nurbs
from usdmlt.stage.nurbs import basis, sample_parameters
from usdmlt.stage.tubes import directions, transported_frames

RNG = np.random.default_rng(5)
CONTROL = RNG.normal(size=(7, 3))


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


# ---------------------------------------------------------------------------------------------
# Where they run


@pytest.mark.parametrize(
    ("kind", "wrap", "vertices", "segments"),
    [
        ("linear", "nonperiodic", 7, 6),
        ("linear", "periodic", 7, 7),
        ("bezier", "nonperiodic", 7, 2),
        ("bezier", "periodic", 6, 2),
        ("bspline", "nonperiodic", 7, 4),
        ("bspline", "periodic", 7, 7),
        ("bspline", "pinned", 7, 6),
        ("catmullRom", "nonperiodic", 7, 4),
        ("catmullRom", "periodic", 7, 7),
        ("catmullRom", "pinned", 7, 6),
    ],
)
def test_segments_are_counted_as_usd_counts_them(kind, wrap, vertices, segments):
    samples = sample_curves(np.array([vertices]), kind, wrap, 3)
    steps = 1 if kind == "linear" else 3
    open_ = wrap != "periodic"
    assert len(samples.curve) == segments * steps + open_
    assert samples.varying.count == segments + open_
    assert samples.vertex.weight.sum(axis=1) == pytest.approx(np.ones(len(samples.curve)))


def test_bsplines_are_those_of_uniform_knots():
    at = sample_curves(np.array([7]), "bspline", "nonperiodic", 4).points(CONTROL)
    spline = BSpline(np.arange(-3, 8.0), CONTROL, 3)
    assert at == pytest.approx(spline(np.arange(17) / 4))


def test_catmull_rom_curves_go_through_their_points_with_half_the_chord_as_slope():
    samples = sample_curves(np.array([7]), "catmullRom", "nonperiodic", 4)
    assert samples.points(CONTROL)[::4] == pytest.approx(CONTROL[1:-1])
    assert samples.slopes(CONTROL)[::4] == pytest.approx((CONTROL[2:] - CONTROL[:-2]) / 2)


def test_bezier_curves_are_bernstein_polynomials():
    at = sample_curves(np.array([4]), "bezier", "nonperiodic", 8).points(CONTROL[:4])
    u = np.linspace(0, 1, 9)[:, None]
    weights = ((1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3)
    assert at == pytest.approx(sum(w * p for w, p in zip(weights, CONTROL, strict=False)))


@pytest.mark.parametrize("kind", ["bspline", "catmullRom"])
@pytest.mark.parametrize("vertices", [2, 3, 7])
def test_pinned_curves_reach_their_ends(kind, vertices):
    control = CONTROL[:vertices]
    at = sample_curves(np.array([vertices]), kind, "pinned", 4).points(control)
    assert at[[0, -1]] == pytest.approx(control[[0, -1]])


@pytest.mark.parametrize("kind", ["linear", "bezier", "bspline", "catmullRom"])
def test_periodic_curves_close_smoothly(kind):
    samples = sample_curves(np.array([6]), kind, "periodic", 4)
    control = CONTROL[:6]
    turned = samples.points(np.roll(control, 3, axis=0))
    # Starting three points later is the same curve: a segment of a Bézier curve, or three others.
    shift = {"linear": 3, "bezier": 4}.get(kind, 12)
    assert np.roll(samples.points(control), shift, axis=0) == pytest.approx(turned)


def test_several_curves_do_not_mix():
    counts = np.array([4, 7, 1, 5])
    control = RNG.normal(size=(17, 3))
    all_at = sample_curves(counts, "bspline", "nonperiodic", 3)
    starts = np.cumsum(counts) - counts
    at = all_at.points(control)
    for curve in (0, 1, 3):
        own = control[starts[curve] : starts[curve] + counts[curve]]
        alone = sample_curves(counts[[curve]], "bspline", "nonperiodic", 3)
        assert at[all_at.curve == curve] == pytest.approx(alone.points(own))
    assert not (all_at.curve == 2).any()


def test_hermite_curves_have_their_tangents():
    tangents = RNG.normal(size=(7, 3))
    samples = sample_hermite(np.array([7]), 5)
    both = np.concatenate([CONTROL, tangents])
    assert samples.points(both)[::5] == pytest.approx(CONTROL)
    assert samples.slopes(both)[::5] == pytest.approx(tangents)


def test_nurbs_curves_are_de_boors_and_rational_ones_draw_circles():
    knots = np.array([0, 0, 0, 0, 1, 2, 2, 4, 4, 4, 4.0])
    samples = sample_nurbs(np.array([7]), np.array([4]), knots, np.array([[0.0, 4.0]]), None, 5)
    at = sample_parameters(knots, 4, 0, 4, 5)
    assert samples.points(CONTROL) == pytest.approx(BSpline(knots, CONTROL, 3)(at))
    assert samples.slopes(CONTROL) == pytest.approx(
        BSpline(knots, CONTROL, 3).derivative()(at), abs=1e-9
    )
    quarter = np.array([(1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
    weights = np.array([1, np.sqrt(0.5), 1])
    circle = sample_nurbs(
        np.array([3]),
        np.array([3]),
        np.array([0, 0, 0, 1, 1, 1.0]),
        np.array([[0, 1.0]]),
        weights,
        9,
    )
    at, slopes = circle.points(quarter), circle.slopes(quarter)
    assert np.linalg.norm(at, axis=1) == pytest.approx(np.ones(10))
    assert np.einsum("ij,ij->i", at, slopes) == pytest.approx(np.zeros(10), abs=1e-12)


def test_nurbs_bases_add_up_to_one_up_to_the_last_knot():
    knots = np.array([0, 0, 0, 1, 2, 2, 3, 3, 3.0])
    weights, slopes = basis(knots, 3, 6, np.linspace(0, 3, 50))
    assert weights.weight.sum(axis=1) == pytest.approx(np.ones(50))
    assert slopes.weight.sum(axis=1) == pytest.approx(np.zeros(50), abs=1e-12)


@pytest.mark.parametrize("closed", [False, True])
def test_frames_stay_across_the_curve_and_do_not_jump(closed):
    samples = sample_curves(np.array([7, 5]), "bspline", "periodic" if closed else "pinned", 24)
    control = RNG.normal(size=(12, 3))
    tangents = directions(
        samples.points(control), samples.slopes(control), samples.curve, samples.closed
    )
    frames = transported_frames(tangents, samples.counts, closed)
    assert np.einsum("ij,ij->i", frames, tangents) == pytest.approx(np.zeros(len(frames)), abs=1e-9)
    assert np.linalg.norm(frames, axis=1) == pytest.approx(np.ones(len(frames)))
    for curve in (0, 1):
        own, along = frames[samples.curve == curve], tangents[samples.curve == curve]
        if closed:  # from the last to the first too
            own, along = np.append(own, own[:1], axis=0), np.append(along, along[:1], axis=0)
        turn = np.arccos(np.clip(np.einsum("ij,ij->i", own[1:], own[:-1]), -1, 1))
        bend = np.arccos(np.clip(np.einsum("ij,ij->i", along[1:], along[:-1]), -1, 1))
        spread = np.pi / len(own) if closed else 0
        assert (turn <= bend + spread + 1e-6).all()


# ---------------------------------------------------------------------------------------------
# How they look

STRAIGHT = """def BasisCurves "c" {{
    uniform token type = "linear"
    int[] curveVertexCounts = [2]
    point3f[] points = [(-1.5, -0.3, 0), (1.5, 0.4, 0)]
    float[] widths = [{width}] ( interpolation = "constant" )
    {extra} }}"""


@pytest.mark.parametrize(
    ("width", "ribbon", "error"),
    [
        (0.02, False, 0.11),
        (0.1, False, 0.05),
        (0.5, False, 0.015),
        (1.5, False, 0.01),
        (0.02, True, 0.03),
        (0.1, True, 0.02),
        (0.5, True, 0.01),
    ],
)
def test_a_straight_curve_covers_its_length_times_its_width(read, width, ribbon, error):
    """From a third of a pixel to 24 pixels wide; the camera's pixels are 1/16. A thin tube of few
    sides is off by what they are, a ribbon by the noise of the samples along its edges only."""
    extra = 'normal3f[] normals = [(0, 0, 1), (0, 0, 1)] ( interpolation = "vertex" )'
    body = STRAIGHT.format(width=width, extra=extra if ribbon else "")
    scene = read(CAMERA + body, width=64, height=64)
    assert covered(scene) == pytest.approx(np.hypot(3, 0.7) * width, rel=error)


def test_many_thin_curves_in_all_directions_cover_what_round_ones_do(read):
    """Tubes of three sides: each is too wide or too narrow, but not all of them together. 400 of
    them in random directions: 0.2 % of standard error."""
    rng = np.random.default_rng(7)
    starts = np.stack([rng.uniform(-1.5, 1.5, 400), rng.uniform(-1.5, 1.5, 400), np.zeros(400)])
    steps = rng.normal(size=(3, 400)) * 0.15
    points = np.stack([starts.T, (starts + steps).T], axis=1).reshape(-1, 3)
    body = f"""def BasisCurves "c" {{
        uniform token type = "linear"
        int[] curveVertexCounts = {[2] * 400}
        point3f[] points = {[tuple(p) for p in points.tolist()]}
        float[] widths = [0.01] ( interpolation = "constant" ) }}"""
    mesh = read(CAMERA + body, width=64, height=64).meshes[0]
    assert len(mesh.triangles) == 400 * 6
    # The shadow of all triangles on z = 0, each tube counted once: half of what all of them cast.
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    shadow = np.abs(np.cross(b - a, c - a)[:, 2]).sum() / 4
    assert shadow == pytest.approx(0.01 * np.hypot(*steps[:2]).sum(), rel=0.008)


def test_widths_may_vary_along_a_curve(read):
    body = STRAIGHT.format(width=0.1, extra="").replace(
        '[0.1] ( interpolation = "constant" )', '[0.2, 0.6] ( interpolation = "vertex" )'
    )
    scene = read(CAMERA + body, width=64, height=64)
    assert covered(scene) == pytest.approx(np.hypot(3, 0.7) * 0.4, rel=0.02)


@pytest.mark.parametrize(
    ("widths", "interpolation"),
    [("[0.1, 0.3]", "uniform"), ("[0.1, 0.1, 0.3, 0.3]", "varying")],
)
def test_widths_per_curve_and_varying(only_mesh, widths, interpolation):
    mesh = only_mesh(
        f"""def BasisCurves "c" {{
        uniform token type = "cubic"
        uniform token basis = "bspline"
        uniform token wrap = "nonperiodic"
        int[] curveVertexCounts = [4, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0),
                            (0, 2, 0), (1, 2, 0), (2, 2, 0), (3, 2, 0)]
        float[] widths = {widths} ( interpolation = "{interpolation}" ) }}""",
        complexity="veryhigh",
    )
    for row, width in ((0, 0.1), (2, 0.3)):
        near = np.abs(mesh.points[:, 1] - row) < 0.5
        assert np.ptp(mesh.points[near, 2]) == pytest.approx(width, rel=0.01)
        assert np.ptp(mesh.points[near, 0]) == pytest.approx(1)


def test_a_closed_curve_is_a_ring(only_mesh):
    angle = np.arange(8) * np.pi / 4
    points = [(float(np.cos(a)), float(np.sin(a)), 0.0) for a in angle]
    mesh = only_mesh(
        f"""def BasisCurves "c" {{
        uniform token type = "cubic"
        uniform token basis = "catmullRom"
        uniform token wrap = "periodic"
        int[] curveVertexCounts = [8]
        point3f[] points = {points}
        float[] widths = [0.2] ( interpolation = "constant" ) }}""",
        complexity="veryhigh",
    )
    edges = np.sort(mesh.triangles[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # no end, no seam
    assert area(mesh) == pytest.approx(2 * np.pi * 0.2 * np.pi, rel=0.01)  # 4 pi² R r
    a, b, c = (mesh.points[mesh.triangles[:, i]].astype(float) for i in range(3))
    facing = np.einsum(
        "ij,ij->i", np.cross(b - a, c - a), mesh.normals.values[mesh.triangles[:, 0]]
    )
    assert (facing > 0).all()


def test_ribbons_lie_across_their_normals(only_mesh):
    mesh = only_mesh(
        STRAIGHT.format(
            width=0.5,
            extra='normal3f[] normals = [(0, 0, 1), (0, 1, 0)] ( interpolation = "vertex" )',
        )
    )
    assert len(mesh.triangles) == 2
    assert np.abs(mesh.normals.values[:2]) == pytest.approx(np.tile([0, 0, 1], (2, 1)), abs=1e-6)
    assert np.ptp(mesh.points[:2, 2]) == pytest.approx(0, abs=1e-6)
    assert np.ptp(mesh.points[2:, 2]) == pytest.approx(0.5)


@pytest.mark.parametrize("kind", ["HermiteCurves", "NurbsCurves"])
def test_other_curves_cover_their_area_too(read, kind):
    more = {
        "HermiteCurves": "vector3f[] tangents = [(3, 0.7, 0), (3, 0.7, 0)]",
        "NurbsCurves": "int[] order = [2]\ndouble[] knots = [0, 0, 1, 1]\n"
        "double2[] ranges = [(0, 1)]",
    }[kind]
    body = STRAIGHT.format(width=0.2, extra=more).replace("BasisCurves", kind)
    scene = read(CAMERA + body.replace('uniform token type = "linear"', ""), width=64, height=64)
    assert covered(scene) == pytest.approx(np.hypot(3, 0.7) * 0.2, rel=0.03)


# ---------------------------------------------------------------------------------------------
# Values


@pytest.mark.parametrize(
    ("interpolation", "values", "expected"),
    [
        ("constant", [5], lambda x, y: 5 + 0 * x),
        ("uniform", [1, 2], lambda x, y: 1.0 + (y > 1)),
        # B-spline control values 0, 1, 2, 3 run from 1 to 2, as x does.
        ("vertex", [0, 1, 2, 3, 0, 1, 2, 3], lambda x, y: x),
        ("varying", [0, 8, 4, 2], lambda x, y: np.where(y > 1, 4 - 2 * (x - 1), 8 * (x - 1))),
    ],
)
def test_primvars_run_along_curves(only_mesh, interpolation, values, expected):
    mesh = only_mesh(
        f"""def BasisCurves "c" {{
        uniform token type = "cubic"
        uniform token basis = "bspline"
        int[] curveVertexCounts = [4, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0),
                            (0, 2, 0), (1, 2, 0), (2, 2, 0), (3, 2, 0)]
        float[] widths = [0.1] ( interpolation = "constant" )
        color3f[] primvars:displayColor = {[(value, 0, 0) for value in values]} (
            interpolation = "{interpolation}" ) }}""",
        complexity="high",
    )
    color = mesh.primvars["displayColor"]
    corners = mesh.triangles if color.corners is None else color.corners
    x, y, _ = np.moveaxis(mesh.points[mesh.triangles], -1, 0)
    assert color.values[corners][..., 0] == pytest.approx(expected(x, y), abs=1e-5)


# ---------------------------------------------------------------------------------------------
# Broken content


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("int[] curveVertexCounts = [3]\npoint3f[] points = [(0, 0, 0), (1, 0, 0)]", "add up to 3"),
        ("int[] curveVertexCounts = [2]\npoint3f[] points = [(0, nan, 0), (1, 0, 0)]", "finite"),
        (
            "int[] curveVertexCounts = [2]\npoint3f[] points = [(0, 0, 0), (1, 0, 0)]\n"
            "float[] widths = [nan]",
            "widths",
        ),
    ],
)
def test_broken_curves_name_their_path(read, content, says):
    with pytest.raises(Error, match=f"/c.*{says}"):
        read(f'def BasisCurves "c" {{ uniform token type = "linear"\n{content} }}')


@pytest.mark.parametrize(
    "content",
    [
        "",
        "int[] curveVertexCounts = [1]\npoint3f[] points = [(0, 0, 0)]",
        "int[] curveVertexCounts = [2]\npoint3f[] points = [(0, 0, 0), (1, 0, 0)]\n"
        "float[] widths = [0, 0]",
    ],
)
def test_curves_without_extent_are_left_out_with_a_warning(examine, content):
    found = examine(f'def BasisCurves "c" {{ uniform token type = "linear"\n{content} }}')
    assert found.meshes == 0
    assert any(w.paths == ["/c"] for w in found.warnings)


def test_curves_without_widths_say_how_wide_they_are(examine):
    found = examine("""def BasisCurves "c" { uniform token type = "linear"
        int[] curveVertexCounts = [2]
        point3f[] points = [(0, 0, 0), (1, 0, 0)] }""")
    assert [w.paths for w in found.warnings if "1 wide" in w.kind] == [["/c"]]
    assert found.meshes == 1


def test_knots_that_fall_are_refused(read):
    with pytest.raises(Error, match=r"/c.*knots"):
        read("""def NurbsCurves "c" {
            int[] curveVertexCounts = [2]
            point3f[] points = [(0, 0, 0), (1, 0, 0)]
            int[] order = [2]
            double[] knots = [0, 1, 0, 1] }""")


def test_short_curves_far_apart_have_few_samples(only_mesh):
    """What lies between one curve and the next is no curve: each of these is 3 pixels long."""
    starts = np.arange(30) * 10.0
    points = [(x + 0.1 * i, 0.0, 0.0) for x in starts.tolist() for i in range(4)]
    mesh = only_mesh(
        f"""def BasisCurves "c" {{
        uniform token type = "cubic"
        uniform token basis = "bezier"
        int[] curveVertexCounts = {[4] * 30}
        point3f[] points = {points}
        float[] widths = [0.01] ( interpolation = "constant" ) }}"""
    )
    assert len(mesh.triangles) == 30 * 6
