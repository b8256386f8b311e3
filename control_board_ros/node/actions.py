# SPDX-License-Identifier: Apache-2.0
"""The actions ~/move and ~/calibrate: started by a goal, watched by one timer.

Neither blocks the executor: a goal's coroutine waits for a future, the timer looks at the board
between two cycles, sends feedback, and sets the future when the motion has ended, was cancelled
or cannot end any more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future

from ..interface import CALIBRATE, MOVE
from .goals import CalibrateGoal, Motion, MoveGoal, Outcome
from .loop import ControlLoop

#: s between two looks at the motions under way (wall clock), which is the feedback's period.
PERIOD = 0.05
#: s for which the result of a goal can still be asked for.
RESULT_KEPT = 60


class Actions:
    """The action servers of a node.

    Args:
        node: to serve from.
        loop: whose board moves.
    """

    def __init__(self, node: Node, loop: ControlLoop) -> None:
        self._loop = loop
        self._motions: list[tuple[Any, Motion, Future]] = []
        self._servers: Sequence[ActionServer] = [
            ActionServer(
                node,
                action.load(),
                action.name,
                self._executor(action.load(), motion),
                cancel_callback=accept_cancel,
                goal_service_qos_profile=action.qos.profile(),
                result_service_qos_profile=action.qos.profile(),
                cancel_service_qos_profile=action.qos.profile(),
                result_timeout=RESULT_KEPT,
            )
            for action, motion in ((MOVE, MoveGoal), (CALIBRATE, CalibrateGoal))
        ]
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._look, clock=steady, autostart=False)

    def _executor(self, kind: Any, motion: Any) -> Any:
        async def execute(goal: Any) -> Any:
            try:
                with self._loop.exclusive() as board:
                    started = motion(board, goal.request)
            except ValueError as error:
                goal.abort()
                return kind.Result(success=False, message=str(error))
            ended = Future()
            self._motions.append((goal, started, ended))
            if len(self._motions) == 1:
                self._timer.reset()
            success, message = await ended
            return kind.Result(success=success, message=message)

        return execute

    def _look(self) -> None:
        """Feedback for every motion; end those that have ended or are to be cancelled."""
        for entry in list(self._motions):
            goal, motion, ended = entry
            outcome: Outcome | None = (False, "internal error; the board's log tells more")
            try:
                outcome = self._attend(goal, motion)
            finally:
                if outcome is not None:
                    self._motions.remove(entry)
                    ended.set_result(outcome)
        if not self._motions:
            self._timer.cancel()

    def _attend(self, goal: Any, motion: Motion) -> Outcome | None:
        with self._loop.exclusive() as board:
            cancelled = goal.is_cancel_requested
            outcome = (False, motion.cancel(board)) if cancelled else motion.look(board)
            feedback = motion.feedback(board)
        goal.publish_feedback(feedback)
        if outcome is None:
            return None
        if cancelled:
            goal.canceled()
        elif outcome[0]:
            goal.succeed()
        else:
            goal.abort()
        return outcome


def accept_cancel(_goal: Any) -> CancelResponse:
    """Every goal can be cancelled."""
    return CancelResponse.ACCEPT
