# SPDX-License-Identifier: Apache-2.0
"""A recorder: first messages, queued messages at its end, reconnection and gaps."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.duration import Duration
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from talk import state_of
from waiting import until

from control_board_ros.cli.board.experiments import await_states
from control_board_ros.cli.line.words import Refused
from control_board_ros.interface import MODES, STATE
from control_board_ros.recording import recorder as module
from control_board_ros.recording.bag import Bag
from control_board_ros.recording.page import page
from control_board_ros.recording.parameters import Parameters
from control_board_ros.recording.reading import read
from control_board_ros.recording.recorder import LATEST, PATIENCE, SOONEST, Gaps, Recorder
from control_board_ros.recording.tables import write_csv
from control_board_ros.recording.topics import GAPS, Topic
from control_board_ros.testing import free_domain, ros_node

BOARD = "/late"


class Kept:
    """A sink that needs a time, s, for each message, and keeps topic and data."""

    def __init__(self, time: float = 0.0) -> None:
        self._time = time
        self.written: list[tuple[str, bytes]] = []

    def begin(self, latched: Mapping[Topic, bytes]) -> None: ...

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        time.sleep(self._time)
        self.written.append((topic.name, data))

    def sync(self) -> None: ...

    def close(self) -> None: ...


@pytest.mark.ros
def test_it_waits_for_the_first_of_a_topic() -> None:
    """True once one is received, false on timeout; other topics do not count."""
    with free_domain() as domain, ros_node(domain, "late") as node:
        recorder = Recorder(node.context, [Parameters(BOARD, {})], Kept())
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


@pytest.mark.slow
@pytest.mark.ros
def test_queued_messages_are_recorded_before_the_end() -> None:
    """At any lag, and with any other messages."""
    with free_domain() as domain, ros_node(domain, "late") as node:
        sink = Kept(0.02)
        recorder = Recorder(node.context, [Parameters(BOARD, {})], sink)
        name = STATE.of(BOARD)
        states = node.create_publisher(STATE.load(), name, 1000)
        until(lambda: states.get_subscription_count() > 0)
        sent = 0

        def send() -> None:
            nonlocal sent
            states.publish(STATE.load()(names=["a"]))
            sent += 1

        while not sink.written:  # latched topics are waited for first
            send()
            time.sleep(0.1)
        for _ in range(150):  # 3 s of writing
            send()
        assert states.wait_for_all_acked(Duration(seconds=60))
        modes = node.create_publisher(MODES.load(), MODES.of(BOARD), MODES.qos.profile())
        timer = node.create_timer(0.05, lambda: modes.publish(MODES.load()()))
        recorder.close()
        timer.cancel()
        assert [topic for topic, _ in sink.written].count(name) == sent


@pytest.mark.parametrize(
    ("ended", "reason"),
    [("", "nothing of /late/state came for 10 s"), ("the disk is full", "the disk is full")],
)
def test_nothing_moves_before_a_state_is_received(ended: str, reason: str) -> None:
    """A step that begins before the recording would be missing in it."""
    session: Any = SimpleNamespace(client=SimpleNamespace(board_name=BOARD))
    recorder = SimpleNamespace(ended=ended, await_first=lambda _name, _patience: False)
    with pytest.raises(Refused, match=f"{reason}: nothing was moved; try again"):
        await_states(session, recorder)


def times(data: bytes) -> dict[str, float]:
    found: dict[str, float] = json.loads(deserialize_message(data, String).data)
    return found


def test_a_silent_board_is_looked_for_less_and_less_often() -> None:
    found = Gaps({BOARD: 100.0}, 0.0, 10**9)
    looked = [now for now in np.arange(0.0, 200.0, 1.0) if found.look(float(now))]
    pauses = np.diff([PATIENCE, *looked[1:]])
    assert looked[0] == PATIENCE
    assert list(pauses) == [SOONEST] + [LATEST] * (len(pauses) - 1)
    assert found.silent == [BOARD]


def test_a_gap_has_begin_and_end_and_is_reported_once() -> None:
    found = Gaps({BOARD: 100.0, "/other": 100.0}, 0.0, 0)
    assert found.received(BOARD, 1.0, 1_000_000_000) == b""
    assert not found.look(4.9)
    found.received("/other", 4.0, 4_000_000_000)
    assert found.look(6.0)
    assert found.silent == [BOARD]
    assert times(found.running(7_000_000_000)[BOARD]) == {"begin": 1.0, "end": 7.0}
    assert times(found.received(BOARD, 8.0, 8_000_000_000)) == {"begin": 1.0, "end": 8.0}
    assert found.received(BOARD, 8.1, 8_100_000_000) == b""
    assert found.silent == []
    assert found.look(8.1 + PATIENCE)
    assert not found.look(8.1 + PATIENCE + 1.0)


def test_a_board_that_seldom_speaks_is_not_silent() -> None:
    found = Gaps({BOARD: 0.1}, 0.0, 0)
    assert not found.look(29.0)
    assert found.look(30.0)


@pytest.mark.slow
@pytest.mark.ros
def test_a_recorder_receives_the_board_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """New subscriptions replace dead ones; the recording has the gap."""
    monkeypatch.setattr(module, "PATIENCE", 0.5)
    with free_domain() as domain, ros_node(domain, "late") as node:
        bag = Bag(tmp_path / "bag")
        recorder = Recorder(node.context, [Parameters(BOARD, {})], bag)
        states = node.create_publisher(STATE.load(), STATE.of(BOARD), 10)
        modes = node.create_publisher(MODES.load(), MODES.of(BOARD), MODES.qos.profile())
        modes.publish(MODES.load()(names=["a"], control_modes=["pos"], interaction_modes=["stif"]))

        def send() -> None:
            message = state_of(["a"])
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(time.time_ns(), 10**9)
            states.publish(message)

        def received() -> int:
            return sum(n for topic, n in recorder.counts.items() if topic.name == STATE.of(BOARD))

        until(lambda: send() or received() > 0)
        for subscription in recorder._subscriptions:  # no longer served
            recorder._node.destroy_subscription(subscription)
        before = received()

        def looked() -> bool:
            send()
            recorder.look()
            assert not recorder.board_is_gone()
            return received() > before

        until(looked)
        recorder.close()
        assert recorder.ended == ""
    (found,) = read(tmp_path / "bag")
    (gap,) = found.gaps
    assert 0.5 < gap.until - gap.time < 60.0
    assert "Gaps: no messages from the board" in page("bag", [found])
    write_csv(tmp_path / "bag")
    assert ",gap,no messages for" in (tmp_path / "bag" / "events.csv").read_text("utf-8")


@pytest.mark.ros
def test_a_gap_that_lasts_to_the_end_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.2)
    with free_domain() as domain, ros_node(domain, "late") as node:
        sink = Kept()
        recorder = Recorder(node.context, [Parameters(BOARD, {})], sink)
        until(lambda: recorder.look() or bool(recorder.silent))
        recorder.close()
    ((name, data),) = sink.written
    assert name == GAPS.of(BOARD)
    assert times(data)["end"] - times(data)["begin"] > 0.2
