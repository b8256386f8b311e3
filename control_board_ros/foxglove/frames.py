# SPDX-License-Identifier: Apache-2.0
"""Schemas of messages and services, and the frames of a board's links.

The frames are computed from the published robot description and joint positions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from foxglove import MessageSchema, Schema, ServiceSchema
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from ..recording.definitions import definition, share_file, whole_text
from ..urdf_xml import DescribedJoint, Vector, heard_joints

ENCODING, DEFINITIONS = "cdr", "ros2msg"


@cache
def schema(type_name: str) -> Schema:
    """The schema of ``package/msg/Name``.

    Raises:
        RecordingError: its package is not installed.
    """
    return Schema(name=type_name, encoding=DEFINITIONS, data=definition(type_name).text.encode())


@cache
def service_schema(type_name: str) -> ServiceSchema:
    """The schema of ``package/srv/Name``: its messages are ``…_Request`` and ``…_Response``."""
    request, _, response = share_file(type_name, ".srv").read_text("utf-8").partition("---\n")

    def half(name: str, text: str) -> MessageSchema:
        data = whole_text(type_name, text).encode()
        made = Schema(name=f"{type_name}_{name}", encoding=DEFINITIONS, data=data)
        return MessageSchema(encoding=ENCODING, schema=made)

    return ServiceSchema(
        type_name, request=half("Request", request), response=half("Response", response)
    )


Quat = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame of a link in the frame of its parent link.

    Attributes: parent and child (links), xyz and turn (pose at joint position 0), axis (unit
    vector), leader (joint whose position moves the frame; empty: none), slides, factor and offset
    (joint position = factor · leader's + offset).
    """

    parent: str
    child: str
    xyz: Vector
    turn: Quat
    axis: Vector
    leader: str
    slides: bool
    factor: float = 1.0
    offset: float = 0.0

    def at(self, q: float) -> tuple[Vector, Quat]:
        """Position (m) and quaternion with the leader at position ``q``, rad or m."""
        q = self.factor * q + self.offset
        ax, ay, az = self.axis
        if self.slides:
            dx, dy, dz = turned(self.turn, (ax * q, ay * q, az * q))
            x, y, z = self.xyz
            return (x + dx, y + dy, z + dz), self.turn
        s = math.sin(q / 2.0)
        return self.xyz, times(self.turn, (ax * s, ay * s, az * s, math.cos(q / 2.0)))


def frames_of(description: str) -> list[Frame]:
    """The frames of a robot description; none if it is invalid."""
    return [frame_of(name, joint) for name, joint in heard_joints(description).items()]


def frame_of(name: str, joint: DescribedJoint) -> Frame:
    """The frame of a joint's child link."""
    x, y, z = joint.axis
    length = math.hypot(x, y, z) or 1.0
    return Frame(
        joint.parent,
        joint.child,
        joint.xyz,
        of_rpy(joint.rpy),
        (x / length, y / length, z / length),
        "" if joint.kind == "fixed" else joint.leader or name,
        joint.kind == "prismatic",
        joint.multiplier,
        joint.offset,
    )


def of_rpy(rpy: Vector) -> Quat:
    """The quaternion of rotations about the fixed axes x, then y, then z."""
    (sr, sp, sy), (cr, cp, cy) = (
        tuple(function(angle / 2.0) for angle in rpy) for function in (math.sin, math.cos)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def times(a: Quat, b: Quat) -> Quat:
    """The product a ⊗ b: the rotation b, then a."""
    x, y, z, w = a
    p, q, r, s = b
    return (
        w * p + x * s + y * r - z * q,
        w * q - x * r + y * s + z * p,
        w * r + x * q - y * p + z * s,
        w * s - x * p - y * q - z * r,
    )


def turned(by: Quat, vector: Vector) -> Vector:
    """A vector rotated by a quaternion."""
    x, y, z, _ = times(times(by, (*vector, 0.0)), (-by[0], -by[1], -by[2], by[3]))
    return x, y, z


def message(frames: list[Frame], positions: Mapping[str, float], stamp: Any) -> TFMessage:
    """The frames as a message of /tf; joints without a position are at 0."""
    found = []
    for frame in frames:
        (x, y, z), (a, b, c, w) = frame.at(positions.get(frame.leader, 0.0))
        found.append(
            TransformStamped(
                header=Header(stamp=stamp, frame_id=frame.parent),
                child_frame_id=frame.child,
                transform=Transform(
                    translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=a, y=b, z=c, w=w)
                ),
            )
        )
    return TFMessage(transforms=found)
