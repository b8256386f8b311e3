# SPDX-License-Identifier: Apache-2.0
"""What the board suggests to try at its start can be done (P9, K2)."""

from __future__ import annotations

import math
import os
from pathlib import Path

import pytest
from rig import board_config, joint

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.process.console import (
    first_target,
    provide_log_folder,
    suggestions,
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


@pytest.mark.parametrize(
    ("mode", "when", "first"),
    [
        (M.POSITION, "Try", "move a=30deg"),
        (M.MIXED, "Try", "move a=30deg"),
        (M.IDLE, "Try", "mode a pos"),
        (M.CALIBRATING, "When they have calibrated, try", "mode a pos"),
        (M.NOT_CONFIGURED, "Try", "configure"),
        (M.HW_FAULT, "See why, remove the cause, then try", "faults"),
    ],
)
def test_the_mode_accepts_the_suggested_command(mode: ControlMode, when: str, first: str) -> None:
    """K2, M3: a move is suggested where the joint takes one, and when."""
    found, words = suggestions(joint("a"), mode)
    assert (found, words[0]) == (when, first)
    assert words[-1] == "move a=30deg"


def test_a_board_that_starts_in_fault() -> None:
    """F2: its joints accept no mode before they are cleared."""
    _, words = suggestions(joint("a"), M.HW_FAULT)
    assert words == ["faults", "clear", "mode a pos", "move a=30deg"]


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


def test_it_names_the_board_where_it_is_another() -> None:
    """What is pasted reaches this board."""
    config = board_config(joint("a"))
    assert "  cbctl move a=30deg\n" in welcome("/control_board", config, [M.POSITION])
    text = welcome("/left/arm", config, [M.IDLE])
    assert "  cbctl --board /left/arm mode a pos\n" in text
    assert "joints in IDLE" in text


def test_a_log_folder_without_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a service: rcl asks HOME only, and would not start."""
    for name in ("HOME", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("ROS_LOG_DIR", "")
    monkeypatch.setattr("os.path.expanduser", lambda path: path.replace("~", str(tmp_path)))
    provide_log_folder()
    assert os.environ["ROS_LOG_DIR"] == str(tmp_path / ".ros/log")
