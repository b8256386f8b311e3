# SPDX-License-Identifier: Apache-2.0
"""Faults injected into the plant show in the readings, and only where they should (SPEC F)."""

from __future__ import annotations

import numpy as np
import pytest
from plants import bullet_plant, drive, ideal_plant

from control_board_ros.core.faults import FaultCode
from control_board_ros.core.measurement import Row
from control_board_ros.sim.config import Encoder
from control_board_ros.sim.injection import KINDS

PHYSICS = [pytest.mark.physics]
JOINT = 2
OTHERS = [0, 1, 3]
#: Rows that each kind touches on its joint.
TOUCHED = {
    "overcurrent": {Row.CURRENT},
    "encoder": {Row.POSITION, Row.VELOCITY, Row.ENCODER_AGE},
    "encoder_nan": {Row.POSITION, Row.VELOCITY},
    "encoder_frozen": {Row.POSITION, Row.VELOCITY},
    "encoder_spike": {Row.POSITION},
    "encoder_reversed": {Row.POSITION, Row.VELOCITY},
    "torque_sensor": {Row.TORQUE, Row.TORQUE_AGE},
    "overheating": {Row.TEMPERATURE},
    "external": {Row.ALARM},
}


@pytest.fixture
def pair():
    """A plant to break and a sound one to compare with, both moving."""
    plants = ideal_plant(4), ideal_plant(4)
    for plant in plants:
        drive(plant, 10.0, cycles=50)
    return plants


def both(pair, cycles=1, pwm=10.0):
    return drive(pair[0], pwm, cycles=cycles), drive(pair[1], pwm, cycles=cycles)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "diverged"])
def test_a_fault_touches_its_rows_of_its_joint_only_and_clears(pair, kind):
    plant = pair[0]
    plant.inject("joint_2", kind, persistent=True)
    seen = set()
    for _ in range(4):
        broken, sound = both(pair)
        np.testing.assert_array_equal(broken[:, OTHERS], sound[:, OTHERS])
        seen |= {Row(row) for row in np.flatnonzero(broken[:, JOINT] != sound[:, JOINT])}
    assert seen == TOUCHED[kind]
    plant.clear_injected()
    broken, sound = both(pair)
    np.testing.assert_array_equal(broken, sound)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "diverged"])
def test_a_passing_fault_ends_by_itself_and_a_persistent_one_stays(pair, kind):
    plant = pair[0]
    plant.inject(JOINT, kind)
    wrong = [not np.array_equal(plant.read().values, pair[1].read().values)]
    for _ in range(120):
        wrong.append(not np.array_equal(*both(pair)))
    lasts = {"encoder_spike": 1, "encoder": 100, "torque_sensor": 100}.get(kind, 20)
    assert not any(wrong[lasts:])
    assert any(wrong[:lasts])
    plant.inject(JOINT, kind, persistent=True)
    both(pair, 300)
    assert any(not np.array_equal(*both(pair)) for _ in range(2))


def test_overcurrent_reads_far_above_peak_whatever_the_pwm(pair):
    plant = pair[0]
    plant.inject(JOINT, "overcurrent", persistent=True)
    for pwm, powered in ((10.0, 1.0), (0.0, 1.0), (0.0, 0.0)):
        values = drive(plant, pwm, powered)
        assert values[Row.CURRENT, JOINT] > 2 * 16.0
        reference = drive(pair[1], pwm, powered)
        assert values[Row.TORQUE, JOINT] == reference[Row.TORQUE, JOINT]


@pytest.mark.parametrize(
    ("kind", "row", "age"),
    [
        ("encoder", Row.POSITION, Row.ENCODER_AGE),
        ("torque_sensor", Row.TORQUE, Row.TORQUE_AGE),
    ],
)
def test_a_silent_sensor_ages(pair, kind, row, age):
    plant = pair[0]
    last = plant.read().values[row, JOINT]
    plant.inject(JOINT, kind, persistent=True)
    for cycle in range(1, 30):
        values = drive(plant, 30.0)
        assert values[row, JOINT] == last
        assert values[age, JOINT] == pytest.approx(cycle * 1e-3)
    plant.clear_injected()
    values = drive(plant, 30.0)
    assert values[row, JOINT] != last
    assert values[age, JOINT] == 0.0


def test_a_frozen_encoder_is_fresh_and_still(pair):
    plant = pair[0]
    last = plant.read().values[Row.POSITION, JOINT]
    plant.inject(JOINT, "encoder_frozen", persistent=True)
    values = drive(plant, 30.0, cycles=30)
    assert values[Row.POSITION, JOINT] == last
    assert values[Row.VELOCITY, JOINT] == values[Row.ENCODER_AGE, JOINT] == 0.0


