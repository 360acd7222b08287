"""Rendering: a scene and settings in, an image out."""

from __future__ import annotations

import json
import logging
import math
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from copy import copy
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

from usdmlt import color, layers, light_path_layers, native, target_error
from usdmlt.checkpoint import open_checkpoint, settings_to_resume
from usdmlt.choice import choose
from usdmlt.errors import Error, UsageError, Warning
from usdmlt.fingerprint import Fingerprint, of_render
from usdmlt.image import Image
from usdmlt.interruption import Interruption
from usdmlt.making import making, metadata
from usdmlt.parts import RenderPart, State
from usdmlt.previews import Preview
from usdmlt.scene import Scene
from usdmlt.settings import ResolvedIntegrator, Settings, check_resolution, merged
from usdmlt.surface_layers import SurfaceLayers, surface_layers
from usdmlt.units import Range, gaps, overlap

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from distributed import Client
    from pxr import Usd

    from usdmlt import _core
    from usdmlt.checkpoint import Checkpoint

logger = logging.getLogger("usdmlt")

TRUNCATION_WARNED_ABOUT = 0.01
EDGES_OF_UNREACHABLE_PATHS = 4  # of LSDSE, the shortest of them


@dataclass(frozen=True)
class Progress:
    """How far a render is."""

    units_done: int
    units_total: int  # with a target error as many as it will need, as estimated, if that is fewer
    samples_per_unit: float  # on average
    seconds: float  # of this run
    samples_are: str = "samples"  # of mlt "mutations", or their worth
    units_before: int = 0  # that were done before this run
    is_total_known: bool = True  # else it is the limit, and the error will be looked at before

    @property
    def samples_done(self) -> float:
        """Samples taken, or mutations made, so far, over all pixels."""
        return self.units_done * self.samples_per_unit


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during :func:`render`. ``image`` is the picture of the units that were finished."""

    def __init__(self, image: Image) -> None:
        super().__init__("the render was interrupted")
        self.image = image


class Rendering:
    """A planned render of one picture, run in one go or in pieces.

    ``scene``: the scene description; ``settings``: how to render it. Building the acceleration
    structures and the plan happens here; raises :class:`usdmlt.Error` when the core refuses the
    scene. ``integrator`` is the one that runs: ``"path"``, ``"bdpt"`` or ``"mlt"``.
    """

    def __init__(self, scene: Scene, settings: Settings) -> None:
        self.scene = scene
        self.settings = settings
        color.rendering_space(scene.color_space)  # the picture's file has to name it
        started = perf_counter()
        self._core_scene = native.build_scene(scene, settings.embree_isa)
        self.choice = choose(self._core_scene, settings)
        self.integrator: ResolvedIntegrator = self.choice.integrator
        self.layers = light_path_layers.expanded(layers.resolve(settings.aovs), scene)
        self._light_paths = [layer for layer in self.layers if layer.source == "paths"]
        compiled = light_path_layers.compiled_for(scene, self._light_paths)
        self._render = native.plan_render(
            self._core_scene, settings, self.integrator, compiled if self._light_paths else None
        )
        self._surfaces: SurfaceLayers | None = None
        self._look: target_error.Look | None = None  # the last
        self._unreachable = unreachable_light(scene, self._core_scene, settings.depth)
        self._seconds_building = perf_counter() - started

    def again(self, seed: int, samples: int) -> Rendering:
        """A rendering by the same plan with other random numbers, and without an error layer.

        Given the plan it is independent of this one, and of others again. ``seed``: below 2^64;
        ``samples``: per pixel.
        """
        other = copy(self)
        other.__dict__.pop("fingerprint", None)
        other.settings = replace(
            self.settings, samples=samples, mutations=None, error=False, aovs=()
        )
        other.layers, other._light_paths, other._surfaces = [], [], None
        other._render = self._render.again(seed, samples)
        return other

    @property
    def units(self) -> list[Range]:
        """Which work units the picture is of: ranges (first, one beyond the last), ascending."""
        return self._render.units

    @property
    def units_done(self) -> int:
        """How many work units the picture is of."""
        return int(self._render.units_done)

    @property
    def units_total(self) -> int:
        """The number of work units when all samples are taken."""
        return int(self._render.units_total)

    @property
    def samples_per_unit(self) -> float:
        """Samples, or mutations or their worth, of a work unit on average."""
        return self._render.samples_per_unit

    @cached_property
    def fingerprint(self) -> Fingerprint:
        """What tells the plan from others, whose units must not be summed with its own."""
        plan = self._render.plan_digest
        return of_render(self.scene, self.settings, self.integrator, self.layers, plan)

    def run(
        self,
        progress: Callable[[Progress], None] | None = None,
        stop: Callable[[], bool] | None = None,
        until: int | None = None,
        previews: Sequence[Preview] = (),
        first: int = 0,
        checkpoint: Checkpoint | None = None,
    ) -> bool:
        """Render until all units are done, the time is over, the error is small enough or
        ``stop()`` is true.

        ``first``, ``until``: render units from the first up to, and without, the second only; what
        of them is done already is not done again. ``progress`` and ``stop`` are called from this
        thread about ten times a second; units that have started by then are finished.
        ``previews`` are shown the picture so far, each in its time, which does not count;
        ``checkpoint`` is written now and then.
        Returns whether all units are done. MemoryError where a unit cannot be rendered; no unit is
        done then any more, as some were begun.
        """
        self.see_surfaces(stop)
        last = self.units_total if until is None else min(until, self.units_total)
        seconds, limit = 0.0, self.settings.time
        total, units_before = last - first, self.units_done

        def tell(units_done: int, seconds: float) -> None:
            if progress is not None:
                progress(self.progress(units_done, total, seconds, units_before))

        while not self.is_good_enough():
            gap = next(iter(gaps((first, last), self.units)), None)
            if gap is None:
                break
            end = target_error.next_look(self, *gap)
            started, before = perf_counter(), seconds
            due = started + min((preview.wait(started) for preview in previews), default=math.inf)
            stopped = False

            def poll(units_done: int) -> bool:
                nonlocal stopped
                now = perf_counter()
                tell(units_done, before + now - started)  # noqa: B023
                stopped = stop is not None and stop()
                is_due = checkpoint is not None and checkpoint.wait(now) <= 0
                # Nobody is shown, and no file has, the same units twice.
                return stopped or (units_done > 0 and (now >= due or is_due))  # noqa: B023

            self._render.run(
                end,
                threads=self.settings.resolved_threads,
                deadline_seconds=None if limit is None else limit - seconds,
                poll=poll,
                first_unit=gap[0],
            )
            seconds += perf_counter() - started
            if stopped or (limit is not None and seconds >= limit):
                break
            if not gaps((first, last), self.units):
                break  # what is due will be made of the whole
            self.show(previews)
            if checkpoint is not None and checkpoint.wait(perf_counter()) <= 0:
                checkpoint.update(self)
        tell(self.units_done, seconds)
        return self.units_done == self.units_total

    def is_good_enough(self) -> bool:
        """Whether the error is looked at now, by the number of units done, and is small enough."""
        look = target_error.look(self)
        self._look = look or self._look
        return look is not None and look.is_reached

    def state(self) -> State:
        """What the units done so far gave, to be added to a rendering of the same plan; its arrays
        are the film's own and change when more is rendered."""
        return State(self._render.film.planes(), self._render.saved())

    def add(self, state: State) -> None:
        """Add units of the same plan that were rendered elsewhere, or before.

        :class:`usdmlt.Error` where some of them are done already; then nothing is added.
        """
        both = overlap(self.units, state.units)
        if both:
            raise Error(f"units {both[0]}:{both[1]} are there already")
        self._render.film.add(state.sums)
        self._render.add_saved(state.saved)

    def render_alone(self, first: int, last: int, threads: int) -> State:
        """What the units ``first`` to ``last`` - 1 give alone: others that are done are dropped."""
        self._render.clear()
        self._render.run(last, threads=threads, first_unit=first)
        sums = {name: plane.copy() for name, plane in self._render.film.planes().items()}
        return State(sums, self._render.saved())

    def part(self) -> RenderPart:
        """The work so far and its picture, to be written (:mod:`usdmlt.parts`)."""
        development = self._render.development
        with no_warnings():
            image = self.image()
        return RenderPart(
            self.fingerprint,
            self.state(),
            self.units_total,
            (self._render.film.scale, self._render.film.sample_weight),
            (development.mutations_per_unit, development.exposure),
            tuple(layer.name for layer in self._light_paths),
            self._render.samples_per_unit,
            making(self.scene, self.settings, image.stats),
            image,
        )

    def error(self) -> npt.NDArray[np.float32]:
        """The standard error of the picture's luminance so far, (height, width) float32."""
        return self._render.error()

    def rgba(self) -> npt.NDArray[np.float32]:
        """The picture so far without its layers, (height, width, 4) float32."""
        return self._render.image()

    def show(self, previews: Sequence[Preview]) -> None:
        """Show the picture so far to those of the previews that are due."""
        due = [preview for preview in previews if preview.wait(perf_counter()) <= 0]
        if not due or self.units_done == 0:
            return
        with no_warnings():
            image = self.image()
        for preview in due:
            preview.update(image)

    def image(self) -> Image:
        """The picture of the units done so far."""
        stats = self.stats()
        image = Image.from_rgba(
            self._render.image(),
            color_space=color.rendering_space_name(self.scene.color_space),
            stats=stats,
            metadata=metadata(self.scene, self.settings, stats),
        )
        if self.settings.error:
            image.channels["error"] = self._render.error()
        for number, layer in enumerate(self._light_paths):
            image.channels[layer.name] = self._render.layer(number)
        if self._light_paths:
            shown = {layer.stem: layer.shows for layer in self._light_paths}
            image.metadata["light_paths"] = json.dumps(shown, ensure_ascii=False)
        for layer in self.layers:
            if layer.shows == "sampleCount":
                image.channels[layer.name] = self._render.film.sample_counts()
        surfaces = self.see_surfaces()
        image.channels |= surfaces.channels
        image.metadata |= surfaces.metadata
        image.layers = {layer.name: layer for layer in self.layers} | surfaces.layers
        if self.units_done > 0 and not image["color"].any():
            logger.warning("no light was found that reaches the camera: the picture is black")
        _warn(stats)
        return image

    def see_surfaces(self, stop: Callable[[], bool] | None = None) -> SurfaceLayers:
        """The layers of surfaces, by a pass that is made once, however much is rendered."""
        if self._surfaces is None:
            self._surfaces = surface_layers(
                self.scene,
                self._core_scene,
                self.layers,
                self.settings.filter,
                self.settings.resolved_threads,
                stop,
            )
        return self._surfaces

    def stats(self) -> dict[str, Any]:
        """What the core measured, and the settings as they were resolved: JSON has them all.

        ``samples`` are those of the camera; ``samples_per_pixel`` is what was spent of the budget:
        of ``"mlt"``, mutations and the worth of bidirectional samples in them. ``unreachable``
        names lights and materials between which no integrator finds a path.

        Of ``"mlt"`` too: ``mutations`` and their rates; ``share_of_bidirectional_samples`` in the
        work; ``b``, the integral of the light that is left to the mutations, which scales their
        part of the picture, and ``b_error``, its standard error; ``mutation``, by name: the weight
        with which it was tried, how often it was applicable, proposed, made a path and was
        accepted, and the mean acceptance probability; ``path_class_energy``, mean luminance by
        class (``"LSDE"``); ``longest_rejection``, steps that the most stubborn path stayed.
        """
        measured = self._render.stats()
        measured.update(measured.pop("mlt", {}))
        settings = asdict(self.settings)
        settings["integrator"] = self.integrator
        settings["aovs"] = [layer.name for layer in self.layers]
        settings["threads"] = self.settings.resolved_threads
        spent = measured["samples"]
        if self.integrator == "mlt":
            spent = self.units_done * self._render.samples_per_unit
        return {
            "integrator": self.integrator,
            "choice": asdict(self.choice),
            **measured,
            "units_done": self.units_done,
            "units_total": self.units_total,
            "units": [[first, last] for first, last in self.units],
            "samples_per_pixel": spent / self._pixels,
            "truncated_fraction": truncated_fraction(measured["path_length_energy"]),
            "unreachable": self._unreachable,
            "seconds_building": self._seconds_building,
            "settings": settings,
        }

    @property
    def _pixels(self) -> int:
        return self.scene.width * self.scene.height

    def progress(self, done: int, total: int, seconds: float, before: int) -> Progress:
        """Of so many units done, some of them before, and as many in total as are wanted at
        most."""
        samples_are = "mutations" if self.integrator == "mlt" else "samples"
        samples = self._render.samples_per_unit
        is_known = self._look is not None or target_error.next_look(self, done, total) == total
        if self._look is not None:
            # It ends when a look says so: until then there is something left.
            least = done if self._look.is_reached else done + 1
            total = min(total, max(self._look.units_needed, least))
        return Progress(done, total, samples, seconds, samples_are, before, is_known)


