# SPDX-License-Identifier: Apache-2.0
"""Two subscriptions of one command topic: every message counts once, in whatever order they come.

A node that a test plays: what is published waits for both subscriptions until a test serves it.
"""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy

from control_board_ros.interface import NOT_KNOWN_YET, TORQUE_COMMAND
from control_board_ros.node.wiring import command_subscription
from control_board_ros.node.wiring.command_subscription import HANDOVER, CommandSubscription


class Subscription:
    """What rclpy gives: messages wait until the test lets its callback have one."""

    def __init__(self, topic: str, callback: Any, qos: Any) -> None:
        self.topic_name, self.qos_profile, self._callback = topic, qos, callback
        self._waiting: deque[int] = deque()

    def publish(self, stamp: int) -> None:
        self._waiting.append(stamp)

    def serve(self) -> None:
        while self._waiting:
            stamp = self._waiting.popleft()
            self._callback(stamp, {"source_timestamp": stamp})


class PlayedNode:
    """A node, its subscriptions, and best-effort publishers."""

    def __init__(self) -> None:
        self.there: list[Subscription] = []
        self.best_effort: list[Any] = []
        self.warnings: list[str] = []

    def create_subscription(
        self, _kind: Any, topic: str, callback: Any, qos: Any, **_: Any
    ) -> Subscription:
        self.there.append(Subscription(topic, callback, qos))
        return self.there[-1]

    def destroy_subscription(self, subscription: Subscription) -> None:
        self.there.remove(subscription)

    def get_publishers_info_by_topic(self, _topic: str) -> list[Any]:
        return self.best_effort

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warnings.append)

    def publish(self, stamp: int) -> None:
        """A reliable publisher's message, for all that are there."""
        for one in self.there:
            one.publish(stamp)


class Rig:
    """A command topic with a best-effort publisher, after the handover."""

    def __init__(self, clock: SimpleNamespace) -> None:
        self.node, self.clock, self.received = PlayedNode(), clock, list[int]()
        accept = self.received.append
        self.topic = CommandSubscription(cast(Node, self.node), TORQUE_COMMAND, accept)
        best_effort = SimpleNamespace(reliability=ReliabilityPolicy.BEST_EFFORT)
        publisher = SimpleNamespace(node_namespace="/", node_name="x", qos_profile=best_effort)
        self.node.best_effort = [publisher]
        self.topic._on_incompatible(None)
        self.reliable, self.best_effort = self.node.there

    def pass_time(self) -> None:
        self.clock.now += HANDOVER
        self.topic.check()


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    clock = SimpleNamespace(now=100.0)
    clock.monotonic = lambda: clock.now
    monkeypatch.setattr(command_subscription, "time", clock)
    return Rig(clock)


@pytest.mark.parametrize("first", ["reliable", "best_effort"])
def test_a_message_received_twice_counts_once(rig: Rig, first: str) -> None:
    """While they are matched, and when they are."""
    order = sorted(rig.node.there, key=lambda one: one is not getattr(rig, first))
    for stamp in (1, 2):
        rig.node.publish(stamp)
        for one in order:
            one.serve()
        rig.pass_time()
    assert rig.received == [1, 2]


@pytest.mark.parametrize("first", ["reliable", "best_effort"])
def test_the_end_of_a_best_effort_publisher_loses_no_command(rig: Rig, first: str) -> None:
    """Wherever it waits when its publishers are found to be gone, and when it is removed."""
    order = sorted(rig.node.there, key=lambda one: one is not getattr(rig, first))
    rig.pass_time()
    rig.node.best_effort = []
    for stamp in (1, 2, 3):
        rig.node.publish(stamp)
        order[0].serve()
        rig.pass_time()  # found gone, removed, and some more
        for one in rig.node.there:
            one.serve()
    assert rig.node.there == [rig.reliable]
    assert rig.received == [1, 2, 3]


def test_it_stays_for_a_publisher_that_comes_back(rig: Rig) -> None:
    publishers = rig.node.best_effort
    rig.pass_time()
    for stamp, there in enumerate(([], publishers, publishers), start=1):
        rig.node.best_effort = there
        rig.node.publish(stamp)
        rig.reliable.serve()
        rig.pass_time()
        rig.best_effort.serve()
    assert rig.node.there == [rig.reliable, rig.best_effort]
    assert rig.received == [1, 2, 3]


def test_messages_without_a_time_stamp_all_count(rig: Rig) -> None:
    for _ in range(3):
        rig.best_effort.publish(0)
    rig.best_effort.serve()
    assert rig.received == [0, 0, 0]


def test_best_effort_publishers_are_reported_by_name(rig: Rig) -> None:
    """Once, as soon as the graph knows the name."""
    publisher = rig.node.best_effort[0]
    publisher.node_name = NOT_KNOWN_YET
    rig.pass_time()
    assert rig.node.warnings == []
    publisher.node_name = "teleoperation"
    for _ in range(3):
        rig.pass_time()
    (warning,) = rig.node.warnings
    assert warning.startswith("/teleoperation publishes ")


def test_nameless_best_effort_publishers_are_reported(rig: Rig) -> None:
    """A program that is not of ROS."""
    rig.node.best_effort[0].node_name = NOT_KNOWN_YET
    for _ in range(3):
        rig.pass_time()
    assert len(rig.node.warnings) == 1
