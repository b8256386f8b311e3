# SPDX-License-Identifier: Apache-2.0
"""``make conformance``: run the tests of the rules and show, rule by rule, how they went.

Prints the table rule -> tests -> result, records it in conformance.json and docs/conformance.md,
and ends with 1 when a rule has no test or a test failed, or when ``control_board_conformance``
finds one that is not held. The tests are those of test/spec, and those of a rule beyond the source
wherever they are, but for soak tests. Arguments go to pytest, for example ``-k brakes``; the
record is only written, and the board only tried from outside, by a run of all tests. ``--tables``
runs nothing and prints the recorded table, which the site shows.
"""

from __future__ import annotations

import json
import sys
from collections import Counter, defaultdict
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "conformance.md"
RECORD = HERE / "conformance.json"
#: Rule -> its result, the one from outside, and its tests with how often each ran.
Record = dict[str, dict[str, Any]]
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


HEAD = """\
# Conformance

Every rule of the [specification](spec.md) has tests, and `make conformance` runs them: rule,
tests, runs, result. A test names its rules at the start of its docstring:
`grep -rnE '""[A-Z0-9, ]*M4[,:]' test` finds those of a rule, and the site's page *The tests of the
rules* lists all. *From outside* is [`control_board_conformance`](howto/conformance.md) over ROS;
of the rules that are testable there; it has those of the source and of YARP 4.

"""
FULL = """\
# The tests of the rules

Rule by rule, the tests that prove it, those of `test/spec` by their file alone, and how often each
ran (with different modes, joints or values); [conformance](../conformance.md) in short.

| rule | about | result | from outside | tests |
|---|---|---|---|---|
"""


def recorded(table: dict[str, dict[str, Counter[str]]], outside: dict[str, Result]) -> Record:
    """What conformance.json keeps of a run."""
    return {
        rule: {
            "result": verdict(tests),
            "outside": f"{outside[rule].outcome}" if rule in outside else "–",
            "tests": {name: sum(n.values()) for name, n in sorted(tests.items())},
        }
        for rule, tests in table.items()
    }


def page(record: Record) -> str:
    """docs/conformance.md: a line for each section of the specification."""
    lines = ["| rules | tests | runs | held from outside |", "|---|---|---|---|"]
    for _, group in groupby(record, key=lambda rule: rule[0]):
        rules = list(group)
        links = [
            f"[{rule}](spec.md#{rule.lower()})" for rule in dict.fromkeys((rules[0], rules[-1]))
        ]
        of = [record[rule] for rule in rules]
        tests = {name: runs for entry in of for name, runs in entry["tests"].items()}
        tried = [e["outside"] for e in of if e["outside"] not in ("–", "not testable")]
        outside = f"{tried.count('held')} of {len(tried)}" if tried else "–"
        cells = (" to ".join(links), len(tests), sum(tests.values()), outside)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    broken = [rule for rule, entry in record.items() if entry["result"] != "passed"]
    verdict = f"{len(record) - len(broken)} of {len(record)} rules hold{': not ' * bool(broken)}"
    return HEAD + "\n".join([*lines, "", f"{verdict}{', '.join(broken)}.", ""])


def tables(record: Record) -> str:
    """The page of all tests, for the site."""
    lines = []
    for rule, entry in record.items():
        shown = "<br>".join(f"`{name}` × {runs}" for name, runs in entry["tests"].items())
        linked = f"[{rule}](../spec.md#{rule.lower()})"
        cells = (linked, RULES[rule], entry["result"], entry["outside"], shown)
        lines.append(f"| {' | '.join(cells)} |")
    return FULL + "\n".join([*lines, ""])


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
    if arguments == ["--tables"]:
        print(tables(json.loads(RECORD.read_text("utf-8"))), end="")
        return 0
    results = Results()
    options = ["-q", "-p", "no:cacheprovider", f"--rootdir={ROOT}"]
    code = pytest.main([*options, *map(str, files()), *arguments], plugins=[results])
    table = results.by_rule()
    show(table)
    good = all(verdict(tests) == "passed" for tests in table.values())
    if code > pytest.ExitCode.TESTS_FAILED:  # it could not read them, or was interrupted
        return int(code)
    if not results.chosen and not arguments:
        outside = from_outside()
        good = good and all(r.outcome is not Outcome.NOT_HELD for r in outside.values())
        record = recorded(table, outside)
        text = json.dumps(record, indent=1, ensure_ascii=False)
        RECORD.write_text(f"{text}\n", encoding="utf-8")
        PAGE.write_text(page(record), encoding="utf-8")
        print(f"\nwritten: {PAGE.relative_to(ROOT)}")
    print(f"\n{'all rules hold' if good and not code else 'not all rules hold'}")
    return int(code) or int(not good)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
