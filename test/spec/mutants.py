# SPDX-License-Identifier: Apache-2.0
"""``make mutants``: break the core in one small way after the other; a test must fail each time.

A sample, drawn from a seed; ARGS="--all" tries every mutant, "--sample 200", "--seed 7",
"--only laws watch" (parts of names) and "--list" choose otherwise. A mutant is written into a
copy of the package, with the laws uncompiled, and tried in a process of its own: first the tests
of test/core, those of its module ahead, then the quick ones of test/spec. A test that hangs is
ended by its CPU time, so a busy machine changes no result.

Those that no test can tell apart from the original are in survivors.txt, each with its reason.
Ends with 1 when another one survives, when one of the list is killed after all (with --all) or
is no mutant any more, or when less than 95 % are killed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PACKAGE = ROOT / "control_board_ros"
SURVIVORS = HERE / "survivors.txt"
LEAST = 0.95
#: CPU time of one mutant, as a multiple of what the tests take without any, and seconds more.
PATIENCE, MORE = 2.0, 20.0

#: Not the board's behaviour: names for the uncompiled laws.
LEFT_OUT = ("__init__", "nocython")
TABLES = (
    "TRANSITIONS",
    "ACCEPTS",
    "LAWS",
    "DIRECT_GAINS",
    "GUARDED",
    "UNCALIBRATED_MODES",
    "STORES_INTERACTION",
    "NO_FEEDFORWARD",
    "STOPPABLE",
    "AT_REST",
)
#: Tests that prove nothing of the core, or take long for what they find.
ASIDE = ("test_conformance_table", "test_vocabs")

sys.path.insert(0, str(HERE))

from mutations import Mutant, mutants, rows  # noqa: E402


def every() -> list[Mutant]:
    """All mutants of the core, module by module."""
    made: list[Mutant] = []
    for path in sorted((PACKAGE / "core").glob("*.py")):
        if path.stem in LEFT_OUT:
            continue
        text = path.read_text(encoding="utf-8")
        if path.stem == "modes":
            from control_board_ros.core import modes

            known = {name: getattr(modes, name) for name in TABLES if hasattr(modes, name)}
            made += rows("modes", text, known)
        made += mutants(path.stem, text)
    return made


def survivors(text: str) -> dict[str, str]:
    """Reasons by mutant; a line is ``mutant | reason``, others begin with #."""
    found = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            name, _, reason = line.partition(" | ")
            if not reason.strip():
                raise SystemExit(f"{SURVIVORS.name}: {name!r} has no reason; add ' | why'")
            found[name.strip()] = reason.strip()
    return found


#: Modules whose own formulas the tests of test/core look at; others are found sooner by the rules.
DIRECT = ("laws", "control", "trajectory", "path", "follower", "arrival", "config", "parts")
#: Files named otherwise than the module that they look at.
OWN = {
    "modes": "rules_modes",
    "requests": "rules_modes",
    "machine": "rules_calibration",
    "faults": "rules_faults",
    "monitor": "rules_faults",
    "watch": "rules_faults",
    "commands": "rules_motion",
    "references": "rules_motion",
    "calibrator": "rules_calibration",
    "heat": "rules_faults",
}
#: Those that take longest for what they find.
SLOW = ("laws", "physics", "rules_calibration", "rules_hard_stop")


def tests_for(module: str) -> list[str]:
    """The test files in the order in which they find a mutant of a module soonest."""
    core = sorted((ROOT / "test/core").glob("test_*.py"))
    spec = sorted(HERE.glob("test_*.py"))
    files = [path for path in (*core, *spec) if path.stem not in ASIDE]

    def place(path: Path) -> tuple[bool, bool, bool, bool]:
        name, folder = path.stem.removeprefix("test_"), path.parent.name
        own = name.startswith(module) or name == OWN.get(module)
        near = (folder == "core") == (module in DIRECT)
        slow = folder == "spec" and name in SLOW
        return not own, not near, name != "machine_stateful", slow

    return [str(path) for path in sorted(files, key=place)]


