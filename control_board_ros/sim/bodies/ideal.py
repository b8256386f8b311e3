# SPDX-License-Identifier: Apache-2.0
"""The ideal body: one double integrator per joint between two hard stops, no gravity."""

from __future__ import annotations

import math

import numpy as np

from ...core.config.config import BoardConfig
from ...core.terms.measurement import Array
from ..config import SimulationConfig
from ..motor import rotors_at_axes


class IdealBody:
    """Independent joints; semi-implicit Euler, exact at constant torque in dq.

    At a hard stop a joint has zero velocity until driven away.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        inertia = np.array([joint.inertia for joint in simulation.joints])
        self._step = simulation.physics_step
        self._gain = self._step / (inertia + rotors_at_axes(board, simulation))
        self._lower = np.array([joint.limits.hard_lower for joint in board.joints])
        self._upper = np.array([joint.limits.hard_upper for joint in board.joints])
        self._change = np.zeros(len(inertia))
        self._state = np.zeros((2, len(inertia)))
        self._position, self._velocity = self._state

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        self._state = state
        self._position, self._velocity = state

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged."""
        position, velocity, change = self._position, self._velocity, self._change
        np.multiply(torque, self._gain, change)
        np.add(velocity, change, velocity)
        np.multiply(velocity, self._step, change)
        np.add(position, change, change)
        np.maximum(change, self._lower, out=position)
        np.minimum(position, self._upper, out=position)
        if change.tobytes() != position.tobytes():
            velocity[change != position] = 0.0
        return math.isfinite(position.dot(position))

    def restore(self, state: Array) -> None:
        """Set positions and velocities, shape (2, n)."""
        self._state[:] = state

    def close(self) -> None:
        """Nothing to release."""
