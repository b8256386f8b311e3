# SPDX-License-Identifier: Apache-2.0
"""Rules of recovery and emergency stop (SPEC E1, E2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rig import COMPLIANT, STIFF, Held, M, Rig, board_config, joint

from control_board_ros.core.board import Board
from control_board_ros.core.config.config import Calibration, Timeouts, joined
from control_board_ros.core.state import Reference
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.reply import Answer, Reason
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

MOVING = {"left": (M.VELOCITY, STIFF), "right": (M.POSITION, COMPLIANT), "bare": (M.MIXED, STIFF)}


def enter(rig: Rig, modes: dict[str, tuple[ControlMode, InteractionMode]]) -> None:
    for name, (mode, interaction) in modes.items():
        assert rig.board.set_interaction_mode(name, interaction)
        assert rig.board.set_control_mode(name, mode)


def now(rig: Rig) -> dict[str, tuple[ControlMode, InteractionMode]]:
    board = rig.board
    both = zip(board.get_control_mode(), board.get_interaction_mode(), strict=True)
    return dict(zip(board.names, both, strict=True))


# --- E1 ----------------------------------------------------------------------------------------


def test_all_that_are_in_fault_go_back_to_the_modes_before(rig: Rig) -> None:
    """E1: in one cycle, where they are; one that is in no fault goes on as it was."""
    enter(rig, MOVING)
    rig.run(0.1)
    assert rig.board.velocity_move("left", 0.5)
    rig.run(0.2)
    for name in ("left", "right"):
        rig.plant.inject(name, "overcurrent", False)
    rig.run(0.3)
    assert rig.board.get_control_mode() == [M.HW_FAULT, M.HW_FAULT, M.MIXED]
    version = rig.board.modes_version
    reply = rig.board.recover()
    assert reply, reply
    assert reply.joints == ("left", "right")
    assert reply.modes == (M.VELOCITY, M.POSITION)
    assert now(rig) == MOVING
    assert rig.board.modes_version > version
    place = rig.board.get_encoder()
    rig.run(0.3)
    assert rig.board.get_encoder() == pytest.approx(place, abs=2e-3)  # M9
    assert not any(fault.active for fault in rig.board.get_faults())


def test_it_moves_again_within_fifty_milliseconds(rig: Rig) -> None:
    """E1: from the cycle in which the cause is gone, by one call and one reference."""
    rig.board.set_control_mode("left", M.VELOCITY)
    rig.plant.inject("left", "external", True)
    rig.run(0.3)
    assert not rig.board.recover()
    rig.plant.clear_injected()
    begin = rig.board.time
    while not rig.board.recover():
        rig.tick()
    rig.board.velocity_move("left", 0.5)
    while abs(rig.board.get_encoder_speed("left")[0]) < 1e-3:
        rig.tick()
        assert rig.board.time - begin <= 0.05


def test_nothing_is_left_to_recover_where_nothing_is_in_fault(rig: Rig) -> None:
    """E1: accepted, and nothing changes, named or not."""
    enter(rig, MOVING)
    rig.board.velocity_move("left", 0.5)
    rig.run(0.1)
    speed = rig.board.get_encoder_speed("left")
    assert rig.board.recover()
    assert rig.board.recover("left").answers == (Answer.ACCEPTED,)
    rig.tick(2)
    assert now(rig) == MOVING
    assert rig.board.get_encoder_speed("left") == pytest.approx(speed, rel=0.1)


@pytest.mark.parametrize("partial", [False, True])
def test_a_cause_that_persists_holds_all_of_them_unless_partial(rig: Rig, partial: bool) -> None:
    """E1: the reason, and how long to wait; with partial the others go."""
    enter(rig, MOVING)
    rig.plant.inject("left", "overcurrent", False)
    rig.plant.inject("right", "overheating", True)
    rig.run(0.1)
    reply = rig.board.recover(["left", "right"], partial=partial)
    assert not reply
    expected = (Answer.ACCEPTED if partial else Answer.REFUSED, Answer.REFUSED)
    assert reply.answers == expected
    assert reply.codes == (Reason.NONE if partial else Reason.TOGETHER, Reason.CAUSE_PERSISTS)
    assert "overheating" in reply.reasons[1]
    assert reply.waits[0] == 0.0
    assert reply.waits[1] >= 0.0
    modes = rig.board.get_control_mode(["left", "right"])
    assert modes == [M.VELOCITY if partial else M.HW_FAULT, M.HW_FAULT]


def test_the_time_to_wait_is_that_of_the_winding() -> None:
    """E1, F3: after it recovery succeeds, a little before it does not."""
    cooling = 2.0
    config = board_config(joint("hot", motor=replace(joint("x").motor, thermal_time=cooling)))
    rig = Rig(config, Held(config))
    rig.tick(3)
    rig.board.set_control_mode("hot", M.POSITION)

    def at(time: float) -> None:
        rig.plant.values[Row.TEMPERATURE] = 25.0 + 105.0 * math.exp(-time / cooling)
        rig.tick()

    at(0.0)
    wait = rig.board.recover("hot").waits[0]
    assert wait == pytest.approx(cooling * math.log(105.0 / 85.0) + 0.1)
    at(wait - 0.15)
    assert not rig.board.recover("hot")
    at(wait)
    assert rig.board.recover("hot")
    assert rig.board.get_control_mode() == [M.POSITION]


def test_a_calibration_that_failed_ends_in_idle() -> None:
    """E1, K7: what the calibrator had is gone; recovery clears the fault and says no more."""
    lost = joint("lost", calibration=Calibration(type=3, zero=0.0, start=1.5, timeout=0.05))
    rig = Rig(board_config(lost))
    rig.run(0.5)
    assert rig.board.get_control_mode() == [M.HW_FAULT]
    reply = rig.board.recover()
    assert reply, reply
    assert reply.modes == (M.IDLE,)


def test_an_unsupported_mode_is_recovered_from(rig: Rig) -> None:
    """E1, M5: to the mode before it."""
    rig.board.set_control_mode("bare", M.POSITION)
    assert not rig.board.set_control_mode("bare", M.TORQUE)
    assert rig.board.get_control_mode("bare") == [M.HW_FAULT]
    assert rig.board.recover("bare").modes == (M.POSITION,)


# --- E2 ----------------------------------------------------------------------------------------


def test_an_emergency_stop_faults_every_joint_in_the_next_cycle(rig: Rig) -> None:
    """E2, F1: without power, also one that calibrates or idles; commands change nothing."""
    enter(rig, MOVING)
    rig.board.set_control_mode("bare", M.IDLE)
    rig.board.velocity_move("left", 1.0)
    rig.run(0.2)
    rig.board.emergency_stop()
    rig.tick()
    assert rig.board.get_control_mode() == [M.HW_FAULT] * 3
    assert not rig.board.state.powered.any()
    for fault in rig.board.get_faults():
        assert (fault.active, fault.code) == (True, 24)
        assert fault.text == "emergency stop, requested"
    rig.board.velocity_move("left", 1.0)
    rig.board.set_control_mode(None, M.POSITION)
    rig.tick()
    assert rig.board.get_control_mode() == [M.HW_FAULT] * 3


def test_it_is_left_as_a_fault_once_it_is_released(rig: Rig) -> None:
    """E2, F2, F3: refused before with its own code; released, nothing moves by itself."""
    enter(rig, MOVING)
    rig.board.emergency_stop()
    rig.tick()
    for refused in (rig.board.set_control_mode(None, M.FORCE_IDLE), rig.board.recover()):
        assert refused.codes == (Reason.EMERGENCY_STOP,) * 3
        assert "emergency stop, requested); release it" in refused.reasons[0]
    refused = rig.board.set_control_mode(None, M.POSITION)
    assert refused.codes == (Reason.EMERGENCY_STOP,) * 3
    assert "emergency stop, requested); release it" in refused.reasons[0]
    ignored = rig.board.position_move("left", 0.1)
    assert ignored.codes == (Reason.EMERGENCY_STOP,)
    assert "emergency stop, requested); release it, then send FORCE_IDLE" in ignored.reasons[0]
    rig.board.emergency_stop(False)
    rig.tick(5)
    assert rig.board.get_control_mode() == [M.HW_FAULT] * 3
    assert rig.board.recover()
    assert now(rig) == MOVING


def test_joints_that_are_configured_while_it_holds_get_no_power() -> None:
    """E2, N3: not for one cycle."""
    rig = Rig(board_config(joint("a", startup_mode=M.POSITION), autoconfigure=False))
    rig.tick(2)
    rig.board.emergency_stop()
    assert rig.board.configure()
    for _ in range(3):
        rig.tick()
        assert not rig.board.state.powered.any()
    assert rig.board.get_control_mode() == [M.HW_FAULT]


def test_the_input_of_a_plant_is_a_stop() -> None:
    """E2: a contact that the plant reads, as the alarm of its joints; they leave it as F2."""
    rig = Rig(config := board_config(joint("a"), joint("b")), Held(config))
    rig.tick(2)
    rig.board.set_control_mode(None, M.POSITION)
    rig.tick()
    rig.plant.values[Row.ALARM] = 1.0 + FaultCode.EMERGENCY_STOP
    rig.tick()
    assert rig.board.get_control_mode() == [M.HW_FAULT] * 2
    assert not rig.board.state.powered.any()
    assert {fault.code for fault in rig.board.get_faults()} == {FaultCode.EMERGENCY_STOP}
    assert rig.board.recover().codes == (Reason.EMERGENCY_STOP,) * 2
    rig.plant.values[Row.ALARM] = 0.0
    rig.tick()
    assert rig.board.recover().modes == (M.POSITION,) * 2


@pytest.mark.fresh("from the first cycle on")
def test_the_silence_of_the_heartbeat_is_a_stop() -> None:
    """E2: from the first reading on; when it is received again, the fault can be cleared."""
    rig = Rig(board_config(heartbeat_timeout=0.1))
    assert rig.run(0.09) is not None
    assert M.HW_FAULT not in rig.board.get_control_mode()
    for _ in range(4):
        rig.board.beat()
        rig.run(0.09)
        assert M.HW_FAULT not in rig.board.get_control_mode()
    rig.run(0.02)
    assert rig.board.get_control_mode() == [M.HW_FAULT] * 3
    assert rig.board.get_faults()[0].text == "emergency stop, no heartbeat for 0.1 s"
    assert rig.board.recover().codes == (Reason.EMERGENCY_STOP,) * 3
    rig.board.beat()
    rig.tick()
    assert rig.board.recover()


def test_a_requested_stop_outlasts_the_heartbeat() -> None:
    """E2: each cause has its own end."""
    rig = Rig(board_config(heartbeat_timeout=0.1))
    rig.tick()
    rig.board.emergency_stop()
    rig.run(0.2)
    rig.board.beat()
    rig.tick()
    assert rig.board.engine.emergency.reason == ("requested", "release it")
    assert not rig.board.recover()
    rig.board.emergency_stop(False)
    rig.board.beat()
    rig.tick()
    assert rig.board.recover()


def test_the_stop_of_a_part_is_that_of_the_robot() -> None:
    """E1, E2, R3: every joint, for any caller; a part recovers its own, the robot the rest."""
    config = joined({n: board_config(joint(f"{n}_a"), joint(f"{n}_b")) for n in ("arm", "leg")})
    board = Board(config)
    plant = Held(config)
    board.tick(plant.read())
    board.set_control_mode(None, M.POSITION)
    board.parts["arm"].emergency_stop()
    plant.write(board.tick(plant.read()))
    assert board.get_control_mode() == [M.HW_FAULT] * 4
    assert np.count_nonzero(board.state.powered) == 0
    board.parts["leg"].emergency_stop(False)
    plant.write(board.tick(plant.read()))
    assert board.parts["leg"].recover().joints == ("leg_a", "leg_b")
    assert board.parts["arm"].get_control_mode() == [M.HW_FAULT] * 2
    assert board.recover().joints == ("arm_a", "arm_b")
    assert board.get_control_mode() == [M.POSITION] * 4


# --- E3 ----------------------------------------------------------------------------------------


def around_a_fault(rig: Rig) -> float:
    """A joint that moves, faults and is cleared; the time of its fault, s."""
    rig.board.set_control_mode("left", M.POSITION)
    rig.board.position_move("left", 1.0, 0.4)
    rig.run(2.0)
    rig.plant.inject("left", "overcurrent", False)
    rig.run(0.1)
    stamp = rig.board.get_faults("left")[0].stamp
    assert rig.board.recover("left")
    return stamp


@pytest.mark.fresh("position of that cycle")
def test_a_fault_keeps_a_freeze_frame(rig: Rig) -> None:
    """E3: two seconds of what was measured and followed, around it; also once it is cleared."""
    assert rig.board.get_freeze_frame("left") is None
    stamp = around_a_fault(rig)
    rig.run(3.0)
    frame = rig.board.get_freeze_frame("left")
    assert frame is not None
    assert len(frame.stamps) == round(2.0 / rig.period)
    assert np.diff(frame.stamps) == pytest.approx(rig.period)
    assert frame.stamps[0] == pytest.approx(stamp - 1.5, abs=2 * rig.period)
    assert frame.stamps[-1] == pytest.approx(stamp + 0.5, abs=2 * rig.period)
    reference = frame.block[:, Reference.POSITION]
    moving = frame.stamps < stamp
    assert np.all(np.diff(reference[moving]) > 0.0)
    assert frame.block[moving, Row.POSITION] == pytest.approx(reference[moving], abs=0.01)
    assert frame.block[frame.stamps == stamp, Row.CURRENT] > 25.0
    assert not frame.done[moving].any()
    assert rig.board.get_freeze_frame("right") is None


@pytest.mark.parametrize("partial", [False, True])
def test_a_joint_without_its_torque_keeps_its_fault(partial: bool) -> None:
    """E1, Y5: until it is measured again the mode before the fault is kept in mind."""
    far = joint("far", external_torque=True, timeouts=Timeouts(torque_sensor=0.1))
    rig = Rig(board_config(far))
    for _ in range(10):
        rig.board.update_torque_sensor("far", 0.0)
        rig.tick()
    assert rig.board.set_control_mode("far", M.TORQUE)
    rig.run(0.3)
    fault = rig.board.get_faults("far")[0]
    assert fault.active
    reply = rig.board.recover("far", partial=partial)
    assert reply.answers == (Answer.REFUSED,)
    assert "stays in HW_FAULT" in reply.message
    assert rig.board.get_faults("far")[0] == fault
    rig.board.update_torque_sensor("far", 0.0)
    rig.tick(2)
    assert rig.board.recover("far")
    assert rig.board.get_control_mode("far") == [M.TORQUE]


def test_an_interaction_mode_set_amid_a_fault_is_not_lost(rig: Rig) -> None:
    """E1, I2: it is stored, and acts when recovery enters such a mode."""
    enter(rig, {"left": (M.POSITION, STIFF), "right": (M.POSITION, COMPLIANT)})
    for name in ("left", "right"):
        rig.plant.inject(name, "external", False)
    rig.run(0.3)
    assert rig.board.set_interaction_mode("left", COMPLIANT)
    assert rig.board.recover()
    shown = now(rig)
    assert shown["left"] == (M.POSITION, COMPLIANT)
    assert shown["right"] == (M.POSITION, COMPLIANT)
