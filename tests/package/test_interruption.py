"""Signals are noted, and handed back afterwards."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from usdmlt.interruption import Interruption

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")


@pytest.mark.usefixtures("interruptible")
def test_a_signal_is_noted_and_the_handler_comes_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    with Interruption(signal.SIGINT) as interruption:
        assert not interruption
        os.kill(os.getpid(), signal.SIGINT)
        assert interruption.signal == signal.SIGINT
    assert signal.getsignal(signal.SIGINT) is before


def test_a_program_keeps_its_own_handler() -> None:
    received: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    try:
        with Interruption(signal.SIGINT) as interruption:
            os.kill(os.getpid(), signal.SIGINT)
        assert not interruption
        assert received == [signal.SIGINT]
    finally:
        signal.signal(signal.SIGINT, before)


def test_in_another_thread_it_does_nothing() -> None:
    failures: list[BaseException] = []

    def enter() -> None:
        try:
            with Interruption(signal.SIGINT):
                pass
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert not failures
