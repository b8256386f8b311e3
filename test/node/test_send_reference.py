# SPDX-License-Identifier: Apache-2.0
"""References by ~/send_reference and by the topic of their kind (SPEC P, M4, M7, Y1, Y2)."""

from __future__ import annotations

from typing import Any

import pytest
from board_in_process import InProcess

from control_board_ros.core.machine.commands import COMMANDS
from control_board_ros.interface import (
    COMMAND_TOPICS,
    EXTERNAL_TORQUE_SENSOR,
    FEEDFORWARD_COMMAND,
    GET_AVAILABLE_MODES,
    GET_IMPEDANCE,
    GET_REFERENCES,
    JOINT_TRAJECTORY,
    POSITION_COMMAND,
    SEND_REFERENCE,
    VELOCITY_COMMAND,
    Endpoint,
)
from control_board_ros.settings.loading import Settings, load

#: A mode that takes each kind, the field of the last accepted one, and a value beyond its limit.
KINDS = {
    "position": ("pos", "positions", 40.0),
    "position_direct": ("posd", "direct_positions", -40.0),
    "velocity": ("vel", "velocities", 40.0),
    "torque": ("torq", "torques", -4000.0),
    "output": ("open", "outputs", 400.0),
    "velocity_direct": ("veld", "direct_velocities", 40.0),
    "current": ("icur", "currents", 4000.0),
}
MODES = [*(mode for mode, _, _ in KINDS.values()), "mix", "idl"]


@pytest.fixture(scope="module")
def settings() -> Settings:
    return load("iiwa", {"joint_defaults.control_modes": MODES})


@pytest.fixture
def board(settings: Settings) -> InProcess:
    """An iiwa that implements all modes, in POSITION."""
    return InProcess(settings)


def send(board: InProcess, kind: str, names: list[str], values: list[float], **more: Any) -> Any:
    return board.call(SEND_REFERENCE, kind=kind, names=names, values=values, **more)


def last(board: InProcess, field: str, joints: list[str]) -> list[float]:
    """The last accepted references of a kind."""
    return list(getattr(board.call(GET_REFERENCES, names=joints), field))


def rejected(board: InProcess) -> list[int]:
    return [int(count) for count in board.rig.board.rejected_commands]


@pytest.mark.parametrize(
    "topic",
    [one for one in COMMAND_TOPICS if one.reference is not None and one is not JOINT_TRAJECTORY],
    ids=lambda topic: topic.short,
)
def test_a_topic_does_the_same_and_warns(board: InProcess, topic: Endpoint) -> None:
    """M4: of what is ignored, and of what is bounded, which is not called ignored."""
    assert topic.reference is not None
    mode, field, beyond = KINDS[topic.reference.name.lower()]
    values = COMMANDS[topic.reference].field
    first, second, *rest = board.names
    assert board.set_mode([first, second], mode, "idl").success
    board.send(topic, names=[first], **{values: [0.1]})
    assert last(board, field, [first]) == [0.1]
    assert board.warnings == []
    board.send(topic, names=[first], **{values: [beyond]})
    assert 0.1 < abs(last(board, field, [first])[0]) < abs(beyond)
    board.send(topic, names=[second, first], **{values: [0.1, 0.2]})
    assert last(board, field, [first]) == [0.2]
    assert rejected(board) == [0, 1, *[0] * len(rest)]
    (bounded, times), (ignored, what) = board.warnings
    assert "bounded to" in bounded
    assert f"for {second} ignored: mode is IDLE" in ignored
    assert (times, what) == ("times", "ignored")


def test_values_along_with_references_on_topics(board: InProcess) -> None:
    """P1, P5: likewise; without it the set ones count."""
    first, second = board.names[:2]
    assert board.set_mode([second], "vel").success
    board.send(POSITION_COMMAND, names=[first], positions=[0.1], speeds=[0.2])
    assert board.rig.board.get_remaining_time(first)[0] == pytest.approx(0.1 / 0.2)
    board.send(VELOCITY_COMMAND, names=[second], velocities=[0.5], accelerations=[0.2])
    board.rig.run(0.1)
    assert board.state().velocity_reference[1] == pytest.approx(0.2 * 0.1, rel=0.1)


def test_feedforward_terms(board: InProcess) -> None:
    """P11: outputs as values, torques along; either may be left empty; by topic likewise."""
    first = board.names[0]
    assert list(send(board, "feedforward", [first], [250.0], along=[0.5]).values) == [100.0]
    assert list(board.call(GET_IMPEDANCE, names=[first]).torque_offset) == [0.5]
    assert list(send(board, "feedforward", [first], [], along=[0.25]).values) == [0.25]
    assert "neither outputs nor torques given" in send(board, "feedforward", [first], []).message
    board.send(FEEDFORWARD_COMMAND, names=[first], outputs=[1.0], torques=[0.75])
    assert list(board.call(GET_IMPEDANCE, names=[first]).torque_offset) == [0.75]
    assert send(board, "feedforward", [first], [0.0], along=[0.0]).success


def test_the_velocity_of_the_present_mode(board: InProcess) -> None:
    """M11, Y1: the direct one in VELOCITY_DIRECT, else that of VELOCITY, in one response."""
    first, second = board.names[:2]
    assert board.set_mode([first, second], "vel", "veld").success
    assert send(board, "velocity", [first], [0.1]).success
    assert send(board, "velocity_direct", [second], [0.2]).success
    assert last(board, "ref_velocities", [second, first]) == [0.2, 0.1]
    assert board.set_mode([first, second], "veld", "vel").success
    read = board.call(GET_REFERENCES, names=[first, second])
    assert list(read.ref_velocities) == [read.direct_velocities[0], read.velocities[1]]
    assert (read.direct_velocities[1], read.velocities[0]) == (0.2, 0.1)


def test_kinds_that_are_none(board: InProcess) -> None:
    """M4: nothing faults by a reference."""
    first = board.names[0]
    reply = send(board, "speed", [first], [0.1])
    assert "kind 'speed' unknown; one of position, position_direct, velocity" in reply.message
    assert "did you mean 'velocity'?" in send(board, "velocty", [first], [0.1]).message
    assert {mode.code for mode in board.rig.modes()} == {"pos"}


def test_a_torque_from_elsewhere() -> None:
    """Y5, I7: TORQUE is there once torques come."""
    name = "lbr_iiwa_joint_6"
    board = InProcess(load("iiwa", {f"{name}.torque_sensor": "external"}))

    def modes() -> str:
        return str(board.call(GET_AVAILABLE_MODES, names=[name]).control_modes[0])

    assert "torq" not in modes()
    board.send(EXTERNAL_TORQUE_SENSOR, names=[name], torques=[1.25])
    board.pass_time()
    assert board.state().torque[5] == 1.25
    assert "torq" in modes()


def test_references_bring_a_timeout_of_their_own(board: InProcess) -> None:
    """P12: what nobody repeats ends, by default never; what does not expire is refused so."""
    name = board.names[0]
    assert board.set_mode([name], "open").success
    assert send(board, "output", [name], [1.0], valid_for=0.3).success
    for kind in ("position", "feedforward"):
        assert "does not expire" in send(board, kind, [name], [1.0], valid_for=0.3).message
    board.rig.tick(299)
    assert board.rig.modes()[0].code == "open"
    board.rig.tick(2)
    assert board.rig.modes()[0].code == "hwfa"
