# SPDX-License-Identifier: Apache-2.0
"""Processes of tests that run to their end."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from waiting import GUARD


def ended(*words: Any, code: int = 0, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end with this exit code; what it printed."""
    settings = {"capture_output": True, "text": True, "timeout": GUARD} | how
    done: Any = subprocess.run([*map(str, words)], check=False, **settings)
    assert done.returncode == code, done.stdout + done.stderr
    return done  # type: ignore[no-any-return]


def python(program: str, *words: Any, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run a program in a Python of its own to its end; what it printed."""
    return ended(sys.executable, "-c", program, *words, **how)
