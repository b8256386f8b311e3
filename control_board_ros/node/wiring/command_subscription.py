# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to command topics that receive from reliable and from best-effort publishers.

DDS never connects a best-effort publisher to a reliable subscription. The subscription stays
reliable, as the interface promises; when the middleware reports an incompatible publisher, a
best-effort subscription is added beside it. That one receives from all publishers, so its
messages count from then on; while publishers match, a message that arrives by both is recognized
by its source time stamp. When the last best-effort publisher is gone, both count again until it is
removed: messages that the reliable one ignored may still wait there.
Such publishers are logged once: their lost messages are not repeated.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from ...interface import NOT_KNOWN_YET, Endpoint

#: s in which messages of both subscriptions count after the second one came or went.
HANDOVER = 1.0
#: Source time stamps remembered in this time.
STAMPS_KEPT = 64


class CommandSubscription:
    """One command topic with ``qos_overrides``; the callback gets each message once.

    ``is_void`` gets each message before it, and when it was sent, ns: void ones are dropped (B6).
    """

    def __init__(
        self,
        node: Node,
        topic: Endpoint,
        callback: Callable[[Any], None],
        is_void: Callable[[Any, int], bool] = lambda _message, _sent: False,
    ) -> None:
        self._node, self._topic = node, topic
        self._callback, self._is_void = callback, is_void
        self._best_effort: Any = None
        self._warned = self._waited = False
        self._leaving = False
        self._handover_end = 0.0
        self._stamps: deque[int] = deque(maxlen=STAMPS_KEPT)
        self._reliable = node.create_subscription(
            topic.load(),
            topic.name,
            cast(Any, self._on_reliable),
            topic.qos.profile(),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=self._on_incompatible, use_default_callbacks=False
            ),
        )

    def check(self) -> None:
        """Remove the best-effort subscription when it is not needed; called once a second."""
        if self._best_effort is None:
            return
        names = self._best_effort_publishers()
        if names:
            self._warn(names)
        if self._leaving and not names:
            self._node.destroy_subscription(self._best_effort)
            self._best_effort = None
        if self._leaving or not names:  # removed, still needed, or to be removed at the next check
            self._handover_end = time.monotonic() + HANDOVER
        self._leaving = self._best_effort is not None and not names

    def _best_effort_publishers(self) -> list[str]:
        """Names of the nodes that publish with best effort."""
        return [
            f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(self._reliable.topic_name)
            if info.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
        ]

    def _warn(self, names: list[str]) -> None:
        """Warn once of best-effort publishers.

        An undiscovered name is awaited until the next check: a program without ROS never has one.
        """
        if not self._waited and any(NOT_KNOWN_YET in name for name in names):
            self._waited = True
        elif not self._warned:
            self._warned = True
            self._node.get_logger().warning(
                f"{', '.join(names)} publishes {self._reliable.topic_name} with best effort: it "
                "is received, but lost messages are not repeated; publish it reliable"
            )

    def _on_incompatible(self, _event: Any) -> None:
        if self._best_effort is None and self._reliable.qos_profile.reliability is not (
            ReliabilityPolicy.BEST_EFFORT
        ):
            self._handover_end = time.monotonic() + HANDOVER
            self._best_effort = self._node.create_subscription(
                self._topic.load(),
                self._topic.name,
                cast(Any, self._on_best_effort),
                replace(self._topic.qos, reliable=False).profile(),
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )

    def _on_reliable(self, message: Any, info: dict[str, int]) -> None:
        shared = self._leaving or time.monotonic() < self._handover_end
        if self._best_effort is not None and not shared:
            return
        if not shared or self._is_new(info):
            self._receive(message, info)

    def _on_best_effort(self, message: Any, info: dict[str, int]) -> None:
        if self._is_new(info):
            self._receive(message, info)

    def _receive(self, message: Any, info: dict[str, int]) -> None:
        if not self._is_void(message, info["source_timestamp"]):
            self._callback(message)

    def _is_new(self, info: dict[str, int]) -> bool:
        stamp = info["source_timestamp"]
        if stamp and stamp in self._stamps:  # 0 where the middleware has none
            return False
        self._stamps.append(stamp)
        return True
