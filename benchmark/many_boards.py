# SPDX-License-Identifier: Apache-2.0
"""So many boards in one process, each in a namespace: ``python many_boards.py COUNT``."""

from __future__ import annotations

import os
import sys
import threading

from rclpy.context import Context
from tap import install

from control_board_ros.node.loop.timing import take_priority
from control_board_ros.node.main import SWITCH_INTERVAL
from control_board_ros.node.process.boards import Boards
from control_board_ros.node.process.executor import KeptWaitSetExecutor
from control_board_ros.node.process.start import settings_from_arguments
from control_board_ros.sim.plant import SimulatedPlant


def main(count: int) -> None:
    """Run them until the input ends."""
    install()
    sys.setswitchinterval(SWITCH_INTERVAL)
    boards = []
    for k in range(count):
        start = settings_from_arguments(["--ros-args", "-r", f"__ns:=/arm_{k}"])
        take_priority(start.settings.values)
        plant = SimulatedPlant(start.settings.board, start.settings.simulation)
        context = Context()
        context.init(args=start.arguments)
        board = Boards(start, plant, context=context)
        executor = KeptWaitSetExecutor(board.on_error, context=context)
        executor.add_node(board.nodes[0])
        threading.Thread(target=executor.spin, daemon=True).start()
        boards.append(board)
    for board in boards:
        board.start()
    print("ready", flush=True)
    sys.stdin.read()
    for board in boards:
        board.stop()
    os._exit(0)  # ten DDS participants are not taken down in order


if __name__ == "__main__":
    main(int(sys.argv[1]))
