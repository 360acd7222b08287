"""How to render: the settings of a render, their defaults and their limits."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from numbers import Integral
from typing import Literal, get_args

from usdmlt.errors import UsageError

IntegratorName = Literal["auto", "path", "bdpt"]
FilterName = Literal["gaussian", "box"]
EmbreeIsa = Literal["sse2", "sse4.2", "avx", "avx2", "avx512"]

# What `--time` alone means: as many samples as the time allows.
UNLIMITED_SAMPLES = 2**20


@dataclass(frozen=True)
class Settings:
    """Settings of a render; values out of range raise ValueError.

    ``integrator``: ``"path"`` (path tracing), ``"bdpt"`` (bidirectional path tracing) or
    ``"auto"``, which is ``"path"`` in this version.
    ``samples``: per pixel; None: 64, or as many as ``time`` allows.
    ``time``: seconds of rendering after which to stop, not counting the reading of the stage.
    ``depth``: the most edges a path may have, lens and light included: 2 is direct light.
    ``seed``: any integer from 0 below 2^32. The same scene, settings and seed give the same bits.
    ``threads``: None: as many as the process may run on.
    ``filter``: the pixel filter, ``"gaussian"`` or ``"box"``.
    ``embree_isa``: the instruction set Embree uses. Pictures made with different ones differ in
    the last bits.
    """

    integrator: IntegratorName = "auto"
    samples: int | None = None
    time: float | None = None
    depth: int = 16
    seed: int = 0
    threads: int | None = None
    filter: FilterName = "gaussian"
    embree_isa: EmbreeIsa = "avx2"

    def __post_init__(self) -> None:
        _check_choice("integrator", self.integrator, get_args(IntegratorName))
        _check_choice("filter", self.filter, get_args(FilterName))
        _check_choice("embree_isa", self.embree_isa, get_args(EmbreeIsa))
        _check_integer("samples", self.samples, 1, UNLIMITED_SAMPLES, optional=True)
        _check_integer("depth", self.depth, 1, 1000)
        _check_integer("seed", self.seed, 0, 2**32 - 1)
        _check_integer("threads", self.threads, 1, 4096, optional=True)
        if self.time is not None and not (self.time > 0 and math.isfinite(self.time)):
            raise UsageError(f"time must be a positive number of seconds, not {self.time}")

    @property
    def resolved_integrator(self) -> Literal["path", "bdpt"]:
        """The integrator that runs."""
        return "path" if self.integrator == "auto" else self.integrator

    @property
    def resolved_samples(self) -> int:
        """The samples per pixel at which the render ends if nothing stops it before."""
        if self.samples is not None:
            return self.samples
        return 64 if self.time is None else UNLIMITED_SAMPLES

    @property
    def resolved_threads(self) -> int:
        """The number of threads."""
        return available_processors() if self.threads is None else self.threads


def available_processors() -> int:
    """The number of processors this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_resolution(width: int | None, height: int | None) -> None:
    """Raise ValueError for image sizes that cannot be."""
    _check_integer("width", width, 1, 65536, optional=True)
    _check_integer("height", height, 1, 65536, optional=True)


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise UsageError(f"{name} must be one of {', '.join(choices)}, not {value!r}")


def _check_integer(
    name: str, value: int | None, least: int, most: int, optional: bool = False
) -> None:
    if value is None and optional:
        return
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"{name} must be an integer, not {value!r}")
    if not least <= value <= most:
        raise UsageError(f"{name} must be between {least} and {most}, not {value}")
