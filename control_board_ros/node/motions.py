# SPDX-License-Identifier: Apache-2.0
"""What goals of actions set going: how it is watched, and how it ends."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from control_board_msgs.action import Calibrate, Move

from ..core.board import Board
from ..core.reply import Answer, Reply
from ..core.vocabs import CommandKind, ControlMode, InteractionMode
from .messages import chosen, doubles

#: A move has arrived when each joint is this near to its target, rad.
ARRIVED = 0.01
#: s of simulated time that joints get to arrive after their profile has ended.
SETTLING = 1.0

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
            if moving := accepted_joints(reply):
                board.stop(moving)  # all or nothing: no cycle has passed since
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
        self._refusal = reply.message
        self._started = accepted_joints(reply)
        if not self._started:
            raise ValueError(reply.message)

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


def accepted_joints(reply: Reply) -> list[str]:
    """The joints of a reply that accepted."""
    pairs = zip(reply.joints, reply.answers, strict=True)
    return [name for name, answer in pairs if answer is Answer.ACCEPTED]
