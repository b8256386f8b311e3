# SPDX-License-Identifier: Apache-2.0
"""The client's connection to a board over ROS: its publishers, subscriptions and clients.

The client keeps a hidden node of its own, in the context of the user's node, and serves it from
a thread of its own. So a call works whether the user's node spins in another thread, in this
one (from within a callback), or not at all.
"""

from __future__ import annotations

import contextlib
import itertools
import threading
import time
from array import array
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from rcl_interfaces.msg import Parameter
from rclpy.action.client import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter as TypedParameter
from rclpy.parameter import parameter_value_to_python

from control_board_ros.interface import (
    EMERGENCY_STOP,
    GET_CONTROL_MODE,
    GOAL_HEARTBEAT,
    MODES,
    NOT_KNOWN_YET,
    STOP,
    Endpoint,
    service,
)

from .checking import check_asked, check_response
from .errors import BoardError, BoardNotFound, BoardTimeout, one_line
from .executor_thread import GONE, ExecutorThread, hidden_node

#: s from the match of a subscription until delivery to it is certain.
MATCHING_TIME = 0.05
#: s without an answer before the query is repeated.
REPEAT_TIME = 0.3
#: s between heartbeats of a goal.
BEAT_PERIOD = 0.2
#: What is sent before and without waiting for anything else (E2).
STOPS = (EMERGENCY_STOP, STOP)
#: s between log lines about lost messages.
REPORT_EVERY = 5.0

# Standard services of every node.
LIST_PARAMETERS = service("~/list_parameters", type_="rcl_interfaces/srv/ListParameters")
GET_PARAMETERS = service("~/get_parameters", type_="rcl_interfaces/srv/GetParameters")
SET_PARAMETERS = service(
    "~/set_parameters_atomically", type_="rcl_interfaces/srv/SetParametersAtomically"
)

_numbers = itertools.count(1)