def render(
    stage: Usd.Stage | Scene | str | os.PathLike[str],
    *,
    camera: str | None = None,
    frame: float | Literal["default"] | None = None,
    width: int | None = None,
    height: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    preview: Callable[[Image], None] | None = None,
    preview_seconds: float = 2.0,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    client: Client | None = None,
    **options: Any,
) -> Image:
    """Render a USD stage, or a scene description, and return the picture.

    ``stage``: an open stage, the path of a file, or a :class:`usdmlt.scene.Scene`, which takes
    none of the options of reading.
    ``progress``: called about ten times a second with a :class:`Progress`.
    ``preview``: called with the picture so far every ``preview_seconds``, and at last with the
    whole; in a notebook :class:`usdmlt.notebook.Live`.
    ``checkpoint``: a file that has the work so far, as of the command line; ``resume``: go on from
    it, if it is there yet. Where it cannot be written there is a warning, and the picture.
    ``client``: a ``distributed.Client`` of Dask, whose workers render: the same bits.
    ``options``: the fields of :class:`usdmlt.Settings`: integrator, samples, mutations, time,
    target_error, depth, seed, threads, filter, error, aovs, mutation_weights, direct, selective,
    two_stage, which go before what the stage itself asks for; all others are those of
    :func:`usdmlt.load`, as camera, frame, width and height are: purposes, mask, variants,
    color_space …

    The picture's layers are ``"color"`` and ``"alpha"`` and, unless ``error=False``, ``"error"``:
    the standard error of the luminance by pixel, 0 where there were too few samples to tell; and
    those that are asked for by ``aovs``: ``image["albedo"]``.

    Raises ValueError for settings out of range, :class:`usdmlt.Error` when the render could not
    be done, and :class:`usdmlt.Interrupted`, a KeyboardInterrupt that carries the picture so far,
    after Ctrl-C.

    >>> image = usdmlt.render("shot.usda", width=640, samples=256)
    >>> image.write("shot.exr")
    """
    options |= {"camera": camera, "frame": frame, "width": width, "height": height}
    scene, given, _ = read(stage, options)
    previews = [] if preview is None else [Preview(preview, preview_seconds)]
    settings = merged(scene.settings, given)
    saved, before = open_checkpoint(checkpoint, resume)
    if before is not None:
        settings = settings_to_resume(settings, before)
    rendering = Rendering(scene, settings)
    if saved is not None and before is not None:
        saved.restore(rendering, before)
    if settings.integrator == "auto":
        logger.info("auto: %s (%s)", rendering.integrator, rendering.choice.reason)
    with Interruption(signal.SIGINT) as interruption, saved or nullcontext():
        try:
            if client is None:
                rendering.run(progress, lambda: bool(interruption), None, previews, 0, saved)
            else:
                from usdmlt.cluster import render as render_on

                render_on(client, rendering, progress, lambda: bool(interruption), previews, saved)
        finally:
            if saved is not None:
                try:
                    saved.write(rendering)
                except Error as error:  # for which the picture is not lost
                    logger.warning("%s", error)
    image = rendering.image()
    for last in previews:
        last.update(image)
    if interruption:
        raise Interrupted(image)
    return image


