# SPDX-License-Identifier: Apache-2.0
"""/tf and /tf_static: the frames of the links, from the same readings as ``joint_states``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node

from ...core.state import Snapshot
from ...description.couplings import coupling_of
from ...description.urdf import Urdf
from ...frames import Frames, fill_tf, tf_message
from ...interface import TF, TF_STATIC
from ...settings.loading import Settings
from ...urdf_xml import joints_in
from ..loop.loop import ControlLoop
from .messages import stamp
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
    now = stamp(loop.main.snapshots.now())
    home = frames.poses(np.zeros(len(settings.board.names)))
    message = tf_message(frames.moving, home, now, prefix)

    def publish(snapshot: Snapshot, nanoseconds: int) -> None:
        if moving.get_subscription_count():
            fill_tf(message, frames.poses(snapshot.position), stamp(nanoseconds))
            moving.publish(message)

    states.also.append(publish)
    standing.publish(tf_message(frames.standing, frames.standing_poses, now, prefix))


def frames_of(urdf: Urdf, names: Sequence[str]) -> Frames:
    """The frames of a robot of which these joints, or axes, are driven."""
    coupling = coupling_of(urdf, names, followers=False)
    return Frames(joints_in(urdf.tree.root), names, coupling)
