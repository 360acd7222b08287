"""What is shown of a picture while it renders, now and then."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from time import perf_counter

from usdmlt.errors import Error, UsageError
from usdmlt.image import Image

logger = logging.getLogger("usdmlt")

FIRST_SECONDS = 0.5  # until the first picture, which is worth seeing soon


class Preview:
    """Calls ``show(image)`` every so many seconds of rendering; the first time sooner.

    If that fails there is a warning, and no more calls: a render is not lost for a picture of it.
    ``show`` should take a fraction of the time between calls, as the render waits for it.
    """

    def __init__(self, show: Callable[[Image], None], seconds: float) -> None:
        if not (seconds > 0 and math.isfinite(seconds)):
            raise UsageError(f"the seconds between previews must be positive, not {seconds}")
        self.show = show
        self.seconds = seconds
        self.failed = False
        self._due: float | None = None

    def wait(self, now: float) -> float:
        """Seconds from ``now`` until it is due; infinite after a failure."""
        if self._due is None:
            self._due = now + min(self.seconds, FIRST_SECONDS)
        return math.inf if self.failed else self._due - now

    def update(self, image: Image) -> None:
        """Show the picture; the next one is due ``seconds`` later."""
        if self.failed:
            return
        try:
            self.show(image)
        except Error as error:
            logger.warning("%s; the render goes on without it", error)
            self.failed = True
        self._due = perf_counter() + self.seconds
