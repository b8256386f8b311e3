# SPDX-License-Identifier: Apache-2.0
"""Parking before power-off: to the pose park (SPEC R6)."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ...core.goals.pose import Pose
from ...core.goals.pose_moves import start_parking
from ...core.selection import RequestError
from ..loop.loop import Member

#: Period in s at which the joints are checked (wall clock).
PERIOD = 0.02

PAUSED = "the simulation is paused; resume it first, with ~/pause"
SECOND_SIGNAL = "a second signal came"


def park(
    member: Member, pose: Pose, on_start: Callable[[float], None], at_once: threading.Event
) -> str:
    """Move to the pose park, in a thread of its own, until the end or until ``at_once`` is set.

    The caller can stop waiting at any time, also where the control loop hangs with its lock.
    ``on_start`` is called with the duration of the move, s.

    Returns:
        Why the robot is not parked; empty when it is.
    """
    reasons: list[str] = []

    def move() -> None:
        try:
            reasons.append(_move(member, pose, on_start, at_once))
        except RequestError as error:
            reasons.append(str(error))
        except Exception as error:  # noqa: BLE001 - told as the reason
            reasons.append(f"internal error, {type(error).__name__}: {error}")

    thread = threading.Thread(target=move, name="parking", daemon=True)
    thread.start()
    while thread.is_alive() and not at_once.is_set():
        thread.join(PERIOD)
    return reasons[0] if reasons else SECOND_SIGNAL


def _move(
    member: Member, pose: Pose, on_start: Callable[[float], None], left: threading.Event
) -> str:
    """Start and wait for the end; returns as ``park``."""
    if reason := _stopped(member):
        return reason
    with member.exclusive() as board:
        if left.is_set():  # while this thread waited for the lock
            return SECOND_SIGNAL
        task = start_parking(board, pose)
        time = task.remaining_time()
    on_start(time)
    while not left.wait(PERIOD):
        if reason := _stopped(member):
            return reason
        with member.exclusive():
            outcome = task.outcome()
        if outcome is not None:
            return "" if outcome.success else outcome.message
    return SECOND_SIGNAL


def _stopped(member: Member) -> str:
    """The reason why no joint moves; empty while time passes."""
    if member.loop.failure is not None:
        return "the control loop failed"
    return PAUSED if member.loop.paused else ""
