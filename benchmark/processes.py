# SPDX-License-Identifier: Apache-2.0
"""Processes beside the one that measures: boards, bare references, loads and listeners."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sensor_msgs.msg import JointState
from tap import LAUNCHER, Tap

from control_board_ros.testing import BoardProcess, board_process, child_environment, ros_node

FOLDER = Path(__file__).parent
#: Starts a program without the right to raise its priority.
ORDINARY = (sys.executable, str(FOLDER / "ordinary.py"))
NODE = (sys.executable, "-m", "control_board_ros.node.main")
BOARD = "/control_board"
BARE = "/bare"


@contextmanager
def board(
    domain: int,
    params: Mapping[str, Any] | None = None,
    *,
    tap: Tap | None = None,
    ordinary: bool = False,
    **options: Any,
) -> Iterator[BoardProcess]:
    """A real board on this domain.

    Args:
        domain: its ROS domain.
        params: of the node.
        tap: what its cycles are written down to, if anything.
        ordinary: as a user without the right to raise priorities has it.
        options: of ``board_process``.
    """
    command: tuple[str, ...] = NODE
    if tap is not None:
        options |= {"env": tap.environment}
        command = (sys.executable, str(LAUNCHER))
    options |= {"command": (*ORDINARY, *command) if ordinary else command}
    with board_process(params, domain=domain, **options) as process:
        yield process


def seconds_to_first_state(domain: int, topic: str, *parameters: str) -> float:
    """From the start of a board's process to its first joint state at a waiting subscriber, s.

    Raises:
        RuntimeError: none came.
    """
    seen = threading.Event()
    with ros_node(domain, "waiting") as node:
        node.create_subscription(JointState, topic, lambda _: seen.set(), 10)
        time.sleep(0.2)
        begin = time.monotonic()
        given = [word for parameter in parameters for word in ("-p", parameter)]
        command = (*NODE, "--ros-args", *given)
        process = BoardProcess(command, BOARD, domain, child_environment(domain))
        try:
            if not seen.wait(60.0):
                raise RuntimeError(f"no joint state came:\n{process.tail()}")
            return time.monotonic() - begin
        finally:
            process.stop()


class Helper:
    """A script of this folder in a process of its own.

    It prints ``ready`` once it works, goes on until its input ends, and may end with a line of
    JSON.
    """

    def __init__(self, domain: int, script: str, *arguments: object, **environment: str) -> None:
        self._logs = TemporaryDirectory(prefix="control_board_log_")
        self.process = subprocess.Popen(
            [sys.executable, str(FOLDER / f"{script}.py"), *map(str, arguments)],
            env=child_environment(domain) | {"ROS_LOG_DIR": self._logs.name} | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._name = f"{script} {' '.join(map(str, arguments))}"

    def wait_until_ready(self) -> None:
        """Wait for the line ``ready``.

        Raises:
            RuntimeError: it ended without.
        """
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line == "ready\n":
                return
        raise RuntimeError(f"{self._name} ended with code {self.process.wait()}")

    def result(self) -> dict[str, Any]:
        """Let it end; what it found.

        Raises:
            RuntimeError: it ended without a result.
        """
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        lines = self.process.stdout.read().splitlines()
        if self.process.wait() != 0 or not lines:
            raise RuntimeError(f"{self._name} ended with code {self.process.returncode}")
        return dict(json.loads(lines[-1]))

    def close(self) -> None:
        """End the process, if it still runs: the end of its input tells it to."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        self._logs.cleanup()


@contextmanager
def helper(domain: int, script: str, *arguments: object, **environment: str) -> Iterator[Helper]:
    """A helper that works already, ended with the block."""
    process = Helper(domain, script, *arguments, **environment)
    try:
        process.wait_until_ready()
        yield process
    finally:
        process.close()


def cpu_seconds(pid: int) -> float:
    """User and system time that a process has used, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_megabytes(pid: int) -> float:
    """Resident memory of a process, MB (10⁶ bytes)."""
    for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) * 1024 / 1e6
    raise RuntimeError(f"no memory of process {pid}")


def cpu_share(pids: Sequence[int], seconds: float) -> float:
    """The part of one core that processes use together over some time, percent."""
    begin, used = time.monotonic(), sum(map(cpu_seconds, pids))
    time.sleep(seconds)
    return 100.0 * (sum(map(cpu_seconds, pids)) - used) / (time.monotonic() - begin)
