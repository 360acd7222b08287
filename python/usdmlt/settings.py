"""How to render: the settings of a render, their defaults and their limits."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal, get_args

from usdmlt import layers
from usdmlt.errors import UsageError

ResolvedIntegrator = Literal["path", "bdpt", "mlt"]
IntegratorName = Literal["auto", "path", "bdpt", "mlt"]
DirectName = Literal["auto", "mlt", "separate"]
FilterName = Literal["gaussian", "box"]
EmbreeIsa = Literal["sse2", "sse4.2", "avx", "avx2", "avx512"]

MUTATIONS = (
    "new_path",
    "bidirectional",
    "lens",
    "caustic",
    "multi_chain",
    "lens_subpath",
    "glossy_lens",
    "glossy_caustic",
    "aimed",
)
# One of these has to be there: the others keep the length of a path, or what it runs through.
ERGODIC_MUTATIONS = ("new_path", "bidirectional")

# What `--time` or `--error` alone means: as many samples as the time allows or the error needs.
UNLIMITED_SAMPLES = 2**20


@dataclass(frozen=True)
class Settings:
    """Settings of a render; values out of range raise ValueError.

    ``integrator``: ``"path"`` (path tracing), ``"bdpt"`` (bidirectional path tracing), ``"mlt"``
    (Metropolis light transport) or ``"auto"``: the one that suits the scene, by short pilots
    (:mod:`usdmlt.choice`); ``"mlt"`` where mutations are asked for.
    ``samples``: per pixel, of whichever integrator runs: mutations for ``"mlt"``. None: 64, or as
    many as ``time`` allows or ``target_error`` needs.
    ``mutations``: the same for ``"mlt"`` alone. The render ends with a whole unit of work, so a
    small picture may get more.
    ``time``: seconds of rendering after which to stop, not counting the reading of the stage.
    ``target_error``: render until the error of the picture is estimated to be below it: the root
    mean square of the pixels' standard errors, relative to their luminance R, as
    e / sqrt(R^2 + 0.01 mean^2). It is looked at now and then, by the number of work units.
    ``depth``: the most edges a path may have, lens and light included: 2 is direct light.
    ``seed``: any integer from 0 below 2^32. The same scene, settings and seed give the same bits.
    ``threads``: None: as many as the process may run on.
    ``filter``: the pixel filter, ``"gaussian"`` or ``"box"``.
    ``error``: whether the picture gets a layer ``"error"``, the standard error of its luminance.
    ``aovs``: further layers of the picture (:mod:`usdmlt.layers`): names, ``"primvars:NAME"``,
    ``"lightGroup:NAME"`` and light path expressions, which may be named: ``"caustics=LS+DE"``.
    ``embree_isa``: the instruction set Embree uses. Pictures made with different ones differ in
    the last bits.

    Of ``"mlt"`` alone:

    ``mutation_weights``: how often each mutation is tried, relative to the others that apply;
    those that are not named are not. Names: ``new_path``, ``bidirectional``, ``lens``,
    ``caustic``, ``multi_chain``, ``lens_subpath``, ``glossy_lens``, ``glossy_caustic``, ``aimed``;
    one of the first two has to be among them. None: chosen for the scene.
    ``selective``: whether light that bidirectional path tracing finds is left to it, so that the
    mutations have what is hard to find alone; a part of the work goes to each, by a pilot.
    ``direct``: who renders light that is seen directly or after one bounce: path tracing alone
    (``"separate"``), or what renders all other light (``"mlt"``); ``"auto"`` is ``"separate"``,
    unless path tracing finds such light at few places only.
    ``two_stage``: whether dark parts get as much work as bright ones, by a coarse picture that is
    made first.
    """

    integrator: IntegratorName = "auto"
    samples: int | None = None
    mutations: int | None = None
    time: float | None = None
    target_error: float | None = None
    depth: int = 16
    seed: int = 0
    threads: int | None = None
    filter: FilterName = "gaussian"
    error: bool = True
    aovs: Iterable[layers.Asked] = ()
    mutation_weights: Mapping[str, float] | None = None
    direct: DirectName = "auto"
    selective: bool = True
    two_stage: bool = True
    embree_isa: EmbreeIsa = "avx2"

    def __post_init__(self) -> None:
        _check_choice("integrator", self.integrator, get_args(IntegratorName))
        _check_choice("filter", self.filter, get_args(FilterName))
        _check_choice("direct", self.direct, get_args(DirectName))
        _check_choice("embree_isa", self.embree_isa, get_args(EmbreeIsa))
        check_integer("samples", self.samples, 1, UNLIMITED_SAMPLES, optional=True)
        check_integer("mutations", self.mutations, 1, UNLIMITED_SAMPLES, optional=True)
        check_integer("depth", self.depth, 1, 1000)
        check_integer("seed", self.seed, 0, 2**32 - 1)
        check_integer("threads", self.threads, 1, 4096, optional=True)
        _check_positive("time", self.time, "number of seconds")
        _check_positive("target_error", self.target_error, "number")
        for name in ("error", "selective", "two_stage"):
            _check_flag(name, getattr(self, name))
        if self.target_error is not None and not self.error:
            raise UsageError("target_error needs the layer of the error: error=True")
        if self.mutation_weights is not None:
            weights = check_weights(
                "mutation_weights", self.mutation_weights, MUTATIONS, ERGODIC_MUTATIONS
            )
            object.__setattr__(self, "mutation_weights", weights)
        object.__setattr__(self, "aovs", layers.resolve(self.aovs))
        if self.samples is not None and self.mutations is not None:
            raise UsageError("samples and mutations say the same: give one of them")
        if self.integrator not in ("auto", "mlt"):
            for name in ("mutations", "mutation_weights"):
                if getattr(self, name) is not None:
                    raise UsageError(f"{name} are for mlt, not for {self.integrator}")

    @property
    def resolved_samples(self) -> int:
        """Samples, or mutations, per pixel at which the render ends if nothing stops it before."""
        given = self.mutations if self.samples is None else self.samples
        if given is not None:
            return given
        is_limited = self.time is not None or self.target_error is not None
        return UNLIMITED_SAMPLES if is_limited else 64

    @property
    def primvars(self) -> tuple[str, ...]:
        """What layers read of a stage beside what materials do."""
        asked = (layer.primvar for layer in layers.resolve(self.aovs))
        return tuple(name for name in asked if name)

    @property
    def resolved_threads(self) -> int:
        """The number of threads."""
        return available_processors() if self.threads is None else self.threads


def merged(asked: Mapping[str, Any], given: Mapping[str, Any]) -> Settings:
    """Settings that are ``given`` over those that a stage asks for.

    What would contradict a given one is left out: the budget comes from one side, and what is for
    mlt alone goes with another integrator.
    """
    kept = {name: value for name, value in asked.items() if name not in given}
    if {"samples", "mutations"} & given.keys():
        kept.pop("samples", None)
        kept.pop("mutations", None)
    if given.get("integrator") in ("path", "bdpt"):
        kept.pop("mutations", None)
        kept.pop("mutation_weights", None)
    if {"mutations", "mutation_weights"} & given.keys():
        kept.pop("integrator", None)
    return Settings(**kept, **given)


def available_processors() -> int:
    """The number of processors this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_resolution(width: int | None, height: int | None) -> None:
    """Raise ValueError for image sizes that cannot be."""
    check_integer("width", width, 1, 65536, optional=True)
    check_integer("height", height, 1, 65536, optional=True)


