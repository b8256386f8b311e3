# SPDX-License-Identifier: Apache-2.0
"""Decisions on requests, for one joint, from facts and the tables of ``modes``.

``decide`` is total: every request has a Verdict for every joint in every mode. It changes nothing:
``machine`` carries verdicts out, ``explanations`` words them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..config.config import JointConfig
from ..terms.faults import Cause, FaultCode, FaultRecord
from ..terms.modes import (
    ACCEPTS,
    AT_REST,
    CALIBRATES,
    CONFIGURED,
    DRIVEN,
    FAULTED,
    POWERED,
    REQUESTS,
    STOPPABLE,
    STORES_INTERACTION,
    UNCONFIGURED,
    UNPOWERED_MODES,
    Choice,
    Event,
    Stage,
    Trigger,
    next_mode,
)
from ..terms.reply import Answer, Reason
from ..terms.vocabs import BrakeMode, CommandKind, ControlMode, InteractionMode

Requested = ControlMode | InteractionMode | Event


class Facts(NamedTuple):
    """The facts for a decision on one joint.

    Attributes: joint (its configuration), mode, interaction, calibrated (K7), fault (its last
    one), cause (of a fault that is active and would come back now), time (s, of the reading),
    stage (of the board), brake_closed (by hand, Y4).
    """

    joint: JointConfig
    mode: ControlMode
    interaction: InteractionMode
    calibrated: bool
    fault: FaultRecord
    cause: Cause | None
    time: float
    stage: Stage = Stage.ACTIVE
    brake_closed: bool = False

    @property
    def lacks_calibration(self) -> bool:
        """Whether the joint requires a calibration and has none (K7)."""
        return self.joint.requires_calibration and not self.calibrated

    @property
    def inactive(self) -> bool:
        """Whether the joint may have no power."""
        return self.stage is not Stage.ACTIVE

    @property
    def stopped(self) -> bool:
        """Whether an emergency stop keeps the joint in its fault (E2)."""
        return self.cause is not None and self.cause.code is FaultCode.EMERGENCY_STOP

    def after(self, verdict: Verdict) -> Facts:
        """The facts after an accepted verdict has been carried out."""
        effect = verdict.effect
        if isinstance(effect, InteractionMode):
            return self._replace(interaction=effect)
        if isinstance(effect, ControlMode):
            return self._replace(mode=effect)
        target = next_mode(self.mode, effect) if effect is not None else None
        if isinstance(target, ControlMode):
            return self._replace(mode=target, fault=self.fault.cleared(), cause=None)
        return self

    def withholds(self, requested: ControlMode) -> bool:
        """Whether the lack of a calibration, or the stage, withholds a mode (K7)."""
        return (self.lacks_calibration or self.inactive) and requested not in UNPOWERED_MODES


class Verdict(NamedTuple):
    """The answer for a joint, the reason where it is not accepted, and what to carry out.

    Attributes: answer, reason, effect (a trigger of the mode machine, an interaction mode to
    store, or None: nothing changes).
    """

    answer: Answer
    reason: Reason = Reason.NONE
    effect: Trigger | InteractionMode | None = None

    @property
    def accepts(self) -> bool:
        """Whether the joint does what was requested."""
        return self.answer is Answer.ACCEPTED


ACCEPT = Verdict(Answer.ACCEPTED)

#: Why a joint in such a mode refuses requests; absent: it does, unless it is inactive or lacks a
#: calibration.
UNAVAILABLE = {
    **dict.fromkeys(FAULTED, Reason.IN_FAULT),
    **dict.fromkeys(CALIBRATES, Reason.CALIBRATING),
    **dict.fromkeys(UNCONFIGURED, Reason.NOT_CONFIGURED),
}


def decide(facts: Facts, requested: Requested) -> Verdict:
    """The verdict on a request.

    Args:
        facts: Of one joint.
        requested: A control mode that can be requested (a key of REQUESTS), an interaction mode,
            or Event.CALIBRATE.
    """
    if isinstance(requested, InteractionMode):
        return _decide_interaction(facts, requested)
    if requested is Event.CALIBRATE:
        return _decide_calibration(facts)
    assert isinstance(requested, ControlMode)
    return _decide_control_mode(facts, requested)


def _decide_control_mode(facts: Facts, requested: ControlMode) -> Verdict:
    """M1, M5, M8, F2, F4, K2, K7, Y4."""
    trigger = REQUESTS[requested]
    if trigger is requested and requested not in facts.joint.control_modes:
        trigger = Event.UNSUPPORTED
    target = next_mode(facts.mode, trigger)
    if target is None or facts.withholds(requested):
        return _refused(facts)
    if trigger is Event.UNSUPPORTED:
        return Verdict(Answer.UNSUPPORTED, Reason.UNSUPPORTED, trigger)
    if (reason := _hindrance(facts, target)) is not Reason.NONE:
        return Verdict(Answer.REFUSED, reason)
    if target is facts.mode:
        return ACCEPT
    if trigger is requested and isinstance(target, ControlMode):
        return Verdict(Answer.ACCEPTED, effect=target)
    return Verdict(Answer.ACCEPTED, effect=trigger)


def _hindrance(facts: Facts, target: ControlMode | Choice) -> Reason:
    """The obstacle to a mode that the table allows (F3, E2, Y4)."""
    if facts.cause is not None:
        return Reason.EMERGENCY_STOP if facts.stopped else Reason.CAUSE_PERSISTS
    closed = facts.brake_closed and target in POWERED
    return Reason.BRAKE_CLOSED if closed else Reason.NONE


def _decide_interaction(facts: Facts, requested: InteractionMode) -> Verdict:
    """I1, I2, I4, I7."""
    if facts.mode not in STORES_INTERACTION:
        return _refused(facts)
    if requested not in facts.joint.interaction_modes:
        if next_mode(facts.mode, Event.UNSUPPORTED) is None:
            return _refused(facts)
        return Verdict(Answer.UNSUPPORTED, Reason.UNSUPPORTED, Event.UNSUPPORTED)
    return ACCEPT if requested is facts.interaction else Verdict(Answer.ACCEPTED, effect=requested)


def _decide_calibration(facts: Facts) -> Verdict:
    """K1, N4."""
    if facts.joint.calibration is None:
        return Verdict(Answer.REFUSED, Reason.NO_CALIBRATOR)
    allowed = facts.mode in CONFIGURED and not facts.inactive
    if not allowed or next_mode(facts.mode, Event.CALIBRATE) is None:
        return _refused(facts)
    if facts.brake_closed:
        return Verdict(Answer.REFUSED, Reason.BRAKE_CLOSED)
    return Verdict(Answer.ACCEPTED, effect=Event.CALIBRATE)


def decide_brake(facts: Facts, mode: BrakeMode, *, present: bool) -> Verdict:
    """The verdict on a brake mode (Y4): a brake closes by hand only without power, and opens
    none while an emergency stop holds (E2).
    """
    if not present:
        return Verdict(Answer.REFUSED, Reason.UNSUPPORTED)
    if mode is BrakeMode.CLOSED and facts.mode in DRIVEN:
        return Verdict(Answer.REFUSED, Reason.OTHER_MODE)
    if mode is BrakeMode.OPEN and facts.stopped:
        return Verdict(Answer.REFUSED, Reason.EMERGENCY_STOP)
    return ACCEPT


def decide_stop(facts: Facts) -> Verdict:
    """The verdict on a stop: it acts where a position reference is followed (P3)."""
    if facts.mode in STOPPABLE or facts.mode in AT_REST:
        return ACCEPT
    return Verdict(Answer.IGNORED, UNAVAILABLE.get(facts.mode, Reason.NOTHING_TO_STOP))


def decide_reference(
    facts: Facts,
    kind: CommandKind | None,
    values: tuple[float, ...],
    fits: bool = True,
    void: Reason = Reason.NONE,
) -> Verdict:
    """The verdict on a reference (M4, P13, F8), or on feed-forward terms (P11, K6, N4).

    Args:
        facts: Of one joint.
        kind: Of the reference; None: feed-forward terms.
        values: The reference and its accompanying value, or the terms.
        fits: Whether the accompanying value is in its range.
        void: Why the stream that it belongs to is.
    """
    if kind is None:
        if facts.mode in CALIBRATES or facts.mode in UNCONFIGURED:
            return _ignored(facts, UNAVAILABLE[facts.mode])
    elif kind not in ACCEPTS.get(facts.mode, ()):
        known = any(kind in ACCEPTS.get(mode, ()) for mode in facts.joint.control_modes)
        otherwise = Reason.OTHER_MODE if known else Reason.UNSUPPORTED
        return _ignored(facts, _unavailable(facts, otherwise))
    if not all(math.isfinite(value) for value in values):
        return _ignored(facts, Reason.NOT_FINITE)
    if not fits:
        return _ignored(facts, Reason.OUT_OF_RANGE)
    return ACCEPT if void is Reason.NONE else _ignored(facts, void)


def _ignored(facts: Facts, reason: Reason) -> Verdict:
    """Commands are ignored (M4); before the configuration is in, refused (N4)."""
    answer = Answer.IGNORED if facts.mode in CONFIGURED else Answer.REFUSED
    return Verdict(answer, reason)


def _refused(facts: Facts) -> Verdict:
    return Verdict(Answer.REFUSED, _unavailable(facts, Reason.UNCALIBRATED))


def _unavailable(facts: Facts, otherwise: Reason) -> Reason:
    """Why a joint accepts nothing in its mode; ``otherwise`` where the mode is not the reason."""
    if facts.mode in FAULTED and facts.stopped:
        return Reason.EMERGENCY_STOP  # E2: FORCE_IDLE, the way out of a fault, is refused, too
    if facts.mode in UNAVAILABLE:
        return UNAVAILABLE[facts.mode]
    if facts.inactive:
        return Reason.INACTIVE
    return Reason.UNCALIBRATED if facts.lacks_calibration else otherwise
