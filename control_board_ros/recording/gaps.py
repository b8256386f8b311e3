# SPDX-License-Identifier: Apache-2.0
"""Connection losses during a recording: time of reconnection, record of the gap.

A middleware drops a participant not received for its lease, and may not notify one that is paused
or cut off in one direction. So a receiver without messages reconnects.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from rclpy.serialization import serialize_message
from std_msgs.msg import String

#: s without a message until a board is silent, and minimum periods of its state.
PATIENCE, PERIODS = 5.0, 3.0
#: s between reconnections, initially and at most.
SOONEST, LATEST = 5.0, 10.0


@dataclass(slots=True)
class _Reception:
    """A board: patience (s), last (reception: s, monotonic), stamp (the same, ns of the system's
    clock), due (next reconnection, s), pause (s between reconnections), silent.
    """

    patience: float
    last: float
    stamp: int
    due: float = 0.0
    pause: float = SOONEST
    silent: bool = False


class Gaps:
    """Detects silent boards.

    Args:
        rates: Of the states of each board, Hz.
        now: Time, s, monotonic.
        stamp: The same, ns of the system's clock.
    """

    def __init__(self, rates: Mapping[str, float], now: float, stamp: int) -> None:
        self._boards = {
            board: _Reception(max(PATIENCE, PERIODS / rate if rate > 0.0 else 0.0), now, stamp)
            for board, rate in rates.items()
        }

    @property
    def silent(self) -> list[str]:
        """The silent boards."""
        return [board for board, reception in self._boards.items() if reception.silent]

    def received(self, board: str, now: float, stamp: int) -> bytes:
        """Record a message of a board; returns the gap that it ends, of GAPS, as CDR."""
        reception = self._boards[board]
        before, was_silent = reception.stamp, reception.silent
        reception.last, reception.stamp = now, stamp
        if not was_silent:
            return b""
        reception.silent, reception.pause = False, SOONEST
        return gap(before, stamp)

    def look(self, now: float) -> bool:
        """Whether to reconnect to a silent board now, at growing intervals."""
        due = False
        for reception in self._boards.values():
            if not reception.silent and now - reception.last >= reception.patience:
                reception.silent, reception.due = True, now
            if reception.silent and now >= reception.due:
                reception.due = now + reception.pause
                reception.pause = min(2.0 * reception.pause, LATEST)
                due = True
        return due

    def running(self, stamp: int) -> dict[str, bytes]:
        """Gaps of boards silent at the end, by board."""
        return {board: gap(self._boards[board].stamp, stamp) for board in self.silent}


def gap(begin: int, end: int) -> bytes:
    """A message of GAPS; times in ns."""
    text = json.dumps({"begin": round(1e-9 * begin, 6), "end": round(1e-9 * end, 6)})
    return bytes(serialize_message(String(data=text)))
