# SPDX-License-Identifier: Apache-2.0
"""``cbctl``: the board from a terminal.

``app`` reads a line and runs a verb of ``verbs``; a verb prints what functions of the modules
beside it read. Nothing here imports rclpy before a verb needs the board, so that help is fast.
"""

from __future__ import annotations

from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run cbctl; the exit code: 0 done, 1 refused or no board, 2 wrong usage."""
    from .app import run

    return run(arguments)
