"""Comparing two pictures by the best that they allow: batches, error layers, or their values."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from usdmlt import exr, image, layers
from usdmlt.errors import Error, UsageError
from usdmlt.image import Image
from usdmlt.image_files import read_parts
from usdmlt.testing import metrics, references
from usdmlt.testing.batches import Batches, means
from usdmlt.testing.error_layers import compare_pictures
from usdmlt.testing.metrics import Metrics, Thresholds
from usdmlt.testing.outcome import Outcome
from usdmlt.testing.statistics import SIGNIFICANCE, TOLERANCE, compare_batches

Method = Literal["same bits", "batches", "errors", "values"]
# Settings that do not decide how noise is distributed.
INDIFFERENT = ("seed", "aovs", "mutations", "embree_isa")  # mutations are told as samples
# Errors of all pixels together: chains are scaled by one estimate of b per unit.
COMMON_ERRORS = ("mlt",)


@dataclass
class Comparison:
    """Two pictures, and whether they show the same.

    ``method``: what decided. ``outcome``: the statistical test, where there was one. ``reasons``:
    why they differ, one line each; none: they are the same, as far as could be seen.
    ``notes``: what else a reader should know.
    """

    reference: Image
    picture: Image
    method: Method
    outcome: Outcome | None
    metrics: Metrics
    reasons: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def different(self) -> bool:
        """Whether there is any reason to call them different."""
        return bool(self.reasons)

    def lines(self) -> list[str]:
        """What was found, for people."""
        lines = list(self.reasons)
        outcome = self.outcome
        if outcome is not None:
            kind = "about " if any("approximate" in note for note in self.notes) else ""
            lines.append(
                f"p = {kind}{outcome.p:.2g} (different at {outcome.significance:g}, "
                "the probability of a false alarm)"
            )
            if math.isfinite(outcome.ratio_error):
                lines.append(
                    f"brightness {outcome.ratio:.4f} ± {outcome.ratio_error:.4f} of the reference's"
                )
            if not self.reasons and math.isfinite(outcome.detectable):
                lines.append(f"smallest change that would have been seen: {detectable(outcome)}")
        elif self.method == "same bits":
            same = "colours and alpha" if self.reasons else "pictures"
            lines.append(f"the {same} are the same, bit for bit")
        lines.append(str(self.metrics))
        return lines + self.notes


def detectable(outcome: Outcome) -> str:
    """The power of a test, for people."""
    parts = [f"{outcome.detectable:.2g} of the whole picture's brightness"]
    for size in (8, 32):
        if size in outcome.detectable_by_size:
            change = outcome.detectable_by_size[size]
            parts.append(f"{change:.2g} of {size}x{size} pixels'")
    return ", ".join(parts)


def compare(
    reference: Image,
    picture: Image,
    *,
    significance: float = SIGNIFICANCE,
    tolerance: float = TOLERANCE,
    thresholds: Thresholds | None = None,
    flip: float | None = None,
) -> Comparison:
    """Compare two pictures of the same size; ValueError where sizes differ.

    With batches, or error layers, on both sides a statistical test decides; without, the values
    have to agree within ``thresholds``, which are OpenImageIO's by default. ``thresholds`` and
    ``flip``, the largest mean FLIP, decide as well where they are given. Layers beside the picture
    and its error (depth, normals, ids) have to be there in both and the same, bit for bit; those
    of light paths where the picture is.
    """
    if picture["color"].shape != reference["color"].shape:
        sizes = [f"{x.width}x{x.height}" for x in (reference, picture)]
        raise UsageError(f"the pictures differ in size: {sizes[0]} and {sizes[1]}")
    rgba = [_rgba(x) for x in (picture, reference)]
    fail = (thresholds or Thresholds()).fail
    measured = metrics.measure(rgba[0], rgba[1], reference.color_space, fail)
    outcome, method, notes = _test(reference, picture, significance, tolerance)
    result = Comparison(reference, picture, method, outcome, measured, notes=notes)
    if reference.color_space != picture.color_space:
        result.reasons.append(
            f"the colour spaces differ: {reference.color_space} and {picture.color_space}"
        )
    places = [_place(x) for x in (reference, picture)]
    if places[0] != places[1]:
        result.reasons.append(f"the data windows differ: they start at {places[0]} and {places[1]}")
    broken = int(np.count_nonzero(~np.isfinite(np.dstack(rgba)).all(axis=-1)))
    if broken and method != "same bits":
        result.reasons.append(f"{broken} pixels are not finite")
    if method == "errors":
        errors = np.dstack([reference["error"], picture["error"]])
        broken = int(np.count_nonzero(~np.isfinite(errors).all(axis=-1)))
        if broken:
            result.reasons.append(f"{broken} pixels have errors that are not finite")
    if outcome is not None and outcome.different:
        result.reasons += [str(finding) for finding in outcome.findings]
    if thresholds is not None or method == "values":
        _by_thresholds(result, thresholds or Thresholds())
    if flip is not None:
        _by_flip(result, flip)
    _by_layers(result)
    return result


def _test(
    reference: Image, picture: Image, significance: float, tolerance: float
) -> tuple[Outcome | None, Method, list[str]]:
    if isinstance(reference, Batches) and isinstance(picture, Batches):
        if reference.bits and reference.bits == picture.bits:
            return None, "same bits", []
        pair, cell = _alike(reference, picture)
        if pair is not None:
            alike = same_noise(reference, picture)
            notes = [] if alike else ["made in different ways, so p is approximate"]
            outcome = compare_batches(
                *pair, cell=cell, significance=significance, tolerance=tolerance, alike=alike
            )
            return outcome, "batches", notes
    if all(
        np.array_equal(_rgba(reference)[..., c], _rgba(picture)[..., c], equal_nan=True)
        for c in range(4)
    ):
        return None, "same bits", []
    errors = [x.channels.get("error") for x in (reference, picture)]
    if errors[0] is not None and errors[1] is not None and errors[0].any() and errors[1].any():
        integrators = [x.metadata.get("integrator") for x in (reference, picture)]
        common = any(name in COMMON_ERRORS for name in integrators)
        notes = ["from error layers, so p is approximate"]
        if common:
            notes.append("the whole picture's brightness was not tested: its error is not known")
        outcome = compare_pictures(
            _rgba(reference),
            errors[0],
            _rgba(picture),
            errors[1],
            common=common,
            significance=significance,
        )
        return outcome, "errors", notes
    return None, "values", []


def _alike(
    reference: Batches, picture: Batches
) -> tuple[tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None, int]:
    """Batches of cells of one size and rounded in one way, if both have as many; and that size."""
    if len(reference.pictures) != len(picture.pictures):
        return None, 0
    cell = max(reference.cell, picture.cell)
    if cell % reference.cell or cell % picture.cell:
        return None, 0
    scale = reference.scale
    a, b = (
        references.rounded(means(_known(x.pictures), cell // x.cell), scale)
        for x in (reference, picture)
    )
    return (a, b), cell


def _known(pictures: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """0 where they are not numbers: that is a difference by itself."""
    return np.where(np.isnan(pictures), np.float32(0), pictures)


def same_noise(reference: Batches, picture: Batches) -> bool:
    """Whether both were made in a way that gives them noise of one distribution."""
    one, other = reference.made, picture.made
    if one.get("versions") != other.get("versions"):
        return False
    if one.get("plan") != other.get("plan"):
        return False
    settings = [
        {k: v for k, v in made.get("settings", {}).items() if k not in INDIFFERENT}
        for made in (one, other)
    ]
    return settings[0] == settings[1]


def _by_thresholds(result: Comparison, thresholds: Thresholds) -> None:
    found = result.metrics.difference
    if found.exceeds(thresholds):
        result.reasons.append(
            f"{found.failed} of {found.pixels} pixels differ by more than {thresholds.fail:g}, "
            f"the most by {found.largest:.4g}"
        )


def _by_flip(result: Comparison, most: float) -> None:
    if result.metrics.flip is None:
        raise Error("FLIP needs a package: pip install flip-evaluator")
    if result.metrics.flip > most:
        result.reasons.append(f"FLIP is {result.metrics.flip:.4f}, more than {most:g}")


def _by_layers(result: Comparison) -> None:
    one, other = result.reference, result.picture
    noisy: list[str] = []
    for name in sorted((one.channels.keys() | other.channels.keys()) - set(layers.ALWAYS)):
        if name not in one.channels or name not in other.channels:
            where = "reference" if name in one.channels else "picture"
            result.reasons.append(f"only the {where} has the layer {name}")
            continue
        layer = one.layer(name)
        a, b = (_as_in_a_file(x[name], layer) for x in (one, other))
        if a.shape != b.shape:
            result.reasons.append(f"the layer {name} is {a.shape} and {b.shape}")
            continue
        unequal = ~((a == b) | ((a != a) & (b != b)))
        count = int(np.count_nonzero(unequal if a.ndim == 2 else unequal.any(axis=-1)))
        if count and result.method != "same bits" and _is_noisy(layer, one, other):
            noisy.append(name)
        elif count:
            pixels = a.shape[0] * a.shape[1]
            result.reasons.append(f"the layer {name} differs in {count} of {pixels} pixels")
    if noisy:
        result.notes.append(f"not compared, as their noise is not known: {', '.join(noisy)}")


def _as_in_a_file(pixels: npt.NDArray[Any], layer: layers.Layer) -> npt.NDArray[Any]:
    """Rounded to halves where files do that: a reference comes from one."""
    if not layer.half or pixels.dtype == np.float16:
        return pixels
    return np.asarray(np.clip(pixels, -exr.HALF_MAX, exr.HALF_MAX), np.float16)


def _is_noisy(layer: layers.Layer, *pictures: Image) -> bool:
    """Whether it is a layer of light paths, or counts their samples."""
    stems = {"sampleCount"}
    for picture in pictures:
        stems |= json.loads(picture.metadata.get("light_paths", "{}")).keys()
    return layer.source == "paths" or layer.stem in stems


def _place(picture: Image) -> tuple[int, int]:
    """Of the upper left pixel in the whole picture."""
    window: Any = picture.metadata.get("data_window") or {"x": 0, "y": 0}
    return window["x"], window["y"]


def _rgba(picture: Image) -> npt.NDArray[np.float32]:
    return np.concatenate([picture["color"], picture["alpha"][..., None]], axis=-1)


# ---------------------------------------------------------------------------------------------
# Files


def compare_files(
    reference: str | os.PathLike[str], picture: str | os.PathLike[str], **options: Any
) -> Comparison:
    """Compare two EXRs, with :func:`compare`'s options.

    :class:`usdmlt.Error` for what cannot be read.
    """
    return compare(read(reference), read(picture), **options)


def read(path: str | os.PathLike[str]) -> Image:
    """A picture with its layers, and with its batches if it has any.

    Without R, G, B what is called Y, or the first channel there is, stands for all three.
    """
    try:
        found = list(read_parts(path))
    except OSError as error:
        raise Error(f"cannot read {path}: {error}") from None
    channels = exr.merged(found)
    if {"R", "G", "B"} <= channels.keys():
        picture = image.read(path)
        batches = references.read_batches(path, picture)
        picture = picture if batches is None else batches
    else:
        grey = channels.pop("Y" if "Y" in channels else next(iter(channels))).astype(np.float32)
        alpha = channels.pop("A", np.ones_like(grey)).astype(np.float32)
        metadata = exr.read_metadata(found[0][0])
        color = {"color": np.dstack([grey] * 3), "alpha": alpha}
        picture = Image(color | channels, metadata=metadata)
    picture.channels |= exr.of_other_sizes(found)
    return picture
