# SPDX-License-Identifier: Apache-2.0
"""Publications reach the board, with other subscribers or not; a goal waits for discovery."""

from __future__ import annotations

import contextlib
import gc
import math
import threading
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest
from control_board_msgs.action import Move
from control_board_msgs.msg import JointModes, PositionCommand
from control_board_msgs.srv import GetControlMode, SetControlMode, Stop
from rclpy.action import ActionServer
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool
from talk import state_of
from waiting import GUARD, until

from control_board_ros.client import (
    BoardError,
    BoardNotFound,
    BoardTimeout,
    ControlBoardClient,
    InvalidAnswer,
    state,
)
from control_board_ros.client.operations import run
from control_board_ros.client.ros_link import RosLink
from control_board_ros.interface import (
    GET_CONTROL_MODE,
    MOVE,
    POSITION_COMMAND,
    SET_CONTROL_MODE,
    STATE,
)
from control_board_ros.testing import ros_node
from control_board_ros.testing.domains import free_domain

pytestmark = pytest.mark.ros
TOPIC = "/board/command/position"


class Ear:
    """Records the messages of the topic of position commands."""

    def __init__(self, node: Any) -> None:
        self.received: list[float] = []
        self._changed = threading.Condition()
        node.create_subscription(PositionCommand, TOPIC, self._take, QoSProfile(depth=10))

    def _take(self, message: PositionCommand) -> None:
        with self._changed:
            self.received += message.positions
            self._changed.notify_all()

    def receives(self, *values: float) -> bool:
        """Wait for these values, and no others."""
        with self._changed:
            return self._changed.wait_for(lambda: self.received == list(values), GUARD)


class Board:
    """A node that publishes modes and is asked for them; ``loses`` that many answers first.

    Attributes: sent (what became of each answer).
    """

    def __init__(self, node: Any, loses: float = 0) -> None:
        self.loses, self.sent = loses, list[str]()
        node.create_publisher(JointModes, "~/modes", 1)
        asked = node.create_service(GetControlMode, "~/get_control_mode", lambda _, r: r)
        answer = asked.send_response

        def send(*of: Any) -> None:
            self.sent.append("lost" if self.loses else "answered")
            if self.loses:
                self.loses -= 1
            else:
                answer(*of)

        asked.send_response = send


@pytest.fixture
def link() -> Iterator[RosLink]:
    """A connection to ``/board``, on a domain of its own."""
    with free_domain() as domain, ros_node(domain, "user", spin=False) as user:
        link = RosLink(user, "board", find_timeout=GUARD, answer_timeout=GUARD)
        yield link
        link.close()


def test_a_command_waits_for_the_board_itself(link: RosLink) -> None:
    """Not for a panel or a recorder, which subscribes to the same topic."""
    with ros_node(link.domain, "panel") as panel:
        other = Ear(panel)
        link.find_timeout = 0.5
        with pytest.raises(BoardNotFound):
            run(link.publish(POSITION_COMMAND, positions=[1.0]))
        link.find_timeout = GUARD
        for value in (2.0, 3.0):  # and again of a board that was restarted
            with ros_node(link.domain, "board") as node:
                node.create_publisher(JointModes, "~/modes", 1)
                own = Ear(node)
                run(link.publish(POSITION_COMMAND, positions=[value]))
                assert own.receives(value)
        assert other.receives(2.0, 3.0)


def test_publications_are_delivered_when_a_later_call_is_answered(link: RosLink) -> None:
    """A call that failed settles nothing: the next one queries again."""
    with ros_node(link.domain, "board") as node:
        board, ear = Board(node), Ear(node)
        run(link.call(GET_CONTROL_MODE))  # client and board are acquainted from now on
        run(link.publish(POSITION_COMMAND, positions=[1.0]))
        assert ear.receives(1.0)
        board.sent.clear()
        link.answer_timeout, board.loses = 0.5, math.inf
        with pytest.raises(BoardTimeout):
            run(link.flush())
        link.answer_timeout, board.loses = GUARD, 0
        run(link.flush())
        assert board.sent == ["lost", "answered"]
        run(link.flush())
        assert board.sent == ["lost", "answered"]


