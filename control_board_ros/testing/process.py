# SPDX-License-Identifier: Apache-2.0
"""A board in a separate process, for a test."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.terms.modes import INITIAL
from ..interface import GET_CONTROL_MODE, MODES, SET_CONTROL_MODE, Endpoint
from ..whole_file import yaml_line
from .domains import child_environment, free_domain
from .nodes import ros_node

# s; timeouts for the busiest machine: 5 s and 2 s on an idle one.
START_TIMEOUT, STOP_TIMEOUT = 120.0, 60.0


class BoardProcess:
    """A running board.

    Attributes: name (of the node, absolute: ``/control_board``), domain (its ROS_DOMAIN_ID),
    process (the subprocess.Popen), environment (of the process; for other processes that connect
    to the board).
    """

    def __init__(
        self, command: Sequence[str], name: str, domain: int, environment: Mapping[str, str]
    ) -> None:
        self.name, self.domain = name, domain
        self.environment = dict(environment)
        self._lines: list[str] = []
        self._printed = threading.Condition()
        self.process = subprocess.Popen(
            command,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, name="board output", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._printed:
                self._lines.append(line)
                self._printed.notify_all()
        with self._printed:
            self._printed.notify_all()

    @property
    def output(self) -> str:
        """The output of the process so far, stdout and stderr."""
        with self._printed:
            return "".join(self._lines)

    def wait_for_output(self, text: str, timeout: float = 60.0) -> str:
        """Wait until a line holds this text; return the line.

        Raises:
            AssertionError: no such line within the timeout (s).
        """

        def find_line() -> str | None:
            return next((line for line in self._lines if text in line), None)

        with self._printed:
            self._printed.wait_for(lambda: find_line() or not self._reader.is_alive(), timeout)
            line = find_line()
        assert line is not None, f"no line with {text!r} in {timeout:g} s:\n{self.tail()}"
        return line

    def tail(self, lines: int = 120) -> str:
        with self._printed:
            return "".join(self._lines[-lines:])

    def stop(self, number: int = signal.SIGTERM, timeout: float = STOP_TIMEOUT) -> int:
        """Send the signal, wait for the end, return the exit code.

        After the timeout SIGABRT, so that it prints where each thread stands; then SIGKILL.
        """
        for signum, patience in ((number, timeout), (signal.SIGABRT, 5.0), (signal.SIGKILL, None)):
            if self.process.poll() is None:
                self.process.send_signal(signum)
            try:
                self.process.wait(patience)
                break
            except subprocess.TimeoutExpired:
                continue
        self._reader.join(timeout=5.0)
        if self.process.stdout is not None and not self._reader.is_alive():
            self.process.stdout.close()
        return self.process.returncode


@contextlib.contextmanager
def board_process(
    params: Mapping[str, Any] | None = None,
    *,
    config: str | Path | None = None,
    name: str = "control_board",
    namespace: str = "",
    robot: str = "",
    arguments: Sequence[str] = (),
    env: Mapping[str, str] | None = None,
    domain: int | None = None,
    command: Sequence[str] | None = None,
    configured: bool | None = None,
    start_timeout: float = START_TIMEOUT,
    exit_code: int = 0,
) -> Iterator[BoardProcess]:
    """Start a board, wait until it answers, and stop it when the block ends.

    Args:
        params: Parameters by name; nested dictionaries are joined with dots.
        config: A parameter file, given before ``params``.
        name: Of the node.
        namespace: Of the node.
        robot: Of a robot of several parts, its ``robot_name``: what it yields has the name of
            the robot's own node, ``/icub/robot``, and ``name`` is unused.
        arguments: Further command-line arguments, unchanged.
        env: Variables to set for the process, beside those of a test.
        domain: ROS_DOMAIN_ID; None: a free one.
        command: Command in place of the board, before the arguments (a custom node).
        configured: Whether to wait until no joint is NOT_CONFIGURED; None: unless ``params``
            has ``autoconfigure: False`` or, of a managed node, ``autostart: False``.
        start_timeout: s.
        exit_code: Required exit code.

    Raises:
        AssertionError: the board ended early, did not answer in time, or returned another
            exit code; with its output.
    """
    params = flatten(params or {})
    if configured is None:
        waits = "autostart" if params.get("lifecycle") else "autoconfigure"
        configured = params.get(waits, True) is not False
    with contextlib.ExitStack() as stack:
        if domain is None:
            domain = stack.enter_context(free_domain())
        logs = stack.enter_context(tempfile.TemporaryDirectory(prefix="control_board_log_"))
        environment = child_environment(domain) | {"ROS_LOG_DIR": logs} | dict(env or {})
        inner = f"{robot}/robot" if robot else name
        full = f"/{namespace.strip('/')}/{inner}".replace("//", "/")
        program = command or (sys.executable, "-m", "control_board_ros.node.main")
        renamed = [] if robot else ["-r", f"__node:={name}"]
        settings = ros_arguments(params, config=config, namespace=namespace)
        line = [*program, *arguments, "--ros-args", *renamed, *settings]
        board = BoardProcess(line, full, domain, environment)
        try:
            _wait_until_ready(board, configured, start_timeout)
            yield board
        except BaseException as error:
            board.stop()
            error.add_note(f"--- the board printed:\n{board.tail()}")
            raise
        code = board.stop()
        assert code == exit_code, f"the board returned {code}, not {exit_code}:\n{board.tail()}"


def ros_arguments(
    params: Mapping[str, Any], *, config: str | Path | None, namespace: str
) -> list[str]:
    """Arguments after --ros-args for parameters by their full names, a file, a namespace."""
    line = ["-r", f"__ns:=/{namespace.strip('/')}"] if namespace else []
    if config is not None:
        line += ["--params-file", str(config)]
    for key, value in params.items():
        line += ["-p", f"{key}:={yaml_line(value)}"]
    return line


def _wait_until_ready(board: BoardProcess, configured: bool, timeout: float) -> None:
    """Wait for the latched modes and the services, by the graph of a separate node."""
    ready = threading.Event()

    def on_modes(modes: Any) -> None:
        if not (configured and INITIAL.code in modes.control_modes):
            ready.set()

    def name_of(endpoint: Endpoint) -> str:
        return endpoint.name.replace("~", board.name)

    deadline = time.monotonic() + timeout
    with ros_node(board.domain, "wait_until_ready") as node:
        node.create_subscription(MODES.load(), name_of(MODES), on_modes, MODES.qos.profile())
        clients = [
            node.create_client(service.load(), name_of(service))
            for service in (GET_CONTROL_MODE, SET_CONTROL_MODE)
        ]
        while not (ready.wait(0.02) and all(c.service_is_ready() for c in clients)):
            if board.process.poll() is not None:
                raise AssertionError(f"the board ended with code {board.process.returncode}")
            if time.monotonic() > deadline:
                raise AssertionError(f"no answer from {board.name} within {timeout:g} s")


def flatten(params: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested parameters as flat ones: ``{"a": {"b": 1}}`` gives ``{"a.b": 1}``."""
    flat: dict[str, Any] = {}
    for key, value in params.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[prefix + key] = value
    return flat
