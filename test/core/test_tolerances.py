# SPDX-License-Identifier: Apache-2.0
"""By how much a joint may be away from a trajectory (SPEC T1)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from control_board_ros.core.goals.path import (
    Excess,
    Tolerances,
    Wish,
    Wishes,
    excess,
    explain,
    goal_tolerances,
    resolve,
)
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.joint_kind import JointKind

DEFAULTS = Tolerances(
    path=np.array([[0.1, 0.1], [0.0, 0.0]]),
    goal=np.array([[0.2, 0.2], [0.01, 0.01]]),
    goal_time=1.0,
)


@pytest.mark.parametrize(
    ("default", "wish", "result"),
    [(0.1, 0.0, 0.1), (0.1, 0.3, 0.3), (0.1, -1.0, 0.0), (0.1, -7.0, 0.0), (0.0, 0.0, 0.0)],
)
def test_zero_leaves_the_default_and_a_negative_number_removes_it(
    default: float, wish: float, result: float
) -> None:
    assert resolve(default, wish) == result


def test_a_goal_names_tolerances_in_any_order() -> None:
    """Those of joints outside the goal are passed over; what is not named is as configured.

    0 leaves the default of its own quantity, whatever is wished of the other.
    """
    made = goal_tolerances(
        DEFAULTS,
        ("b", "a"),
        ("a", "b", "c"),
        Wishes(
            path=[Wish("a", 0.0, 0.4), Wish("c", 9.0, 9.0)],
            goal=[Wish("b", -1.0, 0.0)],
            goal_time=-1.0,
        ),
    )
    np.testing.assert_array_equal(made.path, [[0.1, 0.1], [0.0, 0.4]])
    np.testing.assert_array_equal(made.goal, [[0.0, 0.2], [0.01, 0.01]])
    assert made.goal_time == 0.0
    np.testing.assert_array_equal(DEFAULTS.path, [[0.1, 0.1], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("wish", "text"),
    [
        (Wish("elbow", 0.1, 0.0), "goal_tolerance names 'elbow', which is no joint"),
        (Wish("a", math.nan, 0.0), "goal_tolerance of a is not finite"),
        (Wish("a", 0.0, math.inf), "goal_tolerance of a is not finite"),
    ],
)
def test_invalid_tolerances_are_refused(wish: Wish, text: str) -> None:
    with pytest.raises(RequestError, match=text):
        goal_tolerances(DEFAULTS, ("a", "b"), ("a", "b"), Wishes(goal=[wish]))


def test_the_farthest_beyond_is_found() -> None:
    """By the ratio to its own tolerance; 0 is no limit, and the limit itself is allowed."""
    tolerances = np.array([[0.1, 0.2, 0.0], [0.0, 0.0, 0.5]])
    assert excess(np.array([[0.1, -0.2, 9.0], [9.0, 9.0, -0.5]]), tolerances) is None
    found = excess(np.array([[0.15, -0.4, 9.0], [9.0, 9.0, 0.6]]), tolerances)
    assert found == Excess(1, "position", 0.4, 0.2)
    assert excess(np.zeros((2, 3)), np.zeros((2, 3))) is None


def test_the_text_names_joint_amount_and_tolerance_with_units() -> None:
    assert explain(Excess(0, "position", 0.4, 0.2), "elbow", JointKind.REVOLUTE, "path") == (
        "elbow is 0.4 rad away from the position it should have; its path tolerance is 0.2 rad"
    )
    assert explain(Excess(0, "velocity", 0.04, 0.02), "lift", JointKind.PRISMATIC, "goal") == (
        "lift is 0.04 m/s away from the velocity it should have; its goal tolerance is 0.02 m/s"
    )
