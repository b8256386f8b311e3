# SPDX-License-Identifier: Apache-2.0
"""The server: messages are passed on as received (CDR), and only while a client subscribes.

No callback runs per message: a loop reads what has come a hundred times a second.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import foxglove
from foxglove.websocket import Capability, Parameter, ServerListener, Service, ServiceRequest
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.core.selection import RequestError
from control_board_ros.interface import (
    COMMAND_TOPICS,
    JOINT_STATES,
    PUBLISHED,
    ROBOT_DESCRIPTION,
    SERVICES,
    TF,
    TF_STATIC,
    Endpoint,
)
from control_board_ros.recording.topics import ROSOUT

from .frames import ENCODING, Frame, frames_of, message, schema, service_schema

#: s between two looks at what has come.
PERIOD = 0.01
#: Looks between two messages of frames: a screen shows no more.
FRAMES_EVERY = 3
#: Looks between two messages of all frames, for who comes late.
HEAR_EVERY = 100


class CannotServe(OSError):  # noqa: N818
    """The address or the port cannot be had; one line."""


class Forwarded:
    """A topic of the board as a channel; subscribed on ROS while a client has subscribed.

    Args:
        node: of the subscription; no executor serves it.
        topic: of the board.
        board: full name of its node.
        context: of the server.

    Attributes: name, last (the message that came last).
    """

    def __init__(self, node: Node, topic: Endpoint, board: str, context: Any) -> None:
        self._node, self._kind = node, topic.load()
        self.name, self.last = topic.of(board), b""
        self.latched = topic.qos.latched
        self.channel = foxglove.Channel(
            self.name, message_encoding=ENCODING, schema=schema(topic.type), context=context
        )
        policy = ReliabilityPolicy.RELIABLE if self.latched else ReliabilityPolicy.BEST_EFFORT
        durability = (
            DurabilityPolicy.TRANSIENT_LOCAL if self.latched else DurabilityPolicy.VOLATILE
        )
        self._qos = QoSProfile(
            depth=max(10, topic.qos.depth), reliability=policy, durability=durability
        )
        self._subscription: Any = None
        self.again = False

    def hear(self, *, always: bool = False) -> None:
        """Subscribe or unsubscribe, as clients do."""
        wanted = always or self.channel.has_sinks()
        if wanted and self._subscription is None:
            self._subscription = self._node.create_subscription(
                self._kind, self.name, print, self._qos, raw=True
            )
        elif not wanted and self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def take(self) -> bool:
        """Send on what has come; whether anything has."""
        if self._subscription is None:
            return False
        handle, came = self._subscription.handle, False
        again, self.again = self.again, False
        if again and self.latched and self.last:
            self.channel.log(self.last)
        with handle:
            while (taken := handle.take_message(self._kind, True)) is not None:
                came, self.last = True, bytes(taken[0])
                self.channel.log(self.last)
        return came

    def read(self) -> Any:
        """The message that came last."""
        return deserialize_message(self.last, self._kind)


class Live(ServerListener):
    """A server for Foxglove.

    Args:
        node: of the subscriptions; it is not spun.
        asking: asks the board; spun here.
        client: of the board.
        host: address to listen on.
        port: to listen on; 0: a free one.
        read_only: whether clients may only look.
        report: called with lines for the log.

    Attributes: address, app (to open in a browser).

    Raises:
        CannotServe: the address cannot be had.
    """

    def __init__(
        self,
        node: Node,
        asking: Node,
        client: ControlBoardClient,
        *,
        host: str,
        port: int,
        read_only: bool,
        answer_timeout: float,
        report: Callable[[str], None],
    ) -> None:
        self._node, self._asking, self._client = node, asking, client
        self._timeout, self._report = answer_timeout, report
        self.board = board = client.board_name
        self._read_only = read_only
        self._context = context = foxglove.Context()  # channels do not hold it
        topics = (*PUBLISHED, ROSOUT)
        self._topics = {
            topic: Forwarded(node, topic, board, context)
            for topic in topics
            if topic not in (TF, TF_STATIC)
        }
        self._frames_channel = foxglove.Channel(
            TF.name, message_encoding=ENCODING, schema=schema(TF.type), context=context
        )
        self._frames: list[Frame] = []
        self._publishers: dict[str, Any] = {}
        self._clients: dict[Endpoint, Any] = {}
        self._commands = {topic.of(board): topic for topic in COMMAND_TOPICS}
        self._sent: dict[tuple[int, int], str] = {}
        self._executor = SingleThreadedExecutor(context=asking.context)
        self._executor.add_node(asking)
        threading.Thread(target=self._answers, name="foxglove answers", daemon=True).start()
        capabilities = [Capability.Parameters]
        if not read_only:
            capabilities += [Capability.Services, Capability.ClientPublish]
        try:
            self._server = foxglove.start_server(
                name=board,
                host=host,
                port=port,
                capabilities=capabilities,
                server_listener=self,
                supported_encodings=[ENCODING],
                services=[] if read_only else [self._service(one) for one in SERVICES],
                context=context,
            )
        except (RuntimeError, OSError, OverflowError) as error:
            reason = " ".join(str(error).split())[:200]
            raise CannotServe(
                f"cannot listen on {host} port {port}: {reason}; give another --host or --port"
            ) from None
        self.address = f"ws://{host}:{self._server.port}"
        self.app = f"https://app.foxglove.dev/~/view?ds=foxglove-websocket&ds.url={self.address}"

    def run(self, ended: threading.Event) -> None:
        """Send on what comes, until it is ended."""
        try:
            looks = 0
            while not ended.wait(PERIOD):
                self._look(looks)
                looks += 1
        finally:
            self._server.stop()
            self._executor.shutdown(timeout_sec=1.0)

    def _look(self, looks: int) -> None:
        states = self._topics[JOINT_STATES]
        described = self._topics[ROBOT_DESCRIPTION]
        framed = self._frames_channel.has_sinks()
        for topic, forwarded in self._topics.items():
            if looks % 10 == 0:
                forwarded.hear(always=framed and topic in (JOINT_STATES, ROBOT_DESCRIPTION))
            if forwarded.take() and topic is ROBOT_DESCRIPTION:
                self._frames = frames_of(described.read().data)
        if framed and states.last and looks % FRAMES_EVERY == 0:
            if described.last and not self._frames:
                self._frames = frames_of(described.read().data)
            self._show_frames(states.read(), whole=looks % (FRAMES_EVERY * HEAR_EVERY) == 0)

    def _show_frames(self, state: Any, *, whole: bool) -> None:
        """Frames of moving links; now and then of all, for who came meanwhile."""
        positions = dict(zip(state.name, state.position, strict=False))
        chosen = [f for f in self._frames if whole or f.leader in positions]
        if whole or not getattr(self, "_shown", False):
            chosen, self._shown = self._frames, True
        self._frames_channel.log(
            bytes(serialize_message(message(chosen, positions, state.header.stamp)))
        )

    # --- what clients ask for; in the server's threads ----------------------------------------

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Who comes late gets the last message of a latched topic, and all frames."""
        self._shown = False
        for forwarded in self._topics.values():
            if forwarded.name == channel.topic:
                forwarded.again = True

    def on_get_parameters(
        self, client: Any, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """Parameters by ``/control_board.name``; all without names."""
        try:
            names = [self._own(name) for name in param_names] or self._client.list_parameters()
            return self._shown_parameters(names)
        except (BoardError, RequestError) as error:
            self._report(str(error))
            return []

    def on_set_parameters(
        self, client: Any, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Set them, all or none; what is in force afterwards."""
        values = {self._own(one.name): one.get_value() for one in parameters}
        try:
            if self._read_only:
                self._report("parameters are not set: the server is read-only")
            elif not (reply := self._client.set_parameters(values)):
                self._report(f"parameters are not set: {reply.message}")
            return self._shown_parameters(list(values))
        except (BoardError, RequestError) as error:
            self._report(str(error))
            return []

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """A client will send commands."""
        topic = self._commands.get(channel.topic)
        if topic is None or channel.encoding != ENCODING:
            self._report(f"{channel.topic[:100]} is no command of {self.board} in {ENCODING}")
            return
        if channel.topic not in self._publishers:
            made = self._asking.create_publisher(topic.load(), channel.topic, topic.qos.depth)
            self._publishers[channel.topic] = made
        self._sent[client.id, channel.id] = channel.topic

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        """It sends no more."""
        self._sent.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """A command goes on as it came."""
        if (topic := self._sent.get((client.id, client_channel_id))) is not None:
            self._publishers[topic].publish(bytes(data))

    def _service(self, endpoint: Endpoint) -> Service:
        return Service(
            name=endpoint.of(self.board),
            schema=service_schema(endpoint.type),
            handler=partial(self._call, endpoint),
        )

    def _call(self, endpoint: Endpoint, request: ServiceRequest) -> bytes:
        """Ask the board, and wait for its answer.

        Raises:
            TimeoutError: there is none; Foxglove shows the text.
        """
        kind, name = endpoint.load(), endpoint.of(self.board)
        if endpoint not in self._clients:
            self._clients[endpoint] = self._asking.create_client(kind, name)
        client = self._clients[endpoint]
        done = threading.Event()
        if not client.wait_for_service(self._timeout):
            raise TimeoutError(f"{name} is not there; is the board running?")
        future = client.call_async(deserialize_message(bytes(request.payload), kind.Request))
        future.add_done_callback(lambda _: done.set())
        if not done.wait(self._timeout):
            client.remove_pending_request(future)
            raise TimeoutError(f"no answer from {name} within {self._timeout:g} s; call it again")
        return bytes(serialize_message(future.result()))

    def _own(self, name: str) -> str:
        return name.removeprefix(f"{self.board}.")

    def _shown_parameters(self, names: Sequence[str]) -> list[Parameter]:
        values = self._client.get_parameters(names)
        return [
            Parameter(f"{self.board}.{name}", value=shown(value))
            for name, value in values.items()
            if value is not None
        ]

    def _answers(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return


def shown(value: Any) -> Any:
    """A parameter's value as of Foxglove."""
    return value if isinstance(value, bool | int | float | str) else list(value)
