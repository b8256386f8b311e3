# SPDX-License-Identifier: Apache-2.0
"""The record of the benchmarks and the pages made from it."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmark"


@pytest.fixture
def report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    """The module, writing to a folder of the test."""
    monkeypatch.syspath_prepend(str(FOLDER))
    import report as module

    for name in ("PAGE", "README"):
        monkeypatch.setattr(module, name, tmp_path / f"{name}.md")
    yield module
    for name in ("report", "common"):
        del sys.modules[name]


def figure(report: Any, value: float, case: str = "a case") -> Any:
    """A figure as a benchmark gives it."""
    return report.Figure("B1", case, value, "×")


def test_record_keeps_earlier_entries(report: Any, tmp_path: Path) -> None:
    """The page shows the new figure beside the one recorded before."""
    path = tmp_path / "results.json"
    report.remember([figure(report, 2.5)], path)
    record = report.remember([figure(report, 2.75)], path)
    assert record["figures"]["B1 a case"]["previous"]["value"] == 2.5
    row = report.full_table(record).splitlines()[-1]
    assert "2.75 ×" in row
    assert "2.50 ×" in row


def missed(report: Any) -> Any:
    """A figure that does not reach its goal."""
    return report.Figure("B1", "a goal", 2.0, "×", goal=sys.modules["common"].at_most(1.0))


def test_the_page_has_what_is_missed(report: Any, tmp_path: Path) -> None:
    other = figure(report, 2.5, "another")
    record = report.remember([missed(report), other], tmp_path / "results.json")
    text = report.page_table(record)
    assert "0 of 1 goals" in text
    assert "2.00 ×" in text
    assert "another" not in text


def test_record_forgets_cases_that_are_gone(report: Any, tmp_path: Path) -> None:
    """A case that its benchmark no longer measures leaves the record, other groups stay."""
    path = tmp_path / "results.json"
    other = report.Figure("B2", "other", 1.0, "×")
    report.remember([figure(report, 2.5, "old"), other], path)
    text = path.read_text(encoding="utf-8").replace("UTC", "before")
    path.write_text(text, encoding="utf-8")
    record = report.remember([figure(report, 2.5, "new")], path)
    assert list(record["figures"]) == ["B1 new", "B2 other"]


def test_pages_keep_handwritten_text(report: Any, tmp_path: Path) -> None:
    """Only the text between the markers is written anew; README without markers stays."""
    record = report.remember([missed(report)], tmp_path / "results.json")
    report.PAGE.write_text(f"mine\n{report.BEGIN}\nold\n{report.END}\nmine too\n")
    report.README.write_text("no markers\n")
    report.write_pages(record)
    page = report.PAGE.read_text(encoding="utf-8")
    assert page.startswith("mine\n")
    assert page.endswith("mine too\n")
    assert "\nold\n" not in page
    assert "2.00 ×" in page
    assert report.README.read_text(encoding="utf-8") == "no markers\n"


def test_readme_shows_five_figures_of_the_record(report: Any) -> None:
    """Each is measured under the name that README asks for."""
    record = json.loads(report.RECORD.read_text(encoding="utf-8"))
    rows = report.short_table(record).splitlines()
    assert len([row for row in rows if row.startswith("|")]) == 2 + len(report.SHORT) == 2 + 5


def test_a_missing_page_is_created(report: Any, tmp_path: Path) -> None:
    """The first run writes docs/performance.md with its introduction and the table."""
    record = report.remember([missed(report)], tmp_path / "results.json")
    report.write_pages(record)
    assert "2.00 ×" in report.PAGE.read_text(encoding="utf-8")
