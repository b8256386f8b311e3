# SPDX-License-Identifier: Apache-2.0
"""Action clients that send goals, several at a time; at random one lasts, and is cancelled."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from waiting import GUARD

from control_board_ros.testing import BoardProcess, ros_node

ENDS = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
}
#: The part of all goals that is cancelled.
CANCELLED = 0.4
#: Makes a goal from the client's number, a number of 0 to 1, and whether it lasts.
MakeGoal = Callable[[int, float, bool], Any]
#: s after which a goal is cancelled, and from the end of one goal to the next, at most.
LATEST, REST = 0.02, 0.1


class GoalClient:
    """Sends goals until ``count`` of them have ended.

    Attributes: results (numbers of results by goal), ends (numbers of goals by their end).
    """

    def __init__(
        self,
        node: Any,
        kind: Any,
        action: str,
        goal: MakeGoal,
        count: int,
        number: int,
    ) -> None:
        self._node, self._goal, self._left, self.count = node, goal, count, count
        self._number, self._random = number, random.Random(number)
        deep = QoSProfile(depth=1000)  # each receives the answers to all clients
        self._client = ActionClient(
            node,
            kind,
            action,
            goal_service_qos_profile=deep,
            result_service_qos_profile=deep,
            cancel_service_qos_profile=deep,
        )
        self.results: Counter[bytes] = Counter()
        self.ends: Counter[str] = Counter()
        self._ended = threading.Event()

    def start(self, at_a_time: int) -> None:
        assert self._client.wait_for_server(GUARD)
        for _ in range(at_a_time):
            self._node.executor.create_task(self._send)  # so no answer comes before it is awaited

    def wait(self, board: BoardProcess) -> None:
        """Wait for the last end: as long as the board lives and goals end."""
        seen, since = -1, 0.0
        while not self._ended.wait(1.0):
            ended = self.results.total()
            said = f"{ended} of {self.count} goals have ended"
            assert board.process.poll() is None, f"{said}, and the board:\n{board.tail()}"
            if ended != seen:
                seen, since = ended, time.monotonic()
            assert time.monotonic() < since + GUARD, f"{said}, and no other one since"

    def _send(self) -> None:
        if self._left:
            self._left -= 1
            lasts = self._random.random() < CANCELLED
            goal = self._goal(self._number, self._random.random(), lasts)
            sent = self._client.send_goal_async(goal)
            sent.add_done_callback(lambda future: self._on_accepted(future.result(), lasts))

    def _on_accepted(self, handle: Any, lasts: bool) -> None:
        assert handle.accepted
        goal = bytes(handle.goal_id.uuid)
        handle.get_result_async().add_done_callback(lambda f: self._on_end(goal, f.result()))
        if lasts:
            self._later(LATEST, handle.cancel_goal_async)

    def _later(self, seconds: float, do: Callable[[], Any]) -> None:
        """Do something once, within ``seconds``."""

        def once() -> None:
            timer.cancel()
            self._node.destroy_timer(timer)
            do()

        timer = self._node.create_timer(self._random.uniform(0.0, seconds), once)

    def _on_end(self, goal: bytes, answer: Any) -> None:
        self.results[goal] += 1
        self.ends[ENDS.get(answer.status, str(answer.status))] += 1
        self._later(REST, self._send)
        if self.results.total() >= self.count:
            self._ended.set()


def ends_of_goals(
    board: BoardProcess,
    kind: Any,
    action: str,
    goal: MakeGoal,
    *,
    count: int,
    at_a_time: int,
    clients: int = 4,
) -> Counter[str]:
    """Let clients, each in a node of its own, send ``count`` goals; how they ended.

    Raises:
        AssertionError: a goal has no result, or several, or the board has ended.
    """
    with ExitStack() as stack:
        nodes = [stack.enter_context(ros_node(board.domain, f"goals_{k}")) for k in range(clients)]
        all_of = [
            GoalClient(node, kind, f"{board.name}/{action}", goal, count // clients, number)
            for number, node in enumerate(nodes)
        ]
        for one in all_of:
            one.start(at_a_time)
        for one in all_of:
            one.wait(board)
    ends: Counter[str] = Counter()
    for one in all_of:
        assert set(one.results.values()) == {1}
        assert len(one.results) == one.count
        ends += one.ends
    return ends
