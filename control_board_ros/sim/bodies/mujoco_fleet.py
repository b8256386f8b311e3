# SPDX-License-Identifier: Apache-2.0
"""Many arms of one kind in one world of MuJoCo: one step for all, at a third of the cost of each.

They share one place and do not touch: no shape is loaded.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from ...core.config.config import BoardConfig
from ...core.terms.measurement import Array
from ..config import SimulationConfig
from ..errors import PlantError
from .mujoco_spec import Builder
from .prepare import fit


class MujocoFleet:
    """The body of ``count`` arms, joint after joint, arm after arm; see ``plant.Body``.

    Args:
        board: Of one arm.
        simulation: Likewise.
        count: How many arms.

    Raises:
        ConfigError: there is no URDF, or it lacks a joint of the board.
        PlantError: the arm has joints that follow others, or MuJoCo cannot load it.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig, count: int) -> None:
        fitted = fit(board, simulation)
        if fitted.mimics:
            raise PlantError(f"{fitted.mimics[0].follower} follows another joint; use one arm")
        if fitted.coupling is not None:
            raise PlantError("the arm has coupled joints; use one arm")
        one = Builder(fitted, simulation, "").build()
        world = Builder(fit(board, simulation), simulation, "").spec
        for k in range(1, count):
            arm = Builder(fit(board, simulation), simulation, "").spec
            world.attach(arm, prefix=f"{k}/", frame=world.worldbody.add_frame())
        self._model = model = world.compile()
        model.body_inertia[1:] = np.tile(one.body_inertia[1:], (count, 1))
        self._data = data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        self._positions, self._velocities = data.qpos, data.qvel
        self._force = data.qfrc_applied
        own = np.array([one.joint(name).dofadr[0] for name in board.names])
        self._dofs = (np.arange(count)[:, None] * one.nv + own).ravel()

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        self._state = state
        self._refresh()

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged."""
        self._force[self._dofs] = torque
        mujoco.mj_step(self._model, self._data)
        return self._refresh()

    def restore(self, state: Array) -> None:
        """Take over positions and velocities, shape (2, n), also after a divergence."""
        mujoco.mj_resetData(self._model, self._data)
        self._state[:] = state
        self._positions[self._dofs], self._velocities[self._dofs] = state

    def close(self) -> None:
        """Let go of nothing."""

    def _refresh(self) -> bool:
        position, velocity = self._state
        position[:] = self._positions[self._dofs]
        velocity[:] = self._velocities[self._dofs]
        return math.isfinite(position.dot(position))
