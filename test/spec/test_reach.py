# SPDX-License-Identifier: Apache-2.0
"""What make mutants chooses its tests by, and what it says of a sample."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest
from attempts import code_of
from mutations import mutants, uses
from reach import Reach, Recorder, interval, merged

MODULE = """
def register(name):
    NAMES.append(name)

def used(x):
    if x > 1:
        return "large"
    return "small"

def rare(x):
    if x == 77:
        return "rare"
    return "often"

NAMES = []
register("a")
"""
TESTS = """
import pytest, {module}

@pytest.fixture(scope="module")
def small():
    return {module}.used(0)

def test_fixture(small):
    assert small == "small"

def test_large():
    assert {module}.used(2) == "large"

def test_often():
    assert [{module}.rare(x) for x in range(100)].count("rare") == 1

def test_rare():
    assert {module}.rare(77) == "rare"
"""


def recorded(
    folder: Path, tests: str, monkeypatch: pytest.MonkeyPatch
) -> tuple[pytest.ExitCode | int, str]:
    """The exit code of a recorded run of tests, and the name of the module."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)  # meant for the run that this is in
    package = folder / "package"
    package.mkdir()
    name = f"reached_{folder.name}".replace("-", "_")
    (package / f"{name}.py").write_text(MODULE)
    (folder / "test_it.py").write_text(tests.format(module=name))
    recorder = Recorder(package, folder / "reach.json")
    sys.path.insert(0, str(package))
    try:
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--rootdir={folder}"]
        code = pytest.main([*options, "-c", "/dev/null", str(folder)], plugins=[recorder])
    finally:
        sys.path.remove(str(package))
        for module in (name, "test_it"):
            sys.modules.pop(module, None)
    return code, name


