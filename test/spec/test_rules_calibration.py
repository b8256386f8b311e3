# SPDX-License-Identifier: Apache-2.0
"""SPEC K and N: calibration, configuration and power-on, looked at closely, in process."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import (
    COMMANDS,
    COMPLIANT,
    STANDARD,
    STATUSES,
    STIFF,
    M,
    Rig,
    board_config,
    in_status,
    joint,
    ready,
    truth,
)

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.vocabs import ControlMode

SENSOR = Calibration(type=12, zero=0.7)
OFFSET = Calibration(type=3, zero=0.7, start=-0.4, speed=1.0)
STOP = Calibration(type=5, output=-4.0, stop=-2.2, start=0.2, speed=1.0)
ALL = (SENSOR, OFFSET, STOP)
NAMES = ["absolute sensor", "offset and move", "hard stop"]
REQUESTS = ("pos", "posd", "vel", "mix", "torq", "open", "idl", "icur", "veld")


def calibrating(calibration: Calibration, **changes: Any) -> Rig:
    """A joint at 0.5 rad whose encoder reads 0.7 more; it must calibrate and has not ticked."""
    one = joint("left", calibration=calibration, **changes)
    return Rig(board_config(one), home=[0.5], zero=[0.7])


@pytest.mark.fresh("its first answer is one of a joint that moves")
@pytest.mark.parametrize("calibration", ALL, ids=NAMES)
def test_calibrators_find_the_zero(calibration: Calibration) -> None:
    """K5, K1, K3, N2: requested at start-up; the angle is wrong until the zero is known."""
    rig = calibrating(calibration)
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert truth(rig) == 0.5
    known = calibration.type != 5  # from the first reading on
    assert rig.tick().position[0] == pytest.approx(0.5 if known else 1.2, abs=1e-3)
    if calibration.type != 12:  # which is instant
        assert rig.modes() == [M.CALIBRATING]
        status = rig.board.get_calibration("left")[0]
        assert (status.running, status.done) == (True, False)
    moving: list[float] = []
    progress = [one.progress for one in (rig.tick() and rig.board.get_calibration("left"))]
    while rig.modes() == [M.CALIBRATING]:
        status = rig.board.get_calibration("left")[0]
        progress.append(status.progress)
        if status.phase == "moving to the start position":
            moving.append(status.progress)
        assert rig.board.cycle < 10000
        rig.tick()
    assert rig.modes() == [M.POSITION]
    assert rig.board.get_interaction_mode("left") == [STIFF]
    assert np.all(np.diff(progress) >= 0.0)
    if moving:  # its second half
        assert moving[0] == pytest.approx(0.5, abs=0.01)
        assert moving[-1] == pytest.approx(1.0, abs=0.01)
    status = rig.board.get_calibration("left")[0]
    assert (status.running, status.done, status.progress) == (False, True, 1.0)
    assert status.message == ""
    shown = rig.run(0.5)
    assert shown.position[0] == pytest.approx(truth(rig), abs=2e-3)
    where = 0.5 if calibration.type == 12 else calibration.start
    assert truth(rig) == pytest.approx(where, abs=0.02)
    assert any(event.key == "calibrated" for event in rig.board.take_events())


@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize("start", STANDARD, ids=str)
@pytest.mark.parametrize("calibration", ALL[1:], ids=NAMES[1:])
def test_a_user_calibrates_a_configured_joint(
    calibration: Calibration, start: ControlMode, interaction: Any
) -> None:
    """K1, K3: at any time on a configured joint, from every mode; CALIBRATING at once."""
    rig = calibrating(replace(calibration, required=False))
    rig.tick(2)
    assert rig.modes() == [M.IDLE]
    rig.board.set_interaction_mode("left", interaction)
    rig.enter(start)
    assert rig.board.calibrate("left")
    assert rig.modes() == [M.CALIBRATING]
    assert rig.board.get_calibration("left")[0].running
    assert rig.board.state.powered.tolist() == [1.0]  # the controller is on
    assert rig.board.tick(rig.plant.read()).powered.tolist() == [1.0]
    while rig.modes() == [M.CALIBRATING]:
        rig.tick(10)
        assert rig.board.cycle < 6000
    assert rig.modes() == [M.POSITION]
    assert rig.board.get_interaction_mode("left") == [STIFF]


@pytest.mark.parametrize(
    "modes",
    [
        (M.POSITION, COMPLIANT),
        (M.IDLE, STIFF),
        (M.VELOCITY, COMPLIANT),
        (M.TORQUE, STIFF),
    ],
    ids=str,
)
def test_the_modes_after_it(modes: Any) -> None:
    """K3: done, the modes become those of the joint's calibrator."""
    mode, interaction = modes
    rig = calibrating(replace(SENSOR, control_mode=mode, interaction_mode=interaction))
    rig.tick(3)
    assert rig.modes() == [mode]
    assert rig.board.get_interaction_mode("left") == [interaction]
    here = truth(rig)
    rig.run(1.0)
    assert truth(rig) == pytest.approx(here, abs=2e-3)  # M9


