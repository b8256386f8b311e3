# SPDX-License-Identifier: Apache-2.0
"""Subscriptions polled on demand.

A board publishes its state at 100 Hz and more, a screen shows 60: the middleware keeps the newest
message, and the panel reads it per frame. The state is forwarded to the browser serialized (CDR),
at no cost.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from control_board_ros.interface import HISTORY, LATCHED, Endpoint

#: The panels' operators; used between panels only, not part of a board's interface.
OPERATOR = "/control_board_panel/operator"


class Newest:
    """The newest message of a topic, serialized.

    Args:
        node: of the subscription.
        topic: of the board.
        board: full name of its node.

    Attributes: raw (the last message), last (its reception or, before it, the start of the
    subscription, s of ``time.monotonic``).
    """

    def __init__(self, node: Node, topic: Endpoint, board: str) -> None:
        qos = replace(topic.qos, depth=1, reliable=topic.qos.latched).profile()
        self._node, self._kind = node, topic.load()
        self._make = partial(
            node.create_subscription, self._kind, topic.of(board), ignore, qos, raw=True
        )
        self._subscription = self._make()
        self.last = time.monotonic()
        self.raw: bytes | None = None

    def take(self) -> bytes | None:
        """The newest message since the last call; None without one."""
        handle, raw = self._subscription.handle, None
        with handle:
            while (taken := handle.take_message(self._kind, True)) is not None:
                raw = taken[0]
        if raw is not None:
            self.raw, self.last = raw, time.monotonic()
        return raw

    def renew(self) -> None:
        self.close()
        self._subscription = self._make()
        self.last = time.monotonic()

    def read(self) -> Any:
        """The last message; None before the first."""
        return None if self.raw is None else deserialize_message(self.raw, self._kind)

    def take_read(self) -> Any:
        """The newest message since the last call, read; None without one."""
        return None if self.take() is None else self.read()

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)


def ignore(_: Any) -> None:
    """Callback of subscriptions without an executor."""


class OperatorTopic:
    """The topic of the panels' operators: latched, for new panels."""

    def __init__(self, node: Node) -> None:
        subscribed = node.create_subscription(String, OPERATOR, ignore, HISTORY.profile())
        self._handle = subscribed.handle
        self._publisher = node.create_publisher(String, OPERATOR, LATCHED.profile())

    def send(self, text: str) -> None:
        self._publisher.publish(String(data=text))

    def take(self) -> list[str]:
        texts = []
        with self._handle:
            while (taken := self._handle.take_message(String, False)) is not None:
                texts.append(taken[0].data)
        return texts
