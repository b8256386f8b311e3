# SPDX-License-Identifier: Apache-2.0
"""Messages are written in another thread: a slow disk delays no reception."""

from __future__ import annotations

import threading
from collections.abc import Mapping

import pytest

from control_board_ros.interface import STATE
from control_board_ros.recording import RecordingError
from control_board_ros.recording.topics import Topic, topic_of
from control_board_ros.recording.writing import Writing

TOPIC = topic_of(STATE, "/b")


class Disk:
    """A disk that writes once it may, and fails at a message."""

    def __init__(self, fails_at: bytes = b"never") -> None:
        self.may, self.fails_at = threading.Event(), fails_at
        self.written: list[bytes] = []
        self.synced = threading.Event()
        self.closed = 0

    def begin(self, latched: Mapping[Topic, bytes]) -> None: ...

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        self.may.wait()
        if data == self.fails_at:
            raise RecordingError("the disk is full")
        self.written.append(data)

    def sync(self) -> None:
        self.synced.set()

    def close(self) -> None:
        self.closed += 1


def test_a_slow_disk_delays_nobody_and_loses_nothing() -> None:
    disk = Disk()
    writing = Writing(disk)
    writing.begin({})
    sent = [b"%d" % k for k in range(1000)]
    for data in sent:
        writing.write(TOPIC, 1, data)  # returns although nothing is written
    assert disk.written == []
    disk.may.set()
    writing.close()
    assert disk.written == sent
    assert (disk.closed, writing.left_out) == (1, 0)


def test_what_waits_is_bounded_and_counted() -> None:
    disk = Disk()
    writing = Writing(disk, max_waiting=1000)
    writing.begin({})
    for _ in range(100):
        writing.write(TOPIC, 1, bytes(100))
    disk.may.set()
    writing.close()
    assert len(disk.written) + writing.left_out == 100
    assert 10 <= len(disk.written) <= 13


def test_the_sink_is_synced_without_messages() -> None:
    """A board that fell silent: its last second is on the disk all the same."""
    disk = Disk()
    writing = Writing(disk)
    writing.begin({})
    assert disk.synced.wait(60.0)
    writing.close()


@pytest.mark.parametrize("message", [b"1", b"last"])
def test_a_full_disk_is_reported_by_the_next_call(message: bytes) -> None:
    """And the sink is finished once."""
    disk = Disk(message)
    disk.may.set()
    writing = Writing(disk)
    writing.begin({})

    def send() -> None:
        for data in (b"0", b"1", b"last"):
            writing.write(TOPIC, 1, data)
        writing.close()

    with pytest.raises(RecordingError, match="the disk is full"):
        send()
    with pytest.raises(RecordingError, match="the disk is full"):
        writing.close()
    assert disk.closed == 1
