# SPDX-License-Identifier: Apache-2.0
"""Every benchmark yields numbers. How good they are is for `make bench` to tell, not for tests."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

from control_board_ros.testing import child_environment, free_domain

RUN = Path(__file__).resolve().parents[2] / "benchmark" / "run.py"
#: The figures of each benchmark, and how many of them a tiny run gives.
FIGURES = {
    "B1": ("B1", 2),
    "B2": ("B2", 4),
    "B3": ("B3", 2),
    "B4": ("B4", 3),
    "B5": ("B5", 2),
    "B6": ("B6 B9", 2),
    "B7": ("B7", 2),
    "B8": ("B8", 2),
    "B10": ("B10", 3),
    "B11": ("B11", 2),
}


@pytest.mark.ros
@pytest.mark.physics
@pytest.mark.parametrize("name", FIGURES)
def test_yields_numbers(name: str, tmp_path: Path) -> None:
    """A tiny run ends well, and its figures are finite, of the right number, and not negative."""
    found = tmp_path / "figures.json"
    command = [sys.executable, str(RUN), name, "--tiny", "--json", str(found)]
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
            printed, complaints = process.communicate(timeout=50)
        finally:
            process.terminate()  # which ends its boards too
    assert process.returncode == 0, complaints
    figures = json.loads(found.read_text(encoding="utf-8"))["figures"]
    numbers, count = FIGURES[name]
    assert {figure["number"] for figure in figures} == set(numbers.split())
    assert len(figures) == count
    for figure in figures:
        assert math.isfinite(figure["value"]), figure
        assert figure["value"] >= 0.0, figure
        assert figure["number"] in printed
