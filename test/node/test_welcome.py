# SPDX-License-Identifier: Apache-2.0
"""What the board suggests to try at its start can be done (P9, K2)."""

from __future__ import annotations

import math

import pytest
from rig import board_config, joint

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.process.console import (
    first_target,
    ros2_lines,
    suggestions,
    table,
    welcome,
)

M = ControlMode


@pytest.mark.parametrize(
    ("lower", "upper"), [(-1.6, 0.14), (-2.0, 2.0), (0.7, 1.5), (-2.2, -1.0), (0.0, 0.04)]
)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_the_target_is_within_the_limits(lower: float, upper: float, kind: str) -> None:
    """P9: also where 30 degrees or 20 mm are not; 30 degrees or 20 mm where they are."""
    limits = {"lower": lower, "upper": upper}
    made = joint("slide", kind=kind, limits=limits)
    target = first_target(made)
    assert lower < target < upper
    _, words = suggestions(made, M.POSITION)
    value = words[0].removeprefix("move slide=")
    shown = float(value[:-2]) * 1e-3 if kind == "prismatic" else math.radians(float(value[:-3]))
    assert lower < shown < upper
    assert f"positions: [{target:.3g}]" in ros2_lines("/board", made)[1]


@pytest.mark.parametrize(
    ("mode", "when", "first"),
    [
        (M.POSITION, "Try", "move a=30deg"),
        (M.MIXED, "Try", "move a=30deg"),
        (M.IDLE, "Try", "mode a pos"),
        (M.CALIBRATING, "When they have calibrated, try", "mode a pos"),
        (M.NOT_CONFIGURED, "Try", "configure"),
    ],
)
def test_the_mode_accepts_the_suggested_command(mode: ControlMode, when: str, first: str) -> None:
    """K2, M3: a move is suggested where the joint takes one, and when."""
    found, words = suggestions(joint("a"), mode)
    assert (found, words[0]) == (when, first)
    assert words[-1] == "move a=30deg"


def test_a_managed_node_reports_its_next_step() -> None:
    """N2: cbctl configure does not configure it; its transitions do."""
    config = board_config(joint("a"))
    alone = welcome("/control_board", config, [M.NOT_CONFIGURED])
    assert "joints in NOT_CONFIGURED. Try:\n  cbctl configure\n  cbctl mode a pos\n" in alone
    managed = welcome("/left/arm", config, [M.NOT_CONFIGURED], managed=True)
    assert (
        "ros2 lifecycle set /left/arm configure\n  ros2 lifecycle set /left/arm activate"
        in managed
    )
    assert "cbctl --board /left/arm configure" not in managed
    assert "try:\n  cbctl --board /left/arm mode a pos\n" in managed


def test_a_joint_without_position_control() -> None:
    """M5: no move is suggested to a joint that knows none."""
    made = joint("a", control_modes=(M.IDLE, M.OPENLOOP))
    assert suggestions(made, M.IDLE) == ("Try", ["modes a"])


TURNING = {"lower": -2.0, "upper": 2.0, "hard_lower": -2.1, "hard_upper": 2.1, "velocity": 1.5}
FINGER = {"lower": 0.001, "upper": 0.039, "hard_lower": 0.0, "hard_upper": 0.04, "velocity": 0.2}
WHEEL = {"lower": -1e6, "upper": 1e6, "hard_lower": -1e6, "hard_upper": 1e6, "velocity": 20.0}


def test_the_table_has_degrees_both_limits_and_no_endless_number() -> None:
    """As cbctl info; modes beside each joint where they differ."""
    joints = [
        joint("arm", limits=TURNING),
        joint("finger", kind="prismatic", limits=FINGER, control_modes=(M.POSITION, M.IDLE)),
        joint("wheel", kind="continuous", limits=WHEEL),
    ]
    assert table(joints) == [
        "joint          limits          stops       speed  modes",
        "arm     -114.6…114.6°  -120.3…120.3°     85.9°/s  pos posd vel mix torq open idl",
        "finger    1.0…39.0 mm    0.0…40.0 mm  200.0 mm/s  pos idl",
        "wheel         endless        endless   1145.9°/s  pos posd vel mix torq open idl",
    ]


def test_the_table_is_no_wider_than_it_must() -> None:
    """Stops are listed only where they differ, and modes that all joints have below."""
    limits = TURNING | {"hard_lower": -2.0, "hard_upper": 2.0}
    names = ["a_joint_with_a_long_name", "and_another_one_that_is_longer"]
    lines = table([joint(name, limits=limits) for name in names])
    assert lines[0].split() == ["joint", "limits", "speed"]
    assert lines[-1] == "modes of all joints: pos posd vel mix torq open idl"
    assert max(map(len, lines)) <= 80


def test_it_names_the_board_where_it_is_another() -> None:
    """What is pasted reaches this board."""
    config = board_config(joint("a", limits=TURNING))
    assert "  cbctl move a=30deg\n" in welcome("/control_board", config, [M.POSITION])
    text = welcome("/left/arm", config, [M.IDLE])
    assert "  cbctl --board /left/arm mode a pos\n" in text
    assert "ros2 topic pub --once /left/arm/command/position control_board_msgs/msg/" in text
    assert "joints in IDLE" in text
