# SPDX-License-Identifier: Apache-2.0
"""A client without a node of the user's: for scripts and notebooks."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.node import Node

from .board import ControlBoardClient
from .errors import BoardError


def connect(board: str = "control_board", **options: Any) -> ControlBoardClient:
    """A client with a ROS context and a node of its own, closed with it.

    Args:
        board: name of the board's node, absolute or relative to ``/``.
        options: ``find_timeout``, ``answer_timeout`` of :class:`ControlBoardClient`, s.

    Raises:
        BoardError: ROS does not start: invalid RMW, domain or name.
    """
    context = Context()  # independent of the program's rclpy.init()
    try:
        context.init()
        node = Node("control_board_client", context=context, enable_rosout=False)
        client = ControlBoardClient(node, board, **options)
    except Exception as error:
        context.try_shutdown()
        if isinstance(error, TypeError):
            raise  # an unknown option
        raise BoardError(f"cannot start a ROS node: {str(error).splitlines()[0]}") from error
    client._close = weakref.finalize(client, _end, client._close, node, context)
    return client


def _end(close: Callable[[], Any], node: Node, context: Context) -> None:
    close()
    node.destroy_node()
    context.try_shutdown()
