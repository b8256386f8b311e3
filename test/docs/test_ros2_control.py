# SPDX-License-Identifier: Apache-2.0
"""config/ros2_control/: the description is right for the component, the joints are the board's."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import yaml

from control_board_ros.description.robots import SHIPPED
from control_board_ros.description.xacro_file import expand
from control_board_ros.interface import JOINT_COMMANDS, JOINT_STATES
from control_board_ros.settings.loading import load

FOLDER = Path(__file__).resolve().parents[2] / "config/ros2_control"
INTERFACES = ["position", "velocity", "effort"]


def test_the_component_finds_the_board() -> None:
    """Its topics are the board's, and each joint has all interfaces: no array is short."""
    text = expand(FOLDER / "iiwa.urdf.xacro", [f"urdf:={SHIPPED / 'iiwa.urdf'}"])
    (system,) = ET.fromstring(text).findall("ros2_control")
    hardware = system.find("hardware")
    assert hardware is not None
    assert hardware.findtext("plugin") == (
        "joint_state_topic_hardware_interface/JointStateTopicSystem"
    )
    params = {param.get("name"): param.text for param in hardware.findall("param")}
    assert params == {
        "joint_commands_topic": JOINT_COMMANDS.of("/control_board"),
        "joint_states_topic": JOINT_STATES.of("/control_board"),
        "trigger_joint_command_threshold": "-1",
    }
    joints = system.findall("joint")
    assert tuple(joint.get("name") for joint in joints) == load("iiwa").board.names
    for joint in joints:
        for kind in ("command_interface", "state_interface"):
            assert [one.get("name") for one in joint.findall(kind)] == INTERFACES


def test_the_controllers_have_the_boards_joints() -> None:
    """Each controller that the manager knows is configured for all joints of the board."""
    text = (FOLDER / "iiwa_controllers.yaml").read_text("utf-8")
    assert not set("&*") & set(text), "rcl's parser reads neither anchors nor aliases"
    files = yaml.safe_load(text)
    manager = files["controller_manager"]["ros__parameters"]
    controllers = [name for name, what in manager.items() if isinstance(what, dict)]
    assert files.keys() == {"controller_manager", *controllers}
    for name in controllers:
        assert tuple(files[name]["ros__parameters"]["joints"]) == load("iiwa").board.names