def test_requests_and_commands_while_calibrating() -> None:
    """K2: mode requests are refused, commands ignored; the calibration goes on unmoved."""
    rigs = calibrating(OFFSET), calibrating(OFFSET)
    for k in range(1500):
        one, two = rigs[0].tick(), rigs[1].tick()
        assert np.array_equal(one.block, two.block, equal_nan=True)
        if rigs[0].modes() != [M.CALIBRATING]:
            break
        if k % 20 == 0:
            for wanted in (*REQUESTS, "hwfa", "nope"):
                assert not rigs[0].board.set_control_mode("left", wanted)
            for method, _, value in COMMANDS.values():
                assert not getattr(rigs[0].board, method)("left", value)
            assert not rigs[0].board.calibrate("left")
            assert not rigs[0].board.set_interaction_mode("left", "comp")
    assert rigs[0].modes() == [M.POSITION]
    assert k > 100


@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("calibration", ALL[1:], ids=NAMES[1:])
def test_no_feedforward_acts_in_a_calibration(calibration: Calibration, output: str) -> None:
    """K6, P11: one that was set before changes nothing until the joint is calibrated."""
    config = board_config(
        joint("left", calibration=replace(calibration, required=False)), output=output
    )
    rigs = [ready(config, home=[0.5], zero=[0.7]) for _ in range(2)]
    assert rigs[0].board.set_feedforward("left", outputs=3.9, torques=5.0)
    for rig in rigs:
        assert rig.board.calibrate("left")
    for _ in range(10000):
        one, two = (rig.tick() for rig in rigs)
        if rigs[1].modes() != [M.CALIBRATING]:
            break
        assert one.output[0] == two.output[0]
    assert any(rig.board.cycle > 100 for rig in rigs)
    assert [rig.modes() for rig in rigs] == [[M.POSITION]] * 2
    rigs[0].enter("open")
    assert rigs[0].tick().output[0] == pytest.approx(3.9)  # there it acts again


@pytest.mark.parametrize("kind", ["outputs", "torques"])
def test_a_feedforward_offered_while_calibrating(kind: str) -> None:
    """K6, M4: ignored, counted, never kept; the other joints of the message are served."""
    one, two = joint("left", calibration=OFFSET), joint("right", startup_mode=M.POSITION)
    rig = Rig(board_config(one, two), home=[0.5, 0.5], zero=[0.7, 0.0])
    rig.run(0.1)
    assert rig.modes() == [M.CALIBRATING, M.POSITION]
    offset = rig.board.get_torque_offset().tolist()
    reply = rig.board.set_feedforward(None, **{kind: 2.0})
    assert [str(answer) for answer in reply.answers] == ["ignored", "accepted"]
    assert "left" in reply.message
    assert "CALIBRATING" in reply.message
    assert rig.board.rejected_commands.tolist() == [1, 0]
    assert rig.board.get_torque_offset().tolist() == [
        offset[0],
        2.0 if kind == "torques" else offset[1],
    ]
    rig.run(5.0)
    assert rig.modes()[0] is M.POSITION
    assert abs(rig.board.snapshot().output[0]) < 0.5


