# SPDX-License-Identifier: Apache-2.0
"""Threads are watched: B8."""

from __future__ import annotations

import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from waiting import until

from control_board_ros.node.loop import pulse as module
from control_board_ros.node.loop.pulse import TASKS, Pulse, ThreadWatch, ready_threads


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
    monkeypatch.setattr(module, "HANG_TIME", 0.3)


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


def worked(pulse: Pulse, stop: threading.Event) -> None:
    """Some milliseconds, then blocked."""
    with pulse:
        compress(20)
        stop.wait()


def endless(pulse: Pulse, stop: threading.Event) -> None:
    with pulse:
        while not stop.is_set():
            pass


def failing(pulse: Pulse, _stop: threading.Event) -> None:
    with pulse:
        pass


def compress(times: int = 1) -> None:
    """Use the processor without the interpreter."""
    for _ in range(times):
        zlib.compress(bytes(1_000_000))


@pytest.mark.parametrize("work", [rounds, idle])
def test_a_thread_that_goes_on_or_waits_for_work_is_well(
    work: Callable[[Pulse, threading.Event], None],
) -> None:
    with working(work) as watch:
        assert watch.wait(ended_after(1.0)) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "reason"),
    [
        (blocked, "the state thread hangs for 0.3 s"),
        (worked, "the state thread hangs for 0.3 s"),
        (endless, "the state thread hangs for 0.3 s"),
        (failing, "the state thread ended"),
    ],
)
def test_a_thread_that_hangs_or_ends_is_the_reason(
    work: Callable[[Pulse, threading.Event], None], reason: str
) -> None:
    with working(work) as watch:
        assert watch.wait(threading.Event()) == reason


@pytest.mark.slow
def test_a_thread_that_waits_for_a_processor_does_not_hang(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However busy the others are: it needs one, and has none."""

    def all_of_them() -> set[int]:
        compress()
        return {one.native_id for one in threading.enumerate() if one.native_id}

    monkeypatch.setattr(module, "ready_threads", all_of_them)
    with working(blocked) as watch:
        assert watch.wait(ended_after(1.0)) == ""


@pytest.mark.slow
def test_a_thread_behind_one_that_waits_for_a_processor_does_not_hang(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The process gets next to nothing: who is blocked waits as long as who holds the lock."""
    monkeypatch.setattr(module, "ready_threads", lambda: {1})
    with working(blocked) as watch:
        assert watch.wait(ended_after(1.0)) == ""


@pytest.mark.slow
def test_a_hang_beside_threads_that_work_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def busy() -> set[int]:
        compress(5)
        return {1}

    monkeypatch.setattr(module, "ready_threads", busy)
    with working(blocked) as watch:
        assert watch.wait(threading.Event()) == "the state thread hangs for 0.3 s"


@pytest.mark.skipif(not TASKS.exists(), reason="the system does not show its threads")
def test_threads_that_work_are_known() -> None:
    stop = threading.Event()

    def work() -> None:
        while not stop.is_set():
            compress()

    waiting = threading.Thread(target=stop.wait)
    busy = threading.Thread(target=work)
    waiting.start()
    busy.start()
    try:
        until(lambda: busy.native_id in ready_threads())
        until(lambda: waiting.native_id not in ready_threads())
        assert threading.get_native_id() not in ready_threads()
    finally:
        stop.set()
