# SPDX-License-Identifier: Apache-2.0
"""Programs of their own, which cbctl starts: they load libraries that cbctl does not import."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from ..text.output import DONE, REFUSED, put_json
from .session import Session


def run_program(session: Session, module: str, words: Sequence[str]) -> int:
    """Run a module as a program, with --json its lines in one object; the exit code."""
    program = [sys.executable, "-m", module, *words]
    try:
        if not session.options.json:
            return subprocess.run(program, check=False).returncode
        done = subprocess.run(program, check=False, capture_output=True, text=True)
    except KeyboardInterrupt:
        return REFUSED  # the program receives the signal as well, and ends by itself
    success = done.returncode == DONE
    lines = done.stdout.splitlines() + ([] if success else done.stderr.splitlines())
    put_json({"success": success, "lines": lines})
    return done.returncode


def words_of(values: Mapping[str, Any]) -> list[str]:
    """Values of options as words, by the options' names: a flag alone, each entry of a list."""
    words = []
    for name, value in values.items():
        option = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            entries = value if isinstance(value, list) else [value]
            words += [word for entry in entries for word in (option, str(entry))]
    return words
