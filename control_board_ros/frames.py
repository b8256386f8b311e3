# SPDX-License-Identifier: Apache-2.0
"""Pose of each link's frame in its parent link's frame, as in tf2, and the message of /tf.

With the position q of a joint, its origin p₀ and rotation r₀ (a unit quaternion), and its axis a::

    turns:   p = p₀,              r = r₀ ⊗ (a sin q/2, cos q/2)
                                    = cos q/2 · r₀ + sin q/2 · r₀ ⊗ (a, 0)
    slides:  p = p₀ + q R(r₀) a,  r = r₀
    follows: as these, with q = multiplier · q_leader + offset

r₀ and r₀ ⊗ (a, 0) are constants; all joints are computed at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from .core.model.coupling import Coupling
from .core.terms.measurement import Array
from .urdf_xml import DescribedJoint

#: Numbers of a pose: position x, y, z (m), unit quaternion x, y, z, w.
POSE = 7


@dataclass(frozen=True, slots=True)
class Edge:
    """The frame of link ``child`` in the frame of link ``parent``."""

    parent: str
    child: str


class Frames:
    """The frames of a robot's links.

    Args:
        joints: of the robot, by name.
        names: joints whose positions are given, in this order.
        coupling: of these with the robot's joints; None: they are those.

    Attributes: names, moving (edges with poses that depend on the positions), standing (all
    others: fixed joints, and undriven joints at zero), standing_poses (shape (len(standing), 7);
    see POSE).
    """

    def __init__(
        self,
        joints: Mapping[str, DescribedJoint],
        names: Sequence[str],
        coupling: Coupling | None = None,
    ) -> None:
        self.names, self._coupling = tuple(names), coupling
        physical = names if coupling is None else coupling.physical_joints
        index = {name: j for j, name in enumerate(physical)}
        moving: list[DescribedJoint] = []
        standing: list[DescribedJoint] = []
        leads: list[tuple[int, float, float]] = []
        for name, joint in joints.items():
            if name in index:
                leads.append((index[name], 1.0, 0.0))
            elif joint.leader in index:
                leads.append((index[joint.leader], joint.multiplier, joint.offset))
            else:
                standing.append(joint)
                continue
            moving.append(joint)
        self.moving, self.standing = _edges(moving), _edges(standing)
        self.standing_poses = np.hstack(_origins(standing))

        self._source = np.array([source for source, _, _ in leads], dtype=np.intp)
        self._multiplier = np.array([multiplier for _, multiplier, _ in leads])
        self._offset = np.array([offset for _, _, offset in leads])
        slides = np.array([joint.slides for joint in moving], dtype=bool)
        #: q/2 of turning joints, 0 of sliding ones.
        self._half = np.where(slides, 0.0, 0.5)
        self._position, self._rotation = _origins(moving)
        lengths = np.array([math.hypot(*joint.axis) or 1.0 for joint in moving])
        axes = _rows([joint.axis for joint in moving]) / lengths[:, None]
        self._turned = _product(self._rotation, axes)
        self._along = np.where(slides[:, None], _rotated(self._rotation, axes), 0.0)

    def poses(self, positions: Array) -> Array:
        """The poses of ``moving``, shape (len(moving), 7); see POSE.

        Args:
            positions: of the joints, shape (n,), rad or m.
        """
        if self._coupling is not None:
            positions = self._coupling.positions(positions)
        q = positions[self._source] * self._multiplier + self._offset
        half = (q * self._half)[:, None]
        made = np.empty((len(q), POSE))
        made[:, :3] = self._position + q[:, None] * self._along
        made[:, 3:] = np.cos(half) * self._rotation + np.sin(half) * self._turned
        return made


def tf_message(edges: Sequence[Edge], poses: Array, stamp: Any, prefix: str = "") -> TFMessage:
    """Frames as a message; poses of shape (len(edges), 7)."""
    return TFMessage(
        transforms=[
            TransformStamped(
                header=Header(stamp=stamp, frame_id=prefix + edge.parent),
                child_frame_id=prefix + edge.child,
                transform=Transform(
                    translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=a, y=b, z=c, w=w)
                ),
            )
            for edge, (x, y, z, a, b, c, w) in zip(edges, poses.tolist(), strict=True)
        ]
    )


def quaternions_of_rpy(angles: Array) -> Array:
    """Unit quaternions x, y, z, w, shape (m, 4), of roll, pitch and yaw about fixed axes, rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(0.5 * angles).T, np.sin(0.5 * angles).T
    return np.column_stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def _edges(joints: Sequence[DescribedJoint]) -> tuple[Edge, ...]:
    return tuple(Edge(joint.parent, joint.child) for joint in joints)


def _rows(vectors: Sequence[tuple[float, float, float]]) -> Array:
    return np.array(vectors, dtype=float).reshape(-1, 3)


def _origins(joints: Sequence[DescribedJoint]) -> tuple[Array, Array]:
    """Positions, shape (m, 3), m, and rotations, shape (m, 4)."""
    turns = _rows([joint.rpy for joint in joints])
    return _rows([joint.xyz for joint in joints]), quaternions_of_rpy(turns)


def _product(rotations: Array, vectors: Array) -> Array:
    """Products r ⊗ (v, 0) = (w v + u × v, −u·v), shape (m, 4); r = (u, w), shape (m, 4)."""
    parts, scalars = rotations[:, :3], rotations[:, 3:]
    vector = scalars * vectors + np.cross(parts, vectors)
    return np.concatenate([vector, -np.einsum("mi,mi->m", parts, vectors)[:, None]], axis=1)


def _rotated(rotations: Array, vectors: Array) -> Array:
    """Vectors R(r) v = v + 2 w (u × v) + 2 u × (u × v), shape (m, 3); r as in ``_product``."""
    parts, scalars = rotations[:, :3], rotations[:, 3:]
    crossed = 2.0 * np.cross(parts, vectors)
    return np.array(vectors + scalars * crossed + np.cross(parts, crossed))
