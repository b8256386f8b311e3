# SPDX-License-Identifier: Apache-2.0
"""Try mutants: each in a copy of the package, by the tests that reach its line.

Where only functions differ, a process that has collected all tests forks for each mutant, and
the fork exchanges their code. What importing runs is imported anew instead, which takes longer.
"""

from __future__ import annotations

import ast
import compileall
import contextlib
import functools
import hashlib
import json
import multiprocessing
import os
import resource
import shutil
import signal
import sys
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from exchange import Functions
from mutations import Mutant, uses
from reach import Reach, Recorder, merged

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PACKAGE = ROOT / "control_board_ros"
#: CPU time of one mutant, as a multiple of what its tests take when traced, and seconds more.
PATIENCE, MORE = 1.0, 20.0
#: CPU time of the run that records, s.
LONG = 7200.0
#: CPU time of a process that forks for mutants, s.
FOREVER = 1e7
#: What else tests the core: the pages list every default, bound and text.
PAGES = "test/docs/test_generated.py"
#: Exit codes of a process: no test was found; the code could not be exchanged.
NOTHING, NOT_EXCHANGED = 5, 97
#: Tests of a module that killed before, which are tried first.
KILLERS = 12


@dataclass(frozen=True)
class Tree:
    """Modules that are broken, and the tests that look at them.

    Attributes: name (of the folder of its modules, below the package), tests (folders and files),
        aside (files of these folders that prove nothing), modules (patterns of the files that are
        broken).
    """

    name: str
    tests: tuple[str, ...]
    aside: tuple[str, ...] = ()
    modules: tuple[str, ...] = ("**/*.py",)

    @property
    def folder(self) -> Path:
        return PACKAGE / self.name

    @property
    def paths(self) -> list[Path]:
        """The files that are broken."""
        return sorted(path for each in self.modules for path in self.folder.glob(each))

    def path(self, module: str) -> Path:
        """The file of a module."""
        return self.folder / f"{module.replace('.', '/')}.py"

    @property
    def files(self) -> list[str]:
        """The files of its tests."""
        found = []
        for place in self.tests:
            path = ROOT / place
            some = [path] if path.is_file() else sorted(path.glob("test_*.py"))
            found += [str(one.relative_to(ROOT)) for one in some if one.stem not in self.aside]
        return found


CORE = Tree(
    "core",
    ("test/core", "test/robot", "test/spec", PAGES),
    ("test_conformance_table", "test_reach", "test_exchange"),
)
#: What all makes of drives share, by tests that are quick.
QUICK = "axes bring_up can_line can_socket drive_reports drives_plant interview moteus_frames"
QUICK += " reconcile serial_line servo_bus set_id supply turns words"
DRIVES = Tree("plants/drives", tuple(f"test/plants/test_{name}.py" for name in QUICK.split()))
#: Codecs and set-ups of the makes, by these, and by what others pack.
ROOMS = "moteus mit_can dynamixel cia402 odrive_can feetech"
BY_VALUE = "mit_codecs moteus_codec odrive_codec cia402_codec servo_codecs"
CODECS = "driver frames table objects states sdo identity damiao robstride robstride_private"
MAKES = Tree(
    "plants",
    (
        *DRIVES.tests,
        "test/plants/test_drive_hazards.py",
        "test/plants/test_makes.py",
        *(f"test/plants/test_{name}.py" for name in BY_VALUE.split()),
        *(f"test/judged/test_{name}.py" for name in ("codecs", "golden", "durand")),
    ),
    modules=tuple(f"{room}/{name}.py" for room in ROOMS.split() for name in CODECS.split()),
)
TREES = {"core": CORE, "drives": DRIVES, "makes": MAKES}


@dataclass(frozen=True)
class Trial:
    """A mutant, the tests to try it by, in this order, and the CPU seconds that they may take."""

    mutant: Mutant
    tests: list[str]
    seconds: float


class Killers:
    """The tests that killed mutants of a function or module before: tried first, latest first."""

    def __init__(self) -> None:
        self._of: defaultdict[str, deque[str]] = defaultdict(lambda: deque(maxlen=KILLERS))

    def add(self, mutant: Mutant, killer: str) -> None:
        """A test has killed a mutant."""
        for name in self._names(mutant):
            with contextlib.suppress(ValueError):
                self._of[name].remove(killer)
            self._of[name].appendleft(killer)

    def of(self, trial: Trial) -> list[str]:
        """Those of a trial's tests that killed before in the same function, then in the module."""
        found = dict.fromkeys(
            test for name in self._names(trial.mutant) for test in self._of[name]
        )
        return [test for test in found if test in trial.tests]

    def _names(self, mutant: Mutant) -> tuple[str, str]:
        return f"{mutant.module}: {mutant.name.partition(':')[0]}", mutant.module


