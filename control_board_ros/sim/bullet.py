# SPDX-License-Identifier: Apache-2.0
"""The arm in pybullet; the only file that imports it.

pybullet's own joint motors and dampers are off: every torque comes from our motors. Hard stops
are the board's hard limits (the URDF's, unless the configuration narrows them); they are hard
and without bounce. Each body is a physics server of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from struct import Struct
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..core.config import BoardConfig
from ..core.measurement import Array
from .config import Mimic, SimulationConfig
from .display import check_display
from .errors import PlantError, PlantGone
from .prepare import prepare
from .rotor import Moments
from .terminal import captured_output

with captured_output():
    import pybullet as bullet

MOVING = (bullet.JOINT_REVOLUTE, bullet.JOINT_PRISMATIC)
MIMIC_FORCE = 1e4
#: pybullet neither reads nor drives the joints of a larger robot.
MOST_JOINTS = 127


class BulletBody:
    """A robot in a physics server of its own; see ``plant.Body``.

    Raises:
        ConfigError: the URDF lacks a joint of the board.
        PlantError: the URDF cannot be loaded, or a window is asked for without a display.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        self._name = simulation.urdf or ""
        if self._name.lstrip().startswith("<"):
            self._name = "urdf"
        model = prepare(board, simulation)
        self._client = _connect(simulation.gui)
        try:
            self._body = self._load(model.text, simulation)
            joints = self._find_joints(model.moments)
            self._joints = [joints[name] for name in board.names]
            self._disable_motors(list(joints.values()))
            for joint, index in zip(board.joints, self._joints, strict=True):
                if joint.kind != "continuous":
                    self._limit(index, joint.limits.hard_lower, joint.limits.hard_upper)
            self._follow(model.mimics, joints, board.names)
        except BaseException:
            self.close()
            raise
        n = len(self._joints)
        self._pack = Struct(f"{2 * n}d").pack_into
        self._state = np.zeros((2, n))
        self._bytes = self._state.data.cast("B")
        self._apply: Callable[..., None] = partial(
            bullet.setJointMotorControlArray,
            self._body,
            self._joints,
            bullet.TORQUE_CONTROL,
            physicsClientId=self._client,
        )
        self._saved = bullet.saveState(physicsClientId=self._client)

    def attach(self, state: Array) -> None:
        """Refresh ``state``, shape (2, n), position and velocity, from now on."""
        self._state = state
        self._bytes = state.data.cast("B")
        self._refresh()

    def step(self, torque: Array) -> bool:
        """Apply torques, shape (n,), for one physics step; false if the state diverged.

        Raises:
            PlantGone: the physics server is gone.
        """
        try:
            self._apply(forces=torque.tolist())
            if self._mimics:
                self._drive_mimics()
            bullet.stepSimulation(self._client)
            return self._refresh()
        except bullet.error:
            self._gone()

    def restore(self, state: Array) -> None:
        """Take over positions and velocities, shape (2, n), also after a divergence.

        pybullet keeps a NaN for good unless a saved state is restored first.
        """
        try:
            bullet.restoreState(self._saved, physicsClientId=self._client)
            self._state[:] = state
            followers = self._mimic_state() if self._mimics else ([], [])
            indices = [*self._joints, *self._followers]
            positions = [*state[0].tolist(), *followers[0]]
            velocities = [*state[1].tolist(), *followers[1]]
            for index, position, velocity in zip(indices, positions, velocities, strict=True):
                bullet.resetJointState(self._body, index, position, velocity, self._client)
        except bullet.error:
            self._gone()

    def close(self) -> None:
        """Stop the physics server; safe to call twice."""
        client, self._client = self._client, -1
        self._apply = self._gone
        if client >= 0 and bullet.isConnected(client):
            bullet.disconnect(client)

    def add_obstacle(
        self, centre: tuple[float, float, float], half_extents: tuple[float, float, float]
    ) -> int:
        """Put a fixed box into the world, m; returns its number for remove_obstacle."""
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=half_extents, physicsClientId=self._client
        )
        obstacle = bullet.createMultiBody(
            0.0, shape, basePosition=centre, physicsClientId=self._client
        )
        self._save()
        return int(obstacle)

    def remove_obstacle(self, obstacle: int) -> None:
        """Take a box out of the world again."""
        bullet.removeBody(obstacle, physicsClientId=self._client)
        self._save()

    def link_position(self, joint: int) -> tuple[float, float, float]:
        """Where the link behind a joint of the board has its origin, m, in world axes."""
        x, y, z = bullet.getLinkState(
            self._body,
            self._joints[joint],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )[4]
        return x, y, z

    def mimic_positions(self) -> dict[str, float]:
        """Positions of the joints that follow others, by name, rad or m."""
        states = bullet.getJointStates(self._body, self._followers, self._client)
        names = [mimic.joint for mimic in self._mimics]
        return {name: state[0] for name, state in zip(names, states or (), strict=True)}

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """A picture of the whole robot, shape (height, width, 3), drawn without a display."""
        links = range(-1, bullet.getNumJoints(self._body, self._client))
        boxes = np.array([bullet.getAABB(self._body, link, self._client) for link in links])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        centre, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
        view = bullet.computeViewMatrixFromYawPitchRoll(
            centre.tolist(), 1.1 * size, 50.0, -20.0, 0.0, 2
        )
        projection = bullet.computeProjectionMatrixFOV(
            50.0, width / height, 0.05 * size, 5.0 * size
        )
        _, _, pixels, _, _ = bullet.getCameraImage(
            width,
            height,
            view,
            projection,
            shadow=1,
            lightDirection=(1.0, -1.0, 2.0),
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )
        return np.asarray(pixels, dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()

    def _refresh(self) -> bool:
        states = bullet.getJointStates(self._body, self._joints, self._client)
        positions, velocities, _, _ = zip(*states)  # noqa: B905 - in the cycle
        self._pack(self._bytes, 0, *positions, *velocities)
        total = sum(positions)
        return bool(total - total == 0.0)  # neither infinite nor not a number

    def _save(self) -> None:
        bullet.removeState(self._saved, physicsClientId=self._client)
        self._saved = bullet.saveState(physicsClientId=self._client)

    def _gone(self, **_: Any) -> NoReturn:
        raise PlantGone("the physics server is gone; start the board anew") from None

    def _load(self, text: str, simulation: SimulationConfig) -> int:
        client = self._client
        bullet.setGravity(*simulation.gravity, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=simulation.physics_step,
            numSubSteps=0,
            enableFileCaching=0,
            useSplitImpulse=0,  # else a stop met at speed is never fully restored
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        with TemporaryDirectory() as folder, captured_output() as lines:
            path = Path(folder, "robot.urdf")
            path.write_text(text, encoding="utf-8")
            try:
                body = bullet.loadURDF(
                    str(path),
                    useFixedBase=simulation.base_fixed,
                    flags=bullet.URDF_USE_INERTIA_FROM_FILE,
                    physicsClientId=client,
                )
            except bullet.error as error:
                said = [str(error), *lines()]
                reason = "; ".join(line.strip() for line in said if line.strip())[:300]
                raise PlantError(
                    f"{self._name[:200]}: pybullet cannot load it ({reason}); check the URDF"
                ) from None
        return int(body)

    def _find_joints(self, moments: Moments) -> dict[str, int]:
        """Indices of the joints that move; sets the dynamics of every link on the way."""
        joints = {}
        if (count := bullet.getNumJoints(self._body, self._client)) > MOST_JOINTS:
            raise PlantError(
                f"{self._name[:200]}: {count} joints, fixed ones included; pybullet takes at "
                f"most {MOST_JOINTS}; cut the robot to a chain"
            )
        for index in range(count):
            info = bullet.getJointInfo(self._body, index, self._client)
            extra = {}
            if (link := info[12].decode()) in moments:
                extra["localInertiaDiagonal"] = moments[link]
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

    def _follow(
        self, mimics: tuple[Mimic, ...], joints: dict[str, int], names: tuple[str, ...]
    ) -> None:
        """Remember who follows whom: position and velocity targets, one way, every step."""
        self._mimics = mimics
        self._followers = [joints[mimic.joint] for mimic in mimics]
        self._sources = [names.index(mimic.source) for mimic in mimics]
        self._multipliers = np.array([mimic.multiplier for mimic in mimics])
        self._offsets = np.array([mimic.offset for mimic in mimics])
        self._full_gains = [1.0] * len(mimics)
        self._mimic_forces = [MIMIC_FORCE] * len(mimics)

    def _mimic_state(self) -> tuple[list[float], list[float]]:
        positions, velocities = self._state[:, self._sources] * self._multipliers
        return (positions + self._offsets).tolist(), velocities.tolist()

    def _drive_mimics(self) -> None:
        positions, velocities = self._mimic_state()
        bullet.setJointMotorControlArray(
            self._body,
            self._followers,
            bullet.POSITION_CONTROL,
            targetPositions=positions,
            targetVelocities=velocities,
            forces=self._mimic_forces,
            positionGains=self._full_gains,
            velocityGains=self._full_gains,
            physicsClientId=self._client,
        )


def _connect(gui: bool) -> int:
    if gui:
        check_display()
    with captured_output() as lines:
        client = bullet.connect(bullet.GUI if gui else bullet.DIRECT)
        said = lines()
    if client < 0:
        reason = "; ".join(said)[:300]
        raise PlantError(f"pybullet cannot start a physics server ({reason}); try again")
    return int(client)
