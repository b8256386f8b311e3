# SPDX-License-Identifier: Apache-2.0
"""What the methods of the client promise: in the same process, and against a real board."""

from __future__ import annotations

import asyncio
import math
import signal
import threading
from typing import Any

import numpy as np
import pytest
from iiwa import JOINTS
from waiting import GUARD, until

from control_board_ros.client import BoardError, BoardTimeout, ControlBoardClient, MoveFeedback
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Answer, Reply, refused
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.interface import CALIBRATE


def test_joints_by_name_index_sequence_and_none(client: ControlBoardClient) -> None:
    """A: an index, a name, a sequence of them, or None for all; one value goes to all."""
    assert client.names == JOINTS
    assert client.set_control_mode(0, "vel").joints == (JOINTS[0],)
    assert client.set_control_mode(JOINTS[1], M.MIXED)
    assert client.set_control_mode([JOINTS[2], 3], int(M.TORQUE))
    assert client.set_control_mode((4, 5), ["idl", "POSITION"])
    modes = [M.VELOCITY, M.MIXED, M.TORQUE, M.TORQUE, M.IDLE, M.POSITION, M.POSITION]
    assert client.get_control_mode() == modes
    assert client.get_control_mode([6, JOINTS[0]]) == [M.POSITION, M.VELOCITY]
    assert client.set_control_mode(None, "pos").joints == JOINTS
    assert client.get_control_mode(2) == [M.POSITION]


def test_refusals_of_the_board_are_replies(client: ControlBoardClient) -> None:
    """M6, M7, I1: refused whole, nothing changes, the message says why, in one line."""
    for joints, modes, text in (
        ("lbr_iiwa_joint_8", "vel", "unknown; did you mean"),
        (7, "vel", "out of range"),
        ([0, JOINTS[0]], "vel", "twice"),
        ([0, 1], ["vel", "vel", "vel"], "3 modes for 2 joints"),
        (None, ["pos", "vel"], "2 modes for 7 joints"),
        (0, [], "0 modes for 1 joint"),
        (0, "hwfa", "cannot be set"),
        (0, "nonsense", "unknown"),
        ([0, 6], ["vel", "🦾"], "unknown"),
        (None, "x" * 10_000, "unknown"),
        ([0, 1], ["vel", "cald"], "cannot be set"),
    ):
        for method in (client.set_control_mode, client.set_interaction_mode):
            reply = method(joints, modes)
            assert not reply
            assert {str(answer) for answer in reply.answers} <= {"refused"}
            assert set(reply.codes) <= {"invalid"}
            assert text in reply.message or method == client.set_interaction_mode
            assert "\n" not in reply.message
            assert 0 < len(reply.message) < 600
    assert client.get_control_mode() == [M.POSITION] * 7
    assert client.get_interaction_mode() == [InteractionMode.STIFF] * 7


def test_each_joint_has_its_answer(client: ControlBoardClient) -> None:
    """M5, F2, F4: answers joint by joint, each with its own reason."""
    assert client.set_control_mode(0, "vel")
    reply = client.set_control_mode([0, 1], ["vel", "icur"])
    assert reply.answers == (Answer.ACCEPTED, Answer.UNSUPPORTED)
    assert not reply
    assert "does not implement icur" in reply.message
    reply = client.set_control_mode([1, 2, 3], ["torq", "torq", "veld"])
    assert reply.answers == (Answer.REFUSED, Answer.ACCEPTED, Answer.UNSUPPORTED)
    assert "send FORCE_IDLE first" in reply.message
    assert f"{JOINTS[1]} is in HW_FAULT" in reply.reasons[0]
    assert reply.reasons[1] == ""
    assert "does not implement veld" in reply.reasons[2]
    assert client.set_control_mode(3, "fidl")
    faults = client.get_faults()
    assert [fault.active for fault in faults] == [False, True] + [False] * 5
    assert faults[1].code == 16
    assert faults[1].stamp > 0.0
    assert client.set_control_mode(1, "fidl")
    assert client.get_control_mode(1) == [M.IDLE]
    assert client.get_faults(1)[0].active is False
    assert client.get_faults(1)[0].code == 16


