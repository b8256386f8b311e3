# SPDX-License-Identifier: Apache-2.0
"""Whether a position move has come to its end: pure functions, one joint at a time (SPEC P3).

A move that ends by itself leaves the position reference on its target. One that was dropped (by
a stop, another interaction mode, another control mode: M9, I4) leaves it at rest elsewhere.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

from ..terms.joint_kind import JointKind

#: How near to its target a joint has arrived, rad, and m where it slides.
TOLERANCE, SLIDE_TOLERANCE = 0.01, 0.001

#: s of simulated time that joints get to arrive after their profiles have ended.
SETTLING = 1.0

#: Part of the tolerance by which the reference may miss the target of a move that has ended.
EXACT = 0.1


class Outcome(NamedTuple):
    """How a task ended; the message is one line, or empty."""

    success: bool
    message: str


class Standing(Enum):
    """Status of a joint after the end of its profile."""

    ARRIVED = auto()
    SETTLING = auto()  # on its way still
    DROPPED = auto()  # the move was ended by something else
    AWAY = auto()  # it had its time and is not there


def tolerance(kind: JointKind) -> float:
    """How near to its target a joint of a kind has arrived, rad or m."""
    return kind.choose(TOLERANCE, SLIDE_TOLERANCE)


def standing(
    target: float,
    reference: float,
    reference_velocity: float,
    position: float,
    *,
    tolerance: float,
    compliant: bool,
    since: float,
) -> Standing:
    """Status of a joint after its motion.

    ARRIVED: |reference − target| ≤ 0.1 tolerance and, unless compliant, |position − target| ≤
    tolerance. A spring gives way by design, so a compliant joint is judged by its reference.

    Args:
        target: of the move, rad or m.
        reference: position reference in force, rad or m.
        reference_velocity: in force, rad/s or m/s.
        position: measured, rad or m.
        tolerance: see ``tolerance``.
        compliant: whether the interaction mode is COMPLIANT.
        since: time since the profile has ended, s.
    """
    reached = abs(reference - target) <= EXACT * tolerance
    if reached and (compliant or abs(position - target) <= tolerance):
        return Standing.ARRIVED
    if not reached and reference_velocity == 0.0:
        return Standing.DROPPED
    return Standing.SETTLING if since < SETTLING else Standing.AWAY


def ending(
    name: str,
    kind: JointKind,
    found: Standing,
    target: float,
    position: float,
    *,
    changed: str = "",
    compliant: bool = False,
) -> str:
    """One line about a joint whose move has ended; empty when it is where it should be.

    Args:
        name: of the joint.
        kind: of the joint, for the unit and the tolerance.
        found: not SETTLING.
        target: of the move, rad or m.
        position: measured, rad or m.
        changed: which of its modes changed during the move, and to what.
        compliant: whether the interaction mode is COMPLIANT.
    """
    where, wanted = f"{name} is at {kind.position(position)}", kind.position(target)
    away = abs(position - target)
    if found is Standing.ARRIVED:
        if not compliant or away <= tolerance(kind):
            return ""
        return f"{where}, its reference at {wanted}: it is COMPLIANT and gives way to its load"
    if found is Standing.DROPPED:
        cause = changed or "it was stopped"
        return f"{where}, not at its target {wanted}: {cause} during the move; send it again"
    return (
        f"{where}, {kind.position(away)} away from its target {wanted}: it is blocked, "
        "its reference was moved by something else, or its gains are too low"
    )
