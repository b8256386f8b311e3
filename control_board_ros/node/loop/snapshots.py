# SPDX-License-Identifier: Apache-2.0
"""Snapshots of a board with their stamps: frozen, replaced whole, read without a lock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from ...core.group import JointGroup
from ...core.state import Snapshot
from ...core.terms.faults import BoardEvent, FaultRecord
from ...core.terms.vocabs import ControlMode, InteractionMode
from .timing import TimeBase

EVENTS_KEPT = 1000
#: States and modes kept for a delayed publisher; older ones are lost.
MAX_QUEUED = 50


@dataclass(frozen=True, slots=True)
class StampedState:
    """A reading of the board; stamp in ns of ROS time."""

    snapshot: Snapshot
    stamp: int


@dataclass(frozen=True, slots=True)
class StampedModes:
    """The modes of all joints, since stamp (ns of ROS time)."""

    control: list[ControlMode]
    interaction: list[InteractionMode]
    stamp: int


@dataclass(frozen=True, slots=True)
class StampedFaults:
    """The last fault of every joint and when it was raised, as of stamp; ns of ROS time."""

    records: list[FaultRecord]
    raised: list[int]
    stamp: int

    def by_name(self) -> dict[str, tuple[FaultRecord, int]]:
        """The record of each joint, and when it was raised."""
        both = zip(self.records, self.raised, strict=True)
        return {record.name: (record, at) for record, at in both}


class Snapshots:
    """The newest snapshots of a board.

    The ``note`` methods are for callers holding the loop's lock, all others for any caller.

    Attributes: latest, modes, faults; states and mode_changes (not yet consumed, oldest
    first; the newest are ``latest`` and ``modes``); events (of the board, oldest first); on_change
    (called after a snapshot was replaced, from the thread that did it; must return immediately).
    """

    def __init__(self, board: JointGroup, base: TimeBase) -> None:
        self._board, self._base = board, base
        self.on_change: Callable[[], None] = lambda: None
        self.events: deque[BoardEvent] = deque(maxlen=EVENTS_KEPT)
        self.states: deque[StampedState] = deque(maxlen=MAX_QUEUED)
        self.mode_changes: deque[StampedModes] = deque(maxlen=MAX_QUEUED)
        self._modes_version = self._faults_version = -1
        self.latest: StampedState
        self.modes: StampedModes
        self.faults: StampedFaults
        self.note_changes()
        self.note_state()

    def note_state(self) -> None:
        """Replace ``latest`` and consume the board's events."""
        self.latest = StampedState(self._board.snapshot(), self.now())
        self.states.append(self.latest)
        self.events.extend(self._board.take_events())
        self.on_change()

    def note_changes(self) -> None:
        """Replace ``modes`` and ``faults`` where the board's have changed."""
        board = self._board
        if board.modes_version != self._modes_version:
            self._modes_version = board.modes_version
            control, interaction = board.get_control_mode(None), board.get_interaction_mode(None)
            self.modes = StampedModes(control, interaction, self.now())
            self.mode_changes.append(self.modes)
            self.on_change()
        if board.faults_version != self._faults_version:
            self._faults_version = board.faults_version
            records = board.get_faults(None)
            raised = [self._raised(j, record) for j, record in enumerate(records)]
            self.faults = StampedFaults(records, raised, self.now())
            self.on_change()

    def _raised(self, j: int, record: FaultRecord) -> int:
        """When a fault was raised, 0 for none; stable after the first report."""
        if record.code < 0:
            return 0
        if hasattr(self, "faults") and self.faults.records[j].stamp == record.stamp:
            return self.faults.raised[j]
        return self._base.stamp(record.stamp)

    def now(self) -> int:
        """ROS time of the board's last cycle, ns."""
        return self._base.stamp(self._board.time)
