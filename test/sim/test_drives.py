# SPDX-License-Identifier: Apache-2.0
"""The simulated arm on drives that close loops of their own: the rules hold on every row (S7)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from control_board_ros.core.terms.drives import KINDS, OnSilence, SetPoint
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode as I
from control_board_ros.simulation import Simulation

S = SetPoint
OWN = tuple(kind for kind in KINDS if kind is not S.PWM)
#: Delay that the loops of each row bear with the gains that are derived for it, s.
DELAYS = {S.POSITION: 0.01, S.IMPEDANCE: 0.01, S.VELOCITY: 0.01, S.TORQUE: 0.002}


def arm(kind: SetPoint, **values: object) -> Simulation:
    """The iiwa, its masses known to the board, with such a drive at each joint."""
    made = Simulation.load("iiwa", joint_defaults__drive=[kind.code], **values)
    made.run(0.05)
    return made


def modes(simulation: Simulation) -> list[tuple[M, I]]:
    """What the first joint can be in, with power."""
    control, interaction = simulation.board.get_available_modes(0)[0]
    powered = [mode for mode in control if mode not in (M.IDLE, M.OPENLOOP)]
    return [(mode, how) for mode in powered for how in interaction]


def healthy(simulation: Simulation) -> None:
    assert not [fault.text for fault in simulation.board.get_faults() if fault.active]


@pytest.mark.slow
@pytest.mark.parametrize("kind", OWN)
def test_entering_a_mode_at_rest_moves_nothing(kind: SetPoint) -> None:
    """M9, S3: sag of 1 mrad at most, from each mode to the next, and to the first again."""
    with arm(kind) as simulation:
        board = simulation.board
        simulation.run(0.5)
        first, *others = modes(simulation)
        for mode, interaction in (first, *others, first):
            before = board.get_encoder().copy()
            assert board.set_control_mode(None, mode)
            assert board.set_interaction_mode(None, interaction)
            simulation.run(0.3)
            assert np.abs(board.get_encoder() - before).max() < 1e-3, (mode, interaction)
        healthy(simulation)


@pytest.mark.slow
@pytest.mark.parametrize("kind", OWN)
def test_entering_a_mode_in_motion_brings_the_joint_to_rest(kind: SetPoint) -> None:
    """M9: within its stopping distance, and 10 mrad."""
    with arm(kind) as simulation:
        board, joint = simulation.board, 3
        limits = board.config.joints[joint].limits
        for mode, interaction in modes(simulation):
            assert board.set_interaction_mode(None, I.STIFF)
            assert board.set_control_mode(None, M.VELOCITY)
            way = -1.0 if board.get_encoder()[joint] > 0.0 else 1.0
            assert board.velocity_move(joint, way * 0.5)
            simulation.run(0.15)
            speed = float(board.get_encoder_speed()[joint])
            before = float(board.get_encoder()[joint])
            if mode is M.VELOCITY:
                continue
            assert board.set_control_mode(None, mode)
            assert board.set_interaction_mode(None, interaction)
            simulation.run(0.6)
            stopping = speed**2 / (2.0 * limits.acceleration)
            passed = abs(float(board.get_encoder()[joint]) - before)
            assert passed < stopping + 0.01, (mode, interaction)
            assert abs(float(board.get_encoder_speed()[joint])) < 1e-2
        healthy(simulation)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "delay"), DELAYS.items())
def test_a_drive_that_acts_late_follows_and_holds(kind: SetPoint, delay: float) -> None:
    """S7: with positions and torques in steps, too."""
    rest = {
        "joint_defaults__drive_delay": delay,
        "joint_defaults__drive_model__resolution": 1e-5,
        "joint_defaults__drive_model__torque_resolution": 1e-2,
    }
    with arm(kind, **rest) as simulation:
        board = simulation.board
        simulation.run(0.5)
        start = board.get_encoder().copy()
        assert board.position_move(None, start + 0.3, 0.3)
        simulation.run(2.5)
        healthy(simulation)
        assert board.check_motion_done() == [True] * 7
        assert np.abs(board.get_encoder() - start - 0.3).max() < 3e-3


@pytest.mark.slow
def test_a_sine_is_followed_by_impedance_two_milliseconds_late() -> None:
    """S2, S7: 1 Hz within 3 % of its amplitude."""
    with arm(S.IMPEDANCE, joint_defaults__drive_delay=0.002) as simulation:
        board, worst = simulation.board, 0.0
        assert board.set_control_mode(None, M.POSITION_DIRECT)
        start = board.get_encoder().copy()
        for k in range(3000):
            asked = start + 0.1 * (1.0 - math.cos(2.0 * math.pi * 1e-3 * k))
            assert board.set_position(None, asked)
            simulation.step()
            if k > 1000:
                worst = max(worst, float(np.abs(board.get_encoder() - asked).max()))
        healthy(simulation)
        assert worst < 0.03 * 0.1


def test_a_drive_keeps_the_limits_of_its_own() -> None:
    """S4: the smaller acts; the board goes on."""
    rest = {"joint_defaults__drive_model__velocity": 0.1}
    with arm(S.VELOCITY, physics="ideal", **rest) as simulation:
        board = simulation.board
        assert board.position_move(0, 0.3, 0.5)
        fastest = 0.0
        for _ in range(400):
            simulation.step()
            fastest = max(fastest, abs(float(board.get_encoder_speed()[0])))
        assert 0.05 < fastest < 0.2
        healthy(simulation)


def test_the_pwm_that_a_drive_applies_is_shown() -> None:
    """B2: ``applied`` is what acts, no PWM is asked for; the encoder is checked by it (F1)."""
    with arm(S.TORQUE, physics="ideal") as simulation:
        board = simulation.board
        assert board.position_move(0, 0.5, 0.5)
        simulation.run(0.3)
        shown = board.snapshot()
        assert abs(float(shown.applied[0])) > 0.1
        assert shown.output[0] == 0.0
        simulation.plant.inject(0, "encoder_reversed", persistent=True)
        simulation.run(1.0)
        assert board.get_control_mode(0) == [M.HW_FAULT]


def test_the_encoder_of_a_slow_board_is_checked_by_means_of_its_period() -> None:
    """B2, F1: set-points of 200 Hz shake the current between readings, which have its mean."""
    servo = {"gear_ratio": 345.0, "torque_constant": 0.0035, "resistance": 2.7}
    values = {f"motor__{name}": value for name, value in servo.items()} | {
        "motor__supply_voltage": 7.4,
        "limits__torque": 1.6,
        "limits__velocity": 3.0,
        **dict.fromkeys(("inertia_min", "inertia_mean", "inertia_max"), 0.03),
    }
    own = {f"joint_defaults__{name}": value for name, value in values.items()}
    joint = {"joints": ["lbr_iiwa_joint_7"], "physics": "ideal", "control_rate": 200.0}
    with arm(S.POSITION, **joint, **own) as simulation:
        monitor, worst = simulation.board.engine.monitor.joints[0], 0.0
        assert simulation.board.position_move(0, 1.5, 3.0)
        for _ in range(200):
            simulation.step()
            worst = max(worst, abs(monitor.travel))
        healthy(simulation)
        assert worst < 0.25 * monitor.max_travel


def test_a_delay_is_whole_cycles_between_set_point_and_motor() -> None:
    """S7."""
    with arm(S.POSITION, physics="ideal", joint_defaults__drive_delay=0.01) as simulation:
        board = simulation.board
        before = float(board.state.measured[Row.POSITION, 0])
        assert board.set_control_mode(0, M.POSITION_DIRECT)
        assert board.set_position(0, before + 0.1)
        simulation.step(11)
        assert float(board.state.measured[Row.POSITION, 0]) == pytest.approx(before, abs=1e-9)
        simulation.step(30)
        assert float(board.state.measured[Row.POSITION, 0]) > before + 1e-5


@pytest.mark.parametrize("silence", list(OnSilence))
def test_a_drive_without_set_points_does_what_it_is_configured_to(silence: OnSilence) -> None:
    """S5, S7: within its watchdog's time, and reports a fault until set-points return."""
    rest = {
        "joint_defaults__drive_model__watchdog": 0.05,
        "joint_defaults__on_silence": str(silence),
    }
    with arm(S.VELOCITY, physics="ideal", **rest) as simulation:
        board = simulation.board
        assert board.set_control_mode(0, M.VELOCITY)
        assert board.velocity_move(0, 0.5, 5.0)
        simulation.run(0.15)
        simulation.plant.inject(0, "drive_deaf")
        simulation.run(0.04)
        assert board.get_encoder_speed()[0] == pytest.approx(0.5, rel=0.05)
        assert board.get_control_mode(0) == [M.VELOCITY]
        simulation.run(0.02)
        assert board.get_control_mode(0) == [M.HW_FAULT]
        assert "drive, watchdog: no command for 50 ms" in board.get_faults(0)[0].text
        assert board.get_control_mode(1) != [M.HW_FAULT]
        simulation.run(1.0)
        speed = abs(float(board.get_encoder_speed()[0]))
        assert speed < {"free": 0.5, "damped": 0.05, "braked": 1e-3}[silence]
        assert not board.set_control_mode(0, M.FORCE_IDLE), "F3: it still receives nothing"
        simulation.plant.clear_injected()
        simulation.run(0.01)
        assert board.set_control_mode(0, M.FORCE_IDLE)
        assert board.set_control_mode(0, M.POSITION)
        simulation.run(0.1)
        healthy(simulation)


def test_a_motor_of_pwm_has_no_drive_that_could_be_deaf() -> None:
    refused = pytest.raises(ValueError, match="no drive that closes loops of its own")
    with arm(S.PWM, physics="ideal") as simulation, refused:
        simulation.plant.inject(0, "drive_deaf")
