# SPDX-License-Identifier: Apache-2.0
"""Pose of each link's frame in its parent link's frame, as in tf2.

With the position q of a joint, its origin p₀ and rotation r₀ (a unit quaternion), and its axis a::

    turns:   p = p₀,              r = r₀ ⊗ (a sin q/2, cos q/2)
                                    = cos q/2 · r₀ + sin q/2 · r₀ ⊗ (a, 0)
    slides:  p = p₀ + q R(r₀) a,  r = r₀
    follows: as these, with q = multiplier · q_leader + offset

r₀ and r₀ ⊗ (a, 0) are constants; all joints are computed at once.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.terms.measurement import Array
from .couplings import coupling_of
from .geometry import axis_of, numbers_of, origin_of, quaternion_of_rpy
from .urdf import Mimic, Urdf
from .urdf_tree import Tree

#: Numbers of a pose: position x, y, z (m), unit quaternion x, y, z, w.
POSE = 7


@dataclass(frozen=True, slots=True)
class Edge:
    """The frame of link ``child`` in the frame of link ``parent``."""

    parent: str
    child: str


class Frames:
    """The frames of a robot's links, parent by parent.

    Args:
        urdf: the robot.
        names: joints whose positions are given, in this order.

    Attributes: moving (edges with poses that depend on the positions), standing (all others:
    fixed joints, and undriven joints at zero), standing_poses (shape (len(standing), 7); see
    POSE).
    """

    def __init__(self, urdf: Urdf, names: Sequence[str]) -> None:
        self._coupling = coupling_of(urdf, names, followers=False)
        physical = names if self._coupling is None else self._coupling.physical_joints
        index = {name: j for j, name in enumerate(physical)}
        followed = {
            name: mimic
            for name, mimic in urdf.mimics.items()
            if name not in index and mimic.leader in index
        }
        moving: list[ET.Element] = []
        standing: list[ET.Element] = []
        for joint in urdf.tree.walk(urdf.tree.base):
            name = joint.get("name", "")
            (moving if name in index or name in followed else standing).append(joint)
        self.moving = tuple(map(_edge, moving))
        self.standing = tuple(map(_edge, standing))
        self.standing_poses = np.array([_origin(joint) for joint in standing]).reshape(-1, POSE)

        leads = [followed.get(joint.get("name", ""), _itself(joint)) for joint in moving]
        self._source = np.array([index[lead.leader] for lead in leads], dtype=np.intp)
        self._multiplier = np.array([lead.multiplier for lead in leads])
        self._offset = np.array([lead.offset for lead in leads])
        slides = np.array([Tree.slides(joint) for joint in moving])
        #: q/2 of turning joints, 0 of sliding ones.
        self._half = np.where(slides, 0.0, 0.5)
        origins = np.array([_origin(joint) for joint in moving]).reshape(-1, POSE)
        self._position, self._rotation = origins[:, :3], origins[:, 3:]
        axes = np.array([axis_of(joint) for joint in moving]).reshape(-1, 3)
        self._turned = _product(self._rotation, axes)
        turns = np.array([origin_of(joint)[1] for joint in moving]).reshape(-1, 3, 3)
        along = np.einsum("mij,mj->mi", turns, axes)
        self._along = np.where(slides[:, None], along, 0.0)

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


def _edge(joint: ET.Element) -> Edge:
    return Edge(Tree.parent(joint), Tree.child(joint))


def _itself(joint: ET.Element) -> Mimic:
    """An independent joint, expressed as a follower of itself."""
    name = joint.get("name", "")
    return Mimic(name, name, 1.0, 0.0)


def _origin(joint: ET.Element) -> Array:
    origin = joint.find("origin")
    return np.concatenate(
        [numbers_of(origin, "xyz"), quaternion_of_rpy(numbers_of(origin, "rpy"))]
    )


def _product(rotations: Array, vectors: Array) -> Array:
    """Products r ⊗ (v, 0) = (w v + u × v, −u·v), shape (m, 4); r = (u, w), shape (m, 4)."""
    parts, scalars = rotations[:, :3], rotations[:, 3:]
    vector = scalars * vectors + np.cross(parts, vectors)
    return np.concatenate([vector, -np.einsum("mi,mi->m", parts, vectors)[:, None]], axis=1)
