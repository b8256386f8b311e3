# SPDX-License-Identifier: Apache-2.0
"""Every cause of a fault, put into the plant: found in time, told rightly, kept, cleared (F)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rig import ACTIVE, RATE, Rig, board_config, held, joint, ready

from control_board_ros.core.terms.faults import FaultCode as F
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.sim.injection import KINDS

#: What is injected: the code it must give, words of its text, cycles until it must be found.
IN_20_MS = math.ceil(0.02 * RATE) + 2
CAUSES = {
    "overcurrent": (F.OVERCURRENT, "75 A > 25 A", 1),
    "encoder": (F.ENCODER_SILENT, "no sample for", IN_20_MS),
    "encoder_nan": (F.ENCODER_INVALID, "not a number", 1),
    "encoder_frozen": (F.ENCODER_MISMATCH, "encoder and motor disagree", round(0.2 * RATE)),
    "encoder_spike": (F.ENCODER_SPIKE, "jumped by more than", 1),
    "encoder_reversed": (F.ENCODER_MISMATCH, "frozen, slipping or reversed", round(0.2 * RATE)),
    "torque_sensor": (F.TORQUE_SENSOR, "no sample for", IN_20_MS),
    "overheating": (F.OVERHEATING, "130 °C > 120 °C", 1),
    "external": (F.EXTERNAL, "emergency stop", 1),
    "diverged": (F.DIVERGED, "diverged", 2),
}
#: Causes that only a powered, moving motor shows.
MOVING = ("encoder_frozen", "encoder_reversed")


def faulted_by(kind, *, persistent=True):
    """A rig of left and right, moving, after a cause was injected into left; and the cycles."""
    rig = ready(board_config(joint("left"), joint("right")))
    rig.enter(M.POSITION)
    rig.board.position_move(None, 1.5, 2.0)
    rig.run(0.3)
    rig.plant.inject("left", kind, persistent)
    for cycle in range(1, IN_20_MS + 200):
        rig.tick()
        if rig.modes()[0] is M.HW_FAULT:
            return rig, cycle
    raise AssertionError(f"{kind} was not found")


def test_the_list_is_whole():
    assert set(CAUSES) == set(KINDS)


@pytest.mark.parametrize("kind", CAUSES)
def test_each_cause_is_found_in_its_time_with_its_code_and_text(kind):
    """F1, F5: code, text, stamp; the joint is unpowered in that very cycle."""
    code, words, most = CAUSES[kind]
    rig, cycles = faulted_by(kind)
    assert cycles <= most
    record = rig.board.get_faults("left")[0]
    assert (record.active, record.code) == (True, code)
    assert words in record.text
    assert record.text.startswith(code.title)
    assert record.stamp == pytest.approx(rig.board.time)
    assert rig.board.state.powered[0] == 0.0
    assert rig.board.snapshot().output[0] == 0.0
    everybody = kind == "diverged"  # the simulation as a whole
    assert rig.modes()[1] is (M.HW_FAULT if everybody else M.POSITION)
    assert any(event.level == "error" for event in rig.board.take_events())


AT_REST = [kind for kind in CAUSES if kind not in (*MOVING, "diverged")]


@pytest.mark.parametrize("kind", AT_REST)
def test_a_cause_that_is_there_at_power_on_lets_no_power_through(kind):
    """F1, N2: found in the cycle that configures the joint; afterwards the joint is as before."""
    rig = Rig(board_config(joint("left", startup_mode=M.POSITION), autoconfigure=False))
    rig.plant.inject("left", kind, persistent=True)
    rig.run(0.1)
    assert rig.modes() == [M.NOT_CONFIGURED]
    rig.board.power_cycle()  # blind: the next reading configures
    rig.board.configure()
    rig.tick(2 if kind == "encoder_spike" else 1)
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0].code == CAUSES[kind][0]
    assert not rig.board.set_control_mode("left", "fidl")
    rig.plant.clear_injected()
    rig.tick()
    assert rig.board.set_control_mode("left", "fidl")
    assert rig.board.set_control_mode("left", "pos")
    rig.run(0.5)
    assert rig.modes() == [M.POSITION]
    assert abs(rig.board.get_encoder()[0]) < 1e-3


def test_a_reading_that_is_not_a_number_leaves_nothing_behind():
    """F1: where a joint was configured on such a reading, no other fault follows from it."""
    rig = Rig(board_config(joint("left", startup_mode=M.POSITION), autoconfigure=False))
    rig.plant.inject("left", "encoder_nan", persistent=True)
    rig.tick(3)
    assert rig.board.configure()
    assert rig.board.get_target_position().tolist() == [0.0]
    rig.plant.clear_injected()
    rig.run(0.1)
    assert rig.modes() == [M.POSITION]


@pytest.mark.parametrize("cycles", range(1, 10))
def test_a_wrong_current_leaves_no_wrong_encoder_behind(cycles):
    """F3: an overcurrent reading is no travel of the motor; FORCE_IDLE clears it at once."""
    rig = ready(board_config(joint("left"), control_rate=200.0))
    rig.enter(M.POSITION)
    rig.tick(cycles)
    rig.plant.inject("left", "overcurrent", persistent=True)
    rig.tick(20)
    rig.plant.clear_injected()
    rig.tick()
    reply = rig.board.set_control_mode("left", "fidl")
    assert reply, reply.message


def test_the_first_reading_after_those_that_are_none_is_no_spike():
    """F2: nobody knows how far the joint went meanwhile; FORCE_IDLE clears the fault at once."""
    rig = ready(board_config(joint("left")))
    rig.plant.push("left", 10.0)
    rig.run(0.3)
    rig.plant.inject("left", "encoder_nan", persistent=True)
    rig.run(0.2)
    rig.plant.clear_injected()
    rig.tick()
    assert rig.board.set_control_mode("left", "fidl")


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0])
@pytest.mark.parametrize("mode", ["pos", "posd", "vel", "mix", "torq"])
def test_a_fast_joint_may_be_switched_between_two_cycles(rate, mode):
    """F1: until the next reading the motor runs with what it had; that is no broken encoder."""
    wide = {"peak_current": 100.0, "overload_time": 100.0}
    rig = ready(board_config(joint("left", limits=wide), control_rate=rate))
    for wait in range(1, 10):
        rig.enter(M.POSITION_DIRECT)
        rig.board.set_position("left", 1.5 * (-1.0) ** wait)
        rig.run(0.15)
        rig.tick(wait)
        assert rig.board.set_control_mode("left", "fidl")
        assert rig.board.set_control_mode("left", mode)
        rig.run(0.02)
        assert rig.modes()[0].code == mode, rig.board.get_faults()[0].text


@pytest.mark.parametrize("kind", MOVING)
def test_a_broken_encoder_is_found_again_when_the_motor_runs(kind):
    """F3: at rest nobody can tell; the next move does."""
    rig, _ = faulted_by(kind)
    rig.run(0.5)
    assert rig.board.set_control_mode("left", "fidl")
    rig.enter(M.OPENLOOP, ["left"])
    rig.board.set_output("left", 8.0)
    rig.run(0.5)
    assert rig.modes()[0] is M.HW_FAULT
    assert rig.board.get_faults("left")[0].code == F.ENCODER_MISMATCH


@pytest.mark.parametrize("mode", ACTIVE)
def test_the_emergency_stop_takes_all_power_in_one_cycle(mode):
    """F1 (promise P5): in HW_FAULT the motor current is exactly 0 from the next reading on."""
    rig = ready()
    rig.enter(mode, ["left", "right"])
    send = {
        M.POSITION: lambda: rig.board.position_move(None, 1.0, 2.0),
        M.POSITION_DIRECT: lambda: rig.board.set_position(None, 0.05),
        M.VELOCITY: lambda: rig.board.velocity_move(None, 1.0, 10.0),
        M.MIXED: lambda: rig.board.position_move(None, 1.0, 2.0),
        M.TORQUE: lambda: rig.board.set_ref_torque(None, 5.0),
        M.OPENLOOP: lambda: rig.board.set_output(None, 10.0),
    }[mode]
    send()
    rig.run(0.1)
    assert rig.board.snapshot().current[0] != 0.0
    for name in rig.board.names:
        rig.plant.inject(name, "external", persistent=True)
    rig.tick()
    assert rig.modes() == [M.HW_FAULT] * 3
    for snapshot in rig.record(0.2):
        np.testing.assert_array_equal(snapshot.current, 0.0)
        np.testing.assert_array_equal(snapshot.output, 0.0)


@pytest.mark.parametrize("mode", [M.IDLE, M.HW_FAULT, M.NOT_CONFIGURED])
def test_without_power_the_current_is_exactly_zero(mode):
    """M10, F1, N1 (promise P5): whatever is commanded, also a feed-forward."""
    rig = ready(board_config(autoconfigure=mode is not M.NOT_CONFIGURED))
    if mode is M.HW_FAULT:
        rig.plant.inject("left", "external", persistent=True)
        rig.tick()
    assert rig.modes()[0] is mode
    rig.plant.push("left", 3.0)  # it moves, so there is a back-EMF
    for _ in range(100):
        rig.board.set_feedforward(None, 100.0, 10.0)
        rig.board.position_move(None, 1.0)
        rig.board.set_output(None, 100.0)
        snapshot = rig.tick()
        assert snapshot.current[0] == snapshot.output[0] == 0.0
    assert snapshot.velocity[0] != 0.0


# --- causes that are no injection -----------------------------------------------------------


def test_an_overload_trips_i2t():
    """F1: a motor that holds a load between nominal and peak current, for too long."""
    rig = ready(board_config(joint("left", limits={"overload_time": 0.1, "nominal_current": 3.0})))
    rig.enter(M.POSITION)
    rig.plant.push("left", 40.0)  # 8 A: (8² - 3²)·t > (25² - 3²)·0.1
    rig.run(1.0)
    assert rig.modes() == [M.POSITION]
    rig.run(0.3)
    record = rig.board.get_faults("left")[0]
    assert (record.active, record.code) == (True, F.I2T)
    assert "3 A nominal for too long" in record.text


def test_a_joint_beyond_its_hard_stop_faults():
    """F1: an overrun beyond the margin is a fault; within the margin it is none."""
    rig = held(joint("left"))
    limits = rig.config.joints[0].limits
    step = 0.5 * limits.velocity * rig.period

    def carry(target):
        while abs(target - rig.plant.values[Row.POSITION, 0]) > 1e-9:
            way = target - rig.plant.values[Row.POSITION, 0]
            rig.plant.values[Row.POSITION, 0] += np.clip(way, -step, step)
            rig.tick()
        rig.tick(10)

    carry(limits.hard_upper + 0.9 * limits.hard_margin)
    assert rig.modes() == [M.IDLE]
    carry(limits.hard_upper + 1.1 * limits.hard_margin)
    assert rig.modes() == [M.HW_FAULT]
    record = rig.board.get_faults("left")[0]
    assert record.code == F.HARD_LIMIT
    assert "beyond the hard stop" in record.text
    assert not rig.board.set_control_mode("left", "fidl")
    carry(limits.hard_upper)
    assert rig.board.set_control_mode("left", "fidl")


def test_two_causes_at_once_keep_the_first_and_both_must_go():
    """F3, F5: the record tells the first cause, FORCE_IDLE waits for the last."""
    rig = ready()
    rig.plant.inject("left", "overcurrent", persistent=True)
    rig.tick()
    rig.plant.inject("left", "torque_sensor", persistent=True)
    rig.run(0.1)
    assert rig.board.get_faults("left")[0].code == F.OVERCURRENT
    assert "overcurrent" in rig.board.set_control_mode("left", "fidl").message
    rig.plant.clear_injected()
    rig.plant.inject("left", "torque_sensor", persistent=True)
    rig.run(0.1)
    assert "torque sensor" in rig.board.set_control_mode("left", "fidl").message
    rig.plant.clear_injected()
    rig.tick(2)
    assert rig.board.set_control_mode("left", "fidl")


def test_power_cycling_a_fault_that_persists_comes_back_to_it():
    """N1, F3: power-on is no way round a cause."""
    rig = ready()
    rig.plant.inject("left", "external", persistent=True)
    rig.tick()
    rig.board.power_cycle()
    rig.run(0.1)
    assert rig.modes()[0] is M.HW_FAULT
    assert rig.board.state.powered[0] == 0.0


def test_the_same_commands_give_bit_identical_states():
    """Promise P9: two boards, the same commands at the same cycles, the same bits; faults too."""

    def run():
        rig = Rig(replace(board_config()))
        rows = []
        for cycle in range(1500):
            if cycle == 10:
                rig.board.set_control_mode(None, ["pos", "vel", "mix"])
            if cycle == 20:
                rig.board.position_move(["left", "bare"], [1.0, -0.5])
            if cycle % 50 == 0:
                rig.board.velocity_move("right", 0.3)
            if cycle == 400:
                rig.plant.inject("left", "overcurrent")
            if cycle == 700:
                rig.board.set_control_mode("left", "fidl")
                rig.board.set_interaction_mode("right", "comp")
            if cycle == 800:
                rig.plant.push("right", 4.0)
            rows.append(rig.tick().block.tobytes())
        return rows

    assert run() == run()
