# SPDX-License-Identifier: Apache-2.0
"""Verdicts in words: one line each with cause, value, what is allowed, and the next step.

The only place where the texts of replies about single joints are made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from .config import JointConfig
from .decisions import Facts, Reason, Wanted
from .modes import CALIBRATES, FAULTED, MOVES, UNCONFIGURED, Event, Stage, modes_accepting
from .reply import position_text, quantity
from .vocabs import CommandKind, ControlMode, InteractionMode

ACTIVATE = "activate it first (transition activate of its lifecycle)"


def how_to_configure(facts: Facts) -> str:
    """What lets a joint leave NOT_CONFIGURED (N2)."""
    if facts.stage is Stage.UNCONFIGURED:
        return "configure its node first (transition configure of its lifecycle)"
    return "configure the board first (service configure)"


#: Why a request for a joint is not carried out.
REQUEST_TEXTS: dict[Reason, Callable[[Facts, Wanted], str]] = {
    Reason.IN_FAULT: lambda facts, _: (
        f"{facts.joint.name} is in HW_FAULT ({facts.fault.text}, "
        f"{facts.time - facts.fault.stamp:.1f} s ago); send FORCE_IDLE first"
    ),
    Reason.CALIBRATING: lambda facts, _: (
        f"{facts.joint.name} is CALIBRATING; wait until it is done, or abort it with FORCE_IDLE"
    ),
    Reason.UNCALIBRATED: lambda facts, _: (
        f"{facts.joint.name} is not calibrated; "
        f"calibrate it first: cbctl calibrate {facts.joint.name}"
    ),
    Reason.NOT_CONFIGURED: lambda facts, _: (
        f"{facts.joint.name} is {facts.mode.name}; {how_to_configure(facts)}"
    ),
    Reason.INACTIVE: lambda facts, _: (
        f"{facts.joint.name} has no power while its node is inactive; {ACTIVATE}"
    ),
    Reason.UNSUPPORTED: lambda facts, wanted: (
        f"{facts.joint.name} does not implement {asked(wanted)} and is now in HW_FAULT; "
        f"it has {offered(facts, wanted)}; send FORCE_IDLE, then one of these"
    ),
    Reason.CAUSE_PERSISTS: lambda facts, _: persisting(facts),
    Reason.NO_CALIBRATOR: lambda facts, _: (
        f"{facts.joint.name} has no calibrator; give it {facts.joint.name}.calibration.type"
    ),
}

#: Why a joint that could is not set either, where joints are set together or not at all.
LEFT_AS_IT_IS = "the others of the request stay as they are"

#: What to do where a stop does nothing to a joint.
STOP_TEXTS: dict[ControlMode, Callable[[Facts], str]] = {
    **dict.fromkeys(CALIBRATES, lambda _: "abort it with FORCE_IDLE, or wait until it is done"),
    **dict.fromkeys(UNCONFIGURED, how_to_configure),
}
STOP_OTHERWISE = "set idl to take its power"


def explain(reason: Reason, facts: Facts, wanted: Wanted) -> str:
    """Why a request for a joint was not carried out; empty where it was."""
    return REQUEST_TEXTS[reason](facts, wanted) if reason is not Reason.NONE else ""


def explain_stop(facts: Facts) -> str:
    """Why a stop did nothing to a joint."""
    advice = STOP_TEXTS[facts.mode](facts) if facts.mode in STOP_TEXTS else STOP_OTHERWISE
    return f"{facts.joint.name} is {facts.mode.name}, where stop does nothing; {advice}"


def explain_reference(
    reason: Reason, facts: Facts, kind: CommandKind, values: tuple[float, ...], allowed: str = ""
) -> str:
    """Why a joint's part of a reference was ignored; empty where it was not.

    Args:
        reason: Of the verdict.
        facts: Of the joint.
        kind: Of the reference.
        values: It, and what came along.
        allowed: What may come along, in words.
    """
    if reason is Reason.NONE:
        return ""
    if reason is Reason.NOT_FINITE:
        why = not_finite(values)
    elif reason is Reason.OUT_OF_RANGE:
        why = allowed
    else:
        why = wrong_mode(reason, facts, kind)
    return f"{kind} reference for {facts.joint.name} ignored: {why}"


def explain_feedforward(reason: Reason, facts: Facts, values: tuple[float, ...]) -> str:
    """Why a joint's part of a feed-forward was ignored; empty where it was not."""
    if reason is Reason.NONE:
        return ""
    mode = f"mode is {facts.mode.name}, where none acts"
    why = mode if reason is Reason.NO_FEEDFORWARD else not_finite(values)
    return f"feedforward for {facts.joint.name} ignored: {why}"


def explain_bound(joint: JointConfig, kind: CommandKind, asked: float, taken: float) -> str:
    """What a limit made of a reference (P1, P9, P14)."""
    sliding = joint.kind == "prismatic"
    shown = quantity(kind, taken, sliding), quantity(kind, asked, sliding)
    return f"{joint.name}: {kind} bounded to {shown[0]} ({shown[1]} was asked for)"


