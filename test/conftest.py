# SPDX-License-Identifier: Apache-2.0
"""What all tests share: which there are, and folders for what their nodes write."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import pytest

#: Why a test is skipped that needs a browser.
NO_BROWSER = "there is no chromium"
#: The tests that open a browser, which alone keeps a processor busy.
BROWSED = "test/panel/"
#: Niceness of the tests themselves.
NICENESS = os.getpriority(os.PRIO_PROCESS, 0)
#: Tests against pybullet, or with robots of pybullet_data: no wheel for Python from 3.12 on.
WITH_PYBULLET = [
    "benchmark/test_benchmarks.py",
    "description/test_derive.py",
    "description/test_frames.py",
    "description/test_loads.py",
    "description/test_merge.py",
    "sim/test_bullet.py",
    "sim/test_every_urdf.py",
    "sim/test_foreign.py",
    "sim/test_holding.py",
    "sim/test_two_engines.py",
]
#: Tests with libraries that the extra test brings, as make test has it and a distribution has not.
WITH_EXTRA = ["benchmark", "cli/test_guiding_servos.py", "conformance/test_conformance_servos.py"]
WITH_EXTRA += ["description/test_xacro.py", "docs", "foxglove", "gym", "identification", "judged"]
WITH_EXTRA += ["panel", "plants", "recording", "tuning"]
collect_ignore = WITH_PYBULLET if find_spec("pybullet") is None else []
collect_ignore += WITH_EXTRA if find_spec("moteus") is None else []


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests in a browser: together they take longest."""
    items.sort(key=lambda item: not item.nodeid.startswith(BROWSED))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Workers take file after file; one of them all those with a browser, which never meet."""
    from xdist.scheduler import LoadFileScheduling

    class OneBrowser(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return BROWSED if nodeid.startswith(BROWSED) else str(super()._split_scope(nodeid))

    return OneBrowser(config, log)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say what was not tested for want of a browser, and how to get it."""
    skipped = terminalreporter.stats.get("skipped", [])
    count = sum(NO_BROWSER in str(report.longrepr) for report in skipped)
    if count:
        terminalreporter.section("not tested", yellow=True)
        terminalreporter.write_line(
            f"{count} tests of the panel and of reports in a browser: there is no chromium; "
            "on Debian: sudo apt-get install chromium"
        )


def pytest_collection_finish() -> None:
    """Let garbage collections, 0.2 s for a full one, leave out the modules and tests."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def node_files(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Nodes of the tests, and programs that they start, write no log and no lock elsewhere."""
    os.environ.setdefault("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_logs")))
    os.environ["XDG_RUNTIME_DIR"] = str(tmp_path_factory.mktemp("runtime"))


@pytest.fixture(scope="session", autouse=True)
def interrupts() -> None:
    """Ctrl-C reaches what tests start, also where a script runs pytest in the background.

    A shell's background job ignores SIGINT, and so would each of its children.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def niceness() -> Iterator[None]:
    """A board in the process of a test takes priority: no other test keeps it."""
    yield
    if os.getpriority(os.PRIO_PROCESS, 0) != NICENESS:
        for thread in map(int, os.listdir("/proc/self/task")):
            with contextlib.suppress(ProcessLookupError):  # it has ended meanwhile
                os.setpriority(os.PRIO_PROCESS, thread, NICENESS)


@pytest.fixture(scope="module", autouse=True)
def user_files(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No poses of the user, nor of another file's tests, decide a test."""
    os.environ["XDG_CONFIG_HOME"] = str(tmp_path_factory.mktemp("config"))
