"""What may be asked of the reading of a stage: the options of :func:`usdmlt.load`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from usdmlt.errors import UsageError
from usdmlt.settings import check_resolution

Complexity = Literal["low", "medium", "high", "veryhigh"]
ResolverContext = Literal["root", "inherit"]
DoubleSided = Literal["on", "auto"]
KNOWN_PURPOSES = ("default", "render", "proxy", "guide")


@dataclass(frozen=True)
class LoadOptions:
    """Options of reading; values out of range raise ValueError.

    ``camera``: prim path or name; None: the render settings' camera, else ``main_cam``, else the
    only one, else one that frames everything.
    ``frame``: time code; "default": the default time, without time samples; None: the stage's
    start.
    ``width``, ``height``: pixels; None: the render settings', else 960 wide with the camera's
    aspect.
    ``crop``: (xmin, ymin, xmax, ymax), the part of the picture that is rendered, each from 0 at the
    left and at the bottom to 1; None: the render settings' ``dataWindowNDC``.
    ``purposes``: which purposes are rendered besides "default"; None: the render settings', else
    "render".
    ``mask``: prim paths; only they, and what is above and below them, are read.
    ``session_layer``: a layer file with the strongest opinions but for the next two.
    ``variants``: choices by variant set, ``{"/Prim:set": "choice"}``.
    ``overrides``: values by attribute, ``{"/Prim.attribute": "value"}``, the value as a .usda file
    has it; quotes around strings may be left out.
    ``render_settings``, ``render_pass``: path of the RenderSettings, or of the RenderPass whose
    renderSource they are; None: the stage's ``renderSettingsPrimPath``, else the first there are.
    ``product``: path of one of their products, whose opinions are stronger; None: the first.
    ``complexity``: how finely curved surfaces are subdivided, as usdrecord names it; None: as
    finely as the picture shows.
    ``double_sided``: "on": all surfaces are seen from both sides; "auto": those that say so by
    ``doubleSided``, the others from their front alone, which rays that come from the camera's side
    pass where they meet the back. Surfaces that refract have both. None: the render settings'
    ``usdmlt:doubleSided``, else "on".
    ``draw_modes``: whether models are drawn as the cards or boxes that they ask for.
    ``default_light``: whether a stage without lights gets a white dome.
    ``domes_visible``: whether the camera sees domes and distant lights directly.
    ``texture_memory``: MiB that all textures may take; the largest are halved until they fit.
    None: no limit.
    ``search_paths``: folders in which assets are looked for that are not found beside the stage.
    ``resolver``: whose resolver context a file is opened with: that of its own asset ("root") or
    the one that is bound already ("inherit").
    ``primvars``: names of those that are kept for layers, though no material reads them.
    ``color_space``: the linear RGB space of the result; None: the render settings'
    ``renderingColorSpace``, else linear Rec.709.
    ``strict``: whether content that would be left out raises instead.
    """

    camera: str | None = None
    frame: float | Literal["default"] | None = None
    width: int | None = None
    height: int | None = None
    crop: tuple[float, float, float, float] | None = None
    purposes: Iterable[str] | None = None
    mask: Iterable[str] | None = None
    session_layer: str | os.PathLike[str] | None = None
    variants: Mapping[str, str] = field(default_factory=dict)
    overrides: Mapping[str, str] = field(default_factory=dict)
    render_settings: str | None = None
    render_pass: str | None = None
    product: str | None = None
    complexity: Complexity | None = None
    double_sided: DoubleSided | None = None
    draw_modes: bool = True
    default_light: bool = True
    domes_visible: bool = True
    texture_memory: float | None = None
    search_paths: Iterable[str | os.PathLike[str]] = ()
    resolver: ResolverContext = "root"
    primvars: Iterable[str] = ()
    color_space: str | None = None
    strict: bool = False

    def __post_init__(self) -> None:
        for name in ("purposes", "mask", "search_paths", "primvars"):
            value = getattr(self, name)
            if value is not None:
                one = isinstance(value, (str, os.PathLike))
                object.__setattr__(self, name, (value,) if one else tuple(value))
        check_resolution(self.width, self.height)
        if self.frame not in (None, "default") and not _is_finite(self.frame):
            raise UsageError(f"frame must be a number, not {self.frame}")
        unknown = set(self.purposes or ()) - set(KNOWN_PURPOSES)
        if unknown:
            raise UsageError(f"unknown purposes: {', '.join(sorted(unknown))}")
        check_choice("complexity", self.complexity, (None, *get_args(Complexity)))
        check_choice("double_sided", self.double_sided, (None, *get_args(DoubleSided)))
        check_choice("resolver", self.resolver, get_args(ResolverContext))
        if self.crop is not None:
            check_data_window("crop", self.crop)
        if self.render_settings is not None and self.render_pass is not None:
            raise UsageError("render_settings and render_pass exclude each other")
        if self.texture_memory is not None and not (
            _is_finite(self.texture_memory) and self.texture_memory > 0
        ):
            raise UsageError(f"texture_memory must be positive, not {self.texture_memory}")


def check_choice(name: str, value: object, known: tuple[str | None, ...]) -> None:
    """Raise ValueError for what is none of the known values."""
    if value not in known:
        choices = ", ".join(choice for choice in known if choice is not None)
        raise UsageError(f"{name} must be one of {choices}, not {value!r}")


def check_data_window(name: str, window: tuple[float, ...]) -> None:
    """Raise ValueError for what is no (xmin, ymin, xmax, ymax)."""
    if len(window) != 4 or not all(_is_finite(value) for value in window):
        raise UsageError(f"{name} must be four numbers, not {window}")
    if not (window[0] < window[2] and window[1] < window[3]):
        raise UsageError(f"{name} must have xmin < xmax and ymin < ymax, not {tuple(window)}")


def _is_finite(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)
