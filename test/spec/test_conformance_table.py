# SPDX-License-Identifier: Apache-2.0
"""How tests name rules, and that no test of a rule has been lost."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from conformance_sessions import BOARDS
from rules import ALL, RULES, counts, proofs, proved_by

SPEC = Path(__file__).resolve().parents[2] / "docs" / "spec.md"


def test_docstrings_name_rules() -> None:
    assert proved_by("M4: text") == ["M4"]
    assert proved_by("M4, P13, A: text") == ["M4", "P13", "A"]
    assert proved_by("E1, F3: text") == ["E1", "F3"]
    assert proved_by("A joint does it.") == []
    assert proved_by("nothing") == []
    assert proved_by(None) == []
    with pytest.raises(ValueError, match="rule M99 unknown"):
        proved_by("M99: text")


def test_every_rule_has_a_test() -> None:
    """Without running them: their docstrings name each rule at least once."""
    assert {rule for rules in proofs().values() for rule in rules} == set(RULES)


def test_the_record_has_every_rule_and_board() -> None:
    """``make conformance`` has run since one was added."""
    record = json.loads((ALL / "spec" / "conformance.json").read_text(encoding="utf-8"))
    assert set(record["tests"]) == set(RULES)
    assert set(record["boards"]) == set(BOARDS)


def test_a_test_elsewhere_counts_for_a_rule_beyond_the_source() -> None:
    assert counts(ALL / "spec" / "test_laws.py", [])
    assert counts(ALL / "core" / "test_vocabs.py", ["V1"])
    assert counts(ALL / "core" / "test_path.py", ["P1", "T1"])
    assert not counts(ALL / "core" / "test_path.py", ["P1"])


def test_every_rule_of_the_page_is_checked_from_outside_or_gives_a_reason() -> None:
    """docs/spec.md has an anchor for each; all others are tried from outside or say why not."""
    anchors = re.findall(r'<a id="(\w+)">', SPEC.read_text(encoding="utf-8"))
    assert sorted(anchors) == sorted(rule.lower() for rule in RULES)
