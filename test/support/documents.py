# SPDX-License-Identifier: Apache-2.0
"""Reads the code blocks of a page, and runs those that are marked.

A comment before a block says what a test does with it:

    <!-- run -->               a console block: type its `$` lines, compare what they print;
                               a shell block: type its lines, each ends without an error;
                               a Python block: run it as a script of its own
    <!-- run, varies: 4.1 s; ° --> the same; the numbers in the texts named may be others, and
                               all numbers before a text without one
    <!-- run, with: A => B; C => D --> the same, with B in place of A: what a test has in place of
                               what a user has, as a virtual bus; also before `varies`
    <!-- run, beside: PROGRAM, with: … -->  the same, while a program goes on in another terminal
    <!-- output -->            what the Python block before it prints
    <!-- board -->             the line starts the board that the next blocks talk to
    <!-- board /icub/robot --> the same; the name of its node is this one
    <!-- file arm.yaml -->     the block is that file
    <!-- loads panda -->       the block is a parameter file that a robot accepts on top of its own
    <!-- package levers.py --> the block is the entry points of a package with that module, which
                               is installed beside the files for what is run from then on
    <!-- part of FILE -->      the block stands in that file of the project, as it is
    <!-- own ur.yaml: a b -->  the block is that file; the user's URDF that it names is one with
                               these joints, and it is loaded
    <!-- until Ctrl-C -->      each line is typed when the one before it has printed something, in
                               a terminal of its own where it goes on; Ctrl-C ends all of them, and
                               a board among them: then there is the one of before again
    <!-- not run: reason -->   it cannot be run in a test

Where a page says `pip install`, the package must have the extras that it names; `ros2` is
support/ros2.py. A prompt may name a host or a terminal (`robot$`). A line that ends in `&` starts
a board; where a page answers a question (`[y/N] y`), so does the test, in a terminal.

Spaces and the place in a bar do not count. A line of `...` in an output matches any lines. A
page that starts no board talks to one of the default configuration; pytest alone needs none. cbctl
runs within the test over one connection, in a terminal of 80 columns: what it takes to find the
board is tested elsewhere. A line that names a board (`--board`) or drives, and each of a shell
block, is a process of its own. The folder has `config` and `.venv` as the project's has.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from cbctl_terminal import Terminal
from waiting import until

from control_board_ros.cli.app import invoke
from control_board_ros.cli.board.session import Session
from control_board_ros.cli.line.options import Options
from control_board_ros.cli.text import output
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.settings.loading import load
from control_board_ros.testing import BoardProcess, board_process, child_environment

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^\n]*?) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S
)
NUMBER = r"[-+]?\d+(?:\.\d+)?"
#: A number as re.escape writes it, and the pattern for any number.
ESCAPED, ANY = r"(?:\\-)?\d+(?:\\\.\d+)?", NUMBER.replace("\\", "\\\\")
SUPPORT = Path(__file__).parent
#: The folder of programs of the environment, which users have activated.
BIN = str(Path(sys.executable).parent)
#: Fast DDS's server, whose libraries are those of rclpy.
SERVER = f"import os, sys, rclpy; os.execv('{BIN}/fast-discovery-server', sys.argv)"
#: Programs that a page runs, as words of Python.
PROGRAMS = {
    "cbctl": "-m control_board_ros.cli",
    "control_board": "-m control_board_ros.node.main",
    "control_board_conformance": "-m control_board_ros.conformance",
    "pytest": "-m pytest",
    "pip": f"'{SUPPORT / 'pip_install.py'}'",
    "ros2": f"'{SUPPORT / 'ros2.py'}'",
    "fast-discovery-server": f'-c "{SERVER}"',
    "python": "",
    "python3": "",
}
SHELL = ("sh", "bash")
QUESTION = re.compile(r"(.*\[y/N\] )(\w+)$", re.M)

MULTICAST = re.compile(r"(udp_multicast:239\.74\.163\.)\d+")
#: What is run, of the verbs.
RUN = ("run", "board", "loads", "own", "until")
#: s that programs which go on are watched.
WATCHED = 1.0
#: Programs that need no board.
ALONE = ("pytest", "pip", "fast-discovery-server", ".venv/bin/python")
#: What boards get before the words of a page: fewer cycles than its reader's.
FEWER = ["control_board", "--ros-args", "-p", "control_rate:=200.0"]
#: The page that shows limits which depend on the rate: its board has its reader's.
RATED = "impedance"
#: The board of a page that starts none and moves for 40 s.
FASTER = "control_board --ros-args -p control_rate:=100.0 -p real_time_factor:=6.0"
BOARDS = {"identify": FASTER}
#: Exit code of a program of ours that Ctrl-C ended.
INTERRUPTED = 130


@dataclass(frozen=True)
class Block:
    """A code block: its mark ("" without), language, text, and line in the page."""

    mark: str
    language: str
    text: str
    line: int

    @property
    def verb(self) -> str:
        return self.mark.partition(",")[0].partition(":")[0].split(" ")[0] if self.mark else ""

    @property
    def beside(self) -> list[str]:
        """The words of what goes on in another terminal."""
        return shlex.split(self.mark.partition("beside:")[2].partition(", with:")[0])

    @property
    def varies(self) -> list[str]:
        _, _, texts = self.mark.partition("varies:")
        return [text.strip() for text in texts.split(";") if text.strip()]


def blocks(text: str) -> list[Block]:
    """The code blocks of a page, with what a test has in place of what a user has."""
    return [
        Block(
            m["mark"] or "",
            m["language"],
            replaced(m["text"], m["mark"] or ""),
            text.count("\n", 0, m.start()) + 1,
        )
        for m in BLOCK.finditer(text)
    ]


def replaced(text: str, mark: str) -> str:
    """A block's text with what stands in for other texts, which are there."""
    pairs = mark.partition("with:")[2].partition(", varies:")[0]
    for pair in filter(None, pairs.split(";")):
        said, _, here = pair.partition("=>")
        assert said.strip() in text, f"with: {said.strip()!r} is not in\n{text}"
        text = text.replace(said.strip(), here.strip())
    return text


