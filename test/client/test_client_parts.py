# SPDX-License-Identifier: Apache-2.0
"""The parts of the client that need no board: waiting, what it knows of modes and calibrations."""

from __future__ import annotations

import asyncio
import threading
import time
from types import SimpleNamespace
from typing import Any, cast

import pytest
from control_board_msgs.msg import BoardState

from control_board_ros.client.board import ControlBoardClient
from control_board_ros.client.errors import BoardError, BoardNotFound, BoardTimeout
from control_board_ros.client.link import Link
from control_board_ros.client.modes import mode_texts
from control_board_ros.client.operations import (
    Awaitable,
    Blocking,
    Interface,
    operation,
    run,
)
from control_board_ros.client.references import flat
from control_board_ros.client.ros_link import RosLink
from control_board_ros.client.services import Services
from control_board_ros.client.state import CalibrationView, StateView
from control_board_ros.client.waiting import Wait
from control_board_ros.core.terms.vocabs import (
    ControlMode,
    parse_control_mode,
)


class Pair(Interface):
    """An interface with an operation that waits twice."""

    def __init__(self, *waits: Wait) -> None:
        link = SimpleNamespace(wake_user=int, gone=())
        super().__init__(cast(Services, SimpleNamespace(link=link)))
        self.waits, self.interrupted = waits, False

    @operation
    async def both(self, word: str, *, loud: bool = False) -> str:
        """Wait for both."""
        try:
            for wait in self.waits:
                await wait
        except (KeyboardInterrupt, asyncio.CancelledError):
            self.interrupted = True
            raise
        return word.upper() if loud else word

    @operation
    async def twice(self, word: str) -> str:
        """Wait for both, and once more."""
        return await self.both(word) + await self.both(word)


class Waiter(Blocking, Pair):
    """What a client is of its interfaces."""

    def __init__(self, *waits: Wait) -> None:
        self.pair = Pair(*waits)
        Blocking.__init__(self, self.pair._services, self.pair)
        self.aio = AioWaiter(self._services, self.pair)


class AioWaiter(Awaitable, Pair):
    """What ``client.aio`` is of them."""

    __init__ = Awaitable.__init__


def later(*waits: Wait, **how: Any) -> None:
    """Finish waits from another thread, one after the other."""

    def finish() -> None:
        for wait in waits:
            time.sleep(0.02)
            wait.finish(**how)

    threading.Thread(target=finish).start()


def test_the_blocking_form() -> None:
    """The coroutine runs in the caller's thread and returns its value."""
    waits = Wait(None), Wait(None)
    later(*waits)
    assert Waiter(*waits).both("done", loud=True) == "DONE"
    assert Waiter.both.__doc__ == "Wait for both."
    assert Waiter(*waits).twice("ho") == "hoho"  # one operation of another


def test_the_awaitable_form() -> None:
    """The same coroutine under asyncio, beside others."""
    waits = Wait(None), Wait(None)
    other = Wait(None)

    async def talk() -> list[str]:
        first, second = Waiter(*waits).aio, Waiter(other).aio
        later(*waits, other)
        return list(await asyncio.gather(first.both("a"), second.both("b", loud=True)))

    assert asyncio.run(talk()) == ["a", "B"]


def test_a_wait_that_was_closed() -> None:
    """The reason comes out of both forms."""
    for ask in (
        lambda waiter: waiter.both("x"),
        lambda waiter: asyncio.run(waiter.aio.both("x")),
    ):
        wait = Wait(None)
        later(wait, error=BoardError("the end"))
        with pytest.raises(BoardError, match="the end"):
            ask(Waiter(wait))


def test_the_first_end_counts() -> None:
    """A wait that timed out stays so."""
    wait = Wait(1.0)
    wait.finish(done=False)
    wait.finish()
    assert wait.finished
    assert not wait.done
    called = []
    wait.on_finish(lambda: called.append(1))
    assert called == [1]


def test_an_exception_of_the_coroutine_comes_out() -> None:
    """Not swallowed, not changed."""

    async def fails() -> None:
        wait = Wait(None)
        wait.finish()
        assert await wait
        raise ValueError("as it is")

    with pytest.raises(ValueError, match="as it is"):
        run(fails())


def test_a_cancelled_task_reaches_the_coroutine() -> None:
    """Asyncio's cancellation is seen where the steps wait."""
    waiter = Waiter(Wait(None))

    async def talk() -> None:
        task = asyncio.create_task(waiter.aio.both("x"))
        await asyncio.sleep(0.02)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(talk())
    assert waiter.pair.interrupted


