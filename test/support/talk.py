# SPDX-License-Identifier: Apache-2.0
"""A plain rclpy peer of a board for the tests: calls, publishes, and waits for what it sees."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any
from uuid import uuid4

from control_board_msgs import msg, srv
from qos import LATCHED, STREAM
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID
from waiting import GUARD, until

from control_board_ros.client import ControlBoardClient
from control_board_ros.client.state import FLOAT_FIELDS
from control_board_ros.testing import BoardProcess, ros_node

#: A client that waits as long.
patient = partial(ControlBoardClient, find_timeout=GUARD, answer_timeout=GUARD)


class Talker:
    """Talks to one board; every wait ends with an AssertionError after a timeout."""

    def __init__(self, node: Any, board: str) -> None:
        self.node, self.board = node, board
        self._publishers: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}
        self._changed = threading.Condition()
        self.seen: dict[str, list[Any]] = {}
        self._sent: dict[str, list[int]] = {}  # when each was sent, ns
        self.subscribe("state", msg.BoardState, f"{board}/state", STREAM)
        self.subscribe("modes", msg.JointModes, f"{board}/modes", LATCHED)
        self.subscribe("faults", msg.JointFaults, f"{board}/faults", LATCHED)
        self.names = list(self.wait("state", lambda _: True).names)
        self.wait("modes", lambda _: True)

    def subscribe(self, key: str, kind: Any, topic: str, qos: QoSProfile = STREAM) -> None:
        """Keep what comes on a topic in ``seen[key]``."""
        self.seen[key], self._sent[key] = [], []

        def keep(message: Any, info: dict[str, int]) -> None:
            with self._changed:
                self.seen[key].append(message)
                self._sent[key].append(info["source_timestamp"])
                self._changed.notify_all()

        self.node.create_subscription(kind, topic, keep, qos)

    def wait(
        self,
        key: str,
        good: Callable[[Any], bool],
        timeout: float = GUARD,
        *,
        fresh: bool = False,
        after: int | None = None,
    ) -> Any:
        """The newest message that is good; with ``fresh``, one of now or later.

        On a busy machine, messages of the last second may still be on their way when a service
        has answered. So a fresh one was sent from now on; and the first of those is left out, for
        its content may have been read before. With ``after`` (ns, of the system's clock) the
        same from then on: for what may have come and gone when this is called.
        """
        fresh = fresh or after is not None
        asked = time.time_ns() if after is None else after
        with self._changed:
            start = 0 if fresh else max(0, len(self.seen[key]) - 1)
            deadline = time.monotonic() + timeout
            while True:
                sent = self._sent[key]
                while fresh and start < len(sent) and sent[start] < asked:
                    start += 1
                for message in reversed(self.seen[key][start + fresh :]):
                    if good(message):
                        return message
                left = deadline - time.monotonic()
                newest = self.seen[key][-1:]
                assert left > 0, f"waited for {key}; the newest: {newest}"
                self._changed.wait(left)

    def state(self, good: Callable[[Any], bool] = lambda _: True, **rest: Any) -> Any:
        """The state from now on that is good."""
        return self.wait("state", good, fresh=True, **rest)

    def until_state(self, send: Callable[[], None], good: Callable[[Any], bool]) -> None:
        """Send until a state since then is good: the first best-effort messages may be lost."""
        deadline, begun = time.monotonic() + GUARD, time.time_ns()
        while True:
            send()
            try:
                self.state(good, timeout=0.1, after=begun)
                return
            except AssertionError:
                if time.monotonic() > deadline:
                    raise

    def call(self, name: str, kind: Any, /, timeout: float = GUARD, **request: Any) -> Any:
        """Call ``~/name`` and return its response."""
        return self.answer(self.ask(name, kind, **request), timeout)

    def ask(self, name: str, kind: Any, /, **request: Any) -> Future:
        """Call ``~/name`` without waiting."""
        if name not in self._clients:
            self._clients[name] = self.node.create_client(
                kind, f"{self.board}/{name}", qos_profile=QoSProfile(depth=500)
            )
            assert self._clients[name].wait_for_service(GUARD), f"no service {name}"
        return self._clients[name].call_async(kind.Request(**request))

    def answer(self, future: Future, timeout: float = GUARD) -> Any:
        """What a future gives."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        assert done.wait(timeout), "no answer"
        return future.result()

    def set_mode(self, joints: list[str], *modes: str) -> Any:
        """Call ~/set_control_mode."""
        return self.call("set_control_mode", srv.SetControlMode, names=joints, modes=list(modes))

    def set_interaction(self, joints: list[str], *modes: str) -> Any:
        """Call ~/set_interaction_mode."""
        return self.call(
            "set_interaction_mode", srv.SetInteractionMode, names=joints, modes=list(modes)
        )

    def modes(self) -> list[str]:
        """Call ~/get_control_mode for all joints."""
        return list(self.call("get_control_mode", srv.GetControlMode).modes)

    def change(self, **values: Any) -> Any:
        """Set parameters, all or none; double underscores replace dots."""
        given = [
            Parameter(name.replace("__", "."), value=value).to_parameter_msg()
            for name, value in values.items()
        ]
        answer = self.call("set_parameters_atomically", SetParametersAtomically, parameters=given)
        return answer.result

    def command(self, topic: str, message: Any, qos: QoSProfile | int = 10) -> None:
        """Publish on ``~/topic``, once the board listens."""
        key = f"{topic} {qos}"
        if key not in self._publishers:
            publisher = self.node.create_publisher(type(message), f"{self.board}/{topic}", qos)
            self._publishers[key] = publisher
            until(publisher.get_subscription_count, lambda: f"{topic} has no subscription")
        self._publishers[key].publish(message)

    def settle(self) -> None:
        """Let the board take what was published before.

        Of what arrives together it may serve a request first; the next one comes after.
        """
        self.modes()
        self.modes()

    def goal(self, name: str, kind: Any, feedback: list[Any] | None = None, **goal: Any) -> Any:
        """Send a goal to the action ``~/name``; returns the accepted goal's handle."""
        client = ActionClient(self.node, kind, f"{self.board}/{name}")
        assert client.wait_for_server(GUARD), f"no action {name}"
        number = UUID(uuid=list(uuid4().bytes))
        if feedback is not None:
            self._keep_feedback(name, kind, number, feedback)
        handle = self.answer(
            self.within(lambda: client.send_goal_async(kind.Goal(**goal), goal_uuid=number))
        )
        assert handle.accepted
        return handle

    def _keep_feedback(self, name: str, kind: Any, number: UUID, feedback: list[Any]) -> None:
        """Keep all feedback of a goal: an action client drops what comes after the result."""

        def keep(message: Any) -> None:
            if message.goal_id == number:
                feedback.append(message.feedback)

        subscription = self.node.create_subscription(
            kind.Impl.FeedbackMessage, f"{self.board}/{name}/_action/feedback", keep, 100
        )
        until(lambda: subscription.get_publisher_count() > 0)

    def result(self, handle: Any) -> Any:
        """The status and the result of a goal, when it has ended."""
        return self.answer(self.within(handle.get_result_async))

    def within(self, function: Callable[[], Any]) -> Any:
        """What a function gives in the thread that takes answers: so none comes too early."""
        return self.answer(self.node.executor.create_task(function))

    def rest(self) -> None:
        """Back to power-on and the initial pose, all joints configured and not faulted."""
        from std_srvs.srv import SetBool, Trigger

        self.call("pause", SetBool, data=False)
        assert self.call("reset", Trigger).success
        self.wait("modes", lambda m: "cfgn" not in m.control_modes)
        until(lambda: set(self.modes()) == {"pos"}, self.modes)


@contextlib.contextmanager
def talking_to(board: BoardProcess, name: str = "talker", to: str = "") -> Iterator[Talker]:
    """A talker in a node of its own, to the board, or to another one of the same process."""
    with ros_node(board.domain, name) as node:
        yield Talker(node, to or board.name)


def state_of(names: list[str], **other: Any) -> Any:
    """A state with one value of each kind for each joint, but for the other fields."""
    floats = {field: [0.0] * len(names) for field in FLOAT_FIELDS}
    flags = {field: [True] * len(names) for field in ("motion_done", "calibrated")}
    counts = {"rejected_commands": [0] * len(names)}
    return msg.BoardState(**({"names": names} | floats | flags | counts | other))


def stamp_of(message: Any) -> float:
    """The header's time, s."""
    return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)
