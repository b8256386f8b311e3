# SPDX-License-Identifier: Apache-2.0
"""Links of the pages: the files and headings that they name are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from documents import ROOT

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.M | re.S)
ANCHOR = re.compile(r'<a id="([^"]+)">')
HEADING = re.compile(r"^#+ +(.+)$", re.M)


def anchors(page: Path) -> set[str]:
    """What GitHub makes of the headings of a page, and the anchors that it has itself."""
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
    return {
        re.sub(r"[^\w\- ]", "", title.strip().lower()).replace(" ", "-")
        for title in HEADING.findall(text)
    } | set(ANCHOR.findall(text))


def links(page: Path) -> list[str]:
    """What the links of a page lead to, those to other sites aside."""
    found = LINK.findall(CODE.sub("", page.read_text("utf-8")))
    return [link for link in found if not link.startswith(("http://", "https://"))]


@pytest.mark.parametrize(
    "page", list(filter(links, PAGES)), ids=lambda page: str(page.relative_to(ROOT))
)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.is_relative_to(ROOT), f"{link} leaves the project"
        assert target.exists(), f"{link}: no such file"
        if anchor:
            assert anchor in anchors(target), f"{link}: no such heading"


def test_links_are_found() -> None:
    """Or the test above would look at nothing."""
    assert "config" in links(ROOT / "README.md")


def test_no_page_holds_a_path_of_one_machine() -> None:
    for page in PAGES:
        assert not re.search(r"/(?:home|root|work|Users)/\w", page.read_text("utf-8")), page


def test_every_page_is_in_the_menu_of_the_site() -> None:
    """A toctree of docs/index.md names it; those of how-tos and decisions take all."""
    text = (ROOT / "docs" / "index.md").read_text("utf-8")
    menus = "".join(re.findall(r"^```\{toctree\}$(.*?)^```$", text, re.M | re.S)).split()
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")} - {"index"}
    assert not pages - set(menus)


def test_every_page_is_in_an_index() -> None:
    """docs/index.md leads to each page and how-to, its own index to each decision."""
    for index in ("docs/index.md", "docs/decisions/index.md"):
        page = ROOT / index
        there = {(page.parent / link).resolve() for link in links(page)}
        folders = [page.parent, *page.parent.glob("howto")]
        missing = [p for folder in folders for p in folder.glob("*.md") if p not in there | {page}]
        assert not missing, f"{index} does not lead to {missing[0].relative_to(ROOT)}"
