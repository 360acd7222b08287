"""Distances between two pictures, which know nothing of noise.

For pictures of other renderers, and beside the statistical test: how much, not whether.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from usdmlt import color
from usdmlt.errors import UsageError

Picture = npt.NDArray[np.float32]
EPSILON = 0.01


def rel_mse_map(picture: Picture, reference: Picture) -> npt.NDArray[np.float64]:
    """(picture - reference)^2 / (reference^2 + 0.01) by pixel, mean over channels.

    Of (height, width, 3). Rousselle, Knaus & Zwicker 2011, "Adaptive sampling and reconstruction
    using greedy error minimization".
    """
    a, b = picture.astype(np.float64), reference.astype(np.float64)
    return np.asarray(((a - b) ** 2 / (b**2 + EPSILON)).mean(axis=-1))


def smape_map(picture: Picture, reference: Picture) -> npt.NDArray[np.float64]:
    """|picture - reference| / (|picture| + |reference| + 0.01) by pixel, mean over channels.

    The symmetric mean absolute percentage error as in Vogels et al. 2018, "Denoising with kernel
    prediction and asymmetric loss functions".
    """
    a, b = picture.astype(np.float64), reference.astype(np.float64)
    return np.asarray((np.abs(a - b) / (np.abs(a) + np.abs(b) + EPSILON)).mean(axis=-1))


def flip_map(
    picture: Picture, reference: Picture, color_space: str = color.DEFAULT
) -> Picture | None:
    """HDR-FLIP by pixel, 0 … 1, at 67 pixels per degree; None without the package flip-evaluator.

    Andersson et al. 2021, "Visualizing errors in rendered high dynamic range images".
    """
    try:
        import flip_evaluator
    except ImportError:
        return None
    to_709 = color.conversion(color_space, color.DEFAULT)
    a, b = (
        np.ascontiguousarray(np.maximum(x @ to_709.T, 0), np.float32) for x in (picture, reference)
    )
    if not a.any() and not b.any():
        return np.zeros(a.shape[:2], np.float32)
    if np.array_equal(a, b):
        return np.zeros(a.shape[:2], np.float32)
    error, _, _ = flip_evaluator.evaluate(b, a, "HDR", applyMagma=False)
    return np.asarray(error, np.float32).reshape(a.shape[:2])


@dataclass(frozen=True)
class Thresholds:
    """When pictures differ for `idiff`: its flags -fail, -failpercent and -hardfail.

    More than ``failpercent`` per cent of the pixels differ by more than ``fail`` in any channel, or
    one by more than ``hardfail``.
    """

    fail: float = 1e-6
    failpercent: float = 0.0
    hardfail: float = float("inf")

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0:
                raise UsageError(f"{field.name} must not be negative, but is {value:g}")


@dataclass(frozen=True)
class Difference:
    """What OpenImageIO's compare says of two pictures."""

    pixels: int
    failed: int  # pixels beyond the threshold
    largest: float
    mean: float
    rms: float

    def exceeds(self, thresholds: Thresholds) -> bool:
        """Whether `idiff` would call that a failure."""
        beyond = self.failed > thresholds.failpercent / 100 * self.pixels
        return beyond or self.largest > thresholds.hardfail


def difference(picture: Picture, reference: Picture, fail: float = Thresholds.fail) -> Difference:
    """OpenImageIO's comparison of (height, width, channels)."""
    import OpenImageIO as oiio

    result: Any = oiio.ImageBufAlgo.compare(
        _buffer(picture), _buffer(reference), failthresh=fail, warnthresh=fail
    )
    return Difference(
        pixels=int(picture.shape[0] * picture.shape[1]),
        failed=int(result.nfail),
        largest=float(result.maxerror),
        mean=float(result.meanerror),
        rms=float(result.rms_error),
    )


def _buffer(picture: Picture) -> Any:
    import OpenImageIO as oiio

    return oiio.ImageBuf(np.ascontiguousarray(picture, dtype=np.float32))


@dataclass(frozen=True)
class Metrics:
    """Of a picture against a reference; ``flip`` is None without flip-evaluator."""

    rel_mse: float
    smape: float
    flip: float | None
    difference: Difference

    def __str__(self) -> str:
        flip = "not installed" if self.flip is None else f"{self.flip:.4f}"
        return (
            f"relMSE {self.rel_mse:.4g}, SMAPE {self.smape:.4g}, FLIP {flip}, "
            f"largest difference {self.difference.largest:.4g}"
        )


def measure(
    picture: Picture,
    reference: Picture,
    color_space: str = color.DEFAULT,
    fail: float = Thresholds.fail,
) -> Metrics:
    """All of them, of (height, width, 4): RGB, and alpha, which the difference alone looks at.

    What is not finite counts as 0, but in the difference.
    """
    a, b = (np.nan_to_num(x[..., :3], posinf=0, neginf=0) for x in (picture, reference))
    flip = flip_map(a, b, color_space)
    return Metrics(
        rel_mse=float(rel_mse_map(a, b).mean()),
        smape=float(smape_map(a, b).mean()),
        flip=None if flip is None else float(flip.mean()),
        difference=difference(picture, reference, fail),
    )
