"""One picture of `usdmlt render`: from its scene to its files, wherever it is rendered."""

from __future__ import annotations

import argparse
import json
import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from usdmlt.cli.asked import Asked
from usdmlt.cli.long import chunk, tell_how_to_go_on
from usdmlt.cli.pictures import Pictures
from usdmlt.errors import Error
from usdmlt.settings import merged

if TYPE_CHECKING:
    from usdmlt.image import Image
    from usdmlt.rendering import Progress, Rendering

logger = logging.getLogger("usdmlt")


@dataclass(frozen=True)
class Job:
    """One picture: when, of which product (None: the first), and the files it goes to."""

    frame: float | Literal["default"] | None
    product: str | None
    output: str
    stats: str | None
    checkpoint: str | None


class Work:
    """A picture that is ready to be rendered: its stage is read, and its checkpoint.

    ``range``: the units that are to be rendered; ``previews`` and ``checkpoint`` are for
    :meth:`usdmlt.Rendering.run`.
    """

    def __init__(
        self, arguments: argparse.Namespace, asked: Asked, job: Job, pictures: Pictures
    ) -> None:
        from usdmlt import units
        from usdmlt.checkpoint import open_checkpoint, settings_to_resume
        from usdmlt.cli.progress import display_reading
        from usdmlt.rendering import Rendering
        from usdmlt.stage import load

        self.job = job
        self._arguments, self._pictures = arguments, pictures
        options = dict(asked.options)
        if job.frame is not None:
            options["frame"] = job.frame
        if job.product is not None:
            options["product"] = job.product
        self.checkpoint, before = open_checkpoint(
            job.checkpoint, arguments.resume, arguments.checkpoint_seconds
        )
        with display_reading(arguments.progress, arguments.verbosity < 0) as reading:
            scene = load(asked.stage, progress=reading, **options)
        settings = merged(scene.settings, asked.settings)
        if before is not None:
            settings = settings_to_resume(settings, before)
        self.rendering: Rendering = Rendering(scene, settings)
        pictures.check_layers(self.rendering.layers, job.output)
        self.range = chunk(arguments, self.rendering, asked.until)
        logger.info("%s", _description(asked.stage, self.rendering))
        if self.checkpoint is not None and before is not None:
            self.checkpoint.restore(self.rendering, before)
            logger.info(
                "%s has units %s", self.checkpoint.path, units.describe(self.rendering.units)
            )
        with ExitStack() as stack:
            if self.checkpoint is not None:
                stack.enter_context(self.checkpoint)
            self.previews = stack.enter_context(pictures.previews(job.output))
            self._end = stack.pop_all()

    def run(self, stop: Callable[[], bool], progress: Callable[[Progress], None] | None) -> None:
        """Render it here."""
        first, last = self.range
        self.rendering.run(progress, stop, last, self.previews, first, self.checkpoint)

    def finish(self) -> None:
        """Write the checkpoint, the picture of the work so far and its statistics.

        :class:`usdmlt.Error` where one of them cannot be written; the others are, if they can.
        """
        with self._end:
            unsaved: Error | None = None
            if self.checkpoint is not None:
                try:
                    self.checkpoint.write(self.rendering)
                except Error as error:
                    unsaved = error  # the picture may find room
            if self.rendering.units_done:
                self._write(is_saved=self.checkpoint is not None and unsaved is None)
            else:
                logger.warning("stopped before any work was done: nothing was written")
            if unsaved:
                raise unsaved
        tell_how_to_go_on(self.range, self.rendering, self.checkpoint)

    def _write(self, is_saved: bool) -> None:
        from usdmlt import files

        image = self.rendering.image()
        try:
            self._write_image(image)
        except Error as error:
            if self.checkpoint is None or not is_saved:
                raise
            raise Error(f"{error}; {self.checkpoint.path} has the work, to --resume") from None
        logger.info("%s", _outcome(self.job.output, self.rendering, image.stats))
        if self.job.stats:
            files.write_text(self.job.stats, json.dumps(image.stats, indent=2) + "\n")
        if self._arguments.memstats:
            from usdmlt.cli.memory import memory_report

            logger.info("%s", memory_report(self.rendering.scene))

    def _write_image(self, image: Image) -> None:
        if self._arguments.units is None:
            self._pictures.write(image, self.job.output)
            return
        from usdmlt import parts

        parts.write(self.job.output, self.rendering.part(), self._arguments.compression)


def _description(stage: str, rendering: Rendering) -> str:
    """What will be rendered and how, defaults included."""
    scene, settings = rendering.scene, rendering.settings
    limits = []
    unlimited = settings.time is None and settings.target_error is None
    if unlimited or settings.samples or settings.mutations:
        limits.append(f"{settings.resolved_samples} {_samples(rendering)}")
    if settings.time is not None:
        limits.append(f"{settings.time:g} s")
    if settings.target_error is not None:
        limits.append(f"error {settings.target_error:g}")
    why = f" (auto: {rendering.choice.reason})" if settings.integrator == "auto" else ""
    return (
        f"{stage}: camera {scene.camera.name or '(automatic)'}, {scene.width}x{scene.height}, "
        f"{rendering.integrator}{why}, {' or '.join(limits)}, depth {settings.depth}, "
        f"{settings.filter} filter, seed {settings.seed}, threads {settings.resolved_threads}"
    )


def _samples(rendering: Rendering) -> str:
    """What the integrator's budget counts."""
    return "mutations per pixel" if rendering.integrator == "mlt" else "samples per pixel"


def _outcome(output: str, rendering: Rendering, stats: dict[str, Any]) -> str:
    """What was written, and how much of the work is in it."""
    from usdmlt import units

    share = (
        "all units"
        if rendering.units_done == rendering.units_total
        else f"units {units.describe(rendering.units)}"
    )
    return (
        f"wrote {output}: {round(stats['samples_per_pixel'], 1):g} {_samples(rendering)} ({share}) "
        f"in {stats['seconds']:.1f} s"
    )
