# SPDX-License-Identifier: Apache-2.0
"""Faults injected into the plant show in the readings, and only where they should (SPEC F)."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from plants import ENGINES, arm_plant, drive, ideal_plant, plant_of
from rig import LIMITS, Rig, board_config, joint

from control_board_ros.core.config.config import Limits, Pid, Timeouts
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Row
from control_board_ros.sim.config import Encoder, JointSimulation, SimulationConfig
from control_board_ros.sim.injection import KINDS
from control_board_ros.sim.plant import SimulatedPlant

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


def differs(pair, cycles, powered=1.0):
    """In which of the next cycles the readings of the broken plant differ."""
    found = []
    for _ in range(cycles):
        found.append(not np.array_equal(pair[0].read().values, pair[1].read().values))
        for plant in pair:
            drive(plant, 10.0, powered)
    return found


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "diverged"])
def test_a_passing_fault_ends_by_itself_and_a_persistent_one_stays(pair, kind):
    """F1: where one reading is enough, after some; else when the joint has lost its power."""
    plant = pair[0]
    plant.inject(JOINT, kind)
    driven = differs(pair, 120)
    lasts = {"encoder_spike": 1}.get(kind, 20)
    assert any(driven[:lasts])
    if kind in ("encoder", "torque_sensor", "encoder_frozen", "encoder_reversed"):
        assert any(driven[110:])
        assert not any(differs(pair, 20, powered=0.0)[1:])
    else:
        assert not any(driven[lasts:])
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
    assert jump[Row.POSITION, JOINT] > 0.5
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


def test_faults_on_two_joints_and_of_two_kinds_add_up(pair):
    plant = pair[0]
    plant.inject(0, "overheating", persistent=True)
    plant.inject(0, "external", persistent=True)
    plant.inject(3, "encoder_nan")
    values = drive(plant, 0.0, cycles=30)
    assert values[Row.TEMPERATURE, 0] > 120.0
    assert values[Row.ALARM, 0] == 1 + FaultCode.EXTERNAL
    assert not np.isnan(values).any()


@pytest.mark.parametrize("rate", [20.0, 100.0, 500.0])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("start", ["moving", "at rest", "idle"])
def test_every_passing_fault_is_found(kind, rate, start):
    """F1: at every control rate, in every state, before it is gone; and then it is gone."""
    slow = Limits(**(asdict(LIMITS) | {"velocity": 0.5, "acceleration": 1.0}))
    gains = {"position_pid": Pid(kp=4.0, kd=4.0), "torque_pid": Pid(kp=0.01, kff=1.0)}
    config = board_config(joint("a", limits=asdict(slow), **gains), control_rate=rate)
    simulation = SimulationConfig(joints=(JointSimulation(name="a"),), physics_rate=2000.0)
    rig = Rig(config, SimulatedPlant(config, simulation))
    rig.tick(3)
    assert rig.board.set_control_mode("a", "idl" if start == "idle" else "pos")
    rig.tick(2)
    if start == "moving":
        assert rig.board.position_move("a", 1.5, 0.25)
        rig.run(0.5)
    rig.plant.inject("a", kind)
    if start != "moving" and kind in ("encoder_frozen", "encoder_reversed"):
        rig.run(0.5)  # nothing to find yet
        assert rig.board.set_control_mode("a", "pos")
        assert rig.board.position_move("a", 1.5, 0.25)
    for _ in range(round(6.0 * rate)):
        rig.tick()
        if rig.board.get_faults("a")[0].active:
            break
    assert rig.board.get_control_mode("a")[0].code == "hwfa"
    for _ in range(20):  # I²t of an overcurrent fades
        rig.run(max(0.3, 12.0 / rate))
        if rig.board.set_control_mode("a", "fidl"):
            return
    raise AssertionError(rig.board.get_faults("a")[0].text)


def test_a_passing_silence_outlasts_the_timeout(pair):
    """F1: however long the board waits for a sample."""
    patient = joint("a", timeouts=Timeouts(encoder=0.5, torque_sensor=0.7))
    rig = Rig(board_config(patient))
    rig.tick(3)
    for kind, code in (("encoder", "encoder silent"), ("torque_sensor", "torque sensor")):
        rig.plant.inject("a", kind)
        rig.run(0.9)
        assert code in rig.board.get_faults("a")[0].text
        assert rig.board.set_control_mode("a", "fidl")


def test_a_reset_removes_defects_and_pushes(pair):
    """A reset removes persistent faults and pushes."""
    plant, sound = pair
    plant.inject(JOINT, "overheating", persistent=True)
    plant.push(0, 3.0)
    plant.reset()
    sound.reset()
    np.testing.assert_array_equal(*both(pair, 50))


def test_an_unknown_fault_lists_the_known_ones(pair):
    with pytest.raises(ValueError, match="fault 'encodre' unknown; did you mean 'encoder'"):
        pair[0].inject(0, "encodre")
    with pytest.raises(ValueError, match="fault 'fire' unknown; faults: overcurrent, ") as caught:
        pair[0].inject(0, "fire")
    assert all(kind in str(caught.value) for kind in KINDS)
    assert "\n" not in str(caught.value)
    np.testing.assert_array_equal(*both(pair))


@pytest.mark.parametrize("physics", ["ideal", *ENGINES])
@pytest.mark.parametrize("rate", [1000.0, 3000.0])
def test_a_diverged_simulation_is_an_alarm_and_never_a_number(physics, rate):
    plant = plant_of(physics, physics_rate=rate, encoder=Encoder(resolution=1e-5))
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


@pytest.mark.parametrize("physics", ENGINES)
def test_a_passing_divergence_ends_by_itself(physics):
    plant = arm_plant(physics)
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


def test_a_fault_that_one_joint_cannot_have_breaks_none():
    """I7: all joints that are named, or none of them."""
    plant = Rig(board_config()).plant
    with pytest.raises(ValueError, match="bare has no torque sensor to break"):
        plant.inject(["left", "bare"], "torque_sensor", persistent=True)
    with pytest.raises(ValueError, match="'nobody' unknown"):
        plant.inject(["left", "nobody"], "encoder", persistent=True)
    values = drive(plant, 0.0, cycles=5)
    np.testing.assert_array_equal(values[[Row.TORQUE_AGE, Row.ENCODER_AGE]], 0.0)
