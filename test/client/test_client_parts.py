# SPDX-License-Identifier: Apache-2.0
"""The parts of the client that need no board: waiting, what it knows of modes and calibrations."""

from __future__ import annotations

import asyncio
import math
import threading
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from control_board_msgs.msg import BoardState

from control_board_ros.client.calibrations import CalibrationView
from control_board_ros.client.errors import BoardError, BoardNotFound, BoardTimeout
from control_board_ros.client.link import Link
from control_board_ros.client.modes import mode_texts
from control_board_ros.client.modes_view import ANSWER_HOLDS, ModesView
from control_board_ros.client.operations import Aio, operation
from control_board_ros.client.prediction import KnownJoint, predict
from control_board_ros.client.services import reply_of
from control_board_ros.client.state import StateView
from control_board_ros.client.values import as_given
from control_board_ros.client.waiting import Steps, Wait, run
from control_board_ros.core.config import JointConfig
from control_board_ros.core.decisions import Facts
from control_board_ros.core.faults import FaultRecord
from control_board_ros.core.reply import Answer, accepted, refused
from control_board_ros.core.selection import Selection
from control_board_ros.core.vocabs import (
    CommandKind,
    ControlMode,
    InteractionMode,
    parse_control_mode,
)


class Part:
    """A part with an operation that waits twice."""

    def __init__(self, *waits: Wait) -> None:
        self.waits, self.interrupted = waits, False

    def both(self, word: str, *, loud: bool = False) -> Steps[str]:
        """Wait for both."""
        try:
            yield from self.waits
        except (KeyboardInterrupt, asyncio.CancelledError):
            self.interrupted = True
            raise
        return word.upper() if loud else word


class Waiter:
    """What has the part, as a client has its parts."""

    def __init__(self, *waits: Wait) -> None:
        self.part = Part(*waits)

    both = operation("part", Part.both)


def later(*waits: Wait, **how: Any) -> None:
    """Finish waits from another thread, one after the other."""

    def finish() -> None:
        for wait in waits:
            time.sleep(0.02)
            wait.finish(**how)

    threading.Thread(target=finish).start()


def test_the_blocking_form() -> None:
    """The steps run in the caller's thread and return their value."""
    waits = Wait(None), Wait(None)
    later(*waits)
    assert Waiter(*waits).both("done", loud=True) == "DONE"
    assert Waiter.both.__doc__ == "Wait for both."


def test_the_awaitable_form() -> None:
    """The same steps under asyncio, beside others."""
    waits = Wait(None), Wait(None)
    other = Wait(None)

    async def talk() -> list[str]:
        first, second = Aio(Waiter(*waits), int), Aio(Waiter(other), int)
        later(*waits, other)
        return list(await asyncio.gather(first.both("a"), second.both("b", loud=True)))

    assert asyncio.run(talk()) == ["a", "B"]


