# SPDX-License-Identifier: Apache-2.0
"""Motion that an engineer trusts: what once ran away, sagged, struck stops or misreported."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.config.config import JointConfig, Pid
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.simulation import Simulation

pytestmark = pytest.mark.physics


def up(name: str, **values: object) -> Simulation:
    """A robot that holds its home pose."""
    simulation = Simulation.load(name, **values)
    simulation.run(1.0)
    assert set(simulation.board.get_control_mode()) == {M.POSITION}
    return simulation


@pytest.fixture
def panda() -> Iterator[Simulation]:
    with up("panda") as simulation:
        yield simulation


@pytest.fixture
def iiwa() -> Iterator[Simulation]:
    with up("iiwa") as simulation:
        yield simulation


def speeds(simulation: Simulation, j: int, seconds: float) -> np.ndarray:
    """Measured speeds of a joint in each cycle, shape (cycles,)."""
    found = []
    for _ in range(round(seconds * 1000)):
        simulation.step()
        found.append(simulation.board.get_encoder_speed(j)[0])
    return np.array(found)


def changed(simulation: Simulation, j: int, change: Any) -> None:
    """Let the configuration of a joint be another one, while it runs."""
    config = simulation.board.config
    joints = [change(one) if k == j else one for k, one in enumerate(config.joints)]
    simulation.board.reconfigure(replace(config, joints=tuple(joints)))


# --- speed and limits (P14) -------------------------------------------------------------------


@pytest.mark.parametrize("j", [0, 3, 5])
def test_a_velocity_into_a_limit_ends_there_at_rest(panda: Simulation, j: int) -> None:
    """P14, P9: it brakes ahead of the limit; once it struck the stop at 2 rad/s."""
    board, limits = panda.board, panda.board.config.joints[j].limits
    assert board.set_control_mode(j, "vel")
    panda.step()
    for _ in range(60):
        assert board.velocity_move(j, limits.velocity, limits.acceleration)
        panda.run(0.1)
    assert board.get_encoder(j)[0] == pytest.approx(limits.upper, abs=2e-3)
    assert board.get_encoder(j)[0] < limits.upper + 2e-3
    assert abs(board.get_encoder_speed(j)[0]) < 1e-2
    assert board.get_control_mode(j) == [M.VELOCITY]


@pytest.mark.parametrize("name", ["iiwa", "panda"])
def test_a_full_direct_step_keeps_the_speed_limit(name: str) -> None:
    """P14: once a direct step drove a joint at 2.3 times its limit."""
    with up(name) as simulation:
        board = simulation.board
        for j in range(7):
            limits = board.config.joints[j].limits
            assert board.set_control_mode(j, "posd")
            simulation.step()
            assert board.set_position(j, 0.8 * limits.upper + 0.2 * limits.lower)
            assert np.abs(speeds(simulation, j, 1.0)).max() <= 1.05 * limits.velocity, j
            board.set_control_mode(j, "pos")


def test_a_formerly_blocked_joint_resumes_its_speed(iiwa: Simulation) -> None:
    """P14: held back for 2 s and freed, it once shot off at 2.5 times its limit."""
    board, j = iiwa.board, 0
    limits = board.config.joints[j].limits
    assert board.position_move(j, 1.5, 0.7)
    for _ in range(2000):  # a hand that lets nothing through
        iiwa.plant.push(j, -1.5 * limits.torque if board.get_encoder(j)[0] > 0.02 else 0.0)
        iiwa.step()
    iiwa.plant.push(j, 0.0)
    after = speeds(iiwa, j, 3.0)
    assert np.abs(after).max() <= 1.05 * limits.velocity
    assert board.get_encoder(j)[0] == pytest.approx(1.5, abs=1e-3)


def test_mixed_adds_up_to_no_more_than_the_speed_limit(iiwa: Simulation) -> None:
    """P14, P6: a move and a velocity once added up to 2.9 rad/s where 1.5 is the limit."""
    board, j = iiwa.board, 0
    limits = board.config.joints[j].limits
    assert board.set_control_mode(j, "mix")
    iiwa.step()
    board.position_move(j, 1.5, 0.79)
    fastest = 0.0
    for _ in range(20):
        board.velocity_move(j, limits.velocity, limits.acceleration)
        fastest = max(fastest, float(np.abs(speeds(iiwa, j, 0.1)).max()))
    assert 0.9 * limits.velocity < fastest <= 1.05 * limits.velocity


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_torques_do_not_drive_a_joint_beyond_speed_or_limit(panda: Simulation, way: float) -> None:
    """P14, P9: all the torque there is, from rest, ends at the limit without passing it."""
    board, j = panda.board, 0
    limits = board.config.joints[j].limits
    assert board.set_control_mode(j, "torq")
    panda.step()
    board.set_ref_torque(j, way * limits.torque)
    found = speeds(panda, j, 4.0)
    assert np.abs(found).max() <= 1.05 * limits.velocity
    edge = limits.upper if way > 0 else limits.lower
    assert board.get_encoder(j)[0] == pytest.approx(edge, abs=0.02)
    assert abs(found[-100:]).max() < 0.02


# --- moves (P1) -------------------------------------------------------------------------------


def test_a_move_of_a_milliradian_keeps_the_acceleration_limit(iiwa: Simulation) -> None:
    """P1: T is as long as the acceleration needs, and the reply says so."""
    board, j = iiwa.board, 1
    limits = board.config.joints[j].limits
    here = float(board.get_encoder(j)[0])
    reply = board.position_move(j, here + 1e-3, limits.velocity)
    assert reply
    assert "was requested" in reply.message
    assert reply.reasons[0] == reply.message
    velocity = [0.0]
    for _ in range(100):
        iiwa.step()
        velocity.append(board.snapshot().velocity_reference[j])
    assert np.abs(np.diff(velocity)).max() * 1000.0 <= 1.01 * limits.acceleration
    assert board.get_encoder(j)[0] == pytest.approx(here + 1e-3, abs=1e-4)


@pytest.mark.parametrize("stride", [1, 10])
def test_a_sine_by_direct_positions(panda: Simulation, stride: int) -> None:
    """P4: at 1 kHz and at 100 Hz it is followed within 3 % of its amplitude, once it was 30 %."""
    board, j, amplitude, rate = panda.board, 3, 0.1, 2.0 * math.pi
    assert board.set_control_mode(j, "posd")
    panda.step()
    start, worst = float(board.get_encoder(j)[0]), 0.0
    for k in range(3000):
        if k % stride == 0:
            board.set_position(j, start + amplitude * math.sin(rate * k * 1e-3))
        panda.step()
        wanted = start + amplitude * math.sin(rate * k * 1e-3)
        if k > 1000:
            worst = max(worst, abs(float(board.get_encoder(j)[0]) - wanted))
    assert worst <= 0.03 * amplitude


# --- the load is taken over (M9, I10, P11) -----------------------------------------------------


@pytest.mark.parametrize("interaction", ["stif", "comp"])
def test_torque_entered_in_motion_comes_to_rest_and_stays(
    panda: Simulation, interaction: str
) -> None:
    """M9: both stop together, on their path; once inertial torque drove the arm 3.9 rad away."""
    board = panda.board
    board.set_interaction_mode(None, interaction)
    board.set_control_mode(0, "vel")
    board.set_control_mode(3, "vel")
    panda.step()
    for _ in range(3):
        board.velocity_move([0, 3], [1.0, 0.6], 8.0)
        panda.run(0.1)
    at = board.get_encoder([0, 3])
    v = board.get_encoder_speed([0, 3])
    assert abs(v[0]) > 0.8
    assert board.set_control_mode([0, 3], "torq")
    panda.run(10.0)
    limits = [board.config.joints[j].limits.acceleration for j in (0, 3)]
    way = np.abs(board.get_encoder([0, 3]) - at)
    time = np.max(v / np.array(limits))  # of the joint that needs longest
    assert np.all(way <= 0.5 * v * time + 0.01)
    assert np.abs(board.get_encoder_speed([0, 3])).max() < 1e-3


@pytest.mark.slow
def test_a_torque_entered_at_rest_holds(panda: Simulation) -> None:
    """M9: no joint moves before a command comes; once a panda fell after 2 s."""
    board = panda.board
    at, load = board.get_encoder(), board.get_torque(range(7))
    assert board.set_control_mode(list(range(7)), "torq")
    assert board.snapshot().torque_reference[:7] == pytest.approx(load)
    panda.run(20.0)
    assert np.abs(board.get_encoder() - at).max() < 1e-3
    # It is held as firmly as a gearbox rubs, no more: a harder push moves it.
    panda.plant.push(0, 0.3 * board.config.joints[0].limits.torque)
    panda.run(0.3)
    assert abs(board.get_encoder(0)[0] - at[0]) > 0.02


@pytest.mark.parametrize("mode", ["pos", "torq"])
def test_a_start_in_compliant_does_not_sag(mode: str) -> None:
    """M9, I5: at the first reading no load is known yet; it is found before the spring acts."""
    with Simulation.load("iiwa", joint_defaults__startup_interaction="comp") as simulation:
        simulation.step()
        home = simulation.board.get_encoder()
        if mode == "torq":
            assert simulation.board.set_control_mode(None, mode)
        simulation.run(3.0)
        assert np.abs(simulation.board.get_encoder() - home).max() < 5e-3


def test_stop_in_compliant_holds_however_often(iiwa: Simulation) -> None:
    """I10: once every call let the joint sag by 12 to 24 mrad."""
    board = iiwa.board
    board.set_interaction_mode(None, "comp")
    iiwa.run(0.5)
    iiwa.plant.push(1, 40.0)
    iiwa.run(2.0)  # a steady push is part of the load
    at = board.get_encoder()
    for _ in range(20):
        assert board.stop()
        iiwa.run(0.1)
    assert np.abs(board.get_encoder() - at).max() < 1e-3


@pytest.mark.parametrize("interaction", ["stif", "comp"])
def test_a_feedforward_counts_once(iiwa: Simulation, interaction: str) -> None:
    """M9, P11: u_ff was once taken over as load at each change of mode, and then added."""
    board = iiwa.board
    assert board.set_feedforward(1, outputs=5.0)
    iiwa.run(1.0)
    board.set_interaction_mode(1, interaction)
    iiwa.run(1.0)
    at = float(board.get_encoder(1)[0])
    worst = 0.0
    for mode in ("posd", "vel", "mix", "torq", "pos", "torq", "posd"):
        assert board.set_control_mode(1, mode)
        for _ in range(600):
            iiwa.step()
            worst = max(worst, abs(float(board.get_encoder(1)[0]) - at))
    assert worst < 1e-3


# --- live parameters ---------------------------------------------------------------------------


def without_integral(one: JointConfig) -> JointConfig:
    return replace(one, position_pid=replace(one.position_pid, ki=0.0))


def softer(one: JointConfig) -> JointConfig:
    pid = one.position_pid
    return replace(one, position_pid=Pid(kp=0.5 * pid.kp, ki=pid.ki, kd=pid.kd))


@pytest.mark.parametrize("change", [without_integral, softer])
def test_gains_that_change_do_not_move_a_joint(iiwa: Simulation, change: Any) -> None:
    """I5: ki set to 0 once dropped the 25 N·m that held the arm."""
    at = iiwa.board.get_encoder()
    for j in range(7):
        changed(iiwa, j, change)
    iiwa.run(1.0)
    assert np.abs(iiwa.board.get_encoder() - at).max() < 1e-3


def test_a_feedforward_gain_that_changes_does_not_move_a_joint(iiwa: Simulation) -> None:
    """P7: kff set to 0 in TORQUE once moved the arm by 0.45 rad."""
    board = iiwa.board
    assert board.set_control_mode(1, "torq")
    iiwa.run(0.5)
    at = float(board.get_encoder(1)[0])
    changed(iiwa, 1, lambda one: replace(one, torque_pid=replace(one.torque_pid, kff=0.0)))
    iiwa.run(1.0)
    assert abs(float(board.get_encoder(1)[0]) - at) < 1e-3


def test_a_removed_timeout_does_not_fault(iiwa: Simulation) -> None:
    """P12: a deadline that ran already once faulted the joint all the same."""
    board = iiwa.board

    def timeout(seconds: float) -> Any:
        return lambda one: replace(one, timeouts=replace(one.timeouts, torque=seconds))

    changed(iiwa, 1, timeout(0.3))
    assert board.set_control_mode(1, "torq")
    iiwa.step()
    assert board.set_ref_torque(1, float(board.get_torque(1)[0]))
    iiwa.run(0.1)
    changed(iiwa, 1, timeout(0.0))
    iiwa.run(1.0)
    assert board.get_control_mode(1) == [M.TORQUE]
    changed(iiwa, 1, timeout(0.2))
    iiwa.run(0.5)
    assert board.get_control_mode(1) == [M.HW_FAULT]
