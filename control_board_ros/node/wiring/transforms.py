# SPDX-License-Identifier: Apache-2.0
"""/tf and /tf_static: the frames of the links, from the same readings as ``joint_states``.

As in ``state_message``, a message of which only numbers change is serialized once; then its
numbers are written where they were found, and its bytes go out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ...core.state import Snapshot
from ...core.terms.measurement import Array
from ...description.frames import POSE, Edge, Frames
from ...interface import TF, TF_STATIC
from ...settings.loading import Settings
from ..loop.loop import ControlLoop
from .messages import split_time, stamp
from .publishing import StatePublisher, publisher
from .state_message import TRIAL, UnknownLayout

#: Bytes in front of a serialized message's body; alignment counts from the body on.
ENCAPSULATION = 4
#: The first of the marks that stamps are found by: no text has such bytes.
FIRST_MARK = 0x01020304


def offer_transforms(
    node: Node, loop: ControlLoop, states: StatePublisher, settings: Settings
) -> None:
    """Publish /tf with every state and /tf_static at once, where ``publish_tf`` is set.

    Args:
        node: to publish from.
        loop: whose time the stamps are.
        states: whose states the frames go with.
        settings: of the board, or of the whole robot.
    """
    if not settings.values["publish_tf"]:
        return
    frames = Frames(settings.urdf, settings.board.names)
    prefix = str(settings.values.get("frame_prefix", ""))
    moving, standing = publisher(node, TF), publisher(node, TF_STATIC)
    message = TransformMessage(frames.moving, prefix)
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


class TransformMessage:
    """The message of the same frames, time after time, ready to be published.

    Args:
        edges: the frames.
        prefix: put before the name of each.

    Attributes: fallback (why whole messages are published; empty where their bytes are).
    """

    def __init__(self, edges: Sequence[Edge], prefix: str = "") -> None:
        self._edges, self._prefix = edges, prefix
        self.fallback = ""
        try:
            self._find_places()
            self._try()
        except Exception as error:  # noqa: BLE001 - whatever it is, whole messages can go out
            reason = str(error) if isinstance(error, UnknownLayout) else repr(error)
            self.fallback = f"frames go out as messages, not as bytes ready made: {reason}"

    def of(self, poses: Array, nanoseconds: int) -> Any:
        """The message of some poses, shape (len(edges), 7): its bytes, or the message itself."""
        if self.fallback:
            return tf_message(self._edges, poses, nanoseconds, self._prefix)
        self._words[self._stamp_places] = split_time(nanoseconds)
        self._doubles[self._pose_places] = poses
        return self._bytes[ENCAPSULATION : ENCAPSULATION + self._size].tobytes()

    def _find_places(self) -> None:
        """Where a serialized message holds its stamps and numbers.

        Raises:
            UnknownLayout: in no place, or in several.
        """
        count = len(self._edges)
        poses = np.arange(0.5, count * POSE).reshape(count, POSE)
        stamps = FIRST_MARK + np.arange(2 * count, dtype=np.uint32).reshape(count, 2)
        message = tf_message(self._edges, poses, 0, self._prefix)
        for one, (seconds, nanoseconds) in zip(message.transforms, stamps.tolist(), strict=True):
            one.header.stamp = Time(sec=seconds, nanosec=nanoseconds)
        serialized = bytes(serialize_message(message))
        self._size = len(serialized)
        # The body begins at byte 8 of this, aligned for doubles.
        self._bytes = np.zeros(ENCAPSULATION + self._size + 8, dtype=np.uint8)
        self._bytes[ENCAPSULATION : ENCAPSULATION + self._size] = list(serialized)
        body = self._bytes[2 * ENCAPSULATION :]
        self._doubles = body[: len(body) // 8 * 8].view(np.float64)
        self._words = body[: len(body) // 4 * 4].view(np.uint32)
        self._pose_places = places_of(poses, self._doubles)
        self._stamp_places = places_of(stamps, self._words)

    def _try(self) -> None:
        """Read a message from bytes, and compare it with the original."""
        poses = np.arange(float(len(self._edges) * POSE)).reshape(-1, POSE) - 3.25
        made = deserialize_message(self.of(poses, TRIAL), TFMessage)
        if made != tf_message(self._edges, poses, TRIAL, self._prefix):
            raise UnknownLayout("a message made of bytes reads otherwise")


def places_of(values: np.ndarray[Any, Any], among: np.ndarray[Any, Any]) -> Any:
    """Where each value is, in the shape of the values, which rise.

    Raises:
        UnknownLayout: one of them in no place, or in several.
    """
    places = np.flatnonzero(np.isin(among, values))
    places = places[np.argsort(among[places])]
    if not np.array_equal(among[places], values.ravel()):
        raise UnknownLayout(f"{values.size} numbers are in {len(places)} places")
    return np.asarray(places.reshape(values.shape))
