# SPDX-License-Identifier: Apache-2.0
"""Signs of life of the node's threads, and who watches them (SPEC B8)."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

#: s between two looks, and without progress that are a hang.
LOOK, HANG = 0.1, 1.0
#: s of the processor that a thread uses in HANG at most if it is blocked.
BLOCKED = 1e-3


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


class Watched:
    """A thread with its pulse, as it was when it last made progress."""

    def __init__(self, thread: threading.Thread, pulse: Pulse) -> None:
        self.thread, self._pulse = thread, pulse
        self._rounds, self._since, self._used = -1, 0.0, 0.0

    def hangs(self, passed: float) -> bool:
        """Whether its round takes too long: it is blocked, or computes without end.

        A thread that waits for a busy processor does neither.

        Args:
            passed: Time since the last look, s.
        """
        pulse = self._pulse
        if not pulse.busy or pulse.rounds != self._rounds:
            self._rounds, self._since, self._used = pulse.rounds, 0.0, self._processor_time()
            return False
        self._since += passed
        used = self._processor_time() - self._used
        return self._since >= HANG and (used < BLOCKED or used >= HANG)

    def _processor_time(self) -> float:
        ident = self.thread.ident
        if ident is None or not self.thread.is_alive():
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(ident))


class ThreadWatch:
    """Watches threads: one that ends or hangs ends the node.

    Args:
        threads: With their pulses, by name.
    """

    def __init__(self, threads: Mapping[str, tuple[threading.Thread, Pulse]]) -> None:
        self._threads = {name: Watched(*one) for name, one in threads.items()}

    def wait(self, ended: threading.Event) -> str:
        """Wait for the end; returns the reason if it is a thread, else an empty text."""
        before = time.monotonic()
        while not ended.wait(LOOK):
            now = time.monotonic()
            # A process that was stopped as a whole did not hang.
            passed, before = min(now - before, 2.0 * LOOK), now
            for name, watched in self._threads.items():
                if not watched.thread.is_alive() and not ended.is_set():
                    return f"the {name} thread ended"
                if watched.hangs(passed):
                    return f"the {name} thread hangs for {HANG:g} s"
        return ""
