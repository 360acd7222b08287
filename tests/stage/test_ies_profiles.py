"""IES files: what they say, UsdLux's changes to it, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from usdmlt.scene import IesProfile
from usdmlt.stage.ies_profiles import Malformed, mean_factor, parse_ies, shaped


def ies(vertical, horizontal, candela, head="", factors="1", ballast="1 1 50", photometry=1):
    """The text of a file of one lamp."""
    rows = "\n".join(" ".join(map(str, row)) for row in candela)
    return (
        f"IESNA:LM-63-2002\n[TEST] none\n{head or 'TILT=NONE'}\n"
        f"1 1000 {factors} {len(vertical)} {len(horizontal)} {photometry} 2 0 0 0\n{ballast}\n"
        f"{' '.join(map(str, vertical))}\n{' '.join(map(str, horizontal))}\n{rows}\n"
    )


def test_an_axial_profile():
    profile = parse_ies(ies([0, 45, 90], [0], [[100, 60, 0]]))
    np.testing.assert_array_equal(profile.vertical_degrees, [0, 45, 90])
    assert len(profile.horizontal_degrees) == 1
    np.testing.assert_array_equal(profile.factors, [[100, 60, 0]])


def test_multiplier_and_ballast_count():
    text = ies([0, 90], [0], [[100, 50]], factors="2", ballast="0.5 0.8 50")
    np.testing.assert_allclose(parse_ies(text).factors, [[80, 40]])


def test_commas_line_breaks_and_tilt_tables_are_read_over():
    text = ies([0, 90], [0], [[100, 50]], head="TILT=INCLUDE\n1\n3\n0 45 90\n1 0.9 0.8")
    assert parse_ies(text.replace("0 90\n", "0,\n90\n")).factors.tolist() == [[100, 50]]


@pytest.mark.parametrize(
    ("planes", "angles", "order"),
    [
        ([0, 45, 90], [0, 45, 90, 135, 180, 225, 270, 315, 360], [0, 1, 2, 1, 0, 1, 2, 1, 0]),
        ([0, 90, 180], [0, 90, 180, 270, 360], [0, 1, 2, 1, 0]),
        ([90, 180, 270], [0, 90, 180, 270, 360], [1, 0, 1, 2, 1]),
        ([0, 120, 240], [0, 120, 240, 360], [0, 1, 2, 0]),
        ([0, 120, 240, 360], [0, 120, 240, 360], [0, 1, 2, 3]),
    ],
    ids=["quadrant", "half", "half about 90", "open", "whole"],
)
def test_planes_left_out_by_symmetry_are_there(planes, angles, order):
    profile = parse_ies(ies([0, 90], planes, [[i, i] for i in range(len(planes))]))
    np.testing.assert_array_equal(profile.horizontal_degrees, angles)
    np.testing.assert_array_equal(profile.factors[:, 0], order)


def test_half_a_profile_about_90_without_the_plane_of_180_degrees():
    """At 0 degrees it is what is at 180: half-way between the planes of 150 and 210."""
    profile = parse_ies(ies([0, 90], [90, 150, 210, 270], [[0, 0], [2, 2], [4, 4], [9, 9]]))
    assert np.interp(0, profile.horizontal_degrees, profile.factors[:, 0]) == pytest.approx(3)
    assert np.interp(180, profile.horizontal_degrees, profile.factors[:, 0]) == pytest.approx(3)
    assert np.interp(30, profile.horizontal_degrees, profile.factors[:, 0]) == pytest.approx(2)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no line TILT="),
        ("TILT=NONE\n1 2 3", "ends too early"),
        ("TILT=NONE\n1 1000 x 1 1 1 1 0 0 0\n1 1 1\n0\n0\n5", "could not convert"),
        (ies([0, 90], [0], [[1, 1]], photometry=2), "photometry of type B"),
        (ies([0, 0], [0], [[1, 1]]), "do not ascend"),
        (ies([0, 90], [0], [[1, -1]]), "not all positive"),
        (ies([0, 90], [0], [[1, "nan"]]), "not all positive"),
        (ies([0, 90], [45, 90], [[1, 1], [1, 1]]), "start at 45"),
        ("TILT=NONE\n1 1000 1 1e9 1 1 1 0 0 0\n", "is no number of angles"),
    ],
)
def test_what_is_no_profile_is_refused(text, says):
    with pytest.raises(Malformed, match=says):
        parse_ies(text)


def test_the_mean_is_the_integral_over_the_sphere():
    """Against quadrature of the bilinear profile, uneven angles in both directions."""
    random = np.random.default_rng(5)
    vertical = np.array([0, 10, 25, 60, 95, 180.0])
    horizontal = np.array([0, 50, 200, 360.0])
    factors = random.uniform(0, 9, (4, 6))
    factors[-1] = factors[0]
    theta = (np.arange(4000) + 0.5) / 4000 * np.pi
    phi = (np.arange(720) + 0.5) / 2
    rows = np.stack([np.interp(np.degrees(theta), vertical, row) for row in factors])
    table = np.stack([np.interp(phi, horizontal, rows[:, i]) for i in range(len(theta))])
    expected = (table.mean(axis=1) * np.sin(theta)).sum() * np.pi / 4000 / 2
    assert mean_factor(IesProfile(vertical, horizontal, factors)) == pytest.approx(
        expected, rel=1e-5
    )


@pytest.mark.parametrize(("last", "share"), [(180.0, 0.5), (90.0, 1.0)])
def test_normalised_a_hemisphere_counts_as_such_where_the_file_ends(last, share):
    """7 cd in all directions of the lower half; a file to 180 degrees has the dark half too."""
    vertical = np.array([0, 90, last]) if last > 90 else np.array([0, last])
    factors = np.full((1, len(vertical)), 7.0)
    if last > 90:
        vertical = np.array([0, 90, 90.0001, last])
        factors = np.array([[7.0, 7, 0, 0]])
    profile = shaped(IesProfile(vertical, np.zeros(1), factors), 0.0, normalize=True)
    assert profile.factors[0, 0] == pytest.approx(1 / share, rel=1e-5)


@pytest.mark.parametrize(
    ("scale", "light", "file"),
    [(0.0, 30, 30), (0.5, 30, 60), (2.0, 30, 15), (-0.5, 150, 120), (-2.0, 150, 165)],
)
def test_angle_scale_says_where_in_the_file_an_angle_of_the_light_is(scale, light, file):
    vertical = np.linspace(0, 180, 181)
    profile = IesProfile(vertical, np.zeros(1), vertical[None])  # the factor is the file's angle
    scaled = shaped(profile, scale, normalize=False)
    value = np.interp(light, scaled.vertical_degrees, scaled.factors[0])
    assert value == pytest.approx(file)


def test_a_stage_names_its_profile(read, tmp_path):
    (tmp_path / "lamp.ies").write_text(ies([0, 90], [0], [[100, 50]]))
    body = """def SphereLight "l" (prepend apiSchemas = ["ShapingAPI"]) {
        asset inputs:shaping:ies:file = @lamp.ies@
        bool inputs:shaping:ies:normalize = NORMALIZE
        float inputs:shaping:ies:angleScale = 0.5 }"""
    profile = read(body.replace("NORMALIZE", "0")).lights[0].shaping.ies
    np.testing.assert_array_equal(profile.vertical_degrees, [0, 45])
    np.testing.assert_array_equal(profile.factors, [[100, 50]])
    # The mean of 100 - 50 θ/(π/2) over the hemisphere is 100 - 50·2/π.
    profile = read(body.replace("NORMALIZE", "1")).lights[0].shaping.ies
    mean = 100 - 50 * 2 / np.pi
    np.testing.assert_allclose(profile.factors, [[100 / mean, 50 / mean]])


@pytest.mark.parametrize("text", [None, "nonsense"])
def test_a_profile_that_cannot_be_read_is_a_warning(examine, tmp_path, text):
    if text:
        (tmp_path / "lamp.ies").write_text(text)
    body = """def SphereLight "l" (prepend apiSchemas = ["ShapingAPI"]) {
        asset inputs:shaping:ies:file = @lamp.ies@ }"""
    warning = next(w for w in examine(body).warnings if "IES" in w.kind)
    assert warning.kind == "IES profiles cannot be read"
    assert warning.paths[0].startswith("/l (")
