# SPDX-License-Identifier: Apache-2.0
"""The pages: what they tell to type works and prints what they say; nothing is unmarked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from documents import ROOT, RUN, Block, Reader, blocks, pattern, reader

from control_board_ros.settings.loading import load

__all__ = ["reader"]

PAGES = [
    ROOT / "README.md",
    ROOT / "docs" / "tour.md",
    *sorted((ROOT / "docs" / "howto").glob("*.md")),
]
#: Languages of blocks that people type, run or save.
TYPED = {"console", "sh", "bash", "python", "toml", "xml", "yaml"}
VERBS = {*RUN, "output", "file", "package", "part", "not"}
#: Blocks that no test runs, each with its reason beside it: fewer with time, never more.
NOT_RUN = 15
#: The pages with something to run.
FOLLOWED = [
    page
    for page in PAGES
    if any(block.verb in {*RUN, "part"} for block in blocks(page.read_text("utf-8")))
]


#: Pages that need the extra icub.
NEED_ICUB = ("couplings", "whole_robot")


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.parametrize("page", FOLLOWED, ids=[page.stem for page in FOLLOWED])
def test_what_a_page_tells_to_do_works(page: Path, reader: Reader) -> None:
    if page.stem in NEED_ICUB:
        pytest.importorskip("icub_models", reason="extra icub")
    reader.follow(page)
    if page.stem == "identify":
        is_identified(reader.folder, "lbr_iiwa_joint_6.motor.torque_constant")


def is_identified(folder: Path, name: str) -> None:
    """G3: what a board's own recording says is what its file has."""
    found = load(folder / "found.yaml").values[name]
    assert found == pytest.approx(load("iiwa").values[name], rel=0.05)
    assert "<html" in (folder / "found.html").read_text("utf-8")


def test_there_are_pages_to_follow() -> None:
    assert ROOT / "README.md" in FOLLOWED


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_is_run_or_says_why_not(page: Path) -> None:
    text = page.read_text("utf-8")
    for block in blocks(text):
        if block.language in TYPED or block.mark:
            assert block.verb in VERBS, f"{page.name}, line {block.line}: {block.mark!r}"
        unused = [part for part in block.varies if part not in block.text + output_of(block, text)]
        assert not unused, f"{page.name}, line {block.line}: nothing says {unused}"
        if block.verb == "not":
            assert block.mark.startswith("not run: "), f"{page.name}, line {block.line}"


def test_blocks_that_are_not_run_become_fewer() -> None:
    left = [
        f"{page.name}:{block.line}: {block.mark}"
        for page in PAGES
        for block in blocks(page.read_text("utf-8"))
        if block.verb == "not"
    ]
    assert len(left) == NOT_RUN, "\n".join(left)


def output_of(script: Block, text: str) -> str:
    """What a page says that a script prints; empty where it says nothing."""
    after = [block for block in blocks(text) if block.line > script.line][:1]
    return "".join(block.text for block in after if block.verb == "output")


def test_only_the_numbers_named_may_differ() -> None:
    made = pattern("a 4.1 s ago\n...\nb 7\n", ["4.1 s"])
    assert re.fullmatch(made, "a 12 s ago\nx\ny\nb 7\n")
    assert re.fullmatch(made, "a 4.1 s ago\nb 7\n")
    assert not re.fullmatch(made, "a 4.1 s ago\nb 8\n")
    assert not re.fullmatch(made, "c 4.1 s ago\nb 7\n")
    unit = pattern("joint   -7.5°  ├─●──┤  3\n", ["°"])
    assert re.fullmatch(unit, "joint 12.0° ├──●─┤ 3\n")
    assert not re.fullmatch(unit, "joint 12.0° ├──●─┤ 4\n")
