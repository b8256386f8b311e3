# SPDX-License-Identifier: Apache-2.0
"""The board of a line that names none."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..line.options import DEFAULT

if TYPE_CHECKING:
    from rclpy.node import Node

#: s to wait for further boards after the first.
GATHERING = 1.0
POLL = 0.05
#: Name of the own node of a robot with parts.
ROBOT = "robot"


def only_board(node: Node, timeout: float) -> str:
    """The board of a line that names none: the default, else the only one, or the only robot.

    Args:
        node: of cbctl.
        timeout: s to find a board.
    """
    from control_board_ros.client.ros_link import boards_on

    default = node.resolve_topic_name(DEFAULT)
    deadline, first = time.monotonic() + timeout, 0.0
    boards: list[str] = []
    while time.monotonic() < deadline:
        boards = boards_on(node)
        if default in boards:
            break
        if boards:
            first = first or time.monotonic()
            if time.monotonic() - first >= GATHERING:
                return alone_among(boards) or DEFAULT
        time.sleep(POLL)
    return DEFAULT


def alone_among(boards: Sequence[str]) -> str:
    """The only board, or the own board of the only robot, of absolute names; empty: several."""
    if len(boards) == 1:
        return boards[0]
    robots = [name for name in boards if name.rpartition("/")[2] == ROBOT]
    folder = robots[0].removesuffix(ROBOT) if len(robots) == 1 else ""
    return robots[0] if folder and all(name.startswith(folder) for name in boards) else ""
