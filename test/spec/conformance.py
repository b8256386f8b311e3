# SPDX-License-Identifier: Apache-2.0
"""``make conformance``: run the tests of the rules, then try the rules from outside, over ROS.

Prints rule -> tests -> result, tries a simulated board and the virtual drives of each make with
``control_board_conformance``, and records both in conformance.json and docs/conformance.md. Ends
with 1 when a rule has no test, a test failed, or a board does not keep a rule. The tests are those
of test/spec that name a rule, and those of a rule beyond the source wherever they are, but for
soak tests. ``--boards`` tries boards only, all or those of ``--boards=moteus,feetech``; other
arguments go to pytest, for example ``-k brakes``: then nothing else is run, and nothing recorded.
``--tables`` runs nothing and prints the tests of the rules, for the site.
"""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "conformance.md"
RECORD = HERE / "conformance.json"
#: Rule -> how often its tests passed, failed and were skipped; board -> rule -> its outcome.
Record = dict[str, dict[str, Any]]
sys.path.insert(0, str(HERE.parent / "support"))

from conformance_sessions import BOARDS, tried_on  # noqa: E402
from rules import RULES, proofs  # noqa: E402

from control_board_ros.conformance import Outcome  # noqa: E402

ORDER = ("failed", "skipped", "passed")
#: Tests, and boards, that run side by side.
JOBS = int(os.environ.get("JOBS", "3"))


class Results:
    """A pytest plugin that notes how each test went."""

    def __init__(self) -> None:
        self.outcomes: dict[str, str] = {}

    def pytest_runtest_logreport(self, report: Any) -> None:
        before = self.outcomes.get(report.nodeid, "passed")
        if report.when == "call" or report.outcome != "passed":
            self.outcomes[report.nodeid] = min(before, report.outcome, key=ORDER.index)

    def by_rule(self) -> dict[str, Counter[str]]:
        """For each rule how often its tests passed, failed, were skipped."""
        table: dict[str, Counter[str]] = {rule: Counter() for rule in RULES}
        for test, outcome in self.outcomes.items():
            for rule in proofs()[test.split("[")[0]]:
                table[rule][outcome] += 1
        return table


def verdict(runs: dict[str, int]) -> str:
    """What all tests of a rule say together."""
    if not runs.get("passed", 0) + runs.get("failed", 0):
        return "NO TEST"
    return "FAILED" if runs.get("failed") else "passed"


def from_outside(boards: list[str]) -> Record:
    """Try the rules as ``control_board_conformance`` does: the outcomes by board and rule."""
    found = {}
    with ProcessPoolExecutor(JOBS, get_context("spawn")) as pool:
        asked = {pool.submit(tried_on, board): board for board in boards}
        for done in as_completed(asked):
            board, results = asked[done], done.result()
            found[board] = {rule: outcome for rule, (outcome, _) in results.items()}
            print(f"from outside, {board}: {summed_up(found[board])}", flush=True)
            for rule, (outcome, evidence) in results.items():
                if outcome in (Outcome.NOT_HELD, Outcome.NOT_TESTED):
                    print(f"    {rule} {outcome}: {evidence}", flush=True)
    return found


def summed_up(outcomes: dict[str, str]) -> str:
    """How many rules a board keeps, and which it does not."""
    count = Counter(outcomes.values())
    text = ", ".join(f"{count[outcome]} {outcome}" for outcome in Outcome)
    wrong = [r for r, o in outcomes.items() if o in (Outcome.NOT_HELD, Outcome.NOT_TESTED)]
    return text + f" ({', '.join(wrong)})" * bool(wrong)


HEAD = """\
# Conformance

Every rule of the [specification](spec.md) has tests, and `make conformance` runs them, with
different modes, joints and values. A test names its rules at the start of its docstring:
`grep -rnE '""[A-Z0-9, ]*M4[,:]' test` finds those of a rule, and the site's page *The tests of the
rules* lists all.

"""
OUTSIDE = """\

## From outside

[`control_board_conformance`](howto/conformance.md) over ROS, with all permissions, on a simulated
board and on the virtual drives of each make; it has the rules of the source, of YARP 4, and E.
*Not testable* are those that the board does not offer, or that are not visible from outside.

| board | held | not held | not tested | not testable |
|---|---|---|---|---|
"""
FULL = """\
# The tests of the rules

Rule by rule, the tests that prove it, those of `test/spec` by their file alone;
[conformance](../conformance.md) has how they went.

| rule | about | tests |
|---|---|---|
"""


