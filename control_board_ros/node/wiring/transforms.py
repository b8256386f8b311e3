# SPDX-License-Identifier: Apache-2.0
"""/tf and /tf_static: the frames of the links, from the same readings as ``joint_states``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node

from ...core.state import Snapshot
from ...core.terms.measurement import Array
from ...description.couplings import coupling_of
from ...description.urdf import Urdf
from ...frames import POSE, Edge, Frames, tf_message
from ...interface import TF, TF_STATIC
from ...settings.loading import Settings
from ...urdf_xml import joints_in
from ..loop.loop import ControlLoop
from .messages import split_time, stamp
from .prepared import STAMP, PreparedMessage
from .publishing import StatePublisher, publisher


def offer_transforms(
    node: Node, loop: ControlLoop, states: StatePublisher, settings: Settings
) -> None:
    """Publish /tf with every state and /tf_static at once, where ``publish_tf`` is set."""
    if not settings.values["publish_tf"]:
        return
    frames = frames_of(settings.urdf, settings.board.names)
    prefix = str(settings.values.get("frame_prefix", ""))
    moving, standing = publisher(node, TF), publisher(node, TF_STATIC)
    message = prepared_frames(frames.moving, prefix)
    if message.fallback:
        node.get_logger().info(message.fallback)

    def publish(snapshot: Snapshot, nanoseconds: int) -> None:
        if moving.get_subscription_count():
            moving.publish(message.of(frames.poses(snapshot.position), nanoseconds))

    states.also.append(publish)
    now = stamp(loop.main.snapshots.now())
    standing.publish(tf_message(frames.standing, frames.standing_poses, now, prefix))


def frames_of(urdf: Urdf, names: Sequence[str]) -> Frames:
    """The frames of a robot of which these joints, or axes, are driven."""
    coupling = coupling_of(urdf, names, followers=False)
    return Frames(joints_in(urdf.tree.root), names, coupling)


def prepared_frames(edges: Sequence[Edge], prefix: str = "") -> PreparedMessage:
    """The message of the same frames; ``of`` gets their poses, shape (len(edges), 7)."""

    def pieces(poses: Array, nanoseconds: int) -> list[bytes]:
        chunks = 2 * len(edges) * [STAMP.pack(*split_time(nanoseconds))]
        numbers = poses.tobytes()
        chunks[1::2] = [numbers[k : k + 8 * POSE] for k in range(0, len(numbers), 8 * POSE)]
        return chunks

    numbers = np.arange(float(len(edges) * POSE)).reshape(-1, POSE)
    return PreparedMessage(
        lambda poses, nanoseconds: tf_message(edges, poses, stamp(nanoseconds), prefix),
        pieces,
        trial=numbers - 3.25,
        other=numbers + 0.75,
    )
