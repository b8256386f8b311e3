# SPDX-License-Identifier: Apache-2.0
"""Which tests reach which lines of the core, and how long each takes: recorded by one run of them.

A line that a fixture reaches counts for all tests of the file, which may share the fixture; one
that runs while modules are imported, for all tests. Of a function that a test calls often only
some calls are looked at: such a test may reach any line of it.
"""

from __future__ import annotations

import json
import re
import sys
import time
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

#: Calls of a function in one test that are looked at; of later ones each OFTEN-th.
CALLS, OFTEN = 40, 50
#: Lines before and after one that determine which tests are about it.
AROUND = 15
#: What every test is about a line, at least; time that a test costs besides its own, s.
SLIGHT, OVERHEAD = 1e-4, 0.02


def module_name(folder: Path, file: Path) -> str:
    """A module of a folder, with the rooms that it is in: ``laws.control``."""
    return ".".join(file.relative_to(folder).with_suffix("").parts)


class Recorder:
    """A plugin of pytest that notes the lines of a folder, test by test.

    Args:
        folder: of the modules to look at.
        path: of the file to write at the end.
    """

    def __init__(self, folder: Path, path: Path) -> None:
        self._folder, self._path = f"{folder}/", path
        self._lines: set[tuple[str, int]] = set()
        self._calls: defaultdict[CodeType, int] = defaultdict(int)
        self._often: defaultdict[str, set[CodeType]] = defaultdict(set)  # by test and by file
        self._tests: dict[str, set[tuple[str, int]]] = {}
        self._fixtures: defaultdict[str, set[tuple[str, int]]] = defaultdict(set)
        self._seconds: dict[str, float] = {}
        self._imported: set[tuple[str, int]] = set()
        self._failed = False

    def _name(self, file: str) -> str:
        return module_name(Path(self._folder), Path(file))

    def _call(self, frame: FrameType, _event: str, _argument: Any) -> Any:
        code = frame.f_code
        if not code.co_filename.startswith(self._folder):
            return None
        self._calls[code] += 1
        calls = self._calls[code]
        return self._line if calls <= CALLS or calls % OFTEN == 0 else None

    def _line(self, frame: FrameType, _event: str, _argument: Any) -> Any:
        self._lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self._line

    def _skipped(self) -> set[CodeType]:
        """The functions that were called so often that some calls were not looked at."""
        return {code for code, calls in self._calls.items() if calls > CALLS}

    def _watched(self) -> Iterator[None]:
        self._lines, before = set(), sys.gettrace()
        self._calls.clear()
        sys.settrace(self._call)
        try:
            yield
        finally:
            sys.settrace(before)

    @pytest.hookimpl(tryfirst=True)
    def pytest_load_initial_conftests(self) -> None:
        """Look at what runs when modules are imported, from here on."""
        sys.settrace(self._call)

    def pytest_collection_finish(self) -> None:
        """All modules are there."""
        sys.settrace(None)
        self._imported = self._lines

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        yield from self._watched()
        self._fixtures[item.nodeid.partition("::")[0]] |= self._lines
        self._often[item.nodeid.partition("::")[0]] |= self._skipped()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        begin = time.process_time()
        yield from self._watched()
        self._seconds[item.nodeid] = time.process_time() - begin
        self._tests[item.nodeid] = self._lines
        self._often[item.nodeid] = self._skipped()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """The first failure is all that is written: the run ends there."""
        if report.failed:
            self._path.write_text(report.nodeid, encoding="utf-8")
            self._failed = True

    def pytest_sessionfinish(self) -> None:
        """Write what was found: the numbers of tests by module and line."""
        if self._failed:
            return
        found: defaultdict[str, defaultdict[int, list[int]]]
        found = defaultdict(lambda: defaultdict(list))
        for k, (test, lines) in enumerate(self._tests.items()):
            for file, line in lines | self._fixtures[test.partition("::")[0]]:
                found[self._name(file)][line].append(k)
        imported: defaultdict[str, list[int]] = defaultdict(list)
        for file, line in self._imported:
            imported[self._name(file)].append(line)
        often: defaultdict[str, defaultdict[str, list[int]]]
        often = defaultdict(lambda: defaultdict(list))
        for k, test in enumerate(self._tests):
            for code in self._often[test] | self._often[test.partition("::")[0]]:
                last = max(line for _, _, line in code.co_lines() if line)
                often[self._name(code.co_filename)][f"{code.co_firstlineno} {last}"].append(k)
        record = {"seconds": self._seconds, "lines": found, "imported": imported, "often": often}
        self._path.write_text(json.dumps(record), encoding="utf-8")


