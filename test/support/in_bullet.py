# SPDX-License-Identifier: Apache-2.0
"""A robot in pybullet alone: the measure of what is computed of its description."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from control_board_ros.sim.bodies.world import bullet, connect, load
from control_board_ros.sim.config import SimulationConfig


@contextmanager
def in_bullet(text: str, config: SimulationConfig) -> Iterator[tuple[int, int, list[Any]]]:
    """Its world, its body, and what pybullet says of each of its joints."""
    client = connect(gui=False)
    try:
        body = load(client, text, config, visuals=False)
        count = bullet.getNumJoints(body, client)
        yield client, body, [bullet.getJointInfo(body, index, client) for index in range(count)]
    finally:
        bullet.disconnect(client)


def dynamics(
    text: str, config: SimulationConfig, poses: Sequence[Mapping[str, float]]
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """The names of its moving joints, and in each pose M and the torques against gravity."""
    with in_bullet(text, config) as (client, body, info):
        names = [one[1].decode() for one in info if one[2] != bullet.JOINT_FIXED]
        still, matrices, torques = [0.0] * len(names), [], []
        for pose in poses:
            at = [float(pose[name]) for name in names]
            matrices.append(bullet.calculateMassMatrix(body, at, client))
            torques.append(bullet.calculateInverseDynamics(body, at, still, still, client))
    return names, np.array(matrices), np.array(torques)
