"""Scene descriptions rendered by Mitsuba 3: the subset that comparisons need.

Meshes become PLY files, so both renderers intersect the same triangles; rect lights become two
triangles that emit to one side, spheres stay spheres. A path of k edges is Mitsuba's depth k. Where
there are media, bodies hold each other whole or not at all, and the camera is outside all of them.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from usdmlt import scene as s


class Untranslated(ValueError):
    """The scene holds something that has no translation here."""


def load(mi: Any, scene: s.Scene, folder: Path, depth: int, roulette_depth: int = 5) -> Any:
    """Mitsuba's scene of the same content, for its path integrator, or the volumetric one.

    ``mi``: the module, its variant set; ``folder``: where mesh files may be written, needed until
    this returns; ``depth``: edges of the longest path; ``roulette_depth``: Mitsuba's ``rr_depth``.
    Raises :class:`Untranslated`.
    """
    if scene.prototypes or any(not np.isscalar(mesh.materials) for mesh in scene.meshes):
        raise Untranslated("instances or materials by triangle")
    integrator = "volpathmis" if scene.media else "path"
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": depth, "rr_depth": roulette_depth},
        "sensor": _sensor(mi, scene),
    }
    media = [_medium(mi, medium) for medium in scene.media]
    world = None if scene.world_medium is None else media[scene.world_medium]
    if world is not None:
        content["sensor"]["medium"] = world
    for i, mesh in enumerate(scene.meshes):
        points = _placed(mesh)
        st = mesh.primvars["st"].values if "st" in mesh.primvars else None
        normals = None
        if mesh.normals is not None:
            _require(mesh.normals.corners is None, "normals by corner")
            normals = mesh.normals.values @ np.linalg.inv(mesh.transform[:3, :3]).T
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        path = folder / f"mesh{i}.ply"
        _write_ply(path, points, mesh.triangles, st, normals)
        content[f"mesh{i}"] = {
            "type": "ply",
            "filename": str(path),
            "face_normals": normals is None,
            "bsdf": _bsdf(mi, scene, scene.materials[mesh.materials]),
            **_both_sides(scene, media, world, mesh),
        }
    for i, body in enumerate(scene.volumes):
        path = folder / f"volume{i}.ply"
        _write_ply(path, _placed(body), body.triangles)
        content[f"volume{i}"] = {
            "type": "ply",
            "filename": str(path),
            "face_normals": True,
            "bsdf": {"type": "null"},
            **_both_sides(scene, media, world, body),
        }
    for i, light in enumerate(scene.lights):
        content[f"light{i}"] = _emitter(mi, scene, light, folder / f"light{i}.ply")
    return mi.load_dict(content)


def _placed(mesh: s.Mesh | s.Volume) -> np.ndarray:
    """Its points in the world."""
    return np.asarray(mesh.points @ mesh.transform[:3, :3] + mesh.transform[3, :3])


def _medium(mi: Any, medium: s.Medium) -> Any:
    """Mitsuba's. Of grids only the densities vary, with the position from 0 to 1 in their box."""
    _require(not any(medium.emission), "a medium that glows")
    scattering, absorption = np.array(medium.scattering), np.array(medium.absorption)
    extinction = scattering + absorption
    largest = max(float(extinction.max()), 1e-6)
    albedo = scattering / np.where(extinction > 0, extinction, 1)
    phase: dict[str, Any] = {"type": "hg", "g": medium.anisotropy}
    if medium.phase == "rayleigh":
        phase = {"type": "rayleigh"}
    content: dict[str, Any] = {"albedo": _rgb(albedo), "phase": phase}
    if medium.grid is None:
        content |= {"type": "homogeneous", "sigma_t": _rgb(extinction / largest), "scale": largest}
        return mi.load_dict(content)
    grid = medium.grid
    _require(np.ptp(extinction) == 0 and grid.emission is None, "a grid with colours")
    place = np.diag([*(np.array(grid.upper) - grid.lower), 1.0])
    place[3, :3] = grid.lower
    values = np.ascontiguousarray(grid.values.transpose(2, 1, 0)[..., None], np.float32)
    density = {
        "type": "gridvolume",
        "grid": mi.VolumeGrid(values),
        "to_world": _matrix(mi, place @ grid.transform),
        "filter_type": "trilinear",
        "wrap_mode": "clamp",
        "raw": True,
    }
    return mi.load_dict(content | {"type": "heterogeneous", "sigma_t": density, "scale": largest})


