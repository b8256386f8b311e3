# SPDX-License-Identifier: Apache-2.0
"""cbctl as people run it: the executable, in a process of its own."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: s; a guard against what hangs, on the busiest machine: no test is decided by it.
GUARD = 120.0
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
    """Runs cbctl in an environment."""

    def __init__(self, environment: dict[str, str]) -> None:
        self.environment = environment | {"COLUMNS": "120"}

    def command(self, *words: str) -> list[str]:
        """The whole command line; it has the guard's time to find the board."""
        patient = [] if "--timeout" in words else ["--timeout", f"{GUARD / 2.0:g}"]
        return [*COMMAND, *patient, *words]

    def __call__(self, *words: str, text: str | None = None) -> Result:
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

    def start(self, *words: str, **how: Any) -> subprocess.Popen[str]:
        """Start it and let it run."""
        return subprocess.Popen(
            self.command(*words),
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **how,
        )


class Shell:
    """One ``cbctl shell`` that answers in JSON; quicker than a process for every question."""

    def __init__(self, cbctl: Cbctl) -> None:
        self._process = cbctl.start("shell", stdin=subprocess.PIPE)

    def __call__(self, *words: str) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(shlex.join([*words, "--json"]) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def mode(self, *words: str) -> None:
        """Set a mode."""
        assert self("mode", *words)["success"] is True

    def close(self) -> None:
        """End it."""
        self._process.communicate(timeout=GUARD)


def until(condition: Callable[[], bool], timeout: float = GUARD) -> None:
    """Ask again and again until it holds."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "it did not come to pass"
