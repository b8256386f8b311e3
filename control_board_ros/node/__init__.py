# SPDX-License-Identifier: Apache-2.0
"""The wiring of the board to ROS 2: converts, calls, answers, and decides nothing."""

from __future__ import annotations

from ..startup import quiet_interrupt


def start() -> int:
    """Run the executable ``control_board``; the exit code."""
    with quiet_interrupt():
        from .main import main
    return main()
