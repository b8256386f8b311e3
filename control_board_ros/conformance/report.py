# SPDX-License-Identifier: Apache-2.0
"""How the rules went: for people, as JSON, and as JUnit for CI."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from xml.etree import ElementTree

from .runner import Outcome, Result


def as_line(result: Result) -> str:
    """One rule, for people: ``M10  held          IDLE is unpowered: 0 % in 20 states``."""
    return (
        f"{result.rule.name:<5}{result.outcome:<14}{result.rule.title}: {result.evidence}"
    ).rstrip()


def as_text(results: Sequence[Result]) -> str:
    """The count of each outcome, and the rules that are not held."""
    count = Counter(result.outcome for result in results)
    text = ", ".join(f"{count[outcome]} {outcome}" for outcome in Outcome)
    wrong = [result.rule.name for result in results if result.outcome is Outcome.NOT_HELD]
    return f"{text}{': ' + ', '.join(wrong) if wrong else ''}"


def as_json(board: str, joint: str, results: Sequence[Result]) -> str:
    """All of it on one line."""
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
    success = not any(result.outcome is Outcome.NOT_HELD for result in results)
    whole = {"success": success, "board": board, "joint": joint, "results": rows}
    return json.dumps(whole, ensure_ascii=False)


def as_junit(board: str, results: Sequence[Result]) -> str:
    """A JUnit test suite: a test case per rule; what is not testable here is skipped."""
    count = Counter(result.outcome for result in results)
    suite = ElementTree.Element(
        "testsuite",
        name=f"control_board_conformance {board}",
        tests=str(len(results)),
        failures=str(count[Outcome.NOT_HELD]),
        skipped=str(count[Outcome.NOT_TESTABLE]),
        errors="0",
        time=f"{sum(result.seconds for result in results):.3f}",
    )
    for result in results:
        name = f"{result.rule.name} {result.rule.title}"
        case = ElementTree.SubElement(
            suite, "testcase", classname=board, name=name, time=f"{result.seconds:.3f}"
        )
        if result.outcome is Outcome.NOT_HELD:
            ElementTree.SubElement(case, "failure", message=result.evidence)
        elif result.outcome is Outcome.NOT_TESTABLE:
            ElementTree.SubElement(case, "skipped", message=result.evidence)
        else:
            ElementTree.SubElement(case, "system-out").text = result.evidence
    ElementTree.indent(suite)
    return ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"