class Order:
    """A plugin of pytest: these tests, in this order; the first that fails goes into a pipe."""

    def __init__(self, tests: list[str], pipe: int) -> None:
        self._places, self._pipe = {test: k for k, test in enumerate(tests)}, pipe

    def pytest_runtest_logreport(self, report: Any) -> None:
        """The first failure decides."""
        if report.failed:
            os.write(self._pipe, report.nodeid.encode())
            os._exit(1)

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        """Leave out all others."""
        chosen = [item for item in items if item.nodeid in self._places]
        items[:] = sorted(chosen, key=lambda item: self._places[item.nodeid])


class Imports:
    """A plugin of pytest: the modules of a tree are there before the first test, which may be late
    to import them.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree

    def pytest_collection_modifyitems(self) -> None:
        """All tests are collected."""
        for path in self._tree.paths:
            import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))


class Copy:
    """A copy of the package, in which one module at a time is broken.

    Args:
        folder: in which it is made.
        tree: of the modules to break.
        compiled: with the compiled modules, whose source is not looked at then.
    """

    def __init__(self, folder: Path, tree: Tree, *, compiled: bool = False) -> None:
        self.folder, self._tree = folder, tree
        left = shutil.ignore_patterns("*.c", "__pycache__", *([] if compiled else ["*.so"]))
        shutil.copytree(PACKAGE, folder / PACKAGE.name, ignore=left)
        compileall.compile_dir(folder / PACKAGE.name, quiet=2)

    @property
    def modules(self) -> Path:
        """The folder of the modules that are broken."""
        return self.folder / PACKAGE.name / self._tree.name

    def path(self, mutant: Mutant) -> Path:
        """The file that a mutant breaks."""
        return self.modules / f"{mutant.module.replace('.', '/')}.py"

    def whole(self, mutant: Mutant) -> str:
        """The module of a mutant unbroken, written as mutants are."""
        return _unparsed(self._tree.path(mutant.module))

    @contextlib.contextmanager
    def broken(self, mutant: Mutant) -> Iterator[None]:
        """Break a module, and make it whole again, with its time: what is compiled stays valid."""
        path = self.path(mutant)
        text, times = path.read_text(encoding="utf-8"), path.stat()
        path.write_text(mutant.source(), encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))

    def run(self, files: list[str], plugin: Any) -> int:
        """The tests of these files, silently, on this copy; their exit code."""
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        sys.path.insert(0, str(self.folder))
        os.environ["PYTHONPATH"] = str(self.folder)
        os.chdir(ROOT)
        sys.dont_write_bytecode = True
        options = ["-x", "-q", "--tb=no", "--assert=plain", f"--rootdir={ROOT}"]
        options += ["-p", "no:cacheprovider", "-p", "no:xdist", "-o", "timeout=0"]
        options += ["-m", "not ros and not slow and not soak"]
        options += [f"--basetemp={self.folder / 'temporary'}"]
        import pytest

        return int(pytest.main([*options, *files], plugins=[plugin, Imports(self._tree)]))


def forked(work: Callable[[], int], seconds: float, *, group: bool = False) -> int:
    """Do this in a process with so much CPU time, of which the exit code is what it returns.

    Args:
        work: what to do.
        seconds: CPU time.
        group: whether it leads a group of processes, which can be ended at once.

    Returns:
        The process's id.
    """
    child = os.fork()
    if child == 0:
        code = 99
        with contextlib.suppress(BaseException):
            if group:
                os.setpgid(0, 0)
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 5))
            code = work()
        os._exit(code)
    return child


class Exchanging:
    """A plugin of pytest: tries mutants by the tests that are collected, in a fork for each.

    Args:
        copy: the package that these tests import.
        trials: all of them.
        turn: the number of the next one, shared with others like this one.
        results: a pipe for lines of number and status of the fork.
    """

    def __init__(self, copy: Copy, trials: list[Trial], turn: Any, results: int) -> None:
        self._copy, self._trials, self._turn, self._results = copy, trials, turn, results
        self._killers, self._pipe = Killers(), -1

    def pytest_runtestloop(self, session: Any) -> bool:
        """Try those whose turn it is, until there are no more."""
        self._items = {item.nodeid: item for item in session.items}
        self._functions = Functions(self._copy.modules)
        while (k := self._next()) < len(self._trials):
            trial = self._trials[k]
            with self._copy.broken(trial.mutant):
                pipe, self._pipe = os.pipe()
                child = forked(functools.partial(self._attempt, trial), trial.seconds)
                os.close(self._pipe)
                with os.fdopen(pipe, encoding="utf-8") as pipe_end:
                    killer = pipe_end.read()
                _, status = os.waitpid(child, 0)
            if killer:
                self._killers.add(trial.mutant, killer)
            os.write(self._results, f"{k} {status}\n".encode())
        return True

    def _next(self) -> int:
        with self._turn.get_lock():
            self._turn.value += 1
            return int(self._turn.value) - 1

    def _attempt(self, trial: Trial) -> int:
        """In the fork: the exit code of pytest."""
        path = self._copy.path(trial.mutant)
        broken = path.read_text(encoding="utf-8")
        if not self._functions.exchange(path, self._copy.whole(trial.mutant), broken):
            return NOT_EXCHANGED
        order = dict.fromkeys([*self._killers.of(trial), *trial.tests])
        items = [self._items[test] for test in order if test in self._items]
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        return 0 if items else NOTHING

    def pytest_runtest_logreport(self, report: Any) -> None:
        """In the fork: the first failure decides."""
        if report.failed:
            os.write(self._pipe, report.nodeid.encode())
            os._exit(1)


@functools.cache
def _unparsed(path: Path) -> str:
    return ast.unparse(ast.parse(path.read_text(encoding="utf-8")))


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


def reach_of(tree: Tree, folder: Path, path: Path) -> Reach:
    """Which tests reach which line; recorded first of files that are new or have changed.

    Args:
        tree: of the modules.
        folder: for a copy of the package.
        path: of the record, which is of this state of the package.

    Raises:
        SystemExit: the tests fail without any mutant.
    """
    recorded: dict[str, Any] = {
        "files": {},
        "seconds": {},
        "lines": {},
        "imported": {},
        "often": {},
    }
    if path.exists():
        recorded = json.loads(path.read_text(encoding="utf-8"))
    before, now = recorded["files"], {file: digest_of([ROOT / file]) for file in tree.files}
    anew = [file for file in now if before.get(file) != now[file]]
    if anew or before != now:
        print(f"recording which lines the tests of {len(anew)} files reach", flush=True)
        part, copy = path.with_suffix(".part"), Copy(folder, tree)
        recorder = Recorder(copy.modules, part)
        if anew:
            child = forked(functools.partial(copy.run, anew, recorder), LONG)
            if fate_of(os.waitpid(child, 0)[1]) != "passed":
                failed = part.read_text(encoding="utf-8") if part.exists() else "the collection"
                part.unlink(missing_ok=True)
                raise SystemExit(f"without any mutant {failed} fails: mend it first (make test)")
            gone = {*anew, *before} - (now.keys() - {*anew})
            recorded = merged(recorded, json.loads(part.read_text(encoding="utf-8")), gone)
        part.write_text(json.dumps(recorded | {"files": now}), encoding="utf-8")
        part.replace(path)
    return Reach.read(path)


def digest_of(files: Iterable[Path]) -> str:
    """A digest of the contents of files."""
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.read_bytes())
    return digest.hexdigest()


class OnlyCode(ast.NodeTransformer):
    """Leaves out docstrings, texts for people and imports: mutants leave them alone, too."""

    def visit(self, node: ast.AST) -> Any:
        """Leave out a docstring, too."""
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            node.body[0] = ast.Pass()
        return super().visit(node)

    def visit_Constant(self, node: ast.Constant) -> ast.Constant:
        """A word may be a key; several are a text."""
        text = isinstance(node.value, str) and " " in node.value.strip()
        return ast.Constant("") if text else node

    def visit_Import(self, node: ast.Import) -> None:
        """A name is the same wherever it comes from."""

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """A name is the same wherever it comes from."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.JoinedStr:
        """What a text is made of stays."""
        values = [self.visit(one) for one in node.values if isinstance(one, ast.FormattedValue)]
        return ast.JoinedStr(values)


