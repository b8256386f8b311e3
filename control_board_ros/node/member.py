# SPDX-License-Identifier: Apache-2.0
"""A board as its node has it: under the lock of the loop that runs it, with its snapshots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Generic

from .fair_lock import B_co, Exclusive, FairLock
from .snapshots import Snapshots

if TYPE_CHECKING:
    from .loop import ControlLoop


class Member(Generic[B_co]):
    """A board that a control loop runs: the whole one, or a part of it.

    Attributes: loop, board (to be touched within :meth:`exclusive` only), snapshots.
    """

    def __init__(self, loop: ControlLoop[Any], board: B_co, lock: FairLock) -> None:
        self.loop, self.board = loop, board
        self.snapshots = Snapshots(board, loop.time_base)
        self.snapshots.note_changes()
        self.snapshots.note_state()
        self._exclusive = Exclusive(lock, board, loop.end_exclusive)

    def exclusive(self) -> Exclusive[B_co]:
        """Hold the loop's lock, between two cycles: ``with member.exclusive() as board``."""
        return self._exclusive

    def power_cycle(self) -> None:
        """Back to power-on; shown also where the next cycle configures the board."""
        with self.exclusive() as board:
            board.power_cycle()
            self.loop.note_changes()
