# SPDX-License-Identifier: Apache-2.0
"""A loopback that breaks and a disk that is full; needs root, for a namespace of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from control_board_ros.testing import child_environment, free_domain

SCRIPT = Path(__file__).parents[1] / "support" / "islands.py"


def allowed(kind: str) -> bool:
    """Whether this user may have a namespace of its own."""
    words = ["unshare", f"--{kind}", "true"]
    return (
        bool(shutil.which("unshare"))
        and not subprocess.run(words, capture_output=True, check=False).returncode
    )


def island(kind: str, *words: str) -> str:
    """Run the script in a namespace; what it prints."""
    with free_domain() as domain:
        environment = child_environment(domain)
        environment["PYTHONPATH"] = os.pathsep.join(
            [str(SCRIPT.parent), environment.get("PYTHONPATH", "")]
        )
        done = subprocess.run(
            ["unshare", f"--{kind}", sys.executable, str(SCRIPT), *words],
            env=environment,
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.skipif(
    not (allowed("net") and shutil.which("ip")),
    reason="needs root and iproute2 for a network namespace",
)
def test_streams_are_back_after_a_broken_loopback() -> None:
    """Promise P1: 5 s without network are no reason to end, to fault or to move."""
    assert "passed" in island("net", "loopback")


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.skipif(
    not allowed("mount"), reason="needs root for a mount namespace with a small disk"
)
def test_a_full_disk_for_the_logs(tmp_path: Path) -> None:
    """Promise P1: no room for a line of log, and the board runs on."""
    assert "passed" in island("mount", "disk", str(tmp_path))
