# SPDX-License-Identifier: Apache-2.0
"""What every plant must do, whatever its body."""

from __future__ import annotations

import numpy as np
import pytest
from plants import (
    ENGINES,
    IIWA,
    arm_plant,
    board,
    bullet_plant,
    drive,
    ideal_plant,
    plant_of,
    simulation,
)

from control_board_ros.core.config.config import ConfigError
from control_board_ros.core.terms.measurement import ROWS, Actuation, Plant, Row
from control_board_ros.sim.bodies.ideal import IdealBody
from control_board_ros.sim.config import Encoder, MotorModel
from control_board_ros.sim.plant import PlantError, PlantGone, SimulatedPlant

MODEL = MotorModel(inertia=1e-4, coulomb=0.5, viscous=0.2)


@pytest.fixture(params=["ideal", *ENGINES])
def make(request):
    """Makes plants of seven joints; closes them."""
    made = []

    def make_plant(**rest) -> SimulatedPlant:
        made.append(plant_of(request.param, **{"model": MODEL, **rest}))
        return made[-1]

    yield make_plant
    for plant in made:
        plant.close()


def random_actuation(random: np.random.Generator) -> Actuation:
    """Any PWM; every fourth bridge is open."""
    pwm = random.uniform(-40, 40, 7)
    return Actuation(pwm, np.minimum(np.floor(random.uniform(0, 4, 7)), 1.0))


def random_run(plant: SimulatedPlant, cycles: int = 300, seed: int = 1) -> np.ndarray:
    """Readings of a run under random commands, shape (cycles, ROWS, n)."""
    random = np.random.default_rng(seed)
    history = []
    for _ in range(cycles):
        plant.write(random_actuation(random))
        history.append(plant.read().values.copy())
    return np.array(history)


def test_a_reading_is_whole_and_time_passes_only_in_write(make):
    plant: Plant = make(encoder=Encoder(zero=0.25))
    first = plant.read()
    assert first.time == 0.0
    assert first.values.shape == (ROWS, 7)
    assert first.values.dtype == np.float64
    before = first.values.copy()
    np.testing.assert_array_equal(plant.read().values, before)
    np.testing.assert_allclose(before[Row.POSITION], 0.25)
    np.testing.assert_array_equal(before[Row.TEMPERATURE], 25.0)
    for row in (Row.VELOCITY, Row.TORQUE, Row.CURRENT, Row.ENCODER_AGE, Row.TORQUE_AGE):
        np.testing.assert_array_equal(before[row], 0.0)
    drive(plant, 0.0, 0.0, cycles=1234)
    assert plant.read().time == pytest.approx(1.234, abs=1e-12)
    assert plant.time == plant.read().time


def test_pwm_moves_the_joint_its_way(make):
    plant = make()
    values = drive(plant, [20.0, 0, -20.0, 0, 20.0, 0, -20.0], [1, 0, 1, 0, 1, 0, 1], cycles=30)
    for row in (Row.POSITION, Row.VELOCITY):
        assert (values[row, [0, 4]] > 0).all()
        assert (values[row, [2, 6]] < 0).all()


def test_an_open_bridge_carries_no_current_and_makes_no_torque(make):
    """M10, F1, N1: unpowered is exactly zero, at once, on those joints only."""
    plant = make(model=MotorModel(inertia=1e-4))
    drive(plant, 20.0, 1.0, cycles=10)
    powered = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    values = drive(plant, 20.0, powered, cycles=1)
    for row in (Row.CURRENT, Row.TORQUE):
        np.testing.assert_array_equal(values[row, powered == 0], 0.0)
        assert (values[row, powered == 1] != 0.0).all()


def test_an_open_bridge_leaves_the_friction_of_the_gearbox(make):
    plant = make(model=MotorModel(inertia=1e-4, coulomb=0.5, viscous=2.0))
    speed = drive(plant, 20.0, 1.0, cycles=30)[Row.VELOCITY]
    values = drive(plant, 20.0, 0.0, cycles=1)
    np.testing.assert_array_equal(values[Row.CURRENT], 0.0)
    # 0.02 % of 200 N·m are the bearing's, beyond the sensor.
    np.testing.assert_allclose(values[Row.TORQUE], -(0.5 - 0.04) - 2.0 * speed, rtol=1e-6)


