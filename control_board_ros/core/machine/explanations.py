# SPDX-License-Identifier: Apache-2.0
"""Verdicts in words: one line each with cause, value, and what is allowed; no tool is named."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ..config.config import JointConfig
from ..laws.trajectory import LONGEST
from ..terms.modes import CALIBRATES, UNCONFIGURED, UNPOWERED, Event, Stage, modes_accepting
from ..terms.reply import Answer, JointAnswer, Reason, quantity
from ..terms.vocabs import CommandKind, ControlMode, InteractionMode
from .decisions import Facts, Requested
from .stale import NEAR_ANGLE, NEAR_DISTANCE, PAUSE, POSITIONS

ACTIVATE = "activate it first"
UNTIL_CALIBRATED = "until then it accepts idl, fidl and a calibration"


def waits_for(facts: Facts) -> str:
    """The step by which a joint leaves NOT_CONFIGURED (N2)."""
    if facts.stage is Stage.UNCONFIGURED:
        return "the managed board waits for the transition configure"
    return "the board waits for configure"


#: Why a request for a joint is not carried out.
REQUEST_TEXTS: dict[Reason, Callable[[Facts, Requested], str]] = {
    Reason.IN_FAULT: lambda facts, _: (
        f"{facts.joint.name} is in HW_FAULT ({facts.fault.text}, "
        f"{facts.time - facts.fault.stamp:.1f} s ago); send FORCE_IDLE first"
    ),
    Reason.CALIBRATING: lambda facts, _: (
        f"{facts.joint.name} is CALIBRATING; wait until it is done, or abort it with FORCE_IDLE"
    ),
    Reason.UNCALIBRATED: lambda facts, _: (
        f"{facts.joint.name} is not calibrated; {UNTIL_CALIBRATED}"
    ),
    Reason.NOT_CONFIGURED: lambda facts, _: (
        f"{facts.joint.name} is {facts.mode.name}; {waits_for(facts)}"
    ),
    Reason.INACTIVE: lambda facts, _: (
        f"{facts.joint.name} has no power while the board is inactive; {ACTIVATE}"
    ),
    Reason.UNSUPPORTED: lambda facts, requested: (
        f"{facts.joint.name} does not implement {mode_text(requested)} and is now in HW_FAULT; "
        f"it has {offered(facts, requested)}; send FORCE_IDLE, then one of these"
    ),
    Reason.CAUSE_PERSISTS: lambda facts, _: persisting(facts),
    Reason.EMERGENCY_STOP: lambda facts, _: persisting(facts),
    Reason.BRAKE_CLOSED: lambda facts, _: (
        f"the brake of {facts.joint.name} is closed by hand; set it to automatic first"
    ),
    Reason.NO_CALIBRATOR: lambda facts, _: (
        f"{facts.joint.name} has no calibrator; set {facts.joint.name}.calibration.type"
    ),
}

#: The answer of a valid joint where another one of an all-or-none request is refused.
UNCHANGED = JointAnswer(
    Answer.REFUSED, "unchanged: the request is for all joints or none", Reason.TOGETHER
)


def all_or_none(answers: Sequence[JointAnswer]) -> Sequence[JointAnswer]:
    """Answers of joints that are set together: where one could not, LEFT for those that could."""
    if not any(answer.code for answer in answers):
        return answers
    return [answer if answer.code else UNCHANGED for answer in answers]


#: Next step where a stop has no effect on a joint.
STOP_TEXTS: dict[ControlMode, Callable[[Facts], str]] = {
    **dict.fromkeys(CALIBRATES, lambda _: "abort it with FORCE_IDLE, or wait until it is done"),
    **dict.fromkeys(UNCONFIGURED, waits_for),
}
STOP_OTHERWISE = "idl disables it"


def explain(reason: Reason, facts: Facts, requested: Requested) -> str:
    """Why a request for a joint was not carried out; empty where it was."""
    return REQUEST_TEXTS[reason](facts, requested) if reason is not Reason.NONE else ""


def explain_kept(facts: Facts, requested: Requested) -> str:
    """Why a joint is not recovered: it does not implement the mode before the fault now (E1)."""
    return (
        f"{facts.joint.name} stays in {facts.mode.name}: without its torque sensor it does not "
        f"implement {mode_text(requested)}, its mode before the fault; send FORCE_IDLE, or "
        "recover it when its torque is measured again"
    )


def explain_stop(facts: Facts) -> str:
    """Why a stop had no effect on a joint."""
    advice = STOP_TEXTS[facts.mode](facts) if facts.mode in STOP_TEXTS else STOP_OTHERWISE
    return f"{facts.joint.name} is {facts.mode.name}, where stop has no effect; {advice}"


def explain_brake(reason: Reason, facts: Facts) -> str:
    """Why a brake mode was refused; empty where it was not (Y4)."""
    name, mode = facts.joint.name, facts.mode
    if reason is Reason.UNSUPPORTED:
        return f"{name} has no brake"
    if reason is Reason.OTHER_MODE:
        code = UNPOWERED.code
        return f"{name} is in {mode.name}; closing a brake by hand requires {code}; set it first"
    if reason is Reason.EMERGENCY_STOP:
        assert facts.cause is not None
        return f"the brake of {name} stays closed: {facts.cause.text}; {facts.cause.advice} first"
    return ""


def explain_stuck(facts: Facts) -> str:
    """The note on a joint whose brake did not open at the last command (Y4)."""
    return (
        f"the brake of {facts.joint.name} did not open at the last command; the next mode with "
        "power retries"
    )


def explain_reference(
    reason: Reason,
    facts: Facts,
    kind: CommandKind | None,
    values: tuple[float, ...],
    allowed: str = "",
) -> str:
    """Why a joint's part of a reference, or of a feed-forward, was ignored; empty: it was not.

    Args:
        reason: Of the verdict.
        facts: Of the joint.
        kind: Of the reference; None: feed-forward terms.
        values: The reference and its accompanying value, or the terms.
        allowed: The range of the accompanying value, in words.
    """
    if reason is Reason.NONE:
        return ""
    if reason is Reason.NOT_FINITE:
        why = not_finite(values)
    elif reason is Reason.OUT_OF_RANGE:
        why = allowed
    elif reason in OUTLIVED_TEXTS:
        why = outlived(reason, facts, kind)
    elif kind is None and reason is Reason.CALIBRATING:
        why = f"mode is {facts.mode.name}, where it has no effect"
    else:
        why = wrong_mode(reason, facts, kind)
    what = "feedforward" if kind is None else f"{kind} reference"
    return f"{what} for {facts.joint.name} ignored: {why}"


#: Why a stream is void.
OUTLIVED_TEXTS = {
    Reason.STALE: "its stream outlived a fault",
    Reason.CONTACT: "a contact stopped the joint amid its stream",
}


def outlived(reason: Reason, facts: Facts, kind: CommandKind | None) -> str:
    """Why a reference of a void stream is ignored, and how to go on (F8, X2)."""
    near = facts.joint.kind.position(facts.joint.kind.choose(NEAR_ANGLE, NEAR_DISTANCE))
    meets = kind in POSITIONS and reason is Reason.STALE
    meet = f"begin within {near} of the joint, " if meets else ""
    return f"{OUTLIVED_TEXTS[reason]}; {meet}pause for {PAUSE:g} s, or set the mode again"


def explain_bound(joint: JointConfig, kind: CommandKind, requested: float, bounded: float) -> str:
    """Effect of a limit on a reference (P1, P9, P14)."""
    shown = quantity(kind, bounded, joint.kind), quantity(kind, requested, joint.kind)
    return f"{joint.name}: {kind} bounded to {shown[0]} ({shown[1]} was requested)"


def explain_refused(
    joint: JointConfig, kind: CommandKind, requested: float, bounds: tuple[float, float]
) -> str:
    """Why a reference beyond its limits is refused where the board does not bound it (P9)."""
    low, high = (quantity(kind, bound, joint.kind) for bound in bounds)
    return (
        f"{requested:g} is {quantity(kind, requested, joint.kind)}, outside {low} to {high}; "
        "values are in SI units, and out_of_range is refuse"
    )


def explain_contact(joint: JointConfig, torque: float) -> str:
    """The torque from outside that a joint reacts to (X2)."""
    force = joint.kind.force
    return f"external torque {force(torque)}, above {force(joint.contact.threshold)}"


#: Moves shorter than this are slower than requested without a remark: rad, m of a slider.
MIN_TRAVEL_RAD, MIN_TRAVEL_M = 5e-4, 5e-5
#: What makes a move slower than requested.
JOINT_LIMITS_TEXT = "its limits of speed and acceleration"
TORQUE_LIMITS_TEXT = "the torque limits of the joints that move together"


def explain_slower(
    joint: JointConfig, way: float, speed: float, time: float, *, factor: float = 1.0
) -> str:
    """Effect of limits on a move (P1): its duration; empty where as requested.

    Args:
        joint: that moves.
        way: rad.
        speed: requested, rad/s.
        time: of the move, s.
        factor: by which the torques of the whole arm lengthen it.
    """
    least = joint.kind.choose(MIN_TRAVEL_RAD, MIN_TRAVEL_M)
    if way >= 0.99 * speed * time or way <= least:
        return ""
    mean, speed_text = joint.kind.velocity(way / time), joint.kind.velocity(speed)
    return (
        f"{joint.name}: {time:.3g} s at a mean speed of {mean} ({speed_text} was requested), "
        f"bounded by {TORQUE_LIMITS_TEXT if factor > 1.0 else JOINT_LIMITS_TEXT}"
    )


def explain_cut(joint: JointConfig, positions: Sequence[float]) -> str:
    """What the software limits cut of a path, from its first point beyond; empty: nothing (P9)."""
    low, high = joint.limits.lower, joint.limits.upper
    beyond = next((i for i, q in enumerate(positions) if q < low or q > high), None)
    if beyond is None:
        return ""
    shown = [joint.kind.position(q) for q in (low, high, positions[beyond])]
    return (
        f"{joint.name} stays within {shown[0]} to {shown[1]} "
        f"(point {beyond} requests {shown[2]}): software limit"
    )


#: Least speed and acceleration of a request, per s: the longest move is then of a rad or a m.
LEAST_RATE = 1.0 / LONGEST


def range_text(what: str | None, value: float, highest: float, unit: str) -> str:
    """The range of a reference's accompanying value, in words."""
    digits = ".6g" if f"{value:.6g}" != f"{highest:.6g}" else ".17g"
    allowed = f"from {LEAST_RATE:g} to {highest:{digits}} {unit}"
    return f"{what} must be {allowed}, not {value:{digits}}"


