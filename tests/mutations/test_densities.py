"""Transition densities against what proposals do.

Recorded: a proposal multiplies the densities of its own random choices, and the density recomputed
from the pair (x, y) alone has to be the same number. Where several splits could have made y, what
was recorded is one term of a sum.

Counted: proposals from one x. Choices that are discrete have known frequencies, radii and angles
known laws; and whatever the mutation,

    E[1/T(x→y) · 1(y ∈ B)] = measure of B

for parts B of path space that the mutation reaches, here areas of a floor and rings of directions:
it sees an error that both ways of computing T share. It does not see factors of classes that the
scenes below lack.

Significance of the statistical tests: 1e-4 each; seeds are fixed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from support.class_scenes import CLASS_SCENES
from support.media_scenes import LIT_SCENES
from support.mutations import MUTATIONS, build_scene, of_mutation, steps
from support.rendering import build
from support.scenes import GREY, HEIGHT, SCENES, WIDTH, picture_of
from support.shapes import facing, floor, orthographic, perspective, quad
from support.statistics import sidak
from usdmlt import _core
from usdmlt import scene as s

SIGNIFICANCE = 1e-4
ALL = dict.fromkeys(MUTATIONS, 1.0)
JOINING = ("new_path", "bidirectional")
PERTURBATIONS = ("lens", "caustic", "glossy_caustic")

# Rounding of float vertices: grazing cosines and short edges lose digits.
TOLERANCE = 2e-3


def disagreement(rows: dict, column: str, against: str = "log_recorded") -> np.ndarray:
    """|log ratio| of two densities of the proposals that were made."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(np.abs(rows[column] - rows[against]), nan=np.inf)


def require_recorded_is_recomputed(name: str, samples: int, **settings: object) -> None:
    rows = steps(name, ALL, rounds=1, samples=samples, starts=samples, **settings)
    for mutation in MUTATIONS:
        of = of_mutation(rows, mutation)
        if mutation == "glossy_caustic":
            # Where near-specular vertices became others, which is a rejection.
            became = np.isneginf(of["log_forward"])
            assert became.sum() <= 0.02 * became.size + 2
            of = {k: v[~became] if isinstance(v, np.ndarray) else v for k, v in of.items()}
        if mutation in ("multi_chain", "glossy_lens", "aimed"):
            # Directions in float resolve angles of 1e-4 radians to about a thousandth, and T goes
            # with the square. The same angle enters both ways, so that it cancels in a(x→y).
            wrong = disagreement(of, "log_forward")
            assert (wrong > 0.02).sum() <= 0.3 * wrong.size + 5
            assert (wrong > 0.5).sum() <= 2e-3 * wrong.size + 2
            continue
        if mutation in PERTURBATIONS and name in LIT_SCENES:
            # So do distances that change by a thousandth.
            wrong = disagreement(of, "log_forward")
            assert (wrong > 0.005).sum() <= 0.08 * wrong.size + 5, mutation
            assert (wrong > 0.1).sum() <= 3e-3 * wrong.size + 2, mutation
            continue
        wrong = disagreement(of, "log_term") > TOLERANCE
        assert wrong.sum() <= 2e-3 * wrong.size + 2, (mutation, wrong.mean())
        if mutation in JOINING:
            assert not (disagreement(of, "log_by_definition", "log_forward") > 1e-9).any()
        alone = of["terms"] == 1
        wrong = disagreement(of, "log_forward")[alone] > TOLERANCE
        assert wrong.sum() <= 2e-3 * wrong.size + 2, (mutation, wrong.mean())
        assert (of["log_forward"] >= of["log_term"] - 1e-9).all()


@pytest.mark.parametrize("name", CLASS_SCENES | SCENES | LIT_SCENES)
def test_the_recorded_density_is_the_recomputed_one(name: str) -> None:
    require_recorded_is_recomputed(name, 2500)


