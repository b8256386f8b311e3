# SPDX-License-Identifier: Apache-2.0
"""SPEC P: references, laws, limits and timeouts, looked at closely, on the board in process."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from rig import (
    ACTIVE,
    COMMANDS,
    COMPLIANT,
    LIMITS,
    MODE_OF,
    MOTOR,
    PER_TORQUE,
    POSITION_MODES,
    RATE,
    STANDARD,
    STIFF,
    M,
    Rig,
    board_config,
    check_stop,
    column,
    finite,
    held,
    joint,
    ready,
)

from control_board_ros.core.config.config import Pid, Timeouts
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode
from control_board_ros.simulation import Simulation

PERIOD = 1.0 / RATE
ONLY_P = Pid(kp=100.0)
NEVER = Timeouts(velocity=0.0)


def moving(*modes: str, **changes: Any) -> Rig:
    """A rig of one joint in a mode, whose velocity references never expire."""
    rig = ready(board_config(joint("left", **({"timeouts": NEVER} | changes))))
    rig.enter(modes[0] if modes else "pos")
    return rig


# --- P1 to P3: moves -------------------------------------------------------------------------


def test_minimum_jerk_exactly() -> None:
    """P1, P3: cycle by cycle the reference is q0 + Δ(10s³ − 15s⁴ + 6s⁵), s = t v/|Δ|."""
    rig = moving("pos")
    q0 = float(rig.board.snapshot().position_reference[0])
    assert rig.board.position_move("left", 0.9, 0.6)
    assert not rig.board.snapshot().motion_done[0]
    shots = rig.record(2.0)
    s = np.minimum(np.arange(1, len(shots) + 1) * PERIOD * 0.6 / (0.9 - q0), 1.0)
    expected = q0 + (0.9 - q0) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    assert column(shots, "position_reference") == pytest.approx(expected, abs=1e-9)
    assert column(shots, "velocity_reference").max() == pytest.approx(1.875 * 0.6, rel=1e-4)
    done = column(shots, "motion_done")
    cycles = math.ceil((0.9 - q0) / 0.6 / PERIOD - 1e-9)
    assert not done[: cycles - 1].any()
    assert done[cycles - 1 :].all()
    assert shots[-1].position_reference[0] == 0.9
    assert shots[-1].position[0] == pytest.approx(0.9, abs=2e-3)


@pytest.mark.parametrize("when", [1, 100, 250, 400, 499])
@pytest.mark.parametrize("target", [2.0, 0.2, -1.0, 1.0])
def test_a_new_target_without_a_jump(when: int, target: float) -> None:
    """P1: a new target starts from the present reference position and velocity."""
    rig = moving("pos")
    rig.board.position_move("left", 1.0, 1.0)
    before = rig.tick(when)
    assert rig.board.position_move("left", target, 1.0)
    assert not rig.board.snapshot().motion_done[0]
    shots = [before, *rig.record(8.0)]
    position = column(shots, "position_reference")
    velocity = column(shots, "velocity_reference")
    steps = np.abs(np.diff(position))
    assert steps.max() <= LIMITS.velocity * PERIOD
    hardest = 100.0  # rad/s²; a jump to rest from here would be 900
    assert np.abs(np.diff(velocity)).max() <= hardest * PERIOD
    assert abs(steps[0] - abs(velocity[0]) * PERIOD) <= hardest * PERIOD**2
    assert position[-1] == target
    assert velocity[-1] == 0.0
    assert shots[-1].motion_done[0]


@pytest.mark.parametrize("speed", [0.05, 0.3, 2.0])
def test_a_new_target_is_approached_from_its_side(speed: float) -> None:
    """P1: led on, a move does not pass its new target; led back, it first brakes, no longer."""
    for way, most in ((1.0, 0.0), (-1.0, 1.875**2 / LIMITS.acceleration)):
        rig = moving("pos")
        rig.board.position_move("left", 1.0, 1.0)
        before = rig.tick(250)
        assert before.velocity_reference[0] == pytest.approx(1.875, rel=1e-3)
        here = float(before.position_reference[0])
        assert rig.board.position_move("left", here + way * 0.3, speed)
        reference = way * (column(rig.record(9.0), "position_reference") - here)
        assert reference.max() <= 0.3 + 1e-9
        assert reference.min() >= -most * 1.01 - 1e-9
        assert reference[-1] == pytest.approx(0.3, abs=1e-9)


def test_speeds_of_moves() -> None:
    """P2: the configured speed, else 10 deg/s; set_ref_speed; the speed that comes along."""
    ten = math.radians(10.0)
    rig = ready(board_config(joint("left"), joint("right", reference_speed=0.5)))
    assert rig.board.get_ref_speed() == pytest.approx([ten, 0.5])
    assert rig.board.get_ref_acceleration() == pytest.approx([ten, ten])
    rig.enter("pos")
    rig.board.position_move(None, 0.25)
    assert rig.board.get_remaining_time() == pytest.approx([0.25 / ten, 0.5], abs=2 * PERIOD)
    assert rig.board.set_ref_speed("left", 1.0)
    rig.board.position_move("left", 0.5)
    assert rig.board.get_remaining_time("left") == pytest.approx([0.5], abs=2 * PERIOD)
    rig.board.position_move("right", -0.25, 0.25)
    assert rig.board.get_remaining_time("right") == pytest.approx([1.0], abs=2 * PERIOD)
    assert rig.board.get_ref_speed().tolist() == [1.0, 0.5]


def test_the_smallest_speed_there_is() -> None:
    """P1, P2: it makes a very slow move, and no infinite one; a smaller one is an error."""
    rig = moving("pos")
    reply = rig.board.position_move("left", 1.0, 5e-324)
    assert "speeds must be from 1e-06 to 3 rad/s, not 4.94066e-324" in reply.message
    assert not rig.board.set_ref_speed("left", 9.9e-7)
    assert rig.board.position_move("left", 1.0, 1e-6)
    shown = rig.run(0.2)
    assert finite(shown)
    assert not shown.motion_done[0]
    assert math.isfinite(rig.board.get_remaining_time("left")[0])


@pytest.mark.fresh("the way from that reading")
@pytest.mark.parametrize("mode", ["pos", "posd", "vel", "mix"])
def test_stop_in_each_mode(mode: str) -> None:
    """P3: stop drops what runs; the joint brakes, and is held where it comes to rest."""
    rig = moving(mode)
    board = rig.board
    for method, _, _ in COMMANDS.values():
        getattr(board, method)("left", 0.6)
    rig.run(0.3)
    assert board.stop("left")
    shown = board.snapshot()
    assert shown.position_reference[0] == shown.position[0]
    assert shown.velocity_reference[0] == 0.0
    assert shown.motion_done[0]
    check_stop(board, shown, rig.run(1.0))
    assert rig.modes() == [ControlMode[board.get_control_mode("left")[0].name]]


@pytest.mark.parametrize(("rate", "way"), [(100.0, 4), (250.0, 2), (1000.0, 8)])
def test_a_joint_that_stops_after_a_step_rests(rate: float, way: int) -> None:
    """M9, P3: it does not creep on, its reference with it."""
    with Simulation.load("iiwa", control_rate=rate) as simulation:
        board, name = simulation.board, "lbr_iiwa_joint_3"
        simulation.step(3)
        assert board.set_control_mode(name, "posd")
        board.set_position(name, 0.1)
        simulation.step(way)
        assert board.set_control_mode(name, "pos")
        simulation.step(5)
        assert board.position_move(name, 0.6, 0.2)
        simulation.step(9)
        assert board.stop(name)
        simulation.step(round(2.0 * rate))
        held = board.get_encoder(name)[0]
        simulation.step(round(rate))
        assert board.get_encoder(name)[0] == pytest.approx(held, abs=2e-3)


def test_stop_of_one_joint_leaves_the_others() -> None:
    """P3: the other joints of the board complete their moves."""
    rig = ready()
    rig.enter("pos")
    rig.board.position_move(None, 1.0, 1.0)
    rig.run(0.5)
    assert rig.board.stop("left")
    assert rig.board.check_motion_done() == [True, False, False]
    assert rig.run(1.0).position_reference[1:].tolist() == [1.0, 1.0]


def test_stop_where_it_stops_nothing() -> None:
    """P3: in IDLE and HW_FAULT a joint is at rest; in TORQUE and OPENLOOP stop says it can not."""
    rig = ready()
    rig.board.set_control_mode(None, ["torq", "open", "idl"])
    reply = rig.board.stop()
    assert [str(answer) for answer in reply.answers] == ["ignored", "ignored", "accepted"]
    assert "TORQUE" in reply.message
    assert not rig.board.set_control_mode("bare", "veld")
    assert rig.board.stop("bare")


# --- P4 to P6: references --------------------------------------------------------------------


def test_direct_position_is_the_step_itself() -> None:
    """P4: from one cycle to the next; bounded by the limits; the last one is what was taken."""
    rig = moving("posd")
    for wanted, taken in ((0.3, 0.3), (-0.2, -0.2), (7.0, 2.0), (-7.0, -2.0)):
        assert rig.board.set_position("left", wanted)
        shown = rig.tick()
        assert shown.position_reference[0] == taken
        assert shown.velocity_reference[0] == 0.0
        assert rig.board.get_ref_position("left")[0] == taken
        assert shown.motion_done[0]


@pytest.mark.fresh("cycle by cycle")
@pytest.mark.parametrize("gap", [0.005, 0.02, 0.04, 0.051])
@pytest.mark.parametrize("step", [0.002, 0.01, 0.03])
def test_two_steps_are_no_motion(gap: float, step: float) -> None:
    """P4: a single step is the same soon after another as after a long time, and is not passed."""

    def stepped(after: float) -> Any:
        rig = moving("posd", position_pid=Pid(kp=400.0, kd=40.0))
        start = float(rig.board.snapshot().position[0])
        assert rig.board.set_position("left", start)
        rig.run(after)
        assert rig.board.set_position("left", start + step)
        return column(rig.record(0.5), "position") - start

    travelled = stepped(gap)
    assert travelled == pytest.approx(stepped(0.3), abs=1e-6)
    assert travelled.max() < 1.1 * step


def test_velocity_is_ramped_and_integrated() -> None:
    """P5: v grows by a·dt per cycle up to its reference; its sum is the position reference."""
    rig = moving("vel", position_pid=Pid(kp=400.0, kd=40.0))
    start = float(rig.board.snapshot().position_reference[0])
    assert rig.board.velocity_move("left", 0.5, 2.0)
    shots = rig.record(0.5)
    expected = np.minimum(np.arange(1, len(shots) + 1) * 2.0 * PERIOD, 0.5)
    assert column(shots, "velocity_reference") == pytest.approx(expected)
    assert column(shots, "position_reference") == pytest.approx(
        start + np.cumsum(expected) * PERIOD
    )
    assert rig.board.set_ref_acceleration("left", 5.0)
    assert rig.board.velocity_move("left", -0.5)
    shots = rig.record(0.3)
    expected = np.maximum(0.5 - np.arange(1, len(shots) + 1) * 5.0 * PERIOD, -0.5)
    assert column(shots, "velocity_reference") == pytest.approx(expected)
    assert rig.board.velocity_move("left", 99.0, 20.0)
    assert rig.board.get_ref_velocity("left")[0] == 3.0


def test_mixed_is_the_sum() -> None:
    """P6: trajectory plus integrated velocity, in position and in velocity."""
    rig = moving("mix")
    q0 = float(rig.board.snapshot().position_reference[0])
    assert rig.board.position_move("left", q0 + 0.6, 0.6)
    assert rig.board.velocity_move("left", 0.3, 3.0)
    shots = rig.record(1.2)
    k = np.arange(1, len(shots) + 1)
    s = np.minimum(k * PERIOD, 1.0)
    velocity = np.minimum(k * 3.0 * PERIOD, 0.3)
    move = 0.6 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    assert column(shots, "position_reference") == pytest.approx(
        q0 + move + np.cumsum(velocity) * PERIOD, abs=1e-9
    )
    speed = 0.6 * (30 * s**2 - 60 * s**3 + 30 * s**4)
    assert column(shots, "velocity_reference") == pytest.approx(speed + velocity, abs=1e-9)
    assert shots[-1].motion_done[0]
    assert rig.board.get_target_position("left")[0] == pytest.approx(q0 + 0.6)


def test_a_new_move_in_mixed_keeps_the_velocity_part() -> None:
    """P6: it starts where the reference is and ends on its target once the velocity is zero."""
    rig = moving("mix")
    rig.board.velocity_move("left", 0.5, 20.0)
    rig.run(1.0)
    rig.board.velocity_move("left", 0.0, 20.0)
    before = rig.run(0.2)
    assert before.position_reference[0] > 0.45
    assert rig.board.position_move("left", 0.1, 0.5)
    shots = [before, *rig.record(1.5)]
    reference = column(shots, "position_reference")
    assert np.abs(np.diff(reference)).max() < 1.9 * 0.5 * PERIOD
    assert reference[-1] == pytest.approx(0.1, abs=1e-12)


# --- P7, P8, P10, P11: laws ------------------------------------------------------------------


def test_torque_pid_works_on_the_measured_torque() -> None:
    """P7: u = kff·τ_ref + kp·e + ∫ki·e, e = τ_ref − τ measured."""
    pid = Pid(kp=0.5, ki=10.0, kff=1.0)
    rig = held(joint("left", torque_pid=pid))
    rig.enter("torq")
    assert rig.board.set_ref_torque("left", 3.0)
    outputs = column(rig.record(0.02), "output")
    n = np.arange(1, len(outputs) + 1)
    expected = (3.0 + 0.5 * 3.0 + 10.0 * 3.0 * PERIOD * n) * PER_TORQUE
    assert outputs == pytest.approx(expected)
    rig.plant.values[Row.TORQUE] = 5.0
    step = rig.tick().output[0] - outputs[-1]
    assert step == pytest.approx((0.5 * -5.0 + 10.0 * -2.0 * PERIOD) * PER_TORQUE)
    assert rig.board.get_ref_torque("left")[0] == 3.0
    assert rig.board.set_ref_torque("left", 1000.0)
    assert rig.board.get_ref_torque("left")[0] == LIMITS.torque


def test_torque_is_reached_without_feedforward() -> None:
    """P7: the loop closes on the sensor: with integral action alone the torque arrives."""
    rig = moving("torq", torque_pid=Pid(kp=0.0, ki=30.0, kff=0.0, integral_limit=50.0))
    rig.plant.push("left", -5.0)
    rig.board.set_ref_torque("left", 5.0)
    shown = rig.run(0.4)
    assert shown.torque[0] == pytest.approx(5.0, abs=0.1)


def test_feedforward_of_the_references() -> None:
    """P7, P10, M9: kff acts in every loop, and nothing jumps when the loop takes over."""
    slow = {"integral_limit": 50.0, "ki": 1e-9}
    rig = held(joint("left", position_pid=Pid(kp=100.0, kff=20.0, **slow)))
    rig.plant.values[Row.POSITION], rig.plant.values[Row.TORQUE] = 0.1, 4.0
    rig.tick(3)
    rig.enter("posd")
    assert rig.tick().output[0] == pytest.approx(4.0 * PER_TORQUE, rel=1e-6)
    assert rig.board.set_position("left", 0.15)
    assert rig.run(1.0).output[0] == pytest.approx((4.0 + 120.0 * 0.05) * PER_TORQUE, rel=1e-6)
    for kff in (0.0, 0.5, 1.0):
        rig = held(joint("left", torque_pid=Pid(kp=2.0, kff=kff, **slow)))
        rig.plant.values[Row.TORQUE] = 4.0
        rig.tick(3)
        rig.enter("torq")
        assert rig.tick().output[0] == pytest.approx(4.0 * PER_TORQUE, rel=1e-6)
        assert rig.board.set_ref_torque("left", 5.0)
        assert rig.tick().output[0] == pytest.approx((6.0 + kff) * PER_TORQUE, rel=1e-6)
    changes = {"position_pid": ONLY_P, "current_pid": Pid(kp=0.0, kff=2.0)}
    rig = held(joint("left", **changes), output="current")
    rig.enter("posd")
    assert rig.board.set_position("left", 0.05)  # 5 N·m: 1 A
    volts = 1.0 * MOTOR.resistance + 2.0 * 1.0
    assert rig.run(1.0).output[0] == pytest.approx(volts / 48.0 * 100.0)


@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_open_loop_is_the_given_pwm(output: str, interaction: Any) -> None:
    """P8, P10, I2: the PWM that was given, whatever is measured, bounded by the joint's limit."""
    rig = held(joint("left", limits={"output": 40.0}), output=output)
    rig.board.set_interaction_mode("left", interaction)
    rig.enter("open")
    assert rig.tick().output[0] == 0.0
    rig.board.set_output("left", 12.5)
    rig.plant.values[Row.TORQUE] = 1.0
    rig.plant.values[Row.CURRENT] = 2.0
    assert rig.tick().output[0] == 12.5
    rig.board.set_output("left", -99.0)
    assert rig.tick().output[0] == -40.0
    assert rig.board.get_output("left")[0] == -40.0