def commands(block: Block) -> list[tuple[str, str]]:
    """The commands of a console block, each with what it prints."""
    found: list[tuple[str, list[str]]] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        elif found[-1][0].endswith("\\"):
            found[-1] = (found[-1][0][:-1] + line.strip(), [])
        else:
            found[-1][1].append(line)
    return [(command, "\n".join(lines)) for command, lines in found]


def typed(block: Block) -> list[str]:
    """The lines to type of a shell block, or behind the prompts of a console block."""
    if block.language in SHELL:
        return [line for line in block.text.splitlines() if line.strip()]
    lines = (re.match(r"\w*\$ (.*)", line) for line in block.text.splitlines())
    return [line[1].removesuffix("&").strip() for line in lines if line]


def beside_others(words: list[str]) -> list[str]:
    """A line with a port and a group address that no other run on this machine uses."""
    own = [MULTICAST.sub(rf"\g<1>{2 + os.getpid() % 250}", word) for word in words]
    return [*own, "--port", "0"] if words[1:2] in (["panel"], ["foxglove"]) else own


def programs(folder: Path) -> None:
    """Write the programs that pages run."""
    folder.mkdir()
    for name, words in PROGRAMS.items():
        path = folder / name
        path.write_text(f'#!/bin/sh\nexec "{sys.executable}" {words} "$@"\n', encoding="utf-8")
        path.chmod(0o755)


def urdf_of(joints: list[str]) -> str:
    """An arm with these joints, one behind the other."""
    link = (
        "<link name='{}'><inertial><origin xyz='0 0 0.1'/><mass value='0.5'/><inertia ixx='0.002'"
        " iyy='0.002' izz='0.002' ixy='0' ixz='0' iyz='0'/></inertial></link>"
    )
    joint = (
        "<joint name='{1}' type='revolute'><parent link='{0}'/><child link='behind_{1}'/>"
        "<origin xyz='0 0 0.2'/><axis xyz='0 1 0'/>"
        "<limit lower='-1.5' upper='1.5' effort='20' velocity='2'/></joint>"
    )
    parents = ["base", *(f"behind_{name}" for name in joints)]
    parts = [link.format(name) for name in parents]
    parts += [joint.format(*pair) for pair in zip(parents, joints, strict=False)]
    return f"<robot name='own'>{''.join(parts)}</robot>"


def pattern(expected: str, varies: list[str]) -> str:
    """A regular expression of what may be printed."""
    made = []
    for line in expected.splitlines():
        if line.strip() == "...":
            made.append(r"(?:.*\n)*?")
            continue
        text = re.escape(line.rstrip())
        for part in varies:
            loose = NUMBER.join(re.escape(piece) for piece in re.split(NUMBER, part))
            if re.search(NUMBER, part):
                text = text.replace(re.escape(part), loose)
            else:  # a unit: any number before it
                text = re.sub(f"(?:{ESCAPED}){re.escape(re.escape(part))}", ANY + loose, text)
        text = re.sub("├[─●]+┤", "├[─●]+┤", text)
        text = re.sub(r"(?:\\ )+", "[ ]+", text)
        made.append(text + r"[ ]*\n")
    return "".join(made)


