# SPDX-License-Identifier: Apache-2.0
"""The arm in a physics engine obeys mechanics, stops at its stops and keeps to itself (B1)."""

from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from iiwa import JOINTS
from plants import (
    ENGINES,
    GRIPPER,
    IIWA,
    MOTOR,
    PENDULUM,
    SLIDER,
    arm_plant,
    board,
    chain,
    described,
    drive,
    joint,
    link,
    robot,
    simulation,
)

from control_board_ros.core.config.config import ConfigError, Motor
from control_board_ros.core.terms.measurement import Row
from control_board_ros.description.geometry import rotation_of_rpy, rpy_of_rotation
from control_board_ros.description.rotor import add_rotor_inertia
from control_board_ros.sim.config import MotorModel
from control_board_ros.sim.plant import SimulatedPlant

BARE = MotorModel()
GRAVITY = 9.81


@pytest.fixture(params=ENGINES)
def physics(request):
    """The engine."""
    return request.param


@pytest.fixture
def make(physics):
    """Makes plants of a URDF for the joints named; closes them."""
    made = []

    def make_plant(
        urdf: str, *names: str, low=-3.0, high=3.0, kind="revolute", motor=MOTOR, **rest
    ):
        config = board(*names, low=low, high=high, kind=kind, motor=motor)
        values = {"physics": physics, "model": BARE, **rest}
        made.append(SimulatedPlant(config, simulation(config, urdf=described(urdf), **values)))
        return made[-1]

    yield make_plant
    for plant in made:
        plant.close()


@pytest.mark.parametrize("angle", [-2.0, -0.5, 0.0, 0.3, math.pi / 2, 2.5])
def test_a_pendulum_is_held_by_m_g_l_sin_theta(make, angle):
    """A push of m g l sin θ keeps the joint where it is; without it, it falls with τ/I."""
    statics = 2.0 * GRAVITY * 0.5 * math.sin(angle)
    held = make(PENDULUM, "hinge", home=angle)
    held.push(0, statics)
    values = drive(held, 0.0, 0.0, cycles=100)
    assert abs(values[Row.VELOCITY, 0]) < 1e-9
    falling = make(PENDULUM, "hinge", home=angle)
    speed = drive(falling, 0.0, 0.0)[Row.VELOCITY, 0]
    assert speed / 1e-3 == pytest.approx(-statics / (2.0 * 0.25 + 1e-3), rel=1e-6, abs=1e-9)


def test_a_motor_holds_a_pendulum_at_the_torque_that_it_reads(make):
    """Constant PWM settles where the torque sensor reads m g l sin θ."""
    weak = Motor(resistance=20.0, torque_constant=0.08, gear_ratio=30.0)
    plant = make(PENDULUM, "hinge", motor=weak, model=MotorModel(viscous=3.0))
    values = drive(plant, 80.0, cycles=6000)
    assert abs(values[Row.VELOCITY, 0]) < 1e-5
    torque = 0.8 * 48.0 / 20.0 * 0.08 * 30.0
    assert values[Row.TORQUE, 0] == pytest.approx(torque, rel=1e-4)
    angle = values[Row.POSITION, 0]
    assert torque == pytest.approx(2.0 * GRAVITY * 0.5 * math.sin(angle), rel=1e-3)


@pytest.mark.parametrize(
    ("axis", "rpy"), [("0 0 1", "0 0 0"), ("1 0 0", "0.3 -1.2 2.0"), ("1 -2 0.5", "1 0.2 -0.7")]
)
def test_one_joint_accelerates_with_torque_over_link_and_rotor_inertia(make, axis, rpy):
    """A = τ / (aᵀ I a + m d² + J N²), whatever the axis and the inertial frame."""
    tiny = robot(
        link("body", 2.0, "0.1 0.2 -0.1", "0.02 0.03 0.04 0.001 0.002 -0.003", rpy),
        joint("hinge", "base", "body", axis=axis),
    )
    direction = np.array([float(word) for word in axis.split()])
    direction /= np.linalg.norm(direction)
    turn = rotation_of_rpy(np.array([float(word) for word in rpy.split()]))
    tensor = np.array([[0.02, 0.001, 0.002], [0.001, 0.03, -0.003], [0.002, -0.003, 0.04]])
    arm = np.cross(direction, [0.1, 0.2, -0.1])
    own = direction @ turn @ tensor @ turn.T @ direction + 2.0 * arm @ arm
    for rotor in (0.0, 1e-6, 1e-4):
        plant = make(tiny, "hinge", gravity=(0.0, 0.0, 0.0), model=MotorModel(inertia=rotor))
        plant.push(0, 0.5)
        speed = drive(plant, 0.0, 0.0)[Row.VELOCITY, 0]
        assert speed / 1e-3 == pytest.approx(0.5 / (own + rotor * 120.0**2), rel=1e-6)


