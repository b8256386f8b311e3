# SPDX-License-Identifier: Apache-2.0
"""A recorder that tells what it hears already."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest
from talk import until

from control_board_ros.cli.experiments import await_states
from control_board_ros.cli.words import Refused
from control_board_ros.interface import MODES, STATE
from control_board_ros.recording.parameters import Parameters
from control_board_ros.recording.recorder import Recorder
from control_board_ros.recording.topics import Topic
from control_board_ros.testing import free_domain, ros_node

BOARD = "/late"

pytestmark = pytest.mark.ros


class Nowhere:
    """A sink that keeps nothing."""

    def begin(self, latched: Mapping[Topic, bytes]) -> None: ...

    def write(self, topic: Topic, stamp: int, data: bytes) -> None: ...

    def close(self) -> None: ...


def test_it_waits_for_the_first_of_a_topic() -> None:
    """True as soon as one was heard, false where none comes; others do not count."""
    with free_domain() as domain, ros_node(domain, "late") as node:
        recorder = Recorder(node.context, [Parameters(BOARD, {})], Nowhere())
        heard: list[bool] = []
        name = STATE.of(BOARD)
        waiting = threading.Thread(target=lambda: heard.append(recorder.await_first(name, 60.0)))
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
        assert heard == [True]
        recorder.close()


@pytest.mark.parametrize(
    ("ended", "reason"),
    [("", "nothing of /late/state was heard for 10 s"), ("the disk is full", "the disk is full")],
)
def test_nothing_moves_before_a_state_was_heard(ended: str, reason: str) -> None:
    """A step that begins before the recording would be missing in it."""
    session: Any = SimpleNamespace(client=SimpleNamespace(board_name=BOARD))
    recorder = SimpleNamespace(ended=ended, await_first=lambda _name, _patience: False)
    with pytest.raises(Refused, match=f"{reason}: nothing was moved; try again"):
        await_states(session, recorder)