def read(
    stage: Usd.Stage | Scene | str | os.PathLike[str], options: dict[str, Any]
) -> tuple[Scene, dict[str, Any], dict[str, Any]]:
    """The scene, and the options apart: those of :class:`Settings`, those of :func:`usdmlt.load`.

    All of them are checked before anything is read.
    """
    names = {field.name for field in fields(Settings)}
    given = {name: value for name, value in options.items() if name in names}
    reading = {
        name: value for name, value in options.items() if name not in names and value is not None
    }
    settings = Settings(**given)
    check_resolution(reading.get("width"), reading.get("height"))
    if isinstance(stage, Scene):
        if reading:
            raise UsageError("a Scene has its own camera, frame and size: set them there")
        return stage, given, reading
    from usdmlt.stage import load

    return load(stage, **reading, primvars=settings.primvars), given, reading


def unreachable_light(scene: Scene, core_scene: _core.Scene, depth: int) -> dict[str, list[str]]:
    """The names of lights and materials between which paths are that no integrator can make.

    Light of one exact direction that smooth surfaces send to a rough one, and that is seen by way
    of smooth ones again, L S+ D … S+ E, has density zero under every technique. Empty where there
    is no such light or no smooth material, or where such paths are longer than ``depth`` edges.
    """
    lights, materials = core_scene.dirac_lights, core_scene.dirac_materials
    if not lights or not materials or depth < EDGES_OF_UNREACHABLE_PATHS:
        return {}
    return {
        "lights": [scene.lights[i].name for i in lights],
        "materials": [scene.materials[i].name for i in materials],
    }


