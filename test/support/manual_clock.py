# SPDX-License-Identifier: Apache-2.0
"""A clock of a bus without real time."""

from __future__ import annotations

from control_board_ros.plants.drives.clock import Clock


class ManualClock(Clock):
    """Seconds that pass only when they are told to, for a bus without real time."""

    def __init__(self, start: float = 1e6) -> None:
        self.time = start

    def now(self) -> float:
        return self.time

    def pass_by(self, seconds: float) -> None:
        """Let time pass, s."""
        self.time += max(0.0, seconds)