def test_interaction_and_impedance(client: ControlBoardClient) -> None:
    """I1, I6: set and read, one, some or all."""
    assert client.set_interaction_mode([0, 2], InteractionMode.COMPLIANT)
    assert client.get_interaction_mode()[:3] == [
        InteractionMode.COMPLIANT,
        InteractionMode.STIFF,
        InteractionMode.COMPLIANT,
    ]
    assert client.set_impedance([0, 1], [200.0, 300.0], 20.0)
    stiffness, damping = client.get_impedance([1, 0])
    assert stiffness.tolist() == [300.0, 200.0]
    assert damping.tolist() == [20.0, 20.0]
    most, _ = client.get_max_impedance(0)
    for bad, code in (
        (most[0] + 1.0, "out_of_range"),
        (-1.0, "out_of_range"),
        (math.nan, "not_finite"),
    ):
        reply = client.set_impedance(0, bad, 1.0)
        assert reply.codes == (code,)
        assert "is not allowed" in reply.message
    assert client.set_impedance([0, 1], [150.0], [10.0])
    assert client.set_impedance([0, 1], damping=12.0)
    assert [values.tolist() for values in client.get_impedance([0, 1])] == [
        [150.0] * 2,
        [12.0] * 2,
    ]
    assert "send one of them" in client.set_impedance(0).message
    assert client.set_impedance(0, 200.0, 20.0)
    reply = client.set_impedance(0, [1.0, 2.0], 1.0)
    assert not reply
    assert "2 stiffness values for 1 joint" in reply.message
    assert client.get_impedance(0)[0].tolist() == [200.0]
    assert not client.set_interaction_mode(0, "rigid")
    assert client.get_torque_offset().shape == (7,)
    control, interaction = client.get_available_modes(0)[0]
    assert M.TORQUE in control
    assert interaction == tuple(InteractionMode)


#: Kinds of references: a mode, how they are sent and read, and a value beyond the limit.
KINDS = [
    ("pos", "position_move", "get_target_position", 40.0),
    ("posd", "set_position", "get_ref_position", -40.0),
    ("vel", "velocity_move", "get_target_velocity", 40.0),
    ("torq", "set_ref_torque", "get_ref_torque", -4000.0),
    ("open", "set_output", "get_output", 400.0),
]


@pytest.mark.parametrize(("mode", "method", "getter", "beyond"), KINDS)
def test_each_kind_of_reference(
    client: ControlBoardClient, mode: str, method: str, getter: str, beyond: float
) -> None:
    """P1 to P9, M3, M4, M11: bounded, in force, or ignored and counted; with ``together`` (M7)
    a joint that cannot keeps the others at rest.
    """
    send, get = getattr(client, method), getattr(client, getter)
    assert client.set_control_mode([0, 1, 2], [mode, "idl", mode])
    before = client.get_state().rejected_commands
    reply = send([2, 1, 0], [0.01, 0.01, beyond], **({} if mode == "pos" else {"answered": True}))
    assert reply.answers == (Answer.ACCEPTED, Answer.IGNORED, Answer.ACCEPTED)
    assert reply.codes == ("", "other_mode", "")
    assert f"for {JOINTS[1]} ignored: mode is IDLE; it is accepted in " in reply.reasons[1]
    assert "bounded to" in reply.reasons[2]
    assert math.isnan(reply.values[1])
    assert 0.01 == reply.values[0] < abs(reply.values[2]) < abs(beyond)
    assert get([0, 2]).tolist() == [reply.values[2], 0.01]
    assert (client.get_state().rejected_commands - before).tolist() == [0, 1, 0, 0, 0, 0, 0]
    held = get().tolist()
    for joints, values, code in (
        ([0, 1], 0.02, "other_mode"),
        ([0, 2], [0.02, math.nan], "not_finite"),
        ([0, 2], [0.02, math.inf], "not_finite"),
    ):
        reply = send(joints, values, together=True)
        assert reply.answers == (Answer.REFUSED, Answer.IGNORED)
        assert reply.codes == ("together", code)
    assert get().tolist() == held
    assert send([0, 2], [0.02, 0.03], together=True).values == (0.02, 0.03)
    assert send([0, 2], [0.03, 0.04])  # a stream has no answer, and is there when the next call is
    assert get([0, 2]).tolist() == [0.03, 0.04]
    if mode == "vel":
        assert client.get_ref_velocity([0, 2]).tolist() == [0.03, 0.04]


