# SPDX-License-Identifier: Apache-2.0
"""Where a call may come from: any thread, any executor, asyncio, a script with connect()."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from processes import python
from rclpy.executors import SingleThreadedExecutor
from talk import patient
from waiting import GUARD

from control_board_ros.client import BoardError, BoardNotFound, ControlBoardClient, connect
from control_board_ros.core.terms.vocabs import ControlMode as M
from control_board_ros.interface import CALIBRATE
from control_board_ros.testing import BoardProcess, board_process, free_domain, ros_node

pytestmark = pytest.mark.ros


@pytest.fixture
def spinning(board: BoardProcess) -> Iterator[Any]:
    """A node that another thread spins."""
    with ros_node(board.domain, "spinning") as node:
        yield node


def test_within_a_callback(board: BoardProcess, spinning: Any) -> None:
    """A call from a callback of the executor that spins the node does not deadlock."""
    answers: list[Any] = []
    done = threading.Event()
    with patient(spinning, board.name) as client:

        def once() -> None:
            timer.cancel()
            answers.append(client.get_control_mode(0))
            done.set()

        timer = spinning.create_timer(0.01, once)
        assert done.wait(GUARD)
        spinning.destroy_timer(timer)
    assert answers == [[M.POSITION]]


def test_in_a_coroutine_of_rclpy(board: BoardProcess, spinning: Any) -> None:
    """Await in a coroutine of the node's executor, which stays free."""
    done = threading.Event()
    answers: list[Any] = []
    with patient(spinning, board.name) as client:

        async def ask() -> None:
            answers.append(await client.aio.get_control_mode(0))
            answers.append(await client.aio.move(0, 0.1, 0.5))
            answers.append(await client.aio.check_motion_done(0))
            done.set()

        spinning.executor.create_task(ask)
        assert done.wait(GUARD)
        assert answers[0] == [M.POSITION]
        assert answers[1], answers[1].message
        assert answers[2] == [True]


@pytest.mark.slow
def test_in_asyncio(board: BoardProcess, node: Any) -> None:
    """Await under asyncio: many at a time, and a cancelled move stops the joint."""

    async def talk(client: ControlBoardClient) -> None:
        modes = await asyncio.gather(*(client.aio.get_control_mode(k) for k in range(7)))
        assert modes == [[M.POSITION]] * 7
        move = asyncio.create_task(client.aio.move(1, -1.0, 0.2))
        while await client.aio.check_motion_done(1) == [True]:  # until it is under way
            await asyncio.sleep(0.01)
        move.cancel()
        with pytest.raises(asyncio.CancelledError):
            await move
        assert await client.aio.check_motion_done(1) == [True]
        ticks = 0
        move = asyncio.create_task(client.aio.move(0, 0.3, 0.5))
        while not move.done():
            await asyncio.sleep(0.01)
            ticks += 1
        assert ticks > 2  # the loop was free
        assert move.result()

    with patient(node, board.name) as client:
        asyncio.run(talk(client))


def test_the_awaitable_forms(board: BoardProcess, node: Any) -> None:
    """Aio lists what it has, and says so where it has not."""
    with patient(node, board.name) as client:
        assert {"set_control_mode", "move", "get_encoder", "wait_for_state"} <= set(
            dir(client.aio)
        )
        with pytest.raises(AttributeError, match="no awaitable form"):
            client.aio.close  # noqa: B018


