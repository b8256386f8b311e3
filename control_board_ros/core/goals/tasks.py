# SPDX-License-Identifier: Apache-2.0
"""Goals that end when all their joints have: moves (SPEC P3), calibrations (K1).

The end of a position move is decided one joint at a time, from values alone. A move
that is completed leaves the position reference on its target. One that was dropped (by a stop,
another interaction mode, another control mode: M9, I4) leaves it at rest elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calibration.calibrations import CalibrationStatus
from ..selection import RequestError
from ..terms.arguments import Array, Joints
from ..terms.joint_kind import JointKind
from ..terms.modes import ACCEPTS, CALIBRATES, POWER_OFF
from ..terms.reply import Answer, joints_of, summary
from ..terms.vocabs import CommandKind, ControlMode, InteractionMode

if TYPE_CHECKING:
    from ..group import JointGroup

#: Distance to the target within which a joint has arrived, rad; m of a sliding joint.
TOLERANCE, SLIDE_TOLERANCE = 0.01, 0.001

#: Time to arrive after the end of the profile, s of simulated time.
SETTLING_TIME = 1.0

#: Part of the tolerance by which the reference may miss the target of a move that has ended.
REFERENCE_SHARE = 0.1


class Outcome(NamedTuple):
    """How a task ended; the message is one line, or empty."""

    success: bool
    message: str


class Standing(Enum):
    """Status of a joint after the end of its profile."""

    ARRIVED = auto()
    SETTLING = auto()  # still on its way
    DROPPED = auto()  # the move was ended by something else
    AWAY = auto()  # not there after SETTLING_TIME s


def tolerance(kind: JointKind) -> float:
    """Distance to the target within which a joint has arrived, rad or m."""
    return kind.choose(TOLERANCE, SLIDE_TOLERANCE)


class CalibrationTask:
    """The calibration of some joints; refusals are reported at the end.

    Raises:
        RequestError: no joint accepts it.

    Attributes: names (of the joints requested).
    """

    def __init__(self, board: JointGroup, joints: Joints) -> None:
        self._board = board
        self.names = board.selector.select(joints).names
        reply = board.calibrate(self.names)
        self._refusal = reply.message
        self._started = joints_of(reply, Answer.ACCEPTED)
        if not self._started:
            raise RequestError(reply.message, codes=reply.codes)

    def outcome(self) -> Outcome | None:
        """Outcome; None while active."""
        statuses = self._board.get_calibration(self._started)
        if any(status.running for status in statuses):
            return None
        failures = [self._refusal] if self._refusal else []
        faults = self._board.get_faults(self._started)
        for status, fault in zip(statuses, faults, strict=True):
            if not status.done:
                why = fault.text if fault.active else status.message or status.phase
                failures.append(f"{status.name} is not calibrated: {why}")
        return Outcome(not failures, "; ".join(failures))

    def statuses(self) -> list[CalibrationStatus]:
        """Status of each requested joint."""
        return self._board.get_calibration(self.names)

    def feedback(self) -> dict[str, Any]:
        """Fields of the action's feedback: names, progress (0 to 1 each), phase."""
        statuses = self.statuses()
        phases = dict.fromkeys(status.phase for status in statuses if status.running)
        progress = np.array([status.progress for status in statuses])
        return {"names": list(self.names), "progress": progress, "phase": ", ".join(phases)}

    def cancel(self) -> str:
        """Abort what is running (K2); what the joints do now."""
        modes = self._board.get_control_mode(self._started)
        running = {
            name: POWER_OFF[mode]
            for name, mode in zip(self._started, modes, strict=True)
            if mode in CALIBRATES
        }
        if running:
            self._board.set_control_mode(list(running), list(running.values()))
        return f"cancelled; {', '.join(running)} in IDLE, not calibrated"


K = CommandKind


class JointNow(NamedTuple):
    """A joint in a cycle: rad or m, and rad/s or m/s; its modes."""

    position: float
    reference: float
    reference_velocity: float
    control: ControlMode
    interaction: InteractionMode

    @property
    def compliant(self) -> bool:
        return self.interaction is InteractionMode.COMPLIANT


