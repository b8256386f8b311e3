# SPDX-License-Identifier: Apache-2.0
"""The client's connection to a board: services, topics, and a thread that serves them.

The client keeps a hidden node of its own, in the context of the user's node, and serves it from
a thread of its own. So a call works whether the user's node spins in another thread, in this
one (from within a callback), or not at all.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.action.client import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from .errors import BoardError, BoardNotFound, BoardTimeout
from .waiting import Steps, Wait

RELIABLE = QoSProfile(depth=10)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: rclpy's default depth of 10 loses answers when many clients call at once.
SERVICES = QoSProfile(depth=1000)
POLL = 0.002  # s between looks at what rclpy has no event for: matching
#: s from seeing a subscription until it surely sees us; what is sent before may come late.
MATCHING = 0.05
MODES_TYPE = "control_board_msgs/msg/JointModes"

_numbers = itertools.count(1)


def _nothing() -> None:
    """Work that only wakes."""


class Link:
    """What the client sends and hears.

    Args:
        node: the user's node: it gives context, namespace, remappings and log.
        board: name of the board's node, relative to the node's namespace or absolute.
        find_timeout: s to wait for a board to appear.
        answer_timeout: s to wait for an answer.
    """

    def __init__(self, node: Node, board: str, find_timeout: float, answer_timeout: float) -> None:
        self.user = node
        self.board = board.rstrip("/")
        self.name = node.resolve_topic_name(self.board)
        self.find_timeout, self.answer_timeout = find_timeout, answer_timeout
        self._node = Node(
            f"_{node.get_name()}_board_client_{next(_numbers)}",
            namespace=node.get_namespace(),
            context=node.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._node.destroy_publisher(self._node._parameter_event_publisher)
        self._group = ReentrantCallbackGroup()
        self._entities: dict[str, Any] = {}
        self._matched: set[Any] = set()
        self._unsettled = False
        self._waits: list[Wait] = []
        self._lock = threading.Lock()
        self._closed = ""
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._serve, name="board client", daemon=True)
        self._thread.start()

    # The thread

    def _serve(self) -> None:
        try:
            while not self._closed:
                self._serve_once()
        except (ExternalShutdownException, ShutdownException):
            self._closed = self._closed or "the rclpy context was shut down; make a new client"
        finally:
            self._closed = self._closed or "the client's thread ended; make a new client"
            with self._lock:
                waits, self._waits = self._waits, []
            for wait in waits:
                wait.finish(done=False, closed=self._closed)

    def _serve_once(self) -> None:
        try:
            self._executor.spin_once(timeout_sec=self._patience())
            self._finish_due()
        except (ExternalShutdownException, ShutdownException):
            raise
        except Exception as error:  # noqa: BLE001  (one bad message must not end the thread)
            self.user.get_logger().error(f"client of {self.name}: {error!r}")

    def _patience(self) -> float | None:
        """How long the thread may sleep: until the next look or deadline, s."""
        with self._lock:
            if any(wait.condition for wait in self._waits):
                return POLL
            deadlines = [wait.deadline for wait in self._waits if wait.deadline is not None]
        return max(min(deadlines) - time.monotonic(), 0.0) + 1e-4 if deadlines else None

    def _finish_due(self) -> None:
        """Finish what has come or has taken too long."""
        now = time.monotonic()
        with self._lock:
            waits = list(self._waits)
        for wait in waits:
            if wait.condition is not None and wait.condition():
                wait.finish()
            elif wait.deadline is not None and now >= wait.deadline:
                wait.finish(done=False)
        with self._lock:
            self._waits = [wait for wait in self._waits if not wait.finished]

    def close(self) -> None:
        """End the thread and the hidden node; calls that wait raise BoardError."""
        self._closed = self._closed or "the client was closed"
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._executor.create_task(_nothing)
            self._thread.join(timeout=5.0)
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()

    def wake_user(self) -> None:
        """Make the executor of the user's node look at its coroutines again."""
        executor = self.user.executor
        if executor is not None:
            executor.wake()

    # Waiting

    def wait(self, timeout: float | None, condition: Callable[[], bool] | None = None) -> Wait:
        """A wait that the thread finishes."""
        wait = Wait(timeout, condition)
        with self._lock:
            closed = self._closed
            if not closed:
                self._waits.append(wait)
        if closed:
            raise BoardError(closed)
        self._executor.create_task(_nothing)  # only work makes spin_once return
        return wait

    def until(self, condition: Callable[[], bool], timeout: float | None) -> Steps[bool]:
        """Wait until the condition holds; false when it took too long."""
        if condition():
            return True
        wait = self.wait(timeout, condition)
        yield wait
        return wait.done

    def outcome(self, future: Any, timeout: float | None) -> Steps[bool]:
        """Wait for an rclpy future; false when it took too long."""
        if not future.done():
            wait = self.wait(timeout)
            future.add_done_callback(lambda _: wait.finish())
            yield wait
        return bool(future.done())

    def later(self, function: Callable[[], Any]) -> Any:
        """Let the thread run a function; its future.

        Requests of actions go out this way: rclpy forgets an answer that the thread takes before
        the asking thread has noted the question. Its service clients have a lock for that.
        """
        return self._executor.create_task(function)

    def run(self, function: Callable[[], Any]) -> Steps[Any]:
        """What a function gives that the thread runs."""
        task = self.later(function)
        yield from self.outcome(task, None)
        return task.result()

    # What goes out

    def _entity(self, name: str, make: Callable[[str], Any]) -> Any:
        with self._lock:
            if self._closed:
                raise BoardError(self._closed)
            entity = self._entities.get(name)
            if entity is None:
                full = name if name.startswith("/") else f"{self.board}/{name}"
                entity = self._entities[name] = make(full)
        return entity

    def call(self, kind: Any, name: str, request: Any) -> Steps[Any]:
        """Call a service; what was published before is in force when it is answered."""
        yield from self.settle()
        response = yield from self._call(kind, name, request)
        return response

    def _call(self, kind: Any, name: str, request: Any) -> Steps[Any]:
        def make(full: str) -> Any:
            full = self.user.resolve_service_name(full)
            return self._node.create_client(
                kind, full, qos_profile=SERVICES, callback_group=self._group
            )

        client = self._entity(name, make)
        if not (yield from self.until(client.service_is_ready, self.find_timeout)):
            raise self.not_offered(name) if self.is_there() else self.not_found()
        future = client.call_async(request)
        if not (yield from self.outcome(future, self.answer_timeout)):
            client.remove_pending_request(future)
            raise self.timed_out(name)
        return future.result()

    def publish(self, kind: Any, name: str, message: Any) -> Steps[None]:
        """Publish on a topic of the board, once it listens: the first message is not lost."""

        def make(full: str) -> Any:
            full = self.user.resolve_topic_name(full)
            return self._node.create_publisher(kind, full, RELIABLE)

        publisher = self._entity(name, make)
        if publisher not in self._matched or not publisher.get_subscription_count():
            heard = yield from self.until(publisher.get_subscription_count, self.find_timeout)
            if not heard:
                raise self.not_found()
            yield self.wait(MATCHING)
            self._matched.add(publisher)
        publisher.publish(message)
        self._unsettled = True

    def settle(self) -> Steps[None]:
        """Let the board take what was published.

        Of what arrives together the board may serve the request first. When one request more
        is answered, the message was served.
        """
        from control_board_msgs.srv import GetControlMode

        if self._unsettled:
            self._unsettled = False
            yield from self._call(GetControlMode, "get_control_mode", GetControlMode.Request())

    def action(self, kind: Any, name: str) -> Steps[Any]:
        """The client of an action that the board serves now."""

        def make(full: str) -> Any:
            full = self.user.resolve_topic_name(full)
            return ActionClient(self._node, kind, full, callback_group=self._group)

        client = self._entity(name, make)
        if not (yield from self.until(client.server_is_ready, self.find_timeout)):
            raise self.not_found()
        yield from self.settle()
        return client

    def subscribe(
        self, kind: Any, name: str, callback: Callable[[Any], None], qos: QoSProfile = RELIABLE
    ) -> None:
        """Hear a topic of the board from now on; the callback runs in the link's thread."""

        def make(full: str) -> Any:
            full = self.user.resolve_topic_name(full)
            return self._node.create_subscription(
                kind, full, callback, qos, callback_group=self._group
            )

        self._entity(name, make)

    # What to say

    def boards(self) -> list[str]:
        """Names of the boards that this host sees, from their ~/modes topics."""
        topics = self._node.get_topic_names_and_types()
        return sorted(
            name.removesuffix("/modes")
            for name, types in topics
            if MODES_TYPE in types
            and name.endswith("/modes")
            and self._node.count_publishers(name)
        )

    def is_there(self) -> bool:
        """Whether the board publishes its modes."""
        return bool(
            self._node.count_publishers(self.user.resolve_topic_name(f"{self.board}/modes"))
        )

    def not_offered(self, name: str) -> BoardError:
        """The error to raise when the board is there and a service of it is not."""
        return BoardError(
            f"{self.name} does not offer {name}; is it another version, or no simulation?"
        )

    def not_found(self, after: float | None = None) -> BoardNotFound:
        """The error to raise when no board of this name showed up (after so many s)."""
        domain = self._node.context.get_domain_id()
        patience = self.find_timeout if after is None else after
        seen = [name for name in self.boards() if name != self.name]
        what = f"no board found on domain {domain} after {patience:g} s"
        if seen:
            text = f"{what} as {self.name}; boards there are: {', '.join(seen)}"
        else:
            text = (
                f"{what}; is control_board running? "
                f"(looked for {self.name}; start it with: control_board, "
                "with the same ROS_DOMAIN_ID)"
            )
        return BoardNotFound(text)

    def timed_out(self, name: str, after: float | None = None) -> BoardTimeout:
        """The error to raise when an answer did not come (after so many s)."""
        patience = self.answer_timeout if after is None else after
        return BoardTimeout(
            f"no answer from {self.name}/{name} after {patience:g} s; "
            "is the board stopped, or the machine overloaded? see its log"
        )