def test_from_many_threads(board: BoardProcess, node: Any) -> None:
    """One client, many threads."""
    failed: list[BaseException] = []
    with patient(node, board.name) as client:

        def talk(k: int) -> None:
            try:
                for _ in range(20):
                    assert client.set_control_mode(k, "pos")
                    assert client.get_encoder(k).shape == (1,)
            except BaseException as error:  # noqa: BLE001
                failed.append(error)

        threads = [threading.Thread(target=talk, args=(k,)) for k in range(7)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not failed


@pytest.mark.slow
def test_namespaces_and_remappings(board: BoardProcess) -> None:
    """The name of the board is relative to the node, and remapped as the node is."""
    with ros_node(board.domain, "far", namespace="somewhere", spin=False) as node:
        with ControlBoardClient(node, "control_board", find_timeout=4.0) as client:
            assert client.board_name == "/somewhere/control_board"
            with pytest.raises(BoardError, match="boards there are: /control_board"):
                assert client.names
        with patient(node, "/control_board") as client:
            assert len(client.names) == 7


@pytest.mark.slow
def test_a_board_that_comes_back() -> None:
    """One client outlives its board, and serves the next one of the same name, of its limits."""
    with (
        free_domain() as domain,
        ros_node(domain, "long", spin=False) as node,
        ControlBoardClient(
            node, "control_board", find_timeout=2.0, answer_timeout=GUARD
        ) as client,
    ):
        for limit in (0.5, 1.0):
            parameters = {"joint_defaults.limits.velocity": limit}
            with board_process(parameters, domain=domain):
                client.wait_until_found(GUARD)
                assert bool(client.position_move(0, 0.1, 0.8)) == (limit > 0.8)
                assert client.set_control_mode(0, "vel")
                assert client.velocity_move(0, 0.01)
                assert client.get_ref_velocity(0).tolist() == [0.01]
            with pytest.raises(BoardError, match="no board found"):
                client.get_control_mode()


def test_several_executors_do_not_mind(board: BoardProcess, node: Any) -> None:
    """The node may be added to an executor after the client was made."""
    with patient(node, board.name) as client:
        assert client.names
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        assert client.get_control_mode(0) == [M.POSITION]
        executor.remove_node(node)
        executor.shutdown()


class Slow:
    """Of an action client: it comes back late from sending, when the answer is there already."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._handle, name)
        if not name.startswith("send"):
            return method

        def send(request: Any) -> Any:
            number = method(request)
            time.sleep(0.05)
            return number

        return send

    def __enter__(self) -> Any:
        return self._handle.__enter__()

    def __exit__(self, *error: object) -> None:
        self._handle.__exit__(*error)


def test_answers_that_come_at_once_are_not_lost(ros_client: ControlBoardClient) -> None:
    """Rclpy drops an answer that it processes before it has stored the request."""
    assert ros_client.calibrate(2)
    action = ros_client._link._entities[CALIBRATE]
    action._client_handle, quick = Slow(action._client_handle), action._client_handle
    try:
        assert ros_client.calibrate(2)
    finally:
        action._client_handle = quick


def test_three_lines_are_enough(board: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """It brings a node and a context of its own, which end with it; rclpy's own stays as it is."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(board.domain))
    client = connect(find_timeout=60.0, answer_timeout=60.0)
    try:
        assert len(client.names) == 7
        assert client.set_control_mode(0, "pos")
        assert not rclpy.ok()
        context = client._link._node.context
        assert context.ok()
    finally:
        client.close()
        client.close()  # the second time there is nothing to end
    assert not context.ok()


@pytest.mark.slow
def test_a_board_that_is_not_there(board: BoardProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line with the domain, the time, and the boards that are."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(board.domain))
    with connect("nowhere", find_timeout=2.0) as client, pytest.raises(BoardNotFound) as raised:
        client.get_encoder()
    assert str(raised.value) == (
        f"no board found on domain {board.domain} after 2 s as /nowhere; "
        "boards there are: /control_board"
    )


def test_refusals_of_ros_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain that is none ends nothing but the call; an option that is none is a TypeError."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "none")
    with pytest.raises(BoardError, match=r"^cannot start a ROS node: .+$"):
        connect()
    monkeypatch.setenv("ROS_DOMAIN_ID", "47")
    with pytest.raises(BoardError, match=r"^board name 'my board' is not valid; topic "):
        connect("my board")
    with pytest.raises(TypeError, match="patience"):
        connect(patience=1.0)


def test_a_client_needs_no_log_folder(board: BoardProcess) -> None:
    """A home that cannot be written, as of a service: a stop is sent all the same."""
    program = "from control_board_ros.client import connect as c; print(c().emergency_stop(False))"
    nowhere = dict.fromkeys(("HOME", "ROS_LOG_DIR"), "/proc/nowhere")
    done = python(program, env=board.environment | nowhere)
    assert (done.stdout, done.stderr) == ("accepted\n", "")
