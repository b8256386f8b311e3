# SPDX-License-Identifier: Apache-2.0
"""Cancel a goal after the context was shut down.

On Ctrl-C, rclpy's signal handlers shut down every context of the process before Python raises
KeyboardInterrupt, and a context that was shut down sends nothing. The goal of an interrupted
move is therefore cancelled over a new context, which stops the joints.
"""

from __future__ import annotations

from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node


def cancel_over_new_context(domain: int, service: str, goal_id: Any, timeout: float) -> bool:
    """Cancel a goal over a new connection; returns whether the board answered.

    Args:
        domain: the ROS domain.
        service: the action's cancel service, absolute.
        goal_id: the goal's UUID message.
        timeout: s for discovery, and again for the answer.
    """
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=domain)
    try:
        node = Node(
            "_board_client_cancel",
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
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
