# SPDX-License-Identifier: Apache-2.0
"""Time of the control loop: due cycles, their lateness, their priority, and ROS time.

One time base serves all stamps and never goes backwards (docs/decisions/0014-one-time-base.md)::

    stamp = offset + simulated time

So stamps are as far apart as their readings, also where late cycles of a simulation are caught up.
The offset is

- simulated: 0.
- system: follows the system's clock, by a small part of the time that passes.
- free: constant, once the simulation is set to another pace than real time.

The first two are chosen at the start; the third follows the second.

A cycle is late because another program runs. A niceness below 0 lets all threads of the node run
first and still leaves others their share; SCHED_FIFO leaves them nothing.
"""

from __future__ import annotations

import ctypes
import getpass
import math
import os
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

#: Periods that the loop of a simulation may lag before it gives up catching up and skips the rest.
MAX_LAG = 100
#: s before a deadline from which on the thread sleeps exactly, and is not woken.
FINAL_SLEEP_S = 0.05
#: Lateness values kept between two looks at the statistics.
LATENESS_COUNT = 1 << 14
PR_SET_TIMERSLACK = 29
#: Time between two readings of clocks that count as simultaneous, ns.
READING_GAP_NS = 20_000
#: Tries to read them so.
MAX_READINGS = 4


@dataclass(frozen=True, slots=True)
class Statistics:
    """Timing statistics of the control loop.

    Attributes: cycles, overruns (cycles that ended after the next one was due), skipped (periods
    whose cycle was never run), all counted since the start. Of the time since
    the last statistics: rate (cycles per second), median, p99 and worst (lateness of
    the cycle start, s).
    """

    cycles: int
    overruns: int
    skipped: int
    rate: float
    median: float
    p99: float
    worst: float


#: What a control cycle does, in its order: ``wait`` for requests that hold the board; ``read`` the
#: plant; ``check`` the reading; the ``laws``; ``write`` to the plant; make a ``snapshot``;
#: ``publish`` it, or wake the thread that does.
PHASES = ("wait", "read", "check", "laws", "write", "snapshot", "publish")


@dataclass(frozen=True, slots=True)
class PhaseTimes:
    """Where the time of control cycles went, s, by phase; ``cycle``: the sum.

    Attributes: mean, worst, longest (of the cycle that lasted longest).
    """

    mean: dict[str, float]
    worst: dict[str, float]
    longest: dict[str, float]

    @classmethod
    def of(cls, cycles: Sequence[Sequence[float]]) -> PhaseTimes:
        """From the clock at the begin of each cycle and at the end of each phase, s."""
        durations = np.diff(np.array(cycles), axis=1)
        rows = np.column_stack((durations.sum(axis=1), durations))
        figures = rows.mean(axis=0), rows.max(axis=0), rows[rows[:, 0].argmax()]
        names = ("cycle", *PHASES)
        return cls(*(dict(zip(names, row.tolist(), strict=True)) for row in figures))


