# SPDX-License-Identifier: Apache-2.0
"""The actions ~/move and ~/calibrate: started by a goal, watched by one timer.

Neither blocks the executor: a goal's coroutine waits for a future, the timer looks at the board
between two cycles, sends feedback, and sets the future when the motion has ended, was cancelled
or cannot end any more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from control_board_msgs.action import Calibrate, Move
from rclpy.action import ActionServer, CancelResponse
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future

from ..core.board import Board
from ..core.vocabs import CommandKind, ControlMode, InteractionMode
from .loop import ControlLoop
from .messages import chosen, doubles
from .services import DEEP

#: s between two looks at the motions under way (wall clock), which is the feedback's period.
PERIOD = 0.05
#: A move has arrived when each joint is this near to its target, rad.
ARRIVED = 0.01
#: s of simulated time that joints get to arrive after their profile has ended.
SETTLING = 1.0
#: s for which the result of a goal can still be asked for.
RESULT_KEPT = 60

#: What a motion says when it has ended: whether it succeeded, and one line.
Outcome = tuple[bool, str]


class Motion(Protocol):
    """Something under way that a goal asked for; all methods within an exclusive turn."""

    def look(self, board: Board) -> Outcome | None:
        """How it ended, or None while it is under way."""
        ...

    def feedback(self, board: Board) -> Any:
        """The feedback message of now."""
        ...

    def cancel(self, board: Board) -> str:
        """Stop the joints; returns what they do now."""
        ...


class MoveMotion:
    """A position move of some joints.

    Raises:
        ValueError: the board does not take it; nothing moves.
    """

    def __init__(self, board: Board, goal: Any) -> None:
        names = board.selector.select(chosen(goal.names, board.count)).names
        speeds = goal.speeds if len(goal.speeds) else None
        reply = board.position_move(names, goal.positions, speeds)
        if not reply:
            moving = [n for n, a in zip(reply.joints, reply.answers, strict=True) if a == "accepted"]
            if moving:  # all or nothing: no cycle has passed since
                board.stop(moving)
            raise ValueError(reply.message)
        self._names = names
        self._joints = board.selector.select(names).joints
        self._targets = board.get_target_position(names)
        self._ended: float | None = None

    def look(self, board: Board) -> Outcome | None:
        for name, mode, takes in zip(
            self._names,
            board.get_control_mode(self._names),
            board.accepts[CommandKind.POSITION, self._joints],
            strict=True,
        ):
            if not takes:
                board.stop([n for n in self._names if n != name])
                return False, self._left(board, name, mode)
        targets = board.get_target_position(self._names)
        for name, target, wanted in zip(self._names, targets, self._targets, strict=True):
            if target != wanted:
                return False, f"another move took {name} to {target:.4g} instead of {wanted:.4g}"
        if not all(board.check_motion_done(self._names)):
            self._ended = None
            return None
        return self._arrival(board)

    def feedback(self, board: Board) -> Any:
        return Move.Feedback(
            names=list(self._names),
            positions=doubles(board.get_encoder(self._names)),
            remaining_time=float(np.max(board.get_remaining_time(self._names), initial=0.0)),
        )

    def cancel(self, board: Board) -> str:
        moving = [
            name
            for name, takes in zip(
                self._names, board.accepts[CommandKind.POSITION, self._joints], strict=True
            )
            if takes
        ]
        if moving:
            board.stop(moving)
        return f"cancelled; {', '.join(self._names)} stopped and held where they were"

    def _arrival(self, board: Board) -> Outcome | None:
        """The profiles have ended: are the joints there?"""
        if self._ended is None:
            self._ended = board.time
        away = np.abs(board.get_encoder(self._names) - self._targets)
        soft = [m is InteractionMode.COMPLIANT for m in board.get_interaction_mode(self._names)]
        away[soft] = 0.0  # a spring gives way, by design
        worst = int(np.argmax(away))
        if away[worst] <= ARRIVED:
            return True, ""
        if board.time - self._ended < SETTLING:
            return None
        return False, (
            f"{self._names[worst]} stopped {away[worst]:.4g} away from its target "
            f"{self._targets[worst]:.4g}; it was stopped, is blocked, or its gains are too low"
        )

    @staticmethod
    def _left(board: Board, name: str, mode: ControlMode) -> str:
        cause = f" ({board.get_faults(name)[0].text})" if mode is ControlMode.HW_FAULT else ""
        return f"{name} left for {mode.name}{cause} during the move; the other joints stopped"


class CalibrateMotion:
    """The calibration of some joints.

    Raises:
        ValueError: no joint takes it.
    """

    def __init__(self, board: Board, goal: Any) -> None:
        self._names = board.selector.select(chosen(goal.names, board.count)).names
        reply = board.calibrate(self._names)
        if "accepted" not in reply.answers:
            raise ValueError(reply.message)
        self._refusal = reply.message
        self._started = [
            n for n, a in zip(reply.joints, reply.answers, strict=True) if a == "accepted"
        ]

    def look(self, board: Board) -> Outcome | None:
        statuses = board.get_calibration(self._started)
        if any(status.running for status in statuses):
            return None
        failures = [self._refusal] if self._refusal else []
        faults = board.get_faults(self._started)
        for status, fault in zip(statuses, faults, strict=True):
            if not status.done:
                why = fault.text if fault.active else status.message or status.phase
                failures.append(f"{status.name} is not calibrated: {why}")
        return not failures, "; ".join(failures)

    def feedback(self, board: Board) -> Any:
        statuses = board.get_calibration(self._names)
        phases = dict.fromkeys(status.phase for status in statuses if status.running)
        return Calibrate.Feedback(
            names=list(self._names),
            progress=doubles([status.progress for status in statuses]),
            phase=", ".join(phases),
        )

    def cancel(self, board: Board) -> str:
        modes = board.get_control_mode(self._started)
        running = [
            n for n, m in zip(self._started, modes, strict=True) if m is ControlMode.CALIBRATING
        ]
        if running:
            board.set_control_mode(running, ControlMode.FORCE_IDLE)  # K2
        return f"cancelled; {', '.join(running)} in IDLE, not calibrated"


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
                kind,
                name,
                self._executor(kind, motion),
                cancel_callback=accept_cancel,
                goal_service_qos_profile=DEEP,
                result_service_qos_profile=DEEP,
                cancel_service_qos_profile=DEEP,
                result_timeout=RESULT_KEPT,
            )
            for name, kind, motion in (
                ("~/move", Move, MoveMotion),
                ("~/calibrate", Calibrate, CalibrateMotion),
            )
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