def test_a_run_records_the_functions_its_tests_reach(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Lines by test; those of a fixture for its file, those of an import for all tests."""
    code, name = recorded(tmp_path, TESTS, monkeypatch)
    assert code == 0
    reach = Reach.read(tmp_path / "reach.json")
    large, often, rare = (f"test_it.py::test_{name}" for name in ("large", "often", "rare"))
    every = {"test_it.py::test_fixture", large, often, rare}
    assert reach.tests_for(name, 7) == [large]
    assert set(reach.tests_for(name, 8)) == every  # by the fixture, which they may share
    assert set(reach.tests_for(name, 3)) == every  # when the module is imported
    assert reach.tests_for("no_module", 99) == []
    assert set(reach.tests_for(name, 12)) == {rare, often}  # in one call of many


def test_a_run_that_fails_records_which_test_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, _ = recorded(tmp_path, TESTS.replace('== "large"', '== "small"'), monkeypatch)
    assert code == 1
    assert (tmp_path / "reach.json").read_text() == "test_it.py::test_large"


def test_the_quick_ones_come_first() -> None:
    lines = {"laws": {5: ["slow", "quick"], 8: ["other"]}}
    reach = Reach(lines, {"laws": frozenset({8})}, {"slow": 2.0, "quick": 1.0, "other": 0.1})
    assert reach.tests_for("laws", 5) == ["quick", "slow"]
    assert reach.tests_for("laws", 6) == ["quick", "slow"]  # not seen: as the one before
    assert reach.tests_for("laws", 8) == ["other", "quick", "slow"]
    assert reach.tests_for("laws", 0) == ["other", "quick", "slow"]  # a row at the end
    assert reach.tests_for("laws", 4) == []


def test_of_a_constant_those_about_its_uses_come_first() -> None:
    lines = {"laws": {40: ["about"], 80: ["other"]}}
    reach = Reach(lines, {"laws": frozenset({8})}, {"other": 0.1, "about": 1.0})
    assert reach.tests_for("laws", 8) == ["other", "about"]
    assert reach.tests_for("laws", 8, [40]) == ["about", "other"]


def test_uses_of_constants() -> None:
    """Not of tables, which the generated pages show."""
    text = "A, B = 1, declare(2)\nROWS = {A: 3}\ndef f():\n    return A + B\n\nC = A\n"
    assert uses(text, 1) == [2, 4, 6]
    assert uses(text, 2) == uses(text, 4) == uses(text, 6) == uses(text, 0) == []


def test_those_that_skip_calls_of_a_function_come_after() -> None:
    """They may reach any line of it."""
    seconds = {"slow": 2.0, "quick": 1.0, "other": 0.1}
    often = {"laws": {(4, 7): ["slow", "other"], (9, 12): ["slow"]}}
    reach = Reach({"laws": {4: ["quick"], 6: ["quick"]}}, {}, seconds, often)
    assert reach.tests_for("laws", 6) == ["quick", "other", "slow"]
    assert reach.tests_for("laws", 7) == ["quick", "other", "slow"]
    assert reach.tests_for("laws", 8) == ["quick"]
    assert reach.tests_for("control", 6) == []


def test_the_interval_of_a_rate() -> None:
    """Wilson, E. B. (1927), with the values of its usual tables."""
    assert interval(95, 100) == pytest.approx((0.8882, 0.9785), abs=1e-4)
    assert interval(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert interval(0, 0) == (0.0, 1.0)


def test_new_records_replace_old_ones() -> None:
    """Of files that have changed, or are gone; of the others what was recorded stays."""
    old = {
        "seconds": {"a.py::one": 1.0, "b.py::two": 2.0, "c.py::three": 3.0},
        "lines": {"laws": {"5": [0, 1], "6": [1], "7": [2]}, "state": {"1": [1]}},
        "imported": {"laws": [1, 2]},
        "often": {"laws": {"4 7": [1, 2]}},
    }
    new = {
        "seconds": {"b.py::two": 0.5, "d.py::four": 4.0},
        "lines": {"laws": {"5": [0], "9": [1]}},
        "imported": {"laws": [2, 3], "state": [1]},
        "often": {"laws": {"4 7": [1]}},
    }
    found = merged(old, new, {"b.py", "d.py"})
    tests = ["a.py::one", "c.py::three", "b.py::two", "d.py::four"]
    assert found["seconds"] == dict(zip(tests, (1.0, 3.0, 0.5, 4.0), strict=True))
    assert found["lines"] == {"laws": {"5": [0, 2], "7": [1], "9": [3]}, "state": {}}
    assert found["imported"] == {"laws": [1, 2, 3], "state": [1]}
    assert found["often"] == {"laws": {"4 7": [1, 3]}}


def test_results_in_the_repository_count_while_code_and_tests_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed mutants while the code of their module stays; survivors while the tests do, too."""
    where = importlib.util.spec_from_file_location("tool", Path(__file__).with_name("mutants.py"))
    assert where is not None
    assert where.loader is not None
    tool: Any = importlib.util.module_from_spec(where)
    where.loader.exec_module(tool)
    made = mutants("state", (tool.PACKAGE / "core" / "state.py").read_text(encoding="utf-8"))

    def record(name: str, *, again: bool = False) -> Any:
        files = tool.Files("core", tmp_path, tmp_path)
        files.record = tmp_path / name
        return tool.Record(tool.CORE, files, made, anew=False, again=again)

    first = record("first.txt")
    assert first.fates == {}
    for k, mutant in enumerate(made):
        first.add(mutant, "failed" if k else "passed")
    first.keep()
    survivor, *killed = map(str, made)
    assert record("second.txt").fates == {survivor: "passed"} | dict.fromkeys(killed, "failed")
    assert record("third.txt", again=True).fates == dict.fromkeys(killed, "failed")
    monkeypatch.setattr(tool, "code_of", lambda _: "other")
    assert record("fourth.txt").fates == {}


@pytest.mark.parametrize(
    ("code", "same"),
    [
        ('"""A text."""\nfrom b import x\ny = x + 1\n', True),
        ('"""Another."""\nfrom a import x\ny = x + 1  # one more\n', True),
        ('"""A text."""\nfrom a import x\ny = x + 2\n', False),
    ],
)
def test_results_outlast_changes_that_no_mutant_sees(
    tmp_path: Path, code: str, same: bool
) -> None:
    before, after = tmp_path / "before.py", tmp_path / "after.py"
    before.write_text('"""A text."""\nfrom a import x\ny = x + 1\n', encoding="utf-8")
    after.write_text(code, encoding="utf-8")
    assert (code_of(before) == code_of(after)) is same