@pytest.mark.parametrize("name", CLASS_SCENES | SCENES | LIT_SCENES)
def test_what_a_proposal_kept_is_as_if_made_anew(name: str) -> None:
    """Factors and densities of unchanged vertices are not made again; those of the split see all
    that a wrong range of changed vertices would leave behind."""
    rows = steps(
        name, ALL, rounds=1, samples=2500, starts=2500, steps=2, two_stage=True, selective=True
    )
    assert rows["mutation"].size > 300
    assert disagreement(rows, "log_target_anew", "log_target_after").max() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", CLASS_SCENES | SCENES | LIT_SCENES)
def test_it_is_for_many_proposals(name: str) -> None:
    require_recorded_is_recomputed(name, 60000, steps=2, min_edges=2, depth=9, seed=3)


# ---- Proposals from one path ------------------------------------------------------------------

LAMP = s.RectLight((9, 9, 9), 0.8, 0.6, facing((2.7, 3, 0.3), (0.3, 0, 0)))
SUN = s.DistantLight((3, 3, 3), 0.0, facing((0, 0, 0), (-0.8, -1.5, 0.2)))
DOWN = {"up": (0, 0, -1)}
CAMERAS = {
    "perspective": perspective((0, 4, 0), (0, 0, 0), 40, **DOWN),
    "orthographic": orthographic((0, 4, 0), (0, 0, 0), 2.9, **DOWN),
}


def overhead(camera: str, light: object = LAMP) -> object:
    """A camera that looks straight down on a floor, all of which the light reaches."""
    return build(
        picture_of(CAMERAS[camera], meshes=[floor(0, 8.0)], materials=[GREY], lights=[light])
    )


def proposals(scene: object, mutation: str, count: int, path_class: str = "LDE") -> dict:
    return _core.proposal_probe(
        scene, mutation, path_class, (WIDTH / 2, HEIGHT / 2), count=count, depth=3
    )


def position(table: dict, vertex: int) -> np.ndarray:
    return np.stack([table[f"vertex{vertex}{axis}"] for axis in "xyz"], axis=-1)


def pixel_area(camera: str) -> float:
    """Area of the floor that a pixel covers."""
    height = 2.9 if camera == "orthographic" else 2 * 4 * math.tan(math.radians(20))
    return (height / HEIGHT) ** 2


def require_measure(made: dict, chosen: np.ndarray, count: int, size: float, origin: np.ndarray,
                    radius: float, measure: float) -> None:  # fmt: skip
    """E[1/T; y in a square cell] = measure per pixel² · size², for the cells that lie between
    radius and a third of a pixel of the origin."""
    x, y = (made[f"raster_{axis}"] - origin[i] for i, axis in enumerate("xy"))
    inverse = np.where(chosen, np.exp(-made["log_density"]), 0)
    n = math.ceil(radius / size)
    p = []
    for i in range(-n, n):
        for j in range(-n, n):
            corners = [(size * (i + a), size * (j + b)) for a in (0, 1) for b in (0, 1)]
            far = max(math.hypot(*c) for c in corners)
            if far > radius or min(math.hypot(*c) for c in corners) < 0.3:
                continue
            inside = (np.floor(x / size) == i) & (np.floor(y / size) == j)
            values = inverse[inside]
            if inside.sum() < 50:
                continue
            mean = values.sum() / count
            error = math.sqrt((values**2).sum() / count - mean**2) / math.sqrt(count)
            p.append(2 * stats.norm.sf(abs(mean - measure * size**2) / error))
    assert len(p) >= 4
    assert sidak(np.array(p)) >= SIGNIFICANCE, p


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("mutation", ["lens", "lens_subpath", "caustic", "bidirectional"])
def test_the_reciprocal_density_integrates_to_the_floors_area(mutation: str, camera: str) -> None:
    count = 400000 if mutation == "bidirectional" else 60000
    out = proposals(overhead(camera), mutation, count)
    made, start = out["made"], out["start"]
    only_x1 = (made["l"] == 0) & (made["m"] == 2) & (made["m_y"] == 2) & (made["edges"] == 2)
    if mutation != "bidirectional":
        assert only_x1.all()
    origin = np.array([start["raster_x"][0], start["raster_y"][0]])
    wide = mutation in ("lens_subpath", "bidirectional")
    radius = 7.0 if wide else 0.6 * start["largest_move"][0]
    require_measure(made, only_x1, count, 2.0 if wide else 0.5, origin, radius, pixel_area(camera))


