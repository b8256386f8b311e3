# SPDX-License-Identifier: Apache-2.0
"""A short form of make soak; its timed figures belong to a quiet machine and only inform here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from control_board_ros.testing import child_environment

SOAK = Path(__file__).parents[2] / "benchmark" / "soak.py"


@pytest.mark.ros
@pytest.mark.slow
def test_a_short_soak(tmp_path: Path) -> None:
    """Promise P10: no reply lost, every fault found, no memory grown, nothing ends."""
    figures = tmp_path / "figures.json"
    words = ["--seconds", "12", "--switches", "10000", "--flood", "1", "--patient"]
    done = subprocess.run(
        [sys.executable, str(SOAK), *words, "--json", str(figures)],
        env=child_environment(0),
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = {p["text"]: p for p in json.loads(figures.read_text())["promises"]}
    assert found["replies lost"]["value"] == 0
    assert found["faults not found"]["value"] == 0
    assert found["memory slope"]["value"] < 200.0  # MB/h: the least that 12 s can resolve
    print(done.stdout)
