# SPDX-License-Identifier: Apache-2.0
"""yarp.py: YARP's words, and the callbacks, without a node."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from rig import Rig, board_config, joint
from yarp_control_msgs import msg, srv

from control_board_ros.core.board import Board
from control_board_ros.core.terms.modes import STATES
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.interface import YARP
from control_board_ros.node.wiring.reporter import Reporter
from control_board_ros.node.wiring.yarp import (
    NAMES,
    SETTABLE,
    RefusedError,
    YarpInterface,
    available,
    base_name,
    letters,
    offer_yarp,
    vocabs,
    wanted,
)
from control_board_ros.testing.domains import free_domain
from control_board_ros.testing.nodes import ros_node

M = ControlMode
ROW = {row.name.removeprefix("~/"): row for row in YARP}


class Asked:
    """A board of two joints that YARP's clients ask; joint b implements few modes."""

    def __init__(self) -> None:
        poor = joint(
            "b",
            startup_mode=M.POSITION,
            control_modes=(M.POSITION, M.MIXED, M.IDLE),
            interaction_modes=(InteractionMode.STIFF,),
        )
        self.simulation = Rig(board_config(joint("a", startup_mode=M.POSITION), poor))
        self.board, self.tick = self.simulation.board, self.simulation.tick
        self.warnings: list[str] = []
        self.errors: list[Exception] = []
        self.noted: list[tuple[str, bool]] = []
        self.requests: Any = SimpleNamespace(
            note=lambda row, *_, success, message: self.noted.append((row.name + message, success))
        )
        self.yarp = YarpInterface(
            self,
            lambda text, _what: self.warnings.append(text),
            lambda error, _where: self.errors.append(error),
            self.requests,
        )
        self.snapshots = SimpleNamespace()

    @contextlib.contextmanager
    def exclusive(self) -> Iterator[Board]:
        yield self.board

    def call(self, name: str, kind: Any, **request: Any) -> Any:
        return self.yarp.answering(ROW[name])(kind.Request(**request), kind.Response())

    def send(self, name: str, message: Any) -> None:
        self.yarp.reference(ROW[name])(message)


@pytest.fixture
def rig() -> Asked:
    made = Asked()
    made.tick()
    assert made.board.get_control_mode() == [M.POSITION] * 2
    return made


def test_every_mode_that_a_joint_is_in_has_a_name() -> None:
    """Also the statuses; what may be set reads back by its own name, but for two old pairs."""
    assert {mode: NAMES[mode] for mode in STATES} == {
        M.POSITION: "POSITION",
        M.POSITION_DIRECT: "POSITION_DIRECT",
        M.VELOCITY: "VELOCITY",
        M.MIXED: "MIXED",
        M.TORQUE: "TORQUE",
        M.OPENLOOP: "PWM",
        M.IDLE: "IDLE",
        M.VELOCITY_DIRECT: "VELOCITY_DIRECT",
        M.CURRENT: "CURRENT",
        M.HW_FAULT: "HW_FAULT",
        M.CALIBRATING: "CALIBRATING",
        M.NOT_CONFIGURED: "NOT_CONFIGURED",
    }
    for mode in set(STATES) - {M.HW_FAULT, M.CALIBRATING, M.NOT_CONFIGURED}:
        assert SETTABLE[NAMES[mode]] == (mode,)


@pytest.mark.parametrize("mode", ["HW_FAULT", "CALIBRATING", "position", "", "🤖", "x" * 10_000])
def test_unsettable_modes_are_reported(mode: str) -> None:
    """M6: a status and an unknown mode; the text lists what can be set."""
    with pytest.raises(RefusedError) as refused:
        wanted(["POSITION", mode], 2)
    assert refused.value.word == "SET_ERROR"
    assert "FORCE_IDLE" in refused.value.text
    assert len(refused.value.text) < 300


@pytest.mark.parametrize("said", ["0 modes", "1 mode", "3 modes"])
def test_one_mode_per_joint(said: str) -> None:
    with pytest.raises(RefusedError) as refused:
        wanted(["IDLE"] * int(said[0]), 2)
    assert refused.value.word == "INVALID"
    assert refused.value.text.startswith(f"{said} for 2 joints")


