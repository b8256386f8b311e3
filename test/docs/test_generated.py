# SPDX-License-Identifier: Apache-2.0
"""The generated pages: fresh, and whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from documents import ROOT

from control_board_ros.settings.schema import BOARD, JOINT


def generate(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "docs/generate.py", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_pages_say_what_the_program_does() -> None:
    done = generate("--check")
    assert done.returncode == 0, f"{done.stdout}{done.stderr}run: make docs"


def test_a_stale_page_is_found(tmp_path: Path) -> None:
    """The check compares: it fails on a page that says something else."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import generate
    finally:
        sys.path.remove(str(ROOT / "docs"))
    page = tmp_path / "page.md"
    assert generate.stale({page: "new"}) == [page]
    page.write_text("old")
    assert generate.stale({page: "new"}) == [page]
    page.write_text("new")
    assert generate.stale({page: "new"}) == []


def test_every_parameter_has_its_row() -> None:
    text = (ROOT / "docs" / "parameters.md").read_text("utf-8")
    for row in BOARD:
        assert f"| `{row.name}` |" in text
    for row in JOINT:
        assert f"| `<joint>.{row.name}` |" in text


def test_every_definition_has_its_section() -> None:
    text = (ROOT / "docs" / "interface.md").read_text("utf-8")
    for kind in ("msg", "srv", "action"):
        for path in (ROOT / "msg_defs" / kind).iterdir():
            assert f"\n### {path.name}\n" in text
            for line in path.read_text("utf-8").splitlines():
                if line and not line.startswith("#") and line != "---":
                    assert f"| `{line.split()[1]}` | `{line.split()[0]}` |" in text
