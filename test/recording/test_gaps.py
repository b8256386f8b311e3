# SPDX-License-Identifier: Apache-2.0
"""A recorder without messages reconnects to the board, and records the gap."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from talk import until

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


class Kept:
    """A sink that keeps what comes."""

    def __init__(self) -> None:
        self.written: list[tuple[str, bytes]] = []

    def begin(self, latched: Mapping[Topic, bytes]) -> None: ...

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        self.written.append((topic.name, data))

    def close(self) -> None: ...


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
            message = STATE.load()(names=["a"], motion_done=[True], rejected_commands=[0])
            for field in ("position", "velocity", "torque", "position_reference"):
                setattr(message, field, [0.0])
            for field in ("velocity_reference", "torque_reference", "output", "current"):
                setattr(message, field, [0.0])
            message.temperature = [20.0]
            now = time.time_ns()
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 10**9)
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
        until(lambda: recorder.look() or bool(recorder._gaps.silent))
        recorder.close()
    ((name, data),) = sink.written
    assert name == GAPS.of(BOARD)
    assert times(data)["end"] - times(data)["begin"] > 0.2
