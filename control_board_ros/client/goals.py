# SPDX-License-Identifier: Apache-2.0
"""The actions of the board: moves and calibrations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from control_board_ros.core.calibration.calibrations import CalibrationStatus
from control_board_ros.core.selection import RequestError, spread
from control_board_ros.core.terms.modes import CALIBRATES
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import parse_control_mode
from control_board_ros.interface import (
    CALIBRATE,
    FOLLOW_JOINT_TRAJECTORY,
    GET_CONTROL_MODE,
    MOVE,
)
from control_board_ros.protocols import Floats, Joints, Values

from .errors import BoardError
from .operations import Interface, operation, request
from .state import seconds


@dataclass(frozen=True, slots=True, eq=False)
class MoveFeedback:
    """Progress of a move.

    Attributes:
        names: of the joints that move.
        positions: measured, rad, shape (k,).
        remaining_time: until the last arrival, s.
    """

    names: tuple[str, ...]
    positions: Floats
    remaining_time: float


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationFeedback:
    """Progress of a calibration.

    Attributes:
        names: of the joints that are calibrated.
        progress: from 0 to 1, shape (k,).
        phase: current phase, for display.
    """

    names: tuple[str, ...]
    progress: Floats
    phase: str


class Goals(Interface):
    """The actions, and the status of calibrations."""

    @request
    async def move(
        self,
        joints: Joints,
        positions: Values,
        speeds: Values | None = None,
        feedback: Callable[[MoveFeedback], None] | None = None,
    ) -> Reply:
        """Move along minimum-jerk profiles and wait for the end.

        An interruption (Ctrl-C, a cancelled task) cancels the goal, which stops the joints, and is
        raised again.

        Args:
            joints: that move.
            positions: targets, rad; one for all joints, or shape (k,).
            speeds: mean speeds, rad/s, likewise; None: the set reference speeds.
            feedback: called in the caller's thread.
        """
        selection = await self._services.select(joints)
        count = len(selection.names)
        fields = {
            "names": list(selection.names),
            "positions": spread(positions, count, "position references").tolist(),
            "speeds": [] if speeds is None else spread(speeds, count, "speeds").tolist(),
        }

        def read(sent: Any) -> MoveFeedback:
            return MoveFeedback(tuple(sent.names), np.array(sent.positions), sent.remaining_time)

        return await self._services.goal(MOVE).run(fields, selection.names, feedback, read)

    @request
    async def follow_trajectory(
        self,
        joints: Joints,
        times: Values,
        positions: Values,
        velocities: Values | None = None,
        feedback: Callable[[float], None] | None = None,
        *,
        attended: bool = False,
    ) -> Reply:
        """Follow a trajectory in POSITION_DIRECT and wait for the end (T1).

        Interrupted, it cancels the goal, which stops the joints, and raises the interruption
        again.

        Args:
            joints: that follow it.
            times: of its points from its start, s, rising, shape (n,).
            positions: rad, shape (n, k).
            velocities: rad/s, shape (n, k); None: linear in between, else cubic.
            feedback: called with the time from its start, s, in the caller's thread.
            attended: whether the board stops the joints where it does not hear of this program
                for 2 s, as when it was killed; else the trajectory goes on to its end.
        """
        selection = await self._services.select(joints)
        points = trajectory(selection.names, times, positions, velocities)
        goal = self._services.goal(
            FOLLOW_JOINT_TRAJECTORY,
            outcome=lambda result: (result.error_code == 0, result.error_string, ()),
        )
        fields = {"trajectory": points}
        return await goal.run(
            fields,
            selection.names,
            feedback,
            lambda sent: seconds(sent.desired.time_from_start),
            attended=attended,
        )

    @request
    async def calibrate(
        self,
        joints: Joints = None,
        *,
        wait: bool = True,
        feedback: Callable[[CalibrationFeedback], None] | None = None,
    ) -> Reply:
        """Calibrate joints and wait for the end (K1 to K4).

        An interruption while waiting cancels the goal and is raised again.

        Args:
            joints: that are calibrated.
            wait: false: only start it; get_calibration reports its status.
            feedback: called in the caller's thread.
        """
        names = (await self._services.select(joints)).names
        view = self._services.calibrations
        view.started(names)

        def read(sent: Any) -> CalibrationFeedback:
            return CalibrationFeedback(tuple(sent.names), np.array(sent.progress), sent.phase)

        goal = self._services.goal(
            CALIBRATE,
            view.on_feedback,
            lambda result: view.ended(names, result.success, result.message),
        )
        fields = {"names": list(names)}
        try:
            reply = await goal.run(fields, names, feedback, read, to_the_end=wait)
        except BoardError as error:  # no result follows
            view.ended(names, False, str(error))
            raise
        if not reply:  # where the goal is refused, no result follows either
            view.ended(names, False, reply.message)
        return reply

    @operation
    async def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """Status of each joint's last calibration started by this client."""
        link, view, statuses = self._link, self._services.calibrations, []
        response = await self._services.read(GET_CONTROL_MODE, joints)
        for name, code in zip(response.names, response.modes, strict=True):
            if parse_control_mode(code) not in CALIBRATES:  # the result is about to arrive
                await link.until(
                    lambda name=name: not view.status(name).running,  # type: ignore[misc]
                    link.answer_timeout,
                )
            statuses.append(view.status(name))
        return statuses


class Trajectory(NamedTuple):
    """A trajectory of joints: times (s, shape (n,)), positions and velocities (shape (n, k))."""

    names: tuple[str, ...]
    times: Floats
    positions: Floats
    velocities: Floats | None


def trajectory(
    names: tuple[str, ...], times: Values, positions: Values, velocities: Values | None
) -> Trajectory:
    """A trajectory as arrays.

    Raises:
        RequestError: the shapes do not fit.
    """
    try:
        t, q = np.asarray(times, float), np.asarray(positions, float)
        dq = None if velocities is None else np.asarray(velocities, float)
    except (TypeError, ValueError, OverflowError):
        text = "times, positions and velocities must be numbers, rows of the same length"
        raise RequestError(f"{text}: one per joint") from None
    shape = (t.size, len(names))
    if t.ndim != 1 or q.shape != shape or (dq is not None and dq.shape != shape):
        raise RequestError(f"a trajectory of {t.size} times requires rows of shape {shape}")
    return Trajectory(names, t, q, dq)
