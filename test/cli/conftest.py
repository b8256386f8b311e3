# SPDX-License-Identifier: Apache-2.0
"""A board, and cbctl beside it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from cbctl_process import Cbctl, Shell

from control_board_ros.testing import BoardProcess, board_process, child_environment, free_domain


@pytest.fixture(scope="module")
def process() -> Iterator[BoardProcess]:
    """The iiwa, with fault injection."""
    with board_process({"allow_fault_injection": True}) as board:
        yield board


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
