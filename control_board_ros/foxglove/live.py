# SPDX-License-Identifier: Apache-2.0
"""The server: messages are forwarded as received (CDR), and only while a client subscribes.

No callback runs per message: a loop polls the subscriptions 100 times a second.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import foxglove
import numpy as np
from foxglove.websocket import Capability, Parameter, ServerListener, Service, ServiceRequest
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from control_board_ros.client import BoardError, ControlBoardClient
from control_board_ros.client.executor_thread import ExecutorThread
from control_board_ros.core.selection import RequestError
from control_board_ros.frames import Frames, tf_message
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
from control_board_ros.urdf_xml import DescribedJoint, published_joints
from control_board_ros.web_access import in_address, listen

from .gate import Gate, inner_host
from .schemas import ENCODING, schema, service_schema

#: s between polls.
PERIOD = 0.01
#: Polls between updates of the subscriptions, and between messages of frames.
SUBSCRIBE_EVERY, FRAMES_EVERY = 10, 3
#: Polls between messages of all frames, for late clients.
ALL_FRAMES_EVERY = 300


class ForwardedTopic:
    """A topic of the board as a channel; subscribed on ROS while a client subscribes to it.

    ``node`` is not spun.

    Attributes: name, latched, last (message received, CDR), again (repeat ``last`` if latched).
    """

    def __init__(self, node: Node, topic: Endpoint, board: str, context: Any) -> None:
        self._node, self._kind = node, topic.load()
        self.name, self.last = topic.of(board), b""
        self.latched = topic.qos.latched
        self.channel = foxglove.Channel(
            self.name, message_encoding=ENCODING, schema=schema(topic.type), context=context
        )
        self._qos = replace(topic.qos, depth=max(10, topic.qos.depth), reliable=self.latched)
        self._subscription: Any = None
        self.again = False

    def follow(self, *, always: bool = False) -> None:
        """Subscribe or unsubscribe, as clients do."""
        has_reader = always or self.channel.has_sinks()
        if has_reader and self._subscription is None:
            self._subscription = self._node.create_subscription(
                self._kind, self.name, print, self._qos.profile(), raw=True
            )
        elif not has_reader and self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def take(self) -> bool:
        """Forward the messages in the queue; false without any."""
        if self._subscription is None:
            return False
        handle, received = self._subscription.handle, False
        again, self.again = self.again, False
        if again and self.latched and self.last:
            self.channel.log(self.last)
        with handle:
            while (taken := handle.take_message(self._kind, True)) is not None:
                received, self.last = True, bytes(taken[0])
                self.channel.log(self.last)
        return received

    def read(self) -> Any:
        return deserialize_message(self.last, self._kind)


class Live(ServerListener):
    """A server for Foxglove.

    Args:
        node: of the subscriptions; not spun.
        asking: of the requests and commands; spun here.
        client: of the board.
        host: address to listen on.
        port: port to listen on; 0: a free one.
        operate: clients may command the board; else they only read.
        origins: of web pages that may connect, beside Foxglove's own.
        answer_timeout: timeout of a board's answer, s.
        report: called with log lines.

    Attributes: board, address, app (to open in a browser).

    Raises:
        CannotListen: the address is not available.
    """

    def __init__(
        self,
        node: Node,
        asking: Node,
        client: ControlBoardClient,
        *,
        host: str,
        port: int,
        operate: bool,
        origins: Sequence[str] = (),
        answer_timeout: float,
        report: Callable[[str], None],
    ) -> None:
        self._node, self._asking, self._client = node, asking, client
        self._timeout, self._report = answer_timeout, report
        self.board = board = client.board_name
        self._operate = operate
        self._context = context = foxglove.Context()  # channels do not hold it
        self._topics = {
            topic: ForwardedTopic(node, topic, board, context)
            for topic in (*PUBLISHED, ROSOUT)
            if topic not in (TF, TF_STATIC)
        }
        self._frames_channel = foxglove.Channel(
            TF.name, message_encoding=ENCODING, schema=schema(TF.type), context=context
        )
        self._joints: dict[str, DescribedJoint] = {}
        self._frames = Frames({}, ())
        self._all_shown = False
        self._publishers: dict[str, Any] = {}
        self._clients: dict[Endpoint, Any] = {}
        self._commands = {topic.of(board): topic for topic in COMMAND_TOPICS}
        self._sent: dict[tuple[int, int], str] = {}
        capabilities = [Capability.Parameters]
        if operate:
            capabilities += [Capability.Services, Capability.ClientPublish]
        inner = inner_host()
        listening = listen(host, port)
        self._server = foxglove.start_server(
            name=board,
            host=inner,
            port=0,
            capabilities=capabilities,
            server_listener=self,
            supported_encodings=[ENCODING],
            services=[self._service(endpoint) for endpoint in SERVICES] if operate else [],
            context=context,
        )
        self._thread = ExecutorThread(asking, lambda error: report(str(error)))
        port = listening.getsockname()[1]
        self._gate = Gate(listening, host, (inner, self._server.port), frozenset(origins), report)
        self.address = f"ws://{in_address(host)}:{port}"
        self.app = f"https://app.foxglove.dev/~/view?ds=foxglove-websocket&ds.url={self.address}"

    def run(self, ended: threading.Event) -> None:
        """Forward messages until the event."""
        try:
            for count in itertools.count():
                if ended.wait(PERIOD):
                    return
                self._poll(count)
        finally:
            self._gate.close()
            self._server.stop()
            self._thread.close()

    def _poll(self, count: int) -> None:
        states, framed = self._topics[JOINT_STATES], self._frames_channel.has_sinks()
        for topic, forwarded in self._topics.items():
            if count % SUBSCRIBE_EVERY == 0:
                forwarded.follow(always=framed and topic in (JOINT_STATES, ROBOT_DESCRIPTION))
            if forwarded.take() and topic is ROBOT_DESCRIPTION:
                self._joints = published_joints(forwarded.read().data)
                self._frames = Frames(self._joints, self._frames.names)
        if framed and states.last and count % FRAMES_EVERY == 0:
            self._show_frames(states.read(), whole=count % ALL_FRAMES_EVERY == 0)

    def _show_frames(self, state: Any, *, whole: bool) -> None:
        """Send the frames of moving links, or of all: periodically, and to a new client."""
        positions = dict(zip(state.name, state.position, strict=False))
        if self._frames.names != tuple(positions):
            self._frames = Frames(self._joints, tuple(positions))
        frames = self._frames
        edges, poses = frames.moving, frames.poses(np.array([*positions.values()]))
        if whole or not self._all_shown:
            edges, poses = edges + frames.standing, np.vstack([poses, frames.standing_poses])
            self._all_shown = True
        message = tf_message(edges, poses, state.header.stamp)
        self._frames_channel.log(bytes(serialize_message(message)))

    # --- requests of clients; in the server's threads -----------------------------------------

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Repeat the last message of a latched topic, and all frames, for the new client."""
        self._all_shown = False
        for forwarded in self._topics.values():
            if forwarded.name == channel.topic:
                forwarded.again = True

    def on_get_parameters(
        self, client: Any, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """Parameters by ``/control_board.name``; without names all."""
        try:
            names = [
                self._board_parameter(name) for name in param_names
            ] or self._client.list_parameters()
            return self._shown_parameters(names)
        except (BoardError, RequestError) as error:
            self._report(str(error))
            return []

    def on_set_parameters(
        self, client: Any, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Set parameters, all or none; returns the values in force."""
        values = {
            self._board_parameter(parameter.name): parameter.get_value()
            for parameter in parameters
        }
        try:
            if not self._operate:
                self._report("parameters are not set: start cbctl foxglove with --operate")
            elif not (reply := self._client.set_parameters(values)):
                self._report(f"parameters are not set: {reply.message}")
            return self._shown_parameters(list(values))
        except (BoardError, RequestError) as error:
            self._report(str(error))
            return []

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        """Create the publisher of a command topic for a client."""
        topic = self._commands.get(channel.topic)
        if topic is None or channel.encoding != ENCODING:
            self._report(f"{channel.topic[:100]} is no command of {self.board} in {ENCODING}")
            return
        if channel.topic not in self._publishers:
            made = self._asking.create_publisher(topic.load(), channel.topic, topic.qos.depth)
            self._publishers[channel.topic] = made
        self._sent[client.id, channel.id] = channel.topic

    def on_client_unadvertise(self, client: Any, client_channel_id: int) -> None:
        self._sent.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        """Publish a command unchanged."""
        if (topic := self._sent.get((client.id, client_channel_id))) is not None:
            self._publishers[topic].publish(bytes(data))

    def _service(self, endpoint: Endpoint) -> Service:
        return Service(
            name=endpoint.of(self.board),
            schema=service_schema(endpoint.type),
            handler=partial(self._call, endpoint),
        )

    def _call(self, endpoint: Endpoint, request: ServiceRequest) -> bytes:
        """Call a service of the board; returns its response, CDR.

        Raises:
            TimeoutError: no answer; Foxglove shows the text.
        """
        kind, name = endpoint.load(), endpoint.of(self.board)
        if endpoint not in self._clients:
            self._clients[endpoint] = self._asking.create_client(kind, name)
        client = self._clients[endpoint]
        done = threading.Event()
        if not client.wait_for_service(self._timeout):
            raise TimeoutError(f"{name} is not offered; is the board running?")
        future = client.call_async(deserialize_message(bytes(request.payload), kind.Request))
        future.add_done_callback(lambda _: done.set())
        if not done.wait(self._timeout):
            client.remove_pending_request(future)
            raise TimeoutError(f"no answer from {name} within {self._timeout:g} s; call it again")
        return bytes(serialize_message(future.result()))

    def _board_parameter(self, name: str) -> str:
        return name.removeprefix(f"{self.board}.")

    def _shown_parameters(self, names: Sequence[str]) -> list[Parameter]:
        values = self._client.get_parameters(names)
        return [
            Parameter(f"{self.board}.{name}", value=plain_value(value))
            for name, value in values.items()
            if value is not None
        ]


def plain_value(value: Any) -> Any:
    """A parameter's value for Foxglove: a scalar or a list."""
    return value if isinstance(value, bool | int | float | str) else list(value)