@pytest.mark.parametrize("mode", POSITION_MODES, ids=str)
def test_position_pid(mode: ControlMode) -> None:
    """I5, P10: stiff: u = kp·e + ∫ki·e + kd·ė on the position, as a PWM."""
    pid = Pid(kp=100.0, ki=50.0, kd=10.0, derivative_cutoff=1e6)
    direct = Pid(kp=200.0, ki=0.0, kd=0.0)
    rig = held(joint("left", position_pid=pid, direct_pid=direct, back_emf_compensation=0.0))
    rig.enter(mode)
    base = rig.tick().output[0]
    rig.plant.values[Row.POSITION] = -0.01
    rig.plant.values[Row.VELOCITY] = -0.2
    first, second = rig.tick().output[0], rig.tick().output[0]
    if mode is M.POSITION_DIRECT:  # the second set of gains
        assert first - base == pytest.approx(200.0 * 0.01 * PER_TORQUE)
        assert second == pytest.approx(first)
    else:
        torque = 100.0 * 0.01 + 50.0 * 0.01 * PERIOD + 10.0 * 0.2
        assert first - base == pytest.approx(torque * PER_TORQUE, rel=1e-6)
        assert second - first == pytest.approx(50.0 * 0.01 * PERIOD * PER_TORQUE, rel=1e-4)


