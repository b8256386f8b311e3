# SPDX-License-Identifier: Apache-2.0
"""The actions ~/move, ~/calibrate and ~/go_to_pose: started by a goal, watched by one timer.

Neither blocks the executor: a goal's coroutine waits for a future, the timer reads the board
between two cycles, sends feedback, and sets the future when the task has ended, was cancelled
or can no longer end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from rclpy.action.server import ActionServer, CancelResponse
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future
from rclpy.timer import Timer

from ...core.goals.tasks import Outcome
from ...core.selection import RequestError
from ...interface import CALIBRATE, GO_TO_POSE, MOVE, Endpoint
from ...operations import Begin, Task, calibration, doubles, move
from ..loop.loop import Member
from .request_log import GoalRecord, RequestLog

#: Period in s at which active goals are checked and feedback is sent (wall clock).
PERIOD = 0.05
#: s for which the result of a goal is kept.
RESULT_KEPT = 60

T = TypeVar("T")


def feedback_of(task: Task, kind: Any) -> Any:
    """The present feedback message, of its kind."""
    names, fields = kind.get_fields_and_field_types(), task.feedback()
    values = {n: doubles(v) if isinstance(v, np.ndarray) else v for n, v in fields.items()}
    return kind(**{name: values[name] for name in names})


@dataclass(slots=True, eq=False)
class Goal(Generic[T]):
    """An active goal: rclpy's handle, its task, and the future of its end."""

    handle: Any
    task: T
    ended: Future

    def close(self, *, cancelled: bool, success: bool) -> None:
        """Set the final state of the handle."""
        if cancelled:
            self.handle.canceled()
        elif success:
            self.handle.succeed()
        else:
            self.handle.abort()


def action_server(
    node: Node,
    action: Endpoint,
    execute: Callable[[Any], Any],
    cancel: Callable[[Any], CancelResponse] = lambda _goal: CancelResponse.ACCEPT,
) -> ActionServer:
    """A server of one of the board's actions, with the QoS of its row."""
    return ActionServer(
        node,
        action.load(),
        action.name,
        execute,
        cancel_callback=cancel,
        goal_service_qos_profile=action.qos.profile(),
        result_service_qos_profile=action.qos.profile(),
        cancel_service_qos_profile=action.qos.profile(),
        result_timeout=RESULT_KEPT,
    )


def goal_timer(node: Node, look: Callable[[], None]) -> Timer:
    """A timer, not started, that looks at active goals every PERIOD of wall-clock time."""
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    return node.create_timer(PERIOD, look, clock=steady, autostart=False)


class Actions:
    """The action servers of a node.

    Args:
        warn: receives the cause of a waiting goal, and a name for its repetitions.
        go_to_pose: returns the start of a goal of ~/go_to_pose.
    """

    def __init__(
        self,
        node: Node,
        member: Member,
        warn: Callable[[str, str], None],
        go_to_pose: Callable[[Any], Begin],
        requests: RequestLog,
    ) -> None:
        self._member, self._warn, self._requests = member, warn, requests
        self._goals: dict[Goal[Task], Any] = {}  # with the type of its feedback
        self._servers: Sequence[ActionServer] = [
            self._server(node, MOVE, move),
            self._server(node, CALIBRATE, calibration),
            self._server(node, GO_TO_POSE, go_to_pose),
        ]
        self._timer = goal_timer(node, self._look)

    def _server(self, node: Node, action: Endpoint, start: Callable[[Any], Begin]) -> ActionServer:
        kind = action.load()

        async def execute(handle: Any) -> Any:
            record = GoalRecord(self._requests, action, handle)
            if handle.is_cancel_requested:
                handle.canceled()
                text = "cancelled before it began"
                return record.ended(kind.Result(success=False, message=text))
            try:
                begin = start(handle.request)
                with self._member.exclusive() as board:
                    task = begin(board)
            except ValueError as error:
                handle.abort()
                why = list(map(str, error.codes)) if isinstance(error, RequestError) else []
                return record.refused(kind.Result(success=False, message=str(error), codes=why))
            record.accepted()
            if self._member.loop.paused:
                text = "the simulation is paused; resume it with ~/pause"
                self._warn(f"{action.short} waits: {text}", "times")
            ended = Future()
            self._goals[Goal(handle, task, ended)] = kind.Feedback
            if len(self._goals) == 1:
                self._timer.reset()
            outcome = await ended
            return record.ended(kind.Result(success=outcome.success, message=outcome.message))

        return action_server(node, action, execute)

    def _look(self) -> None:
        """Send feedback of every goal; end the completed and the cancelled ones."""
        for goal, feedback in list(self._goals.items()):
            outcome: Outcome | None = Outcome(False, "internal error; see the board's log")
            try:
                outcome = self._attend(goal, feedback)
            finally:
                if outcome is not None:
                    del self._goals[goal]
                    goal.ended.set_result(outcome)
        if not self._goals:
            self._timer.cancel()

    def _attend(self, goal: Goal[Task], kind: Any) -> Outcome | None:
        task = goal.task
        with self._member.exclusive():
            cancelled = goal.handle.is_cancel_requested
            outcome = Outcome(False, task.cancel()) if cancelled else task.outcome()
            feedback = feedback_of(task, kind)
        goal.handle.publish_feedback(feedback)
        if outcome is not None:
            goal.close(cancelled=cancelled, success=outcome.success)
        return outcome