@pytest.mark.parametrize("calibration", ALL[1:], ids=NAMES[1:])
def test_force_idle_aborts(calibration: Calibration) -> None:
    """K2: FORCE_IDLE aborts it, to IDLE, uncalibrated."""
    rig = calibrating(calibration)
    rig.run(0.2)
    assert rig.board.set_control_mode("left", "fidl")
    assert rig.modes() == [M.IDLE]
    assert not rig.board.state.calibrated[0]
    status = rig.board.get_calibration("left")[0]
    assert (status.running, status.done, status.message) == (False, False, "aborted")
    shown = rig.run(1.0)
    assert rig.modes() == [M.IDLE]
    assert shown.output[0] == 0.0
    assert rig.board.calibrate("left")
    rig.run(12.0)
    assert rig.board.get_calibration("left")[0].done


def uncalibrated(calibration: Calibration = OFFSET, **changes: Any) -> Rig:
    """A joint that requires a calibration and has none: aborted, so in IDLE."""
    rig = calibrating(calibration, **changes)
    rig.run(0.2)
    assert rig.board.set_control_mode("left", "fidl")
    return rig


@pytest.mark.parametrize("wanted", ["pos", "posd", "vel", "mix", "torq", "open", "icur", "veld"])
def test_uncalibrated_joint_refuses_modes(wanted: str) -> None:
    """K7: refused with the reason and the next step; it faults nothing and moves nothing."""
    rig = uncalibrated()
    reply = rig.board.set_control_mode("left", wanted)
    assert [str(answer) for answer in reply.answers] == ["refused"]
    assert (
        reply.message
        == "left is not calibrated; until then it accepts idl, fidl and a calibration"
    )
    rig.tick(2)
    assert rig.modes() == [M.IDLE]
    assert not rig.board.get_faults("left")[0].active
    assert rig.board.snapshot().output[0] == 0.0


def test_requests_accepted_by_an_uncalibrated_joint() -> None:
    """K7, I2: IDLE, FORCE_IDLE, calibration, and an interaction mode, stored as in IDLE."""
    rig = uncalibrated()
    assert rig.board.set_control_mode("left", "idl")
    assert rig.board.set_control_mode("left", "fidl")
    assert rig.board.set_interaction_mode("left", "comp")
    assert rig.board.get_interaction_mode("left") == [COMPLIANT]
    assert rig.modes() == [M.IDLE]
    assert rig.board.calibrate("left")
    rig.run(12.0)
    assert rig.modes() == [M.POSITION]
    assert rig.board.set_control_mode("left", "torq")


def test_the_others_of_a_request_are_served() -> None:
    """K7, M7: a joint without its calibration refuses for itself; the answers name it."""
    one, two = joint("left", calibration=OFFSET), joint("right")
    rig = Rig(board_config(one, two), home=[0.5, 0.5], zero=[0.7, 0.0])
    rig.run(0.2)
    rig.board.set_control_mode("left", "fidl")
    reply = rig.board.set_control_mode(["left", "right"], "pos")
    assert [str(answer) for answer in reply.answers] == ["refused", "accepted"]
    assert rig.modes() == [M.IDLE, M.POSITION]


@pytest.mark.parametrize("how", ["aborted", "failed", "power cycle", "restart of its drive"])
def test_a_calibration_that_is_lost_is_shown(how: str) -> None:
    """K7: the snapshot, get_calibration and requests agree on the calibrated joints."""
    rig = calibrating(OFFSET)
    rig.run(12.0)
    assert rig.board.snapshot().calibrated.tolist() == [True]
    assert rig.board.get_calibration("left")[0].calibrated
    if how == "power cycle":
        rig.board.power_cycle()
    elif how == "restart of its drive":  # S9: with its fault
        rig.plant.inject("left", "external")
        rig.run(0.05)
        read = rig.plant.read
        rig.plant.read = lambda: replace(read(), lost=(0,))
        rig.tick(3)
        rig.plant.read = read
        rig.plant.clear_injected()
        rig.run(0.05)
        assert rig.board.set_control_mode("left", "fidl")
    else:
        assert rig.board.calibrate("left")
        rig.tick(3)
        if how == "failed":
            rig.plant.inject("left", "external")
            rig.run(0.05)
            assert rig.modes() == [M.HW_FAULT]
        assert rig.board.set_control_mode("left", "fidl")
    assert rig.board.snapshot().calibrated.tolist() == [False]
    assert not rig.board.get_calibration("left")[0].calibrated
    assert not rig.board.set_control_mode("left", "pos")


