# SPDX-License-Identifier: Apache-2.0
"""Clients: of a simulation in this process, also through the node's wiring; of a real board."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import board_fixtures
import pytest
from talk import patient
from waiting import until
from wired import wired

from control_board_ros.client import ControlBoardClient, connect
from control_board_ros.simulation import Simulation
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


@pytest.fixture(scope="module")
def local() -> Iterator[ControlBoardClient]:
    """One client of a simulation for the module."""
    with Simulation.load("iiwa") as simulation, connect(simulation) as client:
        yield client


@pytest.fixture(scope="module")
def through_wiring() -> Iterator[ControlBoardClient]:
    """One client of a simulation, through the node's wiring, for the module."""
    with Simulation.load("iiwa") as simulation, wired(simulation) as client:
        yield client


@pytest.fixture(
    params=[
        "local",
        "through_wiring",
        pytest.param("shared", marks=[pytest.mark.slow, pytest.mark.ros]),
    ]
)
def client(request: pytest.FixtureRequest) -> ControlBoardClient:
    """A client over each transport; its board at its initial pose, in POSITION and STIFF."""
    return rested(request.getfixturevalue(request.param))


@pytest.fixture
def ros_client(shared: ControlBoardClient) -> ControlBoardClient:
    """The client over ROS, its board likewise."""
    return rested(shared)


def rested(client: ControlBoardClient) -> ControlBoardClient:
    assert client.pause(False)
    assert client.clear_injected_faults()
    assert client.reset()
    until(  # a cycle configures it
        lambda: all(mode.code == "pos" for mode in client.get_control_mode()), client.get_faults
    )
    return client
