# SPDX-License-Identifier: Apache-2.0
"""How the node stands against other programs on the same cores.

A cycle that is late is late because another program runs. A niceness below 0 lets all threads of
the node go first, and still leaves the others their share; SCHED_FIFO leaves them nothing.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ..settings.schema import BOARD_BY_NAME


def take_priority(values: Mapping[str, Any]) -> str:
    """Apply ``realtime_priority`` and ``niceness`` to all threads, present and future.

    A simulation that runs as fast as it can is never preferred: it would take a whole core.

    Returns:
        An empty text, or what was refused and how to get it; the node goes on without.
    """
    priority, niceness = int(values["realtime_priority"]), int(values["niceness"])
    if priority:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        except OSError as error:
            return refusal(f"realtime_priority {priority}", error, "rtprio")
        return ""
    given = niceness if values["real_time_factor"] else max(niceness, 0)
    try:
        for thread in map(int, os.listdir("/proc/self/task")):
            os.setpriority(os.PRIO_PROCESS, thread, given)
    except OSError as error:
        if niceness != BOARD_BY_NAME["niceness"].default:  # else nobody asked for it
            return refusal(f"niceness {niceness}", error, "nice")
    return ""


def refusal(asked: str, error: OSError, limit: str) -> str:
    """What was refused, and what would grant it."""
    return (
        f"{asked} is not granted ({error.strerror}); the board goes on without: run it with "
        f"CAP_SYS_NICE, or raise {limit} in /etc/security/limits.conf"
    )


def scheduling() -> str:
    """What is in force for the calling thread."""
    if os.sched_getscheduler(0) == os.SCHED_OTHER:
        return f"niceness {os.getpriority(os.PRIO_PROCESS, 0)}"
    return f"real-time priority {os.sched_getparam(0).sched_priority}"
