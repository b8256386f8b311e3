# SPDX-License-Identifier: Apache-2.0
"""What joints move, against pybullet's own inertia matrix and inverse dynamics."""

from __future__ import annotations

import numpy as np
import pybullet_data
import pytest
from in_bullet import dynamics
from plants import GRIPPER, PENDULUM, SLIDER, described, joint, link, robot, xml_of

from control_board_ros.description.loads import POSES, Loads, loads, sample_poses
from control_board_ros.description.robots import load_robot
from control_board_ros.description.urdf import Urdf
from control_board_ros.settings.loading import load
from control_board_ros.sim.bodies.bullet import BulletBody
from control_board_ros.sim.motor import reflected_inertia

DATA = pybullet_data.getDataPath()
ROBOTS = ["iiwa", "panda", f"{DATA}/cartpole.urdf", f"{DATA}/r2d2.urdf"]


def ranges(urdf: Urdf) -> dict[str, tuple[float, float]]:
    return {one.name: (one.lower, one.upper) for one in urdf.joints if one.mimic is None}


def tiny(text: str) -> Loads:
    return loads(described(text))


def physics(urdf: Urdf) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """M_jj and gravity torque by pybullet in every pose, shape (joints, POSES)."""
    settings = load(None, {"robot": urdf.source} if urdf.source.startswith(DATA) else {})
    sampled = sample_poses(urdf, ranges(urdf))
    poses = [{name: at[pose] for name, at in sampled.items()} for pose in range(0, POSES, 8)]
    names, matrices, torques = dynamics(xml_of(urdf), settings.simulation, poses)
    return np.diagonal(matrices, axis1=1, axis2=2).T, torques.T, names


@pytest.mark.parametrize("name", ROBOTS)
def test_inertia_and_gravity_are_the_physics_own(name: str) -> None:
    urdf = load_robot(name)
    found = loads(urdf, ranges(urdf))
    inertia, torque, names = physics(urdf)
    for row, one in enumerate(found.names):
        at = names.index(one)
        assert found.inertia[row, ::8] == pytest.approx(inertia[at], rel=1e-5, abs=1e-9), one
        assert found.gravity[row, ::8] == pytest.approx(-torque[at], rel=1e-5, abs=1e-6), one


@pytest.mark.parametrize("name", ["iiwa", "panda"])
def test_rotors_add_what_the_physics_feels(name: str) -> None:
    """A unit torque on each joint for one step yields M⁻¹, rotors included.

    M_jj with the other joints fixed, 1/(M⁻¹)_jj with them free to give way.
    """
    settings = load(name, {"gravity": [0.0, 0.0, 0.0]})
    board, simulation, n = settings.board, settings.simulation, len(settings.board.joints)
    body, state = BulletBody(board, simulation), np.zeros((2, n))
    home = np.array([[one.home for one in simulation.joints], [0.0] * n])
    try:
        body.attach(state)
        inverse = np.zeros((n, n))
        for j in range(n):
            body.restore(home)
            body.step(np.eye(n)[j])
            inverse[:, j] = state[1] / simulation.physics_step
    finally:
        body.close()
    here = {one.name: (one.home, one.home) for one in simulation.joints}
    rotors = dict(zip(board.names, reflected_inertia(board, simulation).tolist(), strict=True))
    found = loads(settings.urdf, here).with_rotors(rotors)
    held, gives = np.diag(np.linalg.inv(inverse)), 1.0 / np.diag(inverse)
    for j, one in enumerate(board.names):
        assert found[one].inertia_max == pytest.approx(held[j], rel=1e-3), one
        assert found[one].inertia_mean == pytest.approx(held[j], rel=1e-3), one
        assert found[one].inertia_min == pytest.approx(gives[j], rel=1e-3), one


def test_a_pendulum_and_a_carriage_are_as_by_hand() -> None:
    pendulum, carriage = tiny(PENDULUM).by_name["hinge"], tiny(SLIDER).by_name["slide"]
    assert pendulum.inertia_min == pytest.approx(2.0 * 0.25 + 1e-3)
    assert pendulum.inertia_max == pytest.approx(2.0 * 0.25 + 1e-3)
    assert pendulum.gravity == pytest.approx(2.0 * 9.81 * 0.5, rel=0.01)
    assert (carriage.inertia_mean, carriage.gravity) == pytest.approx((2.0, 0.0))


def test_a_distal_rotor_counts_as_far_as_axes_are_parallel() -> None:
    """J N² (a_k · a_j)²: in full beyond a parallel axis, not at all beyond a crossed one."""
    moments = "1e-3 1e-3 1e-3 0 0 0"
    text = robot(
        *(link(name, 1.0, "0 0 0", moments) for name in ("a", "b", "c")),
        joint("one", "base", "a", axis="0 1 0"),
        joint("two", "a", "b", axis="0 1 0"),
        joint("three", "b", "c", axis="0 0 1"),
    )
    found = tiny(text).with_rotors({"two": 0.5, "three": 7.0})
    greatest = [found[name].inertia_max for name in ("one", "two", "three")]
    assert greatest == pytest.approx([0.503, 0.502, 7.001])
    # One moves alone: two, with its rotor, stays where it is.
    assert found["one"].inertia_min == pytest.approx(0.001, rel=1e-2)


def test_fixed_joints_are_at_zero_and_followers_follow() -> None:
    urdf = described(GRIPPER)
    found = loads(urdf, {"left_finger": (0.0, 1.0)})
    assert found.names == ("left_finger",)
    sampled = sample_poses(urdf, {"left_finger": (0.0, 1.0)})
    assert sampled["right_finger"] == pytest.approx(2.0 * sampled["left_finger"] + 0.1)
    assert "unused" not in sampled


def test_the_board_knows_the_loads_of_its_joints() -> None:
    """Derived where they are not given, also for a robot with motors of its own."""
    settings = load("iiwa")
    least, greatest = settings.board.joints[0].inertia_min, settings.board.joints[0].inertia_max
    rotor = reflected_inertia(settings.board, settings.simulation)[0]
    assert rotor < least < greatest
    own = load("iiwa", {"lbr_iiwa_joint_1.inertia_min": 0.5, "lbr_iiwa_joint_1.inertia_max": 6.0})
    assert (own.board.joints[0].inertia_min, own.board.joints[0].inertia_max) == (0.5, 6.0)
