# SPDX-License-Identifier: Apache-2.0
"""A board, and cbctl beside it."""

from __future__ import annotations

from collections.abc import Iterator

import board_fixtures
import pytest
from cbctl_process import Asker, Cbctl
from waiting import until

from control_board_ros.testing import BoardProcess, child_environment, free_domain

board, params = board_fixtures.board, board_fixtures.params


@pytest.fixture(scope="module")
def cbctl(board: BoardProcess) -> Iterator[Cbctl]:
    """Cbctl on the domain of the board."""
    cbctl = Cbctl(board.environment)
    yield cbctl
    cbctl.close()


@pytest.fixture
def ask(cbctl: Cbctl) -> Asker:
    """Questions to the board, which is put back to its start."""
    ask = Asker(cbctl)
    for words in (["resume"], ["inject", "--clear"], ["reset"]):
        assert ask(*words)["success"] is True
    until(lambda: {row["control_mode"] for row in ask("modes").values()} == {"pos"})
    return ask


@pytest.fixture(scope="module")
def alone() -> Iterator[Cbctl]:
    """The command where there is no board."""
    with free_domain() as domain:
        cbctl = Cbctl(child_environment(domain))
        yield cbctl
        cbctl.close()
