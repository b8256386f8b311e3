# SPDX-License-Identifier: Apache-2.0
"""Swing joints of a running board by velocity, from a ROS node of your own.

    python -m control_board_ros.examples.ros_client --seconds 4 lbr_iiwa_joint_4

The node sends a velocity 50 times a second: a velocity reference expires after 0.2 s, so that
the arm stops when a program does. It puts the modes back at the end, also after Ctrl-C.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from ..client import BoardError, ControlBoardClient

RATE = 50.0  # Hz
PERIOD = 2.0  # s of one swing


class Refused(Exception):  # noqa: N818  (the word of the board)
    """The board refuses; the text is its reason."""


def swing(board: ControlBoardClient, joints: list[str], speed: float, seconds: float) -> None:
    """Swing joints with a sine of the velocity, rad/s, for a time.

    Raises:
        Refused: a joint cannot be set to VELOCITY, or leaves it on the way.
    """
    before = board.get_control_mode(joints)
    try:
        reply = board.set_control_mode(joints, "vel")
        if not reply:
            raise Refused(reply.message)
        start = due = time.monotonic()
        while (t := due - start) < seconds:
            velocity = speed * math.sin(2.0 * math.pi * t / PERIOD)
            reply = board.velocity_move(joints, velocity, 4.0 * speed, answered=True)
            if not reply:
                raise Refused(reply.message)
            due += 1.0 / RATE
            time.sleep(max(due - time.monotonic(), 0.0))
    finally:
        board.set_control_mode(joints, before)  # it stops them


def main(argv: Sequence[str] | None = None) -> int:
    """Swing until the time is over; 0, or 1 where the board refuses or is not there."""
    parser = argparse.ArgumentParser(description="Swing joints of a board by velocity.")
    parser.add_argument("joints", nargs="*", help="names of joints; none: the first one")
    parser.add_argument("--board", default="control_board", help="name of the board's node")
    parser.add_argument("--speed", type=float, default=0.2, help="rad/s (m/s), default 0.2")
    parser.add_argument("--seconds", type=float, default=4.0, help="default 4")
    options = parser.parse_args(argv)
    # rclpy's own handler of Ctrl-C would close the connection before the modes are put back.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node("swing")
    try:
        with ControlBoardClient(node, options.board) as board:
            joints = options.joints or [board.names[0]]
            swing(board, joints, options.speed, options.seconds)
            angles = ", ".join(f"{q:.3f}" for q in board.get_encoder(joints))
            print(f"{', '.join(joints)} at {angles}")
    except (Refused, BoardError, ValueError) as error:
        print(f"ros_client: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 1
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