@dataclass(frozen=True, slots=True)
class JointMove:
    """One joint's part of a move, as it was accepted: kind of joint, target (rad or m), modes."""

    name: str
    kind: JointKind
    target: float
    control: ControlMode
    interaction: InteractionMode

    def standing(self, now: JointNow, since: float) -> Standing:
        """Status after the motion, whose profile has ended ``since`` s ago.

        ARRIVED: |reference − target| ≤ 0.1 tolerance and, unless compliant, |position − target| ≤
        tolerance. A spring yields by design, so a compliant joint is judged by its reference.
        """
        near = tolerance(self.kind)
        reached = abs(now.reference - self.target) <= REFERENCE_SHARE * near
        if reached and (now.compliant or abs(now.position - self.target) <= near):
            return Standing.ARRIVED
        if not reached and now.reference_velocity == 0.0:
            return Standing.DROPPED
        return Standing.SETTLING if since < SETTLING_TIME else Standing.AWAY

    def ending(self, standing: Standing, now: JointNow) -> str:
        """One line when the move has ended (not SETTLING); empty where the joint has arrived."""
        kind = self.kind
        where = f"{self.name} is at {kind.position(now.position)}"
        target_text = kind.position(self.target)
        away = abs(now.position - self.target)
        if standing is Standing.ARRIVED:
            if not now.compliant or away <= tolerance(kind):
                return ""
            return (
                f"{where}, its reference at {target_text}: it is COMPLIANT and yields to its load"
            )
        if standing is Standing.DROPPED:
            return (
                f"{where}, not at its target {target_text}: {self._cause(now)} during the move; "
                "send it again"
            )
        return (
            f"{where}, {kind.position(away)} away from its target {target_text}: it is blocked, "
            "its reference was moved by something else, its gains are too low, or the computer is "
            "too slow"
        )

    def _cause(self, now: JointNow) -> str:
        """Which mode is another one than when the move began, and else what may be."""
        if now.control is not self.control:
            return f"its control mode became {now.control.name}"
        if now.interaction is not self.interaction:
            return f"its interaction mode became {now.interaction.name}"
        takes_both = {K.POSITION, K.VELOCITY} <= ACCEPTS.get(now.control, frozenset())
        return "it was stopped, or a velocity moved it" if takes_both else "it was stopped"


