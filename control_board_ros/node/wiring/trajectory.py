# SPDX-License-Identifier: Apache-2.0
"""~/joint_trajectory: messages to paths, which the core follows (SPEC T1 to T3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...core.goals.follower import Follower
from ...core.goals.path import MAX_POINTS, Points, make_path
from ...core.group import JointGroup
from ...core.selection import RequestError
from ...core.terms.reply import Reply
from ..loop.loop import ControlLoop
from ..loop.member import Member
from ..loop.time_base import TimeBase
from .messages import NANOSECONDS, bounded


def read_points(message: Any) -> Points:
    """The points of a JointTrajectory.

    Raises:
        RequestError: a point has effort.
    """
    points = message.points[: MAX_POINTS + 1]  # one too many is enough to refuse it
    for i, point in enumerate(points):
        if len(point.effort):
            raise RequestError(f"point {i} has effort, which is not followed; leave effort empty")
    return Points(
        [p.time_from_start.sec + p.time_from_start.nanosec / NANOSECONDS for p in points],
        [point.positions for point in points],
        [point.velocities for point in points],
        [point.accelerations for point in points],
    )


def start_time(stamp: Any, board: JointGroup, base: TimeBase) -> float:
    """When a trajectory with this stamp begins, time of the board, s; 0 means now."""
    nanoseconds = stamp.sec * NANOSECONDS + stamp.nanosec
    return (nanoseconds - base.offset) / NANOSECONDS if nanoseconds else board.time


def followed(loop: ControlLoop) -> Follower:
    """The follower of a loop's board, which the loop steps."""
    with loop.exclusive():
        follower = Follower(loop.board)
    loop.hooks.append(lambda _board, time: follower.step(time))
    loop.exclusive_hooks.append(follower.check)
    return follower


class TrajectoryTopic:
    """Passes trajectories to the follower, which the control loop steps.

    Args:
        member: whose joints follow.
        follower: of the board.
        warn: throttled log: a message and a name for its repetitions.
    """

    def __init__(
        self,
        member: Member,
        follower: Follower,
        warn: Callable[..., None],
    ) -> None:
        self._member, self._follower, self._warn = member, follower, warn

    def on_message(self, message: Any) -> None:
        """A trajectory; header.stamp is its start, 0 means now; without points: an end."""
        with self._member.exclusive() as board:
            reply = self._take(board, message)
        if reply is not None and reply.message:
            self._warn(f"trajectory: {reply.message}", "times" if reply else "ignored")

    def _take(self, board: JointGroup, message: Any) -> Reply | None:
        joints = bounded(message.joint_names, board.count)
        try:
            names = board.selector.select(joints).names
            if not message.points:
                self._follower.hold(names, "a trajectory without points came")
                return None
            path = make_path(names, *read_points(message))
        except RequestError as error:
            return board.reject(joints, f"refused, {error}")
        start = start_time(message.header.stamp, board, self._member.loop.time_base)
        return self._follower.follow(names, path, start)
