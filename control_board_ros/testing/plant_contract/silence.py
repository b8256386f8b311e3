# SPDX-License-Identifier: Apache-2.0
"""Checks of silence, of either side (SPEC B3, B5, S5), behind the guard of the node."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from ...core.terms.measurement import Actuation, Row, SetPoints
from ...plants.guarded import GuardedPlant
from ...plants.interface import Description, DrivePlant, Readings, Setup
from .bench import TIMEOUT, Subject, UnseenError, at_rest, board_for, expect, off
from .checks import cleared

#: Timeout, s, and period of a loop, s.
PATIENCE, LOOK = 60.0, 2e-3


class CallRecorder:
    """A DrivePlant around another one that records calls, and hangs or raises on request.

    Attributes: driven, left (there was an exchange with power; it was let go), gate (exchanges
    wait for it), trouble (what the next exchange raises), connections, answers (of exchanges).
    """

    def __init__(self, plant: DrivePlant) -> None:
        self._plant = plant
        self.driven, self.left, self.gate = threading.Event(), threading.Event(), threading.Event()
        self.gate.set()
        self.trouble: Exception | None = None
        self.connections = self.answers = 0

    def describe(self) -> Description:
        return self._plant.describe()

    def connect(self, setup: Setup) -> None:
        self._plant.connect(setup)
        self.connections += 1

    def exchange(self, wanted: SetPoints) -> Readings:
        self.gate.wait()
        if self.trouble is not None:
            trouble, self.trouble = self.trouble, None
            raise trouble
        readings = self._plant.exchange(wanted)
        self.answers += 1
        if wanted.powered.any():
            self.driven.set()
        return readings

    def clear_fault(self, joint: int) -> None:
        self._plant.clear_fault(joint)

    def let_go(self) -> None:
        self._plant.let_go()
        self.left.set()

    def close(self) -> None:
        self._plant.close()


class Loop:
    """A control loop on a guarded plant, a cycle at a time.

    Attributes: time (of the guard, s: only checks let it pass, whatever the load of the machine).
    """

    def __init__(self, noted: CallRecorder, timeout: float) -> None:
        self.time, self._noted = 0.0, noted
        board = board_for(noted.describe())
        self.guarded = GuardedPlant(noted, board, timeout, lambda: self.time, first=PATIENCE)
        self._pause = threading.Event()

    def cycle(self, wanted: Actuation) -> dict[int, str]:
        """One cycle; the joints that have an alarm, and why."""
        measurement = self.guarded.read()
        self.guarded.write(wanted)
        self._pause.wait(LOOK)
        return dict(measurement.reasons or {})

    def until(
        self,
        good: Callable[[dict[int, str]], bool],
        wanted: Actuation,
        what: str,
        step: float = 0.0,
    ) -> None:
        """Run cycles until the alarms are so; the time of the guard passes by ``step`` each, s."""
        for _ in range(round(PATIENCE / LOOK)):
            self.time += step
            if good(alarms := self.cycle(wanted)):
                return
        expect(False, f"{what}; {_words(alarms) or 'no alarm'}")

    def without_alarm(self, wanted: Actuation, what: str) -> None:
        """Run cycles until the plant has answered, and there is no alarm."""
        before = self._noted.answers
        self.until(lambda alarms: not alarms and self._noted.answers > before, wanted, what)

    def drive(self, wanted: Actuation) -> None:
        self.until(lambda _: self._noted.driven.is_set(), wanted, "it never gets power")


@contextlib.contextmanager
def looped(
    subject: Subject, timeout: float
) -> Iterator[tuple[CallRecorder, Loop, Actuation, Actuation]]:
    """A plant behind its guard; set-points that hold its joints, and that disable them."""
    with subject.made() as plant:
        noted, n = CallRecorder(plant), len(plant.describe().joints)
        loop, on, none = Loop(noted, timeout), np.ones(n), np.zeros(n)
        try:
            idle = Actuation(none, none)
            loop.without_alarm(idle, "before it gets power")
            position = loop.guarded.read().values[Row.POSITION].copy()
            held = at_rest(plant.describe().joints, position)
            yield noted, loop, Actuation(none, on, held.kinds, held.values, brakes=none), idle
        finally:
            noted.gate.set()
            loop.guarded.close()


def a_board_reads_it_without_an_alarm(subject: Subject) -> None:
    """Behind the guard of the node, in its thread."""
    with looped(subject, PATIENCE) as (_, loop, _, idle):
        for _ in range(20):
            alarms = loop.cycle(idle)
            expect(not alarms, f"an alarm without a cause: {_words(alarms)}")
            motion = loop.guarded.read().values[[Row.POSITION, Row.VELOCITY]]
            expect(bool(np.isfinite(motion).all()), "position or velocity is not finite")


def it_is_let_go_when_the_board_falls_silent(subject: Subject) -> None:
    """B5: after plant_timeout without a set-point; it recovers after the board's fault."""
    with looped(subject, TIMEOUT) as (noted, loop, held, idle):
        loop.drive(held)
        loop.time += 10.0 * TIMEOUT
        noted.left.wait(PATIENCE)
        expect(noted.left.is_set(), "the board fell silent, and let_go() is never called")
        expect(bool(loop.guarded.read().reasons), "the board fell silent: no joint has an alarm")
        loop.without_alarm(idle, "it does not answer any more after let_go()")


def a_board_detects_that_it_hangs(subject: Subject) -> None:
    """B3: a fault within plant_timeout; it recovers once it answers again."""
    with looped(subject, TIMEOUT) as (noted, loop, _, idle):
        noted.gate.clear()
        loop.until(bool, idle, "it hangs, and no joint has an alarm", step=LOOK)
        noted.gate.set()
        loop.without_alarm(idle, "it hung, and does not answer any more")


def it_comes_back_after_an_error(subject: Subject) -> None:
    """B3: an exchange that fails under power; it is connected again, without power."""
    with looped(subject, PATIENCE) as (noted, loop, held, idle):
        loop.drive(held)
        noted.trouble = OSError("the cable is out")
        loop.until(lambda alarms: "the cable is out" in _words(alarms), held, "no error is shown")
        loop.without_alarm(idle, "after an error and connect() it does not answer")
        expect(noted.connections > 1, "after an error it is not connected again")


def its_drives_have_a_watchdog(subject: Subject) -> None:
    """S5: the drives' own watchdog, for a computer that is stopped; reported as a fault."""
    with subject.connected() as (plant, n):
        joints, readings = plant.describe().joints, plant.exchange(off(plant))
        held = at_rest(joints, readings.position)
        subject.drive(plant, held)
        subject.wait(3.0 * TIMEOUT)
        if not any(plant.exchange(held).faults):
            raise UnseenError(
                "no drive reports a watchdog: where this computer stops, the last set-point "
                "stays; set the drives' own in connect(), to setup.timeout at most"
            )
        left = cleared(subject, plant, range(n))
        expect(not left, f"after a watchdog, clear_fault() leaves {left}")


def _words(alarms: Mapping[int, str]) -> str:
    return "; ".join(dict.fromkeys(alarms.values()))
