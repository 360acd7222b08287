"""OpenPBR Surface (ND_open_pbr_surface_surfaceshader) as closures.

The structure of MaterialX's graph (libraries/bxdf/open_pbr_surface.mtlx, OpenPBR 1.1):
    fuzz over coat over mix(metalness: metal, specular over mix(transmission: clear,
        mix(subsurface: subsurface, diffuse))) + emission.
Fuzz is the sheen lobe of its roughness instead of the specification's (Zeltner et al. 2022), which
is not reciprocal.
"""

from __future__ import annotations

from pxr import UsdShade

from usdmlt.scene import (
    Add,
    Closure,
    Dielectric,
    Diffuse,
    GeneralizedSchlick,
    Input,
    Material,
    Multiply,
    Sheen,
    Translucent,
)
from usdmlt.stage import layered_surface as build
from usdmlt.stage.expressions import (
    add,
    clamp,
    divide,
    is_constant,
    mix,
    multiply,
    operate,
    plain,
    power,
    subtract,
)
from usdmlt.stage.layered_surface import WHITE, Inputs
from usdmlt.stage.networks import Networks, is_zero

BLACK = (0.0, 0.0, 0.0)
DEFAULTS = {
    "base_weight": 1.0,
    "base_color": (0.8, 0.8, 0.8),
    "base_diffuse_roughness": 0.0,
    "base_metalness": 0.0,
    "specular_weight": 1.0,
    "specular_color": WHITE,
    "specular_roughness": 0.3,
    "specular_ior": 1.5,
    "specular_roughness_anisotropy": 0.0,
    "transmission_weight": 0.0,
    "transmission_color": WHITE,
    "transmission_depth": 0.0,
    "transmission_dispersion_scale": 0.0,
    "subsurface_weight": 0.0,
    "subsurface_color": (0.8, 0.8, 0.8),
    "subsurface_scatter_anisotropy": 0.0,
    "fuzz_weight": 0.0,
    "fuzz_color": WHITE,
    "fuzz_roughness": 0.5,
    "coat_weight": 0.0,
    "coat_color": WHITE,
    "coat_roughness": 0.0,
    "coat_roughness_anisotropy": 0.0,
    "coat_ior": 1.6,
    "coat_darkening": 1.0,
    "thin_film_weight": 0.0,
    "emission_luminance": 0.0,
    "emission_color": WHITE,
    "geometry_opacity": 1.0,
    "geometry_thin_walled": False,
}


def read_open_pbr_surface(networks: Networks, shader: UsdShade.Shader) -> Material:
    """The material of an open_pbr_surface node."""
    s = Inputs(networks, shader, DEFAULTS)
    thin_walled, coat = s.flag("geometry_thin_walled"), s["coat_weight"]
    _warn(s)

    # A rough coat blurs what is below: min(1, 2 r_coat⁴ + r⁴)^¼.
    blurred = add(multiply(2.0, power(s["coat_roughness"], 4.0)), _fourth(s["specular_roughness"]))
    blurred = power(operate("min", 1.0, blurred), 0.25)
    roughness = alphas(
        mix(blurred, s["specular_roughness"], coat), s["specular_roughness_anisotropy"]
    )
    ior = modulated_ior(s, coat)

    diffuse = Diffuse(
        s["base_color"], s["base_weight"], s["base_diffuse_roughness"], energy_compensation=True
    )
    base = build.blend(_subsurface(s, thin_walled), diffuse, s["subsurface_weight"])
    opaque = build.layer(
        Dielectric(ior, roughness, s["specular_color"]), s["specular_weight"], base
    )
    clear = build.clear(ior, roughness, s["specular_color"], build.tint(s), thin_walled)
    dielectric = build.blend(clear, opaque, s["transmission_weight"])

    metal = GeneralizedSchlick(
        color0=multiply(s["base_weight"], s["base_color"]),
        color82=s["specular_color"],
        roughness=roughness,
        weight=s["specular_weight"],
    )
    closure = build.blend(metal, dielectric, s["base_metalness"])

    if not is_zero(coat):
        closure = build.tinted(closure, _darkening(s, coat))
        closure = build.tinted(closure, mix(s["coat_color"], WHITE, coat))
        rough = alphas(s["coat_roughness"], s["coat_roughness_anisotropy"])
        closure = build.layer(Dielectric(s["coat_ior"], rough, weight=coat), coat, closure)
    fuzz = Sheen(s["fuzz_color"], s["fuzz_weight"], s["fuzz_roughness"])
    closure = build.layer(fuzz, s["fuzz_weight"], closure)

    emission = multiply(s["emission_luminance"], s["emission_color"])
    emission = build.coated_emission(emission, coat, s["coat_color"], s["coat_ior"])
    return build.surface(
        build.emitting(closure, emission),
        s["geometry_opacity"],
        s.normal("geometry_normal", "geometry_coat_normal"),
        0.0,
        thin_walled,
    )