def test_a_nan_encoder_is_not_a_number(pair):
    pair[0].inject(JOINT, "encoder_nan")
    assert np.isnan(pair[0].read().values[Row.POSITION, JOINT])


def test_a_spike_is_one_sample(pair):
    pair[0].inject(JOINT, "encoder_spike")
    jump = pair[0].read().values - pair[1].read().values
    assert jump[Row.POSITION, JOINT] == pytest.approx(0.5)
    np.testing.assert_array_equal(*both(pair))


def test_a_persistent_spike_comes_again_and_again(pair):
    pair[0].inject(JOINT, "encoder_spike", persistent=True)
    wrong = [not np.array_equal(*both(pair)) for _ in range(10)]
    assert wrong == [False, True] * 5


def test_a_reversed_encoder_counts_the_wrong_way(pair):
    plant = pair[0]
    start = plant.read().values[Row.POSITION, JOINT]
    plant.inject(JOINT, "encoder_reversed", persistent=True)
    broken, sound = both(pair, 20)
    travel = sound[Row.POSITION, JOINT] - start
    assert travel > 1e-4
    assert broken[Row.POSITION, JOINT] - start == pytest.approx(-travel)
    assert broken[Row.VELOCITY, JOINT] == -sound[Row.VELOCITY, JOINT]


def test_overheating_reads_above_the_limit(pair):
    pair[0].inject(JOINT, "overheating")
    assert pair[0].read().values[Row.TEMPERATURE, JOINT] > 120.0


def test_an_emergency_stop_is_an_alarm(pair):
    pair[0].inject(JOINT, "external")
    assert pair[0].read().values[Row.ALARM, JOINT] == 1 + FaultCode.EXTERNAL


def test_faults_on_two_joints_and_of_two_kinds_add_up(pair):
    plant = pair[0]
    plant.inject(0, "overheating", persistent=True)
    plant.inject(0, "external", persistent=True)
    plant.inject(3, "encoder_nan")
    values = drive(plant, 0.0, cycles=30)
    assert values[Row.TEMPERATURE, 0] > 120.0
    assert values[Row.ALARM, 0] == 1 + FaultCode.EXTERNAL
    assert not np.isnan(values).any()


def test_an_unknown_fault_lists_the_known_ones(pair):
    with pytest.raises(ValueError, match="fault 'fire' unknown; faults: overcurrent, ") as caught:
        pair[0].inject(0, "fire")
    assert all(kind in str(caught.value) for kind in KINDS)
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(*both(pair))


@pytest.mark.parametrize(
    "make", [ideal_plant, pytest.param(bullet_plant, marks=[pytest.mark.physics])]
)
@pytest.mark.parametrize("rate", [1000.0, 3000.0])
def test_a_diverged_simulation_is_an_alarm_and_never_a_number(make, rate):
    plant = make(physics_rate=rate, encoder=Encoder(resolution=1e-5))
    before = drive(plant, 10.0, cycles=120)
    plant.inject(JOINT, "diverged", persistent=True)
    for _ in range(3):
        values = drive(plant, 10.0)
        assert np.isfinite(values).all()
        np.testing.assert_array_equal(values[Row.ALARM], 1 + FaultCode.DIVERGED)
    plant.clear_injected()
    values = drive(plant, 10.0)
    np.testing.assert_array_equal(values[Row.ALARM], 0.0)
    # The body is where it was at most 50 ms before, and moves on.
    np.testing.assert_allclose(values[Row.POSITION], before[Row.POSITION], atol=0.05)
    later = drive(plant, 10.0, cycles=200)
    assert np.isfinite(later).all()
    assert (later[Row.POSITION] != values[Row.POSITION]).all()
    plant.close()


@pytest.mark.physics
def test_a_passing_divergence_ends_by_itself():
    plant = bullet_plant()
    drive(plant, 5.0, cycles=10)
    plant.inject(0, "diverged")
    alarms = [drive(plant, 5.0)[Row.ALARM, 0] for _ in range(40)]
    assert alarms == [1.0 + FaultCode.DIVERGED] * 20 + [0.0] * 20
    plant.close()


def test_a_reset_ends_the_alarm_of_a_divergence():
    plant = ideal_plant()
    plant.inject(JOINT, "diverged")
    assert (drive(plant, 0.0)[Row.ALARM] > 0.0).all()
    plant.reset()
    np.testing.assert_array_equal(plant.read().values[Row.ALARM], 0.0)
