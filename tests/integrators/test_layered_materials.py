"""Layered surfaces in pictures: path tracing and bidirectional path tracing agree on them, and in
a white furnace they are never brighter than it."""

from __future__ import annotations

import numpy as np
import pytest

from support.rendering import BOTH, pictures
from usdmlt.scene import (
    Add,
    Camera,
    Conductor,
    Dielectric,
    Diffuse,
    DomeLight,
    GeneralizedSchlick,
    Layer,
    Material,
    Mesh,
    Mix,
    Multiply,
    Node,
    Primvar,
    RectLight,
    Scene,
    Sheen,
    Texture,
    TextureInput,
    UniformEmission,
)

WHITE = (1.0, 1.0, 1.0)


def car_paint(albedo: object) -> Material:
    """Coat over a mix of metal and velvet, its share and roughness computed from a texture."""
    share = TextureInput(0, channel="r")
    roughness = Node("add", (Node("multiply", (share, 0.3)), 0.1))
    velvet = Layer(Sheen(WHITE, 0.8, 0.3), Diffuse(albedo, 1.0, 0.6, energy_compensation=True))
    metal = GeneralizedSchlick(albedo, color82=WHITE, roughness=(roughness, 0.2))
    return Material(
        Layer(Dielectric(1.5, 0.05), Multiply(Mix(metal, velvet, share), albedo)),
        tangent_rotation=Node("multiply", (share, 0.5)),
    )


def pane() -> Material:
    """A thin wall, half of it coloured."""
    glass = Layer(Dielectric(1.5, 0.1), Dielectric(1.0, 0.0, scatter_mode="T"))
    return Material(Mix(glass, Diffuse(WHITE), 0.5), thin_walled=True)


def glass() -> Material:
    """A solid of two tints, a metal in it."""
    clear = Dielectric(1.5, 0.3, scatter_mode="RT", reflection_tint=(0.8, 0.9, 1.0))
    return Material(Mix(clear, Conductor(roughness=0.3), 0.8))


def glow() -> Material:
    """Emission computed from a texture, over a rough diffuse surface."""
    light = Node("multiply", (TextureInput(0), (2.0, 1.0, 0.5)))
    return Material(Add(Diffuse((0.5, 0.5, 0.5), 1.0, 0.5), UniformEmission(light)))


MATERIALS = {
    "car paint": car_paint((0.8, 0.5, 0.2)),
    "pane": pane(),
    "glass": glass(),
    "glow": glow(),
}


def sphere(n: int = 24) -> Mesh:
    """A closed ball of radius 1 with texture coordinates."""
    t, p = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, 2 * n + 1))
    points = np.stack([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)], -1)
    st = np.stack([p / (2 * np.pi), 1 - t / np.pi], -1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(2 * n), np.arange(n), indexing="ij"))
    first = i * (n + 1) + j  # of the four corners of a patch; the next meridian is n + 1 further
    a, b, c, d = first, first + 1, first + n + 2, first + n + 1
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    points = points.reshape(-1, 3).astype(np.float32)
    edges = points[triangles]
    area = np.linalg.norm(np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0]), axis=1)
    return Mesh(
        points,
        triangles[area > 1e-6].astype(np.int32),  # those at the poles have two corners
        normals=Primvar(points),
        primvars={"st": Primvar(st.reshape(-1, 2).astype(np.float32))},
    )


RAMP = Texture(np.linspace(0.1, 0.9, 8, dtype=np.float32).reshape(2, 4, 1).repeat(3, 2))


def ball(material: Material, lights: list) -> Scene:
    camera = Camera(transform=np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 4.0, 1]]))
    return Scene(
        camera=camera,
        width=8,
        height=8,
        meshes=[sphere()],
        materials=[material],
        textures=[RAMP],
        lights=lights,
    )


def lamp() -> list:
    """A panel above and beside, and a dim sky."""
    above = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [1.0, 3, 1, 1]])
    return [RectLight((6.0, 5.0, 4.0), 1.5, 1.5, above), DomeLight((0.2, 0.3, 0.4))]


@pytest.mark.parametrize("name", MATERIALS)
def test_path_tracing_and_bidirectional_path_tracing_agree(name):
    """Values and densities of every role: walks from the light use the adjoint. Means over the
    picture of 16 seeds; 4.5 standard errors, about 1e-5 for one of 24 comparisons. It could miss
    what is less than about a hundredth."""
    scene = ball(MATERIALS[name], lamp())
    means = {}
    for integrator in BOTH:
        images = pictures(scene, integrator, 16, samples=64, depth=6)
        halves = np.stack([images[:, :4].mean((1, 2)), images[:, 4:].mean((1, 2))], 1)
        means[integrator] = halves.mean(0), halves.std(0, ddof=1) / 4
    (a, a_error), (b, b_error) = means.values()
    error = np.hypot(a_error, b_error)
    assert (error < 0.02 * a).all()
    assert (np.abs(a - b) < 4.5 * error + 1e-3 * a).all(), (a, b, error)


@pytest.mark.parametrize("name", ["car paint", "pane", "glass"])
def test_a_white_furnace_is_nowhere_outshone(name):
    """Radiance 1 all around: every pixel at most 1 and, so that it can fail, well above 0. Stated
    tolerance 0.02, and 4.5 standard errors of each pixel."""
    material = car_paint(WHITE) if name == "car paint" else MATERIALS[name]
    images = pictures(ball(material, [DomeLight(WHITE)]), "path", 8, samples=64, depth=12)
    mean, error = images.mean(0), images.std(0, ddof=1) / np.sqrt(8)
    assert (mean < 1.02 + 4.5 * error).all()
    assert mean[3:5, 3:5].min() > 0.3