def code_of(module: Path) -> str:
    """A short digest of what a module does: of its code without comments, texts and imports."""
    tree = OnlyCode().visit(ast.parse(module.read_text(encoding="utf-8")))
    return hashlib.sha256(ast.unparse(tree).encode()).hexdigest()[:16]


def is_compiled(tree: Tree, mutant: Mutant) -> bool:
    """Whether the module of a mutant has a compiled form."""
    path = tree.path(mutant.module)
    return any(path.parent.glob(f"{path.stem}.*.so"))


def attempts(
    tree: Tree, tried: Iterable[Mutant], reach: Reach, jobs: int, budget: float, folder: Path
) -> Iterator[tuple[Mutant, str]]:
    """Try mutants, ``jobs`` at a time; each with its fate as soon as that is known.

    One that no test reaches has survived.

    Args:
        tree: of their modules.
        tried: the mutants.
        reach: which tests reach them.
        jobs: how many at a time.
        budget: seconds that the tests of one take, traced; what takes longer is not tried.
        folder: for copies of the package.
    """
    trials, at_import = [], set[str]()
    for mutant in tried:
        used: list[int] = []
        if reach.at_import(mutant.module, mutant.line):
            used = uses(tree.path(mutant.module).read_text(encoding="utf-8"), mutant.line)
        tests = reach.tests_for(mutant.module, mutant.line, used)
        if reach.at_import(mutant.module, mutant.line) and not used:  # most are in a table there
            tests.sort(key=lambda test: not test.startswith(PAGES))
        tests = reach.within(tests, budget)
        if not tests:
            yield mutant, "passed"
            continue
        seconds = PATIENCE * sum(reach.seconds[test] for test in tests) + MORE
        trials.append(Trial(mutant, tests, seconds))
        if reach.at_import(mutant.module, mutant.line):
            at_import.add(str(mutant))
    compileall.compile_dir(ROOT / "test", quiet=2)
    for compiled in (True, False):  # what is compiled is faster, where it is not broken itself
        these = [one for one in trials if is_compiled(tree, one.mutant) is not compiled]
        copies = [Copy(folder / f"{k}{compiled}", tree, compiled=compiled) for k in range(jobs)]
        imported = [trial for trial in these if str(trial.mutant) in at_import]
        exchanged = [trial for trial in these if str(trial.mutant) not in at_import]
        for trial, status in by_exchange(exchanged, copies):
            if os.waitstatus_to_exitcode(status) == NOT_EXCHANGED:
                imported.append(trial)
            else:
                yield trial.mutant, fate_of(status)
        for trial, status in by_import(imported, copies):
            yield trial.mutant, fate_of(status)


