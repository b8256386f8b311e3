# SPDX-License-Identifier: Apache-2.0
"""How the axes of a board and the physical joints of its robot hang together (SPEC Y3).

Linear in the positions, with the matrix J of shape (m, n), m physical joints and n axes::

    q_joints = J q_axes + offset      dq_joints = J dq_axes      ddq_joints = J ddq_axes
    τ_axes   = Jᵀ τ_joints            (the same power on both sides)

The way back is the least-squares one: exact where the physical joints are on the coupling, and for
torques the smallest ones that make those of the axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..terms.measurement import Array


@dataclass(frozen=True)
class Coupling:
    """A linear coupling.

    Args:
        axes: names of the n axes, the board's joints.
        physical_joints: names of the m physical joints.
        rows: of the matrix, one for each physical joint.
        offsets: of the positions of the physical joints, rad or m; empty: zeros.
    """

    axes: tuple[str, ...]
    physical_joints: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    offsets: tuple[float, ...] = ()

    @classmethod
    def plain(cls, axes: Sequence[str]) -> Coupling:
        """Each axis is a physical joint."""
        return cls(tuple(axes), tuple(axes), tuple(map(tuple, np.eye(len(axes)).tolist())))

    @cached_property
    def matrix(self) -> Array:
        """J, shape (m, n)."""
        return np.array(self.rows, dtype=np.float64).reshape(-1, len(self.axes))

    @cached_property
    def inverse(self) -> Array:
        """The pseudo-inverse of J, shape (n, m)."""
        return np.asarray(np.linalg.pinv(self.matrix), dtype=np.float64)

    @cached_property
    def offset(self) -> Array:
        """Of the positions of the physical joints, shape (m,)."""
        return np.array(self.offsets or [0.0] * len(self.physical_joints))

    def positions(self, axes: Array) -> Array:
        """Positions of the physical joints, shape (m,), for those of the axes, shape (n,)."""
        found: Array = self.matrix @ axes + self.offset
        return found

    def velocities(self, axes: Array) -> Array:
        """Velocities, or accelerations, of the physical joints for those of the axes."""
        found: Array = self.matrix @ axes
        return found

    def torques(self, axes: Array) -> Array:
        """The smallest torques of the physical joints, shape (m,), that make those of the axes."""
        found: Array = self.inverse.T @ axes
        return found

    def axis_positions(self, joints: Array) -> Array:
        """Positions of the axes, shape (n,), for those of the physical joints, shape (m,)."""
        found: Array = self.inverse @ (joints - self.offset)
        return found

    def axis_velocities(self, joints: Array) -> Array:
        """Velocities, or accelerations, of the axes for those of the physical joints."""
        found: Array = self.inverse @ joints
        return found

    def axis_torques(self, joints: Array) -> Array:
        """Torques of the axes for those of the physical joints: τ_axes = Jᵀ τ_joints."""
        found: Array = self.matrix.T @ joints
        return found


def side_by_side(couplings: Sequence[Coupling]) -> Coupling:
    """The coupling of several parts, none of which acts on another's joints."""
    axes = tuple(name for one in couplings for name in one.axes)
    before, rows = 0, []
    for one in couplings:
        after = len(axes) - before - len(one.axes)
        rows += [(0.0,) * before + row + (0.0,) * after for row in one.rows]
        before += len(one.axes)
    joints = tuple(name for one in couplings for name in one.physical_joints)
    offsets = tuple(value for one in couplings for value in one.offset.tolist())
    return Coupling(axes, joints, tuple(rows), offsets)
