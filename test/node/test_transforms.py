# SPDX-License-Identifier: Apache-2.0
"""/tf: bytes that read as the message, and a board that publishes them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from waiting import until

from control_board_ros.frames import POSE, Edge, tf_message
from control_board_ros.node.wiring import prepared
from control_board_ros.node.wiring.messages import stamp
from control_board_ros.node.wiring.transforms import frames_of, prepared_frames
from control_board_ros.settings.loading import load
from control_board_ros.testing import board_process, ros_node

STAMP = 1_500_000_000_000_000_001
#: Names of every length that shifts what follows.
EDGES = [Edge("b" * k, f"link_{k}") for k in range(1, 10)]


@pytest.mark.parametrize("count", [0, 1, 2, 9])
@pytest.mark.parametrize("prefix", ["", "left/"])
def test_the_bytes_read_as_the_message(count: int, prefix: str) -> None:
    made = prepared_frames(EDGES[:count], prefix)
    assert made.fallback == ""
    for seed in range(3):
        poses = np.random.default_rng(seed).normal(size=(count, POSE))
        sent = made.of(poses, STAMP + seed)
        assert isinstance(sent, bytes)
        meant = tf_message(EDGES[:count], poses, stamp(STAMP + seed), prefix)
        assert deserialize_message(sent, TFMessage) == meant
        assert all(one.header.frame_id.startswith(prefix + "b") for one in meant.transforms)


def test_complete_messages_where_the_layout_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slower, and the same."""
    real = prepared.serialize_message
    monkeypatch.setattr(prepared, "serialize_message", lambda m: real(m)[::-1])
    made = prepared_frames(EDGES)
    assert "not found" in made.fallback
    poses = np.ones((len(EDGES), POSE))
    assert made.of(poses, STAMP) == tf_message(EDGES, poses, stamp(STAMP))


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
