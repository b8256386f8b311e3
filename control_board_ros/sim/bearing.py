# SPDX-License-Identifier: Apache-2.0
"""Stiction of the bearings, beyond the torque sensors: what holds a joint that is nearly balanced.

Most of a joint's Coulomb friction is the gearbox's (see ``motor``), before the torque sensor: a
torque loop makes up for it. The bearing has a little of it, beyond: a bristle that bends until it
slips (Dahl, 1968; with damping as LuGre has it), so that a joint at rest does not creep::

    y' = clip(y + σ q̇ h, −B, B)            the bristle's torque, slipping at B
    torque = −clip(y' + c q̇, −B, B)

B = min(0.02 % of the torque limit, 10 % of coulomb), σ = B/z with the bend z at which it slips.
z and the damping c keep the explicit integration stable at the least inertia M, and c damps the
largest one::

    z ≥ h² B/(0.05 M),    c = min(√(M_max σ), M/(2 h))
"""

from __future__ import annotations

import numpy as np

from ..core.config import BoardConfig
from ..core.measurement import Array
from .config import SimulationConfig

OF_TORQUE, OF_COULOMB = 2e-4, 0.1
BEND, BEND_METRES = 1e-4, 1e-5


def bearing_torque(board: BoardConfig, simulation: SimulationConfig) -> Array:
    """B of each joint, shape (n,), N·m (N where it slides)."""
    return np.array(
        [
            min(OF_TORQUE * joint.limits.torque, OF_COULOMB * model.motor.coulomb)
            for joint, model in zip(board.joints, simulation.joints, strict=True)
        ]
    )


class Bearings:
    """The bearings of a plant.

    Args:
        board: The board.
        simulation: Its plant.
        inertia: The least that each joint moves, shape (n,), kg·m².
        velocity: Of the joints, shape (n,), rad/s; read in every step.
        torque: From the gearbox to the link, shape (n,), N·m; read in every step.
    """

    def __init__(
        self,
        board: BoardConfig,
        simulation: SimulationConfig,
        inertia: Array,
        velocity: Array,
        torque: Array,
    ) -> None:
        h = simulation.physics_step
        slip = bearing_torque(board, simulation)
        largest = np.maximum(inertia, [joint.inertia_max for joint in board.joints])
        sliding = np.array([joint.kind == "prismatic" for joint in board.joints])
        bend = np.where(sliding, BEND_METRES, BEND)
        bend = np.maximum(bend, h**2 * slip / (0.05 * inertia))
        stiffness = slip / bend
        self._bending = stiffness * h
        self._damping = np.minimum(np.sqrt(largest * stiffness), inertia / (2.0 * h))
        self._slip, self._back = slip, -slip
        self._velocity, self._torque = velocity, torque
        self._bent, self._drag = np.zeros((2, len(slip)))
        self.active = bool(slip.any())
        self.applied = np.zeros(len(slip)) if self.active else torque

    def step(self) -> None:
        """Let one physics step pass; ``applied`` is then the torque on the links."""
        bent, drag, velocity = self._bent, self._drag, self._velocity
        slip, back = self._slip, self._back
        np.multiply(velocity, self._bending, drag)
        np.add(bent, drag, bent)
        np.minimum(bent, slip, out=bent)
        np.maximum(bent, back, out=bent)
        np.multiply(velocity, self._damping, drag)
        np.add(drag, bent, drag)
        np.minimum(drag, slip, out=drag)
        np.maximum(drag, back, out=drag)
        np.subtract(self._torque, drag, self.applied)

    def rest(self) -> None:
        """Nothing is bent."""
        self._bent.fill(0.0)
