# SPDX-License-Identifier: Apache-2.0
"""SPEC V and M: vocabs and control modes, looked at closely, on the board in process."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig import (
    COMMANDS,
    COMPLIANT,
    MODES_OF_A_JOINT,
    PER_TORQUE,
    POSITION_MODES,
    STANDARD,
    STIFF,
    TAKES,
    M,
    Rig,
    held,
    in_mode,
    joint,
    plain,
    ready,
)

from control_board_ros.core.config.config import Pid, Timeouts
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

UNIMPLEMENTED = (M.CURRENT, M.VELOCITY_DIRECT)
NEVER_SET = ("hwfa", "cal", "cald", "cfgn", "cfgy", "stif", "comp", "xyz", "", 0, -1, 2**40)
#: Texts that are no name, and what is no mode at all.
TEXTS = ("", " pos", "x" * 10_000, "\ud800", "p\0", "🤖")
ODD = (*TEXTS, None, 1.5, True, 2**70, object(), {}, [], [None], b"vel")
#: Texts of requests that a status refuses.
WAY_OUT = {
    M.HW_FAULT: "send FORCE_IDLE first",
    M.CALIBRATING: "abort it with FORCE_IDLE",
    M.NOT_CONFIGURED: "the board waits for configure",
}


def test_pwm_is_openloop() -> None:
    """V1, M5: `ipwm` is another name of OPENLOOP and reads back `open`."""
    rig = ready()
    for name in ("ipwm", 1836544105):
        rig.board.set_control_mode(0, "idl")
        assert rig.board.set_control_mode(0, name)
        assert rig.board.get_control_mode(0)[0].code == "open"


def short(value: Any) -> str:
    """The id of a test; an object's address differs from run to run."""
    return ascii(value).partition(" at 0x")[0][:30]


def after(mode: ControlMode, wanted: Any, sensed: bool) -> tuple[ControlMode, Answer]:
    """The mode after a request, and its answer."""
    if not isinstance(wanted, ControlMode) or mode is M.NOT_CONFIGURED:
        return mode, Answer.REFUSED  # M6, N4
    if wanted is M.FORCE_IDLE:
        return M.IDLE, Answer.ACCEPTED  # F2, F4, K2
    if mode in (M.HW_FAULT, M.CALIBRATING):
        return mode, Answer.REFUSED  # F2, K2
    if wanted in UNIMPLEMENTED or (wanted is M.TORQUE and not sensed):
        return M.HW_FAULT, Answer.UNSUPPORTED  # M5, I7
    return wanted, Answer.ACCEPTED  # M1


@pytest.mark.parametrize(("mode", "interaction", "sensed"), MODES_OF_A_JOINT, ids=str)
def test_every_request_in_every_mode(
    mode: ControlMode, interaction: InteractionMode, sensed: bool
) -> None:
    """M1, M5, M6, F2, F4, K2, N4: the mode, the answer and its words, and what has power."""
    for wanted in (*STANDARD, M.FORCE_IDLE, *UNIMPLEMENTED, *NEVER_SET):
        rig = in_mode(mode, interaction, sensed=sensed)
        version = rig.board.modes_version
        entered, answer = after(mode, wanted, sensed)
        reply = rig.board.set_control_mode("left", wanted)
        case = f"{mode.name} -> {wanted}: {reply}"
        assert bool(reply) is (answer is Answer.ACCEPTED) is (reply.message == ""), case
        assert reply.answers == (answer,), case
        if answer is Answer.REFUSED and isinstance(wanted, ControlMode):
            assert WAY_OUT[mode] in reply.message, case
        assert (rig.board.modes_version > version) is (entered is not mode), case
        rig.tick(2)
        assert rig.modes() == [entered], case
        assert rig.board.get_interaction_mode() == [interaction], case
        assert rig.board.get_faults("left")[0].active is (entered is M.HW_FAULT), case
        if entered in (M.IDLE, M.HW_FAULT, M.NOT_CONFIGURED):
            assert rig.board.state.powered[0] == rig.board.snapshot().output[0] == 0.0, case