@pytest.mark.parametrize("camera", CAMERAS)
def test_so_it_does_under_a_sun_without_extent(camera: str) -> None:
    out = proposals(overhead(camera, SUN), "caustic", 60000)
    start = out["start"]
    origin = np.array([start["raster_x"][0], start["raster_y"][0]])
    radius = 0.6 * start["largest_move"][0]
    made = out["made"]
    require_measure(
        made, np.ones(made["l"].size, bool), 60000, 0.5, origin, radius, pixel_area(camera)
    )


@pytest.mark.parametrize("mutation", JOINING)
def test_light_points_bring_their_area(mutation: str) -> None:
    """x_0 and x_1 are both new: the measure is that of the lamp times that of the floor."""
    count = 600000
    out = proposals(overhead("perspective"), mutation, count)
    made = out["made"]
    chosen = (made["l"] == -1) & (made["m_y"] == made["m"]) & (made["edges"] == 2)
    if mutation == "bidirectional":
        chosen &= made["m"] == 2
    else:
        chosen = made["edges"] == 2
    require_measure(made, chosen, count, 2.5, np.array([12.0, 8.0]), 7.6,
                    pixel_area("perspective") * 0.8 * 0.6)  # fmt: skip


FOG = s.Medium((0.25, 0.2, 0.3), (0.02, 0.02, 0.02), anisotropy=0.3)


def foggy() -> object:
    return build(
        picture_of(
            CAMERAS["perspective"], meshes=[floor(0, 8.0)], materials=[GREY], lights=[LAMP],
            media=[FOG], world_medium=0,
        )
    )  # fmt: skip


@pytest.mark.parametrize("mutation", ["lens", "lens_subpath", *JOINING])
def test_in_media_it_integrates_to_their_volume(mutation: str) -> None:
    """A point of fog instead, in frusta above and below the one it comes from: pixels, from depth
    to depth."""
    count = 400000 if mutation in JOINING else 120000
    out = proposals(foggy(), mutation, count, "LME")
    made, start = out["made"], out["start"]
    depth = position(start, 2)[0, 1] - position(start, 1)[0, 1]
    depths = position(made, 2)[:, 1] - position(made, 1)[:, 1]
    only_x1 = (made["edges"] == 2) & (made["m_y"] == 2)
    if mutation == "new_path":  # of which x0 is new as well
        only_x1 = made["edges"] == 2
    else:
        only_x1 &= (made["l"] == 0) & (made["m"] == 2)
    wide = mutation in ("lens_subpath", *JOINING)
    origin = np.array([start["raster_x"][0], start["raster_y"][0]])
    lamp = 0.8 * 0.6 if mutation == "new_path" else 1
    assert 1 < depth < 3.6
    for near, far in ((0.85, 0.95), (1.05, 1.12)) if not wide else ((0.5, 0.8), (0.9, 1.05)):
        inside = only_x1 & (depths > near * depth) & (depths < far * depth)
        # Pixels grow with the depth; ``pixel_area`` is that at a depth of 4.
        volume = pixel_area("perspective") / 16 * depth**3 * (far**3 - near**3) / 3
        radius = 7.0 if wide else 0.6 * start["largest_move"][0]
        size = 2.0 if wide else 0.5
        require_measure(made, inside, count, size, origin, radius, volume * lamp)


