"""The closures that the tests of scattering go through, and the directions they are seen from."""

from __future__ import annotations

import numpy as np
import pytest

from support.scattering import polar, probe
from usdmlt import scene
from usdmlt.scene import (
    Add,
    Conductor,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Layer,
    Mix,
    Multiply,
    PreviewSurface,
    Sheen,
    Translucent,
)

WHITE = (1.0, 1.0, 1.0)
GLASS = GeneralizedSchlick(color0=(0.03, 0.04, 0.05), roughness=0.4, scatter_mode="RT")
PLASTIC = Layer(Dielectric(roughness=0.2), Diffuse((0.8, 0.5, 0.2)))

# One of every lobe, then of every way to combine them. None has a Dirac part.
ROUGH: dict[str, scene.Closure] = {
    "lambert": Diffuse((0.9, 0.6, 0.3)),
    "oren_nayar": Diffuse((0.9, 0.6, 0.3), roughness=0.5),
    "eon": Diffuse((0.9, 0.6, 0.3), roughness=0.7, energy_compensation=True),
    "translucent": Translucent((0.9, 0.6, 0.3)),
    "sheen": Sheen((0.9, 0.6, 0.3), roughness=0.4),
    "sheen_of_short_fibres": Sheen(roughness=0.08),
    "dielectric_R": Dielectric(roughness=0.3),
    "dielectric_T": Dielectric(roughness=0.3, scatter_mode="T"),
    "dielectric_RT": Dielectric(roughness=0.3, scatter_mode="RT"),
    "dielectric_RT_rough": Dielectric(roughness=0.8, scatter_mode="RT"),
    "dielectric_RT_anisotropic": Dielectric(roughness=(0.1, 0.5), scatter_mode="RT"),
    "dielectric_RT_nearly_smooth": Dielectric(roughness=2e-3, scatter_mode="RT"),
    "dielectric_RT_rarer_inside": Dielectric(ior=0.75, roughness=0.2, scatter_mode="RT"),
    "dielectric_RT_of_two_tints": Dielectric(
        roughness=0.3, scatter_mode="RT", tint=(0.9, 0.8, 0.7), reflection_tint=(0.3, 0.5, 0.9)
    ),
    "conductor": Conductor(roughness=0.25),
    "conductor_anisotropic": Conductor(roughness=(0.4, 0.08)),
    "conductor_nearly_smooth": Conductor(roughness=1.1e-3),
    "schlick_R": GeneralizedSchlick((0.9, 0.4, 0.1), exponent=3.0, roughness=0.3),
    "schlick_with_an_edge": GeneralizedSchlick(
        (0.9, 0.7, 0.3), color82=(0.9, 0.5, 0.1), roughness=0.3
    ),
    "schlick_RT": GLASS,
    "plastic": PLASTIC,
    "coated_metal": Layer(Dielectric(roughness=0.1), Conductor(roughness=0.4)),
    "velvet": Layer(Sheen((0.9, 0.5, 0.5), weight=0.8), Diffuse((0.5, 0.1, 0.1))),
    "lacquered_velvet": Layer(
        Dielectric(roughness=0.2), Layer(Sheen(roughness=0.2), Diffuse((0.5, 0.1, 0.1)))
    ),
    "leaf": Layer(
        Dielectric(roughness=0.4), Mix(Diffuse((0.2, 0.6, 0.1)), Translucent((0.4, 0.9, 0.2)), 0.6)
    ),
    "layers_in_a_mix": Mix(PLASTIC, Layer(GLASS, Diffuse()), 0.3),
    "layer_of_a_layer": Layer(Multiply(PLASTIC, (0.5, 0.7, 0.9)), Diffuse()),
    "sum": Add(Multiply(PLASTIC, 0.5), Multiply(GLASS, (0.2, 0.3, 0.4))),
    "preview_surface": PreviewSurface((0.7, 0.3, 0.2), clearcoat=0.6, clearcoatRoughness=0.4),
}

# With Dirac parts, alone and beside others.
SMOOTH: dict[str, scene.Closure] = {
    "mirror": GeneralizedSchlick((0.9, 0.6, 0.3), roughness=0.0),
    "polished_metal": Conductor(roughness=0.0),
    "glass": Dielectric(roughness=0.0, scatter_mode="RT"),
    "tinted_glass": Dielectric(ior=1.7, roughness=0.0, tint=(0.9, 0.6, 0.3), scatter_mode="RT"),
    "glass_T": Dielectric(roughness=0.0, scatter_mode="T"),
    "schlick_glass": GeneralizedSchlick((0.03, 0.04, 0.05), roughness=0.0, scatter_mode="RT"),
    "bubble": Dielectric(ior=0.75, roughness=0.0, scatter_mode="RT"),
    "no_interface": Dielectric(ior=1.0, roughness=0.3, scatter_mode="RT"),
    "varnish": Layer(Dielectric(roughness=0.0), Diffuse((0.8, 0.5, 0.2))),
    "glass_in_parts": Layer(Dielectric(roughness=0.0), Dielectric(roughness=0.0, scatter_mode="T")),
    "frosted_and_clear": Mix(GLASS, Dielectric(roughness=0.0, scatter_mode="RT"), 0.4),
    "clear_preview_surface": PreviewSurface(roughness=0.0, opacity=0.0),
    "tinted_preview_surface": PreviewSurface(
        (0.7, 0.3, 0.2), roughness=0.5, clearcoat=0.5, clearcoatRoughness=0.0, opacity=0.4
    ),
}

# From above and below: steep, oblique, grazing. −0.5 is beyond the critical angle of glass.
DIRECTIONS = {f"{c:+.2f}": polar(c, 0.7) for c in (0.95, 0.4, 0.06, -0.5, -0.9)}


def closures_of(cases: dict[str, scene.Closure]):
    """Probes made once."""
    return {name: probe(closure) for name, closure in cases.items()}


@pytest.fixture(scope="session")
def rough_closures():
    return closures_of(ROUGH)


@pytest.fixture(scope="session")
def smooth_closures():
    return closures_of(SMOOTH)


@pytest.fixture(scope="session", params=ROUGH)
def rough(request, rough_closures):
    """The core's closure of one rough case."""
    return rough_closures[request.param]


@pytest.fixture(scope="session", params=SMOOTH)
def smooth(request, smooth_closures):
    """The core's closure of one case with Dirac parts."""
    return smooth_closures[request.param]


@pytest.fixture(scope="session", params=ROUGH | SMOOTH)
def any_closure(request, rough_closures, smooth_closures):
    """The core's closure of any case."""
    return (rough_closures | smooth_closures)[request.param]


@pytest.fixture(params=DIRECTIONS.values(), ids=DIRECTIONS)
def known(request) -> np.ndarray:
    """The direction that is given."""
    return request.param


@pytest.fixture(params=["eye", "light"])
def role(request) -> str:
    """What is known: the direction to the eye, or to the light."""
    return request.param
