# SPDX-License-Identifier: Apache-2.0
"""``make conformance``: run the tests of the rules and show, rule by rule, how they went.

Prints the table rule -> tests -> result, writes it to docs/conformance.md, and ends with 1 when
a rule has no test or a test failed, or when ``control_board_conformance`` finds one that is not
held. The tests are those of test/spec, and those of a rule beyond the source wherever they are,
but for soak tests. Arguments go to pytest, for example ``-k brakes``; the page is only written,
and the board only tried from outside, by a run of all tests.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "conformance.md"
sys.path.insert(0, str(HERE.parent / "support"))

from conformance_sessions import ARM, session_on  # noqa: E402
from rules import RULES, counts, files, proved_by  # noqa: E402

from control_board_ros.conformance import Outcome, Result, as_line, as_text, run  # noqa: E402
from control_board_ros.conformance.rules import in_order  # noqa: E402
from control_board_ros.testing import board_process  # noqa: E402

ORDER = ("failed", "skipped", "passed")


class Results:
    """A pytest plugin that notes which rules each test proves, and how it went."""

    def __init__(self) -> None:
        self.rules: dict[str, list[str]] = {}
        self.outcomes: dict[str, str] = {}
        self.chosen = False

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        for item in items:
            self.rules[item.nodeid] = proved_by(getattr(item, "function", item).__doc__)
        items[:] = [
            item
            for item in items
            if counts(item.path, self.rules[item.nodeid]) and not item.get_closest_marker("soak")
        ]

    def pytest_deselected(self, items: list[Any]) -> None:
        self.chosen = True

    def pytest_runtest_logreport(self, report: Any) -> None:
        before = self.outcomes.get(report.nodeid, "passed")
        worse = min(before, report.outcome, key=ORDER.index)
        if report.when == "call" or report.outcome != "passed":
            self.outcomes[report.nodeid] = worse

    def by_rule(self) -> dict[str, dict[str, Counter[str]]]:
        """For each rule its tests, and for each of them how often it passed, failed, skipped."""
        table: dict[str, dict[str, Counter[str]]] = {rule: defaultdict(Counter) for rule in RULES}
        for test, outcome in self.outcomes.items():
            name = test.split("[")[0].removeprefix("test/spec/")
            for rule in self.rules.get(test, []):
                table[rule][name][outcome] += 1
        return table


def verdict(tests: dict[str, Counter[str]]) -> str:
    """What all tests of a rule say together."""
    total: Counter[str] = sum(tests.values(), Counter())
    if not total["passed"] + total["failed"]:
        return "NO TEST"
    return "FAILED" if total["failed"] else "passed"


def from_outside() -> dict[str, Result]:
    """Try the rules as ``control_board_conformance`` does, on the board of the tests."""
    with board_process(config=ARM) as board, session_on(board) as session:
        results, _ = run(session, in_order(), lambda result: print(as_line(result), flush=True))
    print(f"from outside: {as_text(results)}")
    return {result.rule.name: result for result in results}


def page(table: dict[str, dict[str, Counter[str]]], outside: dict[str, Result]) -> str:
    """The table as Markdown."""
    lines = [
        "# Conformance",
        "",
        "Rule by rule, the tests that prove it, those of `test/spec` by their file alone, and how",
        "often each ran (with different modes, joints or values). From outside: the result of",
        "[`control_board_conformance`](howto/conformance.md) over ROS; it has the rules of the",
        "source and of YARP 4, not those of this project (R, T, B, S, E, G, X). Written by",
        "`make conformance`.",
        "",
        "| rule | about | result | from outside | tests |",
        "|---|---|---|---|---|",
    ]
    for rule, tests in table.items():
        shown = "<br>".join(f"`{name}` × {sum(n.values())}" for name, n in sorted(tests.items()))
        linked = f"[{rule}](spec.md#{rule.lower()})"
        found = outside[rule].outcome if rule in outside else "–"
        lines.append(f"| {linked} | {RULES[rule]} | {verdict(tests)} | {found} | {shown} |")
    count = sum(verdict(tests) == "passed" for tests in table.values())
    return "\n".join([*lines, "", f"{count} of {len(table)} rules hold.", ""])


def show(table: dict[str, dict[str, Counter[str]]]) -> None:
    """Print the table."""
    print(f"\n{'rule':<5}{'result':<9}{'tests':>6}{'runs':>6}  about")
    for rule, tests in table.items():
        runs = sum(sum(n.values()) for n in tests.values())
        print(f"{rule:<5}{verdict(tests):<9}{len(tests):>6}{runs:>6}  {RULES[rule]}")
        for name, n in sorted(tests.items()):
            if n["failed"]:
                print(f"       failed: {name}")


def main(arguments: list[str]) -> int:
    results = Results()
    options = ["-q", "-p", "no:cacheprovider", f"--rootdir={ROOT}"]
    code = pytest.main([*options, *map(str, files()), *arguments], plugins=[results])
    table = results.by_rule()
    show(table)
    good = all(verdict(tests) == "passed" for tests in table.values())
    if not results.chosen and not arguments:
        outside = from_outside()
        good = good and all(r.outcome is not Outcome.NOT_HELD for r in outside.values())
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(page(table, outside), encoding="utf-8")
        print(f"\nwritten: {PAGE.relative_to(ROOT)}")
    print(f"\n{'all rules hold' if good and not code else 'not all rules hold'}")
    return int(code) or int(not good)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
