# SPDX-License-Identifier: Apache-2.0
"""Joint axes, moved bodies, inertia matrix and gravity torques of a robot in P poses at once.

With the axis a through the point p, and of all links beyond the joint the mass M, the first
moment h = Σ m c and the inertia tensor about the origin I = Σ R I_c Rᵀ + m (c·c E − c cᵀ)::

    M_jj  = aᵀ I a − 2 (h·p) + 2 (a·h)(a·p) + M (p·p − (a·p)²)     kg·m²  (prismatic: M, kg)
    τ_j   = a · ((h − M p) × g)                                     N·m    (prismatic: M a·g, N)

M_jj is the diagonal of the joint-space inertia matrix: the inertia accelerated by the motor with
the other joints at rest (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 6: composite
rigid bodies). Beside it, the momentum of the bodies beyond joint k, moving at unit speed about
its axis, gives M_jk at each joint j on the way to the base::

    L = I a_k − h × (a_k × p_k),  P = a_k × (h − M p_k)             M_jk = a_j · (L − p_j × P)

All in world axes, about the world's origin; the base is fixed there.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.terms.measurement import Array
from .geometry import axis_of, origin_of, rotations_about
from .merge import NOTHING, inertial_of
from .urdf_tree import Tree

NONE = -1


@dataclass(frozen=True, slots=True)
class Body:
    """Rigid bodies that move as one, in P poses.

    Attributes: mass (kg), moment (first moment h, shape (P, 3), kg·m), tensor (I about the
    origin, shape (P, 3, 3), kg·m²).
    """

    mass: float
    moment: Array
    tensor: Array

    def __add__(self, other: Body) -> Body:
        return Body(self.mass + other.mass, self.moment + other.moment, self.tensor + other.tensor)


@dataclass(frozen=True, slots=True)
class MovedJoint:
    """A joint and its moved bodies, in P poses.

    Attributes: name, slides (prismatic), axis and point (a and p, shape (P, 3)), inner (index of
    the next such joint towards the base, or NONE), body (all links beyond it).
    """

    name: str
    slides: bool
    axis: Array
    point: Array
    inner: int
    body: Body


def moved_joints(
    tree: Tree, positions: Mapping[str, Array], driven: Collection[str]
) -> list[MovedJoint]:
    """The driven joints of a robot, from the base outwards.

    Args:
        tree: The robot.
        positions: Of movable joints, shape (P,) each, rad or m; default zero.
        driven: Names of the requested joints, all movable.
    """
    poses = len(next(iter(positions.values())))
    frames = {tree.base: (np.zeros((poses, 3)), np.broadcast_to(np.eye(3), (poses, 3, 3)))}
    bodies = {tree.base: _body(tree.links[tree.base], *frames[tree.base])}
    inner = {tree.base: NONE}  # index of the driven joint that supports a link
    placed: list[tuple[ET.Element, Array, Array, int]] = []  # joint, axis, point, inner
    joints = list(tree.walk(tree.base))
    for joint in joints:
        name, parent, child = joint.get("name", ""), tree.parent(joint), tree.child(joint)
        position, rotation = frames[parent]
        inner[child] = inner[parent]
        offset, turn = origin_of(joint)
        position, rotation = position + rotation @ offset, rotation @ turn
        if name in positions:
            local = axis_of(joint)
            axis = rotation @ local
            if name in driven:
                inner[child] = len(placed)
                placed.append((joint, axis, position, inner[parent]))
            if tree.slides(joint):
                position = position + axis * positions[name][:, None]
            else:
                rotation = rotation @ rotations_about(local, positions[name])
        frames[child] = position, rotation
        bodies[child] = _body(tree.links[child], position, rotation)
    for joint in reversed(joints):
        bodies[tree.parent(joint)] += bodies[tree.child(joint)]
    return [
        MovedJoint(
            name=joint.get("name", ""),
            slides=tree.slides(joint),
            axis=axis,
            point=point,
            inner=nearer,
            body=bodies[tree.child(joint)],
        )
        for joint, axis, point, nearer in placed
    ]


def inward(joints: Sequence[MovedJoint], k: int) -> list[int]:
    """Indices of a joint and of those between it and the base, outermost first."""
    chain = []
    while k != NONE:
        chain.append(k)
        k = joints[k].inner
    return chain


def inertia_matrix(joints: Sequence[MovedJoint]) -> Array:
    """M, shape (P, n, n), kg·m² (kg·m, kg where joints slide)."""
    n = len(joints)
    matrix = np.zeros((len(joints[0].axis), n, n))
    for k, moving in enumerate(joints):
        linear, angular = _momentum(moving)
        for j in inward(joints, k):
            felt = joints[j]
            if felt.slides:
                moment = _dot(felt.axis, linear)
            else:
                moment = _dot(felt.axis, angular - np.cross(felt.point, linear))
            matrix[:, j, k] = matrix[:, k, j] = np.maximum(moment, 0.0) if j == k else moment
    return matrix


def gravity_torque(joint: MovedJoint, gravity: Array) -> Array:
    """τ_j, shape (P,), N·m or N, under a gravity of shape (3,), m/s²."""
    body = joint.body
    if joint.slides:
        return np.array(body.mass * (joint.axis @ gravity))
    return _dot(joint.axis, np.cross(body.moment - body.mass * joint.point, gravity))


def _momentum(joint: MovedJoint) -> tuple[Array, Array]:
    """P and L of a joint's bodies at unit speed, shape (P, 3) each."""
    axis, point, body = joint.axis, joint.point, joint.body
    if joint.slides:
        return body.mass * axis, np.cross(body.moment, axis)
    linear = np.cross(axis, body.moment - body.mass * point)
    angular = np.einsum("pij,pj->pi", body.tensor, axis)
    return linear, angular - np.cross(body.moment, np.cross(axis, point))


def _body(link: ET.Element, position: Array, rotation: Array) -> Body:
    """A link whose frame has this origin, shape (P, 3), and these axes, shape (P, 3, 3)."""
    inertial = inertial_of(link) or NOTHING
    mass, centre = inertial.mass, position + rotation @ inertial.centre
    tensor = rotation @ inertial.tensor @ rotation.transpose(0, 2, 1)
    square = np.einsum("pi,pi->p", centre, centre)[:, None, None] * np.eye(3)
    tensor += mass * (square - centre[:, :, None] * centre[:, None, :])
    return Body(mass, mass * centre, tensor)


def _dot(a: Array, b: Array) -> Array:
    return np.array(np.einsum("pi,pi->p", a, b))
