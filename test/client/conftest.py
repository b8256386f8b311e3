# SPDX-License-Identifier: Apache-2.0
"""A real board per module, and clients of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import board_fixtures
import pytest
from talk import patient
from waiting import until

from control_board_ros.client import ControlBoardClient
from control_board_ros.testing import BoardProcess, ros_node

board, params = board_fixtures.board, board_fixtures.params


@pytest.fixture(scope="module")
def node(board: BoardProcess) -> Iterator[Any]:
    """A node that is not spun: the client does without."""
    with ros_node(board.domain, "user", spin=False) as node:
        yield node


@pytest.fixture(scope="module")
def shared(board: BoardProcess, node: Any) -> Iterator[ControlBoardClient]:
    """One client for the module."""
    with patient(node, board.name) as client:
        yield client


@pytest.fixture
def client(shared: ControlBoardClient) -> ControlBoardClient:
    """The client, with the board at its initial pose in POSITION and STIFF."""
    assert shared.pause(False)
    assert shared.clear_injected_faults()
    assert shared.reset()
    until(  # a cycle configures it
        lambda: all(mode.code == "pos" for mode in shared.get_control_mode()), shared.get_faults
    )
    return shared