@pytest.mark.parametrize("how", ["aborted", "failed"])
@pytest.mark.parametrize("calibration", ALL[1:], ids=NAMES[1:])
def test_joints_without_required_calibration_recover_angle_and_limits(
    calibration: Calibration, how: str
) -> None:
    """K2, K4, P9: what an aborted or failed calibration changed is taken back, limits stay."""
    wrong = replace(calibration, required=False, zero=-1.0, stop=-2.0)
    one = joint("left", calibration=wrong, startup_mode=M.POSITION)
    rig = ready(board_config(one), home=[-0.5], zero=[0.7])
    right = float(rig.board.get_encoder("left")[0])
    assert right == pytest.approx(1.2, abs=1e-3)  # -0.5 + 0.7 + 1.0: as its zero has it
    assert rig.board.calibrate("left")
    while rig.board.get_calibration("left")[0].phase != "moving to the start position":
        rig.tick()
        assert rig.board.cycle < 5000
    if how == "failed":
        rig.plant.inject("left", "external")
        rig.run(0.05)
        assert rig.modes() == [M.HW_FAULT]
    assert rig.board.set_control_mode("left", "fidl")
    shown = rig.run(0.1)
    assert shown.position[0] - truth(rig) == pytest.approx(1.7, abs=1e-4)
    assert shown.position_reference[0] - shown.position[0] == pytest.approx(0.0, abs=0.02)
    status = rig.board.get_calibration("left")[0]
    assert (status.done, status.calibrated) == (False, True)
    rig.enter("posd")
    rig.board.set_position("left", 5.0)
    rig.run(1.0)
    assert rig.board.snapshot().position_reference[0] == pytest.approx(2.0)


@pytest.mark.fresh("counted from the first reading")
def test_timeout() -> None:
    """K4: a calibration that does not end in time: HW_FAULT with the reason."""
    rig = calibrating(replace(OFFSET, speed=0.05, timeout=0.5))
    rig.run(0.45)
    assert rig.modes() == [M.CALIBRATING]
    rig.run(0.1)
    assert rig.modes() == [M.HW_FAULT]
    fault = rig.board.get_faults("left")[0]
    assert fault.code == 20
    assert fault.text.startswith(
        "calibration failed, timed out after 0.5 s while moving to the start position"
    )
    status = rig.board.get_calibration("left")[0]
    assert (status.running, status.done) == (False, False)
    assert "timed out" in status.message
    assert rig.board.set_control_mode("left", "fidl")
    assert rig.modes() == [M.IDLE]


def test_a_fault_while_calibrating() -> None:
    """K4, F1: any fault ends a calibration; its status says which."""
    rig = calibrating(STOP)
    rig.run(0.2)
    rig.plant.inject("left", "overheating")
    rig.run(0.05)
    assert rig.modes() == [M.HW_FAULT]
    assert "overheating" in rig.board.get_calibration("left")[0].message
    assert rig.board.snapshot().output[0] == 0.0


@pytest.mark.fresh("the phases of that cycle")
def test_groups_calibrate_one_after_the_other() -> None:
    """K1, K5: joints of a group together, group after group; waiting joints are at rest."""
    joints = [joint(n, calibration=replace(OFFSET, start=0.2)) for n in ("a", "b", "c")]
    config = board_config(*joints, calibration_groups=(("c",), ("a", "b")))
    rig = Rig(config, home=[0.5, 0.5, 0.5], zero=[0.7, 0.7, 0.7])
    while rig.modes()[2] is M.CALIBRATING or rig.board.cycle < 5:
        rig.tick()
        if rig.modes()[2] is M.CALIBRATING:
            assert [one.phase for one in rig.board.get_calibration(["a", "b"])] == ["waiting"] * 2
            assert rig.plant.body._position[:2] == pytest.approx(0.5, abs=2e-3)
    assert rig.modes() == [M.CALIBRATING, M.CALIBRATING, M.POSITION]
    rig.run(3.0)
    assert rig.modes() == [M.POSITION] * 3
    assert rig.plant.body._position == pytest.approx(0.2, abs=0.02)


def in_turn(calibration: Calibration = STOP) -> Rig:
    """Two idle joints; ``first`` is of the group before that of ``second``."""
    names = ("first", "second")
    joints = [joint(n, calibration=replace(calibration, required=False)) for n in names]
    rig = Rig(board_config(*joints, calibration_groups=(("first",), ("second",))))
    rig.tick(2)
    return rig


