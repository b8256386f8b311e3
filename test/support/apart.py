# SPDX-License-Identifier: Apache-2.0
"""Programs that use a package which cannot be installed beside the others.

Feetech's SDK has the name of another package, LeRobot wants torch and an older Dynamixel SDK: each
has a folder of its own, made by ``make judges``.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = Path(os.environ.get("JUDGES", ROOT / ".venv" / "judges"))


def run_apart(package: str, program: str, *arguments: str) -> list[str]:
    """The lines that a program of test/judged prints, with a package that is apart."""
    folder = FOLDER / package
    if not folder.is_dir():
        pytest.skip(f"{package} is not in {folder}: make judges")
    done = subprocess.run(
        [sys.executable, str(ROOT / "test" / "judged" / program), *arguments],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT / 'test' / 'support'}"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()