class Pacer:
    """Absolute deadlines on the monotonic clock.

    Simulated time must not be lost: a simulation catches up with late cycles, up to MAX_LAG. On
    any other plant time passes anyway: what is late by whole periods is skipped (B6).

    Args:
        period: wall-clock time from one cycle to the next, s; 0 = no waiting at all.
        wake: ends a long wait before the cycle is due.
        catches_up: whether late cycles are run.

    Attributes: due (when the present cycle was to begin, s of the monotonic clock), late (by how
    much it began later than it was first due, s), began (when it did), ahead (lead of the system's
    clock when it was last read, ns; 0 before).
    """

    def __init__(
        self, period: float, wake: threading.Event | None = None, *, catches_up: bool = True
    ) -> None:
        self.period, self._wake = period, wake or threading.Event()
        self._max_lag = MAX_LAG if catches_up else 1
        self.cycles = self.overruns = self.skipped = 0
        self._lateness = np.zeros(LATENESS_COUNT)
        self._late_count = 0
        self._since = time.monotonic()
        self._cycles_since = 0
        self._deadline = self.due = self.began = self._since
        self.late, self.ahead = 0.0, 0
        self._runs = False

    def lag(self, now: float) -> float:
        """Time since the next cycle was due, s; below 0: until then; 0 where none is due."""
        return now - self._deadline if self._runs and self.period > 0.0 else 0.0

    def stop(self) -> None:
        """No cycle is due until :meth:`restart`."""
        self._runs = False

    def restart(self) -> None:
        """The next cycle is due in a period: after a start, a pause or a change of the period."""
        self._deadline, self._runs = time.monotonic() + self.period, True

    def wait(self) -> bool:
        """Sleep until the next cycle is due, and note how late it starts.

        Returns:
            False if it was woken: the cycle is not due yet, and the deadline may have changed.
        """
        period = self.period
        if period <= 0.0:
            self.cycles += 1
            self.due = self.began = time.monotonic()
            return True
        ahead = self._deadline - time.monotonic()
        if ahead > FINAL_SLEEP_S:
            if self._woken(ahead - FINAL_SLEEP_S):
                return False
            ahead = self._deadline - time.monotonic()
        self.cycles += 1
        if ahead > 0.0:
            time.sleep(ahead)
            self.began = began = time.monotonic()
            self.late = late = began - self._deadline
        else:
            self.began, self.late = self._deadline - ahead, -ahead
            late = self._overrun(-ahead, period)
        count = self._late_count
        self._lateness[count % LATENESS_COUNT] = late
        self._late_count = count + 1
        self.due = self._deadline
        self._deadline += period
        return True

    def _woken(self, timeout: float) -> bool:
        woken = self._wake.wait(timeout)
        if woken:
            self._wake.clear()
        return woken

    def due_time(self) -> int:
        """The system's time when the present cycle was to begin, ns."""
        self.ahead = system_ahead()
        return round(self.due * 1e9) + self.ahead

    def _overrun(self, late: float, period: float) -> float:
        """Count an overrun, and skip what is not caught up; returns the remaining delay, s."""
        self.overruns += 1
        if late > self._max_lag * period:
            lost = int(late / period)
            self.skipped += lost
            self._deadline += lost * period
            late -= lost * period
        return late

    def take(self) -> Statistics:
        """The statistics; starts the next window."""
        now = time.monotonic()
        cycles, count = self.cycles, self._late_count
        self._late_count = 0
        lateness = self._lateness[: min(count, LATENESS_COUNT)]
        median, p99, worst = (0.0, 0.0, 0.0)
        if count:
            # np.percentile would be right, too, and load 3 MB of numpy for it.
            ordered = np.sort(lateness)
            last = len(ordered) - 1
            median, p99, worst = ordered[[last // 2, round(0.99 * last), last]].tolist()
        rate = (cycles - self._cycles_since) / max(now - self._since, 1e-9)
        self._since, self._cycles_since = now, cycles
        return Statistics(cycles, self.overruns, self.skipped, rate, median, p99, worst)


class Standstill:
    """The last time that cycles began late by more than LIMIT_S: what waited then is void (B6).

    It is found within as long again, also where a sender's clock differs, or the system's was set
    back meanwhile.

    Args:
        pacer: Of the cycles.
    """

    #: s that a cycle may begin late.
    LIMIT_S = 0.5

    def __init__(self, pacer: Pacer) -> None:
        self._pacer = pacer
        self._ended, self._ended_at, self._lasted = -math.inf, 0, 0.0

    def note(self) -> None:
        """In each cycle, after :meth:`Pacer.wait`."""
        if self._pacer.late > self.LIMIT_S:
            set_back = max(self._pacer.ahead - system_ahead(), 0)
            self._ended, self._ended_at = time.monotonic(), time.time_ns() + set_back
            self._lasted = self._pacer.late

    def of(self, sent: int) -> float:
        """How long the board stood still after a message was sent, s; 0: it did not.

        Args:
            sent: System time, ns.
        """
        now = time.monotonic()
        if (late := self._pacer.lag(now)) > self.LIMIT_S:
            return late
        waited = sent < self._ended_at and now < self._ended + self._lasted
        return self._lasted if waited else 0.0

    def voids(self, sent: int) -> str:
        """Why a command that was sent then (system time, ns) is void; empty: it is not."""
        stood = self.of(sent)
        text = f"it waited while the board stood still for {stood:.1f} s; send it again"
        return text if stood else ""


class Divider:
    """Selects control cycles at a mean rate, as evenly as possible.

    Args:
        rate: of the selected cycles, Hz; above ``control_rate`` all are selected.
        control_rate: cycles per second of simulated time, Hz.

    Attributes: rate (in force, Hz).
    """

    def __init__(self, rate: float, control_rate: float) -> None:
        self.rate = min(rate, control_rate)
        part = Fraction(self.rate).limit_denominator(10**6) / Fraction(control_rate)
        self._step, self._whole = part.numerator, part.denominator
        self._sum = self._whole - self._step  # the first cycle is picked

    def pick(self) -> bool:
        """Whether this cycle is one of them."""
        self._sum += self._step
        if self._sum < self._whole:
            return False
        self._sum -= self._whole
        return True


def system_ahead() -> int:
    """Lead of the system's clock over the monotonic one, ns.

    A thread that loses the processor between the two readings would report a clock that was
    set; such readings are repeated, and the closest pair counts.
    """
    best, ahead = math.inf, 0
    for _ in range(MAX_READINGS):
        started, now, ended = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        if ended - started < best:
            best, ahead = ended - started, now - (started + ended) // 2
        if best < READING_GAP_NS:
            break
    return ahead


def sharpen_timers() -> None:
    """Ask Linux to end this thread's sleeps on time instead of up to 50 µs later."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1)
    except (OSError, AttributeError):
        return  # not Linux: sleeps as well as it can


NANOSECONDS = 1_000_000_000

#: Part of the simulated time that passes by which the offset may grow.
OFFSET_GROWTH = 0.1
#: What the system's clock may be ahead before stamps jump there at once, ns.
MAX_LEAD_NS = NANOSECONDS


class TimeBase:
    """Maps simulated time to ROS time.

    Args:
        simulated: whether ROS time is simulated time; else it is the system's.
        shrinkage: by how much the offset may shrink at a time, ns; less than a control period.

    Attributes: offset (ROS time minus simulated time, ns), follows_system (whether the offset
    follows the system's clock; else others learn the time from /clock only).
    """

    def __init__(self, *, simulated: bool, shrinkage: int) -> None:
        self.offset = 0
        self.follows_system = not simulated
        self._shrinkage = shrinkage
        self._noted: int | None = None  # simulated time of the last correction, ns
        self._jump = True

    def free(self) -> None:
        """Part simulated from real time: stamps continue without a jump."""
        self.follows_system = False

    def resume(self) -> None:
        """Permit a step of the stamps with the next reading: time was stopped."""
        self._jump = True

    def note(self, simulated: float, system: int) -> None:
        """Follow the system's clock.

        Args:
            simulated: time of a reading, s.
            system: the system's time when this reading was due, ns.
        """
        if not self.follows_system:
            return
        now = round(simulated * NANOSECONDS)
        error = system - now - self.offset
        if self._noted is None or error > MAX_LEAD_NS or (self._jump and error > 0):
            self.offset += error
        else:
            passed = max(now - self._noted, 0)
            self.offset += max(min(error, round(OFFSET_GROWTH * passed)), -self._shrinkage)
        self._noted, self._jump = now, False

    def stamp(self, simulated: float) -> int:
        """ROS time of a simulated time (s), ns."""
        return self.offset + round(simulated * NANOSECONDS)


def take_priority(values: Mapping[str, Any], others: Sequence[int] = ()) -> str:
    """Apply ``realtime_priority`` and ``niceness`` to all threads, present and future.

    Args:
        values: parameters by name.
        others: ids of further processes.

    A simulation that runs as fast as it can keeps the priority that it was started with: it
    would use a whole core.

    Returns:
        An empty text, or what was refused and how to get it; the node continues without.
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


def refusal(requested: str, error: OSError, limit: str, value: int) -> str:
    """What was refused, what that means, and what would grant it."""
    line = f"{user()} - {limit} {value}"
    return (
        f"{requested} is not granted ({error.strerror}): the board runs without it, and its "
        f"cycles start later when other programs run; to grant it, add '{line}' to "
        "/etc/security/limits.conf and log in again"
    )


def user() -> str:
    """The user's name for limits.conf; ``*``, all users, where it is unknown."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "*"


def scheduling() -> str:
    if os.sched_getscheduler(0) == os.SCHED_OTHER:
        return f"niceness {os.getpriority(os.PRIO_PROCESS, 0)}"
    return f"real-time priority {os.sched_getparam(0).sched_priority}"
