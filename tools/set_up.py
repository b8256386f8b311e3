# SPDX-License-Identifier: Apache-2.0
"""Makes the environment of the Makefile, and returns at once where it is up to date.

By uv where it is there or can be had, else by pip. Packages come in while messages and laws
compile. An interrupted call continues with the next one.
"""

from __future__ import annotations

import ast
import contextlib
import fcntl
import json
import os
import runpy
import shutil
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from pathlib import Path

import store

ROOT = Path(__file__).resolve().parents[1]
#: What the installation is made of, beside the modules that are compiled.
SOURCES = (
    *("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "tools/*.py", "tools/*.cmake"),
    *("control_board_ros/__init__.py", "control_board_ros/compiled.py"),
    *(f"{folder}/**/*" for folder in ("msg_defs", "vendor", "config", "launch", "resource")),
)
#: Prints what setup.py requires, as an object of lists: "" is the base, others are extras.
REQUIREMENTS = """
import json
from distutils.core import run_setup
made = run_setup("setup.py", stop_after="init")
print(json.dumps({"": made.install_requires, **made.extras_require}))
"""
#: Settings of pip, and the variable of uv that means the same.
OF_UV = {
    "index-url": "UV_DEFAULT_INDEX",
    "find-links": "UV_FIND_LINKS",
    "no-index": "UV_NO_INDEX",
    "cert": "SSL_CERT_FILE",
}
#: Between two lines where no terminal shows a moving one, in seconds.
PATIENCE_S = 20.0


class Progress:
    """What is done and what is under way: one line that moves, or in a log a line now and then."""

    def __init__(self, last_s: float | None) -> None:
        self.last = f", last time {last_s:.0f} s" if last_s else ""
        self.begun = time.monotonic()
        self.doing: dict[str, str] = {}
        self.moves = sys.stdout.isatty()

    @contextlib.contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Name what is under way, and how long it took."""
        begun = time.monotonic()
        self.doing[name] = ""
        try:
            yield
            self.say(f"  {name}: {time.monotonic() - begun:.0f} s")
        finally:
            del self.doing[name]

    def say(self, line: str) -> None:
        """Print a line that stays."""
        print(f"\r\033[K{line}" if self.moves else line, flush=True)

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Show what is under way, until the end of the block."""
        over = threading.Event()

        def show() -> None:
            while not over.wait(0.5 if self.moves else PATIENCE_S):
                steps = ", ".join(f"{name}{more}" for name, more in list(self.doing.items()))
                line = f"  {steps} … {self.seconds:.0f} s{self.last}"
                print(f"\r\033[K{line}" if self.moves else line, end="\n" * (not self.moves))
                sys.stdout.flush()

        thread = threading.Thread(target=show, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()
            if self.moves:
                print("\r\033[K", end="", flush=True)

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.begun


class Installer:
    """uv or pip, for one environment; what they print goes into a log."""

    def __init__(self, python: Path, log: Path) -> None:
        self.python = python
        self.log = log
        self.uv: str | None = None

    def run(self, *command: str | Path, environment: dict[str, str] | None = None) -> bool:
        """Whether a command succeeds."""
        with self.log.open("a", encoding="utf-8") as log:
            print("$", *command, file=log, flush=True)
            done = subprocess.run(
                command, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False
            )
        return done.returncode == 0

    def find_uv(self) -> None:
        """Take uv where it is, else get it; where there is none, pip does."""
        beside = self.python.with_name("uv")
        if os.environ.get("CONTROL_BOARD_INSTALLER") == "pip":
            return
        if found := shutil.which("uv"):
            self.uv = found
        elif beside.is_file() or self.run(*self.pip(), "uv"):
            self.uv = str(beside)

    def pip(self) -> list[str | Path]:
        return [self.python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]

    def uv_environment(self) -> dict[str, str]:
        """With the package index that pip is set to, and a cache that can be written."""
        environment = dict(os.environ)
        listed = subprocess.run(
            [self.python, "-m", "pip", "config", "list"],
            capture_output=True,
            text=True,
            check=False,
        )
        for line in sorted(listed.stdout.splitlines(), key=lambda line: line.startswith(":env:")):
            name, _, value = line.partition("=")
            variable = OF_UV.get(name.rpartition(".")[2])
            if variable and variable not in os.environ:
                environment[variable] = ",".join(ast.literal_eval(value).split())
        if store.folder() == store.LOCAL:
            environment.setdefault("UV_CACHE_DIR", str(ROOT / "build" / "uv"))
        return environment

    def install(self, what: str, *arguments: str, anew: str = "") -> None:
        """Install; by uv from its cache where there is no network, by pip where uv fails.

        Args:
            what: For people.
            arguments: Of `pip install`.
            anew: A package to install again, though its version is there.

        Raises:
            SystemExit: Nothing could; with one line.
        """
        if self.uv:
            uv = [self.uv, "pip", "install", "--python", self.python]
            again = ["--reinstall-package", anew] if anew else []
            environment = self.uv_environment()
            for offline in ([], ["--offline"]):
                if self.run(*uv, *offline, *again, *arguments, environment=environment):
                    return
        if not self.run(*self.pip(), *arguments):
            lines = self.log.read_text("utf-8", "replace").splitlines()
            errors = [line for line in lines if line.lower().startswith(("error:", "  × "))]
            cause = errors[-1].strip() if errors else "see the log"
            raise SystemExit(
                f"cannot install {what}: {cause}; is the package index reachable? log: {self.log}"
            )


def sources() -> list[Path]:
    """The files that the installation is made of."""
    compiled = runpy.run_path(str(ROOT / "control_board_ros" / "compiled.py"))["MODULES"]
    names = [*SOURCES, *(f"{name.replace('.', '/')}.py" for name in compiled)]
    return sorted({path for name in names for path in ROOT.glob(name) if path.is_file()})


class Environment:
    """A virtual environment and what make has put into it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.python = folder / "bin" / "python"
        self.own = folder / ".control_board_ros"
        self.state = self.own / "state.json"
        self.log = self.own / "log.txt"
        self.done: dict[str, str] = {}
        #: Another Python runs this where the environment is not there, or its Python is gone.
        self.is_there = Path(sys.prefix).resolve() == folder.resolve()
        if self.is_there and self.state.is_file():
            self.done = json.loads(self.state.read_text())

    def wanted(self, extras: list[str]) -> dict[str, str]:
        """What is to be there, by name, as hashes of what it is made of."""
        files = [part for path in sources() for part in (str(path.relative_to(ROOT)), path)]
        packages = store.key([ROOT / "setup.py"])
        return {
            "build tools": store.key([ROOT / "pyproject.toml"]),
            "control_board_ros": store.key(files),
            **{f"packages {extra}".rstrip(): packages for extra in ("", *extras)},
        }

    def record(self, wanted: dict[str, str], *names: str) -> None:
        """Write down what is there."""
        self.done |= {name: wanted[name] for name in names}
        self.state.write_text(json.dumps(self.done, indent=1))

    def make(self, installer: Installer) -> None:
        """Make it, with the Python that runs this."""
        if (self.folder / "pyvenv.cfg").is_file():
            shutil.rmtree(self.folder)  # of a Python that is gone
        self.own.mkdir(parents=True, exist_ok=True)
        uv = shutil.which("uv")
        by_uv = [uv or "", "venv", "--seed", "--allow-existing", "--python", sys.executable]
        if uv and installer.run(*by_uv, self.folder):
            return
        if not installer.run(sys.executable, "-m", "venv", self.folder):
            raise SystemExit(f"cannot make {self.folder} with {sys.executable}; log: {self.log}")

    def requirements(self, extras: list[str]) -> list[str]:
        """What the project and its extras require."""
        done = subprocess.run(
            [self.python, "-c", REQUIREMENTS], cwd=ROOT, capture_output=True, text=True, check=True
        )
        required: dict[str, list[str]] = {}
        for name, lines in json.loads(done.stdout.splitlines()[-1]).items():
            extra, _, marker = name.partition(":")  # setuptools keeps what has a marker apart
            required.setdefault(extra, []).extend(
                f"{line}; {marker}" if marker else line for line in lines
            )
        if unknown := set(extras) - set(required):
            raise SystemExit(
                f"no extra {', '.join(sorted(unknown))}; there are: {', '.join(required)}"
            )
        return [line for extra in ("", *extras) for line in required[extra]]

    def compile(self, progress: Callable[[str], None]) -> None:
        """Build messages and laws, into the store; the installation finds them there."""
        command = [self.python, "setup.py", "-q", "build_ext", "--inplace"]
        said, done = [], dict[str, str]()
        with (
            self.log.open("a", encoding="utf-8") as log,
            subprocess.Popen(
                command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            ) as made,
        ):
            assert made.stdout is not None
            for line in made.stdout:
                if line.startswith(("messages ", "laws ")):
                    done[line.split()[0]] = line.strip()
                    progress(f" ({', '.join(done.values())})")
                else:
                    log.write(line)
                    said.append(line.rstrip())
        if made.returncode != 0:
            raise SystemExit("\n".join(said[-30:]))
        for line in said:
            if " is not compiled (" in line:
                print(line, file=sys.stderr)

    def set_up(self, wanted: dict[str, str], extras: list[str]) -> None:
        """Bring everything up to date, and say how it goes."""
        is_new = not self.is_there
        times = store.folder() / "times.json"
        last_s = json.loads(times.read_text())["first"] if is_new and times.is_file() else None
        progress = Progress(last_s)
        self.own.mkdir(parents=True, exist_ok=True)
        self.log.write_text("")
        installer = Installer(self.python, self.log)
        with progress.shown():
            if is_new:
                version = f"Python {sys.version_info[0]}.{sys.version_info[1]}"
                hint = f"{last_s:.0f} s last time" if last_s else "a minute or two"
                progress.say(f"setting up {self.folder} with {version}, once: {hint}")
                with progress.step("environment"):
                    self.make(installer)
            if self.done.get("build tools") != wanted["build tools"]:
                with progress.step("build tools"):
                    installer.find_uv()
                    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
                    installer.install("the build tools", *project["build-system"]["requires"])
                self.record(wanted, "build tools")
            else:
                installer.find_uv()
            self.complete(wanted, extras, installer, progress)
        if is_new:
            times.write_text(json.dumps({"first": progress.seconds}))
            subprocess.run([self.folder / "bin" / "control_board", "--version"], check=False)

    def complete(
        self, wanted: dict[str, str], extras: list[str], installer: Installer, progress: Progress
    ) -> None:
        """The two that take long, at once; then the project itself."""
        packages = [name for name in wanted if name.startswith("packages")]
        missing = [name for name in packages if self.done.get(name) != wanted[name]]

        def install() -> None:
            with progress.step(f"packages{''.join(f' {extra}' for extra in extras)}"):
                installer.install("packages", *self.requirements(extras))
            self.record(wanted, *missing)

        def compile_all() -> None:
            name = "messages and laws"
            with progress.step(name):
                self.compile(lambda text: progress.doing.update({name: text}))

        is_same = self.done.get("control_board_ros") == wanted["control_board_ros"]
        steps = [install] * bool(missing) + [compile_all] * (not is_same)
        with ThreadPoolExecutor(2) as both:
            done, _ = wait([both.submit(step) for step in steps], return_when=FIRST_EXCEPTION)
        for step in done:
            step.result()
        if not is_same:
            arguments = ("--no-deps", "--no-build-isolation", "-e", ".")
            with progress.step("control_board_ros"):
                installer.install("control_board_ros", *arguments, anew="control_board_ros")
            self.record(wanted, "control_board_ros")


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Wait while another call sets up in this checkout."""
    (ROOT / "build").mkdir(exist_ok=True)
    with (ROOT / "build" / "set_up.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("waiting for another make that sets up here", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def main(argv: list[str]) -> None:
    """Set up an environment: its folder, then the extras."""
    folder, extras = Path(argv[0]), argv[1:]
    with alone():
        environment = Environment(folder)
        wanted = environment.wanted(extras)
        if any(environment.done.get(name) != key for name, key in wanted.items()):
            environment.set_up(wanted, extras)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit("interrupted; the next call continues")