@pytest.mark.parametrize(("mode", "interaction", "sensed"), MODES_OF_A_JOINT, ids=str)
def test_each_mode_accepts_its_commands(
    mode: ControlMode, interaction: InteractionMode, sensed: bool
) -> None:
    """M3, M4, M11, I3, N4: each mode and status, each interaction mode, each kind of reference.

    What a mode takes is read back; what it does not is counted, and changes nothing else.
    """
    rig = in_mode(mode, interaction, sensed=sensed)
    board = rig.board
    assert board.get_interaction_mode() == [interaction]
    for kind, (method, getter, value) in COMMANDS.items():
        before, rejected = rig.everything(), board.snapshot().rejected_commands[0]
        reply = getattr(board, method)("left", value)
        taken = kind in TAKES[mode]
        assert bool(reply) is taken
        assert board.snapshot().rejected_commands[0] == rejected + (not taken)
        if taken:
            assert getattr(board, getter)("left")[0] == value
        else:
            want = Answer.REFUSED if mode is M.NOT_CONFIGURED else Answer.IGNORED
            assert reply.answers == (want,)
            assert f"left ignored: mode is {mode.name}" in reply.message
            assert rig.everything() == before
    rig.tick()
    assert rig.modes() == [mode]


@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize("mode", [*STANDARD, M.HW_FAULT], ids=str)
def test_ignored_commands_are_never_kept(mode: ControlMode, interaction: InteractionMode) -> None:
    """M4, M2, M9, D2: it switches no mode; it moves nothing, now and in a mode that takes it."""
    rig = in_mode(mode, interaction)
    ignored = [kind for kind in COMMANDS if kind not in TAKES[mode]]
    for kind in ignored:
        getattr(rig.board, COMMANDS[kind][0])("left", COMMANDS[kind][2])
    shown = rig.run(0.3)
    assert rig.modes() == [mode]
    assert shown.position[0] == pytest.approx(0.0, abs=1e-3)
    assert shown.rejected_commands[0] == len(ignored)
    for later, kinds in TAKES.items():
        if kinds & set(ignored):
            rig.enter(later, "left")
            assert rig.run(0.2).position[0] == pytest.approx(0.0, abs=3e-3)


def test_rejected_commands_touch_no_state(rig: Rig) -> None:
    """M4: after ignored commands the board is bit for bit as without them."""
    other = ready()
    for one in (rig, other):
        one.enter("pos")
        assert one.board.position_move(None, 0.5, 1.0)
    for _ in range(200):
        rig.board.velocity_move(None, 1.0)
        rig.board.set_position(None, 1.0)
        rig.board.set_ref_torque([0, 1], 3.0)
        rig.board.set_output(None, 30.0)
        rig.board.position_move(None, [np.nan] * 3)
        one, two = rig.tick(), other.tick()
        assert np.array_equal(one.block, two.block, equal_nan=True)
    assert one.rejected_commands.tolist() == [1000, 1000, 800]
    assert not two.rejected_commands.any()


def test_no_power_in_the_cycle_of_a_request(rig: Rig) -> None:
    """M7, M10, F1: a request acts on all its joints in one cycle; what is off is off at once."""
    rig.enter("open")
    rig.board.set_output(None, 3.0)
    assert np.all(rig.tick().output == 3.0)
    assert rig.board.set_control_mode([0, 2], "idl")
    assert not rig.board.set_control_mode(1, "veld")
    assert np.all(rig.board.snapshot().output == 0.0)
    actuation = rig.board.tick(rig.plant.read())
    assert not actuation.pwm.any()
    assert not actuation.powered.any()


def test_a_request_reaches_all_joints_between_two_cycles(rig: Rig) -> None:
    """M7: many joints switch in the same control cycle."""
    assert not rig.board.tick(rig.plant.read()).powered.any()
    assert rig.board.set_control_mode(None, "pos")
    assert np.all(rig.board.tick(rig.plant.read()).powered == 1.0)


@pytest.mark.parametrize("mode", STANDARD, ids=str)
def test_the_same_mode_again(mode: ControlMode) -> None:
    """M8: asking for the mode a joint is in changes nothing at all, bit for bit."""
    rigs = ready(), ready()
    for rig in rigs:
        rig.enter(mode, "left")
        for method, _, value in COMMANDS.values():
            getattr(rig.board, method)("left", value)
        rig.run(0.05)
    for _ in range(100):
        version = rigs[0].board.modes_version
        assert rigs[0].board.set_control_mode("left", mode)
        assert rigs[0].board.modes_version == version
        assert np.array_equal(rigs[0].tick().block, rigs[1].tick().block, equal_nan=True)


