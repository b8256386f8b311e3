# SPDX-License-Identifier: Apache-2.0
"""``cbctl``: the board from a terminal.

``app`` reads a line and runs a verb of ``verbs``; a verb prints what functions of the modules
beside it read. Nothing here imports rclpy before a verb needs the board, so that help is fast.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import NoReturn

from control_board_ros.startup import quiet_interrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Run cbctl; the exit code: 0 done, 1 refused or no board, 2 wrong usage.

    Args:
        arguments: the words of the line; None: those of the process, which then ends.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller: cbctl modes >&-
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w"))
    with quiet_interrupt():
        from .app import run

    if arguments is None and isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # what the locale cannot show, as in ASCII
    code = run(arguments)
    if arguments is None:
        leave(code)
    return code


def leave(code: int) -> NoReturn:
    """End the process immediately.

    The session has closed its node, context and thread, and all output is flushed: what Python
    would still do is to unload modules one by one, a fifth of the time of ``cbctl modes``.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
