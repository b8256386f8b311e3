# SPDX-License-Identifier: Apache-2.0
"""``make mutants``: break the core in one small way after the other; a test must fail each time.

A sample, drawn from a seed; ARGS="--all" tries every mutant, "--sample 300", "--seed 7",
"--only laws limits" (parts of names), "--jobs 4" and "--list" choose otherwise. A mutant is
written into a copy of the package, with the laws uncompiled, and tried in a process of its own by
the tests of test/core, test/robot, test/spec and the generated pages that reach its line, those
that take least first: seconds, where one of them fails. Which tests these are is recorded first,
by a run of all of them, later of those whose file has changed. A test that hangs is ended by its
CPU time, so a busy machine changes no result.

Each result is kept in build/mutants.txt at once, what tests reach in build/mutants_reach.json. A
run that was interrupted goes on from there. At the end of a run all that is known is written into
known.txt, for the repository. When one of these tests changes, or with "--again",
those that survived are tried again; when the code of a module changes, all of that module; with
"--anew", all.

"--of drives" breaks plants/drives, what all makes of drives share, in place of the core; its files
are drives_known.txt and drives_survivors.txt. "--of makes" breaks codecs and set-ups of the makes.

All tests that reach a mutant may take minutes, those that kill it take seconds mostly: with
"--budget 60" only the first ones are run, up to 60 s as recorded. What they do not kill
counts as a survivor.

Those that no test can distinguish from the original are in survivors.txt, each with its reason.
Ends with 1 when another one survives, when one of the list is killed after all (with --all) or
is no mutant any more, or when less than 95 % are killed.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))

from attempts import (  # noqa: E402
    CORE,
    PACKAGE,
    ROOT,
    TREES,
    Tree,
    attempts,
    code_of,
    digest_of,
    reach_of,
)
from mutations import Mutant, mutants, rows  # noqa: E402
from reach import interval, module_name  # noqa: E402

#: Letters of results there.
SURVIVED = "s"
FATES = {"k": "failed", "e": "endless", SURVIVED: "passed"}
LEAST = 0.95


class Files:
    """Where the results of a tree are: known and survivors in the repository, others in build/.

    Args:
        tree: its name.
        folder, build: where those are.
    """

    def __init__(self, tree: str, folder: Path = HERE, build: Path = ROOT / "build") -> None:
        begin = "" if tree == "core" else f"{tree}_"
        self.known = folder / f"{begin}known.txt"
        self.survivors = folder / f"{begin}survivors.txt"
        self.record = build / f"{begin}mutants.txt"
        self.reach = build / f"{begin}mutants_reach.json"


def every(tree: Tree) -> list[Mutant]:
    """All mutants of a tree, module by module."""
    made: list[Mutant] = []
    for path in tree.paths:
        if path.stem == "__init__":
            continue
        text = path.read_text(encoding="utf-8")
        name = module_name(tree.folder, path)
        if tree is CORE and name == "terms.modes":
            from control_board_ros.core.terms import modes

            tables = {
                table: value
                for table, value in vars(modes).items()
                if table.isupper() and isinstance(value, (dict, frozenset))
            }
            made += rows(name, text, tables)
        made += mutants(name, text)
    return made


def survivors(text: str) -> dict[str, str]:
    """Reasons by mutant; a line is ``mutant | reason``, others begin with #."""
    found = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            name, _, reason = line.partition(" | ")
            if not reason.strip():
                raise SystemExit(f"survivors: {name!r} has no reason; add ' | why'")
            found[name.strip()] = reason.strip()
    return found


