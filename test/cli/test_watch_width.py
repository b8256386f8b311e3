# SPDX-License-Identifier: Apache-2.0
"""The table of cbctl watch in terminals of many widths."""

from types import SimpleNamespace
from typing import Any

import cbctl_terminal
import pytest

from control_board_ros.cli.line.words import short_names
from control_board_ros.cli.verbs.watch import TITLES, watch_table
from control_board_ros.core.terms.joint_kind import JointKind
from control_board_ros.joint_limits import JointLimits

IIWA = [f"lbr_iiwa_joint_{j}" for j in range(1, 8)]
ICUB = ["l_shoulder_pitch", "l_shoulder_roll", "l_elbow"]
FAULT = "overcurrent, 23.9 A; the limit is 22 A"


def drawn(names: list[str], width: int, fault: str = "", **more: Any) -> list[str]:
    """The lines that a terminal of this width shows."""
    row: dict[str, Any] = {
        "control_mode": "posd",
        "interaction_mode": "stif",
        "position": -2.9,
        "position_reference": -2.9,
        "torque": -125.51,
        "output": -100.0,
        "fault": fault,
        "calibrated": True,
    }
    session: Any = SimpleNamespace(kind=lambda _: JointKind.REVOLUTE, names=names)
    limits: Any = dict.fromkeys(names, JointLimits(-3.0, 3.0, -3.1, 3.1, 2.0, 10.0, 100.0, 100.0))
    rows = dict.fromkeys(names, row | more)
    text = cbctl_terminal.drawn(watch_table(session, rows, limits, width), width)
    return [line for line in text.splitlines() if line.strip()]


@pytest.mark.parametrize("names", [IIWA, ICUB, ["only"]], ids=["iiwa", "icub", "one"])
@pytest.mark.parametrize("width", [60, 70, 80, 100, 160])
@pytest.mark.parametrize("fault", ["", FAULT])
def test_names_modes_and_positions_are_never_cut(names: list[str], width: int, fault: str) -> None:
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
    head = drawn(IIWA, 120)[0]
    assert [title for title in TITLES if title not in head] == []
    assert "lbr_iiwa_joint_1" in "\n".join(drawn(IIWA, 120))


def test_eighty_columns_drop_the_least_important_first() -> None:
    lines = drawn(IIWA, 80)
    assert "output" not in lines[0]
    assert {"joint", "mode", "int.", "position", "torque", "fault"} <= set(lines[0].split())
    assert any(line.split()[0] == "joint_1" for line in lines[2:])


def test_who_is_not_calibrated_is_marked() -> None:
    """K7: where a mode is refused for it; not while the calibration is still to come."""
    assert "not calibrated" in "\n".join(drawn(ICUB, 120, control_mode="idl", calibrated=False))
    assert "not calibrated" in "\n".join(drawn(ICUB, 80, control_mode="idl", calibrated=False))
    for mode in ("cal", "cfgn"):
        shown = "\n".join(drawn(ICUB, 120, control_mode=mode, calibrated=False))
        assert "not calibrated" not in shown
    assert "not calibrated" not in "\n".join(drawn(ICUB, 120))