def test_calls_of_a_service_arrive_in_their_order(link: RosLink) -> None:
    """The first one waits until client and board are acquainted; a later one does not overtake."""
    modes: list[str] = []

    def take(request: Any, response: Any) -> Any:
        modes.extend(request.modes)
        return response

    def set_mode(mode: str) -> threading.Thread:
        thread = threading.Thread(target=lambda: run(link.call(SET_CONTROL_MODE, modes=[mode])))
        thread.start()
        return thread

    with ros_node(link.domain, "board") as node:
        board = Board(node, loses=1)
        node.create_service(SetControlMode, "~/set_control_mode", take)
        first = set_mode("torq")
        until(lambda: board.sent == ["lost"])
        second = set_mode("pos")
        for thread in (first, second):
            thread.join(GUARD)
    assert modes == ["torq", "pos"]


def test_a_call_waits_for_references_while_another_call_does(link: RosLink) -> None:
    """Each has an answer of its own that the board has processed what was published before."""
    answers: list[list[str]] = []

    def take(_: Any, response: Any) -> Any:
        answers.append(list(board.sent))
        return response

    def flush() -> None:
        with contextlib.suppress(BoardError):  # its answer is lost: it waits until the link closes
            run(link.flush())

    with ros_node(link.domain, "board") as node:
        board, ear = Board(node), Ear(node)
        node.create_service(SetControlMode, "~/set_control_mode", take)
        for service in (GET_CONTROL_MODE, SET_CONTROL_MODE):  # acquainted from now on
            run(link.call(service))
        run(link.publish(POSITION_COMMAND, positions=[1.0]))
        assert ear.receives(1.0)
        board.sent.clear()
        board.loses = 1
        threading.Thread(target=flush, daemon=True).start()
        until(lambda: board.sent == ["lost"])
        run(link.call(SET_CONTROL_MODE, modes=["torq"]))
    assert answers[1:] == [["lost", "answered"]]


def test_a_board_that_does_not_answer_and_does_again(link: RosLink) -> None:
    with ros_node(link.domain, "board") as node:
        board = Board(node)
        run(link.call(GET_CONTROL_MODE))
        link.answer_timeout, board.loses = 0.5, math.inf
        match = r"no answer from .*/board/get_control_mode after 0\.5 s"
        with pytest.raises(BoardTimeout, match=match):
            run(link.call(GET_CONTROL_MODE))
        link.answer_timeout, board.loses = GUARD, 0
        run(link.call(GET_CONTROL_MODE))


def test_a_request_waits_until_the_board_has_discovered_the_client(link: RosLink) -> None:
    """It is made once, however often the way of its answer was tried before."""
    made: list[list[str]] = []

    def set_mode(request: Any, response: Any) -> Any:
        made.append(list(request.modes))
        response.success = True
        return response

    with ros_node(link.domain, "board") as node:
        node.create_service(SetControlMode, "~/set_control_mode", set_mode)
        board = Board(node, loses=2)
        for mode in ("pos", "vel"):
            assert run(link.call(SET_CONTROL_MODE, modes=[mode])).success
        assert len(board.sent) > 2
        assert made == [["pos"], ["vel"]]