def page(record: Record) -> str:
    """docs/conformance.md: a line for each section of the specification, and for each board."""
    lines, runs = ["| rules | runs of their tests |", "|---|---|"], record["tests"]
    for _, group in groupby(runs, key=lambda rule: rule[0]):
        rules = list(group)
        ends = dict.fromkeys((rules[0], rules[-1]))
        links = " to ".join(f"[{rule}](spec.md#{rule.lower()})" for rule in ends)
        lines.append(f"| {links} | {sum(sum(runs[rule].values()) for rule in rules)} |")
    broken = [rule for rule in runs if verdict(runs[rule]) != "passed"]
    lines += ["", f"{len(runs) - len(broken)} of {len(runs)} rules hold"]
    lines[-1] += f": not {', '.join(broken)}." if broken else "."
    text = HEAD + "\n".join([*lines, ""]) + OUTSIDE
    for board, outcomes in record["boards"].items():
        cells = [
            f"{len(rules)}{': ' * named}{', '.join(rules * named)}"
            for outcome in Outcome
            for rules in [[rule for rule, found in outcomes.items() if found == outcome]]
            for named in [bool(rules) and outcome in (Outcome.NOT_HELD, Outcome.NOT_TESTED)]
        ]
        text += f"| {board} | {' | '.join(cells)} |\n"
    return text


def tables() -> str:
    """The page of all tests, for the site."""
    lines = []
    for rule, about in RULES.items():
        names = (name for name, rules in proofs().items() if rule in rules)
        shown = "<br>".join(f"`{name.removeprefix('test/spec/')}`" for name in names)
        lines.append(f"| [{rule}](../spec.md#{rule.lower()}) | {about} | {shown} |")
    return FULL + "\n".join([*lines, ""])


def show(table: dict[str, Counter[str]]) -> None:
    """Print the table."""
    print(f"\n{'rule':<5}{'result':<9}{'tests':>6}{'runs':>6}  about")
    for rule, runs in table.items():
        count = sum(rule in rules for rules in proofs().values())
        print(f"{rule:<5}{verdict(runs):<9}{count:>6}{sum(runs.values()):>6}  {RULES[rule]}")


def write(table: dict[str, dict[str, int]] | None, found: Record) -> None:
    """Record what was run, beside what is recorded, and the page."""
    record = json.loads(RECORD.read_text("utf-8"))
    before = record["boards"] | found
    record = {"tests": table or record["tests"], "boards": {n: before[n] for n in BOARDS}}
    text = json.dumps(record, indent=1, ensure_ascii=False)
    RECORD.write_text(f"{text}\n", encoding="utf-8")
    PAGE.write_text(page(record), encoding="utf-8")
    print(f"\nwritten: {PAGE.relative_to(ROOT)}")


def run_tests(arguments: list[str]) -> tuple[int, dict[str, Counter[str]]]:
    """Run the tests of the rules: the exit code, and the outcomes by rule.

    What fails is run again alone, as in CI, and named.
    """
    results = Results()
    options = ["-q", f"--rootdir={ROOT}", "-m", "not soak"]
    names = [str(ROOT / name) for name in proofs()]
    beside = [f"-n{JOBS}", "--dist=loadfile"]
    code = pytest.main([*options, *beside, *names, *arguments], plugins=[results])
    if failed := [test for test, outcome in results.outcomes.items() if outcome == "failed"]:
        print("again:", *failed)
        for test in failed:
            del results.outcomes[test]
        alone = [f"{ROOT}/{test}" for test in failed]
        code = pytest.main([*options, "-pno:xdist", *alone], plugins=[results])
    return int(code), results.by_rule()


def main(arguments: list[str]) -> int:
    if arguments == ["--tables"]:
        print(tables(), end="")
        return 0
    boards, good, table = list(BOARDS), True, None
    if arguments and arguments[0].startswith("--boards"):
        _, _, names = arguments[0].partition("=")
        boards = names.split(",") if names else boards
    else:
        code, table = run_tests(arguments)
        show(table)
        good = not code and all(verdict(runs) == "passed" for runs in table.values())
        if arguments or code > pytest.ExitCode.TESTS_FAILED:  # it could not read them
            return code
    found = from_outside(boards)
    write(table, found)
    good &= all(Outcome.NOT_HELD not in outcomes.values() for outcomes in found.values())
    print(f"\n{'all rules hold' if good else 'not all rules hold'}")
    return int(not good)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
