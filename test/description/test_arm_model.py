# SPDX-License-Identifier: Apache-2.0
"""The arm's model against what both engines do (M9, P1)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.model.arm_model import fill
from control_board_ros.settings.loading import load

BENCHMARK = Path(__file__).resolve().parents[2] / "benchmark" / "motion_measure"
ROBOTS = {
    "iiwa": "iiwa",
    "panda": "panda",
    "gantry": str(BENCHMARK / "gantry.urdf"),
    "scara": str(BENCHMARK / "scara.urdf"),
    "snake": str(BENCHMARK / "snake.urdf"),
}
#: Part of the torques that a follower needs, which the model takes as fixed.
FOLLOWERS = {"panda": 0.02}


def body_of(physics: str) -> Any:
    """An engine's body; pybullet has no wheel for every Python."""
    if physics == "pybullet":
        from control_board_ros.sim.bodies.bullet import BulletBody

        return BulletBody
    from control_board_ros.sim.bodies.mujoco import MujocoBody

    return MujocoBody


@pytest.mark.parametrize("physics", ["pybullet", "mujoco"])
@pytest.mark.parametrize("robot", ROBOTS)
def test_the_torques_of_a_motion_are_those_that_made_it(robot: str, physics: str) -> None:
    """One step of random torques from random states: τ(q, q̇, q̈) gives the torques back."""
    settings = load(None, {"robot": ROBOTS[robot], "physics": physics})
    board, n = settings.board, len(settings.board.joints)
    assert board.model is not None
    arm, state = board.model.arm(), np.zeros((2, n))
    pytest.importorskip(physics)
    make = body_of(physics)
    body = make(board, settings.simulation)
    random = np.random.default_rng(6)
    limits = np.array([joint.limits.torque for joint in board.joints])
    low = np.maximum([joint.limits.lower for joint in board.joints], -3.0)
    high = np.minimum([joint.limits.upper for joint in board.joints], 3.0)
    try:
        body.attach(state)
        for _ in range(10):
            q = low + (high - low) * random.uniform(0.1, 0.9, n)
            dq, torque = random.uniform(-0.5, 0.5, n), 0.2 * limits * random.uniform(-1, 1, n)
            body.restore(np.array([q, dq]))
            body.step(torque)
            ddq = (state[1] - dq) / settings.simulation.physics_step
            for row, values in zip(arm.rows, (q, dq, ddq), strict=False):
                np.asarray(row)[:] = values
            arm.inverse(1.0)
            error = np.abs(np.array(arm.rows[3]) - torque).max()
            assert error <= FOLLOWERS.get(robot, 1e-9) * np.abs(torque).max()
    finally:
        body.close()


@pytest.mark.parametrize("values", [{"physics": "ideal"}, {"base_fixed": False}])
def test_there_is_no_model_where_the_masses_are_not_those_of_the_urdf(
    values: dict[str, Any],
) -> None:
    """The board then takes each joint by itself, as ever."""
    assert load("iiwa", values).board.model is None


def test_a_third_party_plant_has_only_its_gravity_compensated() -> None:
    """G1: what its joints feel of the URDF is their weight; the rest is the plant's own matter."""
    model = load("iiwa", {"plant": "somebody"}).board.model
    assert model is not None
    assert not model.trusted


@pytest.mark.parametrize("robot", ["iiwa", "panda", "icub"])
def test_the_load_of_a_pose_is_pinocchios(robot: str) -> None:
    """G1: gravity and a payload on the last link, against another implementation."""
    pinocchio = pytest.importorskip("pinocchio")
    settings = load(robot, {"physics": "mujoco"})
    board, kg, center = settings.board, 2.0, (0.03, -0.02, 0.15)
    assert board.model is not None
    model = pinocchio.buildModelFromXML(settings.description)
    model.gravity.linear[:] = board.model.gravity
    places = [model.joints[model.getJointId(name)].idx_q for name in board.names]
    last = model.getJointId(board.names[-1])
    mass = pinocchio.Inertia(kg, np.array(center), np.zeros((3, 3)))
    model.appendBodyToJoint(last, mass, pinocchio.SE3.Identity())
    arm, data, random = board.model.arm(), model.createData(), np.random.default_rng(3)
    still = {
        mimic.follower: mimic.multiplier * settings.values[f"{mimic.leader}.home"] + mimic.offset
        for mimic in settings.urdf.mimics.values()
    }
    fill(board.model.links[-1], arm.bodies[-1], kg, center)
    for _ in range(20):
        q = pinocchio.neutral(model)
        q[[model.joints[model.getJointId(one)].idx_q for one in still]] = list(still.values())
        q[places] = random.uniform(-1.5, 1.5, len(board.names))
        np.asarray(arm.rows[0])[:] = q[places]
        arm.inverse(1.0)
        torques = pinocchio.computeGeneralizedGravity(model, data, q)
        assert np.array(arm.rows[3]) == pytest.approx(torques[places], abs=1e-9)


def test_a_part_has_the_model_of_its_own_joints() -> None:
    """R1: the rest of the robot is fixed, its load included."""
    names = [joint.name for joint in load("iiwa").board.joints]
    settings = load("iiwa", {"parts.upper": names[:3], "parts.lower": names[3:]})
    model = settings.part("lower").board.model
    assert model is not None
    assert [link.parent for link in model.links] == [-1, 0, 1, 2]
    whole = settings.board.model
    assert whole is not None
    assert settings.part("upper").board.model.links[2].mass == pytest.approx(
        sum(link.mass for link in whole.links[2:])
    )