def test_a_joint_at_a_right_angle_does_not_feel_a_rotor(physics):
    two = robot(
        link("upper", 1.0, "0 0 0", "0.01 0.01 0.01 0 0 0"),
        link("lower", 1.0, "0 0 0", "0.01 0.01 0.01 0 0 0"),
        joint("first", "base", "upper", axis="0 0 1"),
        joint("second", "upper", "lower", axis="1 0 0"),
    )
    config = board("first", "second", low=-3.0, high=3.0)
    plain = simulation(
        config, urdf=described(two), model=BARE, gravity=(0.0, 0.0, 0.0), physics=physics
    )
    heavy = replace(plain, joints=simulation(config, model=MotorModel(inertia=1e-4)).joints)
    only_second = replace(plain, joints=(plain.joints[0], heavy.joints[1]))
    speeds = []
    for settings in (plain, only_second):
        plant = SimulatedPlant(config, settings)
        plant.push(0, 0.1)
        speeds.append(drive(plant, 0.0, 0.0)[Row.VELOCITY, 0])
        plant.close()
    assert speeds[0] == pytest.approx(speeds[1], rel=1e-9)


def test_angles_and_rotations_are_inverse():
    random = np.random.default_rng(3)
    for angles in [*random.uniform(-3, 3, (50, 3)), [0.3, np.pi / 2, 0.1], [0.3, -np.pi / 2, 1.0]]:
        rotation = rotation_of_rpy(np.array(angles))
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(rotation_of_rpy(rpy_of_rotation(rotation)), rotation, atol=1e-9)


def test_rotor_inertia_of_a_prismatic_joint_is_refused():
    slider = described(SLIDER).tree.copy()
    with pytest.raises(ConfigError, match=r"slide\.motor\.inertia: .*0 for a prismatic joint"):
        add_rotor_inertia(slider, {"slide": 0.5})
    assert add_rotor_inertia(slider, {"slide": 0.0}) == {}


@pytest.mark.parametrize("torque", [1.0, 30.0, 300.0])
def test_a_hard_stop_of_the_urdf_holds_against_any_torque(make, torque):
    plant = make(PENDULUM, "hinge", gravity=(0.0, 0.0, 0.0))
    for sign in (1.0, -1.0):
        plant.push(0, sign * torque)
        values = drive(plant, 0.0, 0.0, cycles=4000)
        assert values[Row.POSITION, 0] == pytest.approx(sign * 3.0, abs=2e-3)
        assert abs(values[Row.VELOCITY, 0]) < 1e-3


def test_a_narrower_hard_limit_of_the_board_is_a_stop_in_physics(make):
    plant = make(PENDULUM, "hinge", low=-0.25, high=0.5, gravity=(0.0, 0.0, 0.0))
    for torque, stop in ((5.0, 0.5), (-5.0, -0.25)):
        plant.push(0, torque)
        assert drive(plant, 0.0, 0.0, cycles=3000)[Row.POSITION, 0] == pytest.approx(
            stop, abs=1e-3
        )


def test_a_continuous_joint_turns_without_end(make):
    wheel = PENDULUM.replace('type="revolute"', 'type="continuous"')
    plant = make(wheel, "hinge", kind="continuous", gravity=(0.0, 0.0, 0.0))
    plant.push(0, 2.0)
    assert drive(plant, 0.0, 0.0, cycles=3000)[Row.POSITION, 0] > 10.0


def test_a_prismatic_joint_is_read_and_driven(make):
    """X = F/(2 m) t²: 10 N on 2 kg."""
    plant = make(SLIDER, "slide", kind="prismatic")
    plant.push("slide", 10.0)
    values = drive(plant, 0.0, 0.0, cycles=500)
    assert values[Row.POSITION, 0] == pytest.approx(0.5 * 5.0 * 0.25, rel=5e-3)
    assert values[Row.VELOCITY, 0] == pytest.approx(2.5, rel=1e-6)
    plant.push("slide", 0.0)
    plant.reset()
    values = drive(plant, 2.0, cycles=5)
    assert values[Row.POSITION, 0] > 1e-5
    assert values[Row.TORQUE, 0] > 0.0


def test_mimic_joints_follow_and_nothing_else_moves(make):
    """Right = 2 · left + 0.1, from the start, while moving and after a reset."""
    plant = make(GRIPPER, "left_finger", kind="prismatic", home=0.05)

    def gap() -> float:
        left = plant.read().values[Row.POSITION, 0]
        return plant.body.mimic_positions()["right_finger"] - (2.0 * left + 0.1)

    assert set(plant.body.mimic_positions()) == {"right_finger"}
    assert abs(gap()) < 1e-9
    plant.push(0, 0.5)
    for _ in range(20):
        speed = drive(plant, 0.0, 0.0, cycles=10)[Row.VELOCITY, 0]
        assert abs(gap()) < 2.5e-3 * speed + 1e-4
    assert plant.read().values[Row.POSITION, 0] > 0.1
    plant.reset()
    assert abs(gap()) < 1e-9


