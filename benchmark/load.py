# SPDX-License-Identifier: Apache-2.0
"""Who talks to a board and listens to it, each run as a process: ``python load.py ROLE BOARD …``.

``listen BOARD``         receives ~/state and reports when each message arrived
``command BOARD RATE``   receives ~/state and commands all joints, in POSITION_DIRECT, at this rate

Both go on until their input ends, then print what they found.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import threading
import time
from array import array
from typing import Any

import rclpy
from control_board_msgs.msg import BoardState, PositionDirectCommand
from rclpy.signals import SignalHandlerOptions

NAP = 2e-4  # s between two looks at the clock
PATIENCE = 20.0


class Listener:
    """Notes when each state was stamped and when it came (s)."""

    def __init__(self, node: Any, board: str) -> None:
        self.stamps: list[float] = []
        self.arrivals: list[float] = []
        self.last: Any = None
        node.create_subscription(BoardState, f"{board}/state", self._hear, 10)

    def _hear(self, message: Any) -> None:
        self.arrivals.append(time.monotonic())
        stamp = message.header.stamp
        self.stamps.append(stamp.sec + 1e-9 * stamp.nanosec)
        self.last = message

    def wait(self) -> None:
        """Wait for the first state."""
        end = time.monotonic() + PATIENCE
        while self.last is None:
            if time.monotonic() > end:
                raise RuntimeError("no state came")
            time.sleep(0.01)


def main(role: str, board: str, rate: str = "0") -> None:
    """Take the role, then print what was found."""
    ended = threading.Event()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(f"benchmark_{role}")
    executor = rclpy.executors.SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    listener = Listener(node, board)
    listener.wait()
    gc.collect()
    gc.disable()  # this is the instrument
    if role == "listen":
        time.sleep(0.5)
        tell_ready(ended)
        begin = len(listener.arrivals)
        ended.wait()
        found = {"arrivals": listener.arrivals[begin:], "stamps": listener.stamps[begin:]}
    else:
        found = command(node, listener, board, float(rate), ended)
    print(json.dumps(found), flush=True)
    os._exit(0)  # the executor spins in another thread, and has nothing to finish


def tell_ready(ended: threading.Event) -> None:
    """Report readiness to the parent process, and note when it ends the run."""

    def watch() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=watch, daemon=True).start()
    print("ready", flush=True)


def command(
    node: Any, listener: Listener, board: str, rate: float, ended: threading.Event
) -> dict[str, Any]:
    """Send set-points around where the arm is, at this rate on average."""
    message = PositionDirectCommand(positions=listener.last.position)
    home = listener.last.position.tolist()
    publisher = node.create_publisher(
        PositionDirectCommand, f"{board}/command/position_direct", 10
    )
    end = time.monotonic() + PATIENCE
    while publisher.get_subscription_count() == 0 and time.monotonic() < end:
        time.sleep(0.01)
    tell_ready(ended)
    begin = now = time.monotonic()
    received, sent = len(listener.arrivals), 0
    while not ended.is_set():
        now = time.monotonic()
        for _ in range(int((now - begin) * rate) - sent):
            sent += 1
            way = 1e-3 * (sent % 100) / 100.0
            message.positions = array("d", [angle + way for angle in home])
            publisher.publish(message)
        time.sleep(NAP)
    return {
        "sent": sent / (now - begin),
        "received": (len(listener.arrivals) - received) / (now - begin),
    }


if __name__ == "__main__":
    sys.setswitchinterval(5e-5)
    main(*sys.argv[1:])