class NoLink:
    """A connection without messages, on which no time passes."""

    answer_timeout = 1.0

    def __init__(self) -> None:
        self.thread = self
        self.asked: list[bool] = []

    def subscribe(self, *_: object) -> None:
        """The test delivers the messages."""

    async def flush(self) -> None:
        """Nothing was published."""

    async def until(self, condition: Any, _: float) -> bool:
        """Note whether the condition held at once."""
        self.asked.append(condition())
        return self.asked[-1]


def test_states_that_waited_in_line_are_no_fresh_ones() -> None:
    """On a busy machine, states from before a request are processed after its answer."""
    link = NoLink()
    states = StateView(cast(RosLink, link))
    early = time.time_ns()
    states.on_message(BoardState(), {"received_timestamp": early})
    assert run(states.latest()) is not None
    states.changed()
    for _ in range(5):
        states.on_message(BoardState(), {"received_timestamp": early})
    assert not states.shown()
    states.on_message(BoardState(), {"received_timestamp": time.time_ns()})
    assert not states.shown()  # it may have been read before
    states.on_message(BoardState(), {"received_timestamp": 0})  # of now, for all that is known
    assert states.shown()
    run(states.latest())
    assert link.asked == [True, True]


def test_other_joints_on_another_board() -> None:
    """A restarted board may have other joints."""
    services = Services(cast(Link, NoLink()), *cast(Any, (None, None)))
    assert services.selector is None
    services.on_modes(SimpleNamespace(names=["a"]))
    services.on_modes(SimpleNamespace(names=["x", "y"]))
    before = services.selector
    assert before is not None
    assert before.names == ("x", "y")
    services.on_modes(SimpleNamespace(names=["x", "y"]))
    assert services.selector is before


def test_modes_of_a_request() -> None:
    """M7: texts go as they are, for the board to judge; enumerations and numbers as codes."""
    assert mode_texts("Position", parse_control_mode) == ["Position"]
    assert mode_texts(ControlMode.VELOCITY, parse_control_mode) == ["vel"]
    given = ["nonsense", ControlMode.IDLE, int(ControlMode.TORQUE)]
    assert mode_texts(given, parse_control_mode) == ["nonsense", "idl", "torq"]
    with pytest.raises(ValueError, match="5 is no control mode"):
        mode_texts(5, parse_control_mode)


def test_malformed_values_are_sent_as_far_as_they_go() -> None:
    """P13: so that the board counts them."""
    assert flat([1, 2]) == [1.0, 2.0]
    assert flat(3) == [3.0]
    assert flat("x") == []
    assert flat([[1.0]]) == []


def test_a_condition_that_fails_ends_its_wait_only() -> None:
    """Who waits gets the error; the thread that looks goes on."""
    wait = Wait(None, lambda: 1 / 0 > 0)
    wait.look(time.monotonic())
    assert wait.finished

    async def waits() -> bool:
        return await wait

    with pytest.raises(ZeroDivisionError):
        run(waits())


def test_calibrations() -> None:
    """K3, K4: statuses from feedback and results; late feedback is ignored."""
    view = CalibrationView()
    assert view.status("a").phase == "none"
    view.started(["a", "b"])
    assert view.status("a").running
    feedback = SimpleNamespace(names=["a", "b"], progress=[1.0, 0.5], phase="move")
    view.on_feedback(feedback)
    assert view.status("b").progress == 0.5
    view.ended(["a", "b"], False, "b is not calibrated: no stop")
    assert view.status("a").done
    assert not view.status("b").done
    assert view.status("b").message == "b is not calibrated: no stop"
    view.on_feedback(feedback)
    assert not view.status("b").running
    assert not view.status("b").done
    view.on_feedback(SimpleNamespace(names=["a", "b"], progress=[1.0, 1.0], phase=""))
    assert view.status("b").done  # queued when the result was processed
    assert view.status("b").message == ""


def test_one_kind_of_error() -> None:
    """Users catch BoardError."""
    assert issubclass(BoardNotFound, BoardError)
    assert issubclass(BoardTimeout, BoardError)


def test_a_client_needs_a_node() -> None:
    with pytest.raises(TypeError, match=r"an rclpy node, not 'control_board'; connect\(\) makes"):
        ControlBoardClient("control_board")