def test_so_it_does_seen_from_the_light() -> None:
    """Parts of shells about the old direction from the light."""
    count = 120000
    out = proposals(foggy(), "caustic", count, "LME")
    made, start = out["made"], out["start"]
    x0, x1, x2 = (position(start, v)[0] for v in range(3))
    axis, ways = x1 - x0, position(made, 1) - x0
    far, distances = np.linalg.norm(axis), np.linalg.norm(ways, axis=1)
    axis /= far
    sides = np.cross(axis, [0.3, 0.5, 0.8])
    sides = np.stack([sides / np.linalg.norm(sides), np.cross(axis, sides / np.linalg.norm(sides))])
    across = ways @ sides.T
    angle = np.arctan2(np.hypot(*across.T), ways @ axis)
    azimuth = np.arctan2(across[:, 1], across[:, 0])
    largest = start["largest_move"][0] * 2 * math.tan(math.radians(20)) / HEIGHT
    largest *= np.linalg.norm(x2 - x1) / far
    inverse = np.exp(-made["log_density"])
    p = []
    for lower, upper in ((0.2, 0.5), (0.5, 0.95)):
        for near, end in ((0.7, 0.95), (1.03, 1.12)):  # above the floor
            for side in (-1, 1):
                inside = (angle > lower * largest) & (angle < upper * largest)
                inside &= (distances > near * far) & (distances < end * far) & (azimuth * side > 0)
                volume = math.pi * (math.cos(lower * largest) - math.cos(upper * largest))
                volume *= far**3 * (end**3 - near**3) / 3
                values = inverse[inside]
                mean = values.sum() / count
                error = math.sqrt((values**2).sum() / count - mean**2) / math.sqrt(count)
                assert error < 0.05 * volume
                p.append(2 * stats.norm.sf(abs(mean - volume) / error))
    assert sidak(np.array(p)) >= SIGNIFICANCE, p


def through_a_mirror() -> object:
    """The lamp seen from the floor in a wall at x = -3 as well."""
    mirror = s.Material(s.Conductor((0.2, 0.4, 1.4), (3.4, 2.3, 1.8), 0.0))
    wall = quad((-3, 0, 4), (0, 0, -8), (0, 4, 0), 1)
    return build(
        picture_of(
            CAMERAS["perspective"], meshes=[floor(0, 8.0), wall], materials=[GREY, mirror],
            lights=[LAMP],
        )
    )  # fmt: skip


@pytest.mark.parametrize("mutation", ["multi_chain", "aimed"])
def test_so_it_does_for_chains_that_end_on_a_lamp(mutation: str) -> None:
    """Area of the floor times that of either half of the lamp. T is of directions, with the
    mirror's point and Dirac unit: |cosθ|²/(r1² r2²) becomes 1/(r1 + r2)², as the lamp is seen."""
    count = 120000
    out = proposals(through_a_mirror(), mutation, count, "LSDE")
    made, start = out["made"], out["start"]
    lamp, mirror, seen = (position(made, v) for v in range(3))
    near, far = (np.linalg.norm(p - mirror, axis=1) for p in (seen, lamp))
    cosine = np.abs(seen[:, 0] - mirror[:, 0]) / near
    made["log_density"] = made["log_density"] - 2 * np.log(cosine * (near + far) / (near * far))
    origin = np.array([start["raster_x"][0], start["raster_y"][0]])
    radius = 0.6 * start["largest_move"][0]
    half = pixel_area("perspective") * 0.8 * 0.6 / 2
    for side in (-1, 1):
        chosen = (lamp[:, 2] - 0.3) * side > 0
        require_measure(made, chosen, count, 0.5, origin, radius, half)


@pytest.mark.parametrize("stretch", [(40.0, 0.0, 40.0), (300.0, -200.0, 9.0), (2.0, 1.0, 0.7)])
def test_the_density_of_aimed_directions_integrates_to_solid_angle(
    stretch: tuple[float, float, float],
) -> None:
    """Cones about where most directions go, and beside."""
    count = 200000
    made = _core.aimed_direction_probe(*stretch, count=count, seed=1)
    directions = np.stack([made[axis] for axis in "xyz"], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=1e-6)
    widths = 0.15 / np.linalg.svd([[stretch[0], stretch[1]], [0, stretch[2]]])[1]
    p = []
    for beside in (0.0, 0.7, 2.5):
        for width in widths:
            axis = np.array([beside * width, 0.4 * beside * width, 1.0])
            angle = min(width, 0.5)
            solid_angle = 4 * math.pi * math.sin(angle / 2) ** 2
            sines = np.linalg.norm(np.cross(directions, axis / np.linalg.norm(axis)), axis=1)
            inside = sines < math.sin(angle)
            values = np.where(inside, 1 / made["pdf"], 0)
            if inside.sum() < 100:
                continue
            error = values.std() / math.sqrt(count)
            p.append(2 * stats.norm.sf(abs(values.mean() - solid_angle) / error))
    assert len(p) >= 3
    assert sidak(np.array(p)) >= SIGNIFICANCE, p


