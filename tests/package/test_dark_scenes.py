"""Scenes whose light does not reach the camera, or only by paths that nothing can find."""

from __future__ import annotations

import json
import logging
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import usdmlt
from support import scenes
from support.shapes import box, facing, floor, perspective, quad, sphere, translate
from usdmlt import scene as s

INTEGRATORS = ("path", "bdpt", "mlt")
Run = Callable[..., "subprocess.CompletedProcess[str]"]

MIRROR = s.Material(s.Conductor(roughness=0.0), name="mirror")
SUN = s.DistantLight((3, 3, 3), 0.0, facing((0, 0, 0), (0, -1, -0.5)), name="sun")
CAMERA = perspective((0, 2.5, 5), (0, 0.4, 0), 40)


def without_lights() -> s.Scene:
    return scenes.picture_of(CAMERA, meshes=[floor(0)], materials=[scenes.WHITE])


def with_nothing_at_all() -> s.Scene:
    return scenes.picture_of(CAMERA)


def with_a_lamp_in_a_closed_box() -> s.Scene:
    """All of whose light stays inside: chains could start nowhere."""
    return scenes.picture_of(
        CAMERA,
        meshes=[floor(0), box((-0.5, 0, -0.5), (0.5, 1, 0.5))],
        materials=[scenes.WHITE],
        lights=[s.SphereLight((5, 5, 5), 0.2, translate(0, 0.5, 0))],
    )


def with_a_lamp_that_shines_into_the_void() -> s.Scene:
    return scenes.picture_of(
        CAMERA,
        meshes=[floor(0)],
        materials=[scenes.WHITE],
        lights=[s.DiskLight((5, 5, 5), 0.4, facing((0, 4, 0), (0, 5, 0), (0, 0, 1)))],
    )


def with_black_lights() -> s.Scene:
    return scenes.picture_of(
        CAMERA,
        meshes=[floor(0)],
        materials=[scenes.WHITE],
        lights=[s.DomeLight((0, 0, 0)), s.DistantLight((0, 0, 0), 0.0)],
    )


def with_black_walls() -> s.Scene:
    return scenes.picture_of(
        CAMERA,
        meshes=[floor(0)],
        materials=[s.Material(None)],
        lights=[s.SphereLight((5, 5, 5), 0.2, translate(0, 9, 0))],
    )


DARK = [
    without_lights,
    with_nothing_at_all,
    with_a_lamp_in_a_closed_box,
    with_a_lamp_that_shines_into_the_void,
    with_black_lights,
    with_black_walls,
]


def warnings_of(
    caplog: pytest.LogCaptureFixture, scene: s.Scene, **settings: object
) -> tuple[usdmlt.Image, list[str]]:
    caplog.clear()
    with caplog.at_level(logging.WARNING, logger="usdmlt"):
        image = usdmlt.render(scene, **settings)
    return image, [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("dark", DARK)
def test_darkness_is_a_black_picture_and_one_warning(
    caplog: pytest.LogCaptureFixture, dark: Callable[[], s.Scene], integrator: str
) -> None:
    image, warnings = warnings_of(caplog, dark(), integrator=integrator, samples=16)
    assert not image["color"].any()
    assert not image["error"].any()
    assert np.isfinite(image["alpha"]).all()
    assert warnings == ["no light was found that reaches the camera: the picture is black"]
    assert image.stats["units_done"] == image.stats["units_total"]
    json.dumps(image.stats, allow_nan=False)


@pytest.mark.parametrize("options", [{"direct": "mlt"}, {"two_stage": True}, {"depth": 1}])
def test_darkness_is_black_with_every_option_of_mlt(
    caplog: pytest.LogCaptureFixture, options: dict
) -> None:
    scene = with_a_lamp_in_a_closed_box()
    image, warnings = warnings_of(caplog, scene, integrator="mlt", samples=16, **options)
    assert not image["color"].any()
    assert len(warnings) == 1
    json.dumps(image.stats, allow_nan=False)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_darkness_is_no_failure_on_the_command_line(
    usdmlt_command: Run, stage: Path, tmp_path: Path, integrator: str
) -> None:
    """The lamp is behind the panel, and turned away from it."""
    lit = stage.read_text()
    stage.write_text(lit.replace("(0, 0, 5)", "(0, 0, -1)"))
    assert stage.read_text() != lit
    flags = ["--integrator", integrator, "--samples", 8, "-w", 32, "--stats", "a.json"]
    done = usdmlt_command("render", stage, "a.exr", *flags)
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if "warning" in line]
    assert len(warnings) == 1
    assert "the picture is black" in warnings[0]
    assert not usdmlt.read_image(tmp_path / "a.exr")["color"].any()
    assert json.loads((tmp_path / "a.json").read_text())["integrator"] == integrator


