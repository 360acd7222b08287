"""Signals that ask a render to stop: it ends between units and keeps what was done."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any


class Interruption:
    """While entered, the given signals are noted in ``signal`` instead of taking effect.

    Only the main thread receives signals; entered in another one it does nothing. A handler that
    the program installed itself is left alone, unless ``always``.
    """

    def __init__(self, *signals: signal.Signals, always: bool = False) -> None:
        self.signal: signal.Signals | None = None
        self._signals = signals
        self._always = always
        self._previous: dict[signal.Signals, Any] = {}

    def __bool__(self) -> bool:
        """Whether a signal came."""
        return self.signal is not None

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in self._signals:
                present = signal.getsignal(number)
                if self._always or present in (signal.SIG_DFL, signal.default_int_handler):
                    self._previous[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._previous.clear()

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.signal is None:
            self.signal = signal.Signals(number)