def truncated_fraction(energies: Sequence[float]) -> float:
    """An estimate of the share of the light on paths longer than the depth limit.

    ``energies``: mean luminance by number of edges, from 0 to the limit. Beyond it the decay is
    continued as a geometric series: that from the second third of the lengths to the last third,
    which is many lengths where there are many, as single ones are noisy. Below five edges it is 0.
    """
    if len(energies) < 6:
        return 0.0
    third = max((len(energies) - 2) // 3, 2)
    last, before = sum(energies[-third:]), sum(energies[-2 * third : -third])
    total = sum(energies)
    if not total > 0 or not before > 0:
        return 0.0
    ratio = min(last / before, 0.99)
    tail = last * ratio / (1.0 - ratio)
    return tail / (total + tail)


@contextmanager
def no_warnings() -> Iterator[None]:
    """What a render would say about its picture is not said again for every seed."""
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _warn(stats: dict[str, Any]) -> None:
    """Warn about what makes the picture differ from what was asked for."""
    if stats["truncated_fraction"] > TRUNCATION_WARNED_ABOUT:
        logger.warning(
            "about %.1f %% of the light takes paths of more than %d edges and is missing: "
            "raise the depth",
            100 * stats["truncated_fraction"],
            stats["settings"]["depth"],
        )
    unreachable = stats["unreachable"]
    if unreachable:
        logger.warning(
            "light of one exact direction (%s) that smooth surfaces (%s) send to a rough one, and "
            "that is seen through smooth ones again, is missing: no integrator can find it; give "
            "the light an angle",
            _listed(unreachable["lights"]),
            _listed(unreachable["materials"]),
        )
    if stats["non_finite"]:
        logger.warning("%d contributions were not finite and were left out", stats["non_finite"])
    if stats["overflows"]:
        logger.warning(
            "%d contributions were too bright for the film and were cut", stats["overflows"]
        )


def _listed(names: Sequence[str]) -> str:
    """Names for a warning, the first few of them."""
    return str(Warning("", [name or "unnamed" for name in names])).removeprefix(": ")
