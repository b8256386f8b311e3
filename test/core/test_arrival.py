# SPDX-License-Identifier: Apache-2.0
"""Status and text of a joint whose move has ended (SPEC P3, I4)."""

from __future__ import annotations

import math
from typing import Any

import pytest

from control_board_ros.core.goals.tasks import JointMove, JointNow, Standing, tolerance
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

M, S = ControlMode, Standing
STIFF, COMPLIANT = InteractionMode.STIFF, InteractionMode.COMPLIANT
TURNS, SLIDES = JointKind.REVOLUTE, JointKind.PRISMATIC


def to(target: float, kind: JointKind = TURNS, control: M = M.POSITION) -> JointMove:
    """The move of a joint that was STIFF when it began."""
    return JointMove("a", kind, target, control, STIFF)


def now(position: float, reference: float = 0.0, velocity: float = 0.0, **modes: Any) -> JointNow:
    """A joint in POSITION and STIFF by default."""
    given = {"control": M.POSITION, "interaction": STIFF} | modes
    return JointNow(position, reference, velocity, **given)


@pytest.mark.parametrize("kind", JointKind)
@pytest.mark.parametrize(
    ("reference", "velocity", "position", "compliant", "since", "expected"),
    [
        (1.0, 0.0, 1.0, False, 0.0, S.ARRIVED),
        (1.0, 0.0, 0.9, False, 0.0, S.ARRIVED),
        (1.0, 0.0, -1.1, False, 0.0, S.SETTLING),
        (1.0, 0.0, -1.1, False, 0.99, S.SETTLING),
        (1.0, 0.0, -1.1, False, 1.0, S.AWAY),
        (1.0, 0.0, -9.0, True, 0.0, S.ARRIVED),  # a spring gives way
        (-3.0, 0.0, -3.0, False, 0.0, S.DROPPED),
        (-3.0, 0.0, -3.0, True, 9.0, S.DROPPED),
        (-3.0, 0.1, 1.0, False, 0.0, S.SETTLING),  # the reference is on its way still
        (-3.0, 0.1, 1.0, True, 1.0, S.AWAY),
    ],
)
def test_statuses_of_moves(
    kind: JointKind,
    reference: float,
    velocity: float,
    position: float,
    compliant: bool,
    since: float,
    expected: Standing,
) -> None:
    """P3, I4: in multiples of the tolerance of each kind of joint, from a target of 1."""
    near = tolerance(kind)
    position, reference = (0.5 + (value - 1.0) * near for value in (position, reference))
    one = now(position, reference, velocity, interaction=COMPLIANT if compliant else STIFF)
    assert to(0.5, kind).standing(one, since) is expected


def test_metres_are_not_radians() -> None:
    """A blocked sliding joint 5 mm from its target has not arrived; 5 mrad are near enough."""
    assert tolerance(SLIDES) == 1e-3
    assert math.isclose(tolerance(TURNS), 0.01)
    for kind, expected in ((SLIDES, S.AWAY), (TURNS, S.ARRIVED)):
        assert to(0.02, kind).standing(now(0.015, 0.02), 2.0) is expected


def test_texts_of_moves_that_end() -> None:
    """One line with the joint, where it is, in its unit, why, and what to do."""
    assert to(1.0).ending(S.ARRIVED, now(1.001)) == ""
    assert to(1.0).ending(S.ARRIVED, now(0.999, interaction=COMPLIANT)) == ""
    move, dropped = to(-1.0), now(0.17)
    text = move.ending(S.ARRIVED, now(-0.9, interaction=COMPLIANT))
    assert text.startswith("a is at -51.6°, its reference at -57.3°: it is COMPLIANT")
    text = move.ending(S.DROPPED, dropped._replace(interaction=COMPLIANT))
    assert text.startswith("a is at 9.7°, not at its target -57.3°: its interaction mode became")
    assert "its control mode became MIXED" in move.ending(S.DROPPED, now(0.17, control=M.MIXED))
    assert ": it was stopped during" in move.ending(S.DROPPED, dropped)
    text = to(-1.0, control=M.MIXED).ending(S.DROPPED, now(0.17, control=M.MIXED))
    assert "it was stopped, or a velocity moved it during" in text
    text = to(0.04, SLIDES).ending(S.AWAY, now(0.031))
    assert text.startswith("a is at 31.0 mm, 9.0 mm away from its target 40.0 mm: it is blocked")