class RosLink:
    """Publishers, subscriptions, service and action clients, created at first use.

    Args:
        node: the user's node: source of context, namespace, remappings and log.
        board: name of the board's node, relative to the node's namespace or absolute.
        find_timeout: s to wait for a board to appear.
        answer_timeout: s to wait for an answer.

    Attributes: name (of the board's node, absolute), domain (ROS_DOMAIN_ID), thread,
    find_timeout, answer_timeout, gone.
    """

    gone: tuple[type[Exception], ...] = GONE

    def __init__(self, node: Node, board: str, find_timeout: float, answer_timeout: float) -> None:
        self.user = node
        self._board = board.rstrip("/")
        try:
            self.name = node.resolve_topic_name(self._board)
        except rclpy_implementation.RCLError as error:
            cause = str(error).removeprefix("failed to resolve name: ").partition(", at ")[0]
            raise BoardError(f"board name {board!r} is not valid; {cause}") from error
        self.domain = node.context.get_domain_id()
        self.find_timeout, self.answer_timeout = find_timeout, answer_timeout
        name = f"_{node.get_name()}_board_client_{next(_numbers)}"
        self._node = hidden_node(name, node.context, node.get_namespace())
        self._node.destroy_publisher(self._node._parameter_event_publisher)
        self._group = ReentrantCallbackGroup()
        self._entities: dict[Endpoint, Any] = {}
        self._callbacks: dict[Endpoint, Callable[..., None]] = {}  # of subscriptions
        self._matched: dict[Any, int] = {}
        self._acquainted: dict[Endpoint, frozenset[bytes]] = {}
        self._published = self._settled = 0  # messages: sent, processed by the board for certain
        self._turns = defaultdict[Endpoint, deque[object]](deque)  # calls that are not sent yet
        self._lock = threading.Lock()
        self._modes_topic = self.full_name(MODES)
        self.thread = ExecutorThread(self._node, self._report)
        for stop in STOPS:  # discovered by the time that one is needed
            self._client(stop)

    def close(self) -> None:
        """End the thread and the hidden node; calls that wait raise BoardError."""
        self.thread.close()
        with self._lock:
            self._node.destroy_node()

    def wake_user(self) -> None:
        """Wake the executor of the user's node."""
        executor = self.user.executor
        if executor is not None:
            with contextlib.suppress(*GONE):  # shut down: nothing to wake
                executor.wake()

    def log_warning(self, text: str) -> None:
        """Log to the user's node."""
        self.user.get_logger().warning(text)

    def log_error(self, text: str) -> None:
        """Log to the user's node; at most one line per REPORT_EVERY."""
        self.user.get_logger().error(
            f"client of {self.name}: {text}", throttle_duration_sec=REPORT_EVERY
        )

    def _report(self, error: Exception) -> None:
        self.log_error(
            f"a message was lost: {type(error).__name__}: {one_line(error)}; "
            "are client and board of the same version?"
        )

    def full_name(self, endpoint: Endpoint) -> str:
        """The absolute name of an endpoint, with the remappings of the user's node."""
        return self.user.resolve_topic_name(endpoint.of(self._board))

    def _entity(self, endpoint: Endpoint, make: Callable[[Any, str], Any]) -> Any:
        """The entity of an endpoint, created at first use from type and full name."""
        with self._lock:
            if self.thread.closed:
                raise BoardError(self.thread.closed)
            entity = self._entities.get(endpoint)
            if entity is None:
                entity = make(endpoint.load(), self.full_name(endpoint))
                self._entities[endpoint] = entity
        return entity

    def _fresh(self, endpoint: Endpoint) -> Any:
        """QoS of a request: it lapses with the answer timeout, and a failed one is not executed
        when the network recovers.
        """
        profile = endpoint.qos.profile()
        profile.lifespan = Duration(seconds=self.answer_timeout)
        return profile

    def _client(self, service: Endpoint) -> Any:
        """The client of a service, created at first use."""

        def make(kind: Any, name: str) -> Any:
            return self._node.create_client(
                kind, name, qos_profile=self._fresh(service), callback_group=self._group
            )

        return self._entity(service, make)

    async def stop(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a stop, which goes out before anything else, until it is answered (E2).

        References published before may arrive after it: then it is repeated behind them.
        """
        late = self._settled < self._published
        response = await self._repeat(service, fields)
        if late:
            with contextlib.suppress(BoardTimeout):
                await self.flush()
            response = await self._repeat(service, fields)
        return response

    async def _repeat(self, service: Endpoint, fields: dict[str, Any]) -> Any:
        """The first response of a service that is called again until it answers."""
        client = self._client(service)
        if not await self.thread.until(client.service_is_ready, self.find_timeout):
            raise self.not_offered(service) if self.is_there() else self.not_found()
        sent = await self._ask(client, fields, self.answer_timeout)
        if not answers(sent):
            for future in sent:
                client.remove_pending_request(future)
            raise self.timed_out(service)
        # a repetition that is still on its way would stop what the caller does next
        await self.thread.until(lambda: answers(sent) == sent, REPEAT_TIME)
        response = answers(sent)[0].result()
        check_response(service, response, self.name)
        return response

    async def _ask(self, client: Any, fields: dict[str, Any], patience: float) -> list[Any]:
        """The futures of a request, repeated until one of them, maybe a late one, is answered."""
        end = time.monotonic() + patience
        sent: list[Any] = []
        while not answers(sent) and time.monotonic() < end:
            sent.append(client.call_async(client.srv_type.Request(**fields)))
            await self.thread.until(lambda: bool(answers(sent)), REPEAT_TIME)
        return sent

    async def is_answering(self) -> bool:
        """Whether the board answers a query, which has no effect, within the answer timeout."""
        client = self._client(GET_CONTROL_MODE)
        return bool(answers(await self._ask(client, {}, self.answer_timeout)))

    async def call(self, service: Endpoint, **fields: Any) -> Any:
        """The response of a service; references published before are in force when it answers.

        Calls of a service go out in their order: one that waits for the board is not overtaken.
        """
        turn, turns = object(), self._turns[service]
        end = time.monotonic() + self.find_timeout
        turns.append(turn)
        try:
            if turns[0] is not turn:
                await self.thread.until(lambda: turns[0] is turn, self.find_timeout)
            await self.flush()
            future = await self._send(service, fields, end)
        finally:
            turns.remove(turn)
        return await self._response(service, future)

    async def _send(self, service: Endpoint, fields: dict[str, Any], end: float) -> Any:
        """Send a request once board and client know each other; the future of its response.

        The service is waited for until ``end``, s of ``time.monotonic``.
        """
        client = self._client(service)
        patience = max(0.0, end - time.monotonic())
        if not await self.thread.until(client.service_is_ready, patience):
            raise self.not_offered(service) if self.is_there() else self.not_found()
        with contextlib.suppress(BoardTimeout):  # the request itself may be answered
            await self._get_acquainted(service, min(self.find_timeout, self.answer_timeout))
        return client.call_async(client.srv_type.Request(**fields))

    async def _response(self, service: Endpoint, future: Any) -> Any:
        if not await self.thread.outcome(future, self.answer_timeout):
            self._client(service).remove_pending_request(future)
            raise self.timed_out(service)
        response = future.result()
        check_response(service, response, self.name)
        return response

    def check_asked(self, service: Endpoint, response: Any, count: int) -> None:
        """Reject the response of a getter without one entry for each of ``count`` joints."""
        check_asked(service, response, count, self.name)

    async def until(self, condition: Callable[[], bool], timeout: float | None) -> bool:
        """Wait until the condition holds; false after ``timeout`` s."""
        return await self.thread.until(condition, timeout)

    async def flush(self) -> None:
        """Wait until the board has processed all published messages.

        The board may serve a request before messages that arrived with it. The answer to one more
        request confirms them.
        """
        published = self._published
        if self._settled < published:
            end = time.monotonic() + self.find_timeout
            future = await self._send(GET_CONTROL_MODE, {}, end)
            await self._response(GET_CONTROL_MODE, future)
            self._settled = max(self._settled, published)

    async def publish(self, topic: Endpoint, **fields: Any) -> None:
        """Publish on a topic once the board subscribes to it, so that the first message arrives.

        Other subscribers (a recorder, a panel) do not count; the check is repeated when the number
        of subscriptions changes.
        """

        def make(kind: Any, name: str) -> Any:
            return self._node.create_publisher(kind, name, self._fresh(topic))

        publisher = self._entity(topic, make)
        count = publisher.get_subscription_count()
        if not count or count != self._matched.get(publisher):

            def listens() -> bool:
                there: bool = publisher.get_subscription_count() > 0
                return there and self._subscribes(publisher.topic_name)

            if publisher not in self._matched or not listens():
                if not await self.thread.until(listens, self.find_timeout):
                    raise self.not_found()
                await self.thread.wait(MATCHING_TIME)
            self._matched[publisher] = publisher.get_subscription_count()
        publisher.publish(publisher.msg_type(**fields))
        with self._lock:
            self._published += 1

    async def action(self, action: Endpoint) -> Any:
        """The client of an action that the board serves."""

        def make(kind: Any, name: str) -> Any:
            qos = action.qos.profile()
            return ActionClient(
                self._node,
                kind,
                name,
                callback_group=self._group,
                goal_service_qos_profile=self._fresh(action),
                result_service_qos_profile=qos,
                cancel_service_qos_profile=qos,
            )

        client = self._entity(action, make)
        if not await self.thread.until(client.server_is_ready, self.find_timeout):
            raise self.not_found()
        await self._get_acquainted(action, self.find_timeout)
        await self.flush()
        return client

    async def beat(self, goal_id: Any) -> Callable[[], None]:
        """Send heartbeats of a goal from now on; returns what ends them."""

        def make(kind: Any, name: str) -> Any:
            return self._node.create_publisher(kind, name, GOAL_HEARTBEAT.qos.profile())

        publisher = self._entity(GOAL_HEARTBEAT, make)
        await self.thread.until(lambda: publisher.get_subscription_count() > 0, REPEAT_TIME)
        await self._get_acquainted(GOAL_HEARTBEAT, self.find_timeout)
        steady = Clock(clock_type=ClockType.STEADY_TIME)

        def start() -> Any:
            publisher.publish(goal_id)  # before the goal
            return self._node.create_timer(
                BEAT_PERIOD, lambda: publisher.publish(goal_id), clock=steady
            )

        timer = await self.thread.run(start)

        def end() -> None:
            with contextlib.suppress(BoardError, *GONE):  # otherwise destroyed with the node
                self.thread.later(lambda: self._node.destroy_timer(timer))

        return end

    async def _get_acquainted(self, endpoint: Endpoint, patience: float) -> None:
        """Wait until this run of the board has discovered the client of a service or action.

        Before that its answer is lost, and a request must not be repeated; or a publisher, whose
        first message would be lost. Endpoints are
        discovered in order of creation: an answer to one created later confirms the client. This
        query has no effect on the board and is repeated after a lost answer.
        """
        if self._acquainted.get(endpoint) == self._identity():
            return
        name = self.full_name(GET_CONTROL_MODE)
        kind = GET_CONTROL_MODE.load()
        with self._lock:
            later = self._node.create_client(kind, name, callback_group=self._group)
        try:
            end = time.monotonic() + patience
            ready = await self.thread.until(later.service_is_ready, patience)
            if not ready or not answers(await self._ask(later, {}, end - time.monotonic())):
                raise self.timed_out(endpoint, patience)
            self._acquainted[endpoint] = self._identity()
        finally:
            with contextlib.suppress(BoardError, *GONE):  # otherwise destroyed with the node
                self.thread.later(lambda: self._node.destroy_client(later))

    # Parameters

    async def list_parameters(self) -> list[str]:
        """Names of the board's parameters."""
        response = await self.call(LIST_PARAMETERS)
        return list(response.result.names)

    async def get_parameters(self, names: Sequence[str]) -> list[Any] | None:
        """Values, None where unset; None in all where one is unknown."""
        response = await self.call(GET_PARAMETERS, names=list(names))
        if len(response.values) != len(names):
            return None
        return [parameter_value_to_python(value) for value in response.values]

    async def set_parameters(
        self, values: Mapping[str, Any], present: Mapping[str, Any]
    ) -> tuple[bool, str]:
        """Set all or none; returns success and the reason of a refusal."""
        parameters = [
            Parameter(name=name, value=typed(value, present[name]))
            for name, value in values.items()
        ]
        response = await self.call(SET_PARAMETERS, parameters=parameters)
        reason = response.result.reason
        name = reason.removeprefix("Trying to set a read-only parameter: ")  # rclpy's words
        if name != reason:
            reason = f"{name.rstrip('.')}: is fixed while the board runs; set it at start"
        return response.result.successful, reason

    # Discovery

    def is_there(self) -> bool:
        return bool(self._node.count_publishers(self._modes_topic))

    def _identity(self) -> frozenset[bytes]:
        """Identifies one run of the board: the publishers of its modes."""
        publishers = self._node.get_publishers_info_by_topic(self._modes_topic)
        return frozenset(bytes(publisher.endpoint_gid) for publisher in publishers)

    def _subscribes(self, topic: str) -> bool:
        """Whether the board, the node that publishes its modes, subscribes to a topic."""
        return bool(
            nodes_of(self._node.get_publishers_info_by_topic(self._modes_topic))
            & nodes_of(self._node.get_subscriptions_info_by_topic(topic))
        )

    def not_offered(self, service: Endpoint) -> BoardError:
        """Error for a service that a present board does not offer."""
        return BoardError(
            f"{self.name} does not offer {service.short}; is it another version, or no simulation?"
        )

    def not_found(self, after: float | None = None) -> BoardNotFound:
        patience = self.find_timeout if after is None else after
        seen = [name for name in boards_on(self._node) if name != self.name]
        what = f"no board found on domain {self.domain} after {patience:g} s"
        if seen:
            return BoardNotFound(f"{what} as {self.name}; boards there are: {', '.join(seen)}")
        return BoardNotFound(
            f"{what}; is control_board running? (looked for {self.name}; start it with: "
            "control_board, with the same ROS_DOMAIN_ID)"
        )

    def timed_out(self, endpoint: Endpoint, after: float | None = None) -> BoardTimeout:
        patience = self.answer_timeout if after is None else after
        return BoardTimeout(
            f"no answer from {endpoint.of(self.name)} after {patience:g} s; "
            "is the board stopped, the machine overloaded, or the network down? see its log"
        )

    # Subscriptions

    def subscribe(self, topic: Endpoint, callback: Callable[..., None]) -> None:
        """Subscribe to a topic; the callback runs in the link's thread.

        Arguments: the message and, if it accepts two, rclpy's message information.
        """

        def make(kind: Any, name: str) -> Any:
            return self._node.create_subscription(
                kind, name, callback, topic.qos.profile(), callback_group=self._group
            )

        self._entity(topic, make)
        self._callbacks.setdefault(topic, callback)

    def renew(self) -> None:
        """Renew every subscription, after the old ones receive nothing any more.

        The old ones are destroyed in the link's thread, which may be reading from them.
        """
        for topic, callback in list(self._callbacks.items()):
            with self._lock:
                old = self._entities.pop(topic, None)
            self.subscribe(topic, callback)
            if old is not None:
                self.thread.later(partial(self._node.destroy_subscription, old))


def boards_on(node: Node) -> list[str]:
    """Absolute names of the boards that a node has discovered, by their ~/modes topics."""
    below = MODES.of("")
    return sorted(
        name.removesuffix(below)
        for name, types in node.get_topic_names_and_types()
        if MODES.type in types and name.endswith(below) and node.count_publishers(name)
    )


def answers(futures: Iterable[Any]) -> list[Any]:
    """The futures that have their result."""
    return [future for future in futures if future.done()]


def nodes_of(endpoints: Iterable[Any]) -> set[tuple[str, str]]:
    """Nodes of these endpoints, (namespace, name), where discovered."""
    return {
        (endpoint.node_namespace, endpoint.node_name)
        for endpoint in endpoints
        if endpoint.node_name != NOT_KNOWN_YET
    }


def typed(value: Any, present: Any) -> Any:
    """A ParameterValue; whole numbers become doubles where the parameter has such."""
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if isinstance(plain, list | tuple) and is_doubles(present):
        plain = [typed_number(item) for item in plain]
    if isinstance(present, float):
        plain = typed_number(plain)
    return TypedParameter("value", value=plain).get_parameter_value()


def typed_number(value: Any) -> Any:
    """A whole number as a double; anything else as it is."""
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def is_doubles(present: Any) -> bool:
    """Whether the value of a parameter is an array of doubles."""
    many = isinstance(present, Sequence | np.ndarray | array) and not isinstance(present, str)
    return many and len(present) > 0 and all(isinstance(item, float) for item in present)
