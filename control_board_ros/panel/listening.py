# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that are looked at when their content is wanted.

A board publishes its state a hundred times a second and more; a screen shows sixty. So nobody is
called for every message: the middleware keeps the newest, and the panel takes it when it draws.
The state goes on to the browser as it came (CDR), which costs this process nothing.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from control_board_ros.interface import Endpoint

#: What panels say of their operators; between panels only, so no board's and in no interface.
OPERATOR = "/control_board_panel/operator"


class Newest:
    """The newest message of a topic, as it came over the wire.

    Args:
        node: whose subscription it is.
        topic: of the board.
        board: full name of its node.

    Attributes: raw (the message last taken), heard (when, s of ``time.monotonic``, or since when
    it is listened for).
    """

    def __init__(self, node: Node, topic: Endpoint, board: str) -> None:
        latched = topic.qos.latched
        qos = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE if latched else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self._node, self._kind = node, topic.load()
        self._make = partial(
            node.create_subscription, self._kind, topic.of(board), ignore, qos, raw=True
        )
        self._subscription = self._make()
        self.heard = time.monotonic()
        self.raw: bytes | None = None

    def take(self) -> bytes | None:
        """The newest message since the last call; None where there is none."""
        handle, raw = self._subscription.handle, None
        with handle:
            while (taken := handle.take_message(self._kind, True)) is not None:
                raw = taken[0]
        if raw is not None:
            self.raw, self.heard = raw, time.monotonic()
        return raw

    def renew(self) -> None:
        """Hear it by a new subscription."""
        self.close()
        self._subscription = self._make()
        self.heard = time.monotonic()

    def read(self) -> Any:
        """The message last taken; None where there was none yet."""
        return None if self.raw is None else deserialize_message(self.raw, self._kind)

    def take_read(self) -> Any:
        """The newest message since the last call, read; None where there is none."""
        return None if self.take() is None else self.read()

    def close(self) -> None:
        """Hear it no more."""
        self._node.destroy_subscription(self._subscription)


def ignore(_: Any) -> None:
    """What a subscription is made with that no executor serves."""


class OperatorTopic:
    """Where the panels of a domain say who operates: latched, so that a new one knows at once."""

    def __init__(self, node: Node) -> None:
        self._handle = node.create_subscription(String, OPERATOR, ignore, latched(50)).handle
        self._publisher = node.create_publisher(String, OPERATOR, latched(1))

    def send(self, text: str) -> None:
        """Say it to all panels."""
        self._publisher.publish(String(data=text))

    def take(self) -> list[str]:
        """What was said since the last call."""
        said = []
        with self._handle:
            while (taken := self._handle.take_message(String, False)) is not None:
                said.append(taken[0].data)
        return said


def latched(depth: int) -> QoSProfile:
    """Reliable; who comes late gets the last message of each."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
