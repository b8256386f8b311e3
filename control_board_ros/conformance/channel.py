# SPDX-License-Identifier: Apache-2.0
"""Messages as they stand: for what the client would not send, and to see every state."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from control_board_ros.client import BoardTimeout, State
from control_board_ros.interface import MODES, STATE, Endpoint

from .rules import OutOfTime
from .shapes import Malformed, check_modes, check_state

#: States and mode messages kept: at 1 kHz the last ten seconds.
KEPT = 10_000
#: Messages of a topic that may wait here: none is to be missed.
DEPTH = 100
#: s from seeing a subscription until it surely sees us.
MATCHING = 0.05
#: s after a message that could not be taken, so that one that lasts does not take the processor.
PAUSE = 0.01


class Channel:
    """Requests and messages to a board, and what it publishes.

    Args:
        node: that nobody spins; this one does, in a thread of its own.
        board: full name of the board's node.
        patience: s to wait for a service and for an answer.

    Attributes: states (State, oldest first), modes (JointModes messages, oldest first),
    states_heard and modes_heard (how many of these came so far), malformed (the last message that
    cannot be read).
    """

    def __init__(self, node: Node, board: str, patience: float) -> None:
        self.node, self.board, self.patience = node, board, patience
        self.states: deque[State] = deque(maxlen=KEPT)
        self.modes: deque[Any] = deque(maxlen=KEPT)
        self.states_heard = self.modes_heard = 0
        self.malformed: Malformed | None = None
        self._allowed, self._deadline = 0.0, math.inf
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

    def allow(self, seconds: float) -> None:
        """Let what comes take so much time, and forget what was malformed before."""
        self._allowed, self._deadline = seconds, time.monotonic() + seconds
        self.malformed = None

    def check(self) -> None:
        """See that there is time left, and that all messages could be read.

        Raises:
            OutOfTime: it took longer than allowed.
            Malformed: a message cannot be read.
        """
        if self.malformed is not None:
            raise self.malformed
        if time.monotonic() > self._deadline:
            raise OutOfTime(f"it took longer than {self._allowed:g} s")

    def call(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a service to a request with these fields.

        Raises:
            BoardTimeout: no such service, or no answer.
        """
        self.check()
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
        """Wait until something is found among states and modes; false when it took too long.

        Raises:
            OutOfTime, Malformed: see ``check``.
        """
        self.check()
        left = min(patience, self._deadline - time.monotonic())
        with self._came:
            there = self._came.wait_for(lambda: self.malformed is not None or found(), left)
        if not there or self.malformed is not None:
            self.check()
        return there

    def _subscribe(self, topic: Endpoint, callback: Callable[[Any], None]) -> Any:
        name, qos = topic.of(self.board), replace(topic.qos, depth=DEPTH).profile()
        return self.node.create_subscription(topic.load(), name, callback, qos)

    def _on_state(self, message: Any) -> None:
        with self._reading():
            check_state(message)
            self.states.append(State.of(message))
            self.states_heard += 1

    def _on_modes(self, message: Any) -> None:
        with self._reading():
            check_modes(message)
            self.modes.append(message)
            self.modes_heard += 1

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Take a message; what cannot be read is kept for whoever waits."""
        with self._came:
            try:
                yield
            except Malformed as error:
                self._keep(error)
            self._came.notify_all()

    def _keep(self, error: Malformed) -> None:
        """Keep what could not be read for whoever waits."""
        with self._came:
            self.malformed = error
            self._came.notify_all()

    def _spin(self) -> None:
        while not self._ended.is_set():
            try:
                self._executor.spin_once(timeout_sec=0.2)
            except ExternalShutdownException:
                return
            except Exception as error:  # noqa: BLE001  (the conversion of a message; kept)
                self._keep(Malformed("A", f"a message cannot be read: {error}"))
                time.sleep(PAUSE)
