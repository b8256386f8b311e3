# SPDX-License-Identifier: Apache-2.0
"""Rules of brakes (SPEC Y4): on the ideal plant with a push for gravity, and on an arm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rig import RATE, M, Rig, board_config, joint, truth

from control_board_ros.core.config.config import Brake, Calibration
from control_board_ros.core.terms.faults import FaultCode
from control_board_ros.core.terms.modes import POWERED, SELECTABLE
from control_board_ros.core.terms.reply import Answer, Reason
from control_board_ros.core.terms.vocabs import BrakeMode, ControlMode
from control_board_ros.simulation import Simulation

DEGREE = math.radians(1.0)
BRAKE = Brake(present=True, slip_torque=60.0)
RELEASE, ENGAGE = round(0.03 * RATE), round(0.02 * RATE)
LOAD = 20.0


def braked(**changes: Any) -> Rig:
    """Joints left (with a brake, under a load) and right (with none), in IDLE."""
    modes = {"control_modes": SELECTABLE} | changes
    rig = Rig(board_config(joint("left", brake=BRAKE, **modes), joint("right")))
    rig.tick(2)
    rig.plant.push("left", LOAD)
    rig.tick(100)
    return rig


def power(rig: Rig) -> tuple[bool, bool]:
    """Whether the joint with the brake has power, and its brake is closed."""
    return bool(rig.board.state.powered[0]), rig.board.is_joint_braked()[0]


# --- the order of things -----------------------------------------------------------------------


@pytest.mark.fresh("0.4 mrad before the first set-point arrives")
@pytest.mark.parametrize("mode", sorted(POWERED, key=lambda mode: mode.code))
def test_the_brake_is_open_before_power_acts_and_nothing_sags(mode: ControlMode) -> None:
    """Y4, M9: the mode is entered at once, power acts when the brake is open, the load stays."""
    rig = braked()
    before = truth(rig)
    assert rig.board.set_control_mode("left", mode)
    assert rig.board.get_control_mode("left") == [mode]
    seen = []
    for _ in range(RELEASE + 20):
        rig.tick()
        seen.append(power(rig))
        if mode not in (M.OPENLOOP, M.CURRENT):  # an output of 0 holds nothing
            assert abs(truth(rig) - before) < 0.02 * DEGREE
    assert seen == [(False, True)] * RELEASE + [(True, False)] * 20


@pytest.mark.parametrize("mode", [M.POSITION, M.TORQUE, M.VELOCITY])
@pytest.mark.parametrize("end", [M.IDLE, M.FORCE_IDLE])
def test_the_brake_is_closed_before_power_is_off(mode: ControlMode, end: ControlMode) -> None:
    """Y4: the joint reads idle at once, is held until the brake has closed, and stays there."""
    rig = braked()
    rig.enter(mode, "left")
    rig.tick(RELEASE + 200)
    before = truth(rig)
    assert rig.board.set_control_mode("left", end)
    assert rig.board.get_control_mode("left") == [M.IDLE]
    seen = []
    for _ in range(ENGAGE + 20):
        rig.tick()
        seen.append(power(rig))
        assert abs(truth(rig) - before) < 0.05 * DEGREE
    assert seen == [(True, False)] * ENGAGE + [(False, True)] * 20


@pytest.mark.parametrize("kind", ["overcurrent", "encoder", "external", "torque_sensor"])
def test_a_fault_removes_power_at_once_with_little_droop(kind: str) -> None:
    """Y4, F1: the joint is without power in the cycle of the fault; the brake then holds it."""
    rig = braked()
    rig.enter(M.POSITION, "left")
    rig.tick(200)
    before = truth(rig)
    rig.plant.inject("left", kind, persistent=True)
    while rig.board.get_control_mode("left") != [M.HW_FAULT]:
        rig.tick()
    assert not power(rig)[0]
    rig.run(0.5)
    assert power(rig) == (False, True)
    assert abs(truth(rig) - before) < 0.5 * DEGREE


@pytest.mark.parametrize("event", ["emergency_stop", "power_cycle"])
def test_what_takes_all_power_closes_them(event: str) -> None:
    """Y4, E2, N1: at once, also one that was open by hand; it is worked automatically again."""
    rig = braked()
    assert rig.board.set_brake("left", "open")
    rig.enter(M.POSITION, "left")
    rig.tick(200)
    getattr(rig.board, event)()
    rig.tick()
    assert not rig.board.state.powered[0]
    rig.run(0.5)
    assert power(rig) == (False, True)
    assert rig.board.get_brake("left") == [BrakeMode.AUTOMATIC]


def test_a_recovery_opens_them() -> None:
    """Y4, E1."""
    rig = braked()
    rig.enter(M.POSITION, "left")
    rig.board.emergency_stop()
    rig.run(0.5)
    rig.board.emergency_stop(False)
    rig.tick(2)
    assert rig.board.recover()
    rig.run(0.5)
    assert power(rig) == (True, False)
    assert rig.board.get_control_mode("left") == [M.POSITION]


@pytest.mark.parametrize("configured", [True, False])
def test_no_brake_opens_by_hand_while_an_emergency_stop_holds(configured: bool) -> None:
    """E2, Y4: of a joint that is not configured neither; it opens after the release."""
    rig = Rig(board_config(joint("left", brake=BRAKE), autoconfigure=configured))
    rig.tick(2)
    rig.board.emergency_stop()
    for _ in range(2):
        reply = rig.board.set_brake("left", "open")
        assert reply.codes == (Reason.EMERGENCY_STOP,)
        assert "release it" in reply.message
        rig.tick(50)
        assert rig.board.is_joint_braked() == [True]
    assert rig.board.get_brake("left") == [BrakeMode.AUTOMATIC]
    rig.board.emergency_stop(False)
    rig.tick()
    assert rig.board.set_brake("left", "open")


def test_references_wait_for_the_brake() -> None:
    """Y4, P1: a move that is requested while the brake opens is made whole, from its start."""
    rig = braked()
    start = truth(rig)
    assert rig.board.set_control_mode("left", "pos")
    assert rig.board.position_move("left", start + 0.2, 1.0)
    rig.tick(RELEASE)
    assert rig.board.state.position_reference[0] == pytest.approx(start, abs=1e-3)
    rig.tick(round(0.1 * RATE))
    assert start < rig.board.state.position_reference[0] < start + 0.15  # half of the 0.2 s
    rig.run(1.0)
    assert truth(rig) == pytest.approx(start + 0.2, abs=5e-3)


@pytest.mark.fresh("within 20 ms")
@pytest.mark.parametrize(
    ("mode", "method", "row", "value"),
    [
        ("torq", "set_ref_torque", "torque_reference", 3.0),
        ("icur", "set_ref_current", "current", 2.0),
    ],
)
def test_what_is_asked_for_while_the_brake_opens_acts_when_it_is_open(
    mode: str, method: str, row: str, value: float
) -> None:
    """Y4, P7, Y2: it is kept, and drives nothing before; no load is taken over in its place."""
    rig = braked()
    assert rig.board.set_control_mode("left", mode)
    assert getattr(rig.board, method)("left", value)
    rig.tick(RELEASE)
    assert rig.board.state.output[0] == 0.0
    rig.tick(20)
    assert getattr(rig.board.state, row)[0] == pytest.approx(value, abs=0.3)


@pytest.mark.parametrize(
    ("mode", "back", "time", "kept"),
    [("idl", "pos", ENGAGE, (True, False)), ("pos", "idl", RELEASE, (False, True))],
)
def test_a_mode_that_is_left_before_its_brake_has_moved(
    mode: str, back: str, time: int, kept: tuple[bool, bool]
) -> None:
    """Y4, M9: back from idle no power is lost; back to idle there was never any."""
    rig = braked()
    if back == "pos":
        rig.enter(M.POSITION, "left")
        rig.tick(200)
    before = truth(rig)
    assert rig.board.set_control_mode("left", mode)
    rig.tick(time // 2)
    assert rig.board.set_control_mode("left", back)
    for _ in range(100):
        rig.tick()
        assert power(rig) == kept
    assert abs(truth(rig) - before) < (0.05 if back == "pos" else 0.02) * DEGREE


def test_a_calibration_waits_for_the_brake() -> None:
    """Y4, K1: a calibrator drives nothing before the brake is open."""
    calibration = Calibration(type=3, required=False, start=0.3, speed=0.5)
    rig = braked(calibration=calibration)
    assert rig.board.calibrate("left")
    for _ in range(RELEASE):
        rig.tick()
        assert power(rig) == (False, True)
        assert rig.board.get_control_mode("left") == [M.CALIBRATING]
    rig.run(2.0)
    assert rig.board.get_control_mode("left") == [M.POSITION]
    assert truth(rig) == pytest.approx(0.3, abs=5e-3)


# --- by hand -----------------------------------------------------------------------------------


def test_a_brake_closed_by_hand_keeps_its_joint_from_power() -> None:
    """Y4, K1: brake_closed, with the reason; nothing changes, and automatic lets it again."""
    rig = braked(calibration=Calibration(type=3, required=False, speed=0.5))
    assert rig.board.set_brake("left", "closed")
    for ask in (
        lambda: rig.board.calibrate("left"),
        lambda: rig.board.set_control_mode("left", "pos"),
        lambda: rig.board.set_control_mode(["left", "right"], "torq"),
    ):
        reply = ask()
        assert reply.answers[0] is Answer.REFUSED
        assert reply.codes[0] is Reason.BRAKE_CLOSED
        assert "closed by hand" in reply.message
    assert rig.board.get_control_mode() == [M.IDLE, M.TORQUE]
    assert rig.board.set_control_mode("left", "idl")
    assert rig.board.set_brake("left", "automatic")
    assert rig.board.set_control_mode("left", "pos")


@pytest.mark.parametrize("mode", sorted(POWERED, key=lambda mode: mode.code))
def test_no_brake_is_closed_by_hand_while_its_motor_drives(mode: ControlMode) -> None:
    """Y4: refused, naming the mode and the way out; it stays open."""
    rig = braked()
    rig.enter(mode, "left")
    rig.tick(RELEASE + 5)
    reply = rig.board.set_brake("left", "closed")
    assert reply.codes == (Reason.OTHER_MODE,)
    assert mode.name in reply.message
    assert rig.board.get_brake("left") == [BrakeMode.AUTOMATIC]
    assert power(rig) == (True, False)


def test_a_brake_open_by_hand_holds_nothing_in_idle() -> None:
    """Y4: it opens without power, and stays open when power goes."""
    rig = braked()
    before = truth(rig)
    assert rig.board.set_brake("left", "open")
    rig.run(0.1)
    assert power(rig) == (False, False)
    assert truth(rig) > before + DEGREE
    rig.plant.push("left", 0.0)
    rig.enter(M.POSITION, "left")
    rig.run(0.5)
    assert rig.board.set_control_mode("left", "idl")
    rig.tick()
    assert power(rig) == (False, False)
    assert rig.board.set_brake("left", "automatic")
    rig.run(0.1)
    assert power(rig) == (False, True)


def test_opened_by_hand_while_it_closes_the_joint_loses_its_power() -> None:
    """Y4: idle was requested; there is nothing left to wait for."""
    rig = braked()
    rig.enter(M.POSITION, "left")
    rig.tick(100)
    assert rig.board.set_control_mode("left", "idl")
    rig.tick(2)
    assert rig.board.set_brake("left", "open")
    rig.tick()
    assert power(rig) == (False, False)


def test_yarps_names() -> None:
    """Y4: IJointBrake's methods."""
    rig = braked()
    board = rig.board
    assert board.is_joint_braked() == [True, False]
    assert board.get_auto_brake_enabled() == [True, False]
    assert board.set_auto_brake_enabled("left", False)
    assert board.get_brake("left") == [BrakeMode.CLOSED]
    assert board.set_manual_brake_active("left", False)
    assert board.get_brake("left") == [BrakeMode.OPEN]
    assert board.set_auto_brake_enabled(None, True)
    assert board.get_auto_brake_enabled() == [True, False]


