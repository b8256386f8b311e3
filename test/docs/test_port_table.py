# SPDX-License-Identifier: Apache-2.0
"""The table of YARP's methods names what the client has (docs/howto/port_icub_script.md)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from control_board_ros.cli.verbs import VERBS
from control_board_ros.client import ControlBoardClient

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "port_icub_script.md"
METHODS = PAGE.read_text().partition("## Every method")[2]
#: Methods that have YARP's name in snake case.
SAME = re.findall(
    r"`([a-z]+[A-Z]\w+)", METHODS.partition("Snake case")[2].partition("All others")[0]
)
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in METHODS.splitlines()
    if line.startswith("| ") and not line.startswith(("| Interface", "|---"))
]


def test_the_table_is_there() -> None:
    """Y5: from modes to calibrators; each row has three cells."""
    assert len(ROWS) + len(SAME) > 75
    assert {len(row) for row in ROWS} == {3}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[2])
def test_each_method_exists(row: list[str]) -> None:
    """A, Y5: what is named is a method of the client; what is not there says why."""
    names = re.findall(r"`(\w+)`", row[2].partition(":")[0])
    assert names or row[2].startswith("—: ")
    for name in names:
        assert callable(getattr(ControlBoardClient, name, None)), name
    verbs = re.findall(r"`cbctl (\w+)`", row[2])
    assert set(verbs) <= VERBS.keys()
    assert row[1]


@pytest.mark.parametrize("name", SAME)
def test_each_method_of_the_same_name_exists(name: str) -> None:
    """YARP's name in snake case is a method of the client."""
    here = re.sub(r"(?<!^)([A-Z])", r"_\1", name).lower()
    assert callable(getattr(ControlBoardClient, here, None)), here