class Copy:
    """A copy of the package without compiled modules, in which one module at a time is broken."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        shutil.copytree(
            PACKAGE,
            folder / PACKAGE.name,
            ignore=shutil.ignore_patterns("*.so", "*.c", "__pycache__"),
        )

    def attempt(self, mutant: Mutant | None, seconds: float) -> tuple[str, float]:
        """How the tests go with a mutant: passed, failed or endless; and the CPU time, s."""
        path = self.folder / PACKAGE.name / "core" / f"{mutant.module if mutant else 'modes'}.py"
        text = path.read_text(encoding="utf-8")
        if mutant:
            path.write_text(mutant.source(), encoding="utf-8")
        try:
            child = os.fork()
            if child == 0:
                self._run(tests_for(mutant.module if mutant else "laws"), seconds)
            _, status, used = os.wait4(child, 0)
        finally:
            path.write_text(text, encoding="utf-8")
        code = os.waitstatus_to_exitcode(status)
        fate = {0: "passed", -signal.SIGXCPU: "endless", -signal.SIGKILL: "endless"}
        return fate.get(code, "failed"), used.ru_utime + used.ru_stime

    def _run(self, files: list[str], seconds: float) -> None:
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
            options = [
                "-x",
                "-q",
                "--tb=no",
                "-p",
                "no:cacheprovider",
                "-p",
                "no:xdist",
                "--assert=plain",
            ]
            options += ["-o", "timeout=0", "-m", "not ros and not slow", f"--rootdir={ROOT}"]
            import pytest

            code = int(pytest.main([*options, *files]))
        os._exit(code)


def chosen(made: list[Mutant], wanted: Any) -> list[Mutant]:
    """The mutants to try, as the command line says."""
    made = [m for m in made if not wanted.only or any(word in str(m) for word in wanted.only)]
    if wanted.all or wanted.sample >= len(made):
        return made
    picked = set(random.Random(wanted.seed).sample(range(len(made)), wanted.sample))
    return [mutant for k, mutant in enumerate(made) if k in picked]


def arguments(words: list[str]) -> Any:
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("--all", action="store_true", help="try every mutant")
    parser.add_argument("--sample", type=int, default=40, help="how many to try")
    parser.add_argument("--seed", type=int, default=1, help="which ones")
    parser.add_argument("--only", nargs="+", default=[], help="parts of their names")
    parser.add_argument("--list", action="store_true", help="print them, try none")
    return parser.parse_args(words)


def attempt_all(tried: list[Mutant], known: dict[str, str], *, again: bool) -> list[Mutant]:
    """Try mutants and tell of each; those that survive. Listed ones run only ``again``."""
    alive = []
    with tempfile.TemporaryDirectory(prefix="control_board_ros_mutants.") as folder:
        copied = Copy(Path(folder))
        fate, used = copied.attempt(None, 3600.0)
        if fate != "passed":
            raise SystemExit("the tests fail without any mutant: mend them first (make test)")
        print(f"without a mutant the tests take {used:.0f} s of CPU time", flush=True)
        for mutant in tried:
            if str(mutant) in known and not again:
                fate = "passed"
            else:
                fate, _ = copied.attempt(mutant, PATIENCE * used + MORE)
            told = {"passed": "SURVIVED", "failed": "killed", "endless": "killed (time)"}[fate]
            told = "listed" if fate == "passed" and str(mutant) in known else told
            print(f"{told:<15}{mutant}", flush=True)
            if fate == "passed":
                alive.append(mutant)
    return alive


def problems(
    tried: list[Mutant], alive: list[Mutant], known: dict[str, str], names: Iterable[str]
) -> list[str]:
    """What makes the run fail, a line each."""
    living, told = {str(mutant) for mutant in alive}, []
    told += [
        f"survived: {mutant} (line {mutant.line}): add a test, or a line to {SURVIVORS.name}"
        for mutant in alive
        if str(mutant) not in known
    ]
    told += [
        f"killed now: {mutant}: take its line out of {SURVIVORS.name}"
        for mutant in tried
        if str(mutant) in known and str(mutant) not in living
    ]
    gone = set(known) - set(names)
    told += [f"no mutant any more: {name}: take it out of {SURVIVORS.name}" for name in gone]
    rate = 1.0 - len(alive) / len(tried) if tried else 1.0
    if rate < LEAST:
        told.append(f"{100 * rate:.1f} % killed; at least {100 * LEAST:.0f} % must be")
    return told


def main(words: list[str]) -> int:
    wanted = arguments(words)
    made = every()
    known = survivors(SURVIVORS.read_text(encoding="utf-8"))
    tried = chosen(made, wanted)
    if wanted.list:
        print("\n".join(f"{mutant}  (line {mutant.line})" for mutant in tried))
        return 0
    print(f"{len(tried)} of {len(made)} mutants, seed {wanted.seed}")
    begin = time.monotonic()
    # What every run imports; the package itself is left to the child, which takes the copy.
    import hypothesis  # noqa: F401
    import numpy as np  # noqa: F401
    import pytest  # noqa: F401

    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE.name]:
        del sys.modules[name]
    alive = attempt_all(tried, known, again=wanted.all)
    killed = len(tried) - len(alive)
    rate = 100.0 * killed / len(tried) if tried else 100.0
    took = time.monotonic() - begin
    print(f"\n{killed} of {len(tried)} mutants killed ({rate:.1f} %) in {took:.0f} s")
    found = problems(tried, alive, known, map(str, made))
    print("\n".join(found))
    return int(bool(found))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main(sys.argv[1:]))
