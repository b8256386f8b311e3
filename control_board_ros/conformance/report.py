# SPDX-License-Identifier: Apache-2.0
"""Results of the rules: as text, JSON, and JUnit for CI."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from xml.etree import ElementTree

from .runner import MAX_UNTESTED, Outcome, Result, passed


def as_line(result: Result) -> str:
    """One rule as text: ``M10  held          IDLE is unpowered: 0 % in 20 states``."""
    return (
        f"{result.rule.name:<5}{result.outcome:<14}{result.rule.title}: {result.evidence}"
    ).rstrip()


def as_text(results: Sequence[Result]) -> str:
    """The count of each outcome, and the rules that are not held."""
    count = Counter(result.outcome for result in results)
    shown = [o for o in Outcome if o is not Outcome.NOT_TESTED or count[o]]
    text = ", ".join(f"{count[outcome]} {outcome}" for outcome in shown)
    wrong = [result.rule.name for result in results if result.outcome is Outcome.NOT_HELD]
    return f"{text}{': ' + ', '.join(wrong) if wrong else ''}"


def too_few(results: Sequence[Result]) -> str:
    """The offered rules that were not tested, where that is a failure."""
    names = [result.rule.name for result in results if result.outcome is Outcome.NOT_TESTED]
    if len(names) <= MAX_UNTESTED:
        return ""
    return (
        f"{len(names)} rules were not tested though the board offers their features "
        f"(up to {MAX_UNTESTED} may be): {', '.join(names)}"
    )


def as_json(board: str, joint: str, results: Sequence[Result]) -> str:
    """All results on one line."""
    rows = [
        {
            "rule": result.rule.name,
            "title": result.rule.title,
            "result": str(result.outcome),
            "evidence": result.evidence,
            "seconds": round(result.seconds, 3),
        }
        for result in results
    ]
    whole = {"success": passed(results), "board": board, "joint": joint, "results": rows}
    return json.dumps(whole, ensure_ascii=False)


def as_junit(board: str, results: Sequence[Result]) -> str:
    """A JUnit test suite: a test case per rule.

    Not testable rules are skipped; so are untested ones, up to the permitted number.
    """
    count = Counter(result.outcome for result in results)
    failing = {Outcome.NOT_HELD, *([Outcome.NOT_TESTED] if too_few(results) else [])}
    suite = ElementTree.Element(
        "testsuite",
        name=f"control_board_conformance {board}",
        tests=str(len(results)),
        failures=str(sum(count[outcome] for outcome in failing)),
        skipped=str(sum(count[o] for o in Outcome if o is not Outcome.HELD and o not in failing)),
        errors="0",
        time=f"{sum(result.seconds for result in results):.3f}",
    )
    for result in results:
        name = f"{result.rule.name} {result.rule.title}"
        case = ElementTree.SubElement(
            suite, "testcase", classname=board, name=name, time=f"{result.seconds:.3f}"
        )
        if result.outcome is Outcome.HELD:
            ElementTree.SubElement(case, "system-out").text = result.evidence
        else:
            kind = "failure" if result.outcome in failing else "skipped"
            ElementTree.SubElement(case, kind, message=result.evidence)
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
