# SPDX-License-Identifier: Apache-2.0
"""One robot of two parts per module, on ideal physics; tests put it back to rest themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from robots import LOWER, UPPER
from talk import Talker, talking_to

from control_board_ros.testing import BoardProcess, board_process

PARAMS: dict[str, Any] = {
    "robot": "iiwa",
    "robot_name": "pair",
    "parts": {"upper": UPPER, "lower": LOWER},
    "physics": "ideal",
    "allow_fault_injection": True,
    "control_rate": 250.0,
}


@pytest.fixture(scope="module")
def board() -> Iterator[BoardProcess]:
    """The module's robot."""
    with board_process(PARAMS, robot="pair") as process:
        yield process


@pytest.fixture(scope="module")
def peers(board: BoardProcess) -> Iterator[dict[str, Talker]]:
    """Talkers to the robot and to each part."""
    with (
        talking_to(board) as robot,
        talking_to(board, "talker_upper", "/pair/upper") as upper,
        talking_to(board, "talker_lower", "/pair/lower") as lower,
    ):
        yield {"robot": robot, "upper": upper, "lower": lower}


@pytest.fixture
def talkers(peers: dict[str, Talker]) -> dict[str, Talker]:
    """The module's talkers, with the robot at rest."""
    peers["robot"].rest()
    return peers