def test_modes_that_all_joints_implement(rig: Asked) -> None:
    """The others are listed with the joints that do; setting a listed one faults no joint (M5)."""
    modes, text = available(rig.board.config.joints)
    assert modes == ["FORCE_IDLE", "IDLE", "MIXED", "POSITION"]
    assert text.startswith("some joints only: IMPEDANCE_POS (a); IMPEDANCE_VEL (a); OPENLOOP (a)")
    assert "CURRENT" not in text
    assert available(rig.board.config.joints[1:]) == (modes, "")
    listed = rig.call("get_available_modes", srv.GetAvailableControlModes, only_implemented=True)
    assert (listed.response, list(listed.modes), listed.opt_descr) == ("OK", modes, text)
    settable = rig.call("get_available_modes", srv.GetAvailableControlModes)
    assert set(settable.modes) == set(SETTABLE)


@pytest.mark.parametrize(
    ("name", "kind", "request_", "word", "text"),
    [
        ("get_modes", srv.GetControlModes, {"names": ["c"]}, "NAMES_ERROR", "joint 'c' unknown"),
        ("get_position", srv.GetPosition, {"names": ["c"]}, "NAMES_ERROR", "joint 'c' unknown"),
        ("get_velocity", srv.GetVelocity, {"names": ["c"] * 60_000}, "NAMES_ERROR", "'c' unknown"),
        *(
            ("get_joints_names", srv.GetJointsNames, {"joint_indexes": indices}, word, text)
            for indices, word, text in (
                ([-1], "GET_NAME_ERROR", "joints are 0 to 1"),
                ([2], "GET_NAME_ERROR", "index 2 out of range"),
                ([0] * 3, "SIZE_ERROR", "3 indices for 2 joints"),
            )
        ),
    ],
)
def test_every_refusal_of_a_reading_has_its_word_and_its_reason(
    rig: Asked, name: str, kind: Any, request_: dict[str, Any], word: str, text: str
) -> None:
    answer = rig.call(name, kind, **request_)
    assert answer.response == word
    assert text in answer.opt_descr


@pytest.mark.parametrize(
    ("msgs_name", "base"),
    [
        ("~", "/left/board"),
        ("~/", "/left/board"),
        ("~/yarp", "/left/board/yarp"),
        ("/icub/head", "/icub/head"),
        ("icub/head", "/icub/head"),
    ],
)
def test_namespace_of_the_yarp_names(msgs_name: str, base: str) -> None:
    """As msgs_name there: a slash comes first; and as ROS has it, ~ is the node."""
    assert base_name(msgs_name, "/left/board") == base


@pytest.mark.parametrize(
    ("msgs_name", "base"),
    [("~", "/icub/head"), ("~/yarp", "/icub/head/yarp"), ("/a", "/a/head"), ("a/b", "/a/b/head")],
)
def test_each_part_of_a_robot_has_names_of_its_own(msgs_name: str, base: str) -> None:
    assert base_name(msgs_name, "/icub/head", "head") == base


def test_letters_and_vocabs() -> None:
    """An int8 holds the first of four letters."""
    modes = [M.POSITION, M.POSITION_DIRECT, M.HW_FAULT, M.CALIBRATING]
    assert letters(modes).tolist() == [ord(letter) for letter in "pphc"]
    assert vocabs(modes).tolist() == [7565168, 1685286768, 1634105192, 7102819]


def test_a_group_is_set_whole_or_not_at_all(rig: Asked) -> None:
    """Joint b does not implement VELOCITY: M5 for it, and joint a stays as it is."""
    answer = rig.call("set_modes", srv.SetControlModes, modes=["VELOCITY", "VELOCITY"])
    assert answer.response == "SET_ERROR"
    assert "b does not implement vel" in answer.opt_descr
    assert rig.board.get_control_mode() == [M.POSITION, M.HW_FAULT]
    answer = rig.call("set_modes", srv.SetControlModes, modes=["IDLE", "IDLE"])
    assert answer.response == "SET_ERROR"
    assert "send FORCE_IDLE first" in answer.opt_descr
    assert rig.board.get_control_mode() == [M.POSITION, M.HW_FAULT]
    answer = rig.call("set_modes", srv.SetControlModes, modes=["IMPEDANCE_VEL", "FORCE_IDLE"])
    assert (answer.response, answer.opt_descr) == ("OK", "")
    assert rig.board.get_control_mode() == [M.VELOCITY, M.IDLE]
    assert rig.board.get_interaction_mode("a") == [InteractionMode.COMPLIANT]


