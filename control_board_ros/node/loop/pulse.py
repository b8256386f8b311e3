# SPDX-License-Identifier: Apache-2.0
"""Signs of life of the node's threads, and who watches them (SPEC B8)."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Set
from contextlib import suppress
from pathlib import Path

#: s between two looks, and without progress that are a hang.
CHECK_PERIOD, HANG_TIME = 0.1, 1.0
#: s of the processor that a thread uses between two looks at most if it is blocked.
MAX_BLOCKED_TIME = 1e-4
#: The threads of this process (Linux).
TASKS = Path("/proc/self/task")


class Pulse:
    """Progress of a thread that works in rounds.

    Attributes: rounds (begun so far), busy (in one of them; else it waits for work).
    """

    __slots__ = ("busy", "rounds")

    def __init__(self) -> None:
        self.rounds, self.busy = 0, False

    def __enter__(self) -> None:
        self.rounds += 1
        self.busy = True

    def __exit__(self, *_error: object) -> None:
        self.busy = False


class WatchedThread:
    """A thread with its pulse, as it was when it last made progress."""

    def __init__(self, thread: threading.Thread, pulse: Pulse) -> None:
        self.thread, self._pulse = thread, pulse
        self._rounds, self._blocked, self._begin, self._used = -1, 0.0, 0.0, 0.0

    def is_stuck(self) -> bool:
        """Whether it is in the same round as at the last look."""
        pulse = self._pulse
        if pulse.busy and pulse.rounds == self._rounds:
            return True
        self._rounds, self._blocked = pulse.rounds, 0.0
        self._begin = self._used = self._processor_time()
        return False

    def hangs(self, granted: float, ready: Set[int]) -> bool:
        """Whether its round takes too long: it is blocked, or computes without end.

        A thread that waits for a busy processor does neither, nor does one behind it.

        Args:
            granted: Time since the last look in which the process could go on, s.
            ready: Threads that run or wait for a processor.
        """
        before, self._used = self._used, self._processor_time()
        works = self.thread.native_id in ready or self._used - before >= MAX_BLOCKED_TIME
        self._blocked = 0.0 if works else self._blocked + granted
        return self._blocked >= HANG_TIME or self._used - self._begin >= HANG_TIME

    def _processor_time(self) -> float:
        ident = self.thread.ident
        if ident is None or not self.thread.is_alive():
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(ident))


def ready_threads() -> set[int]:
    """The other threads of this process that run or wait for a processor; where known (Linux)."""
    ready = set()
    with suppress(OSError):
        for task in TASKS.iterdir():
            with suppress(OSError):  # it has ended
                if (task / "stat").read_text().rpartition(")")[2].split()[0] == "R":
                    ready.add(int(task.name))
    return ready - {threading.get_native_id()}


class ThreadWatch:
    """Watches threads: one that ends or hangs ends the node.

    Args:
        threads: With their pulses, by name.
    """

    def __init__(self, threads: Mapping[str, tuple[threading.Thread, Pulse]]) -> None:
        self._threads = {name: WatchedThread(*pair) for name, pair in threads.items()}

    def wait(self, ended: threading.Event) -> str:
        """Wait for the end; returns the reason if it is a thread, else an empty text."""
        before, used_before = time.monotonic(), time.process_time()
        while not ended.wait(CHECK_PERIOD):
            now, used = time.monotonic(), time.process_time()
            # A process that was stopped as a whole did not hang.
            passed, before = min(now - before, 2.0 * CHECK_PERIOD), now
            worked, used_before = used - used_before, used
            stuck = []
            for name, watched in self._threads.items():
                if not watched.thread.is_alive() and not ended.is_set():
                    return f"the {name} thread ended"
                if watched.is_stuck():
                    stuck.append((name, watched))
            ready = ready_threads() if stuck else set()
            granted = min(passed, worked) if ready else passed
            for name, watched in stuck:
                if watched.hangs(granted, ready):
                    return f"the {name} thread hangs for {HANG_TIME:g} s"
        return ""