def test_the_leader_does_not_feel_its_follower(make):
    plant = make(GRIPPER, "left_finger", kind="prismatic", gravity=(0.0, 0.0, 0.0))
    plant.push(0, 0.5)
    speed = drive(plant, 0.0, 0.0, cycles=50)[Row.VELOCITY, 0]
    assert speed == pytest.approx(0.5 / 0.1 * 0.05, rel=1e-3)


def test_a_box_in_the_way_stops_the_arm_and_can_be_taken_away(physics):
    plant = arm_plant(physics, home=0.5)
    free = arm_plant(physics, home=0.5)
    x, y, z = plant.body.link_position(6)
    side = plant.body.add_obstacle((x - 0.3 * y, y + 0.3 * x, z), (0.1, 0.1, 0.3))
    pwm = np.array([15.0, 0, 0, 0, 0, 0, 0])
    blocked = drive(plant, pwm, cycles=1500)[Row.POSITION, 0]
    assert blocked < drive(free, pwm, cycles=1500)[Row.POSITION, 0] - 0.2
    plant.body.remove_obstacle(side)
    assert drive(plant, pwm, cycles=1500)[Row.POSITION, 0] > blocked + 0.2
    plant.inject(0, "diverged")
    drive(plant, 0.0, cycles=30)
    plant.reset()
    assert plant.read().values[Row.POSITION, 0] == pytest.approx(0.5)
    for each in (plant, free):
        each.close()


def test_a_box_out_of_reach_changes_no_motion(physics):
    """Shapes come with the first box; the arm goes on from where it is, at its speed."""
    pwm, arms = np.array([15.0, 10.0, 0, 0, 0, 0, 0]), [arm_plant(physics) for _ in range(2)]
    for plant in arms:
        drive(plant, pwm, cycles=200)
    arms[0].body.add_obstacle((50.0, 0.0, 0.0), (0.1, 0.1, 0.1))
    beside, free = (drive(plant, pwm, cycles=300) for plant in arms)
    np.testing.assert_allclose(beside, free, rtol=1e-6, atol=1e-6)
    assert abs(free[Row.VELOCITY, 0]) > 0.05
    for plant in arms:
        plant.close()


def test_no_damping_but_ours(make):
    """A pendulum without friction swings as high on the other side."""
    plant = make(PENDULUM, "hinge", home=1.0)
    low = min(drive(plant, 0.0, 0.0)[Row.POSITION, 0] for _ in range(3000))
    assert low == pytest.approx(-1.0, abs=5e-3)


def test_a_board_joint_that_the_urdf_lacks_is_an_error(make):
    with pytest.raises(ConfigError, match=r"joints: 'elbow' .* a joint of the URDF: hinge"):
        make(PENDULUM, "elbow")


def test_a_picture_shows_the_arm(physics):
    plant = arm_plant(physics, home=0.4)
    picture = plant.body.render(160, 120)
    assert picture.shape == (120, 160, 3)
    assert picture.dtype == np.uint8
    assert 0.03 < (np.ptp(picture.reshape(-1, 3), axis=1) > 40).mean() < 0.5  # orange links
    before = picture
    values = drive(plant, [60.0, 0, 0, 0, 0, 0, 0], cycles=300)
    moved = plant.body.render(160, 120)
    assert (moved != before).mean() > 0.01
    box = plant.body.add_obstacle((0.5, 0.5, 0.5), (0.1, 0.1, 0.3))
    assert (plant.body.render(160, 120) != moved).mean() > 0.01
    plant.body.remove_obstacle(box)
    np.testing.assert_array_equal(plant.body.render(160, 120), moved)
    np.testing.assert_array_equal(plant.read().values, values)  # a look changes nothing
    plant.close()


def test_the_terminal_stays_clean(physics, tmp_path):
    """What engines print on import, on loading and on NaN is suppressed, as is a log file."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from plants import arm_plant, drive; "
        "plant = arm_plant(sys.argv[2]); plant.inject(0, 'diverged'); drive(plant, 0.0, cycles=9)"
    )
    support = str(Path(__file__).parents[1] / "support")
    done = subprocess.run(
        [sys.executable, "-c", code, support, physics],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        cwd=tmp_path,
    )
    assert list(tmp_path.iterdir()) == []
    assert (done.stdout, done.stderr) == ("", "")


def test_only_the_joints_of_the_board_move(physics):
    """A board of two joints of seven: the others are fixed."""
    config = board(JOINTS[1], JOINTS[3])
    plant = SimulatedPlant(config, simulation(config, urdf=IIWA, home=1.0, physics=physics))
    values = drive(plant, 0.0, 0.0, cycles=100)
    assert values.shape == (8, 2)
    assert (np.abs(values[Row.VELOCITY]) > 1e-3).all()
    plant.close()


def test_the_longest_chain_is_loaded_and_driven(make):
    urdf, names = chain(127)
    plant = make(urdf, *names, model=MotorModel(inertia=1e-4, coulomb=0.1))
    pwm = np.linspace(-5, 5, 127)
    values = drive(plant, pwm, cycles=20)
    assert np.isfinite(values).all()
    assert (np.sign(values[Row.TORQUE]) == np.sign(pwm)).mean() > 0.7
