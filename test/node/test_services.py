# SPDX-License-Identifier: Apache-2.0
"""The services, message by message: what they read, set and refuse (SPEC A, M7, S1, Y4, Y5)."""

from __future__ import annotations

import pytest
from board_in_process import InProcess

from control_board_ros.interface import (
    GET_AVAILABLE_MODES,
    GET_BRAKE,
    GET_COUPLING,
    GET_DRIVES,
    INJECT_FAULT,
    SAVE_POSE,
    SERVICES,
    SET_BRAKE,
    SET_ENCODERS,
    Endpoint,
)
from control_board_ros.node.wiring.messages import OF_REPLIES
from control_board_ros.operations import OPERATIONS
from control_board_ros.plants import DriveReport
from control_board_ros.settings.loading import Settings, load


@pytest.fixture(scope="module")
def settings() -> Settings:
    return load("iiwa")


@pytest.fixture
def board(settings: Settings) -> InProcess:
    """The iiwa, in POSITION."""
    return InProcess(settings)


#: What a request needs beside the names of joints.
MORE = {
    "send_reference": {"kind": "position", "values": [0.1]},
    "set_reference_speed": {"speeds": [0.1]},
    "get_pids": {"loop": "position"},
    "set_pids": {"loop": "position", "reset": True},
}
ENCODERS = {"set_encoders": {"positions": [0.0] * 7}}


def test_an_operation_gives_every_field_of_its_response(board: InProcess) -> None:
    """No field of a type is left out, and none is given that it has not but a reply."""
    services = {service.short: service.load() for service in SERVICES}
    for name, operation in OPERATIONS.items():
        kind = services[name]
        request = kind.Request(**MORE.get(name, {}) | ENCODERS.get(name, {}))
        fields = set(operation(board.rig.board, request))
        wanted = set(kind.Response.get_fields_and_field_types())
        assert fields | {"message"} >= wanted, name
        assert fields - wanted <= OF_REPLIES, name


@pytest.mark.parametrize(
    "service",
    [
        one
        for one in SERVICES
        if "names" in one.load().Request.get_fields_and_field_types()
        and one not in (SAVE_POSE, INJECT_FAULT)
    ],
    ids=lambda service: service.short,
)
def test_unknown_joints_are_refused_everywhere(board: InProcess, service: Endpoint) -> None:
    """M7: an unknown joint is an answer, not an accident."""
    answer = board.call(service, names=["elbow"], **MORE.get(service.short, {}))
    assert not answer.success
    assert "joint 'elbow' unknown" in answer.message
    if hasattr(answer, "answers"):
        assert list(answer.answers) == ["refused"]
        assert (list(answer.reasons), list(answer.codes)) == ([answer.message], ["invalid"])


def test_available_modes_and_drives(board: InProcess) -> None:
    """S1, S8: what each joint implements, which loop runs where, and what its drive reports."""
    name = board.names[2]
    modes = board.call(GET_AVAILABLE_MODES, names=[name])
    assert list(modes.control_modes) == ["pos,posd,vel,mix,torq,open,idl"]
    assert list(modes.interaction_modes) == ["stif,comp"]
    drives = board.call(GET_DRIVES, names=[name])
    for field in ("set_points", "position", "impedance", "torque", "output"):
        assert list(getattr(drives, field)) == ["pwm"]
    assert list(drives.on_silence) == ["free"]
    assert [*drives.zero, *drives.power, *drives.law] == [""] * 3  # a simulation reports nothing
    assert [*drives.lost, *drives.late] == [-1, -1]
    said = [DriveReport()] * 6 + [DriveReport("absolute", False, "10 position", 3, 0)]
    board.rig.board.engine.drives = said
    drives = board.call(GET_DRIVES, names=[board.names[6], name])
    assert list(drives.zero) == ["absolute", ""]
    assert list(drives.power) == ["off", ""]
    assert list(drives.law) == ["10 position", ""]
    assert [list(drives.lost), list(drives.late)] == [[3, -1], [0, -1]]


def test_brakes() -> None:
    """Y4: ~/get_brake, ~/set_brake, ~/state.brake, and the code of a refused mode."""
    board = InProcess(load("panda"))
    arm, finger = "panda_joint1", "panda_finger_joint1"
    board.rig.run(1.0)
    read = board.call(GET_BRAKE, names=[arm, finger])
    assert (list(read.modes), list(read.closed)) == (["automatic", ""], [False, False])
    assert board.set_mode([arm], "idl").success
    board.rig.run(1.0)
    assert board.state().brake[0]
    assert list(board.call(GET_BRAKE, names=[arm, finger]).closed) == [True, False]
    answer = board.call(SET_BRAKE, names=[arm, finger], modes=["closed"])
    assert not answer.success
    assert list(answer.answers) == ["accepted", "refused"]
    assert list(answer.modes) == ["closed", ""]
    assert list(board.set_mode([arm], "pos").codes) == ["brake_closed"]
    assert board.call(SET_BRAKE, modes=["automatic"]).success
    assert board.set_mode([arm], "pos").success
    board.rig.run(1.0)
    assert not board.state().brake[0]
    wrong = board.call(SET_BRAKE, names=[arm], modes=["ajar"])
    assert "known: automatic, open, closed" in wrong.message


def test_a_coupling() -> None:
    """Y3: a row for each physical joint, also for the second finger, which follows the first."""
    board = InProcess(load("panda"))
    found = board.call(GET_COUPLING)
    assert list(found.axes) == board.names
    assert list(found.physical_joints) == [*board.names, "panda_finger_joint2"]
    assert list(found.matrix[-8:]) == [0.0] * 7 + [1.0]


def test_encoders_need_positions(board: InProcess) -> None:
    """Y5: an empty array is none, of whichever joints."""
    for wrong in ({}, {"names": board.names[:1]}, {"names": board.names[:1], "motor": True}):
        assert "positions are required" in board.call(SET_ENCODERS, **wrong).message