def alphas(roughness: Input, anisotropy: Input) -> Input | tuple[Input, Input]:
    """ND_open_pbr_anisotropy: alpha_x = r² √(2 / (1 + (1 − a)²)), alpha_y = (1 − a) alpha_x."""
    squared = power(roughness, 2.0)
    if is_zero(anisotropy):
        return squared
    rest = subtract(1.0, anisotropy)
    x = multiply(squared, operate("sqrt", divide(2.0, add(1.0, power(rest, 2.0))), width=1))
    return x, multiply(rest, x)


def modulated_ior(s: Inputs, coat: Input) -> Input:
    """The index whose normal reflectance is specular_weight times that of specular_ior; under a
    coat, of their ratio, turned round where it is below 1 (the specification's "coat TIR")."""
    eta = s["specular_ior"]
    if not is_zero(coat):
        ratio = divide(eta, s["coat_ior"])
        inside = operate("max", ratio, divide(1.0, ratio), width=1)
        eta = mix(inside, eta, coat)
    weight = s["specular_weight"]
    if is_constant(weight) and plain(weight) == 1.0:
        return eta
    root = divide(subtract(eta, 1.0), add(eta, 1.0))
    scaled = clamp(multiply(weight, multiply(root, root)), 0.0, 0.99999)
    epsilon = multiply(operate("sign", root, width=1), operate("sqrt", scaled, width=1))
    return divide(add(1.0, epsilon), subtract(1.0, epsilon))


def _fourth(value: Input) -> Input:
    return power(value, 4.0)


def _subsurface(s: Inputs, thin_walled: bool) -> Closure:
    """Diffuse reflection; of thin walls, half reflected and half transmitted, by anisotropy."""
    color = s["subsurface_color"]
    if not thin_walled:
        return Diffuse(color)
    anisotropy = s["subsurface_scatter_anisotropy"]
    back = multiply(0.5, multiply(color, subtract(1.0, anisotropy)))
    forward = multiply(0.5, multiply(color, add(1.0, anisotropy)))
    reflected = Diffuse(color, 1.0, s["base_diffuse_roughness"])
    return Add(Multiply(reflected, back), Multiply(Translucent(color), forward))


def _darkening(s: Inputs, coat: Input) -> Input:
    """(1 − K) / (1 − E K): light caught between coat and base, with E the base's albedo about and
    K = 1 − (1 − F0) / η² the coat's diffuse reflectance from inside (OpenPBR 1.1, coat darkening).
    """
    eta = s["coat_ior"]
    root = divide(subtract(eta, 1.0), add(eta, 1.0))
    passed = subtract(1.0, multiply(root, root))
    kept = subtract(1.0, divide(passed, multiply(eta, eta)))
    metal = multiply(s["base_color"], s["specular_weight"])
    dielectric = mix(s["subsurface_color"], s["base_color"], s["subsurface_weight"])
    albedo = mix(metal, dielectric, s["base_metalness"])
    factor = divide(subtract(1.0, kept), subtract(1.0, multiply(albedo, kept)))
    return mix(factor, WHITE, multiply(coat, s["coat_darkening"]))


def _warn(s: Inputs) -> None:
    build.warn_of_approximations(
        s,
        "transmission_weight",
        [
            ("dispersion is", "transmission_dispersion_scale", 0.0),
        ],
    )
    s.leave_out("thin films are", "thin_film_weight")
    if not is_zero(s["subsurface_weight"]) and not s.flag("geometry_thin_walled"):
        s.networks.report.note(
            "subsurface scattering is rendered as diffuse reflection", s.shader.GetPath()
        )
