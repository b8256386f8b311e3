# SPDX-License-Identifier: Apache-2.0
"""The generated pages: fresh, and whole."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from documents import ROOT

from control_board_ros.settings.schema import BOARD, JOINT


@pytest.fixture
def generate(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    import generate

    return generate


def test_pages_say_what_the_program_does(
    generate: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    code = generate.main(["--check"])
    assert code == 0, f"{capsys.readouterr().out}run: make docs"


def test_a_stale_page_is_found(generate: ModuleType, tmp_path: Path) -> None:
    """The check compares: it fails on a page that says something else."""
    page = tmp_path / "page.md"
    assert generate.stale({page: "new"}) == [page]
    page.write_text("old")
    assert generate.stale({page: "new"}) == [page]
    page.write_text("new")
    assert generate.stale({page: "new"}) == []


def test_every_parameter_has_its_row(generate: ModuleType) -> None:
    """On the page with its default and meaning, on the site's with all."""
    import parameters_page

    text, full = parameters_page.page(), parameters_page.full()
    for row in BOARD:
        assert f"`{row.name}`" in text
        assert f"| `{row.name}` |" in full
    for row in JOINT:
        loop, _, name = row.name.partition(".")
        shown = f"`{loop}`" if loop in parameters_page.LOOPS else f"`{row.name}`"
        assert shown in text
        assert f"`{name or loop}`" in text or shown == f"`{row.name}`"
        assert f"| `<joint>.{row.name}` |" in full


def test_every_definition_has_its_section(generate: ModuleType) -> None:
    """The page of names leads to its file, the site's has its fields."""
    import interface_page

    page, fields = interface_page.page(), interface_page.fields()
    parts = {"Request", "JointFault"}  # of other messages
    for kind in ("msg", "srv", "action"):
        for path in (ROOT / "msg_defs" / kind).iterdir():
            assert f"(../msg_defs/{kind}/{path.name})" in page or path.stem in parts
            assert f"\n## {path.name}\n" in fields
            for line in path.read_text("utf-8").splitlines():
                if line and not line.startswith("#") and line != "---":
                    assert f"| `{line.split()[1]}` | `{line.split()[0]}` |" in fields
