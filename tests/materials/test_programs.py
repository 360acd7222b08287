"""Pattern programs: what every node computes, what is folded, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import probe_material
from usdmlt import closures, scene
from usdmlt.native import core
from usdmlt.scene import Diffuse, Material, Node, PrimvarInput, Texture, TextureInput

# Read from a primvar, so that nothing is folded; all positive, and below 1.
A, B = np.array([0.3, 0.6, 0.9]), np.array([0.5, 0.2, 0.7])
PRIMVARS = {"a": np.tile(A, (3, 1)), "b": np.tile(B, (3, 1)), "x": np.full((3, 1), 0.4)}
a, b, x = PrimvarInput("a"), PrimvarInput("b"), PrimvarInput("x")


def value(node: scene.Input, **options: object) -> np.ndarray:
    """What a node gives, shown as emission (negative parts are lost there)."""
    material = Material(scene.UniformEmission(node))
    probe = probe_material(material, primvars=PRIMVARS, **options)
    assert_allclose(probe.emission, probe.emission_alone)
    return np.array(probe.emission)


def smoothstep(value, low, high):
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


NODES = {
    "add": ((a, b), A + B),
    "subtract": ((1.0, a), 1 - A),
    "multiply": ((a, x), A * 0.4),
    "divide": ((a, b), A / B),
    "modulo": ((a, 0.25), A % 0.25),
    "power": ((a, b), A**B),
    "min": ((a, b), np.minimum(A, B)),
    "max": ((a, b), np.maximum(A, B)),
    "atan2": ((a, b), np.arctan2(A, B)),
    "absolute": ((Node("subtract", (0.0, a)),), A),
    "sign": ((a,), np.ones(3)),
    "floor": ((Node("multiply", (a, 3.5)),), np.floor(3.5 * A)),
    "ceil": ((a,), np.ones(3)),
    "round": ((a,), np.round(A)),
    "sqrt": ((a,), np.sqrt(A)),
    "ln": ((Node("add", (a, 1.0)),), np.log(1 + A)),
    "exp": ((a,), np.exp(A)),
    "sin": ((a,), np.sin(A)),
    "cos": ((a,), np.cos(A)),
    "tan": ((a,), np.tan(A)),
    "asin": ((a,), np.arcsin(A)),
    "acos": ((a,), np.arccos(A)),
    "clamp": ((a, 0.4, 0.7), np.clip(A, 0.4, 0.7)),
    "mix": ((a, b, x), 0.4 * A + 0.6 * B),
    "smoothstep": ((a, 0.2, 0.8), smoothstep(A, 0.2, 0.8)),
    "if_greater": ((x, 0.3, a, b), A),
    "if_greater_or_equal": ((x, 0.5, a, b), B),
    "if_equal": ((x, x, a, b), A),
    "dot": ((a, b), np.full(3, A @ B)),
    "cross": (((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)), [0, 1, 0]),
    "magnitude": ((a,), np.full(3, np.linalg.norm(A))),
    "normalize": ((a,), A / np.linalg.norm(A)),
    "extract": ((a,), np.full(3, A[0])),
    "combine3": ((x, 0.1, Node("extract", (b,), 1, 2)), [0.4, 0.1, 0.7]),
    "rgb_to_hsv": ((a,), [210 / 360, 2 / 3, 0.9]),
    "hsv_to_rgb": (((210 / 360, 2 / 3, 0.9),), A),
    "position": ((), [0.25, 0.5, 0]),
    "normal": ((), [0, 0, 1]),
    "affine": ((a, (2.0, 0.0, 0.5), (0.0, 3.0, 0.25)), [1.1, 2.05, 0]),
}


@pytest.mark.parametrize("name", NODES)
def test_nodes_compute_what_they_are_named_for(name):
    inputs, expected = NODES[name]
    found = value(Node(name, inputs), barycentrics=(0.25, 0.5))
    assert_allclose(found, expected, rtol=2e-6, atol=1e-6)


def test_vectors_of_two_and_four_count_their_own_lanes():
    assert_allclose(value(Node("dot", (a, b), width=2)), A[:2] @ B[:2], rtol=1e-6)
    assert_allclose(value(Node("magnitude", (a,), width=2)), np.hypot(*A[:2]), rtol=1e-6)
    four = Node("combine4", (x, x, x, 0.5), width=4)
    assert_allclose(value(Node("dot", (four, four), width=4)), 3 * 0.16 + 0.25, rtol=1e-6)


def test_rotate2d_is_clockwise_by_degrees():
    st = Node("combine2", (1.0, x), width=2)
    found = value(Node("rotate2d", (st, -90.0), width=2))
    assert_allclose(
        value(Node("extract", (Node("rotate2d", (st, 90.0), 2),), 1, 0)), 0.4, rtol=1e-6
    )
    assert_allclose(found[1], 1.0, rtol=1e-6)


@pytest.mark.parametrize("rgb", np.random.default_rng(5).random((20, 3)).tolist())
def test_hsv_goes_there_and_back(rgb):
    shifted = Node("add", (tuple(rgb), Node("multiply", (x, 0.0))))
    assert_allclose(value(Node("hsv_to_rgb", (Node("rgb_to_hsv", (shifted,)),))), rgb, atol=2e-6)


def test_artistic_indices_have_the_reflectance_they_are_made_for():
    """Normal reflectance ((n − 1)² + k²) / ((n + 1)² + k²) of the indices is the input."""
    edge = (0.9, 0.5, 0.1)
    n = value(Node("artistic_index", (a, edge)))
    k = value(Node("artistic_extinction", (a, edge)))
    assert_allclose(((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2), A, rtol=1e-5)
    no_tint, full_tint = (value(Node("artistic_index", (a, e))) for e in (0.0, 1.0))
    assert_allclose(no_tint, (1 + np.sqrt(A)) / (1 - np.sqrt(A)), rtol=1e-5)
    assert_allclose(full_tint, (1 - A) / (1 + A), rtol=1e-5)


def noise_at(points: np.ndarray, operation: str, **options: object) -> np.ndarray:
    """Noise at points (n, 3), brought to [0, 1]."""
    found = []
    for point in points:
        raised = Node("add", (Node(operation, (tuple(map(float, point)),), 1), 1.0))
        found.append(probe_material(Material(scene.UniformEmission(raised))).emission[0] - 1)
    return np.array(found)


@pytest.mark.parametrize("operation", ["noise2d", "noise3d"])
def test_noise_is_gradient_noise(operation):
    """0 on the lattice, continuous, within its range, of mean 0, and not the same everywhere."""
    rng = np.random.default_rng(1)
    assert_allclose(noise_at(rng.integers(-9, 9, (20, 3)), operation), 0, atol=1e-6)
    points = rng.uniform(-20, 20, (1500, 3))
    values = noise_at(points, operation)
    assert np.abs(values).max() <= 1.0
    assert abs(values.mean()) < 4.5 * values.std() / np.sqrt(len(values))
    assert 0.15 < values.std() < 0.5
    near = noise_at(points[:200] + 1e-4, operation)
    assert np.abs(near - values[:200]).max() < 2e-3


def test_fractals_are_sums_of_noise():
    p = (0.37, 1.21, -0.83)
    octaves = [noise_at(np.array([p]) * 2.0**k, "noise3d")[0] * 0.5**k for k in range(3)]
    found = Node("add", (Node("fractal3d", (p, 2.0, 0.5), 1, 3), 1.0))
    probe = probe_material(Material(scene.UniformEmission(found)))
    assert probe.emission[0] - 1 == pytest.approx(sum(octaves), abs=1e-5)


def test_what_is_constant_is_folded():
    """The same lobes as without the program, and no texture is needed to know them."""
    folded = Diffuse(Node("mix", ((0.2, 0.4, 0.6), 1.0, Node("sqrt", (0.25,)))))
    plain = Diffuse((0.6, 0.7, 0.8))
    assert_allclose(
        probe_material(Material(folded)).lobes[0]["weight"],
        probe_material(Material(plain)).lobes[0]["weight"],
    )
    emission = Node("multiply", (0.0, Node("sin", (1.0,))))
    assert not probe_material(Material(scene.UniformEmission(emission))).is_emissive


def test_equal_values_are_computed_once():
    image = Texture(np.full((1, 1, 3), 0.5, np.float32))
    read = TextureInput(0)
    shared = Node("multiply", (read, Node("multiply", (TextureInput(0), 2.0))))
    description = scene.Scene(materials=[Material(Diffuse(shared))], textures=[image])
    compiled = closures.compile_materials(description)[0][0]
    assert sum(value[0] == "texture" for value in compiled["values"]) == 1
    deep: scene.Input = a
    for _ in range(60):  # 2^60 nodes, if they were not shared
        deep = Node("multiply", (Node("add", (deep, deep)), 0.5))
    assert_allclose(value(deep), A, rtol=1e-5)


def test_textures_are_read_where_nodes_say():
    image = Texture(np.array([[[0.1], [0.9]]], np.float32), "clamp", "clamp")
    st = Node("combine2", (Node("subtract", (1.0, x)), 0.5), 2)
    material = Material(scene.UniformEmission(TextureInput(0, coordinates=st)))
    found = probe_material(material, [image], PRIMVARS).emission[0]
    assert found == pytest.approx(0.1 + 0.8 * (0.6 * 2 - 0.5), rel=1e-5)


def test_normals_may_be_computed():
    flipped = Node("multiply", (TextureInput(0), (1.0, -1.0, 1.0)))
    image = Texture(np.array([[[0.3, 0.4, 0.8]]], np.float32))
    st = {"st": [(0, 0), (1, 0), (0, 1)]}
    probe = probe_material(Material(Diffuse(), normal=flipped), [image], st, tangent=(1, 0, 0))
    assert_allclose(probe.shading_normal, np.array([0.3, -0.4, 0.8]) / np.sqrt(0.89), rtol=1e-5)


def test_tangents_turn_about_the_normal():
    closure = scene.Conductor(roughness=(0.3, 0.1))
    for turns, expected in ((0.0, (1, 0, 0)), (0.25, (0, 1, 0)), (0.5, (-1, 0, 0))):
        material = Material(closure, tangent_rotation=turns)
        assert_allclose(
            probe_material(material, tangent=(1, 0, 0)).shading_tangent, expected, atol=1e-6
        )


@pytest.mark.parametrize(
    ("node", "message"),
    [
        (Node("teapot", (a,)), "material 'rug' has a node of unknown kind 'teapot'"),
        (Node("add", (a,)), "material 'rug' has a node 'add' with 1 inputs"),
        (Node("add", (a, (1.0,) * 5)), "neither a number nor a vector"),
    ],
)
def test_what_is_no_node_is_refused(node, message):
    with pytest.raises(ValueError, match=message):
        probe_material(Material(Diffuse(node), name="rug"), primvars=PRIMVARS)


def test_programs_that_are_too_long_are_refused():
    long: scene.Input = a
    for i in range(300):
        long = Node("add", (long, float(i)))
    with pytest.raises(ValueError, match="more than 256 pattern nodes"):
        probe_material(Material(Diffuse(long)), primvars=PRIMVARS)


def test_every_node_of_the_core_is_tested():
    elsewhere = {"primvar", "texture", "udim", "combine2", "combine4", "convert", "rotate2d"}
    elsewhere |= {"artistic_index", "artistic_extinction", "noise2d", "noise3d", "fractal3d"}
    assert set(core().node_names()) == set(NODES) | elsewhere | {"checker"}


def test_checkers_alternate():
    for st, odd in (((0.5, 0.5), 0), ((1.5, 0.5), 1), ((1.5, 1.5), 0), ((-0.5, 0.5), 1)):
        assert value(Node("checker", ((*st, 0.0),), 1))[0] == odd


def test_conversions_fill_what_was_not_there():
    three = Node("convert", (Node("combine2", (x, 0.2), 2),), 3, 2)
    assert_allclose(value(three), [0.4, 0.2, 0.0], rtol=1e-6)
    four = Node("convert", (a,), 4, 3)
    assert_allclose(value(Node("extract", (four,), 1, 3)), 1.0)
