# SPDX-License-Identifier: Apache-2.0
"""Boards that fall silent while they are recorded: when to look for them anew, and what to note.

A middleware forgets a participant that it does not hear for its lease, and one that is held up or
cut off in one direction may not be told of it. So who hears nothing makes itself known anew.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from rclpy.serialization import serialize_message
from std_msgs.msg import String

#: s without a message of a board after which it is silent, and periods of its state at least.
PATIENCE, PERIODS = 5.0, 3.0
#: s between two times of looking for it anew, at first and at most.
SOONEST, LATEST = 5.0, 10.0


@dataclass(slots=True)
class Hearing:
    """A board: patience (s), last (when it was heard: s, monotonic), stamp (the same, ns of the
    system's clock), due (when to look for it anew, s), pause (s until the next time), silent.
    """

    patience: float
    last: float
    stamp: int
    due: float = 0.0
    pause: float = SOONEST
    silent: bool = False


class Gaps:
    """Notices which boards are silent.

    Args:
        rates: Of the states of each board, Hz.
        now: Time, s, monotonic.
        stamp: The same, ns of the system's clock.
    """

    def __init__(self, rates: Mapping[str, float], now: float, stamp: int) -> None:
        self._boards = {
            board: Hearing(max(PATIENCE, PERIODS / rate if rate > 0.0 else 0.0), now, stamp)
            for board, rate in rates.items()
        }

    @property
    def silent(self) -> list[str]:
        """The boards that are silent now."""
        return [board for board, hearing in self._boards.items() if hearing.silent]

    def heard(self, board: str, now: float, stamp: int) -> bytes:
        """A message of a board came; where it was silent the gap that ends, of GAPS, as CDR."""
        hearing = self._boards[board]
        before, was_silent = hearing.stamp, hearing.silent
        hearing.last, hearing.stamp = now, stamp
        if not was_silent:
            return b""
        hearing.silent, hearing.pause = False, SOONEST
        return gap(before, stamp)

    def look(self, now: float) -> bool:
        """Whether a silent board is to be looked for anew now; less often each time."""
        due = False
        for hearing in self._boards.values():
            if not hearing.silent and now - hearing.last >= hearing.patience:
                hearing.silent, hearing.due = True, now
            if hearing.silent and now >= hearing.due:
                hearing.due = now + hearing.pause
                hearing.pause = min(2.0 * hearing.pause, LATEST)
                due = True
        return due

    def running(self, stamp: int) -> dict[str, bytes]:
        """Gaps of boards that are silent to the end, by board."""
        return {board: gap(self._boards[board].stamp, stamp) for board in self.silent}


def gap(begin: int, end: int) -> bytes:
    """A message of GAPS; times in ns."""
    text = json.dumps({"begin": round(1e-9 * begin, 6), "end": round(1e-9 * end, 6)})
    return bytes(serialize_message(String(data=text)))
