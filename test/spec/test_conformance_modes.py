# SPDX-License-Identifier: Apache-2.0
"""Control and interaction modes as a user meets them, in process and over ROS."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rig import COMMANDS, COMPLIANT, STIFF, TAKES, M

from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode, encode

MODES = [mode for mode in TAKES if mode not in (M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED)]
STATUSES_AND_EVENTS = ["hwfa", "cal", "cald", "cfgn", "cfgy"]


def send(board: Any, kind: str, joints: Any, values: Any = None) -> Any:
    """A reference of a kind to joints."""
    method, _, value = COMMANDS[kind]
    return getattr(board, method)(joints, value if values is None else values)


def test_modes_of_one_a_subset_and_all(board: Any) -> None:
    """M1, A: every joint has its own mode; modes are set for one joint, a subset, or all."""
    assert board.set_control_mode("right", "vel")
    assert board.get_control_mode(None) == [M.IDLE, M.VELOCITY, M.IDLE]
    assert board.set_control_mode([2, "left"], [M.MIXED, M.TORQUE])
    assert board.get_control_mode([0, 1, 2]) == [M.TORQUE, M.VELOCITY, M.MIXED]
    assert board.get_control_mode(["bare", "right"]) == [M.MIXED, M.VELOCITY]
    assert board.set_control_mode(None, "POSITION")
    assert board.get_control_mode() == [M.POSITION] * 3
    board.run(0.02)
    assert board.get_control_mode("left") == [M.POSITION]


@pytest.mark.parametrize("mode", MODES, ids=str)
def test_no_automatic_switch(board: Any, mode: ControlMode) -> None:
    """M2, D2: no command and no time makes a joint leave its mode; only the user switches."""
    assert board.set_control_mode(0, mode)
    for kind in COMMANDS:
        send(board, kind, 0)
        assert board.get_control_mode(0) == [mode]
    board.run(0.5)
    assert board.get_control_mode(0) == [mode]


@pytest.mark.parametrize("mode", [M.MIXED, M.TORQUE, M.IDLE], ids=str)
def test_accepted_commands(board: Any, mode: ControlMode) -> None:
    """M3, M4, M11: what a mode takes is read back; the rest is counted, and says why.

    All modes, with all that must stay as it is: test_each_mode_takes_its_commands.
    """
    assert board.set_control_mode("left", mode)
    for kind, (_, getter, value) in COMMANDS.items():
        before, count = getattr(board, getter)("left")[0], board.rejected("left")[0]
        reply = send(board, kind, "left")
        if kind in TAKES[mode]:
            assert reply, reply.message
            assert getattr(board, getter)("left")[0] == pytest.approx(value)
            assert board.rejected("left")[0] == count
        else:
            assert not reply
            assert reply.answers == (Answer.IGNORED,)
            assert mode.name in reply.message
            assert "left" in reply.message
            assert getattr(board, getter)("left")[0] == before
            assert board.rejected("left")[0] == count + 1
    assert board.get_control_mode("left") == [mode]


def test_ignored_commands_leave_no_trace(board: Any) -> None:
    """M4: what a mode does not take moves nothing and is never kept for a later mode."""
    assert board.set_control_mode("left", "torq")
    assert not board.position_move("left", 1.0)
    assert not board.velocity_move("left", 1.0)
    board.run(0.2)
    assert board.get_encoder("left") == pytest.approx(0.0, abs=1e-3)
    for mode in ("pos", "vel", "mix", "posd", "open"):
        assert board.set_control_mode("left", mode)
        board.run(0.2)
        assert board.get_encoder("left") == pytest.approx(0.0, abs=2e-3)


def test_other_joints_of_a_message_are_served(board: Any) -> None:
    """M4: the joints of a message whose mode takes it are served, the others are not."""
    assert board.set_control_mode(["left", "bare"], "pos")
    reply = board.position_move(["left", "right", "bare"], [0.2, 0.3, -0.4], [1.0, 1.0, 1.0])
    assert not reply
    assert reply.answers == (Answer.ACCEPTED, Answer.IGNORED, Answer.ACCEPTED)
    assert board.rejected() == [0, 1, 0]
    board.run(0.8)
    assert board.get_encoder() == pytest.approx([0.2, 0.0, -0.4], abs=0.01)


@pytest.mark.parametrize("mode", ["torq", "icur", "veld"])
def test_a_mode_that_is_not_implemented_faults(board: Any, mode: str) -> None:
    """M5, I7, V1: the joint is in HW_FAULT, a user fault with its reason; the call is an error."""
    reply = board.set_control_mode("bare", mode)
    assert not reply
    assert reply.answers == (Answer.UNSUPPORTED,)
    assert board.get_control_mode() == [M.IDLE, M.IDLE, M.HW_FAULT]
    fault = board.get_faults("bare")[0]
    assert fault.active
    assert mode in fault.text
    assert "unsupported" in fault.text


@pytest.mark.parametrize("mode", [*STATUSES_AND_EVENTS, "nope", "", encode("abcd"), 0])
def test_statuses_and_unknown_vocabs_are_refused(board: Any, mode: str | int) -> None:
    """M6: an error, and nothing changes, for no joint of the request."""
    assert board.set_control_mode(None, ["vel", "pos", "mix"])
    for modes in (mode, ["idl", mode, "idl"]):
        reply = board.set_control_mode(None, modes)
        assert not reply
        assert reply.message
        assert board.get_control_mode() == [M.VELOCITY, M.POSITION, M.MIXED]
    assert not any(fault.active for fault in board.get_faults())


@pytest.mark.parametrize(
    ("joints", "modes"),
    [
        (["left", "nose"], "pos"),
        ("nose", "pos"),
        ([0, 7], "pos"),
        (["left", "left"], "pos"),
        ([0, "left"], "pos"),
        (["left", "right"], ["pos", "vel", "pos"]),
        (None, ["pos", "vel"]),
    ],
    ids=str,
)
def test_a_wrong_request_is_refused_whole(board: Any, joints: Any, modes: Any) -> None:
    """M7, I1: an unknown joint, one named twice, or unlike lengths reject the request whole."""
    reply = board.set_control_mode(joints, modes)
    assert not reply
    assert reply.message
    assert board.get_control_mode() == [M.IDLE] * 3
    interactions = {"pos": "comp", "vel": "stif"}
    wanted = [interactions[m] for m in modes] if isinstance(modes, list) else "comp"
    assert not board.set_interaction_mode(joints, wanted)
    assert board.get_interaction_mode() == [STIFF] * 3


def test_the_present_mode_again_resets_nothing(board: Any) -> None:
    """M8, I4: a running move goes on when the present modes are set again."""
    assert board.set_control_mode("left", "pos")
    assert board.position_move("left", 0.5, 1.0)
    board.run(0.2)
    assert board.set_control_mode("left", "pos")
    assert board.set_interaction_mode("left", "stif")
    assert board.check_motion_done("left") == [False]
    board.run(0.6)
    assert board.get_encoder("left") == pytest.approx(0.5, abs=0.01)


def test_a_change_stops_and_holds(board: Any) -> None:
    """M9: a real change drops the move: the joint holds where it is measured to be."""
    assert board.set_control_mode("left", "pos")
    assert board.position_move("left", 1.0, 1.0)
    board.run(0.4)
    assert board.set_control_mode("left", "posd")
    here = float(board.get_encoder("left")[0])
    assert board.check_motion_done("left") == [True]
    assert board.reference("left") == pytest.approx(here, abs=0.03)
    board.run(1.0)
    assert board.get_encoder("left") == pytest.approx(here, abs=0.05)


@pytest.mark.parametrize("mode", MODES, ids=str)
@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_entering_a_mode_moves_nothing(board: Any, mode: ControlMode, interaction: Any) -> None:
    """M9, I2: no joint moves on entering a mode, stiff or compliant, before a command comes."""
    assert board.set_control_mode("left", "posd")
    assert board.set_position("left", 0.1)
    board.run(2.0)
    here = float(board.get_encoder("left")[0])
    assert board.set_interaction_mode("left", interaction)
    assert board.set_control_mode("left", mode)
    board.run(0.5)
    assert board.get_encoder("left") == pytest.approx(here, abs=2e-3)


def test_idle_is_unpowered(board: Any) -> None:
    """M10, P8: in OPENLOOP the motor gets its PWM, in IDLE exactly nothing."""
    assert board.set_control_mode("left", "open")
    assert board.set_output("left", 4.0)
    board.run(0.02)
    assert board.power("left") == pytest.approx(4.0)
    assert board.set_control_mode("left", "idl")
    for _ in range(3):
        assert board.power("left")[0] == 0.0
        board.run(0.01)


def test_interaction_modes_of_one_a_subset_and_all(board: Any) -> None:
    """I1, A: STIFF or COMPLIANT per joint, one joint, a subset or all."""
    assert board.get_interaction_mode() == [STIFF] * 3
    assert board.set_interaction_mode("right", COMPLIANT)
    assert board.get_interaction_mode() == [STIFF, COMPLIANT, STIFF]
    assert board.set_interaction_mode([1, 0], ["stif", "comp"])
    assert board.get_interaction_mode(["right", "left"]) == [STIFF, COMPLIANT]
    assert board.set_interaction_mode(None, "STIFF")
    assert board.get_interaction_mode() == [STIFF] * 3


def test_the_interaction_mode_survives(board: Any) -> None:
    """I2: stored in IDLE, TORQUE, OPENLOOP, HW_FAULT; it acts when a mode with it is entered."""
    for mode in (M.IDLE, M.TORQUE, M.OPENLOOP):
        assert board.set_control_mode("left", mode)
        for interaction in (COMPLIANT, STIFF, COMPLIANT):
            assert board.set_interaction_mode("left", interaction)
            assert board.get_control_mode("left") == [mode]
    assert not board.set_control_mode("left", "icur")
    assert board.set_interaction_mode("left", "stif")
    assert board.set_interaction_mode("left", "comp")
    assert board.get_control_mode("left") == [M.HW_FAULT]
    assert board.set_control_mode("left", "fidl")
    assert board.set_control_mode("left", "pos")
    assert board.get_interaction_mode("left") == [COMPLIANT]


@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
@pytest.mark.parametrize("mode", MODES, ids=str)
def test_the_interaction_mode_alters_no_commands(
    board: Any, mode: ControlMode, interaction: Any
) -> None:
    """I3, M3: a mode takes the same commands, stiff and compliant."""
    assert board.set_interaction_mode("right", interaction)
    assert board.set_control_mode("right", mode)
    for kind in COMMANDS:
        assert bool(send(board, kind, "right")) is (kind in TAKES[mode])


def test_changing_the_interaction_mode_stops_the_move(board: Any) -> None:
    """I4: a real change in an active mode stops the joint; a new move is needed."""
    assert board.set_control_mode("left", "pos")
    assert board.position_move("left", 1.0, 1.0)
    board.run(0.5)
    assert board.set_interaction_mode("left", "comp")
    assert board.check_motion_done("left") == [True]
    here = float(board.get_encoder("left")[0])
    assert 0.2 < here < 0.8
    board.run(3.0)
    assert board.get_encoder("left") == pytest.approx(here, abs=0.2)
    assert board.get_encoder_speed("left") == pytest.approx(0.0, abs=0.02)
    assert board.position_move("left", 1.0, 1.0)
    board.run(2.0)
    assert board.get_encoder("left") == pytest.approx(1.0, abs=0.05)


def test_impedance_is_set_and_read_at_any_time(board: Any) -> None:
    """I6, A: per joint, in any mode, without a mode change; what is not allowed is an error."""
    for mode in (*MODES, M.HW_FAULT):
        if mode is M.HW_FAULT:
            assert not board.set_control_mode("left", "icur")
        else:
            assert board.set_control_mode("left", mode)
        assert board.set_impedance(["left", "right"], [100.0, 200.0], 7.0)
        stiffness, damping = board.get_impedance(["right", "left"])
        assert stiffness == pytest.approx([200.0, 100.0])
        assert damping == pytest.approx([7.0, 7.0])
        assert board.get_control_mode("left") == [mode]
        for bad in (-1.0, float("nan"), float("inf"), 501.0):
            assert not board.set_impedance(["left", "right"], [10.0, bad], 1.0)
        for bad in (-1.0, float("nan"), float("inf"), 51.0):
            assert not board.set_impedance(["left", "right"], 10.0, [1.0, bad])
        assert np.array(board.get_impedance("left")).ravel() == pytest.approx([100.0, 7.0])
        assert board.set_impedance(["left", "right"], 20.0, 2.0)


def test_a_stiffness_alone_chooses_its_damping(board: Any) -> None:
    """I6, A: without a damping the board takes one that goes with the stiffness."""
    dampings = []
    for stiffness in (50.0, 200.0, 500.0):
        assert board.set_impedance(["left", "right"], stiffness)
        assert board.get_impedance("left")[0] == pytest.approx([stiffness])
        dampings.append(float(board.get_impedance("left")[1][0]))
    assert 0.0 < dampings[0] < dampings[1] < dampings[2] <= 50.0
    assert not board.set_impedance("left", 501.0)
    assert float(board.get_impedance("left")[1][0]) == dampings[2]


def test_compliant_without_a_torque_sensor_faults(board: Any) -> None:
    """I7: a joint without torque sensing implements only STIFF; COMPLIANT is a user fault."""
    reply = board.set_interaction_mode(None, "comp")
    assert not reply
    assert board.get_control_mode() == [M.IDLE, M.IDLE, M.HW_FAULT]
    assert board.get_interaction_mode() == [COMPLIANT, COMPLIANT, STIFF]
    assert "comp" in board.get_faults("bare")[0].text
    modes, interactions = board.get_available_modes("bare")[0]
    assert M.TORQUE not in modes
    assert tuple(interactions) == (STIFF,)


def test_old_interface(board: Any) -> None:
    """D1, I9: the old methods work, map as the old pairs, and raise a DeprecationWarning."""
    old = {
        "set_position_mode": (M.POSITION, STIFF),
        "set_velocity_mode": (M.VELOCITY, STIFF),
        "set_torque_mode": (M.TORQUE, STIFF),
        "set_open_loop_mode": (M.OPENLOOP, STIFF),
        "set_impedance_position_mode": (M.POSITION, COMPLIANT),
        "set_impedance_velocity_mode": (M.VELOCITY, COMPLIANT),
    }
    for name, (mode, interaction) in old.items():
        with pytest.warns(DeprecationWarning, match=name):
            assert getattr(board, name)("left")
        assert board.get_control_mode("left") == [mode]
        assert board.get_interaction_mode("left") == [interaction]
        assert board.set_interaction_mode("left", "stif")
    with pytest.warns(DeprecationWarning, match="get_control_modes"):
        assert board.get_control_modes() == [M.VELOCITY, M.IDLE, M.IDLE]
    assert board.set_position_direct_mode("left")
    assert board.get_control_mode("left") == [M.POSITION_DIRECT]
