# SPDX-License-Identifier: Apache-2.0
"""pybullet and MuJoCo move a robot by the same equations: M(q) a + c(q, dq) = τ (B1).

Rotors are left out where it is said: MuJoCo gets one as an armature, pybullet as a part of its
link, and joints further in feel the latter. Hard stops are moved away.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from marks import needs_icub
from plants import PENDULUM
from plants import board as make_board
from plants import described as parsed
from plants import simulation as make_simulation

from control_board_ros.core.config.config import BoardConfig
from control_board_ros.description.meshes import package_folder, share_folders
from control_board_ros.settings.loading import Settings, load
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.bodies.mujoco import MujocoBody
from control_board_ros.sim.bodies.mujoco_spec import FOLLOWER_ARMATURE
from control_board_ros.sim.bodies.world import bullet
from control_board_ros.sim.config import SimulationConfig

pytestmark = pytest.mark.physics
DATA = package_folder("pybullet_data") or Path()
MODEL = "iCub/robots/iCubGazeboV2_7/model.urdf"
WHOLE_ICUB = next((share / MODEL for share in share_folders() if (share / MODEL).is_file()), "")
OTHERS = ("xarm/xarm6_robot.urdf", "a1/a1.urdf", "cartpole.urdf", "mini_cheetah/mini_cheetah.urdf")
ROBOTS = [
    "iiwa",
    "panda",
    pytest.param("icub_left_arm", marks=needs_icub),
    pytest.param("icub_right_arm", marks=needs_icub),
    pytest.param(str(WHOLE_ICUB), marks=needs_icub, id="whole icub"),
    *(pytest.param(str(DATA / path), id=Path(path).stem) for path in OTHERS),
]


def described(robot: str) -> Settings:
    """Its settings: by name, or by the path of its URDF."""
    return load(None, {"robot": robot}) if "/" in robot else load(robot)


def bare(settings: Settings) -> tuple[BoardConfig, SimulationConfig]:
    """Next to no rotors; hard stops out of reach, but for the leaders of followers.

    Next to nothing is more than none: pybullet takes a tensor that no rigid body can have (the
    xarm's second link) for zero, unless there is a rotor to be added.
    """
    followed = {mimic.leader for mimic in settings.urdf.mimics.values()}
    board = replace(
        settings.board,
        joints=tuple(
            one
            if one.name in followed
            else replace(one, limits=replace(one.limits, hard_lower=-1e6, hard_upper=1e6))
            for one in settings.board.joints
        ),
    )
    joints = tuple(
        replace(plant, motor=replace(plant.motor, inertia=0.0 if slides else 1e-14))
        for plant, slides in zip(
            settings.simulation.joints,
            [one.kind == "prismatic" for one in board.joints],
            strict=True,
        )
    )
    return board, replace(settings.simulation, joints=joints)


def poses(board: BoardConfig, count: int, seed: int = 4) -> np.ndarray:
    """Positions within the limits, shape (count, n)."""
    low = np.maximum([one.limits.lower for one in board.joints], -3.0)
    high = np.minimum([one.limits.upper for one in board.joints], 3.0)
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def mass_matrix_of_bullet(body: BulletBody, q: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix and gravity torques of the joints of the board and their followers."""
    client, robot = body._client, body._body
    order = sorted([*body._joints, *body._following])
    chosen = [order.index(joint) for joint in [*body._joints, *body._following]]
    inner = [0.0] * len(order)
    for k, position in zip(chosen, q, strict=True):
        inner[k] = position
    zeros = [0.0] * len(order)
    matrix = bullet.calculateMassMatrix(robot, inner, physicsClientId=client)
    gravity = bullet.calculateInverseDynamics(robot, inner, zeros, zeros, physicsClientId=client)
    return np.array(matrix)[np.ix_(chosen, chosen)], np.array(gravity)[chosen]


def mass_matrix_of_mujoco(body: MujocoBody) -> tuple[np.ndarray, np.ndarray]:
    """The same, at the pose that it is in; armatures are no masses."""
    model, data = body._model, body._data
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    dofs = [model.joint(name).dofadr[0] for name in body._fitted.names] + list(body._driven)
    matrix = (full - np.diag(model.dof_armature))[np.ix_(dofs, dofs)]
    return matrix, data.qfrc_bias[dofs]


@pytest.mark.parametrize("robot", ROBOTS)
def test_mass_matrix_and_gravity_torques_agree_at_random_poses(robot: str) -> None:
    """B1: at rest, τ = g(q); M(q) of all joints, those that follow too."""
    board, simulation = bare(described(robot))
    one, other = BulletBody(board, simulation), MujocoBody(board, simulation)
    state = np.zeros((2, len(board.joints)))
    try:
        for pose in poses(board, 5):
            other.attach(state)
            other.restore(np.array([pose, np.zeros_like(pose)]))
            q = [*pose.tolist(), *other.mimic_positions().values()]
            matrix, gravity = mass_matrix_of_bullet(one, q)
            ours, torques = mass_matrix_of_mujoco(other)
            # Lost to rounding: next to the armature of a follower.
            loss = 1e-16 * FOLLOWER_ARMATURE
            np.testing.assert_allclose(ours, matrix, rtol=1e-6, atol=1e-7 + loss)
            np.testing.assert_allclose(torques, gravity, rtol=1e-6, atol=1e-6)
    finally:
        one.close()
        other.close()


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_second_of_free_motion_agrees(robot: str) -> None:
    """B1: let go at a pose, 1000 steps later: 1e-5 rad and 1e-3 rad/s, at speeds of rad/s."""
    settings = described(robot)
    board, simulation = bare(settings)
    start = np.zeros((2, len(board.joints)))
    start[0] = [joint.home for joint in simulation.joints]
    runs = []
    for body in (BulletBody(board, simulation), MujocoBody(board, simulation)):
        state = start.copy()
        body.attach(state)
        body.restore(start)
        assert all(body.step(np.zeros(len(board.joints))) for _ in range(1000))
        runs.append((state, list(body.mimic_positions().values())))
        body.close()
    (one, follows), (other, follows_too) = runs
    np.testing.assert_allclose(other[0], one[0], atol=1e-5)
    np.testing.assert_allclose(other[1], one[1], atol=1e-3)
    np.testing.assert_allclose(follows_too, follows, atol=1e-5)


def test_a_rotor_is_felt_at_its_own_joint_alone_in_mujoco() -> None:
    """M = M₀ + diag(J N²); in pybullet its axis adds to the joints further in, too."""
    settings = load("iiwa")
    _, unarmed = bare(settings)
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
