# SPDX-License-Identifier: Apache-2.0
"""Raw messages: for invalid requests, and to receive every state."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from rclpy.node import Node

from control_board_ros.client import BoardTimeout, State
from control_board_ros.client.executor_thread import ExecutorThread
from control_board_ros.client.ros_link import MATCHING_TIME
from control_board_ros.interface import JOINT_STATES, MODES, STATE, Endpoint

from .rules import OutOfTime
from .shapes import Malformed, check_modes, check_state

#: States and mode messages kept: 10 s at 1 kHz.
MAX_MESSAGES = 10_000
#: Queue length of a topic: none may be lost.
DEPTH = 100


class Channel:
    """Requests and messages to a board, and its published messages.

    Args:
        node: not spun elsewhere; spun here in a separate thread.
        board: full name of the board's node.
        patience: s to wait for a service and for an answer.

    Attributes: states (State, oldest first), modes (JointModes messages, oldest first),
    states_received and modes_received (their counts), malformed (the last invalid message).
    """

    def __init__(self, node: Node, board: str, patience: float) -> None:
        self.node, self.board, self.patience = node, board, patience
        self.states: deque[State] = deque(maxlen=MAX_MESSAGES)
        self.modes: deque[Any] = deque(maxlen=MAX_MESSAGES)
        self.states_received = self.modes_received = 0
        self.malformed: Malformed | None = None
        self._allowed, self._deadline = 0.0, math.inf
        self._came = threading.Condition(threading.RLock())
        self._clients: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}
        self._joints: dict[str, float] | None = None
        self._subscriptions = [
            self._subscribe(STATE, self._on_state),
            self._subscribe(MODES, self._on_modes),
        ]
        self._thread = ExecutorThread(
            node, lambda error: self._keep(Malformed("A", f"a message cannot be read: {error}"))
        )

    def close(self) -> None:
        """End the thread, and restore the node."""
        self._thread.close()
        for subscription in self._subscriptions:
            self.node.destroy_subscription(subscription)
        for client in self._clients.values():
            self.node.destroy_client(client)
        for publisher in self._publishers.values():
            self.node.destroy_publisher(publisher)

    @staticmethod
    def clock() -> float:
        """Time of the rules, s."""
        return time.monotonic()

    @staticmethod
    def sleep(seconds: float) -> None:
        time.sleep(seconds)

    def allow(self, seconds: float) -> None:
        """Set the time limit from now on, and clear ``malformed``."""
        self._allowed, self._deadline = seconds, time.monotonic() + seconds
        self.malformed = None

    def check(self) -> None:
        """Check the time limit and that all messages were valid.

        Raises:
            OutOfTime: the limit is exceeded.
            Malformed: a message is invalid.
        """
        if self.malformed is not None:
            raise self.malformed
        if time.monotonic() > self._deadline:
            raise OutOfTime(f"it took longer than {self._allowed:g} s")

    def call(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a service to a request with these fields.

        Raises:
            BoardTimeout: unknown service, or no answer.
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
        """Publish a message with these fields, once the board subscribes.

        Raises:
            BoardTimeout: it does not subscribe.
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
            time.sleep(MATCHING_TIME)
        publisher.publish(topic.load()(**fields))

    def graph(self) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
        """The types of all services, and of all topics, by name."""
        node = self.node
        return dict(node.get_service_names_and_types()), dict(node.get_topic_names_and_types())

    def modes_since(self, count: int) -> list[Any]:
        """The JointModes messages after the first ``count``."""
        with self._came:
            new = self.modes_received - count
            return list(self.modes)[-new:] if new else []

    def joint_positions(self, names: Sequence[str]) -> dict[str, float]:
        """The positions on joint_states, by name, in the next message with one of these names.

        Empty where none is received in time. The first call subscribes.
        """
        if self._joints is None:
            self._subscriptions.append(self._subscribe(JOINT_STATES, self._on_joints))
        received = self._joints = dict[str, float]()
        self.wait_for(lambda: not received.keys().isdisjoint(names), self.patience)
        with self._came:
            return dict(received)

    def wait_for(self, condition: Callable[[], bool], patience: float) -> bool:
        """Wait for a condition on states and modes; false on timeout.

        Raises:
            OutOfTime, Malformed: see ``check``.
        """
        self.check()
        left = min(patience, self._deadline - time.monotonic())
        with self._came:
            there = self._came.wait_for(lambda: self.malformed is not None or condition(), left)
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
            self.states_received += 1

    def _on_modes(self, message: Any) -> None:
        with self._reading():
            check_modes(message)
            self.modes.append(message)
            self.modes_received += 1

    def _on_joints(self, message: Any) -> None:
        with self._reading():
            if self._joints is not None:
                self._joints.update(zip(message.name, message.position, strict=False))

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Process a message; errors are kept for the waiting call."""
        with self._came:
            try:
                yield
            except Malformed as error:
                self._keep(error)
            self._came.notify_all()

    def _keep(self, error: Malformed) -> None:
        """Keep an error for the waiting call."""
        with self._came:
            self.malformed = error
            self._came.notify_all()