def _both_sides(
    scene: s.Scene, media: list[Any], world: Any, body: s.Mesh | s.Volume
) -> dict[str, Any]:
    """What is inside and outside of a closed mesh: nothing of what is no body."""
    if body.medium is None:
        return {}
    _require(body.medium_priority == 0, "a priority")
    points = _placed(body)
    around, smallest = world, math.inf
    bodies: list[s.Mesh | s.Volume] = [*scene.meshes, *scene.volumes]
    for other in bodies:
        if other is body or other.medium is None:
            continue
        lower, upper = _placed(other).min(0), _placed(other).max(0)
        size = float(np.prod(upper - lower))
        if ((points > lower) & (points < upper)).all() and size < smallest:
            around, smallest = media[other.medium], size
    sides = {"interior": media[body.medium]}
    return sides if around is None else sides | {"exterior": around}


def _require(condition: object, otherwise: str) -> None:
    if not condition:
        raise Untranslated(otherwise)


def pictures(mi: Any, loaded: Any, seeds: int, samples: int) -> np.ndarray:
    """(seeds, h, w, 3); the sampler is independent, so seeds are too."""
    return np.stack(
        [np.array(mi.render(loaded, spp=samples, seed=seed)) for seed in range(seeds)]
    ).astype(np.float64)


def _matrix(mi: Any, m: np.ndarray) -> Any:
    """Of column vectors, as Mitsuba has it."""
    return mi.ScalarTransform4f(m.T)


def _sensor(mi: Any, scene: s.Scene) -> dict[str, Any]:
    camera = scene.camera
    left, right, bottom, top = camera.window
    centred = math.isclose(left, -right, rel_tol=1e-6) and math.isclose(bottom, -top, rel_tol=1e-6)
    _require(centred and camera.projection == "perspective", "an off-centre or orthographic camera")
    # Mitsuba's cameras look along +z with +x to the left.
    turn = np.diag([-1.0, 1.0, -1.0, 1.0])
    sensor = {
        "type": "perspective",
        "fov_axis": "x",
        "fov": 2 * math.degrees(math.atan(right)),
        "to_world": _matrix(mi, turn @ camera.transform),
        "near_clip": 1e-3,
        "film": {
            "type": "hdrfilm",
            "width": scene.width,
            "height": scene.height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent"},
    }
    if camera.lens_radius:
        sensor |= {
            "type": "thinlens",
            "aperture_radius": camera.lens_radius,
            "focus_distance": camera.focus_distance,
        }
    return sensor


def _number(value: object) -> float:
    if not isinstance(value, (int, float)):
        raise Untranslated("a textured number")
    return float(value)


def _texture(scene: s.Scene, index: int | dict[int, int] | None) -> s.Texture:
    if not isinstance(index, int):
        raise Untranslated("a missing texture, or a UDIM set")
    return scene.textures[index]


def _rgb(color: object) -> dict[str, Any]:
    if not isinstance(color, (tuple, list, np.ndarray)):
        raise Untranslated("a textured colour")
    return {"type": "rgb", "value": [float(c) for c in color]}


def _bsdf(mi: Any, scene: s.Scene, material: s.Material) -> dict[str, Any]:
    closure = material.closure
    _require(material.opacity == 1 and getattr(closure, "weight", 1) == 1, "opacity or weights")
    bsdf: dict[str, Any]
    match closure:
        case s.Diffuse(color=s.TextureInput() as read):
            texture = _texture(scene, read.texture)
            bitmap = _bitmap(mi, texture.linear(), texture.wrap_s)
            bsdf = {
                "type": "twosided",
                "bsdf": {"type": "diffuse", "reflectance": bitmap},
            }
        case s.Diffuse():
            _require(closure.roughness == 0, "Oren-Nayar")
            bsdf = {
                "type": "twosided",
                "bsdf": {"type": "diffuse", "reflectance": _rgb(closure.color)},
            }
        case s.Dielectric(scatter_mode="RT"):
            smooth = closure.roughness == 0
            bsdf = {"type": "dielectric" if smooth else "roughdielectric"}
            bsdf |= {"int_ior": _number(closure.ior), "ext_ior": 1.0}
            if not smooth:
                bsdf |= {"distribution": "ggx", "alpha": _number(closure.roughness)}
        case s.Conductor():
            metal: dict[str, Any] = {
                "type": "roughconductor",
                "distribution": "ggx",
                "sample_visible": True,
                "alpha": _number(closure.roughness),
                "eta": _rgb(closure.ior),
                "k": _rgb(closure.extinction),
            }
            bsdf = {"type": "twosided", "bsdf": metal}
        case _:
            raise Untranslated(type(closure).__name__)
    if material.normal is not None:
        if not isinstance(material.normal, s.TextureInput):
            raise Untranslated("a computed normal")
        pixels = _texture(scene, material.normal.texture).linear()
        bsdf = {
            "type": "normalmap",
            "use_shadowing_function": False,
            "flip_invalid_normals": False,
            "normalmap": _bitmap(mi, pixels / 2 + 0.5, "clamp"),
            "bsdf": bsdf,
        }
    return bsdf


def _bitmap(mi: Any, pixels: np.ndarray, wrap: str) -> dict[str, Any]:
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(pixels, np.float32)),
        "raw": True,
        "filter_type": "bilinear",
        "wrap_mode": wrap,
    }


