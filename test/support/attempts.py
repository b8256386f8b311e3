# SPDX-License-Identifier: Apache-2.0
"""Try mutants: each in a copy of the package, by the tests that reach its line."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mutations import Mutant
from reach import Reach, Recorder

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PACKAGE = ROOT / "control_board_ros"
#: CPU time of one mutant, as a multiple of what its tests take when traced, and seconds more.
PATIENCE, MORE = 1.0, 20.0
#: CPU time of the run that records, s.
LONG = 7200.0
#: Where the tests of the core are.
FOLDERS = ("test/core", "test/robot", "test/spec")
#: What else does: the pages tell every default, bound and text.
PAGES = "test/docs/test_generated.py"
#: Tests that prove nothing of the core.
ASIDE = ("test_conformance_table", "test_reach")
#: Exit code of a run in which no test was found.
NOTHING = 5


def test_files() -> list[str]:
    """The files whose tests look at the core."""
    files = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("test_*.py"))
    return [*(str(path.relative_to(ROOT)) for path in files if path.stem not in ASIDE), PAGES]


class Order:
    """A plugin of pytest: these tests, in this order."""

    def __init__(self, tests: list[str]) -> None:
        self._places = {test: k for k, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Leave out all others."""
        chosen = [item for item in items if item.nodeid in self._places]
        items[:] = sorted(chosen, key=lambda item: self._places[item.nodeid])


class Copy:
    """A copy of the package without compiled modules, in which one module at a time is broken."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(
            PACKAGE,
            folder / PACKAGE.name,
            ignore=shutil.ignore_patterns("*.so", "*.c", "__pycache__"),
        )

    def record(self, path: Path) -> int:
        """Record what the tests reach, in a process; its id."""
        recorder = Recorder(self.folder / PACKAGE.name / "core", path)
        return self._start(test_files(), recorder, LONG)

    def try_one(self, mutant: Mutant, tests: list[str], seconds: float) -> int:
        """Try a mutant in a process with so much CPU time; its id."""
        path = self.folder / PACKAGE.name / "core" / f"{mutant.module.replace('.', '/')}.py"
        self._whole = path, path.read_text(encoding="utf-8")
        path.write_text(mutant.source(), encoding="utf-8")
        files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
        return self._start(files, Order(tests), seconds)

    def restore(self) -> None:
        """Make the broken module whole again."""
        path, text = self._whole
        path.write_text(text, encoding="utf-8")

    def _start(self, files: list[str], plugin: Any, seconds: float) -> int:
        child = os.fork()
        if child == 0:
            self._run(files, plugin, seconds)
        return child

    def _run(self, files: list[str], plugin: Any, seconds: float) -> None:
        """In the child: the tests, silently, on this copy; ends the process."""
        code = 99
        with contextlib.suppress(BaseException):
            null = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(null, stream)
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
            sys.path.insert(0, str(self.folder))
            os.environ["PYTHONPATH"] = str(self.folder)
            os.chdir(ROOT)
            sys.dont_write_bytecode = True
            options = ["-x", "-q", "--tb=no", "--assert=plain", f"--rootdir={ROOT}"]
            options += ["-p", "no:cacheprovider", "-p", "no:xdist", "-o", "timeout=0"]
            options += ["-m", "not ros and not slow and not soak"]
            import pytest

            code = int(pytest.main([*options, *files], plugins=[plugin]))
        os._exit(code)


def fate_of(status: int) -> str:
    """How the tests of a process went: passed, failed or endless.

    Raises:
        SystemExit: there were no tests, which says nothing of a mutant.
    """
    code = os.waitstatus_to_exitcode(status)
    if code == NOTHING:
        raise SystemExit("the tests recorded are not found again; try --anew")
    fate = {0: "passed", -signal.SIGXCPU: "endless", -signal.SIGKILL: "endless"}
    return fate.get(code, "failed")


def reach_of(folder: Path, path: Path) -> Reach:
    """Which tests reach which line; recorded first where that is not known yet.

    Args:
        folder: for a copy of the package.
        path: of the record.

    Raises:
        SystemExit: the tests fail without any mutant.
    """
    if not path.exists():
        print("recording which tests reach which lines (once, minutes)", flush=True)
        made = path.with_suffix(".part")
        _, status = os.waitpid(Copy(folder).record(made), 0)
        if fate_of(status) != "passed":
            raise SystemExit("the tests fail without any mutant: mend them first (make test)")
        made.replace(path)
    return Reach.read(path)


def attempts(
    tried: Iterable[Mutant], reach: Reach, jobs: int, folder: Path
) -> Iterator[tuple[Mutant, str]]:
    """Try mutants, so many at a time; each with its fate as soon as that is known.

    One that no test reaches has survived.
    """
    waiting = []
    for mutant in tried:
        if tests := reach.tests_for(mutant.module, mutant.line):
            waiting.append((mutant, tests))
        else:
            yield mutant, "passed"
    waiting.reverse()
    idle = [Copy(folder / str(k)) for k in range(min(jobs, len(waiting)))]
    running: dict[int, tuple[Copy, Mutant]] = {}
    try:
        while waiting or running:
            while waiting and idle:
                copied, (mutant, tests) = idle.pop(), waiting.pop()
                seconds = PATIENCE * sum(reach.seconds[test] for test in tests) + MORE
                running[copied.try_one(mutant, tests, seconds)] = copied, mutant
            child, status, _ = os.wait4(-1, 0)
            copied, mutant = running.pop(child)
            copied.restore()
            idle.append(copied)
            yield mutant, fate_of(status)
    finally:
        for child in running:  # of a run that was stopped
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
