# SPDX-License-Identifier: Apache-2.0
"""How the benchmarks talk to a board: plain rclpy, as any program would."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from control_board_msgs.msg import BoardState, PositionDirectCommand
from control_board_msgs.srv import GetControlMode, SetControlMode
from processes import BOARD
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from control_board_ros.testing import ros_node

PATIENCE = 10.0  # s for an answer


class Talker:
    """A node with an executor of its own, spun by the waiting thread."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def client(self, kind: Any, service: str) -> Any:
        """A client of a service that is there.

        Raises:
            RuntimeError: it is not.
        """
        client = self.node.create_client(kind, service)
        if not client.wait_for_service(PATIENCE):
            raise RuntimeError(f"no service {service}")
        return client

    def call(self, client: Any, request: Any) -> Any:
        """Call and wait for the response.

        Raises:
            RuntimeError: none came, or it reports a failure.
        """
        future = client.call_async(request)
        # spin_until_future_complete would leave more to do behind with every call.
        response = future.result() if self.wait(future.done) else None
        if response is None or not response.success:
            why = "no answer" if response is None else response.message
            raise RuntimeError(f"{client.srv_name}: {why}")
        return response

    def wait(self, condition: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Serve callbacks until something holds; false when it does not within the timeout."""
        end = time.monotonic() + timeout
        while not condition():
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=left)
        return True

    def pause(self, seconds: float) -> None:
        """Let time pass while messages come in."""
        self.wait(lambda: False, seconds)

    def close(self) -> None:
        self._executor.shutdown()


@contextmanager
def talker(domain: int, name: str = "benchmark") -> Iterator[Talker]:
    """A talker for the length of a block."""
    with ros_node(domain, name, spin=False) as node:
        made = Talker(node)
        try:
            yield made
        finally:
            made.close()


def switch(talking: Talker, mode: str) -> None:
    """Put all joints of the board into a control mode."""
    client = talking.client(SetControlMode, f"{BOARD}/set_control_mode")
    talking.call(client, SetControlMode.Request(modes=[mode]))


def joint_names(talking: Talker) -> list[str]:
    """The joints of the board."""
    client = talking.client(GetControlMode, f"{BOARD}/get_control_mode")
    return list(talking.call(client, GetControlMode.Request()).names)


class SetPoints:
    """Sends position set-points to a board and watches them come into force.

    Args:
        talking: sends and receives.
        board: name of the board's node; in POSITION_DIRECT.
    """

    def __init__(self, talking: Talker, board: str = BOARD) -> None:
        self._talking = talking
        self.in_force = float("nan")
        self.received = 0
        node = talking.node
        topic = f"{board}/command/position_direct"
        self._publisher = node.create_publisher(PositionDirectCommand, topic, 10)
        node.create_subscription(BoardState, f"{board}/state", self._hear, 10)
        ready = talking.wait(
            lambda: self.received > 0 and self._publisher.get_subscription_count() > 0
        )
        if not ready:
            raise RuntimeError(f"no state from {board}, or no subscriber to {topic}")
        self._rest: list[float] = self._last.position_reference.tolist()[1:]

    def _hear(self, message: BoardState) -> None:
        self.in_force = message.position_reference[0]
        self._last = message
        self.received += 1

    def send(self, position: float) -> None:
        """A set-point for the first joint; the others stay."""
        positions = array("d", [position, *self._rest])
        self._publisher.publish(PositionDirectCommand(positions=positions))

    def wait_for(self, position: float, timeout: float = 1.0) -> bool:
        """Wait until the state shows the set-point."""
        return self._talking.wait(lambda: self.in_force == position, timeout)

    def let_pass(self, states: int) -> None:
        """Wait for ``states`` more states."""
        end = self.received + states
        self._talking.wait(lambda: self.received >= end)
