# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the rule tests: ``board`` is the board in process, then the same over ROS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import profiles
import pytest
from adapter import CONFIG, InProcess, OverRos
from rig import Rig, ready

profiles.choose()


@pytest.fixture
def rig() -> Rig:
    """Left, right (all modes) and bare (no torque sensor) on the ideal plant, in IDLE."""
    return ready()


@pytest.fixture(scope="session")
def ros_board() -> Iterator[OverRos]:
    """A client of a board of the same configuration, one for all tests."""
    from control_board_ros.client import ControlBoardClient
    from control_board_ros.testing import board_process, ros_node

    fast = {"real_time_factor": 0.0}  # states are then stamped with simulated time
    with (
        board_process(fast, config=CONFIG) as process,
        ros_node(process.domain) as node,
        ControlBoardClient(node, process.name, find_timeout=60.0, answer_timeout=60.0) as client,
    ):
        adapter = OverRos(client)
        adapter.start()
        yield adapter


@pytest.fixture(params=["in_process", pytest.param("ros", marks=pytest.mark.ros)])
def board(request: pytest.FixtureRequest) -> Any:
    """The board of ``arm.yaml``, all joints in IDLE at 0; see adapter.py."""
    if request.param == "in_process":
        return InProcess()
    adapter: OverRos = request.getfixturevalue("ros_board")
    adapter.restart()
    return adapter
