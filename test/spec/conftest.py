# SPDX-License-Identifier: Apache-2.0
"""The rig of the rule tests."""

from __future__ import annotations

import profiles
import pytest
import rig as rigs
from bad_wire import WIRES
from rig import Rig, ready

profiles.choose()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--wire", choices=list(WIRES), help="run the rules' boards behind a bad wire")


def pytest_configure(config: pytest.Config) -> None:
    rigs.WIRE.update(WIRES.get(config.getoption("--wire", None) or "", {}))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Behind a wire, what is so only with fresh readings is not tried."""
    for item in items:
        marker = item.get_closest_marker("fresh")
        if rigs.WIRE and marker:
            item.add_marker(pytest.mark.skip(reason=f"with fresh readings only: {marker.args[0]}"))


@pytest.fixture
def rig() -> Rig:
    """Left, right (all modes) and bare (no torque sensor) on the ideal plant, in IDLE."""
    return ready()
