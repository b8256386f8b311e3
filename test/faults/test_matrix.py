# SPDX-License-Identifier: Apache-2.0
"""Every mode × every request × every interaction mode, from the text of the rules (SPEC M, F, I).

The tables here are written down anew from the specification, not read from the product.
"""

from __future__ import annotations

import random

import pytest
from rig import COMPLIANT, STANDARD, STATUSES, STIFF, board_config, in_status, joint, plain, ready

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.terms.reply import Answer
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.core.terms.vocabs import InteractionMode

#: Source Table 3: what set may not ask for (M6).
NEVER = (M.HW_FAULT, M.CALIBRATING, M.CALIB_DONE, M.NOT_CONFIGURED, M.CONFIGURED)
UNIMPLEMENTED = (M.CURRENT, M.VELOCITY_DIRECT)
REQUESTS = (*STANDARD, M.FORCE_IDLE, *UNIMPLEMENTED, *NEVER)
FROM = (*STANDARD, *STATUSES)
STATUS_REQUESTS = (*STANDARD, *UNIMPLEMENTED)


def joint_in(mode, interaction, *, sensor=True):
    """A rig of the joint ``left`` in a mode, with an interaction mode where it can have one."""
    make = joint if sensor else plain
    changes = {"startup_interaction": interaction}
    if mode in STATUSES:
        if not sensor:
            changes |= {
                "torque_sensor": False,
                "control_modes": plain("left").control_modes,
                "interaction_modes": (STIFF,),
            }
        return in_status(mode, **changes)
    rig = ready(board_config(make("left", **changes)))
    rig.enter(mode)
    return rig


def expected(mode, request, *, sensor):
    """The mode after a request, and the answer, as SPEC M, F, K and N say."""
    if request in NEVER:
        return mode, Answer.REFUSED  # M6
    if mode is M.NOT_CONFIGURED:
        return mode, Answer.REFUSED  # N4
    if request is M.FORCE_IDLE:
        return M.IDLE, Answer.ACCEPTED  # F2, F4, K2
    if mode in (M.HW_FAULT, M.CALIBRATING):
        return mode, Answer.REFUSED  # F2, K2
    if request in UNIMPLEMENTED or (request is M.TORQUE and not sensor):
        return M.HW_FAULT, Answer.UNSUPPORTED  # M5, I7
    return request, Answer.ACCEPTED  # M1


CASES = [
    (mode, interaction, sensor)
    for mode in FROM
    for interaction, sensor in ((STIFF, True), (COMPLIANT, True), (STIFF, False))
    if not (mode is M.TORQUE and not sensor)
]


@pytest.mark.parametrize(("mode", "interaction", "sensor"), CASES)
def test_every_request_in_every_mode(mode, interaction, sensor):
    """M1, M5, M6, F2, F4, K2, N4: one row of the matrix, all 15 vocabs."""
    for request in REQUESTS:
        rig = joint_in(mode, interaction, sensor=sensor)
        kept = rig.board.get_interaction_mode("left")
        want, answer = expected(mode, request, sensor=sensor)
        reply = rig.board.set_control_mode("left", request)
        case = f"{mode.name} -> {request.name}: {reply.message}"
        if request in NEVER:
            assert not reply, case  # refused whole: no joint's answer
        else:
            assert reply.answers == (answer,), case
        assert rig.board.get_control_mode("left") == [want], case
        assert rig.board.get_interaction_mode("left") == kept, case
        assert bool(reply.message) is not bool(reply), case
        rig.tick(2)
        assert rig.board.get_control_mode("left") == [want], case
        if want in (M.IDLE, M.HW_FAULT, M.NOT_CONFIGURED):
            assert rig.board.state.powered[0] == 0.0, case
            assert rig.board.snapshot().output[0] == 0.0, case


@pytest.mark.parametrize("request_", InteractionMode)
@pytest.mark.parametrize(("mode", "interaction", "sensor"), CASES)
def test_every_interaction_request_in_every_mode(mode, interaction, sensor, request_):
    """I1, I2, I4, I7, I8: one row of source Table 3."""
    rig = joint_in(mode, interaction, sensor=sensor)
    kept = rig.board.get_interaction_mode("left")[0]
    reply = rig.board.set_interaction_mode("left", request_)
    after = rig.board.get_control_mode("left")[0], rig.board.get_interaction_mode("left")[0]
    if mode in (M.CALIBRATING, M.NOT_CONFIGURED):
        assert reply.answers == (Answer.REFUSED,)
        assert after == (mode, kept)
    elif request_ is COMPLIANT and not sensor:
        refused = mode is M.HW_FAULT
        assert reply.answers == ((Answer.REFUSED if refused else Answer.UNSUPPORTED),)
        assert after == (M.HW_FAULT, STIFF)
    else:
        assert reply
        assert after == (mode, request_)
    rig.run(0.2)
    assert rig.board.get_control_mode("left")[0] is after[0]