def compare(block: Block, expected: str, printed: str, varies: list[str], what: str) -> None:
    """Fail where the page says something else than the program."""
    tidy = "".join(line.rstrip() + "\n" for line in printed.splitlines() if line.strip())
    wanted = "\n".join(line for line in expected.splitlines() if line.strip())
    if not re.fullmatch(pattern(wanted, varies), tidy):
        pytest.fail(
            f"line {block.line}: {what}\n--- the page says\n{wanted}\n--- it prints\n{tidy}"
        )


class Reader:
    """Does what a page says, from top to bottom."""

    def __init__(self, folder: Path, stack: contextlib.ExitStack) -> None:
        self.folder, self.stack = folder, stack
        programs(folder / "bin")
        (folder / "config").symlink_to(ROOT / "config")
        (folder / ".venv").symlink_to(sys.prefix)
        self._boards = stack.enter_context(contextlib.ExitStack())
        self._board: BoardProcess | None = None
        self._session: Session | None = None
        self._page = ""
        self.installed: dict[str, str] = {}  # environment variables of what is run

    def follow(self, page: Path) -> int:
        """Do all of it; the number of blocks that were run."""
        self._page = page.stem
        found = blocks(page.read_text(encoding="utf-8"))
        does = {
            "file": self.save,
            "loads": self.load,
            "own": self.load_own,
            "package": self.install,
            "board": self.start_board,
            "part": self.find,
            "until": self.run_until_ended,
        }
        for block, after in zip(found, [*found[1:], None], strict=True):
            with contextlib.ExitStack() as beside:
                if block.beside:
                    beside.enter_context(self.terminal(beside_others(block.beside)))
                if block.verb in does:
                    does[block.verb](block)
                elif block.verb == "run" and block.language == "python":
                    follows = after is not None and after.verb == "output"
                    self.run_script(block, after if follows else None)
                elif block.verb == "run":
                    self.run(block)
        return sum(block.verb in RUN for block in found)

    def run(self, block: Block) -> None:
        """Type the lines of a console block, or of a shell block."""
        if block.language in SHELL:
            alone = all(line.split()[0] in ALONE for line in typed(block))
            done = self._run(["bash", "-eo", "pipefail", "-c", block.text], alone)
            assert done.returncode == 0, f"line {block.line}: {done.stdout}"
        else:
            for command, expected in commands(block):
                answers = QUESTION.findall(expected)
                printed = self.type(command, [answer for _, answer in answers])
                compare(block, expected, printed, block.varies, command)

    def save(self, block: Block) -> None:
        """Write a file."""
        path = self.folder / block.mark.split(" ")[1]
        path.write_text(block.text, encoding="utf-8")

    def start_board(self, block: Block) -> None:
        """Start the board that a block says."""
        node = block.mark.partition(", with:")[0].partition(" ")[2]
        self.start(shlex.split(block.text, comments=True), node)

    def find(self, block: Block) -> None:
        """Look a block up in the file that it is a part of."""
        file = ROOT / block.mark.split(" ")[2]
        assert block.text in file.read_text(encoding="utf-8"), f"line {block.line}: {file.name}"

    def load_own(self, block: Block) -> None:
        """Load a parameter file with a URDF of these joints in place of the user's own."""
        words = block.mark.split(" ")
        path = self.folder / words[1].rstrip(":")
        path.write_text(block.text, encoding="utf-8")
        (urdf,) = re.findall(r"robot: (\S+\.urdf)", block.text)
        (self.folder / urdf).write_text(urdf_of(words[2:]), encoding="utf-8")
        load(path)

    def run_until_ended(self, block: Block) -> None:
        """Type lines that go on, and end them by Ctrl-C: each ends well."""
        before = self._boards, self._board, self._session
        with contextlib.ExitStack() as open_terminals:
            for line in typed(block):
                words = beside_others(shlex.split(line, comments=True))
                if "control_board" in words:
                    self._boards = open_terminals.enter_context(contextlib.ExitStack())
                    self.start(words)
                elif words[0] == "pip":
                    done = self._run(["env", *words], alone=True)
                    assert done.returncode == 0, done.stdout
                else:
                    open_terminals.enter_context(self.terminal(words))
            time.sleep(WATCHED)
        self._boards, self._board, self._session = before

    @contextlib.contextmanager
    def terminal(self, words: list[str]) -> Iterator[None]:
        """A program in a terminal of its own, from what it shows first to Ctrl-C."""
        alone = words[0] in ("python", *ALONE)  # drives, servers
        at = Terminal(["env", "TERM=xterm-256color", *words], self._environment(alone))
        try:
            until(lambda: re.search("[A-Za-z]{3}", at.shown) or at.read())
            yield
        finally:
            at.process.send_signal(signal.SIGINT)
            code = at.end()
        assert "Traceback" not in at.all_shown, at.all_shown
        ended = code in (0, INTERRUPTED) or " cancelled: " in at.all_shown  # a move told of that
        assert ended, f"{words}: {code}: {at.all_shown}"

    def load(self, block: Block) -> None:
        """Load a parameter file on top of a shipped robot."""
        path = self.folder / "part.yaml"
        path.write_text(block.text, encoding="utf-8")
        load(block.mark.split(" ")[1], on_top=[path])

    def install(self, block: Block) -> None:
        """Make the folder a place of Python packages, with the entry points of a block."""
        module = Path(block.mark.split(" ")[1]).stem
        info = self.folder / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        points = tomllib.loads(block.text)["project"]["entry-points"]
        text = "".join(
            f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in rows.items())
            for group, rows in points.items()
        )
        (info / "entry_points.txt").write_text(text)
        places = [str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])]
        self.installed = {"PYTHONPATH": os.pathsep.join(places)}

    def start(self, words: list[str], node: str = "") -> None:
        """Start another board in place of the one there is; ``node`` is a robot's own."""
        self._boards.close()
        self._session = None
        if words[0] == "control_board" and {"--params-file", RATED}.isdisjoint(
            [*words, self._page]
        ):
            words = [*FEWER, *words[1:]]
        robot = node.strip("/").partition("/")[0]
        made = board_process(command=["env", *words], robot=robot, env=self.installed | self._path)
        self._board = self._boards.enter_context(made)

    @property
    def board(self) -> BoardProcess:
        if self._board is None:
            self.start(BOARDS.get(self._page, "control_board").split())
        assert self._board is not None
        return self._board

    @property
    def session(self) -> Session:
        """One connection to the board."""
        domain = self.board.domain
        if self._session is None:
            self._session = self._boards.enter_context(
                Session(Options(domain=domain, timeout=60.0))
            )
            self._session.shared = True
            while ControlMode.CALIBRATING in self._session.client.get_control_mode():
                time.sleep(0.02)  # a reader waits until the arm is at rest
        return self._session

    def type(self, command: str, answers: Sequence[str] = ()) -> str:
        """Type a line, and answers to its questions; what is printed."""
        words = beside_others(shlex.split(command, comments=True))
        if words[-1] == "&":
            self.start(words[:-1])
            return ""
        if answers:
            at = Terminal(["env", *words], self._environment() | {"TERM": "dumb"})
            for answer in answers:
                at.see("[y/N] ")
                at.type(f"{answer}\n")
            at.end()
            return at.all_shown.replace("\r\n", "\n")
        if words[0] == "cbctl" and not {"--board", "drives"} & {*words}:
            session = self.session
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                invoke(session, words[1:])
            return printed.getvalue()
        return self._run(["env", *words], words[0] in ALONE).stdout

    def run_script(self, block: Block, expected: Block | None) -> None:
        """Run a Python block as a script."""
        path = self.folder / "snippet.py"
        path.write_text(block.text, encoding="utf-8")
        printed = self._run([sys.executable, str(path)]).stdout
        if expected is None:
            assert "Traceback" not in printed, printed
        else:
            compare(expected, expected.text, printed, block.varies, "the script above")

    def _run(self, command: list[str], alone: bool = False) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            env=self._environment(alone),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=480,
            check=False,
        )

    def _environment(self, alone: bool = False) -> dict[str, str]:
        """That of the board, which programs that stand alone do not need."""
        known = self._board or (None if alone else self.board)
        environment = known.environment if known else child_environment(0)
        return environment | self.installed | self._path | {"COLUMNS": "80"}

    @property
    def _path(self) -> dict[str, str]:
        return {"PATH": os.pathsep.join([str(self.folder / "bin"), BIN, os.environ["PATH"]])}


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> object:
    """A reader with a folder of its own, in a terminal of 80 columns."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr(output, "PIPE_WIDTH", 80)
    monkeypatch.chdir(tmp_path)
    with contextlib.ExitStack() as stack:
        yield Reader(tmp_path, stack)
