# SPDX-License-Identifier: Apache-2.0
"""The table of YARP's methods names what the client has (docs/howto/port_icub_script.md)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
from control_board_ros.cli.verbs import VERBS
from control_board_ros.client import ControlBoardClient

PAGE = Path(__file__).parents[2] / "docs" / "howto" / "port_icub_script.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.read_text().partition("## Every method")[2].splitlines()
    if line.startswith("| ") and not line.startswith(("| Interface", "|---"))
]


def test_the_table_is_there() -> None:
    """Y5: from modes to calibrators; each row has three cells."""
    assert len(ROWS) > 60
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
