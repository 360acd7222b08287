"""Furnaces: scenes whose picture is known exactly, whatever the strategies do.

Inside a closed emitter of radiance 1 and albedo ½, light of k edges is ½^(k−1) at every pixel. In
an environment of radiance 1 whatever loses no energy is invisible. Together they see a missing or
doubled G or cosine, a pdf that is not the sampler's, weights that do not sum to one at any length
(also where the depth limit cuts strategies off), wrong scaling of radiance by refraction, and
Dirac densities that do not cancel.
"""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import ALL, BOTH, build, picture, pictures, plan, work
from support.shapes import box, orthographic, perspective, quad, rotate, scale, sphere, translate
from support.statistics import agreement
from usdmlt import scene as s

LENGTHS = range(1, 7)
GLASS = s.Material(s.Dielectric(1.5, 0.0, scatter_mode="RT"))


def closed_sphere(camera: s.Camera | None = None, **options: object) -> s.Scene:
    """A convex polyhedron seen from inside that emits 1 and reflects half."""
    shell = s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((1, 1, 1))))
    camera = camera or perspective((0.2, -0.1, 0.3), (1, 0.3, -0.2), 90)
    shape = sphere(2.0, rings=8, inward=True, **options)
    return s.Scene(camera, 12, 8, meshes=[shape], materials=[shell])


def closed_box(integrator: str, samples: int, seeds: int, edges: int) -> np.ndarray:
    half = s.Material(s.Add(s.Diffuse((0.5, 0.5, 0.5)), s.UniformEmission((1, 1, 1))))
    scene = s.Scene(
        perspective((0.2, -0.1, 0.3), (1, 0.3, -0.2), 90),
        12,
        8,
        meshes=[box((-1, -2, -1), (2, 1, 1))],
        materials=[half],
    )
    settings = work(integrator, samples)
    return pictures(scene, integrator, seeds, min_edges=edges, depth=edges, **settings)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("edges", LENGTHS)
def test_each_path_length_of_a_closed_emitter(integrator: str, edges: int) -> None:
    """Length k alone is ½^(k−1) in every pixel."""
    built = build(closed_sphere())
    settings = work(integrator, 16 * edges)
    got = pictures(built, integrator, 16, min_edges=edges, depth=edges, **settings)
    expected = np.full(got.shape[1:], 0.5 ** (edges - 1))
    agreement(got, expected).require(resolution=0.012)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("edges", [2, 3, 5])
def test_each_path_length_of_a_closed_box(integrator: str, edges: int) -> None:
    """In corners 1/r² is not bounded: connections alone would not converge there; the weights have
    to take over."""
    got = closed_box(integrator, 32, 16, edges)
    agreement(got, np.full(got.shape[1:], 0.5 ** (edges - 1))).require(resolution=0.02)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("depth", [2, 4])
def test_the_depth_limit_cuts_off_and_does_nothing_else(integrator: str, depth: int) -> None:
    """Σ_{k ≤ n} ½^(k−1) = 2 − ½^(n−1)."""
    got = pictures(closed_sphere(), integrator, 16, depth=depth, **work(integrator, 32))
    agreement(got, np.full(got.shape[1:], 2 - 0.5 ** (depth - 1))).require(resolution=0.01)


@pytest.mark.parametrize("integrator", ALL)
def test_energy_by_path_length_is_reported(integrator: str) -> None:
    """The statistics of a render tell ½^(k−1) too."""
    samples = 3072 if integrator == "mlt" else 1024
    render = plan(closed_sphere(), integrator, depth=6, **work(integrator, samples))
    render.run(render.units_total, 2)
    energy = render.stats()["path_length_energy"]
    assert energy[0] == 0
    assert energy[1:] == pytest.approx(
        [0.5 ** (k - 1) for k in LENGTHS], rel=0.12 if integrator == "mlt" else 0.02
    )


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("edges", [2, 4])
@pytest.mark.parametrize("kind", ["thin lens", "orthographic"])
def test_closed_emitter_through_other_cameras(integrator: str, edges: int, kind: str) -> None:
    """Sees a wrong importance or density of the lens, which a pinhole hides."""
    if kind == "orthographic":
        camera = orthographic((0.2, 0.1, 0.3), (1, 0.3, -0.2), 1.5)
    else:
        camera = perspective(
            (0.2, -0.1, 0.3), (1, 0.3, -0.2), 80, lens_radius=0.5, focus_distance=0.8
        )
    settings = work(integrator, 32)
    scene = closed_sphere(camera)
    got = pictures(scene, integrator, 16, min_edges=edges, depth=edges, **settings)
    agreement(got, np.full(got.shape[1:], 0.5 ** (edges - 1))).require(resolution=0.01)


