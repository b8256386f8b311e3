# SPDX-License-Identifier: Apache-2.0
"""First messages, and the queued messages at the end of a recorder."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.duration import Duration
from talk import until

from control_board_ros.cli.board.experiments import await_states
from control_board_ros.cli.line.words import Refused
from control_board_ros.interface import MODES, STATE
from control_board_ros.recording.parameters import Parameters
from control_board_ros.recording.recorder import Recorder
from control_board_ros.recording.topics import Topic
from control_board_ros.testing import free_domain, ros_node

BOARD = "/late"

pytestmark = pytest.mark.ros


class Slow:
    """A sink that takes its time, s, for each message, and keeps the names of their topics."""

    def __init__(self, time: float = 0.0) -> None:
        self._time = time
        self.topics: list[str] = []

    def begin(self, latched: Mapping[Topic, bytes]) -> None: ...

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        time.sleep(self._time)
        self.topics.append(topic.name)

    def close(self) -> None: ...


def test_it_waits_for_the_first_of_a_topic() -> None:
    """True once one is received, false on timeout; other topics do not count."""
    with free_domain() as domain, ros_node(domain, "late") as node:
        recorder = Recorder(node.context, [Parameters(BOARD, {})], Slow())
        found: list[bool] = []
        name = STATE.of(BOARD)
        waiting = threading.Thread(target=lambda: found.append(recorder.await_first(name, 60.0)))
        waiting.start()
        modes = node.create_publisher(MODES.load(), MODES.of(BOARD), MODES.qos.profile())
        modes.publish(MODES.load()())
        until(lambda: any(topic.name == MODES.of(BOARD) for topic in recorder.counts))
        assert not recorder.await_first(name, 0.1)
        assert waiting.is_alive()
        states = node.create_publisher(STATE.load(), name, STATE.qos.profile())
        until(lambda: states.get_subscription_count() > 0)
        states.publish(STATE.load()(names=["a"]))
        waiting.join(60.0)
        assert found == [True]
        recorder.close()


def test_what_had_come_is_taken_before_it_ends() -> None:
    """At any lag, and with any other messages."""
    with free_domain() as domain, ros_node(domain, "late") as node:
        sink = Slow(0.02)
        recorder = Recorder(node.context, [Parameters(BOARD, {})], sink)
        name = STATE.of(BOARD)
        states = node.create_publisher(STATE.load(), name, 1000)
        until(lambda: states.get_subscription_count() > 0)
        sent = 0

        def send() -> None:
            nonlocal sent
            states.publish(STATE.load()(names=["a"]))
            sent += 1

        while not sink.topics:  # latched topics are waited for first
            send()
            time.sleep(0.1)
        for _ in range(150):  # 3 s of writing
            send()
        assert states.wait_for_all_acked(Duration(seconds=60))
        modes = node.create_publisher(MODES.load(), MODES.of(BOARD), MODES.qos.profile())
        timer = node.create_timer(0.05, lambda: modes.publish(MODES.load()()))
        recorder.close()
        timer.cancel()
        assert sink.topics.count(name) == sent


@pytest.mark.parametrize(
    ("ended", "reason"),
    [("", "nothing of /late/state came for 10 s"), ("the disk is full", "the disk is full")],
)
def test_nothing_moves_before_a_state_was_heard(ended: str, reason: str) -> None:
    """A step that begins before the recording would be missing in it."""
    session: Any = SimpleNamespace(client=SimpleNamespace(board_name=BOARD))
    recorder = SimpleNamespace(ended=ended, await_first=lambda _name, _patience: False)
    with pytest.raises(Refused, match=f"{reason}: nothing was moved; try again"):
        await_states(session, recorder)