def test_a_command_is_in_force_when_the_next_call_answers(client: ControlBoardClient) -> None:
    """M11, P3: no sleeping between a command and reading what it did."""
    for k in range(20):
        target = 0.1 + 0.001 * k
        assert client.position_move(0, target, 0.1)
        assert client.get_target_position(0) == pytest.approx([target], abs=1e-12)
    assert client.check_motion_done() == [False] + [True] * 6
    assert client.stop(0)
    assert client.check_motion_done(0) == [True]


def test_reference_speeds(client: ControlBoardClient) -> None:
    """P2: set, read, refused below the least."""
    assert client.set_ref_speed(None, 0.5)
    assert client.set_ref_acceleration([1, 2], [0.6, 0.7])
    assert client.get_ref_speed().tolist() == [0.5] * 7
    assert client.get_ref_acceleration([2, 1]).tolist() == [0.7, 0.6]
    assert client.set_reference_speed(None, [0.4])
    assert client.get_ref_speed().tolist() == [0.4] * 7
    assert client.get_ref_acceleration([2, 1]).tolist() == [0.7, 0.6]
    assert client.set_reference_speed(0, 0.3, 0.4)
    assert client.get_ref_speed(0).tolist() == [0.3]
    assert "from 1e-06 to" in client.set_ref_speed(0, 0.0).message
    assert client.set_ref_speed(0, math.nan).codes == ("not_finite",)
    assert not client.set_ref_acceleration(0, -1.0)
    assert not client.set_reference_speed(0)
    assert client.get_ref_speed(0).tolist() == [0.3]


def test_a_mode_just_set_is_the_mode_that_counts(client: ControlBoardClient) -> None:
    """M4: what is published right after the mode's answer meets the board in the new mode."""
    before = client.get_state().rejected_commands[0]
    for k in range(30):
        assert client.set_control_mode(0, "torq").modes == (M.TORQUE,)
        assert client.set_ref_torque(0, 0.01 * k)
        assert client.get_ref_torque(0).tolist() == [0.01 * k]
        assert not client.set_output(0, 0.0, answered=True)
        assert client.set_control_mode(0, "open")
        assert client.set_output(0, 0.0, answered=True).values == (0.0,)
        assert client.set_output(0, 0.01 * k)
        assert client.get_output(0).tolist() == [0.01 * k]
        assert not client.set_ref_torque(0, 0.0, answered=True)
    assert client.get_state().rejected_commands[0] - before == 60


@pytest.mark.parametrize(
    ("joints", "positions", "speeds", "text"),
    [
        (0, math.nan, None, "nan is not a finite number"),
        (0, math.inf, None, "inf is not a finite number"),
        (0, [0.1, 0.2], None, "2 position references for 1 joint"),
        (0, "x", None, "must be numbers"),
        (0, 0.1, "fast", "must be numbers"),
        (0, 0.1, [], "0 speeds for 1 joint"),
        ([0, 1], 0.1, [], "0 speeds for 2 joints"),
        ([0, 1], [[0.1], [0.1]], None, "position references must be in one list, not in 2"),
        ([0, 1], 0.1, [[0.2], [0.2]], "speeds must be in one list, not in 2"),
    ],
)
def test_bad_values_are_ignored_and_counted(
    client: ControlBoardClient, joints: Any, positions: Any, speeds: Any, text: str
) -> None:
    """P13: NaN, infinite, of wrong length or no list of numbers, with the reason; none moves."""
    before = client.get_state().rejected_commands
    reply = client.position_move(joints, positions, speeds)
    assert not reply
    assert text in reply.message
    assert client.check_motion_done() == [True] * 7

    def counted() -> list[int]:
        return (client.get_state().rejected_commands - before).tolist()

    until(lambda: counted() == [1, int(joints != 0), *[0] * 5], counted)