def test_the_encoder_adds_its_zero_and_rounds_to_its_resolution(make):
    fine, coarse = make(), make(encoder=Encoder(resolution=1e-3, zero=0.2))
    true = drive(fine, 15.0, cycles=50)
    read = drive(coarse, 15.0, cycles=50)
    np.testing.assert_allclose(read[Row.POSITION], true[Row.POSITION] + 0.2, atol=0.5001e-3)
    counts = read[Row.POSITION] / 1e-3
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    np.testing.assert_array_equal(read[Row.VELOCITY], true[Row.VELOCITY])


def test_same_commands_give_bit_equal_readings(make):
    runs = [random_run(make(encoder=Encoder(resolution=1e-5))) for _ in range(2)]
    np.testing.assert_array_equal(*runs)
    assert np.ptp(runs[0][:, Row.POSITION]) > 0.0


def test_two_plants_in_one_process_do_not_touch(make):
    alone = random_run(make(), 100)
    one, other = make(), make()
    random = np.random.default_rng(1)
    for expected in alone:
        one.write(random_actuation(random))
        other.write(Actuation(np.full(7, -30.0), np.ones(7)))
        np.testing.assert_array_equal(one.read().values, expected)


def test_reset_restores_pose_and_motors_and_time_continues(make):
    plant = make(home=0.3)
    fresh = plant.read().values.copy()
    first = random_run(plant, 200)
    time = plant.time
    plant.reset()
    assert plant.time == time
    np.testing.assert_array_equal(plant.read().values, fresh)
    again = random_run(plant, 200)
    np.testing.assert_allclose(again, first, rtol=0, atol=1e-9)


def test_a_push_acts_on_the_joint_and_not_on_its_torque_sensor(make):
    plant = make(model=MotorModel(inertia=1e-4))
    plant.push(6, 3.0)
    values = drive(plant, 0.0, 0.0, cycles=5)
    speed = values[Row.VELOCITY, 6]
    assert speed > 1e-3
    np.testing.assert_array_equal(values[Row.TORQUE], 0.0)
    plant.push(6, 0.0)
    assert drive(plant, 0.0, 0.0, cycles=5)[Row.VELOCITY, 6] == pytest.approx(speed, rel=0.05)


@pytest.mark.parametrize("torque", [float("nan"), float("inf")])
def test_a_push_is_a_finite_number(torque):
    with pytest.raises(ValueError, match="finite number, N·m"):
        ideal_plant().push(0, torque)


def test_a_misspelt_joint_is_suggested():
    with pytest.raises(ValueError, match="did you mean 'joint_3'"):
        ideal_plant().push("join_3", 1.0)


@pytest.mark.parametrize("joint", [7, -1, "elbow", 1.5, None, True])
def test_an_unknown_joint_is_an_error_that_lists_the_joints(make, joint):
    plant = make()
    for action in (lambda: plant.push(joint, 1.0), lambda: plant.inject(joint, "encoder")):
        with pytest.raises(ValueError, match=r"unknown; joints: \w+, ") as caught:
            action()
        assert "\n" not in str(caught.value)


def test_the_hard_stop_holds(make):
    plant = make()
    values = drive(plant, 30.0, cycles=3000)
    high = values[Row.POSITION]
    assert (high < 2.0 + 0.01).all()
    assert (np.abs(values[Row.VELOCITY, high > 1.999]) < 0.05).all()
    assert (high > 1.999).sum() >= 3
    # Driven away, the joint leaves the stop.
    stuck = int(np.argmax(high))
    assert drive(plant, -50.0, cycles=500)[Row.POSITION, stuck] < 1.9


def test_close_twice_is_safe(make):
    plant = make()
    plant.close()
    plant.close()


