# SPDX-License-Identifier: Apache-2.0
"""One connection for the length of a command, or of a shell."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..startup import announce_often, leave_out_the_generator
from .options import Options
from .robot import JointDescription, describe
from .words import Quantity, Refused, UsageError, assigned, find_joints

if TYPE_CHECKING:
    from control_board_ros.client import ControlBoardClient


class Session:
    """The options in force, and the client once a verb asks for it."""

    def __init__(self, options: Options) -> None:
        self.shared = False  # whether several lines use it: the shell
        self.options = options
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the connection, if there is one."""
        self._stack.close()
        self.__dict__.pop("client", None)

    @cached_property
    def client(self) -> ControlBoardClient:
        """The client; made on first use."""
        announce_often()
        leave_out_the_generator()
        from rclpy.context import Context
        from rclpy.node import Node

        from control_board_ros.client import ControlBoardClient

        options = self.options
        context = Context()  # of its own: without rclpy's signal handlers, Ctrl-C is ours
        try:
            context.init(args=options.ros_arguments or None, domain_id=options.domain)
            self._stack.callback(context.try_shutdown)
            node = Node(
                "cbctl",
                namespace=options.namespace or None,
                context=context,
                use_global_arguments=bool(options.ros_arguments),
                enable_rosout=False,
                start_parameter_services=False,
            )
        except Exception as error:
            raise UsageError(f"cannot start a ROS node: {str(error).splitlines()[0]}") from error
        self._stack.callback(node.destroy_node)
        client = ControlBoardClient(
            node,
            options.board,
            find_timeout=options.timeout,
            answer_timeout=max(options.timeout, 1.0),
        )
        self._stack.callback(client.close)
        return client

    @property
    def names(self) -> tuple[str, ...]:
        """The board's joints."""
        return self.client.names

    def joints(self, words: Sequence[str] | None) -> list[str]:
        """The joints that words mean; none: all."""
        return find_joints(words or (), self.names)

    def values(self, pairs: Sequence[tuple[str, Quantity]]) -> dict[str, float]:
        """Values by joint, each with a unit that fits the joint.

        Raises:
            Refused: an unknown joint, or degrees for a sliding joint and the like.
        """
        values = assigned(pairs, self.names)
        for name, value in values.items():
            joint = self.robot.get(name) if value.dimension else None
            if joint is not None and joint.dimension != value.dimension:
                unit = "m or mm" if joint.prismatic else "rad or deg"
                raise Refused(f"{name} is {joint.kind}; give its value in {unit}")
        return {name: value.value for name, value in values.items()}

    @cached_property
    def robot(self) -> Mapping[str, JointDescription]:
        """Kind and limits of each joint, from the board's URDF; empty when it has none."""
        from control_board_ros.client import BoardTimeout

        try:
            return describe(self.client.get_robot_description())
        except BoardTimeout:
            return {}

    def show_angle(self, name: str, value: float) -> str:
        """A position for people: degrees, or mm."""
        joint = self.robot.get(name)
        if joint is not None and joint.prismatic:
            return f"{value * 1000:.1f} mm"
        return f"{value * 57.29577951308232:.1f}°"


def by_joint(names: Sequence[str], values: Any) -> dict[str, float]:
    """The values of an array, shape (n,), by joint."""
    return dict(zip(names, values.tolist(), strict=True))