def test_a_wait_that_was_closed() -> None:
    """The reason comes out of both forms."""
    for ask in (
        lambda waiter: waiter.both("x"),
        lambda waiter: asyncio.run(Aio(waiter, int).both("x")),
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


def test_an_exception_of_the_steps_comes_out() -> None:
    """Not swallowed, not changed."""

    def steps() -> Steps[None]:
        wait = Wait(None)
        wait.finish()
        yield wait
        raise ValueError("as it is")

    with pytest.raises(ValueError, match="as it is"):
        run(steps())


def test_a_cancelled_task_reaches_the_steps() -> None:
    """Asyncio's cancellation is seen where the steps wait."""
    waiter = Waiter(Wait(None))

    async def talk() -> None:
        task = asyncio.create_task(Aio(waiter, int).both("x"))
        await asyncio.sleep(0.02)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(talk())
    assert waiter.part.interrupted


def modes_message(**modes: str) -> Any:
    """A JointModes message, STIFF throughout."""
    codes = {mode.code: mode for mode in ControlMode}
    return SimpleNamespace(
        names=list(modes),
        control_mode_vocabs=[int(codes[code]) for code in modes.values()],
        interaction_mode_vocabs=[int(InteractionMode.STIFF)] * len(modes),
    )


def test_an_answer_outweighs_an_older_message() -> None:
    """A ~/modes message that was on its way does not undo the answer to a request."""
    view = ModesView()
    assert not view.known()
    view.on_message(modes_message(a="pos", b="idl"))
    assert view.names == ("a", "b")
    view.on_answer(["a"], ["vel"])
    assert view.control_mode("a") is ControlMode.VELOCITY
    view.on_message(modes_message(a="pos", b="pos"))  # of before the request
    assert view.control_mode("a") is ControlMode.VELOCITY
    assert view.control_mode("b") is ControlMode.POSITION
    view.on_message(modes_message(a="vel", b="pos"))  # of the request
    view.on_message(modes_message(a="hwfa", b="pos"))  # a fault since
    assert view.control_mode("a") is ControlMode.HW_FAULT


def test_what_answer_and_message_disagree_on_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Either may be the older one when the answer's time is over; the next answer tells."""
    view, now = ModesView(), at_time(monkeypatch)
    view.on_message(modes_message(a="idl", b="idl"))
    view.on_answer(["a", "b"], ["vel", "idl"])
    assert view.certain(["a", "b"])
    now[0] += ANSWER_HOLDS
    assert not view.certain(["a", "b"])
    assert view.certain(["b"])
    view.on_answer(["a"], ["vel"])  # the message is on its way still
    assert view.certain(["a"])
    assert view.control_mode("a") is ControlMode.VELOCITY
    now[0] += ANSWER_HOLDS
    view.on_answer(["a"], ["idl"])  # it was of after the answer
    assert view.certain(["a"])
    assert view.control_mode("a") is ControlMode.IDLE


def test_doubt_ends_with_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """After what may change all modes the board is asked: for a while, and once afterwards."""
    view, now = ModesView(), at_time(monkeypatch)
    view.on_message(modes_message(a="idl", b="idl"))
    view.on_answer(["a"], ["vel"])
    view.doubt()
    assert view.control_mode("a") is ControlMode.IDLE
    view.on_answer(["a"], ["cfgn"])
    assert not view.certain(["a"])  # that may pass
    now[0] += ANSWER_HOLDS
    assert not view.certain(["a"])
    view.on_answer(["a"], ["idl"])
    assert view.certain(["a"])
    assert not view.certain(["a", "b"])


def at_time(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that the view of modes reads, s: the one entry of this list."""
    now = [100.0]
    clock = SimpleNamespace(monotonic=lambda: now[0])
    monkeypatch.setattr("control_board_ros.client.modes_view.time", clock)
    return now


class NoLink:
    """A connection over which nothing comes, and time does not pass."""

    answer_timeout = 1.0

    def __init__(self) -> None:
        self.thread = self
        self.asked: list[bool] = []

    def subscribe(self, *_: object) -> None:
        """What is heard, the test tells."""

    def settle(self) -> Steps[None]:
        yield from ()

    def until(self, condition: Any, _: float) -> Steps[bool]:
        """Note whether the condition held at once."""
        self.asked.append(condition())
        yield from ()
        return self.asked[-1]


def test_states_that_waited_in_line_are_no_fresh_ones() -> None:
    """On a busy machine, states of before a request are taken after its answer."""
    link = NoLink()
    states = StateView(cast(Link, link))
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
    """A board that comes back with other joints is taken as it is."""
    view = ModesView()
    view.on_message(modes_message(a="idl"))
    view.on_message(modes_message(x="idl", y="pos"))
    assert view.names == ("x", "y")
    assert view.interaction_mode("y") is InteractionMode.STIFF


def test_answers_are_the_boards() -> None:
    """M5, M7: one for each joint with its reason; none where the request was wrong as a whole."""
    both = Selection(np.array([0, 1]), ("a", "b"))
    response = SimpleNamespace(
        answers=["accepted", "unsupported"], reasons=["", "no such mode"], message="no such mode"
    )
    reply = reply_of(response, both)
    assert reply.joints == ("a", "b")
    assert reply.answers == (Answer.ACCEPTED, Answer.UNSUPPORTED)
    assert reply.reasons == ("", "no such mode")
    fine = SimpleNamespace(answers=["accepted"] * 2, reasons=["", ""], message="")
    assert reply_of(fine, both) == accepted(("a", "b"))
    wrong = SimpleNamespace(answers=[], reasons=[], message="named twice")
    assert reply_of(wrong, both) == refused("named twice")


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
    assert as_given({"positions": [1, 2], "speeds": None}) == {"positions": [1.0, 2.0]}
    assert as_given({"positions": "x"}) == {"positions": []}
    assert as_given({"positions": 3}) == {"positions": [3.0]}


def facts(mode: ControlMode, *control_modes: ControlMode) -> Facts:
    """What a client knows of a joint ``a``."""
    joint = cast(JointConfig, KnownJoint("a", control_modes))
    fault = FaultRecord("a", active=mode is ControlMode.HW_FAULT, text="encoder silent")
    return Facts(joint, mode, InteractionMode.STIFF, True, fault, None, 0.0)


@pytest.mark.parametrize(
    ("mode", "answer", "reason"),
    [
        (ControlMode.TORQUE, Answer.ACCEPTED, ""),
        (ControlMode.IDLE, Answer.IGNORED, "mode is IDLE; switch with: cbctl mode a torq"),
        (ControlMode.CALIBRATING, Answer.IGNORED, "mode is CALIBRATING; wait"),
        (ControlMode.HW_FAULT, Answer.IGNORED, "(encoder silent); clear it with: cbctl clear a"),
        (ControlMode.NOT_CONFIGURED, Answer.REFUSED, "configure the board first"),
    ],
)
def test_predictions_are_core_s_decisions(mode: ControlMode, answer: Answer, reason: str) -> None:
    """M3, M4, N4: of a command, with the words that the board's log has."""
    predicted = predict(CommandKind.TORQUE, facts(mode, ControlMode.TORQUE), (1.0,))
    assert predicted[0] is answer
    assert reason in predicted[1]
    assert bool(predicted[1]) == bool(reason)


def test_predictions_without_a_mode_to_offer() -> None:
    """M4: nobody is sent into a mode that the joint does not implement (M5)."""
    _, reason = predict(CommandKind.TORQUE, facts(ControlMode.IDLE, ControlMode.POSITION), (1.0,))
    assert reason.endswith("mode is IDLE, and the joint has no mode for it")


def test_predictions_of_feedforward() -> None:
    """P11, K6: it acts in all modes but one."""
    assert predict(None, facts(ControlMode.IDLE), (1.0,)) == (Answer.ACCEPTED, "")
    answer, reason = predict(None, facts(ControlMode.CALIBRATING), (1.0,))
    assert answer is Answer.IGNORED
    assert "mode is CALIBRATING" in reason
    assert predict(None, facts(ControlMode.IDLE), (math.nan,))[0] is Answer.IGNORED


def test_predictions_know_the_limit() -> None:
    """P2: what goes along with references lies above 0 and within the limit."""
    moving = facts(ControlMode.POSITION)
    for speed, answer in ((0.0, "ignored"), (0.5, "accepted"), (1.0, "accepted")):
        predicted = predict(CommandKind.POSITION, moving, (0.1, speed), "speeds", 1.0)
        assert predicted[0] == answer
    answer, reason = predict(CommandKind.POSITION, moving, (0.1, 2.0), "speeds", 1.0)
    assert answer is Answer.IGNORED
    assert reason.endswith("speeds must be above 0 and up to 1, not 2")


def test_a_condition_that_fails_ends_its_wait_only() -> None:
    """Who waits gets the error; the thread that looks goes on."""
    wait = Wait(None, lambda: 1 / 0 > 0)
    wait.look(time.monotonic())
    assert wait.finished
    with pytest.raises(ZeroDivisionError):
        wait.check()


def test_calibrations() -> None:
    """K3, K4: what feedback and results tell; feedback that is late tells nothing."""
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
    assert view.status("b").done  # it waited in line when the result was taken
    assert view.status("b").message == ""


def test_one_kind_of_error() -> None:
    """Users catch BoardError."""
    assert issubclass(BoardNotFound, BoardError)
    assert issubclass(BoardTimeout, BoardError)