def phases(rig: Rig) -> list[str]:
    """What the calibrations of all joints are at."""
    return [one.phase for one in rig.board.get_calibration()]


def test_running_calibrations_continue() -> None:
    """K1: a calibrator that drives is not suspended by a joint of an earlier group."""
    rig = in_turn()
    assert rig.board.calibrate("second")
    rig.run(0.1)
    assert rig.board.calibrate("first")
    while rig.modes()[1] is M.CALIBRATING:
        rig.tick()
        assert phases(rig)[0] == "waiting"
        assert rig.board.cycle < 20000
    assert rig.modes() == [M.CALIBRATING, M.POSITION]
    rig.run(12.0)
    assert rig.modes() == [M.POSITION, M.POSITION]


def test_monitoring_of_a_calibrator_continues_when_another_is_requested() -> None:
    """K4: the timeout of a joint that drives runs, also while others calibrate."""
    rig = in_turn(replace(STOP, timeout=0.7))
    assert rig.board.calibrate("second")
    rig.run(0.1)
    assert rig.board.calibrate("first")
    rig.run(0.65)
    assert rig.modes() == [M.CALIBRATING, M.HW_FAULT]
    assert "timed out after 0.7 s" in rig.board.get_faults("second")[0].text
    assert phases(rig)[0] == "driving to the hard stop"


def test_joints_added_later_wait_for_earlier_groups() -> None:
    """K1: joints of the driving group that are requested later come after waiting ones."""
    names = ("first", "second", "third")
    joints = [joint(n, calibration=replace(STOP, required=False)) for n in names]
    rig = Rig(board_config(*joints, calibration_groups=(("first",), ("second", "third"))))
    rig.tick(2)
    for name in ("second", "first", "third"):
        assert rig.board.calibrate(name)
        rig.run(0.1)
    assert phases(rig) == ["waiting", "driving to the hard stop", "waiting"]
    rig.board.set_control_mode("second", "fidl")
    rig.run(0.1)
    assert phases(rig) == ["driving to the hard stop", "aborted", "waiting"]


# --- N ---------------------------------------------------------------------------------------


def test_power_on() -> None:
    """N1, N4: NOT_CONFIGURED, no power; other requests than for modes are refused, too."""
    rig = in_status(M.NOT_CONFIGURED)
    assert "configure" in rig.board.position_move("left", 0.1).message
    assert not rig.board.calibrate("left")
    assert not rig.board.stop("left")
    rig.plant.push("left", 1.0)
    for _ in range(100):
        actuation = rig.board.tick(rig.plant.read())
        assert not actuation.powered.any()
        assert not actuation.pwm.any()
        rig.plant.write(actuation)
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert truth(rig) > 1e-3


@pytest.mark.parametrize(
    ("mode", "interaction"),
    [(M.IDLE, STIFF), (M.POSITION, STIFF), (M.POSITION, COMPLIANT)],
    ids=str,
)
def test_configured_default(mode: ControlMode, interaction: Any) -> None:
    """N3, N2: the whole configuration leads to the joint's default, without a move."""
    one = joint("left", startup_mode=mode, startup_interaction=interaction)
    rig = Rig(board_config(one, autoconfigure=False), home=[0.6])
    rig.run(0.1)
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.configure()
    assert rig.modes() == [mode]
    assert rig.board.get_interaction_mode("left") == [interaction]
    assert rig.board.get_target_position("left")[0] == pytest.approx(0.6)
    rig.run(0.5)
    assert truth(rig) == pytest.approx(0.6, abs=2e-3)
    reply = rig.board.configure()
    assert not reply
    assert rig.modes() == [mode]


def test_autoconfigure() -> None:
    """N2: with autoconfigure the first cycle configures; a calibrator's zero is used."""
    sensor = joint("left", calibration=replace(SENSOR, required=False), startup_mode=M.POSITION)
    rig = Rig(board_config(sensor), home=[0.5], zero=[0.7])
    assert rig.modes() == [M.NOT_CONFIGURED]
    shown = rig.tick()
    assert rig.modes() == [M.POSITION]
    assert shown.position[0] == pytest.approx(0.5)
    rig.run(0.5)
    assert truth(rig) == pytest.approx(0.5, abs=2e-3)