def require_solid_angles(out: dict, path_class: str) -> None:
    """E[A/T; y_0 → y_1 in half a ring about x_0 → x_1] = the half's solid angle, of the caustic
    walks that start on the light. A is what T has for a direction of density 1: conversions to
    area, and from half vectors to directions after every G."""
    made, start, count = out["made"], out["start"], out["choices"]["made"].size
    end = path_class.index("D")
    chosen = (made["l"] == 0) & (made["m"] == end + 1)
    points = [position(made, i) for i in range(end + 1)]
    value = np.where(chosen, np.exp(-made["log_density"]), 0)
    ways = []
    for i in range(1, end + 1):
        way = points[i] - points[i - 1]
        distance = np.linalg.norm(way, axis=1, keepdims=True)
        ways.append(way / distance)
        # Every wall is normal to an axis, along which its points do not move.
        moves = np.abs(points[i] - position(start, i))[chosen]
        cosine = np.abs(ways[-1][:, np.argmin(np.median(moves, axis=0))])
        value *= cosine / distance[:, 0] ** 2
        if i > 1:
            half = ways[-1] - ways[-2]
            value /= 4 * np.sum(half * ways[-1], axis=1) / np.linalg.norm(half, axis=1)

    before = np.concatenate([position(start, i) for i in range(end + 1)])
    axis = before[1] - before[0]
    across = ways[0] @ np.linalg.svd(axis[None])[2][1:].T
    angle = np.arctan2(np.hypot(*across.T), ways[0] @ axis / np.linalg.norm(axis))
    walked = np.linalg.norm(np.diff(before, axis=0), axis=1).sum()
    pixel = 2 * math.tan(math.radians(35)) / HEIGHT
    smallest = start["smallest_move"][0] * pixel * (start["length"][0] / walked - 1)
    smallest = min(smallest, 0.1 * 1.5)  # of the largest angle
    p = []
    for lower, upper in ((1.1 * smallest, 1.5 * smallest), (1.5 * smallest, 2 * smallest)):
        for side in (-1, 1):
            inside = (angle > lower) & (angle < upper) & (across[:, 0] * side > 0)
            mean = value[inside].sum() / count
            error = math.sqrt((value[inside] ** 2).sum() / count - mean**2) / math.sqrt(count)
            expected = math.pi * (math.cos(lower) - math.cos(upper))
            assert error < 0.03 * expected
            p.append(2 * stats.norm.sf(abs(mean - expected) / error))
    assert sidak(np.array(p)) >= SIGNIFICANCE, p


@pytest.mark.parametrize(
    ("mutation", "path_class"),
    [("caustic", "LDDE"), ("glossy_caustic", "LGDE"), ("glossy_caustic", "LGDDGDE")],
)
def test_the_choice_of_one_walk_of_several_is_counted(mutation: str, path_class: str) -> None:
    """LDDE and LGDDGDE have two each. Both ways choose among as many, so that neither stationarity
    nor what was recorded would tell that T leaves the choice out of both. The seed is one with
    paths that keep off the edges of walls, so that rings are reached all round."""
    scene, center = build_scene("two_plates"), (WIDTH / 2, HEIGHT / 2)
    out = _core.proposal_probe(scene, mutation, path_class, center, count=100000, seed=14)
    require_solid_angles(out, path_class)


def uniform(values: np.ndarray) -> float:
    assert values.min() >= -1e-3 and values.max() <= 1 + 1e-3
    return stats.kstest(values, "uniform").pvalue


