# SPDX-License-Identifier: Apache-2.0
"""cbctl as people run it: the executable, against a real board."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from control_board_ros.testing import BoardProcess, board_process, child_environment, free_domain

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
        """The whole command line."""
        return [*COMMAND, *words]

    def __call__(self, *words: str, text: str | None = None) -> Result:
        done = subprocess.run(
            self.command(*words),
            env=self.environment,
            input=text,
            stdin=subprocess.DEVNULL if text is None else None,
            capture_output=True,
            text=True,
            timeout=50,
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


@pytest.fixture(scope="module")
def process() -> Iterator[BoardProcess]:
    """The iiwa, with fault injection."""
    with board_process({"allow_fault_injection": True}) as board:
        yield board


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
        self._process.communicate(timeout=20)


@pytest.fixture(scope="module")
def cbctl(process: BoardProcess) -> Cbctl:
    """Cbctl on the domain of the board."""
    return Cbctl(process.environment)


@pytest.fixture(scope="module")
def shell(cbctl: Cbctl) -> Iterator[Shell]:
    """A shell for the module."""
    shell = Shell(cbctl)
    yield shell
    shell.close()


@pytest.fixture
def ask(shell: Shell) -> Shell:
    """The shell, with the board put back to its start."""
    for words in (["resume"], ["inject", "--clear"], ["reset"]):
        assert shell(*words)["success"] is True
    while any(row["control_mode"] != "pos" for row in shell("modes").values()):
        pass  # the next cycle configures it
    return shell


@pytest.fixture(scope="module")
def alone() -> Iterator[Cbctl]:
    """The command where there is no board."""
    with free_domain() as domain:
        yield Cbctl(child_environment(domain))
