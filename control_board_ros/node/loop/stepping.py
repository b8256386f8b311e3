# SPDX-License-Identifier: Apache-2.0
"""Awaited control cycles: steps of a paused simulation, and the next cycle."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable


class Stepping:
    """Counts cycles down and calls who waits; for callers holding the loop's lock.

    Attributes: left (cycles that are still to run while the simulation is paused).
    """

    def __init__(self) -> None:
        self.left = 0
        self._on_steps: Callable[[str], None] | None = None
        self._on_cycle: deque[Callable[[], None]] = deque()

    def begin(self, cycles: int, on_done: Callable[[str], None], *, paused: bool) -> str:
        """Run ``steps`` cycles; returns an empty text, or the reason for a refusal.

        Args:
            cycles: how many, exactly.
            on_done: called after the last one with an empty text, or why they did not all run.
            paused: whether simulated time is stopped.
        """
        if not paused:
            return "step needs a paused simulation, and this one runs; pause it first: ~/pause"
        if self.left:
            return f"step refused: {self.left} cycles of the last one are still to run"
        if cycles <= 0:
            return f"steps: {cycles} is not allowed; a number of control cycles above 0"
        self.left, self._on_steps = cycles, on_done
        return ""

    def ended(self) -> Callable[[], None]:
        """All steps have run: what answers who requested them."""
        done, self._on_steps = self._on_steps, None
        return lambda: done("") if done is not None else None

    def count(self) -> bool:
        """One of the steps has run; whether it was the last one."""
        self.left -= 1
        return not self.left

    def finish(self, message: str) -> None:
        """Answer who requested the steps why they did not all run; none is left."""
        done, self._on_steps, self.left = self._on_steps, None, 0
        if done is not None:
            done(message)

    def on_cycle(self, done: Callable[[], None]) -> None:
        """Call ``done`` once, when a cycle has run."""
        self._on_cycle.append(done)

    def notify_cycle(self) -> None:
        """A cycle has run: call who waits for it."""
        while self._on_cycle:
            self._on_cycle.popleft()()
