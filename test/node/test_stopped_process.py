# SPDX-License-Identifier: Apache-2.0
"""B6: what waited while the whole process stood still (SIGSTOP) does not act when it goes on."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from control_board_msgs.msg import PositionCommand
from control_board_msgs.srv import SendReference
from talk import Talker
from waiting import until
from yarp_control_msgs.msg import Position

from control_board_ros.testing import BoardProcess

pytestmark = pytest.mark.ros

JOINT, NUMBER = "lbr_iiwa_joint_7", 6
#: s of a standstill, and rad of the moves.
STOOD, AWAY = 2.0, 0.4


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    rest = {"physics": "ideal", "control_rate": 250.0}
    return {"yarp_interface": True, "yarp_msgs_name": "~/yarp", **rest}


@contextmanager
def stopped(board: BoardProcess) -> Iterator[None]:
    """The process stands still within the block, and for STOOD afterwards."""
    pid = board.process.pid
    os.kill(pid, signal.SIGSTOP)
    threads = [task / "stat" for task in Path(f"/proc/{pid}/task").iterdir()]
    try:
        until(lambda: all(stat.read_text().rpartition(") ")[2][0] == "T" for stat in threads))
        yield
        time.sleep(STOOD)
    finally:
        os.kill(pid, signal.SIGCONT)


def rejected(talker: Talker) -> int:
    return int(talker.state().rejected_commands[NUMBER])


def stays(talker: Talker) -> None:
    """The joint is where it was, with no move to go, once the board has taken what waited."""
    talker.settle()
    for _ in range(5):
        state = talker.state()
        assert abs(state.position_reference[NUMBER]) < 1e-3
        assert state.motion_done[NUMBER]


TOPICS = {
    "command/position": PositionCommand(names=[JOINT], positions=[AWAY]),
    "yarp/position": Position(names=[JOINT], positions=[AWAY]),
}


@pytest.mark.slow
@pytest.mark.parametrize("topic", TOPICS)
def test_a_reference_that_waited_is_void(talker: Talker, board: BoardProcess, topic: str) -> None:
    """It is counted, and acts when it is sent again."""
    message = TOPICS[topic]
    for place in (0.02, 0.0):  # the board hears the publisher
        there = type(message)(names=[JOINT], positions=[place])
        talker.until_state(
            partial(talker.command, topic, there),
            lambda s, place=place: abs(s.position_reference[NUMBER] - place) < 1e-3,
        )
    talker.settle()
    counted = rejected(talker)
    with stopped(board):
        talker.command(topic, message)
    until(lambda: rejected(talker) == counted + 1)
    stays(talker)
    talker.command(topic, message)
    talker.state(lambda s: s.position_reference[NUMBER] > 0.5 * AWAY)


@pytest.mark.slow
def test_an_answered_reference_that_waited_is_void(talker: Talker, board: BoardProcess) -> None:
    """Its answer has the code stale."""
    ask = {"kind": "position", "names": [JOINT], "values": [AWAY]}
    assert talker.call("send_reference", SendReference, **ask | {"values": [0.0]}).success
    with stopped(board):
        asked = talker.ask("send_reference", SendReference, **ask)
    answer = talker.answer(asked)
    assert (answer.success, list(answer.codes)) == (False, ["stale"])
    assert "stood still" in answer.message
    stays(talker)
    assert talker.call("send_reference", SendReference, **ask).success
    talker.state(lambda s: s.position_reference[NUMBER] > 0.1 * AWAY)
