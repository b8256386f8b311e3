# SPDX-License-Identifier: Apache-2.0
"""The site: its links are checked, and what leads out of docs/ is no link in it."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest
from documents import ROOT
from processes import ended


@pytest.fixture
def build(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs" / "site")
    import build

    return build


def test_links_that_lead_nowhere_are_found(build: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "a.css").touch()
    (tmp_path / "b.html").write_text('<p id="here">')
    page = tmp_path / "a.html"
    page.write_text(
        '<link href="a.css"><a href="b.html#here"><a href="https://example.org/x">'
        '<a href="../9.9/index.html"><a id="own" href="#own">'
    )
    assert build.broken(tmp_path) == []
    page.write_text('<img src="c.png"><a href="b.html#there"><a href="#other">')
    assert build.broken(tmp_path) == [
        "a.html: #other",
        "a.html: b.html#there",
        "a.html: c.png",
    ]


def test_versions_are_sorted_as_numbers(build: ModuleType) -> None:
    assert sorted(["0.10.0", "0.9.1", "1.0.0"], key=build.by_number)[0] == "0.9.1"


@pytest.mark.slow
@pytest.mark.skipif(
    not all(map(find_spec, ("sphinx", "furo", "myst_parser"))), reason="the extra site"
)
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """With search, versions, and the API from the docstrings."""
    done = ended(sys.executable, "docs/site/build.py", tmp_path, cwd=ROOT, timeout=290)
    assert done.stderr == ""
    (version,) = (path.parent for path in tmp_path.glob("*/index.html"))
    assert (version / "search.html").is_file()
    assert "position_move" in (version / "api" / "client.html").read_text("utf-8")
    assert f"{version.name}/index.html" in (tmp_path / "index.html").read_text("utf-8")