@pytest.mark.parametrize(
    ("joints", "values", "text"),
    [
        ([0, 1], [0.1, 0.2, 0.3], "3 position direct references for 2 joints"),
        ([0, 1], [], "0 position direct references for 2 joints"),
        ([1, 1], 0.1, "'lbr_iiwa_joint_2' named twice"),
        ([1, "elbow"], 0.1, "'elbow' unknown"),
        ([1, 99], 0.1, "unknown"),
        (1.5, 0.1, "'1.5' unknown"),
        (0, 10**400, "must be numbers"),
    ],
)
@pytest.mark.parametrize("answered", [True, False])
def test_wrong_requests_are_answered_by_the_board_and_counted_once(
    client: ControlBoardClient, joints: Any, values: Any, text: str, answered: bool
) -> None:
    """P13, M7: the board words its refusal where it is asked; published ones count likewise."""
    before = client.get_state().rejected_commands
    reply = client.set_position(joints, values, answered=answered)
    assert not reply
    if answered or text != "unknown":  # of an index, which the board does not know
        assert text in reply.message
    known = joints in ([0, 1], 0)
    requested = joints if isinstance(joints, list) else [joints]
    assert reply.joints == tuple(JOINTS[j] if j in (0, 1) else str(j) for j in requested)
    assert len(reply.answers) == len(requested)
    counted = (client.get_state().rejected_commands - before).tolist()
    assert counted == [int(known), int(joints not in (0, 1.5)), *[0] * 5]


def test_all_accept_or_none_does(client: ControlBoardClient) -> None:
    """M7: also relative moves, feed-forwards, and kinds that no joint implements."""
    assert client.set_control_mode(1, "idl")
    assert client.relative_move([0, 1], 0.1, 0.2, together=True).codes == (
        "together",
        "other_mode",
    )
    assert client.check_motion_done(0) == [True]
    assert client.relative_move([0, 1], 0.1, 0.2).codes == ("", "other_mode")
    for send in (client.set_ref_velocity, client.set_ref_current):
        assert send([0, 1], 0.01, together=True).codes == ("unsupported", "unsupported")
    reply = client.set_feedforward([0, 1], torques=[0.01, math.nan], together=True)
    assert reply.codes == ("together", "not_finite")
    assert client.set_feedforward([0, 1], 0.0, 0.0, together=True)


def test_speeds_that_are_no_speeds(client: ControlBoardClient) -> None:
    """P2: a speed of a command outside what the joint's limit allows makes it ignored."""
    before = client.get_state().rejected_commands
    reply = client.position_move([0, 1], 0.1, [0.1, 0.0])
    assert reply.answers == (Answer.ACCEPTED, Answer.IGNORED)
    limit = client.get_velocity_limits(0)[0]
    assert "speeds must be from 1e-06 to " in reply.message
    assert " rad/s, not 0" in reply.message
    assert client.position_move(0, 0.2, limit)
    assert not client.position_move(0, 0.3, 1.001 * limit)
    for least in (5e-324, 9e-7):  # rad/s: it would not arrive within days
        assert not client.position_move(0, 0.3, least)
        assert not client.set_ref_speed(0, least)
        assert not client.set_ref_acceleration(0, least)
    reply = client.set_ref_speed(0, 30.0)  # deg/s
    assert reply.message.endswith(f"send a number from 1e-06 to {limit:.6g} rad/s")
    assert "1 speed for 2 joints" in client.position_move([0, 1], 0.1, [0.2]).message
    assert client.set_control_mode(2, "vel")
    assert (
        "accelerations must be from 1e-06 to"
        in client.velocity_move(2, 0.1, 1e6, answered=True).message
    )
    counted = client.get_state().rejected_commands - before
    assert counted.tolist() == [4, 2, 1, 0, 0, 0, 0]


def test_get_methods_raise_for_joints_that_do_not_exist(client: ControlBoardClient) -> None:
    """A: what cannot be answered raises a ValueError with the board's words."""
    for get in (client.get_control_mode, client.get_encoder, client.get_ref_torque):
        with pytest.raises(RequestError, match="unknown; did you mean 'lbr_iiwa_joint_"):
            get("lbr_iiwa_joint_0")
        with pytest.raises(ValueError, match="out of range"):
            get(-1)


