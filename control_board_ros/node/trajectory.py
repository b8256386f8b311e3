# SPDX-License-Identifier: Apache-2.0
"""~/joint_trajectory: the points of a planner, followed in POSITION_DIRECT.

Between two points the reference runs along a cubic where both give velocities, else along a
straight line; every control cycle gets its own direct position. A new trajectory replaces the
old one, an empty one ends it, and so does anybody else's direct position or another mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.board import Board
from ..core.reply import Reply
from ..core.selection import RequestError
from ..core.vocabs import CommandKind
from .loop import ControlLoop
from .messages import NANOSECONDS, chosen

Array = NDArray[np.float64]

MAX_POINTS = 10_000


@dataclass(frozen=True, slots=True)
class Path:
    """Points of some joints over time.

    Attributes: names (of the k joints), times (s from the start, rising, shape (m,)), positions
    (rad, shape (m, k)), velocities (rad/s, shape (m, k); None: straight lines).
    """

    names: tuple[str, ...]
    times: Array
    positions: Array
    velocities: Array | None

    def at(self, time: float) -> Array:
        """Positions at a time, shape (k,); before the first and after the last point, theirs.

        On the segment from t0 to t1, with s = (t − t0)/(t1 − t0) and T = t1 − t0, either
        q = q0 + s (q1 − q0), or the cubic Hermite polynomial of q0, q1, T v0 and T v1.
        """
        after = int(np.searchsorted(self.times, time, side="right"))
        if after == 0 or after == len(self.times):
            edge: Array = self.positions[min(after, len(self.times) - 1)]
            return edge
        t0, t1 = self.times[after - 1], self.times[after]
        q0, q1 = self.positions[after - 1], self.positions[after]
        s, period = (time - t0) / (t1 - t0), t1 - t0
        if self.velocities is None:
            line: Array = q0 + s * (q1 - q0)
            return line
        v0, v1 = period * self.velocities[after - 1], period * self.velocities[after]
        cubic: Array = (
            (2 * s**3 - 3 * s**2 + 1) * q0
            + (s**3 - 2 * s**2 + s) * v0
            + (3 * s**2 - 2 * s**3) * q1
            + (s**3 - s**2) * v1
        )
        return cubic


def read_path(board: Board, message: Any) -> Path:
    """The path of a JointTrajectory, beginning with the joints' present references.

    Raises:
        RequestError: unknown joints, lengths that do not fit, times that do not rise, numbers
            that are not finite.
    """
    names = board.selector.select(chosen(message.joint_names, board.count)).names
    points = message.points
    if len(points) > MAX_POINTS:
        raise RequestError(f"{len(points)} points; a trajectory has up to {MAX_POINTS}")
    times = [p.time_from_start.sec + p.time_from_start.nanosec / NANOSECONDS for p in points]
    if any(b <= a for a, b in zip([-1e-9, *times], times, strict=False)):
        raise RequestError("time_from_start must rise from point to point, from 0 on")
    positions = _field(points, "positions", len(names))
    velocities = None
    if all(len(point.velocities) for point in points):
        velocities = _field(points, "velocities", len(names))
    if times[0] > 0.0:
        start = board.snapshot().position_reference[board.selector.select(names).joints]
        times.insert(0, 0.0)
        positions = np.vstack([start, positions])
        if velocities is not None:
            velocities = np.vstack([np.zeros(len(names)), velocities])
    return Path(names, np.array(times), positions, velocities)


def _field(points: Any, name: str, count: int) -> Array:
    rows = [getattr(point, name) for point in points]
    for index, row in enumerate(rows):
        if len(row) != count:
            raise RequestError(
                f"point {index} has {len(row)} {name} for {count} joints; send one per joint"
            )
    values: Array = np.array(rows, dtype=np.float64)
    if not np.isfinite(values).all():
        raise RequestError(f"{name} must be finite numbers")
    return values


class TrajectoryFollower:
    """Follows one trajectory at a time; a hook of the control loop.

    Args:
        loop: whose board follows.
        complain: takes a message for the throttled log; not called from the control thread.
    """

    def __init__(self, loop: ControlLoop, complain: Callable[[str], None]) -> None:
        self._loop, self._complain = loop, complain
        self._path: Path | None = None
        self._start = 0.0
        self._last = np.empty(0)
        loop.hooks.append(self._follow)

    def on_message(self, message: Any) -> None:
        """A trajectory; header.stamp says when it begins, 0 and the past mean now."""
        with self._loop.exclusive() as board:
            if not message.points:
                self._path = None
                return
            try:
                path = read_path(board, message)
            except RequestError as error:
                self._complain(f"trajectory ignored: {error}")
                return
            stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
            wait = (stamp - self._loop.records.ros_offset()) / NANOSECONDS - board.time
            if wait > 0.0 and stamp:
                self._start = board.time + wait
            else:
                self._start = board.time
            reply = self._send(board, path, path.positions[0])
            self._path = path if reply else None
        if not reply:
            self._complain(f"trajectory not followed: {reply.message}")

    def _follow(self, board: Board, time: float) -> None:
        """Send the reference of this cycle (the hook)."""
        path = self._path
        if path is None:
            return
        joints = board.selector.select(path.names).joints
        if not board.accepts[CommandKind.POSITION_DIRECT, joints].all():
            self._path = None
            self._loop.tell("warning", "trajectory ended: a joint left POSITION_DIRECT")
        elif (board.get_ref_position(path.names) != self._last).any():
            self._path = None  # somebody else's direct position counts from now on
        elif time >= self._start:
            elapsed = time - self._start
            if not self._send(board, path, path.at(elapsed)) or elapsed >= path.times[-1]:
                self._path = None

    def _send(self, board: Board, path: Path, positions: Array) -> Reply:
        reply = board.set_position(path.names, positions)
        self._last = board.get_ref_position(path.names)
        return reply
