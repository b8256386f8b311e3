# SPDX-License-Identifier: Apache-2.0
"""What goals of actions set going: how it is watched, and how it ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from control_board_msgs.action import Calibrate, Move

from ..core.arrival import TOLERANCES, Standing, ending, standing, unit
from ..core.board import Board
from ..core.modes import ACCEPTS
from ..core.reply import Answer, joints_of, summary
from ..core.vocabs import CommandKind, ControlMode, InteractionMode
from .messages import chosen, doubles, optional

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


class MoveGoal:
    """A position move of some joints.

    Raises:
        ValueError: the board does not take it; nothing has changed.
    """

    def __init__(self, board: Board, goal: Any) -> None:
        names = board.selector.select(chosen(goal.names, board.count)).names
        self._told = start_move(board, names, goal.positions, optional(goal.speeds))
        self._names = names
        self._joints = board.selector.select(names).joints
        self._kinds = [board.config.joints[j].kind for j in self._joints]
        self._targets = board.get_target_position(names).tolist()
        self._control = board.get_control_mode(names)
        self._interaction = board.get_interaction_mode(names)
        self._ended: float | None = None

    def look(self, board: Board) -> Outcome | None:
        takes = board.accepts[CommandKind.POSITION, self._joints]
        targets = board.get_target_position(self._names).tolist()
        if not takes.all():
            first = int(np.argmin(takes))
            self._stop(board)
            return False, self._left(board, self._names[first])
        for name, kind, target, wanted in zip(
            self._names, self._kinds, targets, self._targets, strict=True
        ):
            if target != wanted:
                return False, (
                    f"another move took {name} to {target:.6g} {unit(kind)} "
                    f"instead of {wanted:.6g} {unit(kind)}"
                )
        if not all(board.check_motion_done(self._names)):
            self._ended = None
            return self._dropped(board)
        return self._arrival(board)

    def feedback(self, board: Board) -> Any:
        return Move.Feedback(
            names=list(self._names),
            positions=doubles(board.get_encoder(self._names)),
            remaining_time=float(np.max(board.get_remaining_time(self._names), initial=0.0)),
        )

    def cancel(self, board: Board) -> str:
        self._stop(board)
        return f"cancelled; {', '.join(self._names)} stopped and held where they were"

    def _stop(self, board: Board) -> None:
        """Stop the joints that still do this move."""
        moving = [
            name
            for name, takes, target, wanted in zip(
                self._names,
                board.accepts[CommandKind.POSITION, self._joints],
                board.get_target_position(self._names),
                self._targets,
                strict=True,
            )
            if takes and target == wanted
        ]
        if moving:  # none named would mean all
            board.stop(moving)

    def _dropped(self, board: Board) -> Outcome | None:
        """While some joints move: has the move of another one been dropped?"""
        done = board.check_motion_done(self._names)
        found = self._standings(board, since=0.0)
        if not any(d and f is Standing.DROPPED for d, f in zip(done, found, strict=True)):
            return None
        lost = [f if d else Standing.ARRIVED for d, f in zip(done, found, strict=True)]
        message = self._message(board, lost)
        self._stop(board)
        return False, message

    def _arrival(self, board: Board) -> Outcome | None:
        """The profiles have ended: are the joints there?"""
        if self._ended is None:
            self._ended = board.time
        found = self._standings(board, since=board.time - self._ended)
        if Standing.DROPPED not in found and Standing.SETTLING in found:
            return None
        message = self._message(board, found)
        return all(one is Standing.ARRIVED for one in found), message

    def _standings(self, board: Board, *, since: float) -> list[Standing]:
        shown = board.snapshot()
        interaction = board.get_interaction_mode(self._names)
        return [
            standing(
                target,
                float(shown.position_reference[j]),
                float(shown.velocity_reference[j]),
                float(shown.position[j]),
                tolerance=TOLERANCES[kind],
                compliant=mode is InteractionMode.COMPLIANT,
                since=since,
            )
            for j, kind, target, mode in zip(
                self._joints, self._kinds, self._targets, interaction, strict=True
            )
        ]

    def _message(self, board: Board, found: list[Standing]) -> str:
        """What is to be told of the end: what was bounded at the start, and of each joint."""
        texts = [self._told] if all(one is Standing.ARRIVED for one in found) else []
        position = board.get_encoder(self._names)
        control = board.get_control_mode(self._names)
        interaction = board.get_interaction_mode(self._names)
        for k, name in enumerate(self._names):
            changed = "it was stopped, or a velocity moved it" if mixed(control[k]) else ""
            if control[k] is not self._control[k]:
                changed = f"its control mode became {control[k].name}"
            elif interaction[k] is not self._interaction[k]:
                changed = f"its interaction mode became {interaction[k].name}"
            if found[k] is not Standing.SETTLING:
                texts.append(
                    ending(
                        name,
                        self._kinds[k],
                        found[k],
                        self._targets[k],
                        float(position[k]),
                        changed=changed,
                        compliant=interaction[k] is InteractionMode.COMPLIANT,
                    )
                )
        return summary(texts)

    @staticmethod
    def _left(board: Board, name: str) -> str:
        mode = board.get_control_mode(name)[0]
        cause = f" ({board.get_faults(name)[0].text})" if mode is ControlMode.HW_FAULT else ""
        return f"{name} left for {mode.name}{cause} during the move; the other joints stopped"


def mixed(mode: ControlMode) -> bool:
    """Whether a mode takes velocities beside moves."""
    return {CommandKind.POSITION, CommandKind.VELOCITY} <= ACCEPTS.get(mode, frozenset())


def start_move(board: Board, names: Sequence[str], positions: Any, speeds: Any) -> str:
    """Start a move of all these joints or of none; returns what the board said to it.

    The joints that the board refuses for sure come first, then those with a speed above their
    limit: what is refused is refused before anything has changed.

    Raises:
        ValueError: with the board's reason.
    """
    count = len(names)
    if len(positions) != count or (speeds is not None and len(speeds) != count):
        raise ValueError(board.position_move(names, positions, speeds).message)
    joints = board.selector.select(names).joints
    targets = np.asarray(positions, dtype=np.float64)
    rates = board.get_ref_speed(names) if speeds is None else np.asarray(speeds, np.float64)
    with np.errstate(invalid="ignore"):
        refused = ~(board.accepts[CommandKind.POSITION, joints] & np.isfinite(targets))
        refused |= ~(np.isfinite(rates) & (rates > 0.0))
        fast = ~refused & (rates > [board.config.joints[j].limits.velocity for j in joints])
    told = []
    for group in (refused, fast, ~(refused | fast)):
        if not group.any():
            continue
        some = [name for name, among in zip(names, group, strict=True) if among]
        reply = board.position_move(some, targets[group], None if speeds is None else rates[group])
        if not reply:
            raise ValueError(reply.message)
        told.append(reply.message)
    return summary(told)


class CalibrateGoal:
    """The calibration of some joints.

    Raises:
        ValueError: no joint takes it.
    """

    def __init__(self, board: Board, goal: Any) -> None:
        self._names = board.selector.select(chosen(goal.names, board.count)).names
        reply = board.calibrate(self._names)
        self._refusal = reply.message
        self._started = joints_of(reply, Answer.ACCEPTED)
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
