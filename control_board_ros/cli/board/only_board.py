# SPDX-License-Identifier: Apache-2.0
"""The board of a line that names none."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..line.options import DEFAULT

if TYPE_CHECKING:
    from rclpy.node import Node

#: s to wait for further boards after the last one, and where an emergency stop waits.
GATHERING, HASTE = 1.0, 0.3
#: The same where the boards so far are several, and none is that of a robot: it may still come.
SEVERAL = 3.0
POLL = 0.05
#: Name of the own node of a robot with parts.
ROBOT = "robot"


def only_board(node: Node, timeout: float, gathering: float = GATHERING) -> str:
    """The board of a line that names none: the default, else the only one, or the only robot.

    Args:
        node: of cbctl.
        timeout: s to find a board.
        gathering: s to wait for further ones, where there is only one, or only one robot.
    """
    from control_board_ros.client.ros_link import boards_on

    default = node.resolve_topic_name(DEFAULT)
    begun = since = time.monotonic()
    boards: list[str] = []
    while (now := time.monotonic()) - begun < timeout:
        present = boards_on(node)
        if default in present:
            break
        if present != boards:
            boards, since = present, now
        alone = alone_among(boards)
        if boards and now - since >= (gathering if alone else SEVERAL):
            return alone or DEFAULT
        time.sleep(POLL)
    return DEFAULT


def alone_among(boards: Sequence[str]) -> str:
    """The only board, or the own board of the only robot, of absolute names; empty: several."""
    if len(boards) == 1:
        return boards[0]
    robots = [name for name in boards if name.rpartition("/")[2] == ROBOT]
    folder = robots[0].removesuffix(ROBOT) if len(robots) == 1 else ""
    return robots[0] if folder and all(name.startswith(folder) for name in boards) else ""
