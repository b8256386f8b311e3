# SPDX-License-Identifier: Apache-2.0
"""A publisher in a process of its own, to be killed or to flood: see ``sending``."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from control_board_ros.testing import BoardProcess

#: Topic below ~/command, and the field that carries its values.
FIELDS = {
    "position": "positions",
    "position_direct": "positions",
    "velocity": "velocities",
    "torque": "torques",
    "output": "outputs",
}


@contextmanager
def sending(
    board: BoardProcess, topic: str, value: float, rate: float, *, count: int = 0, names: str = ""
) -> Iterator[subprocess.Popen[str]]:
    """A process that publishes references until the block ends.

    Args:
        board: to send to.
        topic: a key of FIELDS.
        value: for each joint.
        rate: Hz.
        count: of values in a message, whatever the number of joints; 0: one per name.
        names: of the joints, with commas; empty for all.
    """
    words = [topic, value, rate, count, names, board.name]
    process = subprocess.Popen(
        [sys.executable, __file__, *map(str, words)],
        env=board.environment,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "sending\n"
        yield process
    finally:
        process.kill()
        process.communicate(timeout=60.0)


def main(topic: str, value: str, rate: str, count: str, names: str, board: str) -> None:
    """Publish at a rate, several messages at a time where sleeping is too coarse."""
    import rclpy
    from control_board_msgs import msg
    from rclpy.qos import QoSProfile

    rclpy.init(args=[])
    node = rclpy.create_node("sender")
    kind = getattr(msg, f"{topic.title().replace('_', '')}Command")
    chosen = names.split(",") if names else []
    values = [float(value)] * (int(count) or len(chosen))
    message = kind(**{"names": chosen, FIELDS[topic]: values})
    publisher = node.create_publisher(kind, f"{board}/command/{topic}", QoSProfile(depth=10))
    while not publisher.get_subscription_count():
        time.sleep(0.01)
    publisher.publish(message)
    print("sending", flush=True)
    batch = max(1, round(float(rate) / 500.0))
    begun, sent = time.monotonic(), 0
    while True:
        for _ in range(batch):
            publisher.publish(message)
        sent += batch
        ahead = begun + sent / float(rate) - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)


if __name__ == "__main__":
    main(*sys.argv[1:])
