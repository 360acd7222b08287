"""Colours: spaces to render in, what spectra are in them, and what metals look like.

>>> usdmlt.color.metal("gold", "lin_ap1_scene").reflectance
>>> usdmlt.color.illuminant("A")

Matrices, chromatic adaptation, blackbodies and spectral data are those of colour-science, which is
imported when one of them is asked for.
"""

from usdmlt.color.spaces import (
    ALIASES,
    DEFAULT,
    RENDERING_SPACES,
    Chromaticities,
    RenderingSpace,
    conversion,
    matrix_to_xyz,
    rendering_space,
    rendering_space_name,
)
from usdmlt.color.spectra import (
    Metal,
    blackbody,
    blackbody_radiance,
    emission,
    illuminant,
    metal,
    metals,
    reflectance,
)

__all__ = [
    "ALIASES",
    "DEFAULT",
    "RENDERING_SPACES",
    "Chromaticities",
    "Metal",
    "RenderingSpace",
    "blackbody",
    "blackbody_radiance",
    "conversion",
    "emission",
    "illuminant",
    "matrix_to_xyz",
    "metal",
    "metals",
    "reflectance",
    "rendering_space",
    "rendering_space_name",
]
