# SPDX-License-Identifier: Apache-2.0
"""How tests name rules, and that no test of a rule has been lost."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from rules import RULES, TESTS, proved_by

SPEC = Path(__file__).resolve().parents[2] / "docs" / "spec.md"


def test_docstrings_name_rules() -> None:
    assert proved_by("M4: text") == ["M4"]
    assert proved_by("M4, P13, A: text") == ["M4", "P13", "A"]
    assert proved_by("E1, F3, R: text") == ["F3"]
    assert proved_by("A joint does it.") == []
    assert proved_by("nothing") == []
    assert proved_by(None) == []
    with pytest.raises(ValueError, match="rule M99 unknown"):
        proved_by("M99: text")


def test_every_rule_has_a_test() -> None:
    """Without running them: their docstrings name each rule at least once."""
    named = set()
    folder, codes = TESTS
    for path in (*folder.glob("test_*.py"), codes):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                named.update(proved_by(ast.get_docstring(node)))
    assert named == set(RULES)


def test_every_rule_of_the_page_is_checked_from_outside_or_gives_a_reason() -> None:
    """docs/spec.md has an anchor for each, and one of its headings is about A."""
    anchors = re.findall(r'<a id="([vmpifknd]\d+|y[1-5])">', SPEC.read_text(encoding="utf-8"))
    assert sorted(anchors) == sorted(rule.lower() for rule in RULES if rule != "A")
