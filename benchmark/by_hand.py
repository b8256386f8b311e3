# SPDX-License-Identifier: Apache-2.0
"""What a user would write instead of a board: the same arm, held by a loop of one's own.

Each loop holds the arm near its home with the same references as the board's in ``cycles``, and
is timed over chunks of the same length. Nothing here checks, limits, switches or reports.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from cycles import CHUNK, Loop

from control_board_ros.settings.loading import Settings
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.bodies.world import bullet
from control_board_ros.sim.motor import reflected_inertia


class BulletLoop:
    """A loop around pybullet; ``cycle`` is one control cycle towards a target, shape (n,)."""

    def __init__(self, settings: Settings) -> None:
        self._world = BulletBody(settings.board, settings.simulation)
        self.body, self.joints = self._world._body, self._world._joints
        self.client = self._world._client
        home = np.array([joint.home for joint in settings.simulation.joints])
        for joint, angle in zip(self.joints, home.tolist(), strict=True):
            bullet.resetJointState(self.body, joint, angle, physicsClientId=self.client)
        self._home, self._chunks = home, 0
        self._following = self._world._following
        urdf, names = settings.simulation.urdf, list(settings.board.names)
        assert urdf is not None
        mimics = [mimic for name, mimic in urdf.mimics.items() if name not in names]
        self._leaders = [names.index(mimic.leader) for mimic in mimics]
        self._ratios = [(mimic.multiplier, mimic.offset) for mimic in mimics]

    def drive_followers(self, states: Any) -> None:
        """Let the joints of <mimic> follow theirs, as the board's world does."""
        if not self._following:
            return
        targets = [
            ratio * states[leader][0] + offset
            for leader, (ratio, offset) in zip(self._leaders, self._ratios, strict=True)
        ]
        bullet.setJointMotorControlArray(
            self.body,
            self._following,
            bullet.POSITION_CONTROL,
            targetPositions=targets,
            forces=[1e4] * len(targets),
            physicsClientId=self.client,
        )

    def chunk(self) -> float:
        """Run one chunk; the target changes from chunk to chunk as the board's does."""
        target = self._home + (0.02 if self._chunks // 5 % 2 else -0.02)
        self._chunks += 1
        cycle = self.cycle
        start = perf_counter()
        for _ in range(CHUNK):
            cycle(target)
        return perf_counter() - start

    def cycle(self, target: Any) -> None:
        """One control cycle."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go of the world."""
        self._world.close()


class PdByHand(BulletLoop):
    """τ = k (q_ref − q) − d dq with numpy, as the examples of pybullet have it."""

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        gains = [joint.position_pid for joint in settings.board.joints]
        # The board's gains are percent of PWM; by hand one writes torques.
        scale = np.array([joint.limits.torque / 100.0 for joint in settings.board.joints])
        self._k = scale * [pid.kp for pid in gains]
        self._d = scale * [pid.kd for pid in gains]
        self._limit = np.array([joint.limits.torque for joint in settings.board.joints])

    def cycle(self, target: Any) -> None:
        """Read, law, torques, step."""
        states = bullet.getJointStates(self.body, self.joints, self.client)
        q = np.array([state[0] for state in states])
        dq = np.array([state[1] for state in states])
        torque = np.clip(self._k * (target - q) - self._d * dq, -self._limit, self._limit)
        bullet.setJointMotorControlArray(
            self.body,
            self.joints,
            bullet.TORQUE_CONTROL,
            forces=torque.tolist(),
            physicsClientId=self.client,
        )
        self.drive_followers(states)
        bullet.stepSimulation(self.client)


class PositionControl(BulletLoop):
    """pybullet's own POSITION_CONTROL: velocities without limits, torques without motors."""

    def cycle(self, target: Any) -> None:
        """Read, target, step."""
        states = bullet.getJointStates(self.body, self.joints, self.client)
        self.drive_followers(states)
        bullet.setJointMotorControlArray(
            self.body,
            self.joints,
            bullet.POSITION_CONTROL,
            targetPositions=target.tolist(),
            physicsClientId=self.client,
        )
        bullet.stepSimulation(self.client)


class MujocoByHand:
    """The same description in MuJoCo with a PD law; needs the package ``mujoco``."""

    def __init__(self, settings: Settings) -> None:
        import mujoco

        simulation = settings.simulation
        spec = mujoco.MjSpec.from_string(without_meshes(settings.urdf.description))
        spec.option.timestep = settings.board.period
        self._mujoco, self._model = mujoco, spec.compile()
        self._data = mujoco.MjData(self._model)
        rotors = reflected_inertia(settings.board, simulation)  # without them the arm flies apart
        self._model.dof_armature[: rotors.size] = rotors
        self._home = np.array([joint.home for joint in simulation.joints])
        self._data.qpos[: self._home.size] = self._home
        torque = np.array([joint.limits.torque for joint in settings.board.joints])
        self._k, self._d, self._chunks = torque, 0.1 * torque, 0

    def chunk(self) -> float:
        """Run one chunk; its time, s."""
        n = self._home.size
        target = self._home + (0.02 if self._chunks // 5 % 2 else -0.02)
        self._chunks += 1
        data, step = self._data, self._mujoco.mj_step
        start = perf_counter()
        for _ in range(CHUNK):
            data.qfrc_applied[:n] = self._k * (target - data.qpos[:n]) - self._d * data.qvel[:n]
            step(self._model, data)
        return perf_counter() - start

    def close(self) -> None:
        """Nothing to let go."""


LOOPS: dict[str, Callable[[Settings], Loop]] = {
    "a PD law by hand": PdByHand,
    "pybullet's POSITION_CONTROL": PositionControl,
}


def without_meshes(text: str) -> str:
    """A description without shapes: only masses and joints cost time here."""
    import xml.etree.ElementTree as ET

    root = ET.fromstring(text)
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    return ET.tostring(root, encoding="unicode")
