"""Autodesk Standard Surface (ND_standard_surface_surfaceshader) as closures.

The structure of MaterialX's graph (libraries/bxdf/standard_surface.mtlx):
    coat over mix(metalness: metal, specular over mix(transmission: clear,
        sheen over mix(subsurface: subsurface, diffuse))) + emission.
Where the base transmits, reflection and refraction are one dielectric lobe, so that what is not
reflected is refracted.
"""

from __future__ import annotations

from pxr import UsdShade

from usdmlt.scene import Conductor, Dielectric, Diffuse, Input, Material, Sheen, Translucent
from usdmlt.stage import layered_surface as build
from usdmlt.stage.expressions import add, clamp, lane, mix, multiply, operate, power
from usdmlt.stage.layered_surface import WHITE, Inputs
from usdmlt.stage.materialx_patterns import ggx_alphas
from usdmlt.stage.networks import Networks, is_zero, node_id

BLACK = (0.0, 0.0, 0.0)
DEFAULTS = {
    "base": 1.0,
    "base_color": (0.8, 0.8, 0.8),
    "diffuse_roughness": 0.0,
    "metalness": 0.0,
    "specular": 1.0,
    "specular_color": WHITE,
    "specular_roughness": 0.2,
    "specular_IOR": 1.5,
    "specular_anisotropy": 0.0,
    "specular_rotation": 0.0,
    "transmission": 0.0,
    "transmission_color": WHITE,
    "transmission_depth": 0.0,
    "transmission_dispersion": 0.0,
    "transmission_extra_roughness": 0.0,
    "subsurface": 0.0,
    "subsurface_color": WHITE,
    "sheen": 0.0,
    "sheen_color": WHITE,
    "sheen_roughness": 0.3,
    "coat": 0.0,
    "coat_color": WHITE,
    "coat_roughness": 0.1,
    "coat_anisotropy": 0.0,
    "coat_rotation": 0.0,
    "coat_IOR": 1.5,
    "coat_affect_color": 0.0,
    "coat_affect_roughness": 0.0,
    "thin_film_thickness": 0.0,
    "emission": 0.0,
    "emission_color": WHITE,
    "opacity": WHITE,
    "thin_walled": False,
}
VERSION_100 = {"base": 0.8, "base_color": WHITE}  # whose defaults differ


def read_standard_surface(networks: Networks, shader: UsdShade.Shader) -> Material:
    """The material of a standard_surface node."""
    older = node_id(shader).endswith("_100")
    s = Inputs(networks, shader, DEFAULTS | (VERSION_100 if older else {}))
    thin_walled, coat = s.flag("thin_walled"), s["coat"]
    _warn(s)

    # "Coat gamma" and coat roughness: what a coat does to what is below.
    gamma = add(1.0, multiply(clamp(coat), s["coat_affect_color"]))
    dulled = multiply(multiply(s["coat_affect_roughness"], coat), s["coat_roughness"])
    roughness = ggx_alphas(mix(1.0, s["specular_roughness"], dulled), s["specular_anisotropy"])

    diffuse = Diffuse(_under_coat(s["base_color"], gamma), s["base"], s["diffuse_roughness"])
    scattered = _under_coat(s["subsurface_color"], gamma)
    subsurface = Translucent(scattered) if thin_walled else Diffuse(scattered)
    base = build.blend(subsurface, diffuse, s["subsurface"])
    sheen = Sheen(s["sheen_color"], s["sheen"], s["sheen_roughness"])
    base = build.layer(sheen, s["sheen"], base)

    specular = Dielectric(s["specular_IOR"], roughness, s["specular_color"], s["specular"])
    opaque = build.layer(specular, s["specular"], base)
    clear = build.clear(
        s["specular_IOR"],
        roughness,
        multiply(s["specular"], s["specular_color"]),
        build.tint(s),
        thin_walled,
    )
    dielectric = build.blend(clear, opaque, s["transmission"])

    reflectivity = multiply(s["base"], s["base_color"])
    edge = multiply(s["specular"], s["specular_color"])
    metal = Conductor(
        operate("artistic_index", reflectivity, edge),
        operate("artistic_extinction", reflectivity, edge),
        roughness,
    )
    closure = build.blend(metal, dielectric, s["metalness"])

    if not is_zero(coat):
        closure = build.tinted(closure, mix(s["coat_color"], WHITE, coat))
        alphas = ggx_alphas(s["coat_roughness"], s["coat_anisotropy"])
        closure = build.layer(Dielectric(s["coat_IOR"], alphas, weight=coat), coat, closure)

    emission = multiply(s["emission"], s["emission_color"])
    emission = build.coated_emission(emission, coat, s["coat_color"], s["coat_IOR"])
    return build.surface(
        build.emitting(closure, emission),
        _coverage(s["opacity"]),
        s.normal("normal", "coat_normal"),
        s["specular_rotation"],
        thin_walled,
    )


def _under_coat(color: Input, gamma: Input) -> Input:
    return color if gamma == 1.0 else power(operate("max", color, 0.0), gamma)


def _coverage(opacity: Input) -> Input:
    """The luminance of the opacity colour, as MaterialX's graph takes it."""
    if opacity == WHITE:
        return 1.0
    weights = (0.2722287, 0.6740818, 0.0536895)
    if isinstance(opacity, tuple):
        return sum(w * lane(opacity, i) for i, w in enumerate(weights))
    return operate("dot", opacity, weights)


def _warn(s: Inputs) -> None:
    build.warn_of_approximations(
        s,
        "transmission",
        [
            ("dispersion is", "transmission_dispersion", 0.0),
            ("transmission_extra_roughness is", "transmission_extra_roughness", 0.0),
        ],
    )
    s.leave_out("thin films are", "thin_film_thickness")
    if not is_zero(s["coat"]) and not is_zero(s["coat_anisotropy"]):
        s.leave_out("rotations of coats are", "coat_rotation")
    if not is_zero(s["subsurface"]) and not s.flag("thin_walled"):
        s.networks.report.note(
            "subsurface scattering is rendered as diffuse reflection", s.shader.GetPath()
        )
