# SPDX-License-Identifier: Apache-2.0
"""B21: `make run` from a fresh clone to a running arm, beside a bare pip install of what it needs.

Both with empty caches, one after the other; then `make run` of another clone, where the first has
filled the caches.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from common import Effort, Figure, at_most, number

from control_board_ros.sim.config import DEFAULT_PHYSICS
from control_board_ros.testing import child_environment, free_domain

ROOT = Path(__file__).resolve().parents[1]
#: What `make run` prints when the arm runs.
RUNS = " runs at "
#: pybullet, or MuJoCo where that has no wheel; and ROS 2 as setup.py pins it.
ENGINES = {"pybullet": "pybullet", "mujoco": "mujoco-core"}


def run(effort: Effort) -> list[Figure]:
    """Measure both, and a second clone."""
    with free_domain() as domain, tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        environment = _without_caches(child_environment(domain), place)
        bare = _bare(place, environment, effort)
        first = _make_run(place / "first", environment, effort)
        second = _make_run(place / "second", environment, effort)
    reference = f"{number(bare)} s of pip install ros-jazzy-rclpy[fastrtps] {DEFAULT_PHYSICS}"
    details = {"first": first, "second": second, "bare": bare}
    return [
        Figure(
            "B21",
            "make run from a fresh clone to a running arm",
            first / bare,
            "×",
            at_most(4.0),
            f"{number(first)} s against {reference}",
            details,
        ),
        Figure("B21", "make run of another clone, same caches", second, "s", None, reference),
    ]


def _without_caches(environment: dict[str, str], place: Path) -> dict[str, str]:
    """Variables of a user who has never installed anything, and of no sourced ROS 2."""
    own = {"XDG_CACHE_HOME": str(place / "caches"), "PIP_CACHE_DIR": str(place / "caches/pip")}
    dropped = ("AMENT_PREFIX_PATH", "CONTROL_BOARD_CACHE", "UV_CACHE_DIR", "VIRTUAL_ENV")
    return {name: environment[name] for name in environment if name not in dropped} | own


def _bare(place: Path, environment: dict[str, str], effort: Effort) -> float:
    """Duration of a virtual environment with ROS 2 and an engine, s."""
    ros = _requirement("ros-jazzy-rclpy")
    python = place / "bare/bin/python"
    begin = perf_counter()
    subprocess.run([sys.executable, "-m", "venv", place / "bare"], env=environment, check=True)
    what = effort.of([ros, ENGINES[DEFAULT_PHYSICS]], [ros, ENGINES[DEFAULT_PHYSICS]], ["--help"])
    subprocess.run(
        [python, "-m", "pip", "install", "-q", *what],
        env=environment | {"PIP_NO_CACHE_DIR": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        check=True,
    )
    return perf_counter() - begin


def _requirement(name: str) -> str:
    """The pinned line of setup.py for a package."""
    lines = (ROOT / "setup.py").read_text("utf-8").splitlines()
    return next(line.strip(' ",') for line in lines if line.strip().startswith(f'"{name}'))


def _make_run(clone: Path, environment: dict[str, str], effort: Effort) -> float:
    """Duration from a clone to a running arm, s."""
    subprocess.run(["git", "clone", "-q", ROOT, clone], check=True)
    words = effort.of(["run"], ["run"], ["help"])
    begin = perf_counter()
    with subprocess.Popen(
        ["make", f"PYTHON={sys.executable}", *words],
        cwd=clone,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as made:
        assert made.stdout is not None
        said = []
        for line in made.stdout:
            said.append(line)
            if RUNS in line:
                break
        seconds = perf_counter() - begin
        if effort.level != "tiny":
            os.killpg(made.pid, signal.SIGINT)
        made.stdout.read()
    if effort.level != "tiny" and RUNS not in said[-1]:
        raise RuntimeError(f"the arm does not run: {''.join(said[-10:])}")
    shutil.rmtree(clone)
    return seconds
