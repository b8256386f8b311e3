# SPDX-License-Identifier: Apache-2.0
"""Scheduling priority of the node.

A cycle that is late is late because another program runs. A niceness below 0 lets all threads of
the node go first, and still leaves the others their share; SCHED_FIFO leaves them nothing.
"""

from __future__ import annotations

import getpass
import os
from collections.abc import Mapping, Sequence
from typing import Any


def take_priority(values: Mapping[str, Any], others: Sequence[int] = ()) -> str:
    """Apply ``realtime_priority`` and ``niceness`` to all threads, present and future.

    Args:
        values: parameters by name.
        others: ids of further processes.

    A simulation that runs as fast as it can is never preferred, for it would use a whole core:
    it stays as it was started, by ``nice`` or without.

    Returns:
        An empty text, or what was refused and how to get it; the node goes on without.
    """
    priority, niceness = int(values["realtime_priority"]), int(values["niceness"])
    if priority:
        try:
            for process in (0, *others):
                os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(priority))
        except OSError as error:
            return refusal(f"realtime_priority {priority}", error, "rtprio", priority)
        return ""
    if niceness < 0 and not values["real_time_factor"]:
        return ""
    try:
        for thread in (*map(int, os.listdir("/proc/self/task")), *others):
            os.setpriority(os.PRIO_PROCESS, thread, niceness)
    except OSError as error:
        return refusal(f"niceness {niceness}", error, "nice", niceness)
    return ""


def refusal(asked: str, error: OSError, limit: str, value: int) -> str:
    """What was refused, what that means, and what would grant it."""
    line = f"{user()} - {limit} {value}"
    return (
        f"{asked} is not granted ({error.strerror}): the board goes on without, and its cycles "
        f"come later when other programs run; to grant it, add '{line}' to "
        "/etc/security/limits.conf and log in again"
    )


def user() -> str:
    """Who runs this, as limits.conf names people; ``*``, all, where that is not known."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "*"


def scheduling() -> str:
    """What is in force for the calling thread."""
    if os.sched_getscheduler(0) == os.SCHED_OTHER:
        return f"niceness {os.getpriority(os.PRIO_PROCESS, 0)}"
    return f"real-time priority {os.sched_getparam(0).sched_priority}"