def merged(old: dict[str, Any], new: dict[str, Any], gone: Collection[str]) -> dict[str, Any]:
    """What two runs have recorded.

    Args:
        old: the first.
        new: the second, of other files or of these anew.
        gone: the files whose tests the first one is not asked about any more.
    """
    kept = {t: s for t, s in old["seconds"].items() if t.partition("::")[0] not in gone}
    seconds = kept | new["seconds"]
    places = {test: k for k, test in enumerate(seconds)}
    lines: defaultdict[str, defaultdict[str, list[int]]]
    found: dict[str, Any] = {"seconds": seconds}
    for key in ("lines", "often"):
        lines = defaultdict(lambda: defaultdict(list))
        for record, counted in ((old, kept), (new, seconds)):
            moved = [places[test] if test in counted else None for test in record["seconds"]]
            for module, by_line in record[key].items():
                for line, tests in by_line.items():
                    lines[module][line] += [k for t in tests if (k := moved[t]) is not None]
        found[key] = {
            module: {line: tests for line, tests in by_line.items() if tests}
            for module, by_line in lines.items()
        }
    modules = {*old["imported"], *new["imported"]}
    found["imported"] = {
        module: sorted({*old["imported"].get(module, ()), *new["imported"].get(module, ())})
        for module in modules
    }
    return found


@dataclass(frozen=True)
class Reach:
    """Tests by module and line; lines that importing runs; CPU seconds by test, traced; tests by
    module and by first and last line of a function of which they skip calls.
    """

    lines: dict[str, dict[int, list[str]]]
    imported: dict[str, frozenset[int]]
    seconds: dict[str, float]
    often: dict[str, dict[tuple[int, int], list[str]]] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path) -> Reach:
        """What a Recorder has written."""
        record = json.loads(path.read_text(encoding="utf-8"))
        tests = list(record["seconds"])
        lines = {
            module: {int(line): [tests[k] for k in found] for line, found in by_line.items()}
            for module, by_line in record["lines"].items()
        }
        imported = {module: frozenset(found) for module, found in record["imported"].items()}
        often = {
            module: {
                (int(first), int(last)): [tests[k] for k in found]
                for (first, _, last), found in ((span.partition(" "), x) for span, x in of.items())
            }
            for module, of in record["often"].items()
        }
        return cls(lines, imported, record["seconds"], often)

    def tests_for(self, module: str, line: int, uses: Collection[int] = ()) -> list[str]:
        """The tests that can detect a broken line: those seen to reach it, and those that skip
        calls of its function; of a line that importing runs, all.

        First those that are about it, for the time that they take: tests that reach lines around
        it which few others reach, and those of a file whose name begins with the module's; the
        time of one with many parameters is that of all before it.

        A line that no test was seen to reach counts as the line before it.

        Args:
            module: of the core.
            line: its number; 0: a row added at the end.
            uses: of a line that importing runs, those that use what it defines: tests about these
                come first.
        """
        asked, line = line, self._seen(module, line)
        about = self._about(module, uses or [line])
        name = re.compile(rf"/test_{module.rpartition('.')[2]}(_\w+)?\.py::")

        def gain(test: str) -> float:
            return about.get(test, 0.0) + SLIGHT + bool(name.search(test))

        def cost(test: str) -> float:
            return self.seconds[test] + OVERHEAD

        found = set(self.lines.get(module, {}).get(line, ()))
        if line and line not in self.imported.get(module, ()):
            spans = self.often.get(module, {}).items()
            found.update(*(tests for (first, last), tests in spans if first <= asked <= last))
        else:
            found.update(self.seconds)
        spent: defaultdict[str, float] = defaultdict(float)
        places = []
        for test in sorted(found, key=lambda test: cost(test) / gain(test)):
            function = test.partition("[")[0]
            spent[function] += cost(test)
            places.append((spent[function] / gain(test), test))
        return [test for _, test in sorted(places)]

    def at_import(self, module: str, line: int) -> bool:
        """Whether importing runs this line (0: a row added at the end)."""
        return not line or self._seen(module, line) in self.imported.get(module, ())

    def within(self, tests: list[str], seconds: float) -> list[str]:
        """The first ones of these tests, which take at most so long together; one at least."""
        taken = list(accumulate(self.seconds[test] for test in tests))
        return tests[: max(1, bisect_right(taken, seconds))]

    def _seen(self, module: str, line: int) -> int:
        """This line, or the last one before it that was seen to run."""
        seen = {*self.lines.get(module, ()), *self.imported.get(module, ())}
        return max((one for one in seen if one <= line), default=line)

    def _about(self, module: str, lines: Collection[int]) -> dict[str, float]:
        """How much tests are about lines: 1 of each line near one, shared by its tests."""
        found: defaultdict[str, float] = defaultdict(float)
        for one, tests in self.lines.get(module, {}).items():
            if any(abs(one - line) <= AROUND for line in lines):
                for test in tests:
                    found[test] += 1.0 / len(tests)
        return found


def interval(killed: int, tried: int) -> tuple[float, float]:
    """Wilson's 95 % confidence interval of a rate."""
    if not tried:
        return 0.0, 1.0
    z, rate = 1.959964, killed / tried
    middle = rate + z * z / (2 * tried)
    half = z * ((rate * (1.0 - rate) + z * z / (4 * tried)) / tried) ** 0.5
    return (middle - half) / (1.0 + z * z / tried), (middle + half) / (1.0 + z * z / tried)
