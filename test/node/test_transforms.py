# SPDX-License-Identifier: Apache-2.0
"""/tf: a message that is filled again, and a board that publishes it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from waiting import until

from control_board_ros.frames import POSE, Edge, fill_tf, tf_message
from control_board_ros.node.wiring.messages import stamp
from control_board_ros.node.wiring.transforms import frames_of
from control_board_ros.settings.loading import load
from control_board_ros.testing import board_process, ros_node

STAMP = 1_500_000_000_000_000_001
#: Names of every length that shifts what follows.
EDGES = [Edge("b" * k, f"link_{k}") for k in range(1, 10)]


@pytest.mark.parametrize("count", [0, 1, 9])
@pytest.mark.parametrize("prefix", ["", "left/"])
def test_a_message_that_is_filled_again_is_a_new_one(count: int, prefix: str) -> None:
    random, edges = np.random.default_rng(1), EDGES[:count]
    message = tf_message(edges, np.zeros((count, POSE)), stamp(0), prefix)
    for k in range(3):
        poses = random.normal(size=(count, POSE))
        fill_tf(message, poses, stamp(STAMP + k))
        assert message == tf_message(edges, poses, stamp(STAMP + k), prefix)
    assert all(one.header.frame_id.startswith(prefix + "b") for one in message.transforms)


@pytest.mark.ros
@pytest.mark.slow
def test_a_board_publishes_the_frames_of_its_joint_states() -> None:
    """Every link but the base, once: moving ones with each reading's stamp, fixed ones latched."""
    settings = load("panda")
    frames = frames_of(settings.urdf, settings.board.names)
    states: dict[tuple[int, int], Any] = {}
    moving: list[Any] = []
    static: list[Any] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def time_of(message: Any) -> tuple[int, int]:
        return message.header.stamp.sec, message.header.stamp.nanosec

    def keep(state: Any) -> None:
        states[time_of(state)] = state

    def pairs() -> list[tuple[Any, Any]]:
        both = [(time_of(one.transforms[0]), one) for one in moving]
        return [(states[at], one) for at, one in both if at in states]

    with (
        board_process({"robot": "panda", "publish_tf": True}) as board,
        ros_node(board.domain) as node,
    ):
        node.create_subscription(JointState, "joint_states", keep, 10)
        node.create_subscription(TFMessage, "/tf", moving.append, 100)
        node.create_subscription(TFMessage, "/tf_static", static.append, latched)
        until(lambda: len(pairs()) > 5 and bool(static))
    state, message = pairs()[-1]
    assert tuple(state.name) == settings.board.names
    poses = frames.poses(np.array(state.position))
    assert message == tf_message(frames.moving, poses, state.header.stamp)
    (fixed,) = static
    children = [one.child_frame_id for one in [*message.transforms, *fixed.transforms]]
    assert sorted(children) == sorted(set(settings.urdf.tree.links) - {settings.urdf.tree.base})
