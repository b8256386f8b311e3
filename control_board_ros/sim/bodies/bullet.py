# SPDX-License-Identifier: Apache-2.0
"""The arm in pybullet.

pybullet's own joint motors and dampers are off: every torque comes from our motors. Hard stops are
the board's hard limits (the URDF's, unless narrowed by the configuration), rigid and without
bounce. Each body is a separate physics server. Shapes, possibly large meshes, are loaded when
needed: for a window at once, collision shapes with the first obstacle, visual ones with the first
picture.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from functools import partial
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ...core.config.config import BoardConfig
from ...core.model.coupling import Gear
from ...core.terms.measurement import Array
from ...description.rotor import add_rotor_inertia
from ..config import SimulationConfig
from ..drive import StateReader
from ..errors import PlantError, PlantGone
from .camera import Camera
from .prepare import fit
from .transmission import Followers
from .world import Box, bullet, connect, load

MOVING = (bullet.JOINT_REVOLUTE, bullet.JOINT_PRISMATIC)
FOLLOWING_FORCE = 1e4
#: Maximum number of joints that pybullet reads and drives.
MOST_JOINTS = 127


class BulletBody:
    """A robot in a physics server of its own; see ``plant.Body``.

    Attributes: coupling (of axes with its joints, for a ``CoupledBody``, or None).

    Raises:
        ConfigError: there is no URDF, or it lacks a joint of the board.
        PlantError: the URDF cannot be loaded, or a window is requested without a display.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        self._fitted, self._simulation = fit(board, simulation), simulation
        fitted = self._fitted
        self._moments = add_rotor_inertia(fitted.tree, fitted.rotors)
        ET.indent(fitted.tree.root)  # pybullet cannot read long lines
        self.coupling = fitted.coupling
        self._camera: Camera | None = None
        self._boxes: dict[int, Box] = {}
        self._followers = Followers(fitted.mimics, fitted.names)
        self._gears: list[tuple[Gear, int, int]] = []
        self._client = connect(gui=simulation.gui)
        try:
            self._load(shapes=simulation.gui)
        except BaseException:
            self.close()
            raise
        self.attach(np.zeros((2, len(fitted.names))))
        self._saved = bullet.saveState(physicsClientId=self._client)

    def _load(self, *, shapes: bool) -> None:
        """Load the robot into the world, with or without shapes."""
        self._solid = shapes
        text, gui = self._fitted.text(shapes=shapes), self._simulation.gui
        self._body = load(self._client, text, self._simulation, visuals=gui)
        joints = self._find_joints()
        self._joints = [joints[name] for name in self._fitted.names]
        self._disable_motors(list(joints.values()))
        for stop, index in zip(self._fitted.joints, self._joints, strict=True):
            if math.isfinite(stop.upper - stop.lower):
                self._limit(index, stop.lower, stop.upper)
        self._gears = [
            (gear, self._mesh(gear, joints), joints[gear.leader]) for gear in self._fitted.gears
        ]
        self._following = [joints[name] for name in self._followers.joints]
        self._apply: Callable[..., None] = partial(
            bullet.setJointMotorControlArray,
            self._body,
            self._joints,
            bullet.TORQUE_CONTROL,
            physicsClientId=self._client,
        )

    def _load_shapes(self) -> None:
        """Reload the robot with collision shapes, in its current state of motion."""
        before, client, moving = self._body, self._client, [*self._joints, *self._following]
        states = bullet.getJointStates(before, moving, client)
        place = bullet.getBasePositionAndOrientation(before, client)
        speed = bullet.getBaseVelocity(before, client)
        bullet.removeBody(before, physicsClientId=client)
        self._load(shapes=True)
        bullet.resetBasePositionAndOrientation(self._body, *place, physicsClientId=client)
        bullet.resetBaseVelocity(self._body, *speed, physicsClientId=client)
        for index, state in zip(moving, states, strict=True):
            bullet.resetJointState(self._body, index, state[0], state[1], client)

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        self._state = state
        self._read_states = StateReader(*(row.data for row in state)).read
        self._refresh()

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged.

        Raises:
            PlantGone: the physics server is gone.
        """
        try:
            self._apply(forces=torque.tolist())
            if self._following:
                self._drive_followers()
            if self._gears:
                self._bend_gears()
            bullet.stepSimulation(self._client)
            return self._refresh()
        except bullet.error:
            self._gone()

    def restore(self, state: Array) -> None:
        """Set positions and velocities, shape (2, n), also after a divergence.

        pybullet keeps a NaN unless a saved state is restored first.
        """
        try:
            bullet.restoreState(self._saved, physicsClientId=self._client)
            self._state[:] = state
            positions, velocities = self._followers.targets(state)
            indices = [*self._joints, *self._following]
            positions = [*state[0].tolist(), *positions]
            velocities = [*state[1].tolist(), *velocities]
            for index, position, velocity in zip(indices, positions, velocities, strict=True):
                bullet.resetJointState(self._body, index, position, velocity, self._client)
        except bullet.error:
            self._gone()

    def close(self) -> None:
        """Stop the physics server; safe to call twice."""
        client, self._client = self._client, -1
        self._apply = self._gone
        if self._camera is not None:
            self._camera.close()
        if client >= 0 and bullet.isConnected(client):
            bullet.disconnect(client)

    def add_obstacle(
        self, centre: tuple[float, float, float], half_extents: tuple[float, float, float]
    ) -> int:
        """Add a fixed box to the world, m; returns its number for remove_obstacle."""
        if not self._solid:
            self._load_shapes()
        box = Box(centre, half_extents)
        obstacle = box.put(self._client)
        self._boxes[obstacle] = box
        self._save()
        return obstacle

    def remove_obstacle(self, obstacle: int) -> None:
        """Remove a box from the world."""
        del self._boxes[obstacle]
        bullet.removeBody(obstacle, physicsClientId=self._client)
        self._save()

    def link_position(self, joint: int) -> tuple[float, float, float]:
        """Origin of the child link of a joint, m, in world axes."""
        x, y, z = bullet.getLinkState(
            self._body,
            self._joints[joint],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )[4]
        return x, y, z

    def mimic_positions(self) -> dict[str, float]:
        """Positions of the followers, by name, rad or m."""
        states = bullet.getJointStates(self._body, self._following, self._client) or ()
        return {name: state[0] for name, state in zip(self._followers.joints, states, strict=True)}

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """A picture of the robot and the obstacles, RGB, shape (height, width, 3)."""
        if self._camera is None:
            self._camera = Camera(self._fitted.text(shapes=True), self._simulation)
        every = range(bullet.getNumJoints(self._body, self._client))
        states = bullet.getJointStates(self._body, every, self._client)
        positions = [state[0] for state in states]
        return self._camera.picture(positions, list(self._boxes.values()), width, height)

    def _refresh(self) -> bool:
        states = bullet.getJointStates(self._body, self._joints, self._client)
        good: bool = self._read_states(states)
        return good

    def _mesh(self, gear: Gear, joints: dict[str, int]) -> int:
        """Let a joint be moved along with another; returns the constraint's number."""
        made = bullet.createConstraint(
            self._body,
            joints[gear.follower],
            self._body,
            joints[gear.leader],
            jointType=bullet.JOINT_GEAR,
            jointAxis=[0.0, 0.0, 1.0],
            parentFramePosition=[0.0] * 3,
            childFramePosition=[0.0] * 3,
            physicsClientId=self._client,
        )
        self._bend(gear, made, 0.0)
        return int(made)

    def _bend(self, gear: Gear, constraint: int, at: float) -> None:
        """Lay a gear along its tangent where its leader is."""
        place, ratio = gear.place(at)
        bullet.changeConstraint(
            constraint,
            gearRatio=-ratio,
            relativePositionTarget=place - ratio * at,
            erp=1.0,
            maxForce=FOLLOWING_FORCE,
            physicsClientId=self._client,
        )

    def _bend_gears(self) -> None:
        """Per step: the gears that are curved are straight lines, along their tangent."""
        for gear, constraint, leader in self._gears:
            if gear.function is not None:
                at = bullet.getJointState(self._body, leader, self._client)[0]
                self._bend(gear, constraint, at)

    def _save(self) -> None:
        bullet.removeState(self._saved, physicsClientId=self._client)
        self._saved = bullet.saveState(physicsClientId=self._client)

    def _gone(self, **_: Any) -> NoReturn:
        raise PlantGone("the physics server is gone; restart the board") from None

    def _find_joints(self) -> dict[str, int]:
        """Indices of the movable joints; also sets the dynamics of every link."""
        joints = {}
        if (count := bullet.getNumJoints(self._body, self._client)) > MOST_JOINTS:
            raise PlantError(
                f"urdf: {count} joints move, pybullet supports at most {MOST_JOINTS}; name those "
                "of the board in the parameter joints, the others are fixed then"
            )
        for index in range(count):
            info = bullet.getJointInfo(self._body, index, self._client)
            extra = {}
            if (link := info[12].decode()) in self._moments:
                extra["localInertiaDiagonal"] = self._moments[link]
            bullet.changeDynamics(
                self._body,
                index,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
                physicsClientId=self._client,
                **extra,
            )
            if info[2] in MOVING:
                joints[info[1].decode()] = index
        return joints

    def _disable_motors(self, indices: list[int]) -> None:
        bullet.setJointMotorControlArray(
            self._body,
            indices,
            bullet.VELOCITY_CONTROL,
            forces=[0.0] * len(indices),
            physicsClientId=self._client,
        )

    def _limit(self, index: int, lower: float, upper: float) -> None:
        info = bullet.getJointInfo(self._body, index, self._client)
        if (info[8], info[9]) != (lower, upper):
            bullet.changeDynamics(
                self._body,
                index,
                jointLowerLimit=lower,
                jointUpperLimit=upper,
                physicsClientId=self._client,
            )

    def _drive_followers(self) -> None:
        """Per step: followers track their leaders, without feedback to them."""
        positions, velocities = self._followers.targets(self._state)
        bullet.setJointMotorControlArray(
            self._body,
            self._following,
            bullet.POSITION_CONTROL,
            targetPositions=positions,
            targetVelocities=velocities,
            forces=[FOLLOWING_FORCE] * len(positions),
            positionGains=[1.0] * len(positions),
            velocityGains=[1.0] * len(positions),
            physicsClientId=self._client,
        )
