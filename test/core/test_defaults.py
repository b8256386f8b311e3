# SPDX-License-Identifier: Apache-2.0
"""Every default, bound, unit and text of a parameter is the one that docs/parameters.md tells."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_page_tells_what_is_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """A default that changes changes the page: ``make docs`` writes it, and a review sees it."""
    monkeypatch.syspath_prepend(str(DOCS))
    for name in ("parameters_page", "interface_page"):  # of another tree, where there is one
        monkeypatch.delitem(sys.modules, name, raising=False)
    import parameters_page

    told = (DOCS / "parameters.md").read_text(encoding="utf-8")
    assert told.endswith(parameters_page.page())