def test_the_old_interface_warns(
    client: ControlBoardClient, capfd: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    """D1: a DeprecationWarning and a log warning; I9: the old pairs."""
    old = "set_impedance_velocity_mode belongs to the old"
    with pytest.warns(DeprecationWarning, match=old) as warned:
        assert client.set_impedance_velocity_mode([0, 1])
    with pytest.warns(DeprecationWarning, match="get_control_modes") as warned_too:
        client.get_control_modes()
    with pytest.warns(DeprecationWarning, match="set_torque_mode") as warned_late:
        assert asyncio.run(client.aio.set_torque_mode(2))
    for record in (*warned, *warned_too):
        assert record.filename == __file__  # Python shows those that come from one's own script
    assert len(warned_late) == 1
    if "shared" in request.node.callspec.id:  # in the log of the user's node, too
        assert f"{old} interface" in capfd.readouterr().err
    assert client.get_control_mode(0) == [M.VELOCITY]
    assert client.get_interaction_mode(0) == [InteractionMode.COMPLIANT]
    with pytest.warns(DeprecationWarning, match="get_control_modes"):
        assert client.get_control_modes() == client.get_control_mode()
    assert client.set_position_direct_mode(0)


def test_measured_state(client: ControlBoardClient) -> None:
    """A: encoders, speeds and torques of the joints requested, in the order requested."""
    state = client.get_state()
    assert state.names == JOINTS
    assert client.get_encoder([3, 1]) == pytest.approx(state.position[[3, 1]], abs=1e-3)
    assert client.get_encoder_speed().shape == (7,)
    assert abs(client.get_torque(1)[0]) > 1.0  # the arm leans forward
    assert client.position_move(6, 0.2, 1.0)
    reached = client.wait_for_state(lambda s: abs(s.position[6] - 0.2) < 0.01, GUARD)
    assert reached.position[6] == pytest.approx(0.2, abs=0.01)
    with pytest.raises(BoardTimeout, match=r"after 0\.2 s"):
        client.wait_for_state(lambda s: bool(s.position[6] > 9.0), 0.2)


def test_move_waits_and_reports(client: ControlBoardClient) -> None:
    """P1: move returns at the end, with feedback on the way."""
    received: list[Any] = []
    caller = threading.get_ident()
    start = client.get_state().stamp

    def feedback(progress: MoveFeedback) -> None:
        received.append((threading.get_ident(), progress))

    reply = client.move([0, 1], [0.5, 0.7], 0.5, feedback)
    assert reply, reply.message
    assert client.get_state().stamp - start > 0.8
    assert client.get_encoder([0, 1]) == pytest.approx([0.5, 0.7], abs=math.radians(1.0))
    assert {thread for thread, _ in received} == {caller}
    remaining = [f.remaining_time for _, f in received]
    assert remaining[0] > 0.0
    assert remaining == sorted(remaining, reverse=True)
    assert received[0][1].names == JOINTS[:2]


def test_a_bounded_move_says_so(client: ControlBoardClient) -> None:
    """P1, P9: a target beyond a limit is accepted, and the reply says what was done instead."""
    assert client.move(5, 0.1, 0.5).message == ""
    reply = client.move([5, 1], [40.0, 0.6], [1.2, 0.1])
    assert reply
    assert reply.message == f"{JOINTS[5]}: position bounded to 118.0° (2291.8° was requested)"
    assert client.get_encoder(5) == pytest.approx([math.radians(118.0)], abs=0.01)


def test_a_move_that_is_only_started_says_so_too(client: ControlBoardClient) -> None:
    """P1, P9: the board answers: what a limit cuts of a target, and the target in force."""
    reply = client.position_move(0, -40.0)
    assert reply
    assert reply.message.startswith(
        f"{JOINTS[0]}: position bounded to -168.0° (-2291.8° was requested)"
    )
    assert reply.values == tuple(client.get_target_position(0))
    assert client.relative_move(0, 0.1, 0.2).message == ""
    assert client.stop(0)


def test_move_fails_with_the_reason(client: ControlBoardClient) -> None:
    """M4: a move of a joint whose mode accepts none, or of none that exists."""
    assert client.set_control_mode(0, "vel")
    reply = client.move(0, 0.5)
    assert not reply
    assert "mode is VELOCITY" in reply.message
    assert reply.codes == ("other_mode",)
    assert "unknown" in client.move("nobody", 0.5).message
    assert "2 position references for 1 joint" in client.move(0, [0.1, 0.2]).message


def test_an_interrupted_move_stops_the_joints(client: ControlBoardClient) -> None:
    """Ctrl-C during a move cancels the goal and comes through."""
    interruptions = iter([threading.Timer(0.05, signal.raise_signal, [signal.SIGINT])])

    def interrupt(feedback: Any) -> None:
        if feedback.positions[0] > 0.005:
            for timer in interruptions:  # once
                timer.start()

    with pytest.raises(KeyboardInterrupt):
        client.move(0, 1.5, 0.1, interrupt)
    assert client.check_motion_done(0) == [True]
    position = client.get_encoder(0)[0]
    assert 0.004 < position < 1.4
    assert client.get_target_position(0) == pytest.approx([1.5])


def test_calibrate(client: ControlBoardClient) -> None:
    """K1, K3: started at once, or waited for; the statuses report it."""
    received: list[Any] = []
    reply = client.calibrate([0, 1], feedback=received.append)
    assert reply, reply.message
    assert received[-1].names == JOINTS[:2]
    progress = np.array([feedback.progress for feedback in received])
    assert (np.diff(progress, axis=0) >= 0.0).all()
    assert (progress[-1] > 0.0).all()  # the very last may come after the result
    assert all(status.done for status in client.get_calibration([0, 1]))
    assert not client.get_calibration(2)[0].done
    assert client.calibrate(2, wait=False)
    until(lambda: client.get_calibration(2)[0].done)


@pytest.mark.parametrize("lost", [True, False])
def test_a_calibration_without_a_result_is_not_running(
    client: ControlBoardClient, monkeypatch: pytest.MonkeyPatch, lost: bool
) -> None:
    """K4: the board went away, or refused the goal; the status says so at once."""

    async def run(*_: Any, **__: Any) -> Reply:
        if lost:
            raise BoardError("it went away")
        return refused("it is refused")

    monkeypatch.setattr(type(client._services.goal(CALIBRATE)), "run", run)
    if lost:
        with pytest.raises(BoardError):
            client.calibrate(3)
    else:
        assert not client.calibrate(3)
    status = client.get_calibration(3)[0]
    assert not status.running
    assert status.phase == "failed"
    assert status.message.startswith("it ")


def test_stop_answers_for_each_joint(client: ControlBoardClient) -> None:
    """P3: what the board says, joint by joint, not what the client thinks."""
    assert client.set_control_mode([1, 2], ["torq", "idl"])
    reply = client.stop([0, 1, 2])
    assert reply.answers == (Answer.ACCEPTED, Answer.IGNORED, Answer.ACCEPTED)
    assert reply.codes == ("", "nothing_to_stop", "")
    assert JOINTS[1] in reply.reasons[1]


def test_faults_of_the_hardware(client: ControlBoardClient) -> None:
    """F1 to F3: injected, latched, refused while the cause persists."""
    assert client.inject_fault(3, "encoder", persistent=True)
    client.wait_for_state(lambda s: not s.output[3], GUARD)
    assert client.get_control_mode(3) == [M.HW_FAULT]
    reply = client.set_control_mode(3, "fidl")
    assert reply.answers == (Answer.REFUSED,)
    assert "the cause persists" in reply.message
    reply = client.position_move(3, 0.0)
    assert reply.answers == (Answer.IGNORED,)
    assert reply.codes == ("in_fault",)
    assert "mode is HW_FAULT" in reply.message
    assert client.clear_injected_faults()
    assert client.set_control_mode(3, "fidl")
    assert not client.inject_fault(3, "nonsense")


def test_an_emergency_stop_and_the_way_out(client: ControlBoardClient) -> None:
    """E1 to E3: no motor has power when it is answered; then each goes back to its mode."""
    assert client.get_freeze_frame(5) is None
    assert client.set_control_mode(0, "vel")
    assert client.emergency_stop()
    assert client.get_control_mode() == [M.HW_FAULT] * 7
    assert {(fault.code, fault.text) for fault in client.get_faults()} == {
        (24, "emergency stop, requested")
    }
    for reply in (client.set_control_mode(None, "fidl"), client.recover()):
        assert reply.codes == ("emergency_stop",) * 7
    fault, frame = client.get_faults(5)[0], client.get_freeze_frame(5)
    assert frame is not None
    assert (frame.fault.stamp, frame.fault.code) == (fault.stamp, 24)
    assert frame.stamps[0] < fault.stamp < frame.stamps[-1]
    assert frame.position.shape == frame.current.shape == frame.stamps.shape
    assert not frame.output[frame.stamps > fault.stamp].any()
    assert client.emergency_stop(False)
    assert "'elbow' unknown" in client.recover([JOINTS[0], "elbow"]).message
    reply = client.recover(0)
    assert (reply.joints, reply.modes, reply.waits) == (JOINTS[:1], (M.VELOCITY,), (0.0,))
    reply = client.recover()
    assert (bool(reply), reply.joints) == (True, JOINTS[1:])
    with pytest.raises(RequestError, match="unknown"):
        client.get_freeze_frame("elbow")


def test_the_simulation_steps(client: ControlBoardClient) -> None:
    """A paused board moves by steps only."""
    assert client.pause()
    before = client.get_encoder(0)[0]
    assert client.position_move(0, 0.5, 0.5)
    assert client.step(100)
    after = client.get_encoder(0)[0]
    assert before < after < 0.2
    assert client.get_encoder(0)[0] == after
    assert "from 1 to" in client.step(0).message
    assert "acts with the next cycle" in client.emergency_stop().message  # E2
    assert client.get_control_mode(0) == [M.POSITION]
    assert client.pause(False)
    client.wait_for_state(lambda state: not state.output.any(), GUARD)
    assert client.get_control_mode(0) == [M.HW_FAULT]
    assert client.emergency_stop(False)


def test_configure_and_power_cycle(client: ControlBoardClient) -> None:
    """N1, N2: what concerns the whole board answers for all joints."""
    reply = client.configure()
    assert not reply
    assert reply.joints == JOINTS
    assert "configured already" in reply.message
    assert client.power_cycle()


def test_feedforward(client: ControlBoardClient) -> None:
    """P11: any mode; values are checked."""
    assert client.set_feedforward(0, torques=0.5)
    assert client.get_torque_offset(0).tolist() == [0.5]
    assert client.set_feedforward(0, 250.0, 0.0, answered=True).values == (100.0,)
    assert client.set_feedforward(0, 0.0, 0.0)
    assert not client.set_feedforward(0)
    reply = client.set_feedforward(0, outputs=math.nan, answered=True)
    assert "not a finite number" in reply.message
    assert reply.codes == ("not_finite",)


def test_the_urdf(client: ControlBoardClient) -> None:
    """The description of the robot is the board's own."""
    assert '<robot name="' in client.get_robot_description()


def test_poses(client: ControlBoardClient) -> None:
    """R5: list, save as measured or as given, go there with feedback; replies report refusals."""
    assert client.list_poses()[:2] == ["home", "park"]
    assert client.get_pose("home").positions[1] == 0.5
    with pytest.raises(RequestError, match="did you mean 'park'"):
        client.get_pose("prak")
    assert client.save_pose("one", 6, 0.3, 1.0)
    assert client.get_pose("one").joints == (JOINTS[6],)
    sent: list[Any] = []
    reply = client.go_to_pose("one", feedback=sent.append)
    assert reply
    assert reply.joints == (JOINTS[6],)
    assert client.get_encoder(6)[0] == pytest.approx(0.3, abs=0.02)
    assert sent[0].names == (JOINTS[6],)
    assert 0.0 < sent[0].remaining[0] < 0.31
    assert client.save_pose("all_now")
    assert client.get_pose("all_now").positions == pytest.approx(client.get_encoder(), abs=0.02)
    assert not client.save_pose("home")
    assert not client.save_pose("two", [0, 1], [0.0])
    assert "unknown" in client.save_pose("two", "elbow").message
    assert not client.go_to_pose("two")
    assert client.park(speed=2.0)
    client.set_control_mode(3, "idl")
    refused = client.home()
    assert not refused
    assert f"{JOINTS[3]} is in IDLE" in refused.message
