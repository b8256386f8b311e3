# SPDX-License-Identifier: Apache-2.0
"""Somebody else's plant as the board's own: whatever it does, the control loop goes on (B3).

A thread of its own exchanges with the plant. ``read`` and ``write`` never wait for it: they take
the last sample, and leave the next outputs. A joint has an alarm, FaultCode.PLANT with the
reason in words, while

* no answer came for ``timeout`` seconds,
* the last exchange raised, or returned what is no reading,
* its drive reports a fault of its own, which is reset there once the joint is without power.

After an error the thread connects anew, every RETRY seconds, with all joints without power.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

import numpy as np

from ..core.config import BoardConfig
from ..core.faults import FaultCode
from ..core.measurement import ROWS, Actuation, Array, Measurement, Row
from .exchange import Exchange, Sample
from .interface import Clock, RobotPlant

RETRY = 0.2
#: s that a start waits for the first sample; after it the joints begin in HW_FAULT.
FIRST_SAMPLE = 5.0
ALARM = 1.0 + FaultCode.PLANT


class GuardedPlant:
    """A ``core.measurement.Plant`` around somebody else's.

    Args:
        plant: Of somebody else.
        board: Its joints are among the plant's.
        timeout: After which a plant that does not answer is a fault, s.
        clock: For tests, s.
        first: s to wait for the first sample.

    Attributes:
        applied: What the plant says that it applied last, percent, shape (n,).
    """

    def __init__(
        self,
        plant: RobotPlant,
        board: BoardConfig,
        timeout: float,
        clock: Callable[[], float] = time.monotonic,
        first: float = FIRST_SAMPLE,
    ) -> None:
        self._plant, self._timeout, self._clock = plant, timeout, clock
        self._exchange = Exchange(plant, board, board.period)
        self._owns_clock = plant.describe().clock is Clock.PLANT
        n = len(board.joints)
        self._period, self._cycle = board.period, 0
        self._everybody = range(n)
        self._values = np.zeros((ROWS, n))
        self._values[Row.TEMPERATURE] = [joint.motor.ambient for joint in board.joints]
        self.applied: Array = np.zeros(n)
        # Replaced whole by one thread, read by the other.
        self._sample: tuple[float, int, Sample] | None = None  # when, of which cycle, what
        self._error = ""
        self._wanted: tuple[int, Array, Array] = 0, np.zeros(n), np.zeros(n)
        self._waiting = self._looked = clock()  # since when an answer is owed; the last reading
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
        """The last readings; their alarms say what is wrong with them."""
        error, sample = self._error, self._sample
        faults: dict[int, str] = {}
        if sample is not None:
            self._values[:] = sample[2].values
            self.applied, faults = sample[2].applied, sample[2].faults
        silent = self._silent(sample)
        if error:
            reasons = dict.fromkeys(self._everybody, error)
        elif sample is None or silent > self._timeout:
            late = f"no answer for {1e3 * silent:.0f} ms > {1e3 * self._timeout:.0f} ms"
            reasons = dict.fromkeys(self._everybody, late)
        else:
            reasons = {j: f"its drive: {text}" for j, text in faults.items()}
        alarm = self._values[Row.ALARM]
        alarm[:] = 0.0
        alarm[list(reasons)] = ALARM
        return Measurement(self._cycle * self._period, self._values, reasons or None)

    def write(self, actuation: Actuation) -> None:
        """Leave the next outputs to the plant; one control period passes."""
        if not self.owes_an_answer:
            self._waiting = self._clock()
        self._cycle += 1
        self._wanted = self._cycle, actuation.pwm.copy(), actuation.powered.copy()
        self._turn.set()

    def close(self) -> None:
        """Take the power off and let go of the plant, unless it hangs; safe to call twice."""
        self._ending.set()
        self._turn.set()
        self._thread.join(timeout=1.0)

    def _silent(self, sample: tuple[float, int, Sample] | None) -> float:
        """For how long the plant owes an answer, s.

        None is owed to outputs that nobody gave, nor for the time in which the control loop stood
        still itself: paused, or kept from running.
        """
        now = self._clock()
        self._waiting += max(0.0, now - self._looked - 2.0 * self._period)
        self._looked = now
        if self._owns_clock and sample is not None:
            self._waiting = max(self._waiting, sample[0])
        elif not self.owes_an_answer:
            return 0.0
        return now - self._waiting

    def _run(self) -> None:
        """The plant's thread: connect, exchange until something fails, and again."""
        while not self._ending.is_set():
            try:
                self._exchange.forget()
                self._plant.connect()
                self._talk()
            except Exception as error:  # noqa: BLE001 - somebody else's code; told as a fault
                self._error = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
                self._answered.set()
                self._let_go()
                self._ending.wait(RETRY)
        with contextlib.suppress(Exception):  # it ends; whoever wants to know has had the fault
            self._plant.close()

    def _talk(self) -> None:
        faults: dict[int, str] = {}
        unpowered = np.zeros(len(self._everybody))
        first = True  # of this connection: no power before there is a reading
        while not self._ending.is_set():
            cycle, pwm, powered = self._wanted
            if first:
                pwm = powered = unpowered
            sample = self._exchange.run(pwm, powered, faults)
            first, faults = False, sample.faults
            self._sample, self._error = (self._clock(), cycle, sample), ""
            self._answered.set()
            if not self._owns_clock:
                self._turn.wait()
                self._turn.clear()
        self._exchange.run(unpowered, unpowered, {})

    def _let_go(self) -> None:
        """After an error: every bridge open, as far as the plant still listens."""
        for number in self._exchange.numbers:
            with contextlib.suppress(Exception):  # the error before it is what is told
                self._plant.disable(number)
