"""Views: what a display shows of a linear picture, by OpenColorIO.

"sRGB" is the plain one, without a tone curve. Others have the name of a view of the configuration
that $OCIO names, else of OpenColorIO's built-in one, such as "ACES 2.0 - SDR 100 nits (Rec.709)";
any part of the name that only one view has will do: "ACES". "Display P3 - Display/ACES" is for
another display than the default. "openColorIO" is the configuration's default view, "disabled"
the linear values.
"""

from __future__ import annotations

import os
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from usdmlt import color
from usdmlt.errors import Error, UsageError

BUILT_IN = "ocio://default"
# One that does not change with the version of OpenColorIO.
_SRGB_CONFIG = "ocio://cg-config-v1.0.0_aces-v1.3_ocio-v2.1"

# What configurations call the spaces to render in, besides the name itself.
_SPACES = {
    "lin_rec709_scene": ("lin_rec709", "lin_srgb", "Utility - Linear - sRGB", "Linear Rec.709"),
    "lin_ap1_scene": ("ACEScg", "lin_ap1", "ACES - ACEScg"),
    "lin_ap0_scene": ("ACES2065-1", "lin_ap0", "ACES - ACES2065-1", "aces_interchange"),
    "lin_rec2020_scene": ("lin_rec2020", "Linear Rec.2020", "Utility - Linear - Rec.2020"),
    "lin_p3d65_scene": ("lin_p3d65", "Linear P3-D65", "Utility - Linear - P3-D65"),
    "lin_adobergb_scene": ("lin_adobergb", "Linear AdobeRGB"),
}


class View(NamedTuple):
    """A view of a display, and the configuration that has them."""

    config: str
    display: str
    view: str


def encode(
    pixels: npt.NDArray[np.floating], color_space: str = color.DEFAULT, view: str = "sRGB"
) -> npt.NDArray[np.uint8]:
    """(height, width, 3) linear values of a space as 8-bit values for a display.

    Raises ValueError for an unknown view, :class:`usdmlt.Error` for a configuration that cannot be
    read or cannot do it.
    """
    limit = float(np.finfo(np.float16).max)
    linear = np.nan_to_num(np.asarray(pixels, np.float32), nan=0.0, posinf=limit, neginf=-limit)
    if view != "disabled":
        linear = _displayed(linear, color_space, find(view))
    return np.asarray(np.rint(255 * np.clip(linear, 0, 1)), dtype=np.uint8)


def find(view: str) -> View:
    """The view of that name. Raises as :func:`encode` does."""
    if view == "sRGB":
        return View(_SRGB_CONFIG, "sRGB - Display", "Un-tone-mapped")
    name = os.environ.get("OCIO") or BUILT_IN
    config = _config(name)
    display = config.getDefaultDisplayName()
    if view == "openColorIO":
        return View(name, display, config.getDefaultViewName(display))
    there = {d: list(config.getViewNames(d)) for d in config.getDisplayNames()}
    views = [View(name, display, v) for v in there.get(display, ())]
    views += [View(name, d, v) for d, names in there.items() if d != display for v in names]
    found = [v for v in views if view in (v.view, f"{v.display}/{v.view}")]
    if not found:
        found = [v for v in views if v.display == display and view.lower() in v.view.lower()]
        wanted_display, slash, wanted = view.lower().partition("/")
        if slash:
            found = [v for v in views if v.display.lower() == wanted_display]
            found = [v for v in found if wanted in v.view.lower()]
        if len(found) > 1:
            several = ", ".join(v.view for v in found)
            raise UsageError(f"view {view!r} may be any of {several}")
    if not found:
        known = ", ".join(["sRGB", *there.get(display, ())])
        others = ", ".join(d for d in there if d != display)
        raise UsageError(
            f"unknown view {view!r}; known are {known}"
            + (f", and DISPLAY/VIEW of {others}" if others else "")
        )
    return found[0]


def _displayed(
    linear: npt.NDArray[np.float32], color_space: str, view: View
) -> npt.NDArray[np.float32]:
    import OpenImageIO as oiio

    name, space = _space(view.config, color.rendering_space_name(color_space))
    if space != color_space:
        linear = linear @ color.conversion(color_space, space).T.astype(np.float32)
    shown = oiio.ImageBufAlgo.ociodisplay(
        oiio.ImageBuf(np.ascontiguousarray(linear)),
        view.display,
        view.view,
        fromspace=name,
        colorconfig=view.config,
    )
    if shown.has_error:
        reason = " ".join(shown.geterror().split())
        raise Error(f"cannot show the view {view.view!r}: {reason}")
    return np.asarray(shown.get_pixels(oiio.FLOAT), dtype=np.float32).reshape(linear.shape)


def _space(config_name: str, color_space: str) -> tuple[str, str]:
    """A space that the configuration knows, by its name there and by ours: the picture's own, else
    one that everything can be converted to."""
    config = _config(config_name)
    known = {}
    for name in config.getColorSpaceNames():
        known.update({other.lower(): name for other in (name, *config.getAliases(name))})
    known.update({role.lower(): role for role in config.getRoles()})
    for space in (color_space, "lin_ap0_scene", "lin_ap1_scene", "lin_rec709_scene"):
        for name in (space, *_SPACES[space]):
            if name.lower() in known:
                return known[name.lower()], space
    raise Error(f"the OCIO config {config_name} has no space for linear Rec.709 or ACES colours")


@cache
def _config(name: str) -> Any:
    import OpenImageIO as oiio

    config = oiio.ColorConfig(name)
    reason = " ".join(config.geterror().split())
    if reason or config.configname() != name:
        raise Error(f"cannot read the OCIO config {name}: {reason or 'it is not one'}")
    return config