def test_integral_is_clamped_and_does_not_wind_up() -> None:
    """I5: the integral part keeps its limit, and stops growing while the output is cut."""
    clamped = Pid(kp=0.0, ki=1000.0, integral_limit=3.0)
    rig = held(joint("left", position_pid=clamped))
    rig.enter("pos")
    rig.plant.values[Row.POSITION] = -0.03
    assert rig.tick(200).output[0] == pytest.approx(3.0 * PER_TORQUE)
    rig.plant.values[Row.POSITION] = 0.0
    rig.tick()
    rig.plant.values[Row.POSITION] = 0.03
    assert rig.tick(400).output[0] == pytest.approx(-3.0 * PER_TORQUE)
    for changes in ({"limits": {"torque": 5.0}}, {"limits": {"output": 5.0 * PER_TORQUE}}):
        rig = held(joint("left", position_pid=Pid(kp=10.0, ki=1000.0), **changes))
        rig.enter("pos")
        rig.plant.values[Row.POSITION] = -0.03
        assert rig.tick(500).output[0] == pytest.approx(5.0 * PER_TORQUE)
        rig.plant.values[Row.POSITION] = 0.0
        # What is left is at most what was below the bound: 5 N·m, not 500 · 0.06.
        assert rig.tick(1).output[0] <= 5.0 * PER_TORQUE
        rig.plant.values[Row.POSITION] = 0.03
        assert rig.tick(120).output[0] < 0.0