#: Why a joint accepts no references of any kind.
WITHHELD_TEXTS: dict[Reason, Callable[[Facts], str]] = {
    Reason.IN_FAULT: lambda facts: (
        f"mode is {facts.mode.name} ({facts.fault.text}), which FORCE_IDLE leaves"
    ),
    Reason.EMERGENCY_STOP: lambda facts: (
        f"mode is {facts.mode.name} ({facts.fault.text}); {advised(facts)}, then send FORCE_IDLE"
    ),
    Reason.NOT_CONFIGURED: lambda facts: f"mode is {facts.mode.name}; {waits_for(facts)}",
    Reason.INACTIVE: lambda _: f"the board is inactive; {ACTIVATE}",
    Reason.CALIBRATING: lambda facts: f"mode is {facts.mode.name}; wait until it is done",
    Reason.UNCALIBRATED: lambda _: f"it is not calibrated; {UNTIL_CALIBRATED}",
}


def wrong_mode(reason: Reason, facts: Facts, kind: CommandKind | None) -> str:
    """Why a joint accepts no references of a kind now, and in which modes it does."""
    if kind is None or reason in WITHHELD_TEXTS:
        return WITHHELD_TEXTS[reason](facts)
    codes = [m.code for m in modes_accepting(kind) if m in facts.joint.control_modes]
    hint = f"it is accepted in {', '.join(codes)}" if codes else "the joint has no mode for it"
    return f"mode is {facts.mode.name}; {hint}"


def advised(facts: Facts) -> str:
    """What ends the cause of a fault that persists."""
    assert facts.cause is not None
    return facts.cause.advice


def persisting(facts: Facts) -> str:
    """Why a fault cannot be cleared yet (F2)."""
    assert facts.cause is not None
    return (
        f"{facts.joint.name} stays in {facts.mode.name}: the cause persists "
        f"({facts.cause.code.title}, {facts.cause.text}); {facts.cause.advice}, "
        "then send FORCE_IDLE again"
    )


def not_finite(values: tuple[float, ...]) -> str:
    """The text on the first value that is not a finite number."""
    bad = next(value for value in values if not math.isfinite(value))
    return f"{bad} is not a finite number"


def mode_text(requested: Requested) -> str:
    """A mode as code and name."""
    return (
        requested.name if isinstance(requested, Event) else f"{requested.code} ({requested.name})"
    )


def offered(facts: Facts, requested: Requested) -> str:
    """The modes that a joint implements, as alternatives to one that it does not."""
    joint = facts.joint
    compliant = isinstance(requested, InteractionMode)
    have = joint.interaction_modes if compliant else joint.control_modes
    return ", ".join(mode.code for mode in have)
