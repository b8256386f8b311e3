# SPDX-License-Identifier: Apache-2.0
"""SPEC I: interaction modes and impedance, looked at closely, on the board in process."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig import (
    COMPLIANT,
    MODES_OF_A_JOINT,
    PER_TORQUE,
    POSITION_MODES,
    STIFF,
    TAKES,
    M,
    Rig,
    board_config,
    check_stop,
    held,
    in_mode,
    in_status,
    joint,
    ready,
)

from control_board_ros.core.config.config import Pid
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

#: u = τ: what the impedance asks for is what the output shows.
OPEN_TORQUE = Pid(kp=0.0, kff=1.0)


@pytest.mark.parametrize("mode", POSITION_MODES, ids=str)
def test_impedance_law(mode: ControlMode) -> None:
    """I5, I2: COMPLIANT: τ = τ_ff + k (q_ref − q) − d q̇, tracked by the torque loop."""
    one = joint("left", torque_pid=OPEN_TORQUE, back_emf_compensation=0.0)
    rig = held(one)
    rig.board.set_impedance("left", 80.0, 6.0)
    rig.board.set_interaction_mode("left", "comp")
    rig.enter(mode)
    rig.board.set_feedforward("left", torques=1.5)
    rig.plant.values[Row.POSITION] = -0.02
    rig.plant.values[Row.VELOCITY] = 0.3
    shown = rig.tick()
    assert shown.torque_reference[0] == pytest.approx(1.5 + 80.0 * 0.02 - 6.0 * 0.3)
    assert shown.output[0] == pytest.approx(shown.torque_reference[0] * PER_TORQUE)
    # The inner loop closes on the sensor.
    tracking = held(joint("left", torque_pid=Pid(kp=2.0, kff=1.0), back_emf_compensation=0.0))
    tracking.board.set_interaction_mode("left", "comp")
    tracking.enter(mode)
    tracking.board.set_feedforward("left", torques=1.5)
    tracking.plant.values[Row.TORQUE] = 0.5
    assert tracking.tick().output[0] == pytest.approx((1.5 + 2.0 * 1.0) * PER_TORQUE)


@pytest.mark.parametrize("mode", POSITION_MODES, ids=str)
def test_stiff_knows_no_impedance(mode: ControlMode) -> None:
    """I5, I2: STIFF: the position PID; stiffness, damping and τ_ff do not act."""
    one = joint("left", position_pid=Pid(kp=100.0), back_emf_compensation=0.0)
    rig = held(one)
    rig.enter(mode)
    rig.board.set_feedforward("left", torques=9.0)
    rig.plant.values[Row.POSITION] = -0.02
    for stiffness in (0.0, 500.0):
        rig.board.set_impedance("left", stiffness, 50.0)
        assert rig.tick().output[0] == pytest.approx(100.0 * 0.02 * PER_TORQUE)


@pytest.mark.parametrize("mode", [M.TORQUE, M.OPENLOOP, M.IDLE], ids=str)
def test_no_effect_in_torque_open_loop_and_idle(mode: ControlMode) -> None:
    """I2: the interaction mode is stored there and does nothing to the control, bit for bit."""
    rigs = ready(), ready()
    for rig in rigs:
        rig.enter(mode, "left")
        rig.board.set_ref_torque("left", 1.0)
        rig.board.set_output("left", 3.0)
    for k in range(100):
        one, two = rigs[0].tick(), rigs[1].tick()
        assert np.array_equal(one.block, two.block, equal_nan=True)
        if k % 10 == 0:
            wanted = COMPLIANT if k % 20 == 0 else STIFF
            assert rigs[0].board.set_interaction_mode("left", wanted)
            assert rigs[0].board.get_interaction_mode("left") == [wanted]
            assert rigs[0].modes() == rigs[1].modes()


@pytest.mark.parametrize("through", [M.IDLE, M.TORQUE, M.OPENLOOP, M.HW_FAULT], ids=str)
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_it_acts_when_a_mode_with_it_is_entered(through: ControlMode, interaction: Any) -> None:
    """I2: what was stored in a passive mode or a fault acts in the next position mode."""
    rig = held(joint("left", position_pid=Pid(kp=100.0), torque_pid=OPEN_TORQUE))
    if through is M.HW_FAULT:
        rig.board.set_control_mode("left", "veld")
    else:
        rig.enter(through)
    assert rig.board.set_interaction_mode("left", interaction)
    rig.board.set_control_mode("left", "fidl")
    assert rig.board.get_interaction_mode("left") == [interaction]
    rig.enter("pos")
    assert rig.board.get_interaction_mode("left") == [interaction]
    rig.plant.values[Row.POSITION] = -0.02
    gain = 100.0 if interaction is STIFF else 50.0
    assert rig.tick().output[0] == pytest.approx(gain * 0.02 * PER_TORQUE)


@pytest.mark.parametrize("wanted", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize(("mode", "interaction", "sensed"), MODES_OF_A_JOINT, ids=str)
def test_every_interaction_mode_in_every_mode(
    mode: ControlMode, interaction: InteractionMode, sensed: bool, wanted: InteractionMode
) -> None:
    """I1, I2, I7, I8, K2, N4: what source Table 3 says of each mode and status."""
    rig = in_mode(mode, interaction, sensed=sensed)
    entered, kept, answer = mode, wanted, Answer.ACCEPTED
    if mode in (M.CALIBRATING, M.NOT_CONFIGURED):
        kept, answer = interaction, Answer.REFUSED
    elif wanted is COMPLIANT and not sensed:
        entered, kept = M.HW_FAULT, STIFF
        answer = Answer.REFUSED if mode is M.HW_FAULT else Answer.UNSUPPORTED
    assert rig.board.set_interaction_mode("left", wanted).answers == (answer,)
    rig.run(0.2)
    assert rig.modes() == [entered]
    assert rig.board.get_interaction_mode("left") == [kept]


def test_calibration_is_stiff_whatever_is_stored() -> None:
    """I8: the calibrator holds with the stiff law, also where COMPLIANT is stored."""
    stiff, compliant = in_status(M.IDLE), in_status(M.IDLE)
    compliant.board.set_interaction_mode("left", COMPLIANT)
    for rig in (stiff, compliant):
        assert rig.board.calibrate("left")
    for _ in range(200):
        assert np.array_equal(stiff.tick().block, compliant.tick().block, equal_nan=True)
    assert compliant.modes() == [M.CALIBRATING]


@pytest.mark.fresh("the way from that reading")
@pytest.mark.parametrize("mode", POSITION_MODES, ids=str)
@pytest.mark.parametrize("first", [STIFF, COMPLIANT], ids=str)
def test_a_change_drops_the_trajectory(mode: ControlMode, first: Any) -> None:
    """I4: a real change in an active mode stops the joint, where it comes to rest."""
    rig = ready(board_config(joint("left")))
    rig.board.set_interaction_mode("left", first)
    rig.enter(mode)
    rig.board.position_move("left", 1.0, 1.0)
    rig.board.velocity_move("left", 0.5)
    rig.run(0.15)
    version = rig.board.modes_version
    assert rig.board.set_interaction_mode("left", COMPLIANT if first is STIFF else STIFF)
    shown = rig.board.snapshot()
    assert rig.board.modes_version > version
    assert rig.modes() == [mode]
    assert shown.motion_done[0]
    assert shown.position_reference[0] == shown.position[0]
    assert shown.velocity_reference[0] == 0.0
    check_stop(rig.board, shown, rig.run(1.0))


@pytest.mark.parametrize("mode", [m for m in TAKES if m not in (M.CALIBRATING, M.NOT_CONFIGURED)])
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_the_present_interaction_mode_again(mode: ControlMode, interaction: Any) -> None:
    """I4: setting the present one again does nothing, bit for bit."""
    rigs = (in_status(M.IDLE), in_status(M.IDLE))
    for rig in rigs:
        rig.board.set_interaction_mode("left", interaction)
        rig.board.set_control_mode("left", "veld" if mode is M.HW_FAULT else mode)
        rig.board.position_move("left", 1.0, 1.0)
        rig.board.velocity_move("left", 1.0)
        rig.run(0.02)
    version = rigs[0].board.modes_version
    for _ in range(20):
        assert rigs[0].board.set_interaction_mode("left", interaction)
        assert np.array_equal(rigs[0].tick().block, rigs[1].tick().block, equal_nan=True)
    assert rigs[0].board.modes_version == version


def test_impedance_acts_in_the_next_cycle() -> None:
    """I6: k and d act in the next cycle, without a mode change; the move goes on."""
    rig = held(joint("left", torque_pid=OPEN_TORQUE, back_emf_compensation=0.0))
    rig.board.set_interaction_mode("left", "comp")
    rig.enter("posd")
    rig.plant.values[Row.POSITION] = -0.02
    rig.plant.values[Row.VELOCITY] = 0.1
    version = rig.board.modes_version
    for stiffness, damping in ((10.0, 1.0), (200.0, 0.0), (0.0, 20.0), (500.0, 50.0)):
        assert rig.board.set_impedance("left", stiffness, damping)
        torque = rig.tick().torque_reference[0]
        assert torque == pytest.approx(stiffness * 0.02 - damping * 0.1)
    assert rig.board.modes_version == version


@pytest.mark.parametrize("status", [M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED], ids=str)
def test_impedance_at_any_time(status: ControlMode) -> None:
    """I6: set and read in every status too; the configuration gives the first values."""
    rig = in_status(status)
    assert np.ravel(rig.board.get_impedance("left")).tolist() == [50.0, 5.0]
    assert np.ravel(rig.board.get_max_impedance("left")).tolist() == [500.0, 50.0]
    assert rig.board.set_impedance("left", 123.0, 4.0)
    assert np.ravel(rig.board.get_impedance("left")).tolist() == [123.0, 4.0]
    assert rig.modes() == [status]


@pytest.mark.parametrize("bad", [-1e-9, float("nan"), float("inf"), -float("inf"), 500.1])
def test_bad_impedance(rig: Rig, bad: float) -> None:
    """I6: negative, not finite or beyond the limits: an error, and for no joint a change."""
    for arguments in (([1.0, bad, 1.0], 1.0), (1.0, [1.0, 1.0, bad])):
        reply = rig.board.set_impedance(None, *arguments)
        assert not reply
        assert "is not allowed" in reply.message
    assert rig.board.get_impedance()[0].tolist() == [50.0] * 3
    assert rig.board.get_impedance()[1].tolist() == [5.0] * 3
    assert not rig.board.set_impedance(None, [1.0, 1.0], 1.0)
    assert not rig.board.set_impedance(None, 1.0, 50.1)
    assert rig.board.set_impedance(None, [0.0, 500.0, 1.0], [50.0, 0.0, 1.0])


def test_a_stiffness_alone_chooses_its_damping(rig: Rig) -> None:
    """I6: without a damping in the request, it grows with the stiffness, up to its limit."""
    dampings = []
    for stiffness in (50.0, 200.0, 500.0):
        assert rig.board.set_impedance([0, 1], stiffness)
        chosen, damping = rig.board.get_impedance("left")
        assert chosen.tolist() == [stiffness]
        dampings.append(damping[0])
    assert 0.0 < dampings[0] < dampings[1] < dampings[2] <= 50.0
    assert not rig.board.set_impedance("left", 500.1)
    assert rig.board.get_impedance("left")[1].tolist() == dampings[2:]


def test_without_torque_sensing(rig: Rig) -> None:
    """I7: COMPLIANT faults a joint that implements only STIFF, from any mode; others go on."""
    for mode in ("idl", "pos", "open"):
        rig.enter(mode)
        reply = rig.board.set_interaction_mode(None, "comp")
        assert reply.answers == (Answer.ACCEPTED, Answer.ACCEPTED, Answer.UNSUPPORTED)
        assert "bare does not implement comp (COMPLIANT)" in reply.message
        assert rig.modes()[2] is M.HW_FAULT
        assert rig.modes()[0].code == mode
        assert rig.board.get_interaction_mode() == [COMPLIANT, COMPLIANT, STIFF]
        fault = rig.board.get_faults("bare")[0]
        assert fault.text == "unsupported mode, comp (COMPLIANT) was requested"
        assert rig.board.set_control_mode("bare", "fidl")
        rig.board.set_interaction_mode(None, "stif")
    modes, interactions = rig.board.get_available_modes("bare")[0]
    assert M.TORQUE not in modes
    assert tuple(interactions) == (STIFF,)
    rig.board.set_control_mode("bare", "veld")
    before = rig.board.get_faults("bare")
    assert not rig.board.set_interaction_mode("bare", "comp")
    assert rig.board.get_faults("bare") == before
    assert rig.board.set_interaction_mode("bare", "stif")


@pytest.mark.fresh("within that time")
def test_the_load_is_kept_on_entering_compliant() -> None:
    """I5, M9: without a τ_ff of the user, the load carried on entry becomes the torque offset."""
    rig = ready(board_config(joint("left")))
    rig.enter("pos")
    rig.plant.push("left", -6.0)
    rig.run(2.0)
    assert rig.board.set_interaction_mode("left", "comp")
    assert rig.board.get_torque_offset("left")[0] == pytest.approx(6.0, abs=0.2)
    here = rig.board.snapshot().position[0]
    assert rig.run(2.0).position[0] == pytest.approx(here, abs=5e-3)
    assert rig.board.set_feedforward("left", torques=0.0)
    assert rig.run(3.0).position[0] == pytest.approx(here - 6.0 / 50.0, abs=0.01)
    rig.board.set_interaction_mode("left", "stif")
    rig.run(1.0)
    rig.board.set_interaction_mode("left", "comp")
    assert rig.board.get_torque_offset("left")[0] == 0.0  # the user's own stays


def test_stop_in_compliant_takes_the_load_over() -> None:
    """I10, M9: stopped again and again, a joint with a load stays where it is."""
    rig = ready(board_config(joint("left")))
    rig.enter("pos")
    rig.plant.push("left", -6.0)
    rig.run(2.0)
    assert rig.board.set_interaction_mode("left", "comp")
    rig.run(0.5)
    rig.plant.push("left", -9.0)
    here = rig.run(3.0).position[0]
    for _ in range(10):
        assert rig.board.stop("left")
        shown = rig.run(0.2)
        assert shown.position_reference[0] == pytest.approx(here, abs=2e-3)
        assert shown.position[0] == pytest.approx(here, abs=2e-3)
    assert rig.board.get_torque_offset("left")[0] == pytest.approx(9.0, abs=0.3)