def test_current_output() -> None:
    """P10: with a current output the PWM is what makes the measured current the wanted one."""
    changes = {"position_pid": ONLY_P, "current_pid": Pid(kp=0.5, ki=0.0)}
    rigs = {kind: held(joint("left", **changes), output=kind) for kind in ("pwm", "current")}
    for rig in rigs.values():
        rig.enter("pos")
        rig.plant.values[Row.POSITION] = -0.025
        rig.tick(2)
        rig.plant.values[Row.POSITION] = -0.05  # 5 N·m: 1 A
        rig.tick(2)
    assert rigs["pwm"].tick().output[0] == pytest.approx(5.0 * PER_TORQUE)
    volts = 1.0 * MOTOR.resistance + 0.5 * 1.0
    assert rigs["current"].tick().output[0] == pytest.approx(volts / 48.0 * 100.0)
    for rig in rigs.values():
        rig.plant.values[Row.CURRENT] = 1.0
    assert rigs["pwm"].tick().output[0] == pytest.approx(5.0 * PER_TORQUE)
    assert rigs["current"].tick().output[0] == pytest.approx(1.0 / 48.0 * 100.0)


@pytest.mark.fresh("within 0.1 s")
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_current_output_moves_the_joint(interaction: Any) -> None:
    """P10: with an inner current loop the joint tracks as with a PWM."""
    rig = ready(board_config(joint("left"), output="current"))
    rig.board.set_interaction_mode("left", interaction)
    rig.board.set_impedance("left", 500.0, 40.0)
    rig.enter("pos")
    rig.board.position_move("left", 0.8, 0.8)
    shown = rig.run(3.0)
    assert shown.position[0] == pytest.approx(0.8, abs=0.01)
    rig.enter("torq")
    rig.plant.push("left", -4.0)
    rig.board.set_ref_torque("left", 4.0)
    shown = rig.run(0.1)
    assert shown.current[0] == pytest.approx(4.0 / 5.0, rel=0.05)


def test_current_stays_below_the_peak() -> None:
    """P10, F1: a current reference never asks for what would be an overcurrent."""
    limits = {"torque": 500.0, "peak_current": 20.0}
    rig = held(joint("left", limits=limits, current_pid=Pid(kp=0.0)), output="current")
    rig.enter("posd")
    rig.board.set_position("left", 1.9)
    volts = rig.run(2.0).output[0] * 48.0 / 100.0
    assert 0.9 * 20.0 < volts / MOTOR.resistance < 20.0


@pytest.mark.parametrize("mode", STANDARD, ids=str)
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_output_feedforward(mode: ControlMode, interaction: Any) -> None:
    """P11: u_ff adds to the output in all active modes, at once; not where there is no power."""
    rig = held(joint("left"))
    rig.board.set_interaction_mode("left", interaction)
    rig.enter(mode)
    base = rig.tick().output[0]
    assert rig.board.set_feedforward("left", outputs=2.5)
    change = rig.tick().output[0] - base
    assert change == pytest.approx(0.0 if mode is M.IDLE else 2.5)


@pytest.mark.parametrize("mode", STANDARD, ids=str)
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_torque_feedforward(mode: ControlMode, interaction: Any) -> None:
    """P11, I5: τ_ff is part of the impedance torque, and acts in COMPLIANT only."""
    rig = held(joint("left"))
    rig.board.set_interaction_mode("left", interaction)
    rig.enter(mode)
    rig.tick()
    assert rig.board.set_feedforward("left", torques=2.0)
    shown = rig.tick()
    acts = mode in POSITION_MODES and interaction is COMPLIANT
    assert shown.torque_reference[0] == pytest.approx(2.0 if acts else 0.0)
    assert bool(shown.output[0]) is acts