class MoveTask:
    """A position move of several joints, started for all of them or for none.

    Args:
        board: which moves.
        joints: as in every request.
        positions: targets, one per joint, rad or m.
        speeds: mean speeds, one per joint, rad/s or m/s; None: the reference speeds.
        time: s after which all of them arrive, in place of speeds (R5); None: each at its own.
        note: a remark for the report at the end.

    Raises:
        RequestError: the board refuses it; nothing has changed.

    Attributes: names (of the joints).
    """

    def __init__(
        self,
        board: JointGroup,
        joints: Joints,
        positions: Sequence[float] | Array,
        speeds: Sequence[float] | Array | None = None,
        *,
        time: float | None = None,
        note: str = "",
    ) -> None:
        self._board = board
        self.names = board.selector.select(joints).names
        reply = board.command(K.POSITION, self.names, positions, speeds, together=True, time=time)
        if not reply:
            raise RequestError(reply.message, codes=reply.codes)
        self._note = summary([note, reply.message])
        self._joints = [
            JointMove(joint.name, joint.kind, target, control, interaction)
            for joint, target, control, interaction in zip(
                board.get_config(self.names),
                board.get_target_position(self.names).tolist(),
                board.get_control_mode(self.names),
                board.get_interaction_mode(self.names),
                strict=True,
            )
        ]
        self._ended: float | None = None  # when the profiles ended, s

    def outcome(self) -> Outcome | None:
        """Outcome; None while active. A failure stops the joints."""
        board = self._board
        left = [name for name, takes in zip(self.names, self._takes(), strict=True) if not takes]
        if left:
            self._stop()
            return Outcome(False, self._left(left[0]))
        for joint, target in zip(self._joints, self._targets(), strict=True):
            if target != joint.target:
                command_text = f"{joint.name} to {joint.kind.position(target)}"
                target_text = joint.kind.position(joint.target)
                return Outcome(
                    False, f"another move commands {command_text} instead of {target_text}"
                )
        if all(board.check_motion_done(self.names)):
            return self._arrival()
        self._ended = None
        return self._dropped()

    def remaining_time(self) -> float:
        """Time until the last profile ends, s."""
        return float(np.max(self._board.get_remaining_time(self.names), initial=0.0))

    def feedback(self) -> dict[str, Any]:
        """Fields of the actions' feedback: names, positions and remaining distances (rad, m;
        signed), remaining time (s).
        """
        positions = self._board.get_encoder(self.names)
        return {
            "names": list(self.names),
            "positions": positions,
            "remaining": np.array([joint.target for joint in self._joints]) - positions,
            "remaining_time": self.remaining_time(),
        }

    def cancel(self) -> str:
        """Stop the joints that still do this move; what they do now."""
        self._stop()
        return f"cancelled; {', '.join(self.names)} stopped and held where they were"

    def _takes(self) -> list[bool]:
        return [takes_moves(mode) for mode in self._board.get_control_mode(self.names)]

    def _targets(self) -> list[float]:
        targets: list[float] = self._board.get_target_position(self.names).tolist()
        return targets

    def _stop(self) -> None:
        """Stop the joints that still do this move."""
        moving = [
            joint.name
            for joint, takes, target in zip(
                self._joints, self._takes(), self._targets(), strict=True
            )
            if takes and target == joint.target
        ]
        if moving:  # none named would mean all
            self._board.stop(moving)

    def _dropped(self) -> Outcome | None:
        """While some joints move: has the move of another one been dropped?"""
        done = self._board.check_motion_done(self.names)
        standings = [
            standing if ended else Standing.ARRIVED
            for standing, ended in zip(self._standings(since=0.0), done, strict=True)
        ]
        if Standing.DROPPED not in standings:
            return None
        message = self._message(standings)
        self._stop()
        return Outcome(False, message)

    def _arrival(self) -> Outcome | None:
        """The profiles have ended: are the joints there?"""
        now = self._board.time
        if self._ended is None:
            self._ended = now
        standings = self._standings(since=now - self._ended)
        if Standing.DROPPED not in standings and Standing.SETTLING in standings:
            return None
        return Outcome(all(s is Standing.ARRIVED for s in standings), self._message(standings))

    def _now(self) -> list[JointNow]:
        board, names = self._board, self.names
        joints, state = board.selector.select(names).joints, board.state
        return [
            JointNow(*values)
            for values in zip(
                state.position[joints].tolist(),
                state.position_reference[joints].tolist(),
                state.velocity_reference[joints].tolist(),
                board.get_control_mode(names),
                board.get_interaction_mode(names),
                strict=True,
            )
        ]

    def _standings(self, *, since: float) -> list[Standing]:
        both = zip(self._joints, self._now(), strict=True)
        return [joint.standing(now, since) for joint, now in both]

    def _message(self, standings: list[Standing]) -> str:
        """The remarks at the end: what was bounded at the start, and of each joint."""
        texts = [self._note] if all(standing is Standing.ARRIVED for standing in standings) else []
        texts += [
            joint.ending(standing, now)
            for joint, standing, now in zip(self._joints, standings, self._now(), strict=True)
            if standing is not Standing.SETTLING
        ]
        return summary(texts)

    def _left(self, name: str) -> str:
        mode = self._board.get_control_mode(name)[0]
        fault = self._board.get_faults(name)[0]
        cause = f" ({fault.text})" if fault.active else ""
        return f"{name} left for {mode.name}{cause} during the move; the other joints stopped"


def takes_moves(mode: ControlMode) -> bool:
    """Whether a control mode accepts position moves."""
    return K.POSITION in ACCEPTS.get(mode, frozenset())
