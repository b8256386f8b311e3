# SPDX-License-Identifier: Apache-2.0
"""One goal of an action over ROS, from request to result."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar
from uuid import uuid4

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from unique_identifier_msgs.msg import UUID

from control_board_ros.core.terms.reply import Reply, accepted, refused
from control_board_ros.interface import Endpoint

from .errors import BoardError, BoardTimeout
from .executor_thread import GONE, hidden_node
from .goals import Trajectory
from .link import Outcome
from .ros_link import RosLink
from .services import Services, whole
from .waiting import Wait

#: s between checks of the board's presence while a goal runs.
PRESENCE_PERIOD = 1.0
#: Feedback messages that are queued.
FEEDBACK_KEPT = 100
F = TypeVar("F")


class RosGoal:
    """An active goal.

    Args:
        link: the connection.
        services: of the board; for others see :meth:`Services.goal`.
    """

    def __init__(
        self,
        link: RosLink,
        services: Services,
        action: Endpoint,
        on_feedback: Callable[[Any], None],
        on_result: Callable[[Any], None],
        outcome: Callable[[Any], Outcome],
    ) -> None:
        self._link, self._thread = link, link.thread
        self._action, self._name = action, action.short
        self._changed = services.states.changed
        self._on_feedback, self._on_result = on_feedback, on_result
        self._outcome = outcome
        self._id = UUID(uuid=list(uuid4().bytes))
        self._client: Any = None
        self._sending: Any = None  # the future of rclpy's handle
        self._result: Any = None  # the future of the result
        self._feedback: deque[Any] = deque(maxlen=FEEDBACK_KEPT)  # not shown yet
        self._received = 0  # feedback messages
        self._wait: Wait | None = None
        self._silent = False  # the board

    async def run(
        self,
        fields: dict[str, Any],
        names: tuple[str, ...],
        feedback: Callable[[F], None] | None,
        read: Callable[[Any], F],
        *,
        to_the_end: bool = True,
        attended: bool = False,
    ) -> Reply:
        """See :meth:`Goal.run`."""

        def show(message: Any) -> None:
            if feedback is not None:
                feedback(read(message))

        self._client = await self._link.action(self._action)
        end_beats = await self._link.beat(self._id) if attended else lambda: None
        try:
            if not await self._send(fields):
                return refused(f"the board refused to {self._name}; see its log", names)
            self._changed()
            while not self._result.done():
                await self._next_sign()
                while self._feedback:
                    show(self._feedback.popleft())
                    if not to_the_end:
                        return accepted(names)
        except GeneratorExit:  # the caller cannot wait
            with contextlib.suppress(BoardError, *GONE):  # nor receive an error
                self._ask_to_cancel()
            raise
        except BaseException:
            if not self._silent:  # or it would stop when the network is back
                await self._cancel()
            self._changed()
            raise
        finally:
            end_beats()
        await self._drain_feedback()
        while self._feedback:
            show(self._feedback.popleft())
        self._changed()
        answer = self._result.result()
        success, message, codes = self._outcome(answer.result)
        if answer.status == GoalStatus.STATUS_CANCELED and not message:
            message = f"{self._name} was cancelled"
        return whole(success, message, names, codes)

    async def _send(self, fields: dict[str, Any]) -> bool:
        goal = self._action.load().Goal(**{name: as_message(v) for name, v in fields.items()})

        def send() -> None:
            self._sending = self._client.send_goal_async(goal, self._queue, self._id)

        await self._thread.run(send)
        if not await self._thread.outcome(self._sending, self._link.answer_timeout):
            raise self._link.timed_out(self._action)
        handle = self._sending.result()
        if handle.accepted:
            await self._thread.run(self._ask_for_result)
        return bool(handle.accepted)

    def _ask_for_result(self) -> None:
        if self._result is None:
            self._result = self._sending.result().get_result_async()
            self._result.add_done_callback(self._end)

    async def _next_sign(self) -> None:
        """Wait for feedback or the result.

        Raises:
            BoardTimeout: the board has disappeared: discovery forgets one that was killed after
                20 s only, but it gives neither feedback nor an answer.
        """
        self._wait = wait = self._thread.wait(PRESENCE_PERIOD)
        if self._feedback or self._result.done():
            wait.finish()
        await wait
        if wait.done or (self._client.server_is_ready() and await self._link.is_answering()):
            return
        if not (self._feedback or self._result.done()):
            self._silent = True
            raise BoardTimeout(
                f"{self._link.name} went silent during {self._name}; is it still running, and the "
                "network up? The joints may still move; send a stop"
            )

    async def _drain_feedback(self) -> None:
        """Process the feedback that precedes the result: rclpy handles one message per task."""
        received = -1
        while received != self._received:
            received = self._received
            for _ in range(2):
                await self._thread.run(lambda: None)

    def _ask_to_cancel(self) -> None:
        if self._sending is not None and self._sending.done() and self._sending.result().accepted:
            self._thread.later(self._sending.result().cancel_goal_async)

    async def _cancel(self) -> None:
        """Cancel the goal, which stops the joints; over a new context if necessary."""
        patience = self._link.answer_timeout
        try:
            await self._thread.run(lambda: None)  # earlier requests are sent by now
            if self._sending is None:
                return
            await self._thread.outcome(self._sending, patience)
            if self._sending.done() and self._sending.result().accepted:
                self._ask_to_cancel()
                await self._thread.run(self._ask_for_result)
                await self._thread.outcome(self._result, patience)
        except (BoardError, *GONE):
            service = f"{self._link.full_name(self._action)}/_action/cancel_goal"
            if not cancel_over_new_context(self._link.domain, service, self._id, patience):
                self._link.log_error(
                    f"could not cancel {self._name}: the board does not answer; "
                    "the joints may still move; send a stop"
                )

    def _queue(self, message: Any) -> None:
        self._on_feedback(message.feedback)
        self._feedback.append(message.feedback)
        self._received += 1
        self._wake()

    def _end(self, future: Any) -> None:
        self._on_result(future.result().result)
        self._wake()

    def _wake(self) -> None:
        if self._wait is not None:
            self._wait.finish()


def cancel_over_new_context(domain: int, service: str, goal_id: Any, timeout: float) -> bool:
    """Cancel a goal after the context was shut down; returns whether the board answered.

    On Ctrl-C, rclpy's signal handlers shut down every context of the process before Python raises
    KeyboardInterrupt, and such a context sends nothing. The goal of an interrupted move is
    therefore cancelled over a new one, which stops the joints.

    Args:
        domain: the ROS domain.
        service: the action's cancel service, absolute.
        goal_id: the goal's UUID message.
        timeout: s for discovery, and again for the answer.
    """
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=domain)
    try:
        node = hidden_node("_board_client_cancel", context)
        client: Any = node.create_client(CancelGoal, service)
        if not client.wait_for_service(timeout):
            return False
        request = CancelGoal.Request()
        request.goal_info.goal_id = goal_id
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        answer = client.call_async(request)
        executor.spin_until_future_complete(answer, timeout)
        executor.shutdown()
        node.destroy_node()
        return bool(answer.done())
    finally:
        context.try_shutdown()


def as_message(value: Any) -> Any:
    """A field of a goal: the message of a trajectory; anything else as it is."""
    if not isinstance(value, Trajectory):
        return value
    message = JointTrajectory(joint_names=list(value.names))
    for k in range(value.times.size):
        point = JointTrajectoryPoint(positions=value.positions[k].tolist())
        if value.velocities is not None:
            point.velocities = value.velocities[k].tolist()
        nanoseconds = round(1e9 * float(value.times[k]))
        point.time_from_start.sec = nanoseconds // 10**9
        point.time_from_start.nanosec = nanoseconds % 10**9
        message.points.append(point)
    return message
