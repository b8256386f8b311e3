# SPDX-License-Identifier: Apache-2.0
"""Motion that an engineer trusts: what once ran away, sagged, struck stops or misreported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.simulation import Simulation


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
    panda.run(4.0)
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


def test_a_feedforward_gain_that_changes_does_not_move_a_joint(iiwa: Simulation) -> None:
    """P7: kff set to 0 in TORQUE once moved the arm by 0.45 rad."""
    board = iiwa.board
    assert board.set_control_mode(1, "torq")
    iiwa.run(0.5)
    at = float(board.get_encoder(1)[0])
    changed(iiwa, 1, lambda one: replace(one, torque_pid=replace(one.torque_pid, kff=0.0)))
    iiwa.run(1.0)
    assert abs(float(board.get_encoder(1)[0]) - at) < 1e-3
