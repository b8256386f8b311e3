# SPDX-License-Identifier: Apache-2.0
"""The motors obey the laws that their constants write."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plants import MOTOR, board, drive, ideal_plant, simulation

from control_board_ros.core.config.config import Motor
from control_board_ros.core.terms.measurement import Actuation, Row
from control_board_ros.sim.config import MotorModel
from control_board_ros.sim.plant import SimulatedPlant

FREE = {"low": -1e6, "high": 1e6}


def one_joint(model: MotorModel, motor: Motor = MOTOR, inertia: float = 1.0, **rest):
    """A free joint without hard stops in reach."""
    config = board("joint", motor=motor, **FREE)
    return SimulatedPlant(config, simulation(config, model=model, inertia=inertia, **rest))


class Locked:
    """A body that something holds: it never moves, or moves at a given speed."""

    def __init__(self, speed: float = 0.0) -> None:
        self.speed = speed
        self.torques: list[float] = []

    def attach(self, state):
        self.state = state

    def step(self, torque):
        self.torques.append(float(torque[0]))
        self.state[1] = self.speed
        return True

    def restore(self, state):
        self.state[1] = self.speed

    def close(self):
        pass


def locked(model=None, motor=MOTOR, speed=0.0, **rest) -> SimulatedPlant:
    """A joint held at a speed by its body."""
    config = board("joint", motor=motor, **FREE)
    plant = simulation(config, model=model or MotorModel(), **rest)
    return SimulatedPlant(config, plant, Locked(speed))


@pytest.mark.parametrize("pwm", [30.0, -12.5])
@pytest.mark.parametrize("efficiency", [1.0, 0.7])
def test_constant_pwm_reaches_the_speed_of_the_constants(pwm, efficiency):
    """At steady speed kt N η (V − Ke w)/R = viscous w + coulomb."""
    motor = Motor(
        resistance=0.5,
        inductance=2e-3,
        torque_constant=0.08,
        gear_ratio=120,
        efficiency=efficiency,
    )
    model = MotorModel(inertia=1e-4, viscous=3.0, coulomb=4.0)
    plant = one_joint(model, motor)
    speed = drive(plant, pwm, cycles=3000)[Row.VELOCITY, 0]
    volts, emf = pwm / 100 * 48.0, 0.08 * 120
    gain = emf * efficiency / 0.5
    expected = (gain * volts - math.copysign(4.0, pwm)) / (gain * emf + 3.0)
    assert speed == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("physics_rate", [1000.0, 8000.0])
def test_the_current_of_a_locked_rotor_is_exact(physics_rate):
    """i(t) = V/R (1 − exp(−t R/L)) at every cycle, whatever the physics step."""
    plant = locked(physics_rate=physics_rate)
    for cycle in range(1, 20):
        current = drive(plant, 25.0)[Row.CURRENT, 0]
        assert current == pytest.approx(24.0 * -math.expm1(-cycle * 1e-3 * 250.0), rel=1e-12)


def test_a_stalled_motor_draws_volts_over_ohms():
    plant = locked()
    values = drive(plant, 25.0, cycles=200)
    assert values[Row.CURRENT, 0] == pytest.approx(0.25 * 48.0 / 0.5, rel=1e-12)
    assert values[Row.TORQUE, 0] == pytest.approx(24.0 * 0.08 * 120.0, rel=1e-12)


def test_a_turning_motor_brakes_by_its_back_emf():
    """With the bridge closed at 0 %, a turned joint meets −Ke² η/R · w."""
    values = drive(locked(speed=0.4), 0.0, cycles=200)
    assert values[Row.CURRENT, 0] == pytest.approx(-9.6 * 0.4 / 0.5, rel=1e-12)
    assert values[Row.TORQUE, 0] == pytest.approx(-9.6 * 9.6 * 0.4 / 0.5, rel=1e-12)


def test_the_torque_of_a_step_is_that_of_the_mean_current():
    """The impulse of each step equals the integral of the exact current over it."""
    plant = locked()
    drive(plant, 25.0, cycles=5)
    start, end = np.arange(5) * 1e-3, np.arange(1, 6) * 1e-3
    rate = 250.0
    charge = 24.0 * (1e-3 + (np.exp(-rate * end) - np.exp(-rate * start)) / rate)
    np.testing.assert_allclose(plant.body.torques, charge / 1e-3 * 9.6, rtol=1e-9)


def test_a_slow_winding_and_a_fast_one_are_both_exact():
    for inductance in (1e-7, 1.0):
        plant = locked(motor=Motor(resistance=0.5, inductance=inductance))
        current = drive(plant, 50.0, cycles=3)[Row.CURRENT, 0]
        expected = 48.0 * -math.expm1(-3e-3 * 0.5 / inductance)
        assert current == pytest.approx(expected, rel=1e-9)


def test_the_bridge_opens_and_closes_at_once():
    """M10, F1: powered 0 means no current and no motor torque within the same cycle."""
    plant = locked(MotorModel(viscous=2.0), speed=0.1)
    drive(plant, 25.0, cycles=100)
    values = drive(plant, 25.0, 0.0)
    assert values[Row.CURRENT, 0] == 0.0
    assert values[Row.TORQUE, 0] == pytest.approx(-0.2, rel=1e-12)
    assert drive(plant, 25.0, 1.0)[Row.CURRENT, 0] > 1.0


def test_the_bridges_are_seen_when_the_board_reuses_its_array():
    """The board reuses its arrays: a change inside one must be seen."""
    plant = ideal_plant(3)
    actuation = Actuation(np.full(3, 20.0), np.ones(3))
    plant.write(actuation)
    actuation.powered[1] = 0.0
    plant.write(actuation)
    current = plant.read().values[Row.CURRENT]
    assert current[1] == 0.0
    assert (current[[0, 2]] > 0.0).all()


@pytest.mark.parametrize("coulomb", [1.0, 50.0])
def test_coulomb_friction_stops_a_joint_and_never_drives_it_back(coulomb):
    """Explicit friction is stable: the joint comes to rest, but for the bristle's spring-back."""
    plant = one_joint(MotorModel(coulomb=coulomb), inertia=0.5)
    plant.push(0, 60.0)
    drive(plant, 0.0, 0.0, cycles=30)
    plant.push(0, 0.0)
    speeds = [drive(plant, 0.0, 0.0)[Row.VELOCITY, 0] for _ in range(3000)]
    assert speeds[0] > 0.1
    assert min(speeds) > -1e-3
    assert (np.diff(speeds) <= 1e-4).all()
    assert abs(speeds[-1]) < 1e-4