def by_exchange(trials: list[Trial], copies: list[Copy]) -> Iterator[tuple[Trial, int]]:
    """Try mutants by processes that have all tests collected, one for each copy."""
    turn = multiprocessing.get_context("fork").Value("i", 0)
    files = sorted({test.partition("::")[0] for trial in trials for test in trial.tests})
    results, sending = os.pipe()
    children = []
    for copy in copies[: len(trials)]:
        work = functools.partial(copy.run, files, Exchanging(copy, trials, turn, sending))
        children.append(forked(work, FOREVER, group=True))
    os.close(sending)
    left = len(trials)
    try:
        with os.fdopen(results, encoding="utf-8") as lines:
            for line in lines:
                k, status = map(int, line.split())
                left -= 1
                yield trials[k], status
    finally:
        for child in children:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
    if left:
        raise SystemExit("the tests cannot be collected without any mutant: see make test")


@dataclass
class Running:
    """A process that tries a mutant by all its tests, or by those that killed before."""

    trial: Trial
    copy: Copy
    killers: list[str]
    breaking: contextlib.ExitStack
    pipe: int

    @classmethod
    def start(cls, trial: Trial, copy: Copy, killers: list[str]) -> tuple[int, Running]:
        """Start it; with its id."""
        tests, (pipe, sending) = killers or trial.tests, os.pipe()
        files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
        breaking = contextlib.ExitStack()
        breaking.enter_context(copy.broken(trial.mutant))
        work = functools.partial(copy.run, files, Order(tests, sending))
        child = forked(work, trial.seconds)
        os.close(sending)
        return child, cls(trial, copy, killers, breaking, pipe)

    def end(self) -> str:
        """It has ended: the test that failed, or an empty text."""
        self.breaking.close()
        with os.fdopen(self.pipe, encoding="utf-8") as lines:
            return lines.read()


def by_import(trials: list[Trial], copies: list[Copy]) -> Iterator[tuple[Trial, int]]:
    """Try mutants by a process for each, which imports the package anew."""
    killers, idle = Killers(), [*copies]
    waiting: list[tuple[Trial, bool]] = [(trial, True) for trial in reversed(trials)]
    running: dict[int, Running] = {}
    try:
        while waiting or running:
            while waiting and idle:
                trial, first = waiting.pop()
                child, one = Running.start(trial, idle.pop(), killers.of(trial) if first else [])
                running[child] = one
            child, status, _ = os.wait4(-1, 0)
            one = running.pop(child)
            idle.append(one.copy)
            if killer := one.end():
                killers.add(one.trial.mutant, killer)
            if status == 0 and one.killers:
                waiting.append((one.trial, False))
            else:
                yield one.trial, status
    finally:
        for child in running:  # of a run that was stopped
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
