# SPDX-License-Identifier: Apache-2.0
"""A third-party plant behind a guard: whatever it does, the control loop continues (B3).

A thread of its own exchanges with the plant. ``read`` and ``write`` never wait for it: they read
the last sample, and store the next outputs. A joint has an alarm, FaultCode.PLANT with the
reason in words, while

* no answer came for ``timeout`` seconds,
* the last exchange raised, or returned an invalid reading,
* its drive reports a fault, which is reset in the drive once the joint is without power.

After an error the thread reconnects, every RETRY seconds, with all joints without power.

The thread also monitors the control loop (B5): outputs older than ``timeout`` are void, and it
disables all joints; also after the computer was suspended. A loop that continues finds an alarm of
each joint that it drove, and enables none before it has read that alarm. Before its first outputs
the thread reads in every period: the loop begins with a reading of now, however long ago the plant
was opened.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..core.board import Board
from ..core.config.config import BoardConfig, ConfigError
from ..core.terms.drives import DriveReport
from ..core.terms.faults import FaultCode
from ..core.terms.measurement import (
    ROWS,
    UNREAD,
    Actuation,
    Array,
    Measurement,
    Row,
    SetPoints,
)
from ..text import clean
from .errors import in_words
from .exchange import Exchange, Sample
from .interface import Clock, DriveLimits, DrivePlant, JointDescription, RobotPlant
from .offers import bounded, corrected_turns, different_gain, limit_differences
from .outputs import as_drives

RETRY = 0.2
#: Cycles that a control loop may be late, however short the timeout is.
CYCLES = 3.0
#: s beyond the timeout that the thread sleeps, so that it wakes after it.
LEAST_WAIT = 1e-4
#: Lines that are kept until the node reads them.
NEWS = 1000
#: Where there is none that goes on while the computer is suspended (Linux), the usual one.
CLOCK = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
#: s that a start waits for the first sample; after it the joints begin in HW_FAULT.
FIRST_SAMPLE = 5.0
NOTHING = MappingProxyType[str, float]({})
AGES = [Row.ENCODER_AGE, Row.TORQUE_AGE]
ALARM, DRIVE = 1.0 + FaultCode.PLANT, 1.0 + FaultCode.DRIVE


def clock() -> float:
    """Time since some instant, also while the computer was suspended, s."""
    return time.clock_gettime(CLOCK)


def patience(timeout: float, period: float) -> float:
    """The allowed silence of a control loop: the timeout, and some cycles at least, s."""
    return max(timeout, CYCLES * period)


@dataclass(frozen=True, slots=True)
class Wanted:
    """Set-points of the loop, with their cycle and time, s."""

    cycle: int
    time: float
    set_points: SetPoints


class GuardedPlant:
    """A ``core.measurement.Plant`` around a third party's.

    Args:
        plant: The third party's.
        board: Its joints are among the plant's.
        timeout: Silence of the plant that is a fault, and of the control loop that disables the
            motors, s.
        clock: For tests, s.
        first: s to wait for the first sample.
        remark: Ends the reason of a silence, of either side.
        derived: Gains to which drives know better, see ``offers.derived_gains``.

    Attributes:
        applied: PWM that the plant reports as applied last, percent, shape (n,).
        late: Answers of each joint that came too late for their exchange so far, shape (n,).
        dropped: Frames to each joint's bus that its interface had no room for, shape (n,).
        drives: What each drive reports of itself, by joint; empty: nothing.
        has: What the joints have, with the drives that are connected; replaced whole when one
            differs.
        processes: The ids of those that run the plant, beside this one.
    """

    def __init__(
        self,
        plant: RobotPlant | DrivePlant,
        board: BoardConfig,
        timeout: float,
        clock: Callable[[], float] = clock,
        first: float = FIRST_SAMPLE,
        remark: str = "",
        derived: Mapping[str, float] = NOTHING,
    ) -> None:
        self._plant, self._timeout, self._clock = as_drives(plant), timeout, clock
        self._board, self._remark, self._derived = board, remark, derived
        self.has = self._acting = tuple(  # none keeps the board within anything yet
            replace(one, limits=DriveLimits(), stiffness=None) for one in self._describe()
        )
        self._refusal = ""
        self._lines: set[str] = set()  # about what differs, already reported
        self._news: deque[str] = deque(maxlen=NEWS)
        self._patience = patience(timeout, board.period)
        self._exchange = Exchange(self._plant, board, timeout)
        self._owns_clock = plant.describe().clock is Clock.PLANT
        n = len(board.joints)
        self._period, self._cycle = board.period, 0
        self._everybody = range(n)
        self._values = np.zeros((ROWS, n))
        self._values[UNREAD] = np.nan  # nothing is read yet (B7)
        self._values[Row.TEMPERATURE] = [joint.motor.ambient for joint in board.joints]
        self.applied: Array = np.zeros(n)
        self.late: NDArray[np.int64] = np.zeros(n, dtype=np.int64)
        self.dropped: Array = np.zeros(n)
        self.drives: tuple[DriveReport, ...] = ()
        limits = [joint.timeouts for joint in board.joints]
        self._oldest = np.array([[one.encoder, one.torque_sensor] for one in limits]).T
        self._off = SetPoints.off(n)
        # Replaced whole by one thread, read by the other.
        self._sample: tuple[float, int, Sample] | None = None  # when, of which cycle, what
        self._error = ""
        self._wanted = Wanted(0, clock(), self._off)
        process = getattr(plant, "process", None)
        self.processes = () if process is None else (process.pid,)
        self._began = self._read_at = clock()
        self._waiting = self._looked = clock()  # start of the overdue answer; last reading
        self._silence: dict[int, str] = {}  # of the loop: the reason by joint, until it acts on it
        self._reported = False  # whether the loop has read it
        self._turn, self._answered = threading.Event(), threading.Event()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plant", daemon=True)
        self._thread.start()
        self._answered.wait(first)

    @property
    def owes_an_answer(self) -> bool:
        """Whether the plant has not answered to the last outputs yet."""
        sample = self._sample
        return sample is None or sample[1] < self._cycle

    def read(self) -> Measurement:
        """The last readings, with their alarms."""
        now = self._clock()
        elapsed, self._read_at = now - self._read_at, now
        self._notice_silence()
        self._reported = True
        error, sample = self._error or self._refusal, self._sample
        faults: dict[int, str] = {}
        motors, lost = None, tuple[int, ...]()
        if sample is not None:
            self._values[:] = sample[2].values
            overdue = now - sample[0] - self._period
            if overdue > 0.0:  # no answer came since the last cycle; a silence of all is an alarm
                ages = np.minimum(self._values[AGES] + overdue, self._oldest)
                self._values[AGES] = np.maximum(ages, self._values[AGES])
            self.applied, faults = sample[2].applied, sample[2].faults
            motors, lost = sample[2].motors, sample[2].lost
        silent = self._silent(sample)
        if error:
            reasons = dict.fromkeys(self._everybody, error)
        elif sample is None or silent > self._timeout:
            late = f"no answer for {1e3 * silent:.0f} ms > {1e3 * self._timeout:.0f} ms"
            if sample is None:
                late = f"no answer in {now - self._began:.1f} s since the start"
            reasons = dict.fromkeys(self._everybody, late + self._remark)
        else:
            reasons = faults | self._silence
        alarm = self._values[Row.ALARM]
        alarm[:] = 0.0
        alarm[list(reasons)] = ALARM
        if reasons and not error:
            alarm[[j for j in reasons if j in faults and j not in self._silence]] = DRIVE
        return Measurement(
            now - self._began,
            self._values,
            reasons or None,
            applied=self.applied,
            motors=motors,
            elapsed=elapsed if elapsed > 0.0 and self._cycle > 0 else None,
            lost=lost,
            drives=self.drives,
        )

    def write(self, actuation: Actuation) -> None:
        """Store the next outputs for the plant; one control period passes."""
        now = self._clock()
        if not self.owes_an_answer:
            self._waiting = now
        self._notice_silence()
        wanted = actuation.set_points()
        if self._silence and self._reported and not wanted.powered[list(self._silence)].any():
            self._silence = {}
        self._cycle += 1
        self._wanted = Wanted(self._cycle, now, self._off if self._silence else wanted)
        self._turn.set()

    def keep_within(self, board: Board, _time: float) -> None:
        """Keep a board within the limits of the drives that are connected (S4), and with their
        gains; in each cycle.
        """
        if (has := self.has) is self._acting:
            return
        self._acting, self._refusal = has, ""
        try:
            board.engine.narrow(lambda config: bounded(config, has, self._derived))
        except ConfigError as error:  # by a change since the start
            self._refusal = f"{error}: nothing is left of its limits and those of its drive"

    def take_news(self) -> list[str]:
        """Where drives that were connected differ from the board (S4), once each."""
        return [self._news.popleft() for _ in range(len(self._news))]

    def close(self) -> None:
        """Disable the motors and release the plant, unless it hangs; safe to call twice."""
        self._ending.set()
        self._turn.set()
        self._thread.join(timeout=1.0)

    def _silent(self, sample: tuple[float, int, Sample] | None) -> float:
        """Time for which an answer of the plant is overdue, s.

        Without outputs no answer is due. Time in which the control loop itself did not run, paused
        or starved, does not count.
        """
        now = self._clock()
        self._waiting += max(0.0, now - self._looked - 2.0 * self._period)
        self._looked = now
        if self._owns_clock and sample is not None:
            self._waiting = max(self._waiting, sample[0])
        elif not self.owes_an_answer:
            return 0.0
        return now - self._waiting

    def _notice_silence(self) -> None:
        """Detect in the loop's own thread that it was silent for too long (B5)."""
        wanted, now = self._wanted, self._clock()
        if self._silence or not self._is_old(wanted, now):
            return
        if not (driven := np.flatnonzero(wanted.set_points.powered).tolist()):
            return
        reason = (
            f"the control loop was silent for {1e3 * (now - wanted.time):.0f} ms "
            f"> {1e3 * self._patience:.0f} ms; the motors lost their power{self._remark}"
        )
        self._silence = dict.fromkeys(driven, reason)
        self._reported = False

    def _is_old(self, wanted: Wanted, now: float) -> bool:
        """Whether outputs are void; a loop that has not begun has none (B5)."""
        return wanted.cycle > 0 and now - wanted.time > self._patience

    def _run(self) -> None:
        """The plant's thread: connect, exchange until something fails, and again."""
        while not self._ending.is_set():
            try:
                self._exchange.connect()
                self._compare()
                self._talk()
            except Exception as error:  # noqa: BLE001 - third-party code; reported as a fault
                self._error = clean(in_words(error), 200)
                self._answered.set()
                with contextlib.suppress(Exception):  # the error before it is reported
                    self._exchange.let_go()
                self._ending.wait(RETRY)
        with contextlib.suppress(Exception):  # it ends; the fault is already reported
            self._plant.close()

    def _describe(self) -> tuple[JointDescription, ...]:
        """What the plant has, in the board's order."""
        has = {joint.name: joint for joint in self._plant.describe().joints}
        return tuple(has[joint.name] for joint in self._board.joints)

    def _compare(self) -> None:
        """Drives report what they have when connected; one that comes back may be another (S4)."""
        has, lines = self._describe(), list[str]()
        for joint, drive in zip(self._board.joints, has, strict=True):
            lines += limit_differences(joint, drive) + different_gain(joint, drive, self._derived)
            lines += corrected_turns(joint, drive)
        self._news += [line for line in lines if line not in self._lines]
        self._lines = set(lines)
        if has != self.has:
            bounded(self._board, has, self._derived)  # a joint without limits stays without power
            self.has = has

    def _talk(self) -> None:
        self._exchanged = self._clock()
        wanted, sample = self._wanted, self._exchange.run(self._off, {})  # no power before it
        while True:
            self._sample, self._error = (self._clock(), wanted.cycle, sample), ""
            self.late += sample.late
            self.dropped, self.drives = sample.dropped, sample.drives or self.drives
            self._answered.set()
            if not self._owns_clock or self._is_old(wanted, self._clock()):
                self._await_turn(wanted)
            if self._ending.is_set():
                break
            wanted = self._wanted
            if not self._is_old(wanted, self._clock()):
                before, sample = sample, self._run_exchange(wanted.set_points, sample.faults)
                if before.faults.keys() - sample.faults:  # it may have come back another
                    self._compare()
            elif self._exchange.drives:
                self._exchange.let_go()
        self._exchange.run(self._off, {})

    def _run_exchange(self, set_points: SetPoints, faults: dict[int, str]) -> Sample:
        now = self._clock()
        elapsed, self._exchanged = now - self._exchanged, now
        return self._exchange.run(set_points, faults, elapsed)

    def _await_turn(self, wanted: Wanted) -> None:
        """Wait for newer outputs, until these are too old (B5); before the first, a period."""
        if wanted.cycle == 0:
            if self._turn.wait(self._period):
                self._turn.clear()
            return
        watched = self._exchange.drives
        while (left := wanted.time + self._patience - self._clock()) >= 0.0 or not watched:
            if self._turn.wait(left + LEAST_WAIT if watched else None):
                self._turn.clear()
                return
