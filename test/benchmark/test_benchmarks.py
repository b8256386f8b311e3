# SPDX-License-Identifier: Apache-2.0
"""Every benchmark yields numbers. `make bench` judges them, not tests."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from control_board_ros.testing import child_environment, free_domain

RUN = Path(__file__).resolve().parents[2] / "benchmark" / "run.py"
#: How many figures a tiny run gives of each benchmark, and those that take seconds even so.
HAS_ICUB = find_spec("icub_models") is not None
FIGURES = {
    "B1": 7 if HAS_ICUB else 5,
    "B2": 4,
    "B3": 4,
    "B4": 6,
    "B5": 5,
    "B6": 1,
    "B7": 2,
    "B8": 2,
    "B9": 1,
    "B10": 6,
    "B11": 3,
    "B12": 3,
    "B13": 3,
    "B14": 6 if HAS_ICUB else 0,
    "B15": 1,
    "B16": 2,
    "B17": 2,
    "B18": 3,
    "B19": 2 * sum(HAS_ICUB and bool(find_spec(name)) for name in ("pybullet", "mujoco")),
    "B20": 7,
    "B21": 2,
}
LONG = ("B3", "B4", "B5", "B7", "B8", "B10", "B11", "B12", "B14", "B21")
QUICK = [name for name in FIGURES if name not in LONG]

pytestmark = pytest.mark.ros


def figures_of(names: Sequence[str], folder: Path) -> list[Any]:
    """The figures of a tiny run of some benchmarks, in one process, which must end well."""
    found = folder / "figures.json"
    command = [sys.executable, str(RUN), *names, "--tiny", "--json", str(found)]
    with (
        free_domain() as domain,
        subprocess.Popen(
            command,
            env=child_environment(domain),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process,
    ):
        try:
            printed, complaints = process.communicate()
        finally:
            process.terminate()  # which ends its boards too
    assert process.returncode == 0, complaints
    figures = json.loads(found.read_text(encoding="utf-8"))["figures"]
    assert all(figure["number"] in printed for figure in figures)
    return list(figures)


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """One run of the benchmarks that need no long measurement."""
    return figures_of(QUICK, tmp_path_factory.mktemp("quick"))


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """One run of the others."""
    return figures_of(LONG, tmp_path_factory.mktemp("long"))


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_yields_numbers(name: str, quick: list[Any]) -> None:
    """The figures of a tiny run are finite, of the right number, and not negative."""
    are_numbers([figure for figure in quick if figure["number"] == name], name)


@pytest.mark.soak
@pytest.mark.parametrize("name", LONG)
def test_a_long_one_yields_numbers(name: str, long: list[Any]) -> None:
    """The same of those that measure for seconds even in a tiny run."""
    are_numbers([figure for figure in long if figure["number"] == name], name)


def are_numbers(figures: Sequence[Any], name: str) -> None:
    """As many figures as the benchmark has, finite, and not negative, but for a difference."""
    assert len(figures) == FIGURES[name]
    for figure in figures:
        assert math.isfinite(figure["value"]), figure
        assert figure["value"] >= 0.0 or "adds" in figure["case"], figure