@pytest.mark.parametrize("integrator", ALL)
def test_closed_emitter_as_a_mirrored_stretched_instance(integrator: str) -> None:
    """The area of emitting triangles is that of the instance."""
    scene = closed_sphere()
    m = scale(1.5, -0.8, 1.1) @ rotate((1, 2, 3), 40) @ translate(0.1, 0.2, -0.1)
    scene.prototypes = [s.Prototype(scene.meshes)]
    scene.instances = [s.Instances(0, m[None])]
    scene.meshes = []
    got = pictures(scene, integrator, 16, min_edges=3, depth=3, **work(integrator, 32))
    agreement(got, np.full(got.shape[1:], 0.25)).require(resolution=0.01)


@pytest.mark.parametrize("integrator", ALL)
def test_half_transparent_closed_emitter(integrator: str) -> None:
    """Coverage α = ½ within a second, opaque shell: emission and reflection count for half, the
    rest goes on. Convex shells, the outer of radiance e and albedo 0, the inner of radiance 1 and
    albedo ½: the inner one's radiosity B obeys B = 1 + ½ (½ B + ½ e), so every pixel sees
    ½ B + ½ e. Sees densities or contributions that forget the coverage of a lamp or of an edge."""
    e = 3.0
    scene = closed_sphere()
    scene.materials[0].opacity = 0.5
    scene.materials.append(s.Material(s.UniformEmission((e, e, e))))
    scene.meshes.append(sphere(3.0, 1, rings=8))
    got = pictures(scene, integrator, 16, depth=24, **work(integrator, 64))
    # From outside the inner shell's faces light the outer one, which reflects nothing.
    B = (1 + e / 4) / (1 - 1 / 4)
    agreement(got, np.full(got.shape[1:], B / 2 + e / 2)).require(resolution=0.01)


# ---------------------------------------------------------------------------------------------
# Objects in an environment of radiance 1


def in_white_world(material: s.Material, shape: s.Mesh, **content: object) -> s.Scene:
    content.setdefault("camera", perspective((0, 0.5, 4), (0, 0, 0), 40))
    content.setdefault("lights", [s.DomeLight((1, 1, 1))])
    return s.Scene(width=12, height=8, meshes=[shape], materials=[material], **content)


MIRROR = s.Material(s.GeneralizedSchlick((1, 1, 1), (1, 1, 1), roughness=0.0))
REFLECTING = {
    "mirror": MIRROR,
    "half there": s.Material(MIRROR.closure, opacity=0.5),
}
REFRACTING = {
    "ball": sphere(1.2, rings=12),
    "ball with interpolated normals": sphere(1.2, rings=24, smooth=True),
    "cube": box((-1,) * 3, (1,) * 3, transform=rotate((1, 2, 3), 50)),
}


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", REFLECTING)
def test_mirrors_are_invisible(integrator: str, name: str) -> None:
    """Every sample carries exactly the radiance that surrounds it: no noise, so no statistics."""
    scene = in_white_world(REFLECTING[name], sphere(1.2, rings=12))
    got = picture(scene, integrator, samples=16, depth=100)
    assert got == pytest.approx(np.ones_like(got), abs=1e-6)


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("name", REFRACTING)
def test_smooth_glass_is_invisible(integrator: str, name: str) -> None:
    """Sees lost or doubled energy in the choice between reflection and refraction, and Dirac terms
    that do not cancel between value, density and weight. Interpolated normals may turn a direction
    to the wrong side of the surface near the silhouette, which absorbs it: less than 0.2 % here."""
    got = pictures(in_white_world(GLASS, REFRACTING[name]), integrator, 16, samples=32, depth=200)
    if "interpolated" in name:
        assert got.mean() == pytest.approx(1, abs=2e-3)
        error = got.std(axis=0, ddof=1) / np.sqrt(len(got))
        assert (np.abs(got.mean(axis=0) - 1) < 0.01 + 5 * error).all()
    else:
        agreement(got, np.ones(got.shape[1:])).require(resolution=0.002)