def test_a_wrong_group_changes_nothing(rig: Asked) -> None:
    """M7: one name or one mode of it that does not exist."""
    for request in (
        {"names": ["a", "c"], "modes": ["IDLE", "IDLE"]},
        {"names": ["a", "a"], "modes": ["IDLE", "IDLE"]},
        {"names": ["a", "b", "c"], "modes": ["IDLE"] * 3},
        {"names": ["a", "b"], "modes": ["IDLE", "SWIM"]},
        {"names": ["a", "b"], "modes": ["IDLE"]},
        {"modes": ["IDLE"]},
        {},
    ):
        answer = rig.call("set_modes", srv.SetControlModes, **request)
        assert answer.response in ("INVALID", "SET_ERROR")
        assert answer.opt_descr
        assert rig.board.get_control_mode() == [M.POSITION] * 2


def test_speeds_that_come_along_stay_set(rig: Asked) -> None:
    """As there: the next message without speeds moves with them; where none move, they do not."""
    board, message = rig.board, msg.Position(names=["b"], positions=[0.5], ref_velocities=[0.3])
    rig.send("position", message)
    assert board.get_ref_speed().tolist() == [pytest.approx(math.radians(10)), 0.3]
    assert board.get_target_position("b").tolist() == [0.5]
    board.set_control_mode("b", M.IDLE)
    message.ref_velocities = [0.4]
    rig.send("position", message)
    assert board.get_ref_speed("b").tolist() == [0.3]
    assert "mode is IDLE" in rig.warnings[-1]
    board.set_control_mode("a", M.VELOCITY)
    rig.send("velocity", msg.Velocity(names=["a"], velocities=[0.1], ref_accelerations=[0.7]))
    assert board.get_ref_acceleration("a").tolist() == [0.7]


def test_a_stream_of_one_target_is_one_move(rig: Asked) -> None:
    """A move ends at its time, however often its message comes, also where one joint is done."""
    board = rig.board
    message = msg.Position(positions=[0.3, 0.1], ref_velocities=[0.3, 0.3])
    rig.send("position", message)
    expected = board.get_remaining_time()
    assert expected[0] == pytest.approx(1.0)
    cycles = round(0.5 / board.period)
    for _ in range(cycles):
        rig.tick()
        rig.send("position", message)
        message.ref_velocities = []
    assert board.check_motion_done() == [False, True]
    lasting = board.get_remaining_time("a")[0]
    assert lasting == pytest.approx(expected[0] - cycles * board.period, abs=2 * board.period)
    rig.send("position", msg.Position(names=["a"], positions=[0.4]))
    assert board.get_target_position("a").tolist() == [0.4]
    rig.send("position", msg.Position(names=["a"], positions=[0.4], ref_velocities=[0.2]))
    assert board.get_ref_speed("a").tolist() == [0.2]
    board.stop()
    rig.send("position", msg.Position(names=["a"], positions=[0.4]))
    assert board.check_motion_done("a") == [False]


def test_a_stream_of_small_steps_is_followed_without_a_word(rig: Asked) -> None:
    """As of a trajectory controller; a target that a limit bounds is reported."""
    reference = 0.0
    for k in range(100):
        reference = 0.02 * (1.0 - math.cos(0.02 * math.pi * k))
        rig.send("position", msg.Position(names=["a"], positions=[reference]))
        rig.tick(5)
    assert rig.board.state.position_reference[0] == pytest.approx(reference, abs=5e-3)
    assert rig.warnings == []
    rig.send("position", msg.Position(names=["a"], positions=[9.0]))
    assert "bounded to" in rig.warnings[0]


def test_a_repeat_in_mixed_is_a_move_once_the_velocity_led_away(rig: Asked) -> None:
    """P15, P6: none while the move is under way, whatever a velocity adds; then it leads back."""
    board = rig.board
    board.set_control_mode(None, M.MIXED)
    rig.send("position", msg.Position(names=["a"], positions=[0.3]))
    rig.send("velocity", msg.Velocity(names=["a"], velocities=[0.1], ref_accelerations=[0.7]))
    rig.tick(50)
    before = board.get_remaining_time("a")[0]
    rig.send("position", msg.Position(names=["a"], positions=[0.3]))
    assert board.get_remaining_time("a")[0] == before > 0.0
    while not board.check_motion_done("a")[0]:
        rig.tick()
    assert board.state.position_reference[0] > 0.31
    rig.send("position", msg.Position(names=["a"], positions=[0.3]))
    assert not board.check_motion_done("a")[0]
    while not board.check_motion_done("a")[0]:
        rig.tick()
    assert board.state.position_reference[0] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("message", "counted"),
    [
        (msg.Position(positions=[0.1]), [1, 1]),
        (msg.Position(names=["a"]), [1, 0]),
        (msg.Position(names=["a"], positions=[math.nan]), [1, 0]),
        (msg.Position(names=["a", "c"], positions=[0.1, 0.1]), [1, 0]),
        (msg.Position(names=["a"] * 5, positions=[0.1] * 5), [1, 0]),
        (msg.Position(names=["a"], positions=[0.1], ref_velocities=[0.1, 0.1]), [1, 0]),
        (msg.Position(names=["a"], positions=[0.1], ref_velocities=[-0.1]), [1, 0]),
        (msg.Position(names=["a"], positions=[0.1], ref_velocities=[math.inf]), [1, 0]),
    ],
)
def test_wrong_messages_are_ignored_counted_and_reported(
    rig: Asked, message: Any, counted: list[int]
) -> None:
    """M4, P13: as of the board's own commands."""
    before = rig.board.get_ref_speed().tolist()
    rig.send("position", message)
    assert rig.board.rejected_commands.tolist() == counted
    assert rig.board.check_motion_done() == [True, True]
    assert rig.board.get_ref_speed().tolist() == before
    assert len(rig.warnings) == 1