def test_several_physics_steps_make_one_control_period(make):
    """Finer physics, same period: time is the same, motion is close but not equal."""
    fine = make(physics_rate=4000.0)
    coarse = make(physics_rate=1000.0)
    a, b = drive(fine, 10.0, cycles=200), drive(coarse, 10.0, cycles=200)
    assert fine.time == coarse.time == pytest.approx(0.2)
    np.testing.assert_allclose(a[Row.POSITION], b[Row.POSITION], atol=2e-3)
    assert (a[Row.POSITION] != b[Row.POSITION]).any()


@pytest.mark.parametrize("rate", [1500.0, 500.0, 999.0])
def test_the_control_period_is_whole_physics_steps(rate):
    config = board("a")
    with pytest.raises(ConfigError, match=r"physics_rate: .*whole multiple of control_rate"):
        SimulatedPlant(config, simulation(config, physics_rate=rate))


def test_joints_of_plant_and_board_must_agree():
    config = board("a", "b")
    with pytest.raises(ConfigError, match="the board's joints: a, b"):
        SimulatedPlant(config, simulation(board("b", "a")))
    with pytest.raises(ConfigError, match=r"a\.home"):
        SimulatedPlant(config, simulation(config, home=2.5))


def test_a_lost_physics_server_is_plant_gone():
    pybullet = pytest.importorskip("pybullet")
    plant = bullet_plant()
    pybullet.disconnect(plant.body._client)
    with pytest.raises(PlantGone, match="physics server is gone"):
        drive(plant, 0.0)
    with pytest.raises(PlantGone):
        plant.reset()
    plant.close()
    with pytest.raises(PlantGone):
        drive(plant, 0.0)


def test_a_window_without_a_display_is_one_line(monkeypatch):
    pytest.importorskip("pybullet")
    for display, reason in (("", "DISPLAY is not set"), (":987", "refuses connections")):
        monkeypatch.setenv("DISPLAY", display)
        config = board("lbr_iiwa_joint_1")
        with pytest.raises(PlantError, match=reason) as caught:
            SimulatedPlant(config, simulation(config, urdf=IIWA, physics="pybullet", gui=True))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("physics", "way"), [("pybullet", "mujoco"), ("mujoco", "pybullet")])
def test_an_engine_that_is_missing_says_how_to_get_it(monkeypatch, physics, way):
    monkeypatch.setattr("control_board_ros.sim.plant.find_spec", lambda _: None)
    with pytest.raises(PlantError, match=rf"physics: {physics} is not installed; pip ") as caught:
        arm_plant(physics)
    assert f"control_board_ros[{physics}]" in str(caught.value)
    assert f"physics:={way}" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("physics", ["mujoco", "ideal"])
def test_only_pybullet_has_a_window(physics):
    config = board("lbr_iiwa_joint_1")
    with pytest.raises(ConfigError, match=f"gui: True .* false with physics {physics}"):
        simulation(config, urdf=IIWA, physics=physics, gui=True)


def test_ideal_physics_of_a_robot_needs_no_engine(monkeypatch):
    monkeypatch.setattr("control_board_ros.sim.plant.find_spec", lambda _: None)
    plant = arm_plant("ideal")
    assert isinstance(plant.body, IdealBody)
    values = drive(plant, 0.0, 0.0, cycles=50)
    np.testing.assert_array_equal(values[Row.POSITION], 0.0)  # no gravity


def test_other_array_types_of_actuations_are_converted_or_refused(make):
    """Flags close bridges as numbers do; too few joints are no actuation."""
    plant = make()
    on = np.ones(7, dtype=bool)
    plant.write(Actuation(np.full(7, 20, dtype=np.int64), on))
    assert (plant.read().values[Row.CURRENT] != 0.0).all()
    on[3] = False
    plant.write(Actuation(np.full(7, 20, dtype=np.int64), on))
    assert (plant.read().values[Row.CURRENT] != 0.0).tolist() == on.tolist()
    with pytest.raises(ValueError, match="could not be broadcast"):
        plant.write(Actuation(np.zeros(6), np.ones(7)))
