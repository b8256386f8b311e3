# SPDX-License-Identifier: Apache-2.0
"""Run in a network namespace of its own: a board whose loopback breaks, and full disks.

``unshare --net python islands.py loopback`` · ``unshare --mount python islands.py disk FOLDER``
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from control_board_msgs import msg
from talk import Talker, stamp_of, talking_to

from control_board_ros.testing import board_process

BROKEN = 5.0
#: Only UDP, which the wheels grant only to a node that looks beyond this host: through shared
#: memory, which needs no network, the fault would have no effect.
UDP = {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}


def run(*words: str) -> None:
    subprocess.run(words, check=True, timeout=120)


def moves(talker: Talker, target: float) -> None:
    """A reference goes out and the motion comes back."""
    talker.command(
        "command/position", msg.PositionCommand(names=["lbr_iiwa_joint_7"], positions=[target])
    )
    talker.state(lambda s: abs(s.position[6] - target) < 0.01)


def loopback() -> None:
    """Without the loopback for 5 s: no fault, no end; prints when the streams come back."""
    run("ip", "link", "set", "lo", "up")
    with board_process(env=UDP) as board, talking_to(board) as talker:
        moves(talker, 0.1)
        assert talker.set_mode(["lbr_iiwa_joint_1"], "vel").success
        run("ip", "link", "set", "lo", "down")
        time.sleep(BROKEN)
        assert board.process.poll() is None, board.tail()
        assert time.time() - stamp_of(talker.seen["state"][-1]) > 0.9 * BROKEN, "not cut"
        run("ip", "link", "set", "lo", "up")
        begun, now = time.monotonic(), time.time()
        state = talker.state(lambda s: stamp_of(s) > now)
        print(f"streams back after {time.monotonic() - begun:.2f} s")
        assert not any(state.rejected_commands)
        moves(talker, 0.0)
        assert talker.modes()[0] == "vel"
    print("passed")


def disk(folder: str) -> None:
    """A file system of 64 kB for the logs, full: the board runs and publishes."""
    run("mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder)
    try:
        with (Path(folder) / "full").open("wb") as file:
            file.write(bytes(65536))
        with board_process(env={"ROS_LOG_DIR": folder}) as board, talking_to(board) as talker:
            for _ in range(300):  # worth lines in the log
                talker.command("command/velocity", msg.VelocityCommand(names=["nobody"]))
            moves(talker, 0.1)
            assert talker.set_mode([], "vel").success
    finally:
        run("umount", folder)
    print("passed")


if __name__ == "__main__":
    {"loopback": loopback, "disk": disk}[sys.argv[1]](*sys.argv[2:])