def test_required_calibration_and_the_command() -> None:
    """N2, N3: a joint that requires calibration leaves only through CALIBRATING."""
    first, second = joint("left", calibration=OFFSET), joint("right")
    rig = Rig(board_config(first, second, autoconfigure=False), home=[0.5, 0.5], zero=[0.7, 0.0])
    rig.run(0.05)
    assert rig.modes() == [M.NOT_CONFIGURED] * 2
    assert rig.board.configure()
    assert rig.modes() == [M.CALIBRATING, M.IDLE]
    rig.run(5.0)
    assert rig.modes() == [M.POSITION, M.IDLE]


@pytest.mark.fresh("configured after the first answer")
@pytest.mark.parametrize("calibration", [None, *ALL], ids=["none", *NAMES])
@pytest.mark.parametrize("first", ["configure", "cycle and configure"])
def test_configured_before_a_reading(calibration: Calibration | None, first: str) -> None:
    """N3, M9: configured before a reading is there, no joint jumps."""
    one = joint("left", calibration=calibration, startup_mode=M.POSITION)
    rig = Rig(board_config(one, autoconfigure=False), home=[0.5], zero=[0.7 * bool(calibration)])
    if first != "configure":
        rig.tick()
        rig.board.configure()
        rig.run(14.0)
        rig.board.power_cycle()
    here = truth(rig)
    assert rig.board.configure()
    rig.run(0.02)
    assert truth(rig) == pytest.approx(here, abs=0.01)
    assert M.NOT_CONFIGURED not in rig.modes()


def test_waiting_joints_hold_after_a_power_cycle() -> None:
    """N1, K1: after a power cycle a joint that waits for its turn holds where it is."""
    joints = [joint(n, calibration=replace(OFFSET, start=0.2)) for n in ("a", "b")]
    config = board_config(*joints, calibration_groups=(("b",), ("a",)), autoconfigure=False)
    rig = Rig(config, home=[0.5, 0.5], zero=[0.7, 0.7])
    rig.tick()
    rig.board.configure()
    rig.run(8.0)
    rig.board.power_cycle()
    rig.board.configure()
    rig.run(0.05)
    assert truth(rig) == pytest.approx(0.2, abs=0.02)


def test_power_cycle() -> None:
    """N1, F5: back to power-on: modes, references, impedance and offsets anew; faults stay."""
    rig = ready(board_config(joint("left", calibration=SENSOR, startup_mode=M.POSITION)))
    rig.board.set_impedance("left", 1.0, 1.0)
    rig.board.set_ref_speed("left", 2.0)
    rig.board.set_feedforward("left", outputs=3.0, torques=3.0)
    rig.board.position_move("left", 0.5)
    rig.board.set_interaction_mode("left", "comp")
    rig.board.set_control_mode("left", "veld")
    fault = rig.board.get_faults("left")[0]
    rig.board.power_cycle()
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.snapshot().output[0] == 0.0
    assert not rig.board.get_faults("left")[0].active
    assert rig.board.get_faults("left")[0].text == fault.text
    assert rig.board.get_interaction_mode("left") == [STIFF]
    assert np.ravel(rig.board.get_impedance("left")).tolist() == [50.0, 5.0]
    assert not rig.board.get_calibration("left")[0].done
    rig.tick(2)
    assert rig.modes() == [M.POSITION]
    assert abs(rig.board.snapshot().output[0]) < 1.0
    assert rig.board.get_ref_speed("left")[0] == pytest.approx(np.radians(10.0))


@pytest.mark.parametrize("start", [*STANDARD, *STATUSES], ids=str)
def test_power_cycle_from_everywhere(start: ControlMode) -> None:
    """N1: after power-on a joint is NOT_CONFIGURED and without power, also on ~/modes."""
    rig = in_status(start if start in STATUSES else M.IDLE)
    if start in STANDARD:
        rig.enter(start)
        rig.board.set_output("left", 3.0)
        rig.tick()
    before = rig.board.modes_version
    rig.board.power_cycle()
    assert rig.modes() == [M.NOT_CONFIGURED]
    assert rig.board.modes_version > before
    assert rig.board.snapshot().output[0] == 0.0
    assert not rig.board.state.powered.any()