def test_image_moves_are_log_uniform_in_all_directions() -> None:
    out = proposals(overhead("perspective"), "lens", 20000)
    made, start = out["made"], out["start"]
    assert out["choices"]["made"].all()
    x, y = (made[f"raster_{axis}"] - start[f"raster_{axis}"][0] for axis in "xy")
    lower, upper = start["smallest_move"][0], start["largest_move"][0]
    assert math.pi * upper**2 == pytest.approx(0.05 * WIDTH * HEIGHT)
    assert uniform(np.log(np.hypot(x, y) / lower) / math.log(upper / lower)) >= SIGNIFICANCE
    assert uniform(np.arctan2(y, x) / (2 * math.pi) + 0.5) >= SIGNIFICANCE


@pytest.mark.parametrize(("scale", "smallest"), [(1, 0.1 * 2.47), (10, 0.5)])
def test_the_smallest_move_is_half_a_pixel_where_a_picture_is_large(
    scale: int, smallest: float
) -> None:
    content = {"meshes": [floor(0, 8.0)], "materials": [GREY], "lights": [LAMP]}
    picture = picture_of(CAMERAS["perspective"], **content)
    scene = build(replace(picture, width=scale * WIDTH, height=scale * HEIGHT))
    center = (scale * WIDTH / 2, scale * HEIGHT / 2)
    start = _core.proposal_probe(scene, "lens", "LDE", center, count=1, depth=3)["start"]
    assert start["smallest_move"][0] == pytest.approx(smallest, rel=1e-2)


def test_caustic_angles_are_log_uniform_in_the_range_of_the_path() -> None:
    """θ = r · pixel angle · |x_1 x_2| / |x_0 x_1|."""
    out = proposals(overhead("perspective"), "caustic", 20000)
    made, start = out["made"], out["start"]
    x0, x1, x2 = (position(start, v)[0] for v in range(3))
    before, after = x1 - x0, position(made, 1) - x0
    angle = np.arctan2(np.linalg.norm(np.cross(after, before), axis=1), after @ before)
    pixel = 2 * math.tan(math.radians(20)) / HEIGHT
    scale = pixel * np.linalg.norm(x2 - x1) / np.linalg.norm(before)
    lower, upper = start["smallest_move"][0] * scale, start["largest_move"][0] * scale
    assert uniform(np.log(angle / lower) / math.log(upper / lower)) >= SIGNIFICANCE


# ---- Choices of the bidirectional mutation ----------------------------------------------------


@pytest.mark.parametrize("min_edges", [1, 3])
@pytest.mark.parametrize("edges", range(3, 7))
def test_choices_are_complete(edges: int, min_edges: int) -> None:
    """Probabilities of (l, m, k_a) sum to 1, and every length from min_edges to the depth can be
    reached, and no other."""
    depth = 6
    choices = _core.bidirectional_choices(overhead("perspective"), edges, depth, min_edges)
    assert sum(p for *_, p in choices) == pytest.approx(1)
    lengths = {edges - (m - first) + added for first, m, added, _ in choices}
    assert lengths == set(range(min_edges, 7))
    assert not any(m - first == 1 == added for first, m, added, _ in choices), "the null change"


@pytest.mark.parametrize("path_class", ["LDE", "LE"])
def test_choices_have_the_frequencies_that_the_density_has(path_class: str) -> None:
    count = 200000
    light = s.SphereLight((1, 1, 1), 0.3, facing((0.5, 1.5, 0.2), (0, 0, 0)))
    scene = overhead("perspective", light)
    drawn = proposals(scene, "bidirectional", count, path_class)["choices"]
    table = {
        tuple(change): p
        for *change, p in _core.bidirectional_choices(scene, len(path_class) - 1, 3)
    }
    keys, observed = np.unique(
        np.stack([drawn["l"], drawn["m"], drawn["m_y"] - drawn["l"]], axis=1).astype(int),
        axis=0, return_counts=True,
    )  # fmt: skip
    counts = {tuple(k): n for k, n in zip(keys.tolist(), observed, strict=True)}
    assert set(counts) <= set(table)
    expected = np.array([p * count for p in table.values()])
    result = stats.chisquare([counts.get(k, 0) for k in table], expected)
    assert result.pvalue >= SIGNIFICANCE
