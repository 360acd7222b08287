"""Surfaces made of samples, each a weighted sum of what was authored: curves, patches, points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import UsdGeom

from usdmlt.scene import Primvar
from usdmlt.stage.primvars import fits


@dataclass
class Weights:
    """``index`` and ``weight`` (samples, k) of ``count`` authored values."""

    count: int
    index: np.ndarray
    weight: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(samples, width) float64 from (count, width)."""
        total = np.zeros((len(self.index), values.shape[1]))
        for column in range(self.index.shape[1]):
            total += self.weight[:, column, None] * values[self.index[:, column]]
        return total

    def repeated(self, times: int) -> Weights:
        """The same for every sample ``times`` over."""
        return Weights(
            self.count,
            np.repeat(self.index, times, axis=0),
            np.repeat(self.weight, times, axis=0),
        )


def one_each(owner: np.ndarray, count: int) -> Weights:
    """Every sample has the value of its ``owner`` (samples,), one of ``count``."""
    return Weights(count, owner[:, None], np.ones((len(owner), 1)))


@dataclass
class Sampled:
    """Stands where a :class:`~usdmlt.stage.primvars.Topology` does for polygons.

    ``vertices`` (triangles, 3): samples; ``faces`` (triangles,): the curve, patch or point.
    ``by_vertex``, ``by_varying``: how values of these interpolations reach the samples.
    """

    vertices: np.ndarray
    faces: np.ndarray
    face_count: int
    by_vertex: Weights
    by_varying: Weights

    @property
    def point_count(self) -> int:
        return self.by_vertex.count

    def spread(
        self, values: np.ndarray, indices: np.ndarray | None, interpolation: str
    ) -> Primvar | None:
        """As :meth:`usdmlt.stage.primvars.Topology.spread`; face-varying is varying here."""
        tokens = UsdGeom.Tokens
        if interpolation in (tokens.constant, tokens.uniform):
            uniform = interpolation == tokens.uniform
            if not fits(values, indices, self.face_count if uniform else 1, interpolation):
                return None
            element = self.faces if uniform else np.zeros_like(self.faces)
            if indices is not None:
                element = indices[element]
            return Primvar(values, np.repeat(element[:, None], 3, axis=1).astype(np.int32))
        weights = self.by_vertex if interpolation == tokens.vertex else self.by_varying
        if not fits(values, indices, weights.count, interpolation):
            return None
        if indices is not None:
            values = values[indices]
        return Primvar(weights(values).astype(np.float32))
