# SPDX-License-Identifier: Apache-2.0
"""Between the axes of a board and the joints of a body: couplings (SPEC Y3), and followers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.model.coupling import Coupling
from ...core.terms.measurement import Array
from ...description.urdf import Mimic


class Transmission:
    """States and torques from axes to joints and back.

    Args:
        coupling: of the axes with the joints; None: the axes are the joints.
        names: of the axes.

    Attributes: there (whether there is a coupling), movers (of each axis the first joint that it
    moves).
    """

    def __init__(self, coupling: Coupling | None, names: Sequence[str]) -> None:
        self._coupling = coupling or Coupling.plain(names)
        self.there = coupling is not None
        first = np.argmax(np.abs(self._coupling.matrix) > 0.0, axis=0).tolist()
        self.movers = [self._coupling.physical_joints[i] for i in first]

    def torques(self, axes: Array, state: Array) -> Array:
        """Torques of the joints for those of the axes in their state, shape (2, n)."""
        return self._coupling.torques(axes, state[0])

    def joints(self, state: Array) -> Array:
        """The state of the joints, shape (2, m), for that of the axes."""
        if not self.there:
            return state
        position, velocity = state
        coupling = self._coupling
        return np.array([coupling.positions(position), coupling.velocities(velocity, position)])

    def read(self, joints: Array, axes: Array) -> None:
        """Take the state of the axes, shape (2, n), from that of the joints."""
        axes[0] = self._coupling.axis_positions(joints[0])
        axes[1] = self._coupling.axis_velocities(joints[1], axes[0])


class Followers:
    """Targets of the followers, independent of the physics; attribute ``joints``: their names."""

    def __init__(self, mimics: Sequence[Mimic], board_names: Sequence[str]) -> None:
        self.joints = [mimic.follower for mimic in mimics]
        self._followed = [
            (board_names.index(mimic.leader), mimic.multiplier, mimic.offset) for mimic in mimics
        ]

    def targets(self, state: Array) -> tuple[list[float], list[float]]:
        """Target positions and velocities for a state of the board's joints, shape (2, n)."""
        positions, velocities = state.tolist()
        return (
            [multiplier * positions[j] + offset for j, multiplier, offset in self._followed],
            [multiplier * velocities[j] for j, multiplier, _ in self._followed],
        )