def loaded() -> Rig:
    """Joints at rest at 0.3 rad that carry 4 N·m; the laws have their gains."""
    rig = held(
        joint("left", position_pid=Pid(kp=400.0, ki=400.0, kd=40.0, integral_limit=20.0)),
        joint("right"),
        plain("bare"),
    )
    rig.plant.values[Row.POSITION] = 0.3
    rig.plant.values[Row.TORQUE] = 4.0
    rig.board.power_cycle()  # or the step to 0.3 rad is a spike
    rig.tick(3)
    return rig


#: Real changes: from the modes that differ in what they leave behind, to any other.
CHANGES = [
    (before, mode)
    for before in (M.IDLE, M.POSITION, M.VELOCITY, M.TORQUE, M.OPENLOOP)
    for mode in STANDARD
    if before is not mode
]


@pytest.mark.parametrize(("before", "mode"), CHANGES, ids=str)
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_references_on_entering_a_mode(
    mode: ControlMode, interaction: InteractionMode, before: ControlMode
) -> None:
    """M9: position := measured, velocity := 0, torque := measured, output := 0: no drop."""
    rig = loaded()
    board = rig.board
    board.set_interaction_mode("left", interaction)
    rig.enter(before, "left")
    for method, _, value in COMMANDS.values():
        getattr(board, method)("left", 2 * value)
    rig.tick(20)
    rig.plant.values[Row.POSITION] += 0.01
    rig.tick(2)
    assert board.set_control_mode("left", mode)
    now = board.snapshot()
    assert now.position_reference[0] == pytest.approx(0.31)
    assert now.velocity_reference[0] == 0.0
    assert now.motion_done[0]
    then = rig.tick()
    assert then.position_reference[0] == pytest.approx(0.31)
    assert then.velocity_reference[0] == 0.0
    carries = mode in (*POSITION_MODES, M.TORQUE)
    if carries:
        assert then.output[0] == pytest.approx(4.0 * PER_TORQUE, rel=1e-6)
    else:
        assert then.output[0] == 0.0
    if mode is M.TORQUE or (mode in POSITION_MODES and interaction is COMPLIANT):
        assert then.torque_reference[0] == pytest.approx(4.0)
    rig.plant.values[Row.TORQUE, 0] = 4.0
    later = rig.tick(10)
    assert later.position_reference[0] == pytest.approx(0.31)
    assert later.output[0] == pytest.approx(then.output[0], abs=1e-9)


@pytest.mark.fresh("0.79 of 0.9 of the speed is left")
def test_a_torque_ends_the_stop_of_entering_torque() -> None:
    """M9: the reference stays where a torque took over; nothing stops a joint that follows one."""
    rig = in_mode(M.POSITION_DIRECT, STIFF)
    assert rig.board.set_position(0, 1.5)
    rig.tick(25)
    assert rig.board.snapshot().velocity[0] > 0.9
    assert rig.board.set_control_mode(0, "torq")
    assert rig.board.set_ref_torque(0, 0.1)
    begin = float(rig.tick().position_reference[0])
    for _ in range(100):
        shot = rig.tick()
        assert (shot.position_reference[0], shot.velocity_reference[0]) == (begin, 0.0)
    assert shot.position[0] > begin + 0.05, "it has moved on"


def test_controllers_start_afresh() -> None:
    """M9: nothing of an earlier integral is left when a mode is entered again."""
    rig = held(joint("left", timeouts=Timeouts(velocity=0.0)))
    rig.enter("pos")
    rig.board.position_move("left", 0.02, 3.0)
    rig.tick(100)  # the joint does not move: the integral grows
    assert rig.board.snapshot().output[0] > 0.03 * 400 * PER_TORQUE * 0.3
    rig.board.set_control_mode("left", "vel")
    assert rig.tick().output[0] == 0.0
    rig.board.velocity_move("left", 0.3, 20.0)
    rig.tick(50)
    rig.board.set_control_mode("left", "mix")
    assert rig.tick(2).output[0] == 0.0
    rig.enter("torq")
    rig.board.set_ref_torque("left", 3.0)
    rig.tick(50)
    assert rig.board.snapshot().output[0] > 3.0 * PER_TORQUE
    rig.board.set_control_mode("left", "idl")
    rig.board.set_control_mode("left", "torq")
    assert rig.tick(5).output[0] == pytest.approx(0.0, abs=1e-12)
    rig.board.set_control_mode("left", "open")
    rig.board.set_output("left", 7.0)
    assert rig.tick().output[0] == pytest.approx(7.0)
    rig.board.set_control_mode("left", "posd")
    rig.board.set_control_mode("left", "open")
    assert rig.tick().output[0] == 0.0


