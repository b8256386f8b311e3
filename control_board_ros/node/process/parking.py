# SPDX-License-Identifier: Apache-2.0
"""Parking before power-off: to the pose park (SPEC R6)."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ...core.goals.pose import Pose
from ...core.goals.poses import start_parking
from ...core.selection import RequestError
from ..loop.loop import Member

#: Period in s at which the joints are checked (wall clock).
PERIOD = 0.02

PAUSED = "the simulation is paused; resume it first, with: cbctl resume"


class Parking:
    """The move to the pose park, monitored by a thread of its own.

    The caller can stop waiting at any time, also where the control loop hangs with its lock.

    Args:
        member: the joints, all of them.
        pose: the target.
        on_start: called with the duration of the move, s.

    Attributes: reason (why the robot is not parked; empty when it is parked).
    """

    def __init__(self, member: Member, pose: Pose, on_start: Callable[[float], None]) -> None:
        self._member, self._pose, self._on_start = member, pose, on_start
        self._left = threading.Event()
        self.reason = "a second signal came"

    def run(self, at_once: threading.Event) -> None:
        """Park until the end or a failure, or until ``at_once`` is set."""
        thread = threading.Thread(target=self._watch, name="parking", daemon=True)
        thread.start()
        while thread.is_alive() and not at_once.is_set():
            thread.join(PERIOD)
        self._left.set()

    def _watch(self) -> None:
        try:
            reason = self._park()
        except RequestError as error:
            reason = str(error)
        if not self._left.is_set():
            self.reason = reason

    def _park(self) -> str:
        """Start and wait for the end; returns the reason of a failure, or an empty text."""
        member = self._member
        if reason := self._stopped():
            return reason
        with member.exclusive() as board:
            if self._left.is_set():  # while this thread waited for the lock
                return self.reason
            task = start_parking(board, self._pose)
            time = task.remaining_time()
        self._on_start(time)
        while not self._left.wait(PERIOD):
            if reason := self._stopped():
                return reason
            with member.exclusive():
                outcome = task.outcome()
            if outcome is not None:
                return "" if outcome.success else outcome.message
        return self.reason

    def _stopped(self) -> str:
        """The reason why no joint moves; empty while time passes."""
        if self._member.loop.failure is not None:
            return "the control loop failed"
        return PAUSED if self._member.loop.paused else ""
