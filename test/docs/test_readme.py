# SPDX-License-Identifier: Apache-2.0
"""What README shows is there; the tables at a glance name what there is, and all of it."""

from __future__ import annotations

import re

import interface_table
import pytest
from documents import ROOT

from control_board_ros.cli.verbs import VERBS
from control_board_ros.client import ControlBoardClient

README = (ROOT / "README.md").read_text("utf-8")
TEXT = (ROOT / "docs" / "at_a_glance.md").read_text("utf-8")
TABLES = (
    interface_table.PUBLISHED,
    interface_table.CLOCK,
    interface_table.SUBSCRIBED,
    interface_table.SERVICES,
    interface_table.ACTIONS,
)
NAMES = {name for table in TABLES for name in table}


def section(title: str) -> str:
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def cells(title: str) -> list[list[str]]:
    """The rows of a section's table, without its head."""
    lines = [line for line in section(title).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_every_name_on_ros_is_on_the_page_of_the_interface() -> None:
    text = (ROOT / "docs" / "interface.md").read_text("utf-8")
    assert not [name for name in NAMES if f"- `{name}`, " not in text]


@pytest.mark.parametrize("row", cells("From YARP"), ids=lambda row: row[0].strip("`")[:20])
def test_the_yarp_table_names_what_there_is(row: list[str]) -> None:
    _, ros, python, line = row
    found = re.findall(r"`([^`]+)`", ros)
    assert found
    assert set(found) <= NAMES
    for call in re.findall(r"`(\w+)\(", python):
        assert hasattr(ControlBoardClient, call)
    assert line.strip("`").split()[0] in VERBS


def test_readme_is_one_screen() -> None:
    """What more there is to say stands in docs/."""
    assert len(README.splitlines()) <= 100
    performance = README.split("<!-- performance -->")[1].split("<!-- /performance -->")[0]
    assert len([line for line in performance.splitlines() if line.startswith("|")]) == 2 + 5


def test_readme_names_the_commands_of_the_makefile() -> None:
    """The two commands that it shows are targets, and `make test` is what CI runs."""
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for target in ("run", "test"):
        assert f"\nmake {target} " in README
        assert f"\n{target}: " in makefile
    assert '\nstep "make test"\n' in (ROOT / ".ci" / "run").read_text("utf-8")


def test_the_picture_moves_and_loads_at_once() -> None:
    """docs/moving_picture.py records it."""
    image = pytest.importorskip("PIL.Image", reason="comes with matplotlib")
    path = ROOT / "docs" / "images" / "board.gif"
    assert f"](docs/images/{path.name})" in README
    assert path.stat().st_size <= 2_000_000
    with image.open(path) as picture:
        assert picture.n_frames >= 20
