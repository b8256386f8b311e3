# SPDX-License-Identifier: Apache-2.0
"""Start a board, optionally with RViz, on a sourced ROS 2.

ros2 launch control_board_ros control_board.launch.py --show-args
ros2 launch control_board_ros control_board.launch.py robot:=panda rviz:=true
ros2 launch control_board_ros control_board.launch.py params_file:=my_robot.yaml namespace:=left
"""

from __future__ import annotations

from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "control_board_ros"

#: Arguments that are parameters of the node; empty: from the parameter file and the defaults.
PARAMETERS = {
    "robot": "Robot: iiwa, panda, icub, panda_pair, iiwa_gripper, icub_left_arm, icub_right_arm, "
    "icub_hand, icub_hand_mk3, icub_hands, or the path of a URDF or xacro file",
    "plant": "Plant by its name, as moteus or virtual/moteus; empty: the simulation",
    "plant_arguments": "Arguments of the plant: [bus=socketcan:can0, ids=1 2]",
    "control_rate": "Rate of the control cycles, Hz",
    "physics": "Engine of the simulation: pybullet, mujoco or ideal",
    "gui": "Show the physics in a window: true or false",
    "state_rate": "Rate of joint_states and ~/state, Hz",
    "real_time_factor": "Simulated seconds per second; 0: as fast as possible",
    "publish_tf": "Publish /tf and /tf_static: true or false",
    "lifecycle": "Be a managed node: true or false",
    "autostart": "A managed node configures and activates itself: true or false",
    "use_sim_time": "Stamp with simulated time, and publish /clock: true or false",
}
#: Arguments of the launch file itself, with their defaults.
OPTIONS = {
    "params_file": ("", "Parameter file; the arguments above override it"),
    "name": ("", "Name of the node; default: control_board"),
    "namespace": ("", "Namespace of the node"),
    "rviz": ("false", "Start RViz, with the frames of the board"),
    "robot_state_publisher": ("false", "Publish the frames by robot_state_publisher"),
    "log_level": ("info", "debug, info, warn or error"),
}


def generate_launch_description() -> LaunchDescription:
    """The arguments and the nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value="", description=text)
        for name, text in PARAMETERS.items()
    ]
    arguments += [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in OPTIONS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[Node]:
    """The nodes, for the arguments given."""

    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    def chosen(name: str) -> bool:
        if (text := given(name).lower()) not in ("true", "false"):
            raise ValueError(f"{name}:={given(name)} is not allowed; true and false are")
        return text == "true"

    parameters = {name: value_of(given(name)) for name in PARAMETERS if given(name)}
    rviz, state_publisher = chosen("rviz"), chosen("robot_state_publisher")
    if rviz and not state_publisher:
        parameters.setdefault("publish_tf", True)
    namespace = given("namespace") or None
    simulated = bool(parameters.get("use_sim_time", False))
    files = [given("params_file")] if given("params_file") else []
    nodes = [
        Node(
            package=PACKAGE,
            executable="control_board",
            name=given("name") or None,
            namespace=namespace,
            parameters=[*files, parameters],
            ros_arguments=["--log-level", given("log_level")],
            output="screen",
        )
    ]
    if not (rviz or state_publisher):
        return nodes
    urdf = description(files, parameters, f"/{given('namespace').strip('/')}", given("name"))
    if state_publisher:
        text = ParameterValue(urdf.description, value_type=str)
        nodes.append(
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=namespace,
                parameters=[{"robot_description": text, "use_sim_time": simulated}],
                output="screen",
            )
        )
    if rviz:
        shown = FindPackageShare(PACKAGE).perform(context) + "/config/rviz/control_board.rviz"
        nodes.append(
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=namespace,
                arguments=["-d", shown, "-f", urdf.tree.base],
                parameters=[{"use_sim_time": simulated}],
                output="screen",
            )
        )
    return nodes


def value_of(text: str) -> Any:
    """An argument as the value of a parameter: number, true, false, list of texts, or text."""
    if text.startswith("["):
        return [item.strip().strip("'\"") for item in text.strip("[] ").split(",") if item.strip()]
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text


def description(files: list[str], parameters: dict[str, Any], namespace: str, name: str) -> Any:
    """The robot of the board, by the sections of its files that are for its node."""
    from control_board_ros.settings.loading import load

    robot = {"robot": parameters["robot"]} if "robot" in parameters else {}
    node = f"{namespace.rstrip('/')}/{name or 'control_board'}"
    return load(files[0] if files else None, robot, node=node).urdf
