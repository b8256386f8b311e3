# SPDX-License-Identifier: Apache-2.0
"""The arm in MuJoCo.

The same masses, joints and hard stops as in pybullet, and the same integration: dq += h M⁻¹ (τ −
c), q += h dq. Torques enter as ``qfrc_applied``. Shapes are loaded when needed: collision shapes
with the first obstacle, visual ones with the first picture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...core.config.config import BoardConfig
from ...core.terms.measurement import Array
from ..config import SimulationConfig
from ..errors import PlantError, PlantGone
from .mujoco_camera import Box, RayCamera
from .mujoco_spec import FOLLOWER_ARMATURE, GEAR, Builder
from .prepare import fit
from .transmission import Followers

Indices = slice | NDArray[np.intp]


def _let_pass(_warning: str) -> None:
    """Suppress MuJoCo's warning file in the working folder; the plant reports warnings."""


class MujocoBody:
    """One robot, or several of one kind, in a separate world; see ``plant.Body``.

    Several share one place and do not touch: one step of all costs a third of a step for each.

    Args:
        board: Of one robot.
        simulation: Likewise.
        count: Of robots, joint after joint, robot after robot; obstacles and pictures are those
            of one.

    Attributes: coupling (of axes with its joints, for a ``CoupledBody``, or None).

    Raises:
        ConfigError: there is no URDF, or it lacks a joint of the board.
        PlantError: MuJoCo cannot load the URDF, or has several robots of coupled joints.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig, count: int = 1) -> None:
        mujoco.set_mju_user_warning(_let_pass)
        self._simulation = simulation
        self._fitted = fitted = fit(board, simulation)
        if count > 1 and fitted.mimics:
            raise PlantError(f"{fitted.mimics[0].follower} follows another joint; use one arm")
        if count > 1 and fitted.coupling is not None:
            raise PlantError("the arm has coupled joints; use one arm")
        self._prefixes = ["", *(f"{k}/" for k in range(1, count))]
        self.coupling = fitted.coupling
        self._followers = Followers(fitted.mimics, fitted.names)
        self._curved = [gear for gear in fitted.gears if gear.function is not None]
        self._period = simulation.physics_step
        self._camera: RayCamera | None = None
        self._boxes: dict[int, Box] = {}
        self._boxes_ever = 0
        self._advance: Callable[..., None] = mujoco.mj_step
        self._load()
        self.attach(np.zeros((2, count * len(fitted.names))))

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        self._state = state
        self._refresh()

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged.

        Raises:
            PlantGone: the body is closed.
        """
        self._force[self._dofs] = torque
        if self._driven:
            self._drive_followers()
        if self._curved:
            self._bend_gears()
        self._advance(self._model, self._data)
        return self._refresh()

    def restore(self, state: Array) -> None:
        """Set positions and velocities, shape (2, n), also after a divergence.

        Raises:
            PlantGone: the body is closed.
        """
        if self._advance == self._gone:
            self._gone()
        mujoco.mj_resetData(self._model, self._data)
        self._state[:] = state
        self._positions[self._coordinates], self._velocities[self._dofs] = state
        positions, velocities = self._followers.targets(state)
        self._positions[self._following], self._velocities[self._driven] = positions, velocities

    def close(self) -> None:
        """Release the model; safe to call twice."""
        self._advance = self._gone
        self._camera = None

    def add_obstacle(
        self, centre: tuple[float, float, float], half_extents: tuple[float, float, float]
    ) -> int:
        """Add a fixed box to the world, m; returns its number for remove_obstacle."""
        self._boxes_ever += 1
        self._boxes[self._boxes_ever] = (centre, half_extents)
        self._change_boxes()
        return self._boxes_ever

    def remove_obstacle(self, obstacle: int) -> None:
        """Remove a box from the world."""
        del self._boxes[obstacle]
        self._change_boxes()

    def link_position(self, joint: int) -> tuple[float, float, float]:
        """Origin of the child link of a joint, m, in world axes."""
        mujoco.mj_kinematics(self._model, self._data)
        name = self._fitted.names[joint]
        x, y, z = self._data.xpos[self._model.joint(name).bodyid[0]].tolist()
        return x, y, z

    def mimic_positions(self) -> dict[str, float]:
        """Positions of the followers, by name, rad or m."""
        positions = self._positions[self._following].tolist()
        return dict(zip(self._followers.joints, positions, strict=True))

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """A picture of the robot and the obstacles, RGB, shape (height, width, 3)."""
        if self._camera is None:
            self._camera = RayCamera(self._fitted, self._simulation)
        return self._camera.picture(self._positions, list(self._boxes.values()), width, height)

    def _change_boxes(self) -> None:
        """Rebuild the world, in its current state of motion."""
        before = self._data
        self._load()
        self._data.qpos[:], self._data.qvel[:] = before.qpos, before.qvel

    def _load(self) -> None:
        """Build the world with its obstacles."""
        shapes = "collision" if self._boxes else ""
        builder = Builder(self._fitted, self._simulation, shapes)
        for box in self._boxes.values():
            builder.add_box(*box)
        for prefix in self._prefixes[1:]:
            builder.attach(prefix, Builder(self._fitted, self._simulation, shapes))
        self._model = model = builder.build()
        self._data = data = mujoco.MjData(model)
        # Views of MuJoCo's arrays: each attribute access would create one.
        self._positions, self._velocities = data.qpos, data.qvel
        self._force = data.qfrc_applied
        names = [prefix + name for prefix in self._prefixes for name in self._fitted.names]
        joints = self._followers.joints
        self._coordinates = _as_slice([model.joint(name).qposadr[0] for name in names])
        self._dofs = _as_slice([model.joint(name).dofadr[0] for name in names])
        self._following = [model.joint(name).qposadr[0] for name in joints]
        self._driven = [model.joint(name).dofadr[0] for name in joints]
        self._bent = [model.equality(GEAR + gear.follower).id for gear in self._curved]
        self._leads = [model.joint(gear.leader).qposadr[0] for gear in self._curved]

    def _refresh(self) -> bool:
        position, velocity = self._state
        position[:] = self._positions[self._coordinates]
        velocity[:] = self._velocities[self._dofs]
        return math.isfinite(position.dot(position))

    def _drive_followers(self) -> None:
        """Per step: followers track their leaders, without feedback to them.

        a = (v + e/h − v_f)/h: the leader's speed plus removal of the error e in one step.
        """
        positions, velocities = self._followers.targets(self._state)
        for k, (coordinate, dof) in enumerate(zip(self._following, self._driven, strict=True)):
            error = positions[k] - self._positions[coordinate]
            change = velocities[k] + error / self._period - self._velocities[dof]
            self._force[dof] = FOLLOWER_ARMATURE * change / self._period

    def _bend_gears(self) -> None:
        """Per step: the gears that are curved are straight lines, along their tangent."""
        for gear, number, lead in zip(self._curved, self._bent, self._leads, strict=True):
            at = self._positions[lead]
            place, ratio = gear.place(at)
            self._model.eq_data[number, :2] = place - ratio * at, ratio

    def _gone(self, *_: Any) -> NoReturn:
        raise PlantGone("the physics is closed; restart the board")


def _as_slice(indices: list[int]) -> Indices:
    """Indices as a slice if consecutive: a view instead of a copy."""
    first = int(indices[0])
    if [int(index) for index in indices] == list(range(first, first + len(indices))):
        return slice(first, first + len(indices))
    return np.array(indices, dtype=np.intp)
