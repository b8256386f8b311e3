# SPDX-License-Identifier: Apache-2.0
"""Messages as they stand: for what the client would not send, and to see every state."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from control_board_ros.client import BoardTimeout, State
from control_board_ros.interface import MODES, STATE, Endpoint

#: States and mode messages kept: at 1 kHz the last ten seconds.
KEPT = 10_000
#: Messages of a topic that may wait here: none is to be missed.
DEPTH = 100
#: s from seeing a subscription until it surely sees us.
MATCHING = 0.05


class Channel:
    """Requests and messages to a board, and what it publishes.

    Args:
        node: that nobody spins; this one does, in a thread of its own.
        board: full name of the board's node.
        patience: s to wait for a service and for an answer.

    Attributes: states (State, oldest first), modes (JointModes messages, oldest first),
    modes_heard (how many of these came so far).
    """

    def __init__(self, node: Node, board: str, patience: float) -> None:
        self.node, self.board, self.patience = node, board, patience
        self.states: deque[State] = deque(maxlen=KEPT)
        self.modes: deque[Any] = deque(maxlen=KEPT)
        self.modes_heard = 0
        self._came = threading.Condition(threading.RLock())
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._ended = threading.Event()
        self._subscriptions = [
            self._subscribe(STATE, self._on_state),
            self._subscribe(MODES, self._on_modes),
        ]
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._spin, name="conformance", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, and leave the node as it was."""
        self._ended.set()
        self._executor.wake()
        self._thread.join(timeout=5.0)
        self._executor.shutdown(timeout_sec=1.0)
        for subscription in self._subscriptions:
            self.node.destroy_subscription(subscription)
        for client in self._clients.values():
            self.node.destroy_client(client)
        for publisher in self._publishers.values():
            self.node.destroy_publisher(publisher)

    def call(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a service to a request with these fields.

        Raises:
            BoardTimeout: no such service, or no answer.
        """
        client = self._clients.get(service.name)
        if client is None:
            client = self._clients[service.name] = self.node.create_client(
                service.load(), service.of(self.board), qos_profile=service.qos.profile()
            )
        if not client.wait_for_service(self.patience):
            raise BoardTimeout(f"{self.board} does not offer {service.short}")
        answered = threading.Event()
        future = client.call_async(service.load().Request(**fields))
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(self.patience):
            client.remove_pending_request(future)
            raise BoardTimeout(f"no answer from {service.short} after {self.patience:g} s")
        return future.result()

    def send(self, topic: Endpoint, **fields: Any) -> None:
        """Publish a message with these fields, once the board listens.

        Raises:
            BoardTimeout: it does not.
        """
        publisher = self._publishers.get(topic.name)
        if publisher is None:
            publisher = self._publishers[topic.name] = self.node.create_publisher(
                topic.load(), topic.of(self.board), topic.qos.profile()
            )
            deadline = time.monotonic() + self.patience
            while not publisher.get_subscription_count():
                if time.monotonic() > deadline:
                    raise BoardTimeout(f"{self.board} does not listen to {topic.short}")
                time.sleep(0.002)
            time.sleep(MATCHING)
        publisher.publish(topic.load()(**fields))

    def modes_since(self, count: int) -> list[Any]:
        """The JointModes messages that came after so many."""
        with self._came:
            new = self.modes_heard - count
            return list(self.modes)[-new:] if new else []

    def wait_for(self, found: Callable[[], bool], patience: float) -> bool:
        """Wait until something is found among states and modes; false when it took too long."""
        with self._came:
            return self._came.wait_for(found, patience)

    def _subscribe(self, topic: Endpoint, callback: Callable[[Any], None]) -> Any:
        name, qos = topic.of(self.board), replace(topic.qos, depth=DEPTH).profile()
        return self.node.create_subscription(topic.load(), name, callback, qos)

    def _on_state(self, message: Any) -> None:
        with self._came:
            self.states.append(State.of(message))
            self._came.notify_all()

    def _on_modes(self, message: Any) -> None:
        with self._came:
            self.modes.append(message)
            self.modes_heard += 1
            self._came.notify_all()

    def _spin(self) -> None:
        try:
            while not self._ended.is_set():
                self._executor.spin_once(timeout_sec=0.2)
        except ExternalShutdownException:
            return
