# SPDX-License-Identifier: Apache-2.0
"""How a joint stands whose move has ended, and what is said of it (SPEC P3, I4)."""

from __future__ import annotations

import math
from typing import Any

import pytest

from control_board_ros.core.goals.tasks import Standing, ending, standing, tolerance
from control_board_ros.core.terms.joint_kind import JointKind

S = Standing
TURNS, SLIDES = JointKind.REVOLUTE, JointKind.PRISMATIC


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
def test_standings(
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
    found = standing(
        0.5,
        0.5 + (reference - 1.0) * near,
        velocity,
        0.5 + (position - 1.0) * near,
        tolerance=near,
        compliant=compliant,
        since=since,
    )
    assert found is expected


def test_metres_are_not_radians() -> None:
    """A blocked sliding joint 5 mm from its target has not arrived; 5 mrad are near enough."""
    values: dict[str, Any] = {"compliant": False, "since": 2.0}
    assert tolerance(SLIDES) == 1e-3
    assert math.isclose(tolerance(TURNS), 0.01)
    for kind, expected in ((SLIDES, S.AWAY), (TURNS, S.ARRIVED)):
        found = standing(0.02, 0.02, 0.0, 0.015, tolerance=tolerance(kind), **values)
        assert found is expected


def test_what_is_said() -> None:
    """One line with the joint, where it is, in its unit, why, and what to do."""
    assert ending("a", TURNS, S.ARRIVED, 1.0, 1.001) == ""
    assert ending("a", TURNS, S.ARRIVED, 1.0, 0.999, compliant=True) == ""
    text = ending("a", TURNS, S.ARRIVED, -1.0, -0.9, compliant=True)
    assert text.startswith("a is at -51.6°, its reference at -57.3°: it is COMPLIANT")
    text = ending("a", TURNS, S.DROPPED, -1.0, 0.17, changed="its mode became COMPLIANT")
    assert text.startswith("a is at 9.7°, not at its target -57.3°: its mode became COMPLIANT")
    assert "it was stopped" in ending("a", TURNS, S.DROPPED, -1.0, 0.17)
    text = ending("f", SLIDES, S.AWAY, 0.04, 0.031)
    assert text.startswith("f is at 31.0 mm, 9.0 mm away from its target 40.0 mm: it is blocked")
