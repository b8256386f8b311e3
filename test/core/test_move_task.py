# SPDX-License-Identifier: Apache-2.0
"""A move of several joints: accepted whole, watched, ended (SPEC P1, P3)."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rig import Rig, with_a_slide

from control_board_ros.core.goals.tasks import MoveTask, Outcome


@pytest.fixture
def rig() -> Rig:
    return with_a_slide()


def outcome(rig: Rig, move: MoveTask, seconds: float = 8.0) -> Outcome:
    """Look every 50 ms until the move has ended."""
    for _ in range(round(seconds / 0.05)):
        rig.run(0.05)
        found = move.outcome()
        if found is not None:
            return found
    raise AssertionError(f"not ended after {seconds} s")


def test_a_move_that_arrives_succeeds(rig: Rig) -> None:
    """P1: with nothing to say."""
    assert outcome(rig, MoveTask(rig.board, ["a", "c"], [0.3, 0.02], [1.0, 0.1])) == (
        True,
        "",
    )


ENDS: dict[str, tuple[Callable[[Any], Any], str]] = {
    "stop": (lambda board: board.stop("a"), "it was stopped during the move"),
    "compliant": (
        lambda board: board.set_interaction_mode("a", "comp"),
        "its interaction mode became COMPLIANT",
    ),
    "mixed": (lambda board: board.set_control_mode("a", "mix"), "its control mode became MIXED"),
    "away and back": (
        lambda board: [board.set_control_mode("a", mode) for mode in ("vel", "pos")],
        "it was stopped during the move",
    ),
}


@pytest.mark.parametrize("names", [["a"], ["a", "b"]])
@pytest.mark.parametrize("way", ENDS)
def test_a_move_that_was_dropped_fails(rig: Rig, way: str, names: list[str]) -> None:
    """P3, I4, M9: done is not arrived; the message says where the joint is and why."""
    act, text = ENDS[way]
    move = MoveTask(rig.board, names, [-1.0] * len(names), [0.5] * len(names))
    rig.run(0.8)
    assert move.outcome() is None
    act(rig.board)
    success, message = outcome(rig, move)
    assert not success
    assert message.startswith("a is at -")
    assert "not at its target -57.3°" in message
    assert text in message
    rig.run(1.0)
    assert rig.board.get_encoder("a")[0] > -0.9


def test_a_compliant_joint_is_judged_by_its_reference(rig: Rig) -> None:
    """I5: a spring gives way to a push; the message says where the joint is."""
    assert rig.board.set_interaction_mode("a", "comp")
    rig.plant.push("a", 5.0)
    success, message = outcome(rig, MoveTask(rig.board, ["a"], [0.2], [0.5]))
    assert success
    assert re.match(r"a is at 1[4-8]\.\d*°", message)
    assert "its reference at 11.5°" in message


def test_a_blocked_sliding_joint_fails(rig: Rig) -> None:
    """A tolerance of 1 mm, not of 10: a finger 5 mm away has not arrived."""
    rig.plant.push("c", -22.0)  # 20 N is what the integral part may give, the rest is 400 N/m
    rig.run(10.0)
    success, message = outcome(rig, MoveTask(rig.board, ["c"], [0.02], [0.1]))
    assert not success
    assert re.match(r"c is at 1\d\.\d mm, \d\.\d mm away from its target 20\.0 mm", message)


#: One of each kind; references are refused in test_commands.py and test_selection.py.
REFUSED = [
    (["a", "b"], [0.5, 0.5], None, "VELOCITY"),
    (["a", "b"], [0.5, float("nan")], None, "nan"),
    (["a", "b"], [0.5, 0.5], [0.5, 1e3], "to 3 rad/s, not 1000"),
    (["a", "b"], [0.5, 0.5], [0.5], "1 speed for 2 joints"),
    (["a", "nobody"], [0.5, 0.5], None, "unknown"),
]


@pytest.mark.parametrize(("names", "positions", "speeds", "text"), REFUSED)
def test_a_refused_goal_stops_nothing(
    rig: Rig, names: list[str], positions: list[float], speeds: list[float] | None, text: str
) -> None:
    """M4, P13: a running move of the same joints goes on to its end, on time."""
    running = MoveTask(rig.board, ["a"], [-1.0], [0.5])
    rig.run(0.5)
    if text == "VELOCITY":
        assert rig.board.set_control_mode("b", "vel")
    left = rig.board.get_remaining_time("a")[0]
    reference = rig.board.snapshot().position_reference.copy()
    with pytest.raises(ValueError, match=text):
        MoveTask(rig.board, names, positions, speeds)
    assert rig.board.get_remaining_time("a")[0] == left
    np.testing.assert_array_equal(rig.board.snapshot().position_reference, reference)
    assert outcome(rig, running) == (True, "")


def test_a_failed_goal_stops_its_own_joints_only(rig: Rig) -> None:
    """P3: a single joint that leaves its mode does not stop the board."""
    alone = MoveTask(rig.board, ["a"], [-1.0], [0.5])
    other = MoveTask(rig.board, ["b"], [0.8], [0.5])
    rig.run(0.3)
    assert rig.board.set_control_mode("a", "vel")
    success, message = outcome(rig, alone)
    assert not success
    assert "a left for VELOCITY" in message
    assert outcome(rig, other) == (True, "")


def test_a_failed_goal_leaves_joints_that_others_move(rig: Rig) -> None:
    """P1: what another move took over in the meantime goes on."""
    first = MoveTask(rig.board, ["a", "b"], [-1.0, 1.0], [0.5, 0.5])
    rig.run(0.3)
    second = MoveTask(rig.board, ["b"], [0.5], [0.5])
    assert rig.board.set_control_mode("a", "vel")
    assert not outcome(rig, first)[0]
    assert outcome(rig, second) == (True, "")


def test_a_target_beyond_the_limits_succeeds_with_a_text(rig: Rig) -> None:
    """P1, P9: it arrives at the limit; the result says what was asked and what was done."""
    success, message = outcome(rig, MoveTask(rig.board, ["a"], [2.6], [1.2]))
    assert success
    assert message.startswith("a: position bounded to 114.6° (149.0° was requested)")
    assert rig.board.get_encoder("a")[0] == pytest.approx(2.0, abs=0.01)
