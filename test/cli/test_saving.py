# SPDX-License-Identifier: Apache-2.0
"""Saved parameters start the same robot of several parts again (SPEC R1)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from control_board_ros.cli.verbs.param import SavedFile, of_one_part, of_robot
from control_board_ros.settings.loading import Settings, load
from control_board_ros.settings.schema import PART_ROWS

PARTS = {"upper": [f"lbr_iiwa_joint_{k}" for k in (7, 6, 5)], "lower": ["lbr_iiwa_joint_1"]}
GIVEN: dict[str, Any] = {
    "robot": "iiwa",
    "robot_name": "pair",
    **{f"parts.{part}": joints for part, joints in PARTS.items()},
    "parts.none": [],
    "joint_defaults.limits.velocity": 1.0,
    "lbr_iiwa_joint_1.position_pid.kp": 700.0,
    "poses.high.lbr_iiwa_joint_5": 0.5,
}


def shown_by_parts(settings: Settings) -> dict[str, dict[str, Any]]:
    """What the node of each part shows: its own parameters, not those of the whole robot."""
    rows, found = {row.name for row in PART_ROWS}, {}
    for name in settings.parts:
        values = settings.part(name).values
        found[name] = {key: v for key, v in values.items() if "." in key or key in rows}
    return found


def reloaded(saved: SavedFile, folder: Path) -> Settings:
    """The settings of what was saved."""
    path = folder / "saved.yaml"
    values = json.loads(json.dumps(saved.values))  # no list twice, as from a board
    path.write_text(yaml.safe_dump({saved.section: {"ros__parameters": values}}, sort_keys=False))
    return load(path)


def test_a_robot_comes_back_as_it_was(tmp_path: Path) -> None:
    """With all parameters of all parts, those of the parts that are left out, and its poses."""
    settings = load(None, GIVEN)
    limits = {n: v for n, v in settings.values.items() if "_pid." not in n}  # its node shows less
    saved = of_robot("/lab/pair", limits, shown_by_parts(settings))
    again = reloaded(saved, tmp_path)
    assert all(again.values[n] == v for n, v in settings.values.items() if n[:6] != "joint_")
    assert list(again.parts.items()) == list(settings.parts.items())
    assert again.board == settings.board
    assert again.poses == settings.poses
    assert (saved.renaming, saved.left_out) == (["-r __ns:=/lab"], [])


def test_differences_between_parts_are_reported() -> None:
    """One file has one value of it for all parts."""
    settings = load(None, GIVEN)
    parts = shown_by_parts(settings)
    parts["upper"]["constraints.goal_time"] = 0.5
    own = {n: v for n, v in settings.values.items() if not n.startswith("constraints.")}
    saved = of_robot("/pair", own, parts)
    assert "constraints.goal_time" not in saved.values
    assert saved.left_out == [
        "constraints.goal_time, which has one value for all parts in a file: upper 0.5, lower 0.0"
    ]
    assert saved.renaming == []


def test_a_part_leaves_the_others_as_they_are(tmp_path: Path) -> None:
    """Its file starts the same robot; what it shows of all joints acts on its own ones only."""
    settings = load(None, GIVEN)
    part = shown_by_parts(settings)["lower"]
    part["lbr_iiwa_joint_1.limits.upper"] = 1.25
    saved = of_one_part("/pair", part, settings.values)
    again = reloaded(saved, tmp_path)
    plain = load(None, {n: v for n, v in GIVEN.items() if n.startswith(("robot", "parts"))})
    assert again.parts == settings.parts
    assert again.poses.keys() == {"home", "park"}
    for joint in again.board.joints:
        if joint.name in PARTS["lower"]:
            assert joint.limits.upper == 1.25
            assert joint.position_pid.kp == 700.0
        else:
            as_ever = next(one for one in plain.board.joints if one.name == joint.name)
            assert joint.limits == as_ever.limits


@pytest.mark.parametrize("name", ["iiwa", "arm.urdf"])
def test_a_robot_is_found_from_any_folder(name: str, tmp_path: Path) -> None:
    """A relative path is shown in full; a name stays."""
    arm = Path(__file__).parents[1] / "support" / "arm.urdf"
    (tmp_path / "arm.urdf").write_bytes(arm.read_bytes())
    path = tmp_path / "board.yaml"
    path.write_text(f"control_board: {{ros__parameters: {{robot: {name}}}}}")
    shown = load(path).values["robot"]
    assert shown == (name if name == "iiwa" else str(tmp_path / name))
    assert load(None, {"robot": shown}).board == load(path).board
