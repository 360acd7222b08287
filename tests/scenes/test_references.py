"""Scenes look as they did, and as another integrator sees them.

References are long renders by bidirectional path tracing, which shares no estimator with path
tracing and no Markov chain with mlt, so these check them as well as the scenes. Means are compared
in cells of 4 pixels and more, by fixed random numbers, at a significance of 1e-4 each.

Only integrators are here that find all light of a scene often: what another meets once or twice in
a picture may be missing in its place. They are compared in the mean, in test_pictures.py.

    pytest tests/scenes/test_references.py --usdmlt-update
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pxr import Usd

from support.eased import EASED

REFERENCE = {"integrator": "bdpt", "samples": 2048, "width": 96}
# Samples or mutations per pixel are 192.
CHECKS = {
    "caustics": ("mlt",),
    "cornell_box": ("path", "mlt"),
    "door_ajar": ("path", "mlt"),
    "gallery": ("path", "mlt"),
    "keyhole": ("mlt",),
    "pool": ("mlt",),
    "small_aperture": ("path",),
    "snow_globe": ("mlt",),
}


@pytest.mark.parametrize(
    ("name", "integrator"), [(name, one) for name, all_ in CHECKS.items() for one in all_]
)
def test_a_scene_renders_to_its_reference(
    name: str,
    integrator: str,
    open_scene: Callable[..., Usd.Stage],
    assert_render: Callable[..., None],
    request: pytest.FixtureRequest,
) -> None:
    stage = open_scene(name, EASED[name])
    if not request.config.getoption("--usdmlt-update"):
        assert_render(stage, name, integrator=integrator, samples=192)
    elif integrator == CHECKS[name][0]:  # once
        assert_render(stage, name, **REFERENCE)


def test_a_reference_is_not_that_of_another_stage(
    open_scene: Callable[..., Usd.Stage], assert_render: Callable[..., None]
) -> None:
    """The blue of the shell ten per cent less."""
    stage = open_scene(
        "cornell_box", {"/World/Materials/White/diffuse.inputs:color": (0.738, 0.736, 0.665)}
    )
    with pytest.raises(pytest.fail.Exception, match="the stage is not the one of the reference"):
        assert_render(stage, "cornell_box", integrator="path", samples=192)