@pytest.mark.slow
def test_a_goal_waits_until_the_board_has_discovered_the_client(
    link: RosLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Answers to a client that the board does not know yet go nowhere; it is asked again."""
    for _ in range(2):  # the second is the board that was restarted
        with ros_node(link.domain, "board") as node:
            board = Board(node, loses=2)
            ActionServer(node, Move, "~/move", lambda _: Move.Result())
            run(link.action(MOVE))
            assert board.sent[:3] == ["lost", "lost", "answered"]
            with monkeypatch.context() as patch:
                patch.setattr(link._node, "create_client", pytest.fail)  # asked once of each
                run(link.action(MOVE))
        assert run(link.thread.until(lambda: not link.is_there(), GUARD))


def test_new_subscriptions_receive_states_again(
    link: RosLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the old ones receive nothing any more, as after a long cut of the network."""
    monkeypatch.setattr(state, "RENEWAL_PERIOD", 0.3)
    link.answer_timeout = 0.2
    with ros_node(link.domain, "board") as node:
        states = node.create_publisher(STATE.load(), "/board/state", 10)
        whole = state_of(["a"])
        node.create_timer(0.02, lambda: states.publish(whole))
        view = state.StateView(link)
        until(lambda: received(view))
        deaf = link._entities[STATE]
        deaf.callback = lambda *_: None  # as one without publishers
        until(lambda: run(view.following(0.1)) is not None)
        assert link._entities[STATE] is not deaf


def test_an_old_state_counts_only_if_the_board_answers(
    link: RosLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A paused board publishes none and answers; one that is out of reach does neither."""
    monkeypatch.setattr(state, "STALE_AGE", 0.2)
    with ros_node(link.domain, "board") as node:
        board = Board(node)
        states = node.create_publisher(STATE.load(), "/board/state", 10)
        publishing = node.create_timer(0.02, lambda: states.publish(state_of(["a"])))
        view = state.StateView(link)
        assert run(view.latest()).names == ("a",)
        publishing.cancel()
        until(lambda: time.monotonic() - view._at > state.STALE_AGE)
        assert run(view.latest()).names == ("a",)
        link.answer_timeout, board.loses = 0.3, math.inf
        with pytest.raises(BoardTimeout, match="no answer from /board/get_control_mode"):
            run(view.latest())
        assert run(view.latest(fresh=False)).names == ("a",)


@pytest.mark.parametrize("field", ["position", "temperature", "motion_done", "calibrated"])
def test_a_state_without_one_value_for_each_joint_is_refused(field: str) -> None:
    """Any ROS node can send one; the error says what is wrong with it."""
    assert state.State.of(state_of(["a", "b"])).checked().names == ("a", "b")
    short = state.State.of(
        state_of(["a", "b"], **{field: [1.0 if field in state.FLOAT_FIELDS else True] * 3})
    )
    with pytest.raises(InvalidAnswer, match=f"2 joints has 3 values of {field}"):
        short.checked()


def received(view: state.StateView) -> bool:
    """Whether a state came within a moment."""
    with contextlib.suppress(BoardTimeout):
        return bool(run(view.latest()).names)
    return False


class Stoppable:
    """A board of which only the stops answer, and those after ``loses`` lost answers.

    Attributes: received (the stops and positions that came, in order).
    """

    def __init__(self, node: Any, loses: int = 0) -> None:
        self.received: list[str] = []
        self.loses = loses
        self._modes = node.create_publisher(
            JointModes, "~/modes", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        )
        self._modes.publish(JointModes(names=["a"], control_modes=["pos"]))
        node.create_subscription(PositionCommand, TOPIC, self._take, QoSProfile(depth=10))
        mute = node.create_service(GetControlMode, "~/get_control_mode", lambda _, r: r)
        mute.send_response = lambda *_: None
        for kind, name in ((Stop, "stop"), (SetBool, "emergency_stop")):
            made = node.create_service(kind, f"~/{name}", partial(self._stop, name))
            made.send_response = partial(self._answer, made.send_response)

    def _take(self, _: PositionCommand) -> None:
        self.received.append("position")

    def _stop(self, name: str, _: Any, response: Any) -> Any:
        self.received.append(name)
        response.success = True
        if name == "stop":
            response.answers, response.reasons, response.codes = ["accepted"], [""], [""]
        return response

    def _answer(self, send: Any, *of: Any) -> None:
        if self.loses:
            self.loses -= 1
        else:
            send(*of)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stop", "emergency_stop"])
@pytest.mark.parametrize("loses", [0, 2])
def test_a_stop_waits_for_nothing(name: str, loses: int) -> None:
    """E2: before the references that were published are confirmed, again until it is answered."""
    with (
        free_domain() as domain,
        ros_node(domain, "user", spin=False) as user,
        ros_node(domain, "board") as node,
    ):
        board = Stoppable(node, loses)
        with contextlib.closing(ControlBoardClient(user, "board", answer_timeout=1.5)) as client:
            assert client.names == ("a",)
            run(client._link.publish(POSITION_COMMAND, names=["a"], positions=[1.0]))
            assert getattr(client, name)()
            assert board.received.count(name) >= loses + 2  # once more, behind the reference
            assert "position" in board.received


def test_a_client_that_is_dropped_ends() -> None:
    """Its thread and node, without a close; not while its awaitable form is used."""
    with free_domain() as domain, ros_node(domain, "user", spin=False) as user:
        aio = ControlBoardClient(user, "board").aio
        thread = aio.client._link.thread
        gc.collect()
        assert not thread.closed
        del aio
        gc.collect()
        assert thread.closed
