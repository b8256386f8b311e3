# SPDX-License-Identifier: Apache-2.0
"""~/joint_trajectory: messages to paths, which the core follows (SPEC T1 to T3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..core.board import Board
from ..core.follower import Follower
from ..core.path import MAX_POINTS, Points, make_path
from ..core.robot import AnyBoard
from ..core.robot_trajectory import RobotFollower
from ..core.selection import RequestError
from .member import Member
from .messages import NANOSECONDS, bounded
from .time_base import TimeBase


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


def start_time(stamp: Any, board: AnyBoard, base: TimeBase) -> float:
    """When a trajectory with this stamp begins, time of the board, s; 0 means now."""
    nanoseconds = stamp.sec * NANOSECONDS + stamp.nanosec
    return (nanoseconds - base.offset) / NANOSECONDS if nanoseconds else board.time


def followed(member: Member[Board]) -> Follower:
    """A follower of a board, which the control loop steps; for callers holding the loop's lock."""
    with member.exclusive() as board:
        follower = Follower(board)
    member.loop.hooks.append(lambda _board, time: follower.step(time))
    member.loop.exclusive_hooks.append(follower.check)
    return follower


class TrajectoryTopic:
    """Takes trajectories and lets the control loop follow them.

    Args:
        member: whose board follows, or whose robot.
        follower: of the board or robot.
        warn: takes a message for the throttled log.
    """

    def __init__(
        self,
        member: Member[AnyBoard],
        follower: Follower | RobotFollower,
        warn: Callable[[str], None],
    ) -> None:
        self._member, self._follower, self._warn = member, follower, warn

    def on_message(self, message: Any) -> None:
        """A trajectory; header.stamp says when it begins, 0 means now; without points: an end."""
        with self._member.exclusive() as board:
            text = self._take(board, message)
        if text:
            self._warn(f"trajectory: {text}")

    def _take(self, board: AnyBoard, message: Any) -> str:
        joints = bounded(message.joint_names, board.count)
        try:
            names = board.selector.select(joints).names
            if not message.points:
                self._follower.hold(names, "a trajectory without points came")
                return ""
            path = make_path(names, *read_points(message))
        except RequestError as error:
            return board.reject(joints, f"refused, {error}").message
        start = start_time(message.header.stamp, board, self._member.loop.time_base)
        return self._follower.follow(names, path, start).message
