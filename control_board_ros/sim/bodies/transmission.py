# SPDX-License-Identifier: Apache-2.0
"""What bodies of both engines have in common: coupled axes (SPEC Y3), and followers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...core.model.coupling import Coupling
from ...core.terms.measurement import Array
from ...description.urdf import Mimic


class CoupledBody:
    """A body whose joints are moved by coupled axes; see ``plant.Body``.

    Args:
        engine: The body of the joints, with their coupling.

    Attributes: engine, coupling, joints (their state, shape (2, m)).
    """

    def __init__(self, engine: Any) -> None:
        self.engine = engine
        self.coupling: Coupling = engine.coupling
        self.joints = np.zeros((2, len(self.coupling.physical_joints)))
        engine.attach(self.joints)
        self.attach(np.zeros((2, len(self.coupling.axes))))
        self.close, self.render = engine.close, engine.render
        self.add_obstacle, self.remove_obstacle = engine.add_obstacle, engine.remove_obstacle
        self.mimic_positions = engine.mimic_positions

    def attach(self, state: Array) -> None:
        self._state = state
        self._read()

    def step(self, torque: Array) -> bool:
        good: bool = self.engine.step(self.coupling.torques(torque, self._state[0]))
        self._read()
        return good

    def restore(self, state: Array) -> None:
        position, velocity = state
        coupling = self.coupling
        self.engine.restore(
            np.array([coupling.positions(position), coupling.velocities(velocity, position)])
        )
        self._state[:] = state

    def link_position(self, axis: int) -> tuple[float, float, float]:
        """Origin of the child link of the first joint that an axis moves, m, in world axes."""
        first = int(np.argmax(np.abs(self.coupling.matrix[:, axis]) > 0.0))
        position: tuple[float, float, float] = self.engine.link_position(first)
        return position

    def _read(self) -> None:
        """Update the state of the axes from that of the joints."""
        position, velocity = self.joints
        self._state[0] = self.coupling.axis_positions(position)
        self._state[1] = self.coupling.axis_velocities(velocity, self._state[0])


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