def test_only_force_idle_leads_from_a_fault_to_power():
    """F2 (promise P4): 3,000 random requests leave a faulted joint unpowered."""
    rig = in_status(M.HW_FAULT)
    board, choose = rig.board, random.Random(4).choice
    calls = [
        lambda: board.set_control_mode("left", choose(STATUS_REQUESTS)),
        lambda: board.set_control_mode(None, choose(STATUS_REQUESTS)),
        lambda: board.set_interaction_mode("left", choose(list(InteractionMode))),
        lambda: board.calibrate("left"),
        board.configure,
        board.stop,
        lambda: board.position_move("left", 1.0),
        lambda: board.set_output("left", 50.0),
        lambda: board.set_ref_torque("left", 5.0),
        lambda: board.velocity_move("left", 1.0),
        lambda: board.set_feedforward("left", 50.0, 5.0),
        lambda: board.set_impedance("left", 100.0, 1.0),
        lambda: board.reconfigure(board.config),
    ]
    for _ in range(3000):
        choose(calls)()
        snapshot = rig.tick()
        assert board.get_control_mode("left") == [M.HW_FAULT]
        assert board.state.powered[0] == 0.0
        assert snapshot.output[0] == snapshot.current[0] == 0.0
    assert board.set_control_mode("left", "fidl")
    assert board.get_control_mode("left") == [M.IDLE]


def test_one_unsupported_joint_of_several():
    """M5, M7: the joint without torque sensing faults and is named; the others switch."""
    rig = ready()
    reply = rig.board.set_control_mode(None, "torq")
    assert [answer.value for answer in reply.answers] == ["accepted", "accepted", "unsupported"]
    assert "bare does not implement torq" in reply.message
    assert rig.modes() == [M.TORQUE, M.TORQUE, M.HW_FAULT]
    assert "torq" in rig.board.get_faults("bare")[0].text


@pytest.mark.parametrize("modes", [["pos", "vel", "nix"], ["pos", "vel", "hwfa"], ["pos", "vel"]])
@pytest.mark.parametrize("joints", [None, ["left", "right", "bare"]])
def test_one_bad_mode_refuses_the_whole_request(joints, modes):
    """M6, M7 (promise P3): all or nothing in checking."""
    rig = ready()
    reply = rig.board.set_control_mode(joints, modes)
    assert not reply
    assert rig.modes() == [M.IDLE] * 3
    assert not any(record.active for record in rig.board.get_faults())


def test_many_joints_switch_in_the_same_cycle():
    """M7 (promise P3): between two cycles no reading shows one joint switched and one not."""
    rig = ready(board_config(*(joint(f"j{k}") for k in range(16))))
    for mode in (M.POSITION, M.TORQUE, M.OPENLOOP, M.IDLE, M.MIXED):
        assert rig.board.set_control_mode(None, mode)
        assert set(rig.modes()) == {mode}
        rig.tick()
        assert set(rig.board.state.powered.tolist()) == {0.0 if mode is M.IDLE else 1.0}


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        (M.HW_FAULT, "FORCE_IDLE first"),
        (M.CALIBRATING, "abort it with FORCE_IDLE"),
        (M.NOT_CONFIGURED, "the board waits for configure"),
    ],
)
def test_what_refuses_says_what_to_do(mode, words):
    """F2, K2, N4: each refusal names the next step."""
    rig = in_status(mode)
    assert words in rig.board.set_control_mode("left", "pos").message
    assert not rig.board.position_move("left", 0.5)
    assert rig.board.snapshot().rejected_commands.tolist() == [1]


def test_asking_to_calibrate_while_calibrating_is_refused_and_changes_nothing():
    """K1, K2: a second request does not start the calibration anew."""
    rig = in_status(M.CALIBRATING)
    before = rig.board.get_calibration("left")
    assert not rig.board.calibrate("left")
    assert rig.board.get_calibration("left") == before
    assert rig.board.set_control_mode("left", "fidl")
    assert rig.board.get_calibration("left")[0].message == "aborted"
    assert not rig.board.get_calibration("left")[0].running


def test_ten_thousand_switches_leave_nothing_behind():
    """M1, M9 (promise P10): a short form of the million of make soak."""
    rig = ready(board_config(joint("left", calibration=Calibration(type=12, required=False))))
    choose = random.Random(3).choice
    versions = rig.board.modes_version
    for k in range(10_000):
        assert rig.board.set_control_mode("left", choose(STANDARD))
        if k % 20 == 0:
            rig.tick()
    assert rig.board.modes_version > versions + 5000
    assert len(rig.board.engine.events) <= 1000
    assert rig.board.set_control_mode("left", "pos")
    assert abs(rig.run(0.5).position[0]) < 0.05
