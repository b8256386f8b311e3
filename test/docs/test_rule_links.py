# SPDX-License-Identifier: Apache-2.0
"""Rules cited in the program and in docs/: each is in docs/spec.md; pages link them."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from pathlib import Path
from types import ModuleType

import pytest
from documents import ROOT

PROGRAM = sorted((ROOT / "control_board_ros").rglob("*.py"))
PAGES = sorted((ROOT / "docs").rglob("*.md"))
PLAIN = [*ROOT.glob("config/*.yaml"), *(path for path in ROOT.glob("msg_defs/*/*"))]
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@pytest.fixture
def rule_links(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    import rule_links

    return rule_links


def prose(source: str) -> str:
    """Comments and docstrings of a module."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    nodes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, DOCUMENTED)]
    return "\n".join([*comments, *(ast.get_docstring(node) or "" for node in nodes)])


def test_every_rule_that_the_program_cites_exists(rule_links: ModuleType) -> None:
    """In whatever form: a section's letter with a number is a rule there."""
    sections = "".join({rule[0] for rule in rule_links.ANCHORS})
    count = 0
    for path in PROGRAM:
        text = prose(path.read_text("utf-8"))
        rules = {*re.findall(rf"\b[{sections}][1-9]\d?\b", text), *rule_links.cited(text)}
        wrong = rules - rule_links.ANCHORS.keys()
        assert not wrong, f"{path.relative_to(ROOT)}: no rule {', '.join(sorted(wrong))}"
        count += len(rules)
    assert count > 300


@pytest.mark.parametrize("path", [*PAGES, *PLAIN], ids=lambda path: str(path.relative_to(ROOT)))
def test_every_rule_that_a_page_cites_exists(rule_links: ModuleType, path: Path) -> None:
    wrong = set(rule_links.cited(path.read_text("utf-8"))) - rule_links.ANCHORS.keys()
    assert not wrong, f"no rule {', '.join(sorted(wrong))}"


def test_wrong_rules_are_found(rule_links: ModuleType) -> None:
    """Or the tests above would look at nothing."""
    source = '"""Text (M99)."""\nx = "(M98)"  # M4, the SPEC X9\n'
    assert prose(source) == "# M4, the SPEC X9\nText (M99)."
    assert rule_links.cited(prose(source)) == ["X9", "M99"]


@pytest.mark.parametrize(
    ("text", "links"),
    [
        ("ignored (M4).", "ignored ([M4](../spec.md#m4))."),
        ("(P1 to P6, I10)", "([P1](../spec.md#p1) to [P6](../spec.md#p6), [I10](../spec.md#i10))"),
        ("SPEC P9,\nP14 says", "SPEC [P9](../spec.md#p9),\n[P14](../spec.md#p14) says"),
        ("(SPEC S1 and S5)", "(SPEC [S1](../spec.md#s1) and [S5](../spec.md#s5))"),
        ("SPEC A and D, over", "SPEC [A](../spec.md#a) and D, over"),
        ("| a | held (M4) |", "| a | held ([M4](../spec.md#m4)) |"),
    ],
)
def test_citations_become_links(rule_links: ModuleType, text: str, links: str) -> None:
    made = rule_links.linked(text, "../spec.md")
    assert made == links
    assert rule_links.linked(made, "../spec.md") == links, "a second run changes nothing"


@pytest.mark.parametrize(
    "text",
    [
        "**B4, B11**: lateness; B2 at 127 joints",
        "(benchmarks B1 and B14)",
        "([performance](performance.md), B1, B14)",
        "M4 screws, an S-curve, E1 in numbers, current (A), force (N)",
        "a span `(M4)` and ``SPEC M4`` of code",
        "```console\n$ test (M4)\n```",
        "[a title (M4)](page.md), ([M4](spec.md#m4))",
        "https://example.org/(M4)",
        "<!-- run (M4) -->",
        "(M4, M99)",
    ],
)
def test_other_texts_are_left_alone(rule_links: ModuleType, text: str) -> None:
    assert rule_links.linked(text, "spec.md") == text


def test_docstrings_get_links_of_their_own_form(rule_links: ModuleType) -> None:
    text = rule_links.linked("Set :meth:`x` (M1, M5).", "../spec.html", rule_links.RST)
    assert text == "Set :meth:`x` (`M1 <../spec.html#m1>`__, `M5 <../spec.html#m5>`__)."
