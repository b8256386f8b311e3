# SPDX-License-Identifier: Apache-2.0
"""The ideal body: one double integrator per joint between two hard stops, no gravity."""

from __future__ import annotations

import math
from typing import Self

import numpy as np

from ...core.config.config import BoardConfig
from ...core.terms.measurement import Array
from ..config import SimulationConfig
from ..motor import rotors_at_axes


class IdealBody:
    """Independent joints; semi-implicit Euler, exact at constant torque in dq.

    At a hard stop a joint has zero velocity until driven away. See ``plant.Body``.

    Args:
        step: s.
        inertia: kg·m² or kg, shape (n,).
        lower, upper: Hard stops, rad or m, shape (n,).
    """

    def __init__(self, step: float, inertia: Array, lower: Array, upper: Array) -> None:
        self._step, self._gain = step, step / inertia
        self._lower, self._upper = lower, upper
        self._change = np.zeros(len(inertia))
        self.attach(np.zeros((2, len(inertia))))

    @classmethod
    def of_board(cls, board: BoardConfig, simulation: SimulationConfig) -> Self:
        """The joints of a board, between their hard limits."""
        inertia = np.array([joint.inertia for joint in simulation.joints])
        return cls(
            simulation.physics_step,
            inertia + rotors_at_axes(board, simulation),
            np.array([joint.limits.hard_lower for joint in board.joints]),
            np.array([joint.limits.hard_upper for joint in board.joints]),
        )

    def attach(self, state: Array) -> None:
        self._state = state
        self._position, self._velocity = state

    def step(self, torque: Array) -> bool:
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
        self._state[:] = state

    def close(self) -> None:
        """Nothing to release."""
