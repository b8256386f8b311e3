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

from control_board_ros.core.calibration import CalibrationStatus
from control_board_ros.core.reply import Reply, accepted, refused
from control_board_ros.core.selection import RequestError, spread
from control_board_ros.core.vocabs import ControlMode
from control_board_ros.interfaces import Floats, Joints, Values

from .calibrations import CalibrationView
from .errors import BoardError
from .link import Link
from .references import ReferenceOperations
from .waiting import Steps, Wait, operation

#: s between looks whether the board is still there while a goal runs.
LOOK = 1.0
#: Feedback that is kept while nobody takes it.
FEEDBACK_KEPT = 100


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


class GoalRun:
    """One goal under way.

    Attributes: heard (feedback that nobody took yet), handle and result (rclpy's, once sent).
    """

    def __init__(
        self,
        link: Link,
        client: Any,
        on_feedback: Callable[[Any], None],
        on_result: Callable[[Any], None],
    ) -> None:
        self.heard: deque[Any] = deque(maxlen=FEEDBACK_KEPT)
        self.handle: Any = None
        self.result: Any = None
        self._link, self._client = link, client
        self._on_feedback, self._on_result = on_feedback, on_result
        self._wait: Wait | None = None

    def send(self, name: str, goal: Any) -> Steps[bool]:
        """Send the goal; whether it was accepted."""
        sending = yield from self._link.run(
            lambda: self._client.send_goal_async(goal, feedback_callback=self._hear)
        )
        if not (yield from self._link.outcome(sending, self._link.answer_timeout)):
            raise self._link.timed_out(name)
        self.handle = sending.result()
        if self.handle.accepted:
            self.result = yield from self._link.run(self.handle.get_result_async)
            self.result.add_done_callback(self._end)
        return bool(self.handle.accepted)

    def cancel(self) -> None:
        """Ask for the end of the goal."""
        self._link.later(self.handle.cancel_goal_async)

    def next_sign(self, name: str) -> Steps[None]:
        """Wait for feedback or the result.

        Raises:
            BoardError: the board is gone.
        """
        self._wait = wait = self._link.wait(LOOK)
        if self.heard or self.result.done():
            wait.finish()
        yield wait
        if not wait.done and not self._client.server_is_ready():
            raise BoardError(f"{self._link.name} went away during {name}; is it still running?")

    def _hear(self, message: Any) -> None:
        self._on_feedback(message.feedback)
        self.heard.append(message.feedback)
        self._wake()

    def _end(self, future: Any) -> None:
        self._on_result(future.result().result)
        self._wake()

    def _wake(self) -> None:
        if self._wait is not None:
            self._wait.finish()


class GoalOperations(ReferenceOperations):
    """The actions."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self._calibrations = CalibrationView()

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
        wait: bool = True,
        feedback: Callable[[CalibrationFeedback], None] | None = None,
    ) -> Steps[Reply]:
        """Calibrate joints and wait for the end (K1 to K4); without ``wait``, only start it.

        Interrupted while waiting, it cancels the goal and lets the interruption through.
        ``feedback`` is called in the caller's thread.
        """
        try:
            selection = yield from self._select(joints)
        except RequestError as error:
            return refused(str(error))
        goal = Calibrate.Goal(names=list(selection.names))
        view, names = self._calibrations, selection.names
        view.started(names)
        self._view.doubt()

        def show(message: Any) -> None:
            if feedback is not None:
                progress = np.array(message.progress)
                feedback(CalibrationFeedback(tuple(message.names), progress, message.phase))

        reply = yield from self._goal(
            Calibrate,
            "calibrate",
            goal,
            names,
            show,
            to_the_end=wait,
            on_feedback=view.on_feedback,
            on_result=lambda result: view.ended(names, result.success, result.message),
        )
        return reply

    @operation
    def get_calibration(self, joints: Joints = None) -> Steps[list[CalibrationStatus]]:
        """How the last calibration of each joint stands, of those this client asked for."""
        response = yield from self._control_modes((yield from self._select(joints)))
        view, statuses = self._calibrations, []
        for name, code in zip(response.names, response.modes, strict=True):
            if code != ControlMode.CALIBRATING.code:  # then the result is on its way
                yield from self._link.until(
                    lambda name=name: not view.status(name).running,  # type: ignore[misc]
                    self._link.answer_timeout,
                )
            statuses.append(view.status(name))
        return statuses

    def _goal(
        self,
        kind: Any,
        name: str,
        goal: Any,
        names: Sequence[str],
        show: Callable[[Any], None],
        *,
        to_the_end: bool = True,
        on_feedback: Callable[[Any], None] = lambda _: None,
        on_result: Callable[[Any], None] = lambda _: None,
    ) -> Steps[Reply]:
        """Send a goal; wait for its result, or only for the first sign that it runs.

        ``show`` gets the feedback in the caller's thread; ``on_feedback`` and ``on_result`` are
        called in the link's thread, also when nobody waits any more.
        """
        client = yield from self._link.action(kind, name)
        run = GoalRun(self._link, client, on_feedback, on_result)
        if not (yield from run.send(name, goal)):
            return refused(f"the board refused to {name}; see its log", tuple(names))
        self._changed()
        try:
            while not run.result.done():
                yield from run.next_sign(name)
                while run.heard:
                    show(run.heard.popleft())
                    if not to_the_end:
                        return accepted(tuple(names))
        except GeneratorExit:
            run.cancel()
            raise
        except BaseException:
            run.cancel()
            yield from self._link.outcome(run.result, self._link.answer_timeout)
            self._changed()
            raise
        yield from self._link.run(lambda: None)  # the thread takes a result before feedback
        while run.heard:
            show(run.heard.popleft())
        self._changed()
        return self._result(name, run.result.result(), names)

    def _result(self, name: str, answer: Any, names: Sequence[str]) -> Reply:
        result = answer.result
        if result.success:
            reply = accepted(tuple(names))
            return Reply(reply.joints, reply.answers, result.message)
        if answer.status == GoalStatus.STATUS_CANCELED and not result.message:
            return refused(f"{name} was cancelled", tuple(names))
        return refused(result.message, tuple(names))
