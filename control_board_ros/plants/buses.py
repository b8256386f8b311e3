# SPDX-License-Identifier: Apache-2.0
"""Several buses as one plant: each exchanges in a thread of its own, in parallel.

A bus that is late for an exchange continues with it: its joints keep their last reading, with its
age, and the late answer is used in the next exchange. The bus then receives the present
set-points, never those that it missed.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from ..core.terms.measurement import Array, SetPoints
from .interface import OF_MOTORS, Description, DriveFault, DrivePlant, Readings, Setup

#: Share of the period for which an exchange waits for all buses.
PATIENCE = 0.6
#: Timeouts of letting go and of the first answer, s.
LEAVING, FIRST = 1.0, 5.0


class Bus:
    """A plant in a thread of its own, and its last answer."""

    def __init__(self, plant: DrivePlant, columns: slice) -> None:
        self.plant, self.columns = plant, columns
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="bus")
        self._pending: Future[Readings] | None = None
        self.started = 0.0  # s
        self.last: Readings | None = None

    def do(self, task: Callable[[], Any]) -> Future[Any]:
        """Run a task in its thread, after those before it."""
        return self._thread.submit(task)

    def exchange(self, wanted: SetPoints) -> Future[Readings]:
        """Start an exchange, unless one is pending."""
        if self._pending is None:
            own = self.columns
            mine = SetPoints(
                wanted.kinds[own].copy(), wanted.values[:, own].copy(), wanted.released[own].copy()
            )
            self.started = time.monotonic()
            self._pending = self.do(lambda: self.plant.exchange(mine))
        return self._pending

    def finish(self) -> bool:
        """Store the answer of a finished exchange; false while it is pending.

        Raises:
            Exception: from the exchange.
        """
        if self._pending is None or not self._pending.done():
            return False
        done, self._pending = self._pending, None
        self.last = done.result()
        return True

    def forget(self) -> None:
        """Drop a pending exchange and the last answer."""
        self._pending = self.last = None

    def end(self) -> None:
        """End its thread, unless it hangs."""
        self._thread.shutdown(wait=False, cancel_futures=True)


class Buses:
    """A DrivePlant of several.

    Args:
        plants: One for each bus; their joints follow each other.

    Attributes: late (exchanges in which each bus answered too late so far).
    """

    def __init__(self, plants: Sequence[DrivePlant]) -> None:
        counts = [len(plant.describe().joints) for plant in plants]
        ends = np.cumsum([0, *counts]).tolist()
        self._buses = [
            Bus(plant, slice(begin, end))
            for plant, begin, end in zip(plants, ends[:-1], ends[1:], strict=True)
        ]
        self._count, self._period = ends[-1], 2e-3
        self.late = [0] * len(plants)

    def describe(self) -> Description:
        own = [bus.plant.describe() for bus in self._buses]
        rates = [one.rate for one in own if one.rate is not None]
        joints = tuple(joint for one in own for joint in one.joints)
        return Description(joints=joints, rate=min(rates, default=None))

    def connect(self, setup: Setup) -> None:
        """Open all buses together."""
        self._period = setup.period
        tasks = []
        for bus in self._buses:
            bus.forget()
            own = replace(setup, joints=setup.joints[bus.columns])
            tasks.append(bus.do(partial(bus.plant.connect, own)))
        for task in tasks:
            task.result()

    def exchange(self, wanted: SetPoints) -> Readings:
        """Exchange with all buses in parallel; only a first reading is waited for.

        Raises:
            TimeoutError: a bus has never answered.
            Exception: from the exchange of a bus.
        """
        pending = [bus.exchange(wanted) for bus in self._buses]
        first = any(bus.last is None for bus in self._buses)
        wait(pending, FIRST if first else PATIENCE * self._period)
        ages = np.zeros(self._count)
        for k, bus in enumerate(self._buses):
            if not bus.finish():
                self.late[k] += 1
                if bus.last is None:
                    raise TimeoutError(f"bus {k + 1} of {len(self._buses)} does not answer")
                ages[bus.columns] = time.monotonic() - bus.started + self._period
        return self._joined([bus.last for bus in self._buses if bus.last is not None], ages)

    def _joined(self, found: Sequence[Readings], ages: Array) -> Readings:
        """Readings of all joints.

        Where a bus has none of a motor quantity, its joints have NaN; any other is None for all.
        """
        rows: dict[str, Any] = {}
        for name in [field.name for field in fields(Readings) if field.name != "faults"]:
            parts = [getattr(one, name) for one in found]
            if name in OF_MOTORS and any(part is not None for part in parts):
                nothing = [np.full_like(one.position, np.nan) for one in found]
                parts = [n if p is None else p for p, n in zip(parts, nothing, strict=True)]
            if all(part is not None for part in parts):
                rows[name] = np.concatenate(parts)
        own = rows.get("ages")
        rows["ages"] = ages if own is None else np.maximum(own, ages)
        faults: list[str | DriveFault | None] = []
        for bus, one in zip(self._buses, found, strict=True):
            faults += one.faults or [None] * (bus.columns.stop - bus.columns.start)
        return Readings(**rows, faults=faults)

    def clear_fault(self, joint: int) -> None:
        for bus in self._buses:
            if bus.columns.start <= joint < bus.columns.stop:
                bus.do(partial(bus.plant.clear_fault, joint - bus.columns.start)).result()

    def let_go(self) -> None:
        """Release all buses in parallel, where they still respond."""
        wait([bus.do(bus.plant.let_go) for bus in self._buses], LEAVING)

    def close(self) -> None:
        """Close all buses; one that hangs is left alone."""
        with contextlib.suppress(RuntimeError):  # closed already
            wait([bus.do(bus.plant.close) for bus in self._buses], LEAVING)
        for bus in self._buses:
            bus.end()
