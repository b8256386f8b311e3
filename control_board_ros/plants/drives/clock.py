# SPDX-License-Identifier: Apache-2.0
"""The one clock of a bus: its line, its plant and, where there is one, its virtual world."""

from __future__ import annotations

import time


class Clock:
    """Seconds of the computer's monotonic clock."""

    def now(self) -> float:
        return time.monotonic()

    def pass_by(self, seconds: float) -> None:
        """Let time pass, s."""
        time.sleep(max(0.0, seconds))
