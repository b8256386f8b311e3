# SPDX-License-Identifier: Apache-2.0
"""A stranger's board on the network, against everything that listens to boards."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest
from cbctl_process import COMMAND
from waiting import GUARD, until

from control_board_ros.testing import child_environment, free_domain, ros_node

pytestmark = [pytest.mark.ros, pytest.mark.slow]
KINDS = ("words", "lengths", "many", "nan", "laughs")
#: s that a command waits for what never comes, and that a panel is looked at.
WHILE = 4.0
BOARD = Path(__file__).parents[1] / "support" / "hostile_board.py"


@contextlib.contextmanager
def hostile(kind: str, domain: int) -> Iterator[None]:
    """A hostile board, from when it is seen."""
    process = subprocess.Popen(
        [sys.executable, str(BOARD), kind],
        env=child_environment(domain),
        stderr=subprocess.DEVNULL,
    )
    try:
        with ros_node(domain, "looking", spin=False) as node:
            until(lambda: "hostile" in node.get_node_names() or process.poll() is not None)
            assert process.poll() is None
        yield
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(GUARD)


@pytest.fixture(scope="module", params=KINDS)
def domain(request: pytest.FixtureRequest) -> Iterator[int]:
    with free_domain() as number, hostile(request.param, number):
        yield number


def run(domain: int, *words: str) -> subprocess.CompletedProcess[str]:
    """A command beside the hostile board: it ends, in words, and gives no orders."""
    done = subprocess.run(
        [*words],
        env=child_environment(domain) | {"COLUMNS": "120"},
        capture_output=True,
        text=True,
        timeout=GUARD,
        check=False,
    )
    said = (done.stdout + done.stderr).splitlines()
    both = "\n".join(line for line in said if "RTPS_" not in line)  # the middleware's own
    assert "Traceback" not in both, both[-3000:]
    assert all(c.isprintable() or c == "\n" for c in both), both[:3000]
    assert done.returncode in (0, 1)
    if done.returncode:
        assert done.stderr.strip() or "message" in done.stdout
    return done


def cbctl(verb: str, domain: int, _: Path) -> None:
    """Every verb ends, with a table or with a line that says what is wrong.

    With --json each line is standard JSON, in which names and texts are clean, too.
    """
    done = run(domain, *COMMAND, *verb.split(), "--board", "hostile", "--timeout", str(WHILE))
    if "--json" in verb:
        assert done.stdout
        for line in done.stdout.splitlines():
            said = json.loads(line, parse_constant=pytest.fail)
            assert all(c.isprintable() for c in texts_in(said)), line


def texts_in(value: object) -> str:
    """All keys and texts of JSON, together."""
    if isinstance(value, dict):
        return "".join(map(str, value)) + texts_in(list(value.values()))
    if isinstance(value, list):
        return "".join(map(texts_in, value))
    return value if isinstance(value, str) else ""


def recorder_and_report(domain: int, folder: Path) -> None:
    """What it says is recorded as it came; the report of it, and its pictures, stay in place."""
    bag = folder / "inside" / "bag"
    bag.parent.mkdir()
    words = ["record", "-o", str(bag), "--for", "2s", "--csv"]
    run(domain, *COMMAND, *words, "--board", "hostile", "--timeout", str(WHILE))
    if bag.exists():
        page = folder / "inside" / "report.html"
        words = ["report", str(bag), "-o", str(page), "--png", str(folder / "inside" / "png")]
        done = run(domain, *COMMAND, *words)
        if done.returncode == 0:
            text = page.read_text(encoding="utf-8")
            assert "<script>alert" not in text
            assert "<img src=x" not in text
    assert [path.name for path in folder.iterdir()] == ["inside"]


def conformance(domain: int, _: Path) -> None:
    """It ends, and says why it tries nothing, or what is not held."""
    words = ["-m", "control_board_ros.conformance", "--yes", "--timeout", "3", "--rules", "V1"]
    done = run(domain, sys.executable, *words, "--board", "hostile")
    assert done.returncode == 1


def panel_server(domain: int, _: Path) -> None:
    """It opens, complains in lines, and ends when it is asked to."""
    panel = subprocess.Popen(
        [*COMMAND, "panel", "--port", "0", "--timeout", "3"],
        env=child_environment(domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert panel.stdout is not None
        while "127.0.0.1" not in (line := panel.stdout.readline()):
            assert line
        with contextlib.suppress(subprocess.TimeoutExpired):
            panel.wait(WHILE)  # it lives
        assert panel.poll() is None
    finally:
        panel.send_signal(signal.SIGTERM)
        out, err = panel.communicate(timeout=GUARD)
    assert panel.returncode == 0
    assert "Traceback" not in err
    lines = [line for line in (out + err).splitlines() if "RTPS_" not in line]
    assert all(line.isprintable() for line in lines)
    assert len(err) < 20_000


#: A verb for each kind of board.
VERBS = ("faults --json", "mode __proto__ pos", "watch --once", "watch --once", "faults --json")
OTHER_VERBS = ("modes --json", "faults", "poses", "impedance", "clear", "move constructor=0.1")


@pytest.mark.parametrize(
    ("domain", "verb"), [*zip(KINDS, VERBS, strict=True)], indirect=["domain"]
)
def test_whatever_listens_ends_well(domain: int, verb: str, tmp_path: Path) -> None:
    """All at once, each in a process of its own: each waits for what never comes."""
    listeners = [recorder_and_report, conformance, panel_server, partial(cbctl, verb)]
    with ThreadPoolExecutor(len(listeners)) as pool:
        for done in [pool.submit(listen, domain, tmp_path) for listen in listeners]:
            done.result()


@pytest.mark.soak
@pytest.mark.parametrize("verb", [*dict.fromkeys(VERBS), *OTHER_VERBS])
def test_cbctl(domain: int, verb: str, tmp_path: Path) -> None:
    cbctl(verb, domain, tmp_path)
