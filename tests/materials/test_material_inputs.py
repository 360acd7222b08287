"""Materials as programs: inputs from constants, textures and primvars; opacity; what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from support.scattering import draw, polar, probe, probe_material, random_directions
from usdmlt import closures, scene
from usdmlt.scene import (
    Add,
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Material,
    Mix,
    Multiply,
    PreviewSurface,
    PrimvarInput,
    Texture,
    TextureInput,
    UniformEmission,
)

# A 2 x 1 image that is constant in t: (0.1, 0.2, 0.3, 0.4) at s = 1/4, (0.5, 0.6, 0.7, 0.8) at 3/4.
RAMP = Texture(np.array([[[0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]]], np.float32), "clamp")
LEFT, RIGHT = (0.25, 0.5), (0.75, 0.5)


def emitted(value: scene.Input, st=LEFT, textures=(RAMP,), **primvars: np.ndarray) -> np.ndarray:
    """An input, read through a closure that emits it; the three corners share ``st``."""
    primvars = {"st": np.tile(st, (3, 1)), **primvars}
    material = Material(UniformEmission(value))
    p = probe_material(material, list(textures), primvars, barycentrics=(0.25, 0.5))
    assert_allclose(p.emission, p.emission_alone)
    return np.array(p.emission)


def test_constants_are_colours_or_grey():
    assert_allclose(emitted((0.1, 0.2, 0.3)), [0.1, 0.2, 0.3])
    assert_allclose(emitted(0.7), [0.7, 0.7, 0.7])


@pytest.mark.parametrize(
    ("channel", "expected"),
    [("rgb", (0.1, 0.2, 0.3)), ("r", 0.1), ("g", 0.2), ("b", 0.3), ("a", 0.4)],
)
def test_textures_give_the_channel_that_is_asked_for(channel, expected):
    assert_allclose(emitted(TextureInput(0, channel=channel)), np.broadcast_to(expected, 3))


def test_scale_and_bias_are_applied_per_channel():
    scale, bias = (2.0, 3.0, 4.0, 5.0), (0.5, 0.25, 0.125, 1.0)
    texture = TextureInput(0, scale=scale, bias=bias)
    assert_allclose(emitted(texture), [0.7, 0.85, 1.325], rtol=1e-6)
    texture = TextureInput(0, channel="a", scale=scale, bias=bias)
    assert_allclose(emitted(texture), 3.0, rtol=1e-6)


def test_texture_coordinates_are_transformed():
    turned = np.array([[0.0, 1.0, 0.25], [1.0, 0.0, 0.0]])  # s' = t + 1/4
    assert_allclose(emitted(TextureInput(0, transform=turned), (0.9, 0.5)), [0.5, 0.6, 0.7])


def test_two_inputs_of_one_texture_may_differ_in_place_and_channel():
    shifted = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0]])
    material = Material(
        Conductor(
            roughness=(TextureInput(0, channel="r"), TextureInput(0, channel="g")),
            ior=TextureInput(0, transform=shifted),
        )
    )
    p = probe_material(material, [RAMP], {"st": np.tile(LEFT, (3, 1))})
    assert_allclose(p.lobes[0]["alpha"], (0.1, 0.2), rtol=1e-6)
    assert_allclose(p.lobes[0]["color0"], (0.5, 0.6, 0.7), rtol=1e-6)


def test_primvars_are_interpolated_over_the_triangle():
    corners = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert_allclose(emitted(PrimvarInput("color"), color=corners), [0.25, 0.25, 0.5])
    assert_allclose(emitted(PrimvarInput("heat"), heat=np.array([[1.0], [3.0], [5.0]])), 3.5)


def test_a_primvar_that_the_mesh_lacks_gives_its_fallback():
    assert_allclose(emitted(PrimvarInput("color", (0.3, 0.2, 0.1))), [0.3, 0.2, 0.1])
    assert_allclose(emitted(PrimvarInput("color", 0.6)), 0.6)


def test_a_texture_without_coordinates_is_read_at_the_origin():
    material = Material(UniformEmission(TextureInput(0)))
    assert_allclose(probe_material(material, [RAMP]).emission, [0.1, 0.2, 0.3])


def test_an_unreadable_texture_gives_its_fallback_as_it_is():
    missing = TextureInput(None, scale=(2.0,) * 4, fallback=(0.1, 0.2, 0.3, 0.4))
    assert_allclose(emitted(missing), [0.1, 0.2, 0.3])
    missing.channel = "a"
    assert_allclose(emitted(missing), 0.4)


def test_primvar_slots_are_shared_by_the_materials_of_a_scene():
    materials = [
        Material(Diffuse(TextureInput(0, primvar="st"), roughness=PrimvarInput("dust"))),
        Material(Diffuse(PrimvarInput("dust"), weight=TextureInput(0, primvar="map2"))),
    ]
    description = scene.Scene(materials=materials, textures=[RAMP])
    compiled, slots = closures.compile_materials(description)
    assert set(slots) == {"st", "dust", "map2"}
    assert sorted(slots.values()) == [0, 1, 2]
    for material, names in zip(compiled, ({"st", "dust"}, {"dust", "map2"}), strict=True):
        read = {value[2] for value in material["values"] if value[0] == "primvar"}
        assert read == {slots[name] for name in names}


def test_textured_and_constant_closures_are_the_same():
    """The folded copy of a constant material, and the program that runs at every point."""
    white = Texture(np.ones((1, 1, 1), np.float16))
    one = TextureInput(0)
    light, eye = random_directions(500, seed=1), random_directions(500, seed=2)
    for closure in (
        lambda w: Layer(Dielectric(roughness=0.3, weight=w), Diffuse((0.2, 0.5, 0.7))),
        lambda w: Mix(
            PreviewSurface((0.2, 0.5, 0.7), clearcoat=w, clearcoatRoughness=0.3),
            Multiply(GeneralizedSchlick((0.9, 0.5, 0.2)), w),
            0.3,
        ),
    ):
        constant = probe(closure(1.0))
        textured = probe_material(Material(closure(one)), [white])
        assert constant.lobes == textured.lobes
        assert_allclose(constant.evaluate(light, eye), textured.evaluate(light, eye), rtol=1e-6)
        assert_allclose(constant.pdf(eye, light, "eye"), textured.pdf(eye, light, "eye"), rtol=1e-6)


@pytest.mark.parametrize(
    ("opacity", "threshold", "expected"),
    [
        (1.0, 0.0, 1.0),
        (0.3, 0.0, 0.3),
        (-1.0, 0.0, 0.0),
        (7.0, 0.0, 1.0),
        (0.3, 0.3, 1.0),
        (0.3, 0.31, 0.0),
        (float("nan"), 0.0, 0.0),
    ],
)
def test_opacity_is_a_fraction_or_a_cut_out(opacity, threshold, expected):
    p = probe_material(Material(Diffuse(), opacity=opacity, opacity_threshold=threshold))
    assert p.opacity == pytest.approx(expected)
    assert p.is_opaque == (expected == 1.0)


def test_opacity_is_read_from_textures():
    material = Material(Diffuse(), opacity=TextureInput(0, channel="a"), opacity_threshold=0.5)
    for st, expected in ((LEFT, 0.0), (RIGHT, 1.0)):
        p = probe_material(material, [RAMP], {"st": np.tile(st, (3, 1))})
        assert p.opacity == expected
        assert not p.is_opaque


def test_no_closure_absorbs_everything():
    p = probe(None)
    assert p.lobes == []
    assert not p.has_non_delta
    assert not p.is_emissive
    up = polar(0.5)
    assert (p.evaluate(up[None], up[None]) == 0).all()
    assert p.pdf(up[None], up[None], "eye")[0] == 0
    assert not draw(p, up, "eye", 10).valid.any()


def test_only_closures_that_may_emit_are_emissive():
    assert not probe(UniformEmission((0.0, 0.0, 0.0))).is_emissive
    assert not probe(Multiply(UniformEmission(), 0.0)).is_emissive
    assert not probe(PreviewSurface()).is_emissive
    assert probe(PreviewSurface(emissiveColor=(0.0, 0.0, 1.0))).is_emissive
    textured = Material(UniformEmission(TextureInput(0)))
    assert probe_material(textured, [RAMP]).is_emissive


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -1.0])
def test_values_that_are_no_colours_scatter_nothing(bad):
    p = probe(Diffuse((bad, 0.5, bad)))
    assert_allclose(p.lobes[0]["weight"], [0.0, 0.5, 0.0])
    assert_allclose(probe(UniformEmission((bad, 2.0, bad))).emission, [0.0, 2.0, 0.0])


def test_weights_above_one_do_not_make_light():
    p = probe(Multiply(Diffuse((0.8, 0.5, 0.1)), 3.0))
    assert_allclose(p.lobes[0]["weight"], [1.0, 1.0, 0.3], rtol=1e-6)


def test_lobes_without_weight_are_dropped():
    assert probe(Diffuse((0.0, 0.0, 0.0))).lobes == []
    assert len(probe(Mix(Diffuse(), Conductor(), 1.0)).lobes) == 1
    assert [x["type"] for x in probe(PreviewSurface(metallic=1.0)).lobes] == ["schlick"]


@pytest.mark.parametrize("alpha", [0.0, 9e-4, -0.3, float("nan")])
def test_alpha_below_a_thousandth_is_smooth(alpha):
    assert probe(Conductor(roughness=alpha)).lobes[0]["delta"]
    assert not probe(Conductor(roughness=(alpha, 0.1))).lobes[0]["delta"]
    assert not probe(Conductor(roughness=1e-3)).lobes[0]["delta"]


def chain(n: int) -> scene.Closure:
    """A sum of ``n`` lobes."""
    closure: scene.Closure = Diffuse()
    for _ in range(n - 1):
        closure = Add(closure, Diffuse())
    return closure


def test_eight_lobes_are_the_most():
    assert len(probe(chain(8)).lobes) == 8
    with pytest.raises(ValueError, match="material 'probed' has 9 lobes; at most 8"):
        probe(chain(9))
    # Those that certainly are not there do not count.
    two = Mix(PreviewSurface(), PreviewSurface(), 0.5)
    assert len(probe(Mix(two, two, 0.5)).lobes) == 8


def test_deep_nesting_is_refused_and_not_run():
    closure: scene.Closure = UniformEmission()
    for _ in range(40):
        closure = Add(UniformEmission(), closure)
    with pytest.raises(ValueError, match="material 'probed' is nested too deeply"):
        probe(closure)


@pytest.mark.parametrize(
    ("closure", "message"),
    [
        (Diffuse(TextureInput(3)), "texture 3 is none of the scene's"),
        (Diffuse(TextureInput(0, channel="x")), "channel 'x'"),
        (Diffuse((1.0, 2.0)), "neither a number nor a colour"),
        (Diffuse("red"), "material 'rug'"),
        (Diffuse(TextureInput(0, transform=np.eye(3))), r"transform is \(2, 3\)"),
        (Dielectric(scatter_mode="TR"), "scatter mode 'TR'"),
        (Layer(Diffuse(), "Diffuse"), "str is not a closure"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_no_input_is_refused_with_the_materials_name(closure, message):
    with pytest.raises(ValueError, match=message) as error:
        probe_material(Material(closure, name="rug"), [RAMP])
    assert "material 'rug'" in str(error.value)
