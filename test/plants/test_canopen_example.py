# SPDX-License-Identifier: Apache-2.0
"""The tests of examples/canopen_plant, run as its author runs them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "canopen_plant"


@pytest.mark.slow
def test_the_canopen_plant_passes_its_own_tests() -> None:
    """B1, B3, F1, F2: a plant over CiA 402 drives."""
    pytest.importorskip("canopen")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"]
    done = subprocess.run(command, cwd=EXAMPLE, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
