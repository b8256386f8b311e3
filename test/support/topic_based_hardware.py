# SPDX-License-Identifier: Apache-2.0
"""A stand-in for ros2_control's joint_state_topic_hardware_interface/JointStateTopicSystem.

It sends what that component's source (1.1.0; before, the threshold looked at positions alone)
sends: all joints of the tag by name; of each of position, velocity and effort one number per
joint that has the command interface, so that arrays can be short; NaN where no controller has
commanded; nothing while commands and readings differ by no more than the threshold in sum, which
no sum with a NaN does. It takes those readings that are finite, of the joints that it knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

INTERFACES = ("position", "velocity", "effort")


class TopicBasedHardware:
    """The component's memory: commands that controllers write, states that they read.

    Args:
        joints: the command interfaces of each joint, in the order of the tag.
        threshold: trigger_joint_command_threshold.
    """

    def __init__(self, joints: Mapping[str, Sequence[str]], threshold: float = 1e-5) -> None:
        self._joints, self._threshold = joints, threshold
        self.commands = {
            f"{joint}/{interface}": math.nan
            for joint, interfaces in joints.items()
            for interface in interfaces
        }
        self.states = {
            f"{joint}/{interface}": math.nan for joint in joints for interface in INTERFACES
        }

    def read(self, message: JointState) -> None:
        """Take readings."""
        for interface in INTERFACES:
            values = getattr(message, interface)
            for name, value in zip(message.name, values, strict=bool(len(values))):
                if name in self._joints and math.isfinite(value):
                    self.states[f"{name}/{interface}"] = value

    def write(self) -> JointState | None:
        """What is published in this cycle; None: nothing."""
        difference = sum(abs(self.states[key] - value) for key, value in self.commands.items())
        if difference <= self._threshold:
            return None
        sent: dict[str, list[float]] = {interface: [] for interface in INTERFACES}
        for key, value in self.commands.items():
            sent[key.rpartition("/")[2]].append(value)
        return JointState(name=list(self._joints), **sent)


class Component:
    """The same on a node, with the component's QoS.

    Args:
        node: to publish and subscribe from.
        hardware: what it keeps.
        commands: joint_commands_topic.
        states: joint_states_topic.
    """

    def __init__(self, node: Node, hardware: TopicBasedHardware, commands: str, states: str):
        self._node, self.hardware = node, hardware
        self.publisher: Any = node.create_publisher(JointState, commands, QoSProfile(depth=1))
        self._latest = JointState()
        node.create_subscription(JointState, states, self._keep, qos_profile_sensor_data)

    def _keep(self, message: JointState) -> None:
        self._latest = message

    def read(self) -> bool:
        """The controller manager's read; whether a reading has come yet."""
        self.hardware.read(self._latest)
        return bool(self._latest.name)

    def write(self) -> bool:
        """The controller manager's write; whether anything was published."""
        if (message := self.hardware.write()) is None:
            return False
        message.header.stamp = self._node.get_clock().now().to_msg()
        self.publisher.publish(message)
        return True