def test_feedforward_values() -> None:
    """P11, P13: not finite or of a wrong length is ignored with the reason, and counted."""
    rig = held(joint("left"), joint("right"))
    rig.enter("open")
    reply = rig.board.set_feedforward(None, outputs=[math.nan, 1.0])
    assert not reply
    assert "not a finite number" in reply.message
    assert not rig.board.set_feedforward(None, outputs=[1.0, 1.0, 1.0])
    assert not rig.board.set_feedforward(None)
    before = rig.board.get_torque_offset().tolist()
    assert not rig.board.set_feedforward("left", "much")
    assert not rig.board.set_feedforward("left", 2.0, torques=-math.inf)
    assert rig.board.get_torque_offset().tolist() == before
    shown = rig.tick()
    assert shown.output.tolist() == [0.0, 1.0]
    assert shown.rejected_commands.tolist() == [5, 2]
    rig.board.set_feedforward(None, outputs=1000.0)
    assert rig.tick().output.tolist() == [100.0, 100.0]


# --- P9: limits ------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1e308, -1e308, 1e6, 5e-324, -5e-324])
@pytest.mark.parametrize("kind", COMMANDS)
def test_finite_values_of_any_size(kind: str, value: float) -> None:
    """P9, P13: the largest end at the joint's limits, the smallest are taken, none overflows."""
    rig = ready(board_config(joint("left")))
    rig.enter(MODE_OF[kind])
    method, getter, _ = COMMANDS[kind]
    assert getattr(rig.board, method)("left", value)
    bound = {"velocity": LIMITS.velocity, "torque": LIMITS.torque, "output": LIMITS.output}
    most = bound.get(kind, LIMITS.upper)
    assert getattr(rig.board, getter)("left")[0] == min(max(value, -most), most)
    for snapshot in rig.record(1.0):
        assert finite(snapshot)
        assert abs(snapshot.position[0]) <= (LIMITS.hard_upper if abs(value) > 1.0 else 0.02)


@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize("mode", POSITION_MODES, ids=str)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_position_references_stay_inside(mode: ControlMode, interaction: Any, way: float) -> None:
    """P9: software limits bound every position reference in every mode."""
    rig = moving(mode.code)
    rig.board.set_interaction_mode("left", interaction)
    rig.board.position_move("left", way * 1.9, 3.0)
    rig.board.set_position("left", way * 9.0)
    rig.board.velocity_move("left", way * 3.0, 20.0)
    shots = rig.record(3.0)
    if mode is M.MIXED:
        rig.board.position_move("left", way * 9.0, 1.0)
        assert rig.board.get_target_position("left")[0] == way * 2.0
        shots += rig.record(1.0)
    reference = column(shots, "position_reference")
    assert np.all(np.abs(reference) <= 2.0)
    assert way * reference[-1] == pytest.approx(1.9 if mode is M.POSITION else 2.0)
    assert rig.modes() == [mode]


def test_a_limit_ends_motion_against_it() -> None:
    """P9, P5: held back by a limit, the velocity is zero; away from it the joint goes at once."""
    rig = moving("vel")
    rig.board.velocity_move("left", 3.0, 20.0)
    shots = rig.record(1.5)
    reference, velocity = (column(shots, f"{what}_reference") for what in ("position", "velocity"))
    assert reference[-1] == pytest.approx(2.0, abs=1e-12)
    assert np.abs(velocity[reference > 2.0 - 1e-9])[1:].max() < 1e-6
    # P14: it brakes ahead, within the acceleration limit, and arrives at rest.
    assert np.abs(np.diff(velocity)).max() <= LIMITS.acceleration * PERIOD * (1 + 1e-9)
    rig.board.velocity_move("left", -1.0, 20.0)
    shown = rig.run(0.1)
    assert shown.position_reference[0] < 1.97


def carry(rig: Rig, place: float) -> None:
    """Move the plant's joint to a place by hand, at 1 rad/s."""
    start, step = float(rig.plant.values[Row.POSITION][0]), rig.board.period
    for k in range(1, round(abs(place - start) / step) + 1):
        rig.plant.values[Row.POSITION] = start + math.copysign(k * step, place - start)
        rig.tick()
    rig.plant.values[Row.POSITION] = place


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("mode", "interaction"),
    [(M.TORQUE, STIFF), (M.OPENLOOP, COMPLIANT), *((m, COMPLIANT) for m in POSITION_MODES)],
    ids=str,
)
@pytest.mark.parametrize("output", ["pwm", "current"])
def test_protection_at_the_limits(
    mode: ControlMode, interaction: Any, way: float, output: str
) -> None:
    """P9: the output may not drive a joint further out: it is pushed back; a warning; the mode
    is unchanged.
    """
    rig = held(joint("left"), output=output)
    rig.board.set_interaction_mode("left", interaction)
    rig.plant.values[Row.POSITION] = 2.0 * way
    rig.board.power_cycle()
    rig.tick(2)
    rig.board.set_interaction_mode("left", interaction)
    rig.enter(mode)
    carry(rig, 2.02 * way)
    rig.board.take_events()
    rig.board.set_ref_torque("left", way * 10.0)
    rig.board.set_output("left", way * 10.0)
    rig.board.set_feedforward("left", torques=way * 10.0, outputs=way * 5.0)
    shown = rig.tick(3)
    assert way * shown.output[0] < 0.0
    assert rig.modes() == [mode]
    # Inwards it may drive with all it has.
    rig.board.set_ref_torque("left", way * -30.0)
    rig.board.set_output("left", way * -30.0)
    rig.board.set_feedforward("left", torques=way * -30.0, outputs=way * -30.0)
    assert way * rig.tick(3).output[0] < -20.0


@pytest.mark.parametrize("mode", ["torq", "open"])
def test_far_from_its_limits_torque_is_not_reduced(mode: str) -> None:
    """P9, P14: slow and with room, the joint gets what its law asks for."""
    rig = held(joint("left", torque_pid=Pid(kp=0.0, kff=1.0), back_emf_compensation=0.0))
    rig.enter(mode)
    rig.plant.values[Row.VELOCITY] = 0.8
    rig.board.set_ref_torque("left", 100.0)
    rig.board.set_output("left", 60.0 * PER_TORQUE)
    assert rig.tick(2).output[0] == pytest.approx(60.0 * PER_TORQUE)