class Record:
    """The results so far, each with the code of its module, in a file that a stopped run leaves.

    Those of a module whose code has changed are forgotten; where tests have, the mutants that
    survived. What tests reach is recorded anew when any file of the package has changed. Those in
    the repository count, too.

    Args:
        tree: of the modules.
        files: where the results are.
        made: all mutants.
        anew: whether to forget everything.
        again: whether to forget the mutants that survived.
    """

    def __init__(
        self, tree: Tree, files: Files, made: list[Mutant], *, anew: bool, again: bool
    ) -> None:
        self.path, self.fates = (path := files.record), dict[str, str]()
        self._known = files.known
        self._made: dict[str, list[str]] = {}
        for mutant in made:
            self._made.setdefault(mutant.module, []).append(str(mutant))
        self._codes = {
            module_name(tree.folder, module): code_of(module)
            for module in tree.folder.rglob("*.py")
        }
        tests = [path for place in tree.tests for path in (ROOT / place).glob("*.py")]
        tests += [ROOT / place for place in tree.tests if place.endswith(".py")]
        tests += [*(ROOT / "docs").glob("*.py")] if tree is CORE else []
        heads = [f"# {digest_of(some)}" for some in (PACKAGE.rglob("*.py"), tests)]
        self._tests = heads[1]
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() and not anew else []
        if lines[:1] != heads[:1]:
            files.reach.unlink(missing_ok=True)
        if files.known.exists() and not anew:
            self._remember(files.known.read_text(encoding="utf-8").splitlines(), again=again)
        retry = lines[1:2] != heads[1:] or again
        for fate, code, name in (line.split(" ", 2) for line in lines[2:]):
            module = name.partition(":")[0]
            if self._codes.get(module) == code and not (retry and fate == "passed"):
                self.fates[name] = fate
        path.parent.mkdir(exist_ok=True)
        kept = [self._line(name, fate) for name, fate in self.fates.items()]
        path.write_text("\n".join([*heads, *kept, ""]), encoding="utf-8")

    def _remember(self, lines: list[str], *, again: bool) -> None:
        """The results of modules whose code is the same, as :meth:`keep` writes them."""
        retry = lines[1:2] != [self._tests] or again
        for module, code, letters in map(str.split, lines[2:]):
            names = self._made.get(module, [])
            if self._codes.get(module) == code and len(names) == len(letters):
                for name, letter in zip(names, letters, strict=True):
                    if letter in FATES and not (retry and letter == SURVIVED):
                        self.fates[name] = FATES[letter]

    def _line(self, name: str, fate: str) -> str:
        return f"{fate} {self._codes[name.partition(':')[0]]} {name}"

    def add(self, mutant: Mutant, fate: str) -> None:
        """Keep one result."""
        self.fates[str(mutant)] = fate
        with self.path.open("a", encoding="utf-8") as file:
            file.write(self._line(str(mutant), fate) + "\n")

    def keep(self) -> None:
        """Write into the repository: module, digest of its code, a letter for each mutant."""
        letters = {fate: letter for letter, fate in FATES.items()}
        lines = [
            f"# Written by make mutants: {', '.join(map(' '.join, FATES.items()))}, - untried."
        ]
        lines.append(self._tests)
        for module, names in self._made.items():
            fates = "".join(letters.get(self.fates.get(name, ""), "-") for name in names)
            lines.append(f"{module} {self._codes[module]} {fates}")
        self._known.write_text("\n".join([*lines, ""]), encoding="utf-8")


def chosen(made: list[Mutant], wanted: Any) -> list[Mutant]:
    """The mutants to try, as the command line says; a sample in the order drawn."""
    made = [m for m in made if not wanted.only or any(word in str(m) for word in wanted.only)]
    if wanted.all or wanted.sample >= len(made):
        return made
    return random.Random(wanted.seed).sample(made, wanted.sample)


def arguments(words: list[str]) -> Any:
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("--of", choices=TREES, default="core", help="the modules to break")
    parser.add_argument("--all", action="store_true", help="try every mutant")
    parser.add_argument("--sample", type=int, default=100, help="how many to try")
    parser.add_argument("--seed", type=int, default=1, help="which ones")
    parser.add_argument("--only", nargs="+", default=[], help="parts of their names")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time")
    parser.add_argument(
        "--budget", type=float, default=float("inf"), help="seconds of tests for each, traced"
    )
    parser.add_argument("--anew", action="store_true", help="forget the results so far")
    parser.add_argument("--again", action="store_true", help="try those again that survived")
    parser.add_argument("--list", action="store_true", help="print them, try none")
    return parser.parse_args(words)


