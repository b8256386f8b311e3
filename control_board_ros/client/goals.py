# SPDX-License-Identifier: Apache-2.0
"""Moves and calibrations that are waited for: the actions of the board."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_board_msgs.action import Calibrate, Move

from control_board_ros.core.reply import Reply, accepted, refused
from control_board_ros.core.selection import RequestError, spread
from control_board_ros.interfaces import Floats, Joints, Values

from .errors import BoardError
from .references import ReferenceOperations
from .waiting import Steps, Wait, operation

#: s between looks whether the board is still there while a goal runs.
LOOK = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class MoveFeedback:
    """How a move stands: names, positions (measured, rad), remaining_time (s)."""

    names: tuple[str, ...]
    positions: Floats
    remaining_time: float


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationFeedback:
    """How a calibration stands: names, progress (0 to 1 each), phase (text)."""

    names: tuple[str, ...]
    progress: Floats
    phase: str


class GoalOperations(ReferenceOperations):
    """The actions."""

    @operation
    def move(
        self,
        joints: Joints,
        positions: Values,
        speeds: Values | None = None,
        feedback: Callable[[MoveFeedback], None] | None = None,
    ) -> Steps[Reply]:
        """Move along minimum-jerk profiles and wait for the end.

        Interrupted (Ctrl-C, a cancelled task), it cancels the goal, which stops the joints, and
        lets the interruption through. ``feedback`` is called in the caller's thread.
        """
        try:
            selection = yield from self._select(joints)
            count = len(selection.names)
            goal = Move.Goal(
                names=list(selection.names),
                positions=spread(positions, count, "position references").tolist(),
                speeds=[] if speeds is None else spread(speeds, count, "speeds").tolist(),
            )
        except RequestError as error:
            return refused(str(error))

        def show(message: Any) -> None:
            if feedback is not None:
                positions = np.array(message.positions)
                feedback(MoveFeedback(tuple(message.names), positions, message.remaining_time))

        reply = yield from self._goal(Move, "move", goal, selection.names, show)
        return reply

    @operation
    def calibrate(
        self,
        joints: Joints = None,
        *,
        wait: bool = False,
        feedback: Callable[[CalibrationFeedback], None] | None = None,
    ) -> Steps[Reply]:
        """Start the calibration of joints, and with ``wait`` see it to its end (K1 to K4).

        Interrupted while waiting, it cancels the goal and lets the interruption through.
        ``feedback`` is called in the caller's thread.
        """
        try:
            selection = yield from self._select(joints)
        except RequestError as error:
            return refused(str(error))
        goal = Calibrate.Goal(names=list(selection.names))

        def show(message: Any) -> None:
            if feedback is not None:
                progress = np.array(message.progress)
                feedback(CalibrationFeedback(tuple(message.names), progress, message.phase))

        reply = yield from self._goal(
            Calibrate, "calibrate", goal, selection.names, show, to_the_end=wait
        )
        return reply

    def _goal(
        self,
        kind: Any,
        name: str,
        goal: Any,
        names: Sequence[str],
        show: Callable[[Any], None],
        *,
        to_the_end: bool = True,
    ) -> Steps[Reply]:
        """Send a goal; wait for its result, or only for the first sign that it runs."""
        client = yield from self._link.action(kind, name)
        heard: deque[Any] = deque()
        waits: list[Wait] = []

        def on_feedback(message: Any) -> None:
            heard.append(message.feedback)
            if waits:
                waits[-1].finish()

        sending = client.send_goal_async(goal, feedback_callback=on_feedback)
        if not (yield from self._link.outcome(sending, self._link.answer_timeout)):
            raise self._link.timed_out(name)
        handle = sending.result()
        if not handle.accepted:
            return refused(f"the board refused to {name}; see its log", tuple(names))
        self._changed()
        result = handle.get_result_async()
        result.add_done_callback(lambda _: waits[-1].finish() if waits else None)
        try:
            while not result.done():
                wait = self._link.wait(LOOK)
                waits.append(wait)
                if heard or result.done():
                    wait.finish()
                yield wait
                while heard:
                    show(heard.popleft())
                    if not to_the_end:
                        return accepted(tuple(names))
                if not wait.done and not client.server_is_ready():
                    raise BoardError(f"{self._link.name} went away during {name}")
        except GeneratorExit:
            handle.cancel_goal_async()
            raise
        except BaseException:
            handle.cancel_goal_async()
            yield from self._link.outcome(result, self._link.answer_timeout)
            raise
        self._changed()
        return self._result(name, result.result(), names)

    def _result(self, name: str, answer: Any, names: Sequence[str]) -> Reply:
        result = answer.result
        if result.success:
            reply = accepted(tuple(names))
            return Reply(reply.joints, reply.answers, result.message)
        if answer.status == GoalStatus.STATUS_CANCELED and not result.message:
            return refused(f"{name} was cancelled", tuple(names))
        return refused(result.message, tuple(names))