@pytest.mark.parametrize("modes", ["half", [], ["open", "closed"]])
def test_a_request_refused_as_a_whole_changes_nothing(modes: Any) -> None:
    """Y4, M7: an unknown way to work a brake, or too few or many of them."""
    rig = braked()
    reply = rig.board.set_brake("left", modes)
    assert reply.codes == (Reason.INVALID,)
    assert rig.board.get_brake("left") == [BrakeMode.AUTOMATIC]


def test_a_joint_without_a_brake_has_none_to_set() -> None:
    """Y4: its part is refused, the other is done; all joints are those that have one."""
    rig = braked()
    reply = rig.board.set_brake(["left", "right"], "closed")
    assert reply.answers == (Answer.ACCEPTED, Answer.REFUSED)
    assert reply.message == "right has no brake"
    assert rig.board.set_brake(None, "automatic").joints == ("left",)


# --- brakes that fail --------------------------------------------------------------------------


def test_a_brake_that_does_not_open_is_a_fault() -> None:
    """Y4, F3: no power acts against it; FORCE_IDLE reports it, and the next mode tries again."""
    rig = braked()
    rig.plant.inject("left", "brake_stuck")
    assert rig.board.set_control_mode("left", "pos")
    for _ in range(round(0.3 * RATE)):
        rig.tick()
        assert not power(rig)[0]
    fault = rig.board.get_faults("left")[0]
    assert fault.active
    assert fault.code == FaultCode.BRAKE
    assert "did not open within 150 ms" in fault.text
    reply = rig.board.set_control_mode("left", "fidl")
    assert reply
    assert "did not open" in reply.message
    rig.plant.clear_injected(["left"])
    assert rig.board.set_control_mode("left", "pos")
    rig.run(0.1)
    assert power(rig) == (True, False)
    assert rig.board.set_control_mode("left", "fidl").message == ""


