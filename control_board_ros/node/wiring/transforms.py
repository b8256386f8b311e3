# SPDX-License-Identifier: Apache-2.0
"""/tf and /tf_static: the frames of the links, from the same readings as ``joint_states``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.node import Node
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ...core.state import Snapshot
from ...core.terms.measurement import Array
from ...description.frames import POSE, Edge, Frames
from ...interface import TF, TF_STATIC
from ...settings.loading import Settings
from ..loop.loop import ControlLoop
from .messages import split_time, stamp
from .prepared import MARK, STAMP, PreparedMessage
from .publishing import StatePublisher, publisher


def offer_transforms(
    node: Node, loop: ControlLoop, states: StatePublisher, settings: Settings
) -> None:
    """Publish /tf with every state and /tf_static at once, where ``publish_tf`` is set."""
    if not settings.values["publish_tf"]:
        return
    frames = Frames(settings.urdf, settings.board.names)
    prefix = str(settings.values.get("frame_prefix", ""))
    moving, standing = publisher(node, TF), publisher(node, TF_STATIC)
    message = prepared_frames(frames.moving, prefix)
    if message.fallback:
        node.get_logger().info(message.fallback)

    def publish(snapshot: Snapshot, nanoseconds: int) -> None:
        if moving.get_subscription_count():
            moving.publish(message.of(frames.poses(snapshot.position), nanoseconds))

    states.also.append(publish)
    now = loop.snapshots.now()
    standing.publish(tf_message(frames.standing, frames.standing_poses, now, prefix))


def tf_message(edges: Sequence[Edge], poses: Array, nanoseconds: int, prefix: str) -> TFMessage:
    """Frames as a message; poses of shape (len(edges), 7)."""
    at = stamp(nanoseconds)
    return TFMessage(
        transforms=[
            TransformStamped(
                header=Header(stamp=at, frame_id=prefix + edge.parent),
                child_frame_id=prefix + edge.child,
                transform=Transform(
                    translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=a, y=b, z=c, w=w)
                ),
            )
            for edge, (x, y, z, a, b, c, w) in zip(edges, poses.tolist(), strict=True)
        ]
    )


def prepared_frames(edges: Sequence[Edge], prefix: str = "") -> PreparedMessage:
    """The message of the same frames; ``of`` gets their poses, shape (len(edges), 7)."""

    def pieces(poses: Array, nanoseconds: int) -> list[bytes]:
        found = 2 * len(edges) * [STAMP.pack(*split_time(nanoseconds))]
        numbers = poses.tobytes()
        found[1::2] = [numbers[k : k + 8 * POSE] for k in range(0, len(numbers), 8 * POSE)]
        return found

    numbers = np.arange(float(len(edges) * POSE)).reshape(-1, POSE)
    return PreparedMessage(
        lambda poses, nanoseconds: tf_message(edges, poses, nanoseconds, prefix),
        pieces,
        blank=np.zeros_like(numbers),
        marked=np.full_like(numbers, np.frombuffer(bytes([MARK]) * 8)),
        trial=numbers - 3.25,
    )