def test_nothing_is_reported_before_it_is_measured() -> None:
    answer = Asked().call("get_position", srv.GetPosition)
    assert (answer.response, list(answer.positions)) == ("RETRIEVE_ERROR", [])
    assert "nothing is measured yet" in answer.opt_descr


def test_an_error_of_the_program_is_an_answer(rig: Asked) -> None:
    """No callback ends the node, and no client waits in vain."""
    del rig.yarp._member
    answer = rig.call("get_modes", srv.GetControlModes)
    assert answer.response == "RETRIEVE_ERROR"
    assert "internal error" in answer.opt_descr
    assert isinstance(rig.errors[0], AttributeError)


@pytest.mark.parametrize(
    ("values", "below", "missing"),
    [
        ({"yarp_interface": False, "yarp_msgs_name": "/a"}, None, set()),
        ({"yarp_interface": True, "yarp_msgs_name": ""}, "", set(ROW)),
        ({"yarp_interface": True, "yarp_msgs_name": "~/yarp"}, "/left/board/yarp", set()),
        ({"yarp_interface": True, "yarp_msgs_name": "~"}, "/left/board", {"get_available_modes"}),
    ],
)
def test_offered_endpoints(
    rig: Asked,
    capfd: pytest.CaptureFixture[str],
    values: dict[str, Any],
    below: str | None,
    missing: set[str],
) -> None:
    """Nothing by default; without a name the modes only; a name that the board has is reported."""
    with free_domain() as domain, ros_node(domain, "board", namespace="/left", spin=False) as node:
        before = {service.srv_name for service in node.services}
        states: Any = SimpleNamespace(also=[])
        received = offer_yarp(node, rig, values, states, Reporter(node), rig.requests)
        services = {service.srv_name for service in node.services} - before
        commands = {subscription.topic_name for subscription in node.subscriptions}
        topics = {publisher.topic_name for publisher in node.publishers}
    yarp_topics = {"/left/joint_states/controlModes", "/left/joint_states/controlModeVocabs"}
    assert topics & yarp_topics == (set() if below is None else yarp_topics)
    assert len(states.also) == (below is not None)
    expected: dict[str, set[str]] = {
        kind: {f"{below}/{name}" for name, row in ROW.items() if row.kind == kind}
        if below
        else set()
        for kind in ("command", "service")
    }
    clash = {f"{below}/{name}" for name in missing} if below else set()
    assert commands == expected["command"]
    assert len(received) == len(commands)
    assert services == expected["service"] - clash
    warned = capfd.readouterr().err
    assert all(name in warned for name in clash)
    assert bool(warned) == bool(clash)


def test_a_part_of_a_robot_offers_it_below_its_own_name(rig: Asked) -> None:
    """Two parts of one robot do not answer for each other."""
    values = {"yarp_interface": True, "yarp_msgs_name": "/yarp"}
    with free_domain() as domain, ros_node(domain, "head", namespace="/icub", spin=False) as node:
        states: Any = SimpleNamespace(also=[])
        offer_yarp(node, rig, values, states, Reporter(node), rig.requests, part=True)
        services = {service.srv_name for service in node.services}
        topics = {publisher.topic_name for publisher in node.publishers}
    assert "/yarp/head/get_modes" in services
    assert not [name for name in services if name.startswith("/yarp/get")]
    assert "/icub/head/joint_states/controlModes" in topics
