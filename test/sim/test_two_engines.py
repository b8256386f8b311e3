# SPDX-License-Identifier: Apache-2.0
"""What differs between pybullet and MuJoCo, and what must not (B1).

That both move a robot by the same equations is told by test/description/test_arm_model.py.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from plants import PENDULUM
from plants import board as make_board
from plants import described as parsed
from plants import simulation as make_simulation

from control_board_ros.settings.loading import load
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.bodies.mujoco import MujocoBody


def test_a_rotor_is_felt_at_its_own_joint_alone_in_mujoco() -> None:
    """M = M₀ + diag(J N²); in pybullet its axis adds to the joints further in, too."""
    settings = load("iiwa")
    plain = [
        replace(one, motor=replace(one.motor, inertia=0.0)) for one in settings.simulation.joints
    ]
    unarmed = replace(settings.simulation, joints=tuple(plain))
    matrices = []
    for simulation in (unarmed, settings.simulation):
        body = MujocoBody(settings.board, simulation)
        mujoco.mj_forward(body._model, body._data)
        full = np.zeros((7, 7))
        mujoco.mj_fullM(body._model, body._data, full)
        matrices.append(full)
    reflected = [
        plant.motor.inertia * joint.motor.gear_ratio**2
        for plant, joint in zip(settings.simulation.joints, settings.board.joints, strict=True)
    ]
    assert min(reflected) > 0.0
    np.testing.assert_allclose(matrices[1] - matrices[0], np.diag(reflected), atol=1e-9)


@pytest.mark.parametrize("speed", [0.5, 3.0, 8.0])
def test_a_joint_meets_its_stop_alike(speed: float) -> None:
    """What passed the stop is pushed back by a fifth per step; nothing bounces."""
    config = make_board("hinge", low=-3.0, high=3.0)
    plant = make_simulation(config, urdf=parsed(PENDULUM), gravity=(0.0, 0.0, 0.0))
    runs = []
    for body in (BulletBody(config, plant), MujocoBody(config, plant)):
        state = np.zeros((2, 1))
        body.attach(state)
        body.restore(np.array([[2.9965], [speed]]))
        runs.append([(body.step(np.zeros(1)), *state.ravel()) for _ in range(100)])
        body.close()
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)
    assert np.max(runs[0], axis=0)[1] > 3.0
    assert runs[0][-1][2] < 0.0
