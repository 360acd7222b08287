"""Pictures from parts of one render: the sums of their integers."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from usdmlt import fingerprint, native, parts, units
from usdmlt.errors import Error
from usdmlt.image import Image
from usdmlt.making import encoded
from usdmlt.parts import RenderPart, State
from usdmlt.units import Range

if TYPE_CHECKING:
    from usdmlt import _core

logger = logging.getLogger("usdmlt")


def merge(paths: Sequence[str | os.PathLike[str]], allow_gaps: bool = False) -> RenderPart:
    """The sum of part files, in any order: the same bits as one render of all their units.

    ``allow_gaps``: units may be missing; the picture is then of those that are there.

    Raises :class:`usdmlt.Error` for files that are damaged or of different plans, for units that
    are in two of them, and for those that are in none.
    """
    first, film, done = None, None, dict[str, list[Range]]()
    saved, total = None, 0
    for name in paths:
        path = os.fspath(name)
        part = parts.read(path)
        if first is None or film is None:
            first, film = part, _film(part)
        different = fingerprint.difference(part.fingerprint, first.fingerprint)
        if different:
            raise Error(f"{path} and {next(iter(done))} are of different renders: {different}")
        for other, ranges in done.items():
            both = units.overlap(ranges, part.state.units)
            if both:
                raise Error(f"units {both[0]}:{both[1]} are in {other} and in {path}")
        film.add(part.state.sums)
        saved = part.state.saved if saved is None else parts.added(saved, part.state.saved)
        done[path] = part.state.units
        total = max(total, part.units_total)
    if first is None or film is None or saved is None:
        raise Error("there are no parts to merge")
    ranges = units.joined(unit for of_file in done.values() for unit in of_file)
    missing = units.gaps((0, total), ranges)
    if missing:
        named = f"units {units.describe(missing)} of 0:{total} are missing"
        if not allow_gaps:
            raise Error(f"{named}: render them, or take what is there by --allow-gaps")
        logger.warning("%s: the picture is of the others", named)
    if saved["overflows"]:
        count = saved["overflows"]
        logger.warning("%d contributions were too bright for the film and were cut", count)
    state = State(film.planes(), saved | {"units": ranges})
    whole = replace(first, state=state, units_total=total)
    return replace(whole, image=_image(whole, film))


def _film(part: RenderPart) -> _core.Film:
    image, sums = part.image, part.state.sums
    film: _core.Film = native.core().Film(
        image.width,
        image.height,
        *part.scales,
        splats="splats" in sums,
        error="squares" in sums,
        layers=len(part.light_layers),
    )
    return film


def _image(part: RenderPart, film: _core.Film) -> Image:
    """The picture of the film; layers of surfaces are the same in all parts."""
    development = native.core().Development(*part.development)
    ranges, saved = part.state.units, part.state.saved
    rgba = development.image(film, ranges)
    channels = part.image.channels | {"color": rgba[..., :3], "alpha": rgba[..., 3]}
    if "error" in channels:
        channels["error"] = development.error(film, ranges)
    for number, name in enumerate(part.light_layers):
        channels[name] = development.layer(film, ranges, number)
    for name in channels:
        if part.image.layer(name).shows == "sampleCount":
            channels[name] = film.sample_counts()
    is_mlt = part.fingerprint["settings"]["integrator"] == "mlt"
    done = units.count(ranges)
    samples = done * part.samples_per_unit if is_mlt else saved["statistics"][2]
    spent = samples / (part.image.width * part.image.height)
    making = part.making and part.making | {"units": done, "samples_per_pixel": spent}
    metadata = part.image.metadata | {
        "mutations" if is_mlt else "samples": spent,
        "units": done,
        "time": saved["seconds"],
        "settings": encoded(making, ranges),
    }
    return replace(part.image, channels=channels, metadata=metadata)