def test_idle_and_faults_are_unpowered(rig: Rig) -> None:
    """M10, F1, N1: bridge open, PWM exactly zero, whatever was requested."""
    rig.board.set_feedforward(None, outputs=5.0, torques=None)
    rig.plant.push("left", 1.0)
    rig.board.set_control_mode("right", "veld")
    for _ in range(50):
        actuation = rig.board.tick(rig.plant.read())
        assert not actuation.pwm.any()
        assert not np.signbit(actuation.pwm).any()
        assert not actuation.powered.any()
        rig.plant.write(actuation)
    assert rig.board.get_encoder("left")[0] > 1e-4  # pushed, and nothing holds it


def test_last_accepted_references(rig: Rig) -> None:
    """M11: each kind keeps its own, across modes, faults and ignored commands."""
    board = rig.board
    for mode, kinds in TAKES.items():
        for kind in kinds:
            rig.enter(mode, "left")
            method, getter, value = COMMANDS[kind]
            assert getattr(board, method)("left", value)
            assert getattr(board, getter)("left")[0] == value
            getattr(board, method)("left", float("nan"))
            assert getattr(board, getter)("left")[0] == value
    board.set_control_mode("left", "veld")
    rig.tick(3)
    for method, getter, value in COMMANDS.values():
        getattr(board, method)("left", 3 * value)
        assert getattr(board, getter)("left")[0] == value


def test_modes_belong_to_the_user(rig: Rig) -> None:
    """M2: motion, limits, timeouts and time change no mode."""
    board = rig.board
    for mode in STANDARD:
        rig.enter(mode, "left")
        for method, _, _value in COMMANDS.values():
            getattr(board, method)("left", 50.0)
        rig.run(1.0)
        assert rig.modes()[0] is mode


TWICE_OR_UNKNOWN = [[0, 0], ["left", 0], ["left", "nose"], 9, -1, 2**70, *TEXTS]
NO_JOINTS = [[True], 1.5, b"left", [[0]], [None], object(), {"x"}]


@pytest.mark.parametrize("joints", [*TWICE_OR_UNKNOWN, *NO_JOINTS], ids=short)
def test_wrong_joints_change_nothing(rig: Rig, joints: Any) -> None:
    """M7: a request with any unknown joint, or one twice, is refused whole."""
    board = rig.board
    rig.enter("pos")
    before = rig.everything()
    for reply in (
        board.set_control_mode(joints, "vel"),
        board.set_interaction_mode(joints, "comp"),
        board.set_impedance(joints, 1.0, 1.0),
        board.set_ref_speed(joints, 1.0),
        board.position_move(joints, 0.1),
        board.calibrate(joints),
        board.stop(joints),
    ):
        assert not reply
        assert "joint" in reply.message
        assert "\n" not in reply.message
    assert rig.everything() == before


@pytest.mark.parametrize(
    ("method", "modes"),
    [
        ("set_control_mode", ["pos", "vel"]),
        ("set_interaction_mode", ["comp", "stif"]),
        *(("set_control_mode", ["idl", wrong, "idl"]) for wrong in (*NEVER_SET, *ODD)),
        *(("set_interaction_mode", ["comp", wrong, "comp"]) for wrong in ("pos", "hwfa", *ODD)),
        *((kind, modes) for modes in ODD for kind in ("set_control_mode", "set_interaction_mode")),
    ],
    ids=short,
)
def test_wrong_modes_change_nothing(rig: Rig, method: str, modes: Any) -> None:
    """M6, M7, I1: too few modes, or one that cannot be set, and the request is refused whole."""
    assert rig.board.set_control_mode(None, [M.VELOCITY, M.POSITION, M.MIXED])
    before = rig.everything()
    reply = getattr(rig.board, method)(None, modes)
    assert not reply
    assert "\n" not in reply.message
    assert 0 < len(reply.message) < 400
    assert rig.everything() == before
