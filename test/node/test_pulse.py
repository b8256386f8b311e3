# SPDX-License-Identifier: Apache-2.0
"""Threads are watched: B8."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from control_board_ros.node.loop import pulse as module
from control_board_ros.node.loop.pulse import Pulse, ThreadWatch


@contextmanager
def working(work: Callable[[Pulse, threading.Event], None]) -> Iterator[ThreadWatch]:
    """A watched thread at work, until its event is set."""
    pulse, stop = Pulse(), threading.Event()
    thread = threading.Thread(target=work, args=(pulse, stop), daemon=True)
    thread.start()
    yield ThreadWatch({"state": (thread, pulse)})
    stop.set()
    thread.join()


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "HANG", 0.3)


def ended_after(seconds: float) -> threading.Event:
    ended = threading.Event()
    threading.Timer(seconds, ended.set).start()
    return ended


def rounds(pulse: Pulse, stop: threading.Event) -> None:
    while not stop.wait(0.01):
        with pulse:
            pass


def idle(pulse: Pulse, stop: threading.Event) -> None:
    with pulse:
        pass
    stop.wait()


def blocked(pulse: Pulse, stop: threading.Event) -> None:
    with pulse:
        stop.wait()


def endless(pulse: Pulse, stop: threading.Event) -> None:
    with pulse:
        while not stop.is_set():
            pass


def failing(pulse: Pulse, _stop: threading.Event) -> None:
    with pulse:
        pass


@pytest.mark.parametrize("work", [rounds, idle])
def test_a_thread_that_goes_on_or_waits_for_work_is_well(
    work: Callable[[Pulse, threading.Event], None],
) -> None:
    with working(work) as watch:
        assert watch.wait(ended_after(1.0)) == ""


@pytest.mark.parametrize(
    ("work", "reason"),
    [
        (blocked, "the state thread hangs for 0.3 s"),
        (endless, "the state thread hangs for 0.3 s"),
        (failing, "the state thread ended"),
    ],
)
def test_a_thread_that_hangs_or_ends_is_the_reason(
    work: Callable[[Pulse, threading.Event], None], reason: str
) -> None:
    with working(work) as watch:
        assert watch.wait(threading.Event()) == reason