def _emitter(mi: Any, scene: s.Scene, light: s.Light, path: Path) -> dict[str, Any]:
    area = {"type": "area", "radiance": _rgb(light.radiance)}
    black = {"type": "diffuse", "reflectance": 0.0}
    m = light.transform
    _require(getattr(light, "shaping", None) is None, "a shaped light")
    match light:
        case s.RectLight(texture=None):
            x, y = light.width / 2, light.height / 2
            corners = np.array([(-x, -y, 0), (-x, y, 0), (x, y, 0), (x, -y, 0)])  # faces -z
            _write_ply(path, corners @ m[:3, :3] + m[3, :3], np.array([(0, 1, 2), (0, 2, 3)]))
            shape: dict[str, Any] = {"type": "ply", "filename": str(path), "face_normals": True}
            return shape | {"emitter": area, "bsdf": black}
        case s.SphereLight():
            _require(np.array_equal(m[:3, :3], np.eye(3)), "a scaled sphere light")
            shape = {
                "type": "sphere",
                "center": m[3, :3].tolist(),
                "radius": light.radius,
            }
            return shape | {"emitter": area, "bsdf": black}
        case s.DistantLight(angle_degrees=0.0):
            direction = (-m[2, :3]).tolist()
            return {"type": "directional", "direction": direction,
                    "irradiance": _rgb(light.radiance)}  # fmt: skip
        case s.DomeLight(texture=None):
            return {"type": "constant", "radiance": _rgb(light.radiance)}
        case s.DomeLight():
            pixels = _texture(scene, light.texture).linear() * np.array(light.radiance, np.float32)
            return {
                "type": "envmap",
                "bitmap": mi.Bitmap(_rows_from_pole_to_pole(pixels)),
                "to_world": _matrix(mi, m),
            }
        case _:
            raise Untranslated(type(light).__name__)


def _rows_from_pole_to_pole(pixels: np.ndarray) -> np.ndarray:
    """Mitsuba's rows lie at θ = iπ/(h−1), the poles included; ours at (i + ½)π/h.

    Interpolated to four times as many rows, which leaves an error of second order.
    """
    h = len(pixels)
    y = np.linspace(0, 1, 4 * h + 1) * h - 0.5
    i = np.clip(np.floor(y).astype(int), 0, h - 2)
    f = np.clip(y - i, 0, 1)[:, None, None]
    return np.ascontiguousarray((pixels[i] * (1 - f) + pixels[i + 1] * f).astype(np.float32))


def _write_ply(
    path: Path, points: Any, triangles: Any, st: Any = None, normals: Any = None
) -> None:
    columns = [np.asarray(points, "<f4")]
    names = ["x", "y", "z"]
    if normals is not None:
        columns.append(np.asarray(normals, "<f4"))
        names += ["nx", "ny", "nz"]
    if st is not None:
        # Mitsuba's images begin at v = 0 with their top row.
        columns.append(np.stack([st[:, 0], 1 - st[:, 1]], -1).astype("<f4"))
        names += ["u", "v"]
    faces = np.empty(len(triangles), [("n", "u1"), ("v", "<i4", 3)])
    faces["n"], faces["v"] = 3, triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property float {name}" for name in names),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    vertices = np.ascontiguousarray(np.concatenate(columns, axis=1))
    path.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())
