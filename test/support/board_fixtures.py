# SPDX-License-Identifier: Apache-2.0
"""One board process per module; tests put it back to rest themselves. Imported by conftest.py."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from talk import Talker, talking_to

from control_board_ros.testing import BoardProcess, board_process


@pytest.fixture(scope="module")
def params() -> dict[str, Any]:
    """Parameters of the module's board; a module overrides this to change them."""
    return {"allow_fault_injection": True, "control_rate": 250.0}


@pytest.fixture(scope="module")
def board(params: dict[str, Any]) -> Iterator[BoardProcess]:
    """The module's board; it must end with code 0 and without a traceback."""
    with board_process(params) as process:
        yield process
        assert process.process.poll() is None, process.tail()
        assert "internal error" not in process.output
    assert "Traceback" not in process.output


@pytest.fixture(scope="module")
def peer(board: BoardProcess) -> Iterator[Talker]:
    """A talker that lives as long as the module's board."""
    with talking_to(board) as talker:
        yield talker


@pytest.fixture
def talker(peer: Talker) -> Talker:
    """The module's talker, with the board at rest."""
    peer.rest()
    return peer
