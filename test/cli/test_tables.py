# SPDX-License-Identifier: Apache-2.0
"""Tables of cbctl in terminals of many widths: nothing is cut."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from cbctl_terminal import drawn
from iiwa import JOINTS

from control_board_ros.cli.line.words import short_names
from control_board_ros.cli.text.tables import grid
from control_board_ros.cli.verbs.look import joints_table, references_table
from control_board_ros.cli.verbs.modes import impedance_table
from control_board_ros.core.terms.joint_kind import JointKind

WIDTHS = [40, 60, 80, 120]
#: The largest numbers that the shipped robots show, in the units of the board.
REFERENCE = {
    "position": -2.93215,
    "direct_position": -2.93215,
    "velocity": -2.3562,
    "torque": -320.25,
    "direct_velocity": -1.75,
    "current": -12.25,
    "output": -100.0,
    "speed": 2.3562,
    "acceleration": 25.0,
}
JOINT = {
    "index": 0,
    "kind": "revolute",
    "lower": -2.93215,
    "upper": 2.93215,
    "hard_lower": -2.96706,
    "hard_upper": 2.96706,
    "control_modes": ["pos", "posd", "vel", "mix", "torq", "open", "idl"],
    "interaction_modes": ["stif", "comp"],
    "drive": {"set_points": ("pwm",), "loops": "pwm: all", "reported": {}},
    "moves": [],
}


Shown = Callable[..., str]


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> Shown:
    """Makes a table on a terminal of some width; what that shows."""

    def shown(width: int, table: Callable[..., Any], *words: Any, **more: Any) -> str:
        screen = lambda: SimpleNamespace(width=width)  # noqa: E731
        monkeypatch.setattr("control_board_ros.cli.text.tables.console", screen)
        text = drawn(table(*words, **more), width)
        assert all(len(line) <= width for line in text.splitlines())
        return text

    return shown


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("names", [JOINTS, JOINTS[:1]], ids=["all", "one"])
def test_references(shown: Shown, width: int, names: list[str]) -> None:
    """Every number is there whole, with its unit, beside the short name of its joint."""
    session = SimpleNamespace(kind=lambda _: JointKind.REVOLUTE, names=JOINTS)
    text = shown(width, references_table, session, dict.fromkeys(names, REFERENCE))
    for value in ("-168.0°", "-135.0°/s", "-320.25 N·m", "-100.0 %", "135.0°/s", "1432.4°/s²"):
        assert text.count(value) >= len(names), value
    assert all(name.removeprefix("lbr_iiwa_") in text for name in names)


@pytest.mark.parametrize("width", WIDTHS)
def test_info(shown: Shown, width: int) -> None:
    """Limits, stops and modes of every joint, none of them broken within a word."""
    rows = {name: JOINT | {"index": k} for k, name in enumerate(JOINTS)}
    text = shown(width, joints_table, "/control_board", rows)
    assert text.startswith("/control_board\n")
    assert text.count("-168.0…168.0°") == 7
    assert text.count("-170.0…170.0°") == 7
    words = text.split()
    for word in ("revolute", *JOINT["control_modes"], *JOINT["interaction_modes"]):
        assert words.count(word) == 7, word
    name = JOINTS[6] if width == 120 else "joint_7"
    assert name in words


def test_what_drives_report(shown: Shown) -> None:
    """S8, S9: whatever they do, in words; a board whose drives report nothing has no column."""
    said = {"power": False, "law": "8 CSP", "zero": "one turn", "lost": 7, "late": 0}
    rows = {"a": JOINT | {"drive": JOINT["drive"] | {"reported": said}}, "b": JOINT}
    text = " ".join(shown(200, joints_table, "/b", rows).split())
    assert "power off, mode 8 CSP, zero one turn, 7 lost" in text
    assert "drive reports" not in shown(200, joints_table, "/b", {"b": JOINT})


@pytest.mark.parametrize("width", WIDTHS)
def test_impedance(shown: Shown, width: int) -> None:
    """Two columns have one title; four digits of each number are shown."""
    row = {
        "stiffness": 1000.0,
        "max_stiffness": 5000.0,
        "damping": 114.8213,
        "max_damping": 1088.14,
        "torque_offset": -33.1234,
    }
    text = shown(width, impedance_table, SimpleNamespace(names=JOINTS), dict.fromkeys(JOINTS, row))
    for value in ("1000", "5000", "114.8", "1088", "-33.12"):
        assert text.split().count(value) == 7
    assert text.split().count("max") == 2


def test_a_continuous_joint_is_endless(shown: Shown) -> None:
    """Its parameters hold limits that no joint has: they are not shown as numbers."""
    wheel = JOINT | {"kind": "continuous", "lower": -1e6, "upper": 1e6}
    wheel |= {"hard_lower": float("-inf"), "hard_upper": float("inf")}
    text = shown(120, joints_table, "/b", {"wheel": wheel})
    assert text.split().count("endless") == 2
    unknown = JOINT | {"lower": None, "upper": None}
    text = shown(120, joints_table, "/b", {"a": unknown})
    assert "revolute       -  -170.0…170.0°" in text


def test_a_name_wider_than_the_terminal_wraps(shown: Shown) -> None:
    """Broken, not cut: all characters are there."""
    name = "a_joint_of_a_very_long_name"
    text = shown(20, grid, {"joint": [name], "position": ["-168.0°"]})
    assert text.count("-168.0°") == 1
    assert "".join(line[:11].strip() for line in text.splitlines()[2:]) == name


def test_short_names() -> None:
    """Names lose what all of the board begin with, but one word of it; also a joint alone."""
    assert list(short_names(JOINTS[:2]).values()) == ["joint_1", "joint_2"]
    assert short_names(JOINTS[:1], JOINTS) == {JOINTS[0]: "joint_1"}
    for names in (
        ["l_elbow", "l_arm", "l"],
        ["a", "b"],
        ["panda_joint1", "panda_finger_joint1"],
        ["only_one"],
    ):
        assert short_names(names) == dict(zip(names, names, strict=True))
