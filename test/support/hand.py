# SPDX-License-Identifier: Apache-2.0
"""A hand at a simulated arm: it pushes the last joint."""

from __future__ import annotations

import rclpy
from rclpy.context import Context
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.interface import EXTERNAL_TORQUE
from control_board_ros.testing import BoardProcess

JOINT = "lbr_iiwa_joint_7"


class Hand:
    """Pushes the last joint, and looks where it is.

    Args:
        process: The board's.
    """

    def __init__(self, process: BoardProcess) -> None:
        self._context = Context()
        domain = int(process.environment["ROS_DOMAIN_ID"])
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("hand", context=self._context)
        self._client = ControlBoardClient(self._node)
        self._client.wait_until_found(60.0)
        topic = EXTERNAL_TORQUE.of(self._client.board_name)
        profile = EXTERNAL_TORQUE.qos.profile()
        self._push = self._node.create_publisher(EXTERNAL_TORQUE.load(), topic, profile)
        until(lambda: self._push.get_subscription_count() > 0)

    def push(self, torque: float) -> None:
        """Push until the next push, N·m."""
        self._push.publish(EXTERNAL_TORQUE.load()(names=[JOINT], torques=[torque]))

    def position(self) -> float:
        """Of the joint, rad."""
        return float(self._client.get_encoder(JOINT)[0])

    def speed(self) -> float:
        """Of the joint, rad/s."""
        return float(self._client.get_encoder_speed(JOINT)[0])

    def is_soft(self) -> bool:
        """Whether the joint gives way to a hand."""
        return self._client.get_interaction_mode(JOINT)[0] is InteractionMode.COMPLIANT

    def close(self) -> None:
        """Let go."""
        self.push(0.0)
        self._push.wait_for_all_acked()
        self._client.close()
        self._node.destroy_node()
        self._context.try_shutdown()