def test_a_bearing_holds_what_is_nearly_balanced_and_slips_beyond():
    """A joint that gravity pulls by less than the bearing's torque stays for good, unpowered."""
    model, limit = MotorModel(coulomb=2.0), 0.04  # of 200 N·m
    plant = one_joint(model, inertia=0.5)
    plant.push(0, 0.9 * limit)
    there = drive(plant, 0.0, 0.0, cycles=60000)[Row.POSITION, 0]
    assert there == pytest.approx(0.9e-4, rel=1e-3)
    plant.push(0, 1.2 * limit)  # the gearbox, before the sensor, creeps as it did
    moved = drive(plant, 0.0, 0.0, cycles=20000)
    assert moved[Row.POSITION, 0] > 2e-4
    assert moved[Row.TORQUE, 0] == pytest.approx(-0.2 * limit, rel=1e-3)


def test_coulomb_friction_opposes_motion_in_full():
    """Deceleration of a coasting joint is coulomb/M."""
    plant = one_joint(MotorModel(coulomb=2.0, inertia=1e-4), inertia=0.5)
    plant.push(0, 60.0)
    drive(plant, 0.0, 0.0, cycles=100)
    plant.push(0, 0.0)
    before = drive(plant, 0.0, 0.0)[Row.VELOCITY, 0]
    after = drive(plant, 0.0, 0.0, cycles=100)[Row.VELOCITY, 0]
    assert (before - after) / 0.1 == pytest.approx(2.0 / (0.5 + 1e-4 * 120.0**2), rel=1e-6)


def test_the_rotor_adds_its_reflected_inertia():
    """A = τ / (I + J N²)."""
    plant = one_joint(MotorModel(inertia=1e-4), inertia=0.5)
    plant.push(0, 10.0)
    speed = drive(plant, 0.0, 0.0, cycles=10)[Row.VELOCITY, 0]
    assert speed / 0.01 == pytest.approx(10.0 / (0.5 + 1.44), rel=1e-12)


def test_the_winding_warms_to_its_steady_state():
    """T = ambient + Rth R i², with the time constant Rth Cth."""
    model = MotorModel(thermal_resistance=2.0, thermal_capacitance=1.0)
    plant = locked(model, replace(MOTOR, ambient=20.0))
    rise = 2.0 * 0.5 * 2.4**2  # 2.4 A at 2.5 %
    after = drive(plant, 2.5, cycles=2000)[Row.TEMPERATURE, 0]
    assert after == pytest.approx(20.0 + rise * -math.expm1(-1.0), rel=0.01)
    assert drive(plant, 2.5, cycles=30000)[Row.TEMPERATURE, 0] == pytest.approx(20.0 + rise, 1e-4)
    cooled = drive(plant, 0.0, 0.0, cycles=2000)[Row.TEMPERATURE, 0]
    assert cooled == pytest.approx(20.0 + rise * math.exp(-1.0), rel=0.01)
    plant.reset()
    assert plant.read().values[Row.TEMPERATURE, 0] == 20.0


def test_a_slow_board_warms_as_a_fast_one():
    """The heat of a period does not depend on the control rate."""
    readings = []
    for rate in (10.0, 1000.0):
        config = board("joint", control_rate=rate, **FREE)
        model = MotorModel(thermal_resistance=2.0, thermal_capacitance=1.0)
        plant = SimulatedPlant(config, simulation(config, model=model), Locked())
        readings.append(drive(plant, 2.5, cycles=round(3 * rate))[Row.TEMPERATURE, 0])
    assert readings[0] == pytest.approx(readings[1], rel=5e-3)


def test_joints_do_not_mix():
    """Permuting joints permutes results."""
    motors = [Motor(resistance=0.3 + 0.1 * k, gear_ratio=50.0 + 10 * k) for k in range(5)]
    config = board(*"abcde", **FREE)
    config_of = {
        joint.name: (joint, motor) for joint, motor in zip(config.joints, motors, strict=True)
    }
    pwm = dict(zip("abcde", (5.0, -10.0, 20.0, 40.0, -3.0), strict=True))

    def run(order: str) -> dict[str, list[float]]:
        joints = tuple(replace(config_of[n][0], motor=config_of[n][1]) for n in order)
        own = replace(config, joints=joints)
        model = MotorModel(coulomb=0.3, viscous=0.1, inertia=1e-5)
        plant = SimulatedPlant(own, simulation(own, model=model))
        values = drive(plant, [pwm[n] for n in order], cycles=100)
        return {name: values[:, index].tolist() for index, name in enumerate(order)}

    assert run("abcde") == run("dbeca")