@pytest.mark.parametrize("integrator", ALL)
def test_white_diffuse_convex_objects_are_invisible(integrator: str) -> None:
    white = s.Material(s.Diffuse((1, 1, 1)))
    got = pictures(
        in_white_world(white, sphere(1.2)), integrator, 16, depth=2, **work(integrator, 32)
    )
    agreement(got, np.ones(got.shape[1:])).require(resolution=0.01)


MIRRORED = scale(-1, 1, 1) @ rotate((1, 2, 3), 40)


@pytest.mark.parametrize("integrator", BOTH)
@pytest.mark.parametrize("placed", ["directly", "mirrored", "as a mirrored instance"])
def test_radiance_inside_glass_is_scaled_by_the_index_squared(integrator: str, placed: str) -> None:
    """L/η² is what refraction keeps: a camera inside glass sees η² times the world's radiance, at
    every pixel. Near the centre of a ball nothing is reflected totally. Sees a wrong power of η,
    and an inside taken for the outside: that would be 1/η²."""
    eye = perspective((0.05, 0, 0.1), (1, 0.2, 0), 60)
    scene = in_white_world(GLASS, sphere(1.2, rings=32), camera=eye)
    if placed == "mirrored":
        scene.meshes[0].transform = MIRRORED
    elif placed == "as a mirrored instance":
        scene.prototypes = [s.Prototype(scene.meshes)]
        scene.instances = [s.Instances(0, MIRRORED[None])]
        scene.meshes = []
    got = picture(scene, integrator, samples=32, depth=60)
    assert got == pytest.approx(np.full_like(got, 1.5**2), rel=3e-4)


def white_core_in(shell: s.Material) -> s.Scene:
    """A white diffuse ball inside a ball of glass: light reaches it by refraction only."""
    scene = in_white_world(shell, sphere(1.5, rings=16))
    scene.materials.append(s.Material(s.Diffuse((1, 1, 1))))
    scene.meshes.append(sphere(0.7, 1, rings=8))
    return scene


@pytest.mark.parametrize("integrator", ALL)
def test_white_diffuse_core_in_smooth_glass_is_invisible(integrator: str) -> None:
    """Light subpaths enter the glass and meet camera subpaths inside it: radiance is scaled by η²
    on one of them and importance is not on the other."""
    scene = white_core_in(GLASS)
    got = pictures(scene, integrator, 16, depth=500, **work(integrator, 32))
    agreement(got, np.ones(got.shape[1:])).require(resolution=0.01)


ROUGH = {
    "metal": s.GeneralizedSchlick((1, 1, 1), (1, 1, 1), roughness=0.3),
    "glass": s.Dielectric(1.5, 0.1, scatter_mode="RT"),
    "coat": s.Layer(s.Dielectric(1.5, 0.2), s.Diffuse((1, 1, 1))),
}


@pytest.mark.parametrize("name", ROUGH)
def test_rough_lossless_objects_lose_little_and_gain_nothing(name: str) -> None:
    """GGX without multiple scattering loses what is shadowed: never a gain, some per cent of loss,
    and both integrators lose the same."""
    scene = build(in_white_world(s.Material(ROUGH[name]), sphere(1.2, rings=24, smooth=True)))
    path, bdpt = (pictures(scene, i, 24, samples=32, depth=32) for i in BOTH)
    agreement(path, bdpt).require(resolution=0.01)
    for got in (path, bdpt):
        error = got.std(axis=0, ddof=1) / np.sqrt(len(got))
        assert (got.mean(axis=0) <= 1 + 5 * error + 1e-5).all()
        assert got.mean() > 0.9


def test_a_black_world_stays_black() -> None:
    """No emitter: nothing arrives, and nothing is not a number."""
    material = s.Material(s.Diffuse((0.8, 0.8, 0.8)))
    scene = in_white_world(material, quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)), lights=[])
    for integrator in ALL:
        assert not picture(scene, integrator, samples=4, depth=4).any()
