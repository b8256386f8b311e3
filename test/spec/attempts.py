# SPDX-License-Identifier: Apache-2.0
"""Try mutants: each in a copy of the package, by the tests that find it soonest."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from mutations import Mutant

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PACKAGE = ROOT / "control_board_ros"
#: CPU time of one mutant, as a multiple of what the tests take without any, and seconds more.
PATIENCE, MORE = 2.0, 20.0

#: Tests that prove nothing of the core, or take long for what they find.
ASIDE = ("test_conformance_table", "test_vocabs")
#: Modules whose formulas the tests of test/core look at; of others the rules find more, sooner.
DIRECT = ("laws", "control", "trajectory", "path", "follower", "arrival", "config", "parts")
#: The rules that look at a module, where their file has another name.
OWN = {
    "board": "rules_modes",
    "calibrations": "rules_calibration",
    "calibrator": "rules_calibration",
    "calibration": "rules_calibration",
    "causes": "rules_faults",
    "checks": "rules_calibration",
    "commands": "rules_motion",
    "decisions": "rules_modes",
    "explanations": "rules_modes",
    "fault_monitor": "rules_faults",
    "faults": "rules_faults",
    "hard_stop": "rules_hard_stop",
    "heat": "rules_faults",
    "limits": "rules_motion",
    "machine": "rules_modes",
    "modes": "rules_modes",
    "monitor": "rules_faults",
    "references": "rules_motion",
    "timeouts": "rules_motion",
}
#: Those that take longest for what they find.
SLOW = ("laws", "physics", "rules_calibration", "rules_hard_stop")


def tests_for(module: str) -> list[list[str]]:
    """The test files: those of a module, then the others, those that find most soonest first."""
    core = sorted((ROOT / "test/core").glob("test_*.py"))
    spec = sorted(HERE.glob("test_*.py"))
    files = [path for path in (*core, *spec) if path.stem not in ASIDE]

    def own(path: Path) -> bool:
        name = path.stem.removeprefix("test_")
        return name == OWN.get(module) or (name.startswith(module) and name not in SLOW)

    def place(path: Path) -> tuple[bool, bool, bool]:
        name, folder = path.stem.removeprefix("test_"), path.parent.name
        near = (folder == "core") == (module in DIRECT)
        return not near, name != "machine_stateful", folder == "spec" and name in SLOW

    first = [path for path in files if own(path)]
    rest = [path for path in sorted(files, key=place) if not own(path)]
    return [[str(path) for path in group] for group in (first, rest) if group]


class Copy:
    """A copy of the package without compiled modules, in which one module at a time is broken."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(
            PACKAGE,
            folder / PACKAGE.name,
            ignore=shutil.ignore_patterns("*.so", "*.c", "__pycache__"),
        )

    def start(self, mutant: Mutant | None, seconds: float) -> int:
        """Try a mutant, or none, in a process with so much CPU time; its id."""
        module = mutant.module if mutant else "laws"
        path = self.folder / PACKAGE.name / "core" / f"{module}.py"
        self._whole = path, path.read_text(encoding="utf-8")
        if mutant:
            path.write_text(mutant.source(), encoding="utf-8")
        child = os.fork()
        if child == 0:
            self._run(tests_for(module), seconds)
        return child

    def restore(self) -> None:
        """Make the broken module whole again."""
        path, text = self._whole
        path.write_text(text, encoding="utf-8")

    def _run(self, groups: list[list[str]], seconds: float) -> None:
        """In the child: the tests, silently, on this copy; ends the process."""
        code = 99
        with contextlib.suppress(BaseException):
            null = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(null, stream)
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
            sys.path.insert(0, str(self.folder))
            os.environ["PYTHONPATH"] = str(self.folder)
            sys.dont_write_bytecode = True
            options = ["-x", "-q", "--tb=no", "--assert=plain", f"--rootdir={ROOT}"]
            options += ["-p", "no:cacheprovider", "-p", "no:xdist", "-o", "timeout=0"]
            options += ["-m", "not ros and not slow"]
            import pytest

            for files in groups:
                code = int(pytest.main([*options, *files]))
                if code:
                    break
        os._exit(code)


def fate_of(status: int) -> str:
    """How the tests of a process went: passed, failed or endless."""
    code = os.waitstatus_to_exitcode(status)
    fate = {0: "passed", -signal.SIGXCPU: "endless", -signal.SIGKILL: "endless"}
    return fate.get(code, "failed")


def attempts(tried: Iterable[Mutant], jobs: int, folder: Path) -> Iterator[tuple[Mutant, str]]:
    """Try mutants, so many at a time; each with its fate as soon as that is known.

    Raises:
        SystemExit: the tests fail without any mutant.
    """
    waiting, idle = list(tried)[::-1], [Copy(folder / str(k)) for k in range(jobs)]
    if not waiting:
        return
    _, status, used = os.wait4(idle[0].start(None, 3600.0), 0)
    seconds = used.ru_utime + used.ru_stime
    if fate_of(status) != "passed":
        raise SystemExit("the tests fail without any mutant: mend them first (make test)")
    print(f"without a mutant the tests take {seconds:.0f} s of CPU time", flush=True)
    running: dict[int, tuple[Copy, Mutant]] = {}
    try:
        while waiting or running:
            while waiting and idle:
                copied, mutant = idle.pop(), waiting.pop()
                running[copied.start(mutant, PATIENCE * seconds + MORE)] = copied, mutant
            child, status, _ = os.wait4(-1, 0)
            copied, mutant = running.pop(child)
            copied.restore()
            idle.append(copied)
            yield mutant, fate_of(status)
    finally:
        for child in running:  # of a run that was stopped
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
