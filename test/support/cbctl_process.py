# SPDX-License-Identifier: Apache-2.0
"""cbctl as people run it: lines over one connection, or the executable in its own process."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from waiting import GUARD

from control_board_ros.cli import main
from control_board_ros.cli.app import invoke
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import ROS_ARGUMENTS, hoist, read_options

EXECUTABLE = Path(sys.executable).with_name("cbctl")
COMMAND = (
    [str(EXECUTABLE)]
    if EXECUTABLE.exists()  # colcon puts it elsewhere
    else [sys.executable, "-m", "control_board_ros.cli"]
)


@dataclass(frozen=True)
class Result:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """The one JSON document on stdout."""
        return json.loads(self.out)


class Cbctl:
    """Runs cbctl in an environment.

    A call runs a line in this process, over one connection, as ``cbctl shell`` does; a line with
    options of its own gets a connection of its own. ``run`` and ``start`` take the executable:
    for signals, terminals, and to see that it works.

    Args:
        environment: Of its processes.
        options: Of all lines.
    """

    def __init__(self, environment: dict[str, str], *options: str) -> None:
        self.environment, self.options = environment | {"COLUMNS": "120"}, options
        self._session: Session | None = None
        self._started: list[subprocess.Popen[str]] = []

    def line(self, *words: str) -> list[str]:
        """The words of a line; it has the guard's time to find the board."""
        patient = [] if "--timeout" in words else ["--timeout", f"{GUARD / 2.0:g}"]
        return [*patient, *self.options, *words]

    def command(self, *words: str) -> list[str]:
        """The whole command line of a process."""
        return [*COMMAND, *self.line(*words)]

    def __call__(self, *words: str) -> Result:
        own, rest = hoist(words)
        with self._as_a_process() as (out, err):
            if {*own, ROS_ARGUMENTS} & {*rest, *own} <= {"--json"} and rest:
                code = invoke(self._shared(), words)
            else:
                code = main(self.line(*words))
        return Result(code, out.getvalue(), err.getvalue())

    def _shared(self) -> Session:
        """The session of all lines that have no options of their own."""
        if self._session is None:
            self._session = Session(read_options(self.line(), [])[0])
            self._session.shared = True
        return self._session

    def close(self) -> None:
        """End the connection, and what a test that failed has left running."""
        if self._session is not None:
            self._session.close()
        for process in self._started:
            if process.poll() is None:
                process.kill()
                process.communicate()

    @contextlib.contextmanager
    def _as_a_process(self) -> Iterator[tuple[io.StringIO, io.StringIO]]:
        """Give this process the environment and the outputs of another, and no input."""
        out, err = io.StringIO(), io.StringIO()
        handlers = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGHUP)}
        try:
            with (
                mock.patch.dict(os.environ, self.environment, clear=True),
                mock.patch.object(sys, "stdin", io.StringIO()),
                contextlib.redirect_stdout(out),
                contextlib.redirect_stderr(err),
            ):
                yield out, err
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)

    def run(self, *words: str, text: str | None = None) -> Result:
        """Run the executable, and wait for its end."""
        done = subprocess.run(
            self.command(*words),
            env=self.environment,
            input=text,
            stdin=subprocess.DEVNULL if text is None else None,
            capture_output=True,
            text=True,
            timeout=GUARD,
            check=False,
        )
        return Result(done.returncode, done.stdout, done.stderr)

    def start(self, *words: str, **variables: str) -> subprocess.Popen[str]:
        """Start it, with variables of the environment, and let it run."""
        process = subprocess.Popen(
            self.command(*words),
            env=self.environment | variables,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._started.append(process)
        return process


def interrupted(process: subprocess.Popen[str], by: int = signal.SIGINT) -> Result:
    """Send a signal to a command that runs; how it ends."""
    process.send_signal(by)
    out, err = process.communicate(timeout=GUARD)
    return Result(process.returncode, out, err)


class Asker:
    """Asks through cbctl, and reads its JSON."""

    def __init__(self, cbctl: Cbctl) -> None:
        self._cbctl = cbctl

    def __call__(self, *words: str) -> Any:
        return self._cbctl(*words, "--json").json

    def mode(self, *words: str) -> None:
        """Set a mode."""
        assert self("mode", *words)["success"] is True
