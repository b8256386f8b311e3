# SPDX-License-Identifier: Apache-2.0
"""Load of each joint of a robot: inertia and gravity torque over sampled poses.

Inertia matrix M and gravity torques are those of ``kinematics``. 1/(M⁻¹)_jj is the inertia felt by
a motor with the other joints free: the stronger the coupling, the smaller it is than M_jj.
Followers of the joint do not load it, as in the physics, unless they lie beyond it.

A rotor behind a gear adds J N² at its own joint. The simulation adds it to the child link's
tensor (see ``rotor``): a rotor k adds J N² (a_k · a_i) (a_k · a_j) to M_ij of the joints i and j
from the base up to its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.terms.measurement import Array
from .couplings import rotors_at_joints
from .kinematics import MovedJoint, gravity_torque, inertia_matrix, inward, moved_joints
from .urdf import Urdf

EARTH = (0.0, 0.0, -9.81)
POSES = 128
#: Sampled travel of a sliding joint with placeholder limits, m.
REACH = 10.0

#: Robots of more joints invert matrices in every FEWER-th pose only, with this added to the
#: diagonals, kg·m²: links may have no mass.
MANY, FEWER, TINY = 32, 8, 1e-9

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Load:
    """Load of a joint over the poses.

    Attributes: inertia_min, inertia_mean, inertia_max (kg·m²; kg for sliding joints), gravity
    (greatest torque, N·m; force, N).
    """

    inertia_min: float
    inertia_mean: float
    inertia_max: float
    gravity: float


@dataclass(frozen=True, slots=True)
class Loads:
    """The loads of n joints in P poses.

    Attributes: joints (from the base outwards), matrix (M, shape (P, n, n)), gravity (τ_j, shape
    (n, P)), urdf (the robot), axes (names of what moves the joints, shape (a,)), shares (J of the
    joints by the axes, shape (P, n, a); None: the axes are the joints).
    """

    joints: tuple[MovedJoint, ...]
    matrix: Array
    gravity: Array
    urdf: Urdf
    axes: tuple[str, ...] = ()
    shares: Array | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return self.axes or tuple(joint.name for joint in self.joints)

    @property
    def inertia(self) -> Array:
        """M_jj, shape (n, P)."""
        return np.array(np.einsum("pnn->np", self._of_axes(self.matrix)))

    @property
    def by_name(self) -> dict[str, Load]:
        """Of each joint without rotors: least, mean and greatest inertia."""
        rows = zip(self.names, self.inertia, self._most_torques(), strict=True)
        return {
            name: Load(float(row.min()), float(row.mean()), float(row.max()), torque)
            for name, row, torque in rows
        }

    def shared(self, accelerations: Mapping[str, float]) -> dict[str, float]:
        """The greatest Σ_k |M_jk| q̈_k over the poses, of each joint; N·m (N where it slides).

        Args:
            accelerations: q̈_k by name, rad/s² (m/s²); default none.
        """
        rates = np.array([accelerations.get(name, 0.0) for name in self.names])
        torques = (np.abs(self._of_axes(self.matrix)) @ rates).max(axis=0)
        return dict(zip(self.names, torques.tolist(), strict=True))

    def _of_axes(self, matrix: Array) -> Array:
        """Jᵀ M J, shape (P, a, a)."""
        if self.shares is None:
            return matrix
        reduced: Array = self.shares.transpose(0, 2, 1) @ matrix @ self.shares
        return reduced

    def _most_torques(self) -> list[float]:
        """The greatest of Jᵀ τ over the poses, of each axis."""
        torques = self.gravity
        if self.shares is not None:
            torques = np.einsum("pna,np->ap", self.shares, torques)
        largest: list[float] = np.abs(torques).max(axis=1).tolist()
        return largest

    def with_rotors(self, reflected: Mapping[str, float]) -> dict[str, Load]:
        """Of each motor with rotors: least inertia, with the other joints free; its middle and
        greatest, with them at rest.

        Args:
            reflected: J N² by joint name, kg·m² (kg where it slides); default none.
        """
        matrix, at_joints = self.matrix.copy(), rotors_at_joints(self.urdf, reflected)
        for k, joint in enumerate(self.joints):
            rotor = at_joints.get(joint.name, 0.0)
            if joint.slides:
                matrix[:, k, k] += rotor
            elif rotor:
                matrix += rotor * self._rotor_coupling(k)
        matrix = self._of_axes(matrix)
        standing = np.einsum("pnn->np", matrix)
        few = matrix if len(self.names) <= MANY else matrix[::FEWER]
        inverse = np.linalg.inv(few + TINY * np.eye(len(self.names)))
        least = (1.0 / np.einsum("pnn->np", inverse)).min(axis=1)
        rows = zip(self.names, least, standing, self._most_torques(), strict=True)
        return {
            name: Load(float(free), 0.5 * float(row.min() + row.max()), float(row.max()), torque)
            for name, free, row, torque in rows
        }

    def _rotor_coupling(self, k: int) -> Array:
        """(a_k · a_i) (a_k · a_j), shape (P, n, n); zero for joints that are not inward of k."""
        turned = np.zeros((len(self.matrix), len(self.joints)))
        for j in inward(self.joints, k):
            if not self.joints[j].slides:
                turned[:, j] = np.einsum("pi,pi->p", self.joints[j].axis, self.joints[k].axis)
        return turned[:, :, None] * turned[:, None, :]


def loads(
    urdf: Urdf,
    limits: Mapping[str, Range] | None = None,
    gravity: tuple[float, float, float] = EARTH,
) -> Loads:
    """The loads of the joints of a robot.

    Args:
        urdf: The robot.
        limits: Lower and upper limit of each joint of the board, rad or m; others are at zero.
            None: all independent joints, within the URDF's limits.
        gravity: In world axes, m/s².
    """
    if limits is None:
        limits = {joint.name: (joint.lower, joint.upper) for joint in urdf.axes}
    poses = sample_poses(urdf, limits)
    joints = moved_joints(urdf.tree, poses, _driven(urdf, limits))
    torques = [gravity_torque(joint, np.array(gravity)) for joint in joints]
    axes = tuple(name for name in limits if name in poses) if urdf.coupled else ()
    shares = _shares(urdf, axes, poses, [joint.name for joint in joints]) if axes else None
    return Loads(tuple(joints), inertia_matrix(joints), np.array(torques), urdf, axes, shares)


def _driven(urdf: Urdf, names: Collection[str]) -> set[str]:
    """The physical joints of axes."""
    coupled = [c.coupling for c in urdf.coupled if set(c.coupling.axes) <= set(names)]
    return {*names} | {joint for coupling in coupled for joint in coupling.physical_joints}


def _shares(
    urdf: Urdf, axes: tuple[str, ...], poses: Mapping[str, Array], joints: Sequence[str]
) -> Array:
    """J of joints by axes, shape (P, n, a)."""
    shares = np.zeros((POSES, len(joints), len(axes)))
    for k, axis in enumerate(axes):
        if axis in joints:
            shares[:, joints.index(axis), k] = 1.0
    for coupled in urdf.coupled:
        coupling = coupled.coupling
        if not set(coupling.axes) <= set(axes):
            continue
        rows = [joints.index(joint) for joint in coupling.physical_joints]
        columns = [axes.index(axis) for axis in coupling.axes]
        at = np.array([poses[axis] for axis in coupling.axes]).T
        if not coupling.curved:
            at = at[:1]
        shares[:, rows, :] = 0.0
        blocks = np.array([coupling.jacobian(pose) for pose in at])
        shares[np.ix_(range(POSES), rows, columns)] = blocks
    return shares


def sample_poses(urdf: Urdf, limits: Mapping[str, Range]) -> dict[str, Array]:
    """Positions of movable joints, including followers, shape (P,) each; deterministic.

    The first pose has every joint as near to zero as permitted. Half of the others are uniform
    within the limits; in the other half each joint is at a limit or next to zero, where arms are
    stretched out.
    """
    half = POSES // 2
    poses: dict[str, Array] = {}
    for joint in urdf.axes:
        if joint.name not in limits:
            continue
        spread = evenly_spread(1 + len(poses), POSES)
        low, high = sorted(limits[joint.name])  # invalid ones are rejected later
        if joint.kind.slides:
            low, high = max(low, min(-REACH, high)), min(high, max(REACH, low))
        elif high - low > 2.0 * math.pi:
            low, high = max(low, -math.pi), min(high, math.pi)
        rest = min(max(0.0, low), high)
        edges = np.array([low, high, rest, rest])[(4.0 * spread[half:]).astype(int)]
        positions = np.concatenate([low + (high - low) * spread[:half], edges])
        positions[0] = rest
        poses[joint.name] = positions
    for coupled in urdf.coupled:
        axes = coupled.coupling.axes
        if set(axes) <= poses.keys():
            at = np.array([poses[axis] for axis in axes]).T
            places = np.array([coupled.coupling.positions(pose) for pose in at]).T
            poses |= dict(zip(coupled.coupling.physical_joints, places, strict=True))
    for mimic in urdf.mimics.values():
        if mimic.leader in poses:
            poses[mimic.follower] = mimic.multiplier * poses[mimic.leader] + mimic.offset
    return poses


def evenly_spread(dimension: int, count: int) -> Array:
    """frac(k √p), k = 1 … count, with the prime p of the dimension; in [0, 1), shape (count,).

    Kronecker's sequence: its dimensions fill the unit cube more evenly than random numbers, and
    numpy's generators would need 7 MB for this alone.
    """
    prime, primes = 2, 1
    while primes < dimension:
        prime += 1
        primes += all(prime % k for k in range(2, math.isqrt(prime) + 1))
    steps: Array = math.sqrt(prime) * np.arange(1, count + 1, dtype=np.float64)
    return steps % 1.0