def test_one_warning_for_each_time_at_a_limit() -> None:
    """P9: it repeats when the joint has left the limit, not while it trembles there."""
    rig = held(joint("left"))
    rig.enter("torq")
    warnings = []
    for start, end in pairwise((0.0, 1.9, 2.01, 1.995, 2.01, 1.9, 2.01)):
        for position in np.linspace(start, end, 200):
            rig.plant.values[Row.POSITION] = position
            rig.tick()
        warnings.append(len([text for text in rig.warnings() if "software limits" in text]))
    assert warnings == [0, 1, 0, 0, 0, 1]


@pytest.mark.parametrize("mode", ["torq", "open", "pos"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_driven_against_a_limit(mode: str, way: float) -> None:
    """P9: driven outwards a joint comes to rest at its limit, and a warning says so."""
    rig = moving(mode)
    rig.board.set_interaction_mode("left", COMPLIANT)
    rig.board.take_events()
    rig.board.set_feedforward("left", torques=way * 25.0)
    rig.board.set_impedance("left", 10.0, 5.0)
    rig.board.set_ref_torque("left", way * 10.0)
    rig.board.set_output("left", way * 8.0)
    shots = rig.record(8.0)
    position = way * column(shots, "position")
    assert position.max() < 2.1
    assert position[-1] == pytest.approx(2.0, abs=0.03)
    assert np.abs(column(shots[-100:], "velocity")).max() < 0.02
    assert rig.modes()[0].code == mode
    assert any("software limits" in text for text in rig.warnings())


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_joint_found_outside(way: float) -> None:
    """P9, M9: a joint found outside its limits may stay or go inwards, never further out."""
    rig = ready(board_config(joint("left")), home=[2.1 * way])
    rig.enter("posd")
    shown = rig.run(0.5)
    assert shown.position_reference[0] == pytest.approx(2.1 * way)
    assert shown.position[0] == pytest.approx(2.1 * way, abs=1e-3)
    rig.board.set_position("left", 2.15 * way)
    assert rig.tick().position_reference[0] == 2.0 * way
    rig.enter("vel")
    rig.board.velocity_move("left", way, 20.0)
    here = rig.board.snapshot().position_reference[0]
    assert rig.run(0.1).position_reference[0] == pytest.approx(here, abs=1e-9)
    rig.board.velocity_move("left", -way, 20.0)
    rig.run(0.15)
    assert rig.board.snapshot().position_reference[0] * way < here * way


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize("mode", ACTIVE, ids=str)
def test_a_joint_found_outside_moves_only_when_asked(
    mode: ControlMode, interaction: Any, way: float
) -> None:
    """P16: it rests where it was found; only what drives it inwards moves it."""
    rig = ready(board_config(joint("left")), home=[2.1 * way])
    rig.board.set_interaction_mode("left", interaction)
    rig.enter(mode)
    assert rig.run(1.0).position[0] == pytest.approx(2.1 * way, abs=1e-3)
    for sign in (1.0, -1.0):
        force(rig, mode, sign * way)
        shots = rig.record(0.3)
        assert (way * column(shots, "position")).max() < 2.1 + 1e-3
    assert way * shots[-1].position[0] < 2.1 - 5e-3


def force(rig: Rig, mode: ControlMode, way: float) -> None:
    """A command that would drive the joint by 0.5 rad and more in a direction, ±1."""
    here = float(rig.board.snapshot().position[0])
    board = rig.board
    if mode in (M.POSITION, M.MIXED):
        board.position_move("left", here + 0.5 * way, speeds=1.0)
    elif mode is M.POSITION_DIRECT:
        board.set_position("left", here + 0.5 * way)
    elif mode is M.VELOCITY:
        board.velocity_move("left", way, 20.0)
    elif mode is M.VELOCITY_DIRECT:
        board.set_velocity("left", way)
    elif mode is M.CURRENT:
        board.set_current("left", way)
    elif mode is M.TORQUE:
        board.set_ref_torque("left", 5.0 * way)
    else:
        board.set_output("left", 10.0 * way)


@pytest.mark.fresh("a slower loop overshoots by a fifth")
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_direct_position_comes_in_at_the_reference_speed(way: float) -> None:
    """P16: until the joint is inside its limits; then as fast as they allow (P4)."""
    rig = ready(board_config(joint("left")), home=[2.15 * way])
    rig.board.set_ref_speed("left", 0.3)
    rig.enter("posd")
    rig.board.set_position("left", 0.0)
    shots = rig.record(2.0)
    outside = way * column(shots, "position") > 2.0
    assert np.abs(column(shots, "velocity")[outside]).max() <= 1.1 * 0.3
    assert outside.sum() * rig.board.period == pytest.approx(0.15 / 0.3, rel=0.2)
    assert np.abs(column(shots, "velocity")).max() > 1.0


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("mode", [M.VELOCITY, M.MIXED], ids=str)
@pytest.mark.parametrize("inwards", [0.05, 0.3])
def test_a_joint_that_came_back_in(inwards: float, mode: ControlMode, way: float) -> None:
    """P9: the bound of a joint found outside follows it inwards: it does not go out again."""
    lasting = joint("left", timeouts=NEVER)
    rig = ready(board_config(lasting), home=[2.15 * way])
    rig.enter(mode)
    rig.board.velocity_move("left", -0.5 * way, 20.0)
    rig.run(inwards / 0.5)
    assert rig.board.stop("left")
    reached = rig.run(0.5).position_reference[0] * way
    assert reached < 2.15 - 0.5 * inwards
    rig.board.velocity_move("left", 0.5 * way, 20.0)
    outermost = (column(rig.record(1.0), "position_reference") * way).max()
    assert outermost == pytest.approx(max(reached, 2.0), abs=5e-3)  # as far as it may


def test_speed_limit_where_no_position_loop_is() -> None:
    """P9: in TORQUE and OPENLOOP the output does not drive a joint beyond its speed."""
    wide = {"lower": -90.0, "upper": 90.0, "hard_lower": -99.0, "hard_upper": 99.0}
    for mode in ("torq", "open"):
        rig = moving(mode, limits=wide)
        rig.board.set_ref_torque("left", 10.0)
        rig.board.set_output("left", 40.0)
        shots = rig.record(3.0)
        assert column(shots, "velocity").max() < 1.05 * LIMITS.velocity
        assert column(shots, "velocity")[-1] > 0.9 * LIMITS.velocity


@pytest.mark.parametrize("mode", ACTIVE, ids=str)
@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_output_keeps_its_limit(mode: ControlMode, output: str, way: float) -> None:
    """P10, N2: the output stays within the joint's maximum output."""
    rig = held(joint("left", limits={"output": 7.0}, back_emf_compensation=0.0), output=output)
    rig.enter(mode)
    rig.board.set_ref_torque("left", way * 60.0)
    rig.board.set_output("left", way * 50.0)
    rig.plant.values[Row.POSITION] = -0.03 * way
    rig.plant.values[Row.VELOCITY] = -2.0 * way
    shots = rig.record(0.2)
    assert (way * column(shots, "output")).max() == pytest.approx(7.0)
    assert np.abs(column(shots, "output")).max() == pytest.approx(7.0)


# --- P12: timeouts ---------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["vel", "mix"])
def test_a_velocity_expires(mode: str) -> None:
    """P12: 0.2 s after the last accepted velocity the joint stops and holds; no fault."""
    rig = ready(board_config(joint("left")))
    rig.enter(mode)
    assert rig.board.velocity_move("left", 0.5, 20.0)
    rig.run(0.1)
    assert not rig.board.velocity_move("left", math.nan)
    assert rig.board.velocity_move("left", 0.5, 20.0)
    shots = rig.record(0.4)
    velocity = column(shots, "velocity_reference")
    assert np.all(velocity[:100] == 0.5)
    assert np.all(velocity[100:112] < 0.5)
    assert velocity[100] == pytest.approx(0.5 - LIMITS.acceleration * PERIOD)
    assert velocity[120] == 0.0
    hold = shots[-1].position_reference[0]
    assert rig.run(1.0).position_reference[0] == hold
    assert rig.modes()[0].code == mode
    assert not rig.board.get_faults("left")[0].active
    assert rig.board.velocity_move("left", 0.5, 20.0)
    assert rig.tick(50).velocity_reference[0] == 0.5


def test_a_position_move_does_not_prolong_a_velocity() -> None:
    """P12: in MIXED a timeout runs from the last accepted velocity, whatever else comes."""
    rig = ready(board_config(joint("left")))
    rig.enter("mix")
    assert rig.board.velocity_move("left", 0.5, 20.0)
    rig.run(0.15)
    assert rig.board.position_move("left", 0.1, 1.0)
    rig.run(0.5)
    end = rig.board.snapshot().position_reference[0]
    assert rig.run(0.5).position_reference[0] == end
    assert rig.board.snapshot().velocity_reference[0] == 0.0


def test_timeouts_off() -> None:
    """P12, Y2: 0 is never, and the default of all but velocities."""
    rig = moving("vel", control_modes=(*STANDARD, M.CURRENT))
    rig.board.velocity_move("left", 0.1, 20.0)
    assert rig.run(5.0).velocity_reference[0] == 0.1
    for mode, method, value in (
        ("torq", "set_ref_torque", 0.1),
        ("open", "set_output", 0.5),
        ("icur", "set_ref_current", 0.1),
    ):
        rig.enter(mode)
        getattr(rig.board, method)("left", value)
        rig.run(2.0)
        assert rig.modes()[0].code == mode


@pytest.mark.parametrize(
    ("mode", "method", "key"),
    [
        ("torq", "set_ref_torque", "torque"),
        ("open", "set_output", "output"),
        ("icur", "set_ref_current", "current"),
    ],
)
def test_torques_outputs_and_currents_that_expire_fault(mode: str, method: str, key: str) -> None:
    """P12, Y2, F1: the expiry of such a reference is the fault "reference timeout"."""
    timeouts = replace(NEVER, **{key: 0.1})
    one = joint("left", control_modes=(*STANDARD, M.CURRENT), timeouts=timeouts)
    rig = ready(board_config(one))
    rig.enter(mode)
    rig.run(0.5)  # without a reference nothing expires
    for _ in range(3):
        assert getattr(rig.board, method)("left", 1.0)
        rig.tick(50)
        assert rig.modes()[0].code == mode
    shown = rig.tick()
    assert rig.modes() == [M.HW_FAULT]
    assert shown.output[0] == 0.0
    fault = rig.board.get_faults("left")[0]
    assert fault.code == 21
    assert fault.text.startswith("reference timeout")
    rig.board.set_control_mode("left", "fidl")
    rig.enter(mode)
    rig.run(0.5)
    assert rig.modes()[0].code == mode


def test_references_bring_a_timeout_of_their_own() -> None:
    """P12: ``valid_for`` acts instead of the joint's timeout, until a reference without it."""
    rig = ready(board_config(joint("left", timeouts=NEVER)))
    rig.enter("open")
    assert rig.board.command(CommandKind.OUTPUT, "left", 1.0, valid_for=0.1)
    rig.tick(50)
    assert rig.modes() == [M.OPENLOOP]
    rig.board.reconfigure(rig.board.config)  # settings leave it as it is
    rig.tick()
    assert rig.modes() == [M.HW_FAULT]
    assert rig.board.get_faults("left")[0].text.startswith("reference timeout")
    rig.board.set_control_mode("left", "fidl")
    rig.enter("open")
    assert rig.board.command(CommandKind.OUTPUT, "left", 1.0, valid_for=0.1)
    assert rig.board.set_output("left", 1.0)
    rig.run(0.5)
    assert rig.modes() == [M.OPENLOOP]


def test_a_held_velocity_stops_and_holds() -> None:
    """P12: with ``valid_for``, where velocities never expire."""
    rig = ready(board_config(joint("left", timeouts=NEVER)))
    rig.enter("vel")
    assert rig.board.command(CommandKind.VELOCITY, "left", 0.5, 5.0, valid_for=0.3)
    rig.run(0.3)
    assert rig.board.snapshot().velocity_reference[0] == 0.5
    rig.run(0.2)
    assert rig.board.snapshot().velocity_reference[0] == 0.0
    assert rig.modes() == [M.VELOCITY]


@pytest.mark.parametrize(
    ("kind", "valid_for", "text"),
    [
        (CommandKind.OUTPUT, -1.0, "valid_for must be 0 or a time in s, not -1"),
        (CommandKind.OUTPUT, float("nan"), "not nan"),
        (CommandKind.TORQUE, float("inf"), "not inf"),
        (CommandKind.POSITION, 0.3, "does not expire"),
    ],
)
def test_a_timeout_that_is_none_is_refused(kind: CommandKind, valid_for: float, text: str) -> None:
    """P12, M7: before anything acts."""
    rig = ready(board_config(joint("left", timeouts=NEVER)))
    rig.enter("open")
    reply = rig.board.command(kind, "left", 1.0, valid_for=valid_for)
    assert not reply
    assert text in reply.message
    assert rig.board.get_output("left")[0] == 0.0


def test_a_mode_change_ends_the_timeout() -> None:
    """P12, M9: a reference of a mode that was left cannot expire."""
    rig = ready(board_config(joint("left", timeouts=replace(NEVER, torque=0.1))))
    rig.enter("torq")
    rig.board.set_ref_torque("left", 1.0)
    rig.board.set_control_mode("left", "open")
    rig.board.set_control_mode("left", "torq")
    rig.run(0.5)
    assert rig.modes() == [M.TORQUE]


# --- P13 -------------------------------------------------------------------------------------


LEFT, BOTH, ALL = [1, 0, 0], [1, 1, 0], [1, 1, 1]
NAMES = ["left", "right"]
#: Joints and values, words of the answer, and the joints that count it; more of them are in
#: test/core/test_selection.py.
MALFORMED = [
    (None, [1.0, 2.0], "2 .* for 3 joints", ALL),
    ((), [[1.0, 2.0], [3.0]], "must be numbers", ALL),
    (NAMES, [], "0 .* for 2 joints", BOTH),
    ("left", [1.0, 1.0], "2 .* for 1 joint", LEFT),
    ("left", "\ud800", "must be numbers", LEFT),
    (["left", "rigth"], [1.0, 1.0], "'rigth' unknown; did you mean 'right'", LEFT),
    (["left", ["x"]], [1.0, 1.0], "unknown", LEFT),
    (["left", "x" * 10_000], [1.0, 1.0], "unknown", LEFT),
    (["left", 3], [1.0, 1.0], "out of range; joints are 0 to 2", LEFT),
    (["right", "right"], [1.0, 1.0], "named twice", [0, 1, 0]),
    ("nose", 1.0, "unknown", [0, 0, 0]),
    (7, 1.0, "out of range", [0, 0, 0]),
]


@pytest.mark.parametrize(("joints", "values", "words", "counts"), MALFORMED)
@pytest.mark.parametrize("kind", list(COMMANDS))
def test_malformed_commands(
    kind: str, joints: Any, values: Any, words: str, counts: list[int]
) -> None:
    """P13, M7: rejected as a whole with one line; the joints that it names count it."""
    rig = ready()
    rig.enter(MODE_OF[kind], NAMES)
    before = rig.everything()
    reply = getattr(rig.board, COMMANDS[kind][0])(joints, values)
    assert not reply
    assert reply.message.startswith(f"{kind} reference ignored: ")
    assert "\n" not in reply.message
    assert len(reply.message) < 400
    assert re.search(words, reply.message), reply.message
    assert rig.board.snapshot().rejected_commands.tolist() == counts
    assert rig.everything() == before


# --- P15: a command that repeats ---------------------------------------------------------------


def arrival(rate: float, kind: CommandKind = CommandKind.POSITION, target: float = 1.5) -> float:
    """S until a move arrives whose command is repeated at a rate, Hz; 0: sent once."""
    rig = held(joint("left", reference_speed=0.5))
    rig.enter("mix")
    every = round(RATE / rate) if rate else 10**9
    for cycle in range(round(8.0 * RATE)):
        if cycle % every == 0:
            assert rig.board.command(kind, "left", target)
        shown = rig.tick()
        if shown.motion_done[0]:
            assert shown.position_reference[0] == min(target, LIMITS.upper)
            return cycle / RATE
    return math.inf


@pytest.mark.parametrize("rate", [1.0, 10.0, 50.0, RATE])
@pytest.mark.parametrize("target", [1.5, 9.0])
def test_a_repeated_command_is_no_new_move(rate: float, target: float) -> None:
    """P15: it arrives when the first one would have, bounded by a limit as well."""
    assert arrival(rate, target=target) == arrival(0.0, target=target) < 5.0


def test_a_repeated_command_stays_done() -> None:
    """P15, P3: at its target nothing starts; after a stop it is a new move."""
    rig = held(joint("left", reference_speed=0.5))
    rig.enter("pos")
    assert rig.board.position_move("left", 0.1)
    rig.run(1.0)
    assert rig.board.position_move("left", 0.1)
    assert rig.board.snapshot().motion_done[0]
    assert rig.board.position_move("left", 0.5)
    rig.run(0.3)
    assert rig.board.stop()
    assert rig.board.position_move("left", 0.5)
    rig.run(2.0)
    assert rig.board.snapshot().position_reference[0] == 0.5


def test_another_speed_is_another_move() -> None:
    """P15, P1: also the set one; of several joints those start that differ."""
    rig = held(joint("left", reference_speed=0.5), joint("right", reference_speed=0.5))
    rig.enter("pos")
    assert rig.board.position_move(None, 1.0)
    rig.run(0.5)
    before = rig.board.engine.references.remaining(np.array([0, 1]))
    assert rig.board.position_move(None, 1.0, [0.5, 0.1])
    after = rig.board.engine.references.remaining(np.array([0, 1]))
    assert after[0] == before[0]
    assert after[1] > before[1] + 2.0
