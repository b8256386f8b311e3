# SPDX-License-Identifier: Apache-2.0
"""The services, message by message: what they read, set and refuse (SPEC A, M7, S1, Y4, Y5)."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from board_in_process import InProcess

from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.interface import (
    GET_AVAILABLE_MODES,
    GET_BRAKE,
    GET_COUPLING,
    GET_DRIVES,
    GET_IMPEDANCE,
    GET_INTERACTION_MODE,
    GET_LIMITS,
    GET_MOTORS,
    GET_PIDS,
    GET_REFERENCES,
    INJECT_FAULT,
    SAVE_POSE,
    SERVICES,
    SET_BRAKE,
    SET_CONTROL_MODE,
    SET_ENCODERS,
    SET_IMPEDANCE,
    SET_INTERACTION_MODE,
    SET_MOTORS,
    SET_PIDS,
    SET_REFERENCE_SPEED,
    Endpoint,
)
from control_board_ros.joint_limits import FIELDS
from control_board_ros.node.wiring.messages import OF_REPLIES
from control_board_ros.operations import OPERATIONS
from control_board_ros.plants import DriveLimits, DriveReport
from control_board_ros.plants.offers import bounded
from control_board_ros.settings.loading import Settings, load


@pytest.fixture(scope="module")
def settings() -> Settings:
    return load("iiwa")


@pytest.fixture
def board(settings: Settings) -> InProcess:
    """The iiwa, in POSITION."""
    return InProcess(settings)


def test_interaction_modes(board: InProcess) -> None:
    """I1: set, and read back with their vocabs."""
    answer = board.call(SET_INTERACTION_MODE, names=board.names[:1], modes=["comp"])
    assert (answer.success, list(answer.modes)) == (True, ["comp"])
    read = board.call(GET_INTERACTION_MODE)
    assert list(read.modes) == ["comp"] + ["stif"] * 6
    assert list(read.vocabs[:2]) == [InteractionMode.COMPLIANT, InteractionMode.STIFF]


@pytest.mark.parametrize(
    ("joints", "modes", "text"),
    [
        (["lbr_iiwa_joint_33"], ["pos"], "did you mean 'lbr_iiwa_joint_3'"),
        ([], ["pos", "vel"], "2 modes for 7 joints"),
        (["lbr_iiwa_joint_1"], [], "0 modes for 1 joint"),
        (["lbr_iiwa_joint_1", "lbr_iiwa_joint_7"], ["pos"] * 3, "3 modes for 2 joints"),
        (["lbr_iiwa_joint_1", "lbr_iiwa_joint_7"], ["vel", "🦾"], "unknown"),
        ([], ["x" * 10_000], "unknown"),
        (["lbr_iiwa_joint_1", "é" * 10_000], ["pos"], "unknown"),
    ],
)
@pytest.mark.parametrize("service", [SET_CONTROL_MODE, SET_INTERACTION_MODE])
def test_refusals_change_nothing_and_say_why(
    board: InProcess, service: Endpoint, joints: list[str], modes: list[str], text: str
) -> None:
    """M6, M7, I1: a wrong request is refused whole, in one line that says why."""
    if service is SET_INTERACTION_MODE:
        modes = [mode.replace("pos", "stif").replace("vel", "comp") for mode in modes]
    before = board.rig.modes()
    answer = board.call(service, names=joints, modes=modes)
    assert not answer.success
    assert text in answer.message
    assert "\n" not in answer.message
    assert len(answer.message) < 600
    assert board.rig.modes() == before
    assert {mode.code for mode in board.rig.board.get_interaction_mode()} == {"stif"}


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


def test_limits(board: InProcess) -> None:
    """P9, P14, S4: those in force: of the board, or of drives that allow less."""
    second, first = board.names[1], board.names[0]
    read = board.call(GET_LIMITS, names=[second, first])
    own = [board.settings.board.joints[j].limits for j in (1, 0)]
    for field in FIELDS:
        assert list(getattr(read, field)) == [getattr(limits, field) for limits in own]
    narrow = (DriveLimits(upper=0.5, velocity=0.4), *[DriveLimits()] * 6)
    board.rig.board.engine.narrow(partial(bounded, drives=narrow))
    read = board.call(GET_LIMITS, names=[second, first])
    assert list(read.upper) == [own[0].upper, 0.5]
    assert list(read.velocity) == [own[0].velocity, 0.4]
    assert list(read.acceleration) == [limits.acceleration for limits in own]


def test_impedance(board: InProcess) -> None:
    """I6: stiffness and damping are set and read per joint; bad values change nothing."""
    name, own = board.names[1], board.settings.board.joints[1].impedance
    before = board.call(GET_IMPEDANCE, names=[name])
    most = before.max_stiffness[0]
    assert (most, before.max_damping[0]) == (own.max_stiffness, own.max_damping)
    good = {"stiffness": [0.5 * most], "damping": [2.0]}
    assert board.call(SET_IMPEDANCE, names=[name], **good).success
    for bad in ([-1.0], [math.nan], [2 * most], []):
        answer = board.call(SET_IMPEDANCE, names=[name], stiffness=bad, damping=[1.0])
        assert not answer.success
        assert "stiffness" in answer.message
    answer = board.call(SET_IMPEDANCE, names=[name], stiffness=[1.0], damping=[math.nan])
    assert not answer.success
    assert "send" in answer.message
    after = board.call(GET_IMPEDANCE, names=[name])
    assert (after.stiffness[0], after.damping[0]) == (good["stiffness"][0], 2.0)


def test_reference_speeds(board: InProcess) -> None:
    """P2: speeds and accelerations are set and read back, each without the other, or refused."""
    name = board.names[4]
    before = board.call(GET_REFERENCES, names=[name])
    assert board.call(SET_REFERENCE_SPEED, names=[name], speeds=[0.7]).success
    assert "above 0" in board.call(SET_REFERENCE_SPEED, names=[name], speeds=[0.0]).message
    read = board.call(GET_REFERENCES, names=[name])
    assert (list(read.speeds), read.accelerations) == ([0.7], before.accelerations)
    assert board.call(SET_REFERENCE_SPEED, names=[name], accelerations=[3.0]).success
    for bad in ({"speeds": []}, {"accelerations": [-1.0]}):
        assert "send" in board.call(SET_REFERENCE_SPEED, names=[name], **bad).message
    read = board.call(GET_REFERENCES, names=[name])
    assert (list(read.speeds), list(read.accelerations)) == ([0.7], [3.0])


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


def test_motors_are_read_and_capped(board: InProcess) -> None:
    """Y5: as the state has them; set within what is configured, or not at all."""
    found = board.call(GET_MOTORS)
    assert found.success
    assert list(found.names) == board.names
    state = board.state()
    ratios = np.array(found.gear_ratios)
    np.testing.assert_allclose(state.motor_position, ratios * state.position, atol=1e-3)
    assert list(state.supply_voltage) == list(found.supply_voltages)
    name, peak = board.names[0], found.peak_currents[0]
    assert board.call(SET_MOTORS, names=[name], max_currents=[0.5 * peak]).success
    assert board.call(GET_MOTORS, names=[name]).max_currents[0] == 0.5 * peak
    refused = board.call(SET_MOTORS, names=[name], max_currents=[2.0 * peak])
    assert "max_current" in refused.message
    assert list(refused.codes) == ["out_of_range"]


def test_motor_torque_parameters_are_set_live(board: InProcess) -> None:
    """Y5: read, set and refused; an empty array leaves a value alone."""
    name = board.names[2]
    before = board.call(GET_MOTORS, names=[name])
    given = {"torque_constants": [1.1 * before.torque_constants[0]], "coulomb_negative": [0.5]}
    assert board.call(SET_MOTORS, names=[name], **given).success
    after = board.call(GET_MOTORS, names=[name])
    assert {field: list(getattr(after, field)) for field in given} == given
    assert after.back_emf_constants == before.back_emf_constants
    assert after.coulomb_positive == before.coulomb_positive
    refused = board.call(SET_MOTORS, names=[name], torque_constants=[1e3])
    assert list(refused.codes) == ["out_of_range"]
    assert "torque_constant 1000 of" in refused.message


def test_loops_and_encoders(board: InProcess) -> None:
    """Y5: loops are read and reset; encoders of motors, and of joints without power, are set."""
    name = board.names[5]  # at 0.9 rad
    read = board.call(GET_PIDS, loop="position", names=[name])
    assert read.success
    assert len(read.references) == len(read.outputs) == 1
    wrong = board.call(GET_PIDS, loop="pwm")
    assert "one of position, velocity, torque, current" in wrong.message
    assert board.call(SET_PIDS, loop="position", names=[name], reset=True).success
    refused = board.call(SET_ENCODERS, names=[name], positions=[0.0])
    assert list(refused.codes) == ["other_mode"]
    assert board.call(SET_ENCODERS, names=[name], positions=[0.0], motor=True).success
    board.pass_time()
    assert abs(board.state().motor_position[5]) < 1.0
    assert board.state().position[5] == pytest.approx(0.9, abs=0.02)
    assert board.set_mode([name], "idl").success
    assert board.call(SET_ENCODERS, names=[name], positions=[0.5]).success
    board.pass_time()
    for wrong in ({}, {"names": [name]}, {"names": [name], "motor": True}):
        assert "positions are required" in board.call(SET_ENCODERS, **wrong).message
    assert board.state().position[5] == pytest.approx(0.5, abs=0.02)