def explain_limit(joint: JointConfig, position: float) -> str:
    """Where a joint is that its protection pushes back into its software limits (P9)."""
    limits = joint.limits
    beyond = max(limits.lower - position, position - limits.upper)
    at, over, low, high = (
        position_text(joint.kind, value)
        for value in (position, beyond, limits.lower, limits.upper)
    )
    where = f"{over} beyond" if beyond > 0.0 else "at"
    return f"at {at}, {where} its software limits, {low} to {high}; the protection pushes it back"


#: Moves shorter than this are slower than asked for without a word: rad, m where a joint slides.
WORTH_A_WORD = {"revolute": 5e-4, "continuous": 5e-4, "prismatic": 5e-5}


def explain_slower(joint: JointConfig, way: float, speed: float, time: float) -> str:
    """What limits make of a move (P1): how long it takes; empty where that is as asked for.

    Args:
        joint: that moves.
        way: rad.
        speed: asked for, rad/s.
        time: of the move, s.
    """
    if way >= 0.99 * speed * time or way <= WORTH_A_WORD[joint.kind]:
        return ""
    sliding = joint.kind == "prismatic"
    mean = quantity(CommandKind.VELOCITY, way / time, sliding)
    return (
        f"{joint.name}: takes {time:.3g} s, at a mean speed of {mean} "
        f"({quantity(CommandKind.VELOCITY, speed, sliding)} was asked for), "
        "by its limits of speed and acceleration"
    )


def explain_cut(joint: JointConfig, positions: Sequence[float]) -> str:
    """What the software limits cut of a path, from its first point beyond; empty: nothing (P9)."""
    low, high = joint.limits.lower, joint.limits.upper
    beyond = next((i for i, q in enumerate(positions) if q < low or q > high), None)
    if beyond is None:
        return ""
    shown = [position_text(joint.kind, q) for q in (low, high, positions[beyond])]
    return (
        f"{joint.name} stays within {shown[0]} to {shown[1]} "
        f"(point {beyond} asks for {shown[2]}): software limit"
    )


def range_text(what: str | None, value: float, most: float) -> str:
    """What may come along with a reference."""
    digits = ".6g" if f"{value:.6g}" != f"{most:.6g}" else ".17g"
    return f"{what} must be above 0 and up to {most:{digits}}, not {value:{digits}}"


#: Why a joint takes no references, whatever their kind.
WITHHELD_TEXTS: dict[Reason, Callable[[Facts], str]] = {
    Reason.IN_FAULT: lambda facts: (
        f"mode is {facts.mode.name} ({facts.fault.text}); "
        f"clear it with: cbctl clear {facts.joint.name}"
    ),
    Reason.NOT_CONFIGURED: lambda facts: f"mode is {facts.mode.name}; {how_to_configure(facts)}",
    Reason.INACTIVE: lambda _: f"its node is inactive; {ACTIVATE}",
    Reason.CALIBRATING: lambda facts: f"mode is {facts.mode.name}; wait until it is done",
    Reason.UNCALIBRATED: lambda facts: (
        f"it is not calibrated; calibrate it first: cbctl calibrate {facts.joint.name}"
    ),
}


def wrong_mode(reason: Reason, facts: Facts, kind: CommandKind) -> str:
    """Why a joint takes no references of a kind now, and what to do."""
    if reason in WITHHELD_TEXTS:
        return WITHHELD_TEXTS[reason](facts)
    name, mode = facts.joint.name, facts.mode.name
    codes = [m.code for m in modes_accepting(kind) if m in facts.joint.control_modes]
    if not codes:
        return f"mode is {mode}, and the joint has no mode for it"
    return f"mode is {mode}; switch with: cbctl mode {name} {codes[0]}"


def way_to_move(modes: Mapping[str, ControlMode], everyone: Sequence[str]) -> str:
    """What to type so that joints take position moves.

    Args:
        modes: of those that take none, by name.
        everyone: the names of all joints of the board.
    """
    words = "all" if len(modes) == len(everyone) else " ".join(modes)
    faulty = [name for name, mode in modes.items() if mode in FAULTED]
    if faulty:
        first = f"clear with: cbctl clear {' '.join(faulty)}, then "
    elif not CALIBRATES.isdisjoint(modes.values()):
        first = "wait until they have calibrated, then "
    elif not UNCONFIGURED.isdisjoint(modes.values()):
        first = "configure with: cbctl configure, then "
    else:
        first = ""
    return f"{first}switch with: cbctl mode {words} {MOVES.code}"


def persisting(facts: Facts) -> str:
    """Why a fault cannot be cleared yet (F2)."""
    assert facts.cause is not None
    return (
        f"{facts.joint.name} stays in {facts.mode.name}: the cause persists "
        f"({facts.cause.code.title}, {facts.cause.text}); {facts.cause.advice}, "
        "then send FORCE_IDLE again"
    )


def not_finite(values: tuple[float, ...]) -> str:
    """Which of the values is none."""
    bad = next(value for value in values if not math.isfinite(value))
    return f"{bad} is not a finite number"


def asked(wanted: Wanted) -> str:
    """A mode as code and name."""
    return wanted.name if isinstance(wanted, Event) else f"{wanted.code} ({wanted.name})"


def offered(facts: Facts, wanted: Wanted) -> str:
    """What a joint has instead of a mode that it does not implement."""
    joint = facts.joint
    compliant = isinstance(wanted, InteractionMode)
    have = joint.interaction_modes if compliant else joint.control_modes
    return ", ".join(mode.code for mode in have)
