# SPDX-License-Identifier: Apache-2.0
"""Joints as their node has them: under the lock of the loop that runs them, with snapshots."""

from __future__ import annotations

from ...core.group import JointGroup
from .fair_lock import Exclusive
from .loop import ControlLoop


class Member:
    """A group of joints that a control loop runs: the whole board, or a part of it.

    Attributes: loop, board (the group; to be touched within :meth:`exclusive` only), snapshots.
    """

    def __init__(self, loop: ControlLoop, group: JointGroup) -> None:
        self.loop, self.board = loop, group
        self.snapshots = loop.snapshots_of(group)
        self._exclusive = loop.exclusive_of(group)

    def exclusive(self) -> Exclusive:
        """Hold the loop's lock, between two cycles: ``with member.exclusive() as board``."""
        return self._exclusive

    def power_cycle(self) -> None:
        """Back to power-on; shown also where the next cycle configures the joints."""
        with self.exclusive() as board:
            board.power_cycle()
            self.loop.note_changes()
