# SPDX-License-Identifier: Apache-2.0
"""Several buses as one plant, which exchange in parallel.

Those with a socket share one loop, in the thread of the caller: set-points to all, then the
answers of one after the other, while those of the next arrive. Each other one has a thread, as a
call of its library may wait: threads that hand over to each other for each frame make two of three
answers late on a busy computer.

A bus that is late for an exchange continues with it: its joints keep their last reading, with its
age, and the late answer is used in the next exchange. The bus then receives the present
set-points, never those that it missed. One that raises faults its own joints, and is connected
again by itself (S10).
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import fields, replace
from operator import attrgetter
from typing import Any, Protocol, cast

import numpy as np

from ..core.terms.drives import DriveReport
from ..core.terms.measurement import Array, SetPoints
from .errors import in_words
from .interface import OF_MOTORS, Description, DriveFault, DrivePlant, Readings, Setup

#: Share of the period for which an exchange waits for all buses.
PATIENCE = 0.6
#: Timeouts of letting go and of the first answer, s; s until a bus is connected again.
LEAVING, FIRST, RETRY = 1.0, 5.0, 0.2
#: What the joints of a bus read that has no such readings, where another one has.
ABSENT: dict[str, Any] = {**dict.fromkeys(OF_MOTORS, np.nan), "lost": False, "dropped": 0.0}
#: Readings that are arrays.
ROWS = [field.name for field in fields(Readings) if field.name not in ("faults", "drives")]
rows_of = attrgetter(*ROWS)


class Polled(DrivePlant, Protocol):
    """A plant whose exchange is in parts, of which one waits; see ``DrivesPlant``."""

    def fileno(self) -> int | None:
        """The number of its socket, which keeps what arrives; None: it has none now."""
        ...

    def begin(self, wanted: SetPoints) -> None:
        """Send set-points."""
        ...

    def read(self, end: float) -> bool:
        """Read answers until all are there, or until a time, s; false then."""
        ...

    def finish(self) -> Readings:
        """The readings."""
        ...


class Bus:
    """A plant, its thread, and its last answer.

    A bus that raises is connected again, every RETRY seconds, with all its joints without power;
    the others do not notice (S10).

    Attributes: error (why it has no answer; empty: it has), last, started (s), waited (its last
        exchange was read in parts, and waited in vain), drives (what each of its drives reports of
        itself).
    """

    def __init__(self, plant: DrivePlant, columns: slice) -> None:
        self.plant, self.columns = plant, columns
        self._number: Callable[[], int | None] = getattr(plant, "fileno", lambda: None)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="bus")
        self._pending: Future[Readings] | None = None
        self._resets: list[int] = []
        self._ending = threading.Event()
        self.started, self.error, self.waited = 0.0, "", False
        self.last: Readings | None = None
        self.drives: Sequence[DriveReport] = [DriveReport()] * (columns.stop - columns.start)

    def do(self, task: Callable[[], Any]) -> Future[Any]:
        """Run a task in its thread, after those before it."""
        return self._thread.submit(task)

    def connect(self, setup: Setup) -> Future[Any]:
        self._setup = setup
        self._pending, self.last, self.error = None, None, ""
        return self.do(lambda: self.plant.connect(setup))

    def exchange(self, wanted: SetPoints) -> Future[Readings]:
        """Start an exchange, unless one is pending."""
        if self._pending is None:
            k = self.columns
            part = SetPoints(
                wanted.kinds[k].copy(), wanted.values[:, k].copy(), wanted.released[k].copy()
            )
            resets, self._resets = self._resets, []
            self.started = time.monotonic()
            self._pending = self.do(lambda: self._exchange(part, resets))
        return self._pending

    def begin(self, plant: Polled, wanted: SetPoints) -> None:
        """Send its set-points, after the faults that are to be reset."""
        columns, resets = self.columns, self._resets
        self._resets, self.started = [], time.monotonic()
        for joint in resets:
            plant.clear_fault(joint)
        plant.begin(
            SetPoints(wanted.kinds[columns], wanted.values[:, columns], wanted.released[columns])
        )

    def clear_fault(self, joint: int) -> None:
        """Reset the fault of a drive with the next exchange."""
        self._resets.append(joint)

    @property
    def polled(self) -> Polled | None:
        """Its plant, where it can exchange in parts now."""
        if self._pending is not None or self.error or self._number() is None:
            return None
        return cast(Polled, self.plant)

    def finish(self) -> bool:
        """Store the answer of a finished exchange; false while it is pending."""
        if self._pending is None or not self._pending.done():
            return False
        done, self._pending = self._pending, None
        if (error := done.exception()) is None:
            self.store(done.result())
        else:
            self.fail(error)
        return True

    def store(self, answer: Readings) -> None:
        """Keep an answer."""
        self.last, self.error = answer, ""
        self.drives = answer.drives or self.drives

    def fail(self, error: BaseException) -> None:
        """Report an error, and connect again."""
        self.error = in_words(error)
        self._pending = self.do(self._again)

    def _exchange(self, wanted: SetPoints, resets: Sequence[int]) -> Readings:
        for joint in resets:
            self.plant.clear_fault(joint)
        return self.plant.exchange(wanted)

    def _again(self) -> Readings:
        with contextlib.suppress(Exception):  # the error before it is reported
            self.plant.let_go()
        self._ending.wait(RETRY)
        self.plant.connect(self._setup)
        return self.plant.exchange(SetPoints.off(len(self._setup.joints)))

    def end(self) -> None:
        """End its thread, unless it hangs."""
        self._ending.set()
        self._thread.shutdown(wait=False, cancel_futures=True)


class Buses:
    """A DrivePlant of several.

    Args:
        plants: One for each bus; their joints follow each other.

    Attributes: late (exchanges in which each bus answered too late so far, while it works).
    """

    def __init__(self, plants: Sequence[DrivePlant]) -> None:
        counts = [len(plant.describe().joints) for plant in plants]
        ends = np.cumsum([0, *counts]).tolist()
        self._buses = [
            Bus(plant, slice(begin, end))
            for plant, begin, end in zip(plants, ends[:-1], ends[1:], strict=True)
        ]
        self._count, self._period = ends[-1], 2e-3
        self._first = True
        self.late = [0] * len(plants)

    def describe(self) -> Description:
        descriptions = [bus.plant.describe() for bus in self._buses]
        rates = [description.rate for description in descriptions if description.rate is not None]
        joints = tuple(joint for description in descriptions for joint in description.joints)
        return Description(joints=joints, rate=min(rates, default=None))

    def connect(self, setup: Setup) -> None:
        """Open all buses together.

        Raises:
            Exception: none could be opened; of the first.
        """
        self._period, self._first = setup.period, True
        tasks = [
            bus.connect(replace(setup, joints=setup.joints[bus.columns])) for bus in self._buses
        ]
        errors = [task.exception() for task in tasks]
        if all(errors):
            tasks[0].result()
        for bus, error in zip(self._buses, errors, strict=True):
            if error is not None:
                bus.fail(error)

    def exchange(self, wanted: SetPoints) -> Readings:
        """Exchange with all buses in parallel; only the first readings are waited for."""
        polled = {k: plant for k, bus in enumerate(self._buses) if (plant := bus.polled)}
        apart = [bus for k, bus in enumerate(self._buses) if k not in polled and not bus.error]
        pending = [bus.exchange(wanted) for bus in apart]
        end = time.monotonic() + PATIENCE * self._period
        fresh = self._poll(polled, wanted, end)
        if pending:
            wait(pending, FIRST if self._first else max(0.0, end - time.monotonic()))
        self._first = False
        ages = np.zeros(self._count)
        for k, bus in enumerate(self._buses):
            if k in fresh:
                continue
            if not bus.finish() or bus.error:
                self.late[k] += not bus.error
                ages[bus.columns] = time.monotonic() - bus.started + self._period
        return self._joined(ages)

    def _poll(self, polled: dict[int, Polled], wanted: SetPoints, end: float) -> set[int]:
        """Exchange with buses that have sockets, until a time, s; those without an error (S10).

        One that was waited for in vain is read last: what the others sent has arrived by then.
        """
        fresh = set()
        for k, plant in polled.items():
            try:
                self._buses[k].begin(plant, wanted)
                fresh.add(k)
            except Exception as error:  # noqa: BLE001 - whatever it is
                self._buses[k].fail(error)
        for k in sorted(fresh, key=lambda k: self._buses[k].waited):
            bus = self._buses[k]
            try:
                bus.waited = not polled[k].read(end)
                bus.store(polled[k].finish())
            except Exception as error:  # noqa: BLE001 - whatever it is
                bus.fail(error)
                fresh.discard(k)
        return fresh

    def _joined(self, ages: Array) -> Readings:
        """Readings of all joints.

        Where a bus has none of a motor quantity, its joints have NaN; any other is None for all.
        """
        readings = [bus.last or unread(bus.columns) for bus in self._buses]
        rows: dict[str, Any] = {}
        for name, parts in zip(ROWS, zip(*map(rows_of, readings), strict=True), strict=True):
            there = [part is not None for part in parts]
            if all(there):
                rows[name] = np.concatenate(parts)
            elif any(there) and name in ABSENT:
                filled = [np.full(len(reading.position), ABSENT[name]) for reading in readings]
                rows[name] = np.concatenate(
                    [f if p is None else p for p, f in zip(parts, filled, strict=True)]
                )
        if any(reading.drives for reading in readings):
            rows["drives"] = [
                reading._replace(late=(reading.late or 0) + late)
                for bus, late in zip(self._buses, self.late, strict=True)
                for reading in bus.drives
            ]
        oldest = rows.get("ages")
        rows["ages"] = ages if oldest is None else np.maximum(oldest, ages)
        faults: list[str | DriveFault | None] = []
        for k, (bus, reading) in enumerate(zip(self._buses, readings, strict=True), start=1):
            silence = f"bus {k} of {len(self._buses)} does not answer" if bus.last is None else ""
            everybody = [bus.error or silence or None] * (bus.columns.stop - bus.columns.start)
            faults += everybody if everybody[0] else reading.faults or everybody
        return Readings(**rows, faults=faults)

    def clear_fault(self, joint: int) -> None:
        for bus in self._buses:
            if bus.columns.start <= joint < bus.columns.stop:
                bus.clear_fault(joint - bus.columns.start)

    def let_go(self) -> None:
        """Release all buses in parallel, where they still respond."""
        wait([bus.do(bus.plant.let_go) for bus in self._buses], LEAVING)

    def close(self) -> None:
        """Close all buses; one that hangs is left alone."""
        with contextlib.suppress(RuntimeError):  # closed already
            wait([bus.do(bus.plant.close) for bus in self._buses], LEAVING)
        for bus in self._buses:
            bus.end()


def unread(columns: slice) -> Readings:
    """Readings of joints that were never read."""
    nothing = np.full(columns.stop - columns.start, np.nan)
    rows: dict[str, Any] = dict.fromkeys(ROWS, nothing)
    return Readings(**rows | {"ages": np.zeros_like(nothing), "lost": None, "dropped": None})