@pytest.mark.parametrize(("push", "moves"), [(0.9, False), (1.2, True)])
def test_a_closed_brake_slips_at_its_torque(push: float, moves: bool) -> None:
    """Y4: the simulated brake holds up to its slip torque, and no further."""
    rig = braked()
    before = truth(rig)
    rig.plant.push("left", push * BRAKE.slip_torque)
    rig.run(0.1)
    assert (abs(truth(rig) - before) > DEGREE) is moves


# --- an arm ------------------------------------------------------------------------------------


@pytest.mark.parametrize("physics", ["pybullet", "mujoco"])
def test_an_arm_with_brakes_does_not_fall(physics: str) -> None:
    """Y4: the panda loses less than 0.5 deg on a fault from standstill, and nothing on idle."""
    pytest.importorskip(physics)
    with Simulation.load(None, robot="panda", physics=physics) as simulation:
        board, plant = simulation.board, simulation.plant
        before = plant._motors.position.copy()

        def moved(seconds: float) -> float:
            worst = 0.0
            for _ in range(round(seconds * 1000)):
                simulation.step()
                worst = max(worst, float(np.abs(plant._motors.position - before).max()))
            return worst / DEGREE

        arm = list(board.names[:7])
        assert moved(0.3) < 0.05
        assert board.set_control_mode(arm, "idl")
        assert moved(0.3) < 0.05
        assert board.set_control_mode(arm, "pos")
        assert moved(0.3) < 0.05
        board.emergency_stop()
        assert moved(0.5) < 0.5
        assert set(board.get_control_mode()) == {M.HW_FAULT}
        assert board.is_joint_braked() == [True] * 7 + [False]


def test_joints_without_sensors_are_held_by_the_arms_model() -> None:
    """Y4, M9: what a brake carried is not measured there; the model knows the load."""
    modes = ["pos", "idl"]
    with Simulation.load(
        None,
        robot="panda",
        joint_defaults__torque_sensor=False,
        joint_defaults__control_modes=modes,
        joint_defaults__interaction_modes=["stif"],
    ) as simulation:
        before, worst = simulation.plant._motors.position.copy(), 0.0
        for _ in range(200):
            simulation.step()
            moved = np.abs(simulation.plant._motors.position - before).max()
            worst = max(worst, float(moved))
        assert simulation.board.state.powered.all()
        assert worst < 0.1 * DEGREE