def check_weights(
    setting: str, weights: Mapping[str, float], known: Iterable[str], ergodic: Iterable[str]
) -> dict[str, float]:
    """Weights of mutations as a dict of floats; ValueError for what they cannot be.

    One of the mutations ``ergodic``, which make every state from every other, has to be in use.
    """
    if not isinstance(weights, Mapping):
        raise UsageError(f"{setting} must be a mapping of names to weights, not {weights!r}")
    known, ergodic = tuple(known), tuple(ergodic)
    for name, weight in weights.items():
        if name not in known:
            raise UsageError(f"unknown mutation {name!r}: the mutations are {', '.join(known)}")
        if isinstance(weight, bool) or not isinstance(weight, Real):
            raise UsageError(f"the weight of {name} must be a number, not {weight!r}")
        if not (weight >= 0 and math.isfinite(weight)):
            raise UsageError(f"the weight of {name} must be finite and not negative, not {weight}")
    if not math.isfinite(sum(map(float, weights.values()))):
        raise UsageError(f"{setting} are too large to be added up")
    if not any(weights.values()):
        raise UsageError(f"{setting} must not all be zero")
    if not any(weights.get(name, 0) for name in ergodic):
        raise UsageError(f"these mutations cannot reach everything: add {' or '.join(ergodic)}")
    return {name: float(weight) for name, weight in weights.items()}


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise UsageError(f"{name} must be one of {', '.join(choices)}, not {value!r}")


def _check_positive(name: str, value: float | None, what: str) -> None:
    if value is None:
        return
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    if not (is_number and value > 0 and math.isfinite(value)):
        raise UsageError(f"{name} must be a positive {what}, not {value!r}")


def _check_flag(name: str, value: bool) -> None:
    if value not in (True, False):  # NumPy's are as good
        raise UsageError(f"{name} must be True or False, not {value!r}")


def check_integer(
    name: str, value: int | None, least: int, most: int, optional: bool = False
) -> None:
    """Raise ValueError for what is no integer between ``least`` and ``most``."""
    if value is None and optional:
        return
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise UsageError(f"{name} must be an integer, not {value!r}")
    if not least <= value <= most:
        raise UsageError(f"{name} must be between {least} and {most}, not {value}")
