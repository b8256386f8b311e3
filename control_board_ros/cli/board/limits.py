# SPDX-License-Identifier: Apache-2.0
"""Targets held against the limits that a board has in force."""

from __future__ import annotations

from collections.abc import Mapping

from control_board_ros.core.terms.joint_kind import JointKind

from ...joint_limits import JointLimits
from ..line.words import Quantity, Refused

#: What comes after the unit of a position in that of each quantity that turns with it.
RATES = {"position": "", "speed": "/s", "acceleration": "/s²"}


def check_limits(
    what: str,
    given: Mapping[str, Quantity],
    limits: Mapping[str, JointLimits | None],
    kinds: Mapping[str, JointKind],
) -> None:
    """Refuse values beyond the limits, before anything moves.

    Args:
        what: the values are: position, speed, acceleration, torque, current or output.
        given: by joint.
        limits: likewise; None of a joint that is not known: the board itself decides.
        kinds: of the joints.

    Raises:
        Refused: what was understood, in both units, and what is allowed.
    """
    wrong = []
    for name, value in given.items():
        known, kind = limits.get(name), kinds.get(name, JointKind.REVOLUTE)
        if known is not None and not within(what, value.value, known, kind):
            wrong.append(f"{name}: {outside(what, value, known, kind)}")
    if wrong:
        raise Refused("; ".join(wrong))


def within(what: str, value: float, limits: JointLimits, kind: JointKind) -> bool:
    """Whether a value is within its limits, as they are shown: half of the last digit more."""
    slack = 0.5 * kind.resolution if what in RATES else 0.0
    low, high = limits.range(what)
    return low - slack <= value <= high + slack


def outside(what: str, given: Quantity, limits: JointLimits, kind: JointKind) -> str:
    """What is wrong with a value, and what it may have meant."""
    low, high = limits.range(what)
    value = given.value
    if what not in RATES:
        unit = {"torque": kind.force_unit, "current": "A"}.get(what, "%")
        return f"{value:.4g} {unit} is beyond its limit, {high:.4g} {unit}"
    unit = kind.unit + RATES[what]
    shown, least, most = (kind.position(q, RATES[what]) for q in (value, low, high))
    text = f"{value:.4g} {unit} = {shown} is "
    if what == "position":
        text += f"outside its limits, {low:.4g} to {high:.4g} {unit} = {least} to {most}"
    else:
        text += f"beyond its limit, {high:.4g} {unit} = {most}"
    if not given.dimension and within(what, value / kind.shown_factor, limits, kind):
        text += f"; did you mean {value:g}{kind.choose('deg', 'mm')}?"
    return text
