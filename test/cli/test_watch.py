# SPDX-License-Identifier: Apache-2.0
"""cbctl watch in terminals of many widths and heights."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cbctl_terminal
import pytest
from iiwa import JOINTS
from rich.text import Text

from control_board_ros.cli.line.words import short_names
from control_board_ros.cli.verbs.watch import (
    DISPENSABLE,
    View,
    dense,
    fitting,
    on_screen,
)
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.joint_limits import JointLimits

ICUB = ["l_shoulder_pitch", "l_shoulder_roll", "l_elbow"]
FAULT = "overcurrent, 23.9 A; the limit is 22 A"


PARTS = {
    "head": [f"neck_{k}" for k in range(3)],
    "torso": [f"torso_{k}" for k in range(3)],
    "left_arm": [f"l_wrist_pros_{k}" for k in range(7)],
    "right_arm": [f"r_wrist_pros_{k}" for k in range(7)],
    "left_leg": [f"l_ankle_{k}" for k in range(6)],
    "right_leg": [f"r_ankle_{k}" for k in range(6)],
}
EVERYONE = [name for names in PARTS.values() for name in names]


def view(board: str, names: list[str], faulty: tuple[str, ...] = (), **more: Any) -> View:
    """What was read of a board."""
    limits = dict.fromkeys(names, JointLimits(-3.0, 3.0, -3.1, 3.1, 2.0, 10.0, 100.0, 100.0))
    session: Any = SimpleNamespace(
        kind=lambda _: JointKind.REVOLUTE,
        names=names,
        limits=lambda _: limits,
        options=SimpleNamespace(json=False),
    )
    row = {
        "control_mode": "posd",
        "interaction_mode": "stif",
        "position": -2.9,
        "position_reference": -2.9,
        "torque": -125.51,
        "external_torque": 0.3,
        "output": -100.0,
        "calibrated": True,
    }
    made = View(board, session, names)
    made.rows = {n: row | {"fault": FAULT if n in faulty else ""} | more for n in names}
    return made


def drawn(names: list[str], width: int, fault: bool = False, **more: Any) -> list[str]:
    """The lines of the table of one board."""
    shown = view("/board", names, tuple(names) if fault else (), **more)
    text = cbctl_terminal.drawn(shown.table(width), width)
    return [line for line in text.splitlines() if line.strip()]


def on_terminal(views: list[View], width: int, height: int) -> list[str]:
    """The lines that a terminal of this size shows."""
    return cbctl_terminal.drawn(on_screen(views, width, height), width).splitlines()


@pytest.mark.parametrize("names", [JOINTS, ICUB, ["only"]], ids=["iiwa", "icub", "one"])
@pytest.mark.parametrize("width", [60, 70, 80, 100, 160])
@pytest.mark.parametrize("fault", [False, True])
def test_names_modes_and_positions_are_never_cut(
    names: list[str], width: int, fault: bool
) -> None:
    lines = drawn(names, width, fault)
    assert all(len(line) <= width for line in lines)
    text = "\n".join(lines)
    for name in short_names(names).values():
        assert name in text
    assert text.count("posd") == len(names)
    assert text.count("-166.2°") == len(names) * (2 if "reference" in text else 1)
    if fault:
        assert text.count(FAULT[:10]) == len(names)
    else:
        assert "…" not in text


def test_a_wide_terminal_shows_everything() -> None:
    head = drawn(JOINTS, 120)[0]
    titles = {*DISPENSABLE, "joint", "mode", "position", "fault"}
    assert [title for title in titles if title not in head] == []
    assert "lbr_iiwa_joint_1" in "\n".join(drawn(JOINTS, 120))


def test_eighty_columns_drop_the_least_important_first() -> None:
    lines = drawn(JOINTS, 80)
    assert "output" not in lines[0]
    assert {"joint", "mode", "int.", "position", "torque", "fault"} <= set(lines[0].split())
    assert any(line.split()[0] == "joint_1" for line in lines[2:])


def test_uncalibrated_joints_are_marked() -> None:
    """K7: where a mode is refused for it; not while the calibration is still to come."""
    assert "not calibrated" in "\n".join(drawn(ICUB, 120, control_mode="idl", calibrated=False))
    assert "not calibrated" in "\n".join(drawn(ICUB, 80, control_mode="idl", calibrated=False))
    for mode in ("cal", "cfgn"):
        shown = "\n".join(drawn(ICUB, 120, control_mode=mode, calibrated=False))
        assert "not calibrated" not in shown
    assert "not calibrated" not in "\n".join(drawn(ICUB, 120))


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 24), (160, 20), (200, 14)])
@pytest.mark.parametrize("split", [False, True], ids=["robot", "parts"])
def test_all_joints_are_seen(width: int, height: int, split: bool) -> None:
    """32 joints are shown side by side, with their modes and positions, and no line more."""
    views = [view(f"/icub/{part}", names) for part, names in PARTS.items()]
    lines = on_terminal(views if split else [view("/icub/robot", EVERYONE)], width, height)
    text = "\n".join(lines)
    assert len(lines) < height
    assert all(len(line) <= width for line in lines)
    for names in PARTS.values() if split else [EVERYONE]:
        for name in short_names(names).values():
            assert f"{name} " in text
    assert text.count("posd") == len(EVERYONE)
    assert text.count("-166.2°") >= len(EVERYONE)
    assert ("/icub/left_leg" in text) is split


def test_rows_without_room_are_reported() -> None:
    """And never a line more than the terminal has."""
    lines = on_terminal([view("/icub/robot", EVERYONE)], 40, 12)
    assert len(lines) < 12
    assert lines[-1].startswith("… 24 lines more: a larger")


def test_faults_are_shown_below() -> None:
    """Three lines of them at most; the last counts the rest."""
    lines = on_terminal([view("/icub/robot", EVERYONE, tuple(EVERYONE[:2]))], 80, 24)
    assert lines[-2:] == [f"{name}: {FAULT}" for name in EVERYONE[:2]]
    lines = on_terminal([view("/icub/robot", EVERYONE, tuple(EVERYONE))], 80, 24)
    assert lines[-1] == "… 30 more in fault: cbctl faults"
    assert len(lines) < 24


def test_a_high_terminal_shows_the_table_as_ever() -> None:
    """One below the other, with all columns."""
    lines = on_terminal([view("/icub/robot", EVERYONE)], 120, 60)
    assert len(lines) == len(EVERYONE) + 2
    assert "its limits" in lines[0]


def test_columns_go_in_their_order() -> None:
    """Those that are not worth a joint's place go first."""
    columns = {title: [Text("x" * 10)] * 20 for title in ("joint", *DISPENSABLE)}
    assert fitting(columns, DISPENSABLE, 200, 30) == (columns, 2)
    kept, blocks = fitting(columns, DISPENSABLE, 80, 12)
    assert (list(kept), blocks) == (["joint", "torque", "int."], 2)
    assert dense(columns, (), (), 10, 12)[1] == 10