def attempt_all(
    tried: list[Mutant], made: list[Mutant], known: dict[str, str], wanted: Any
) -> list[Mutant]:
    """Try mutants, of all that were made, and report each; those that survive.

    Listed ones run only with --all.
    """
    tree, files = TREES[wanted.of], Files(wanted.of)
    record = Record(tree, files, made, anew=wanted.anew, again=wanted.again)
    skipped = set() if wanted.all else set(known)
    left = [one for one in tried if str(one) not in {*record.fates, *skipped}]
    if len(left) < len(tried):
        print(f"{len(tried) - len(left)} of them are listed, or known from a run before")
    with tempfile.TemporaryDirectory(prefix="control_board_ros_mutants.") as folder:
        reach = reach_of(tree, Path(folder) / "recorded", files.reach)
        for mutant, fate in attempts(tree, left, reach, wanted.jobs, wanted.budget, Path(folder)):
            result = {"passed": "SURVIVED", "failed": "killed", "endless": "killed (time)"}[fate]
            result = "listed" if fate == "passed" and str(mutant) in known else result
            print(f"{result:<15}{mutant}", flush=True)
            record.add(mutant, fate)
    record.keep()
    return [one for one in tried if record.fates.get(str(one), "passed") == "passed"]


def table(tried: list[Mutant], alive: list[Mutant], known: Iterable[str]) -> str:
    """Counts by folder of the tree, as a table of Markdown."""
    listed, living = set(known), {str(mutant) for mutant in alive}
    counts: dict[str, list[int]] = {}
    for mutant in tried:
        row = counts.setdefault(str(mutant).partition(":")[0].partition(".")[0], [0, 0, 0])
        row[0] += 1
        row[1] += str(mutant) not in living
        row[2] += str(mutant) in living & listed
    counts["all"] = [sum(column) for column in zip(*counts.values(), strict=True)]
    lines = ["| modules | mutants | killed | | listed as equivalent |", "|---|--:|--:|--:|--:|"]
    lines += [
        f"| {name} | {all_of} | {killed} | {100.0 * killed / all_of:.1f} % | {same} |"
        for name, (all_of, killed, same) in counts.items()
    ]
    return "\n".join(lines)


def problems(
    tried: list[Mutant], alive: list[Mutant], known: dict[str, str], names: Iterable[str]
) -> list[str]:
    """What makes the run fail, a line each."""
    living, lines = {str(mutant) for mutant in alive}, []
    lines += [
        f"survived: {mutant} (line {mutant.line}): add a test, or a line to the survivors"
        for mutant in alive
        if str(mutant) not in known
    ]
    lines += [
        f"killed now: {mutant}: take its line out of the survivors"
        for mutant in tried
        if str(mutant) in known and str(mutant) not in living
    ]
    gone = set(known) - set(names)
    lines += [f"no mutant any more: {name}: take it out of the survivors" for name in gone]
    rate = 1.0 - len(alive) / len(tried) if tried else 1.0
    if rate < LEAST:
        lines.append(f"{100 * rate:.1f} % killed; at least {100 * LEAST:.0f} % must be")
    return lines


def main(words: list[str]) -> int:
    wanted = arguments(words)
    made, listed = every(TREES[wanted.of]), Files(wanted.of).survivors
    known = survivors(listed.read_text(encoding="utf-8") if listed.exists() else "")
    tried = chosen(made, wanted)
    if wanted.list:
        print("\n".join(f"{mutant}  (line {mutant.line})" for mutant in tried))
        return 0
    print(f"{len(tried)} of {len(made)} mutants, seed {wanted.seed}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that nothing is left behind
    begin = time.monotonic()
    # What every run imports; the package itself is left to the child, which takes the copy.
    import hypothesis  # noqa: F401
    import numpy as np  # noqa: F401
    import pytest  # noqa: F401

    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE.name]:
        del sys.modules[name]
    alive = attempt_all(tried, made, known, wanted)
    killed = len(tried) - len(alive)
    rate = 100.0 * killed / len(tried) if tried else 100.0
    took = time.monotonic() - begin
    low, high = (100.0 * bound for bound in interval(killed, len(tried)))
    print(f"\n{killed} of {len(tried)} mutants killed in {took:.0f} s: {rate:.1f} %", end="")
    print(f" (95 % confidence: {low:.1f} to {high:.1f} %)" if len(tried) < len(made) else "")
    if tried:
        print(f"\n{table(tried, alive, known)}\n")
    found = problems(tried, alive, known, map(str, made))
    print("\n".join(found))
    return int(bool(found))


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main(sys.argv[1:]))