def test_a_lit_scene_is_not_called_black(caplog: pytest.LogCaptureFixture) -> None:
    for integrator in INTEGRATORS:
        image, warnings = warnings_of(
            caplog, scenes.build("diffuse_box"), integrator=integrator, samples=16, depth=4
        )
        assert image["color"].any()
        assert not any("black" in warning for warning in warnings)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_values_that_are_not_finite_are_left_out_and_counted(
    caplog: pytest.LogCaptureFixture, integrator: str, value: float
) -> None:
    """One texel of a dome: every pixel stays finite, and the rest of the light is there."""
    scene = scenes.build("diffuse_box")
    pixels = np.ones((4, 4, 3), np.float32)
    pixels[1, 1] = value
    scene.textures = [s.Texture(pixels)]
    scene.lights = [s.DomeLight((1, 1, 1), 0)]
    image, warnings = warnings_of(caplog, scene, integrator=integrator, samples=32)
    assert np.isfinite(image["color"]).all()
    assert np.isfinite(image["error"]).all()
    assert image["color"].mean() > 0.2
    count = image.stats["non_finite"]
    assert count > 0
    assert warnings == [f"{count} contributions were not finite and were left out"]


@pytest.mark.parametrize("depth", [1, 2])
@pytest.mark.parametrize("direct", ["separate", "mlt"])
def test_mlt_renders_depths_that_leave_it_no_chains(depth: int, direct: str) -> None:
    """Light that is seen directly, and light after one bounce: the picture's mean is path tracing's
    to 5 %, some three standard errors."""
    scene = scenes.build("diffuse_box" if depth == 2 else "emission")
    expected = usdmlt.render(scene, integrator="path", samples=256, depth=depth)
    image = usdmlt.render(scene, integrator="mlt", samples=1024, depth=depth, direct=direct)
    assert image["color"].mean() == pytest.approx(expected["color"].mean(), rel=0.05)
    assert np.isfinite(image["color"]).all()
    assert (image.stats["mutations"] > 0) == (direct == "mlt")
    json.dumps(image.stats, allow_nan=False)


# ---------------------------------------------------------------------------------------------
# Light that no technique finds


def sunlit_mirrors(sun: s.DistantLight = SUN, mirror: s.Material = MIRROR) -> s.Scene:
    return scenes.picture_of(
        CAMERA,
        meshes=[floor(0), sphere(0.6, 1, smooth=True, transform=translate(0, 0.6, 0))],
        materials=[scenes.WHITE, mirror],
        lights=[sun],
    )


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_unreachable_light_is_said_once_by_name(
    caplog: pytest.LogCaptureFixture, integrator: str
) -> None:
    image, warnings = warnings_of(caplog, sunlit_mirrors(), integrator=integrator, samples=4)
    assert image.stats["unreachable"] == {"lights": ["sun"], "materials": ["mirror"]}
    assert len(warnings) == 1
    assert "(sun)" in warnings[0]
    assert "(mirror)" in warnings[0]
    assert "no integrator can find it" in warnings[0]


def wide_sun() -> s.Scene:
    return sunlit_mirrors(s.DistantLight((3, 3, 3), 0.5, SUN.transform))


def black_sun() -> s.Scene:
    return sunlit_mirrors(s.DistantLight((0, 0, 0), 0.0, SUN.transform))


def rough_mirror() -> s.Scene:
    return sunlit_mirrors(mirror=s.Material(s.Conductor(roughness=0.1)))


def mirror_that_nothing_has() -> s.Scene:
    scene = rough_mirror()
    scene.materials.append(MIRROR)
    return scene


@pytest.mark.parametrize("reachable", [wide_sun, black_sun, rough_mirror, mirror_that_nothing_has])
def test_light_that_can_be_found_is_not_called_unreachable(
    reachable: Callable[[], s.Scene],
) -> None:
    image = usdmlt.render(reachable(), samples=1)
    assert image.stats["unreachable"] == {}


def test_paths_of_three_edges_are_too_short_to_be_unreachable() -> None:
    assert usdmlt.render(sunlit_mirrors(), samples=1, depth=3).stats["unreachable"] == {}
    assert usdmlt.render(sunlit_mirrors(), samples=1, depth=4).stats["unreachable"] != {}


def test_textured_and_coated_materials_are_looked_at_where_meshes_have_them() -> None:
    """A textured colour with a constant roughness, one per triangle, and a smooth coat."""
    texture = s.Texture(np.random.default_rng(1).random((4, 4, 3)).astype(np.float32))
    color = s.TextureInput(0, channel="rgb")
    materials = [
        s.Material(s.PreviewSurface(color, metallic=1.0, roughness=0.0), name="polished"),
        s.Material(s.PreviewSurface(color, roughness=0.5), name="rough"),
        s.Material(s.Layer(s.Dielectric(1.5, 0.0), s.Diffuse()), name="coated"),
        s.Material(s.Dielectric(1.5, 0.0, weight=0.0), name="absent"),
    ]
    panel = quad((-1, 0, 0), (2, 0, 0), (0, 1, 0))
    panel.materials = np.array([0, 2], np.int32)
    scene = scenes.picture_of(
        CAMERA,
        meshes=[floor(1), panel, floor(3)],
        materials=materials,
        textures=[texture],
        lights=[SUN],
    )
    unreachable = usdmlt.render(scene, samples=1).stats["unreachable"]
    assert unreachable["materials"] == ["polished", "coated"]
