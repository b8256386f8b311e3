# SPDX-License-Identifier: Apache-2.0
"""The drives of one bus as a plant: what every driver in the box has in common.

It converts directions, ratios and offsets, keeps the last answer of each drive, reports silent
drives and sets up again those that restarted.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Array, SetPoints
from ..errors import PlantSettingsError
from ..interface import Description, DriveFault, JointDescription, Readings, Setup
from .axes import Axes, Axis, Options
from .driver import NONE, Answers, Driver, Found, Wanted
from .faults import RESTARTED

#: Surplus answers that mean two drives with one id, less some for each exchange without.
CLASHES, FORGIVEN = 3.0, 0.3
#: Most answers that may be pending, above what one exchange reads.
LATEST = 100
Make = Callable[[Sequence[str], Mapping[str, str]], "DrivesPlant"]


class DrivesPlant:
    """A DrivePlant over the drives of one bus.

    Args:
        axes: One for each joint, in the board's order.
        driver: That talks to the drives, in the same order.

    Attributes: axes, driver; answers (the last of each drive); far_end (virtual drives that are
        closed with it, or None); clock (of the times of answers, s; set before ``connect``).
    """

    def __init__(self, axes: Sequence[Axis], driver: Driver) -> None:
        self.axes, self.driver = tuple(axes), driver
        self.far_end: Any = None
        self.clock: Callable[[], float] = time.monotonic
        self._axes = Axes(axes)
        self._shafts = any(axis.motor_turns for axis in axes)
        self.answers = Answers(axes)
        self._timeout, self._period, self._free = math.inf, 0.0, [True] * len(axes)
        self._found: list[Found | None] = [None] * len(axes)
        self._off = SetPoints.off(len(axes))
        self._clashes, self._owed, self._last = self._no_clashes()
        #: Start of the overdue answer of each drive, s; a loop that pauses expects none.
        self._asked = np.full(len(axes), math.inf)

    def _no_clashes(self) -> tuple[list[float], list[int], list[bytes]]:
        """Counts of surplus answers, counts of pending answers, last answers."""
        n = len(self.axes)
        return [0.0] * n, [0] * n, [b""] * n

    def describe(self) -> Description:
        """What the drives have; with type, firmware and limits of each once it is connected."""
        traits = self.driver.traits
        joints = (
            JointDescription(
                name=axis.name,
                set_points=traits.set_points,
                drive="" if found is None else f"{found.type} {found.firmware}".strip(),
                rate=traits.rate,
                resolution=traits.resolution / axis.ratio,
                limits=NONE if found is None else axis.limits_at_joint(found.limits),
                on_silence=traits.on_silence,
                torque_estimate=traits.torque,
                current_sensor=traits.current,
                temperature_sensor=traits.temperature,
                motor_encoder=axis.motor_turns > 0.0 or k in traits.motor_encoders,
            )
            for k, (axis, found) in enumerate(zip(self.axes, self._found, strict=True))
        )
        return Description(joints=tuple(joints))

    def connect(self, setup: Setup) -> None:
        """Open the bus again.

        Raises:
            OSError: a drive does not answer, or two answer as one.
            ValueError: a drive is none that this driver supports.
        """
        self.driver.close()
        self.answers = Answers(self.axes, self.clock)
        self._clashes, self._owed, self._last = self._no_clashes()
        self._asked.fill(math.inf)
        self._timeout, self._period = setup.timeout, setup.period
        self._free = [j is None or j.on_silence is OnSilence.FREE for j in setup.joints]
        self.driver.open(setup, self.answers)
        self._found = [self.driver.set_up(k) for k in range(len(self.axes))]
        self.exchange(self._off)

    def exchange(self, wanted: SetPoints) -> Readings:
        """Send set-points and read; a silent drive keeps its last reading."""
        axes, answers, traits = self._axes, self.answers, self.driver.traits
        begin, sent = self.clock(), self._at_drives(wanted)
        for raw in answers.raw:
            raw.clear()
        self.driver.exchange(sent)
        self._notice_clashes(sent)
        late = answers.times < begin
        faults: list[str | DriveFault | None] = [
            fault or (RESTARTED if restarted else None)
            for fault, restarted in zip(answers.faults, answers.restarted, strict=True)
        ]
        for k, count in enumerate(self._clashes):
            if count >= CLASHES:
                faults[k] = f"two drives answer as id {self.axes[k].id}; change that of one"
        if late.any():
            now = self.clock()
            self._asked = np.where(late, np.minimum(self._asked, begin), math.inf)
            owed = np.where(late, now - self._asked, 0.0)  # a loop that pauses is no silence
            for k in np.flatnonzero(owed > self._timeout).tolist():
                faults[k] = silent(self.axes[k], now - answers.times[k])
            ages = np.where(late, np.minimum(owed + self._period, self._timeout), 0.0)
        else:
            ages = np.zeros(len(faults))
            self._asked.fill(math.inf)
        shafts = self._at_shafts() if self._shafts or traits.motor_encoders else (None, None)
        return Readings(
            position=axes.position(answers.position),
            velocity=answers.velocity / axes.factor,
            torque=answers.torque * axes.factor if traits.torque else None,
            current=answers.current * axes.sign if traits.current else None,
            temperature=answers.temperature.copy() if traits.temperature else None,
            voltage=answers.voltage.copy() if traits.voltage else None,
            motor_position=shafts[0],
            motor_velocity=shafts[1],
            ages=ages,
            faults=faults,
        )

    def _at_shafts(self) -> tuple[Array, Array]:
        """Position and velocity of the motors' shafts; NaN where they are not measured."""
        axes, answers = self._axes, self.answers
        position, velocity = axes.shaft * answers.position, axes.shaft * answers.velocity
        own = ~np.isnan(answers.motor_position)
        position[own], velocity[own] = (axes.sign * answers.motor_position)[own], math.nan
        return position, velocity

    def _at_drives(self, wanted: SetPoints) -> dict[int, tuple[SetPoint, list[float]]]:
        values = self._axes.to_drive(wanted).T.tolist()
        kinds = wanted.kinds.copy()
        kinds[self.answers.restarted] = SetPoint.OFF
        return dict(enumerate(zip(map(SetPoint, kinds.tolist()), values, strict=True)))

    def _notice_clashes(self, sent: Wanted) -> None:
        """Detect two drives with one id: more answers than questions, which differ."""
        for k, raw in enumerate(self.answers.raw):
            repeated = len(raw) == 1 and self._last[k] in raw  # it may be a late copy
            owed = min(LATEST, self._owed[k] + (k in sent))
            owed -= 0 if repeated else len(raw)
            self._owed[k] = max(0, owed)
            if owed < 0:
                self._clashes[k] += 1.0
            elif 0.0 < self._clashes[k] < CLASHES:
                self._clashes[k] -= FORGIVEN
            if raw:
                self._last[k] = next(reversed(raw))

    def clear_fault(self, joint: int) -> None:
        """Reset the fault of a drive; one that restarted is set up again, once it answers."""
        self._clashes[joint] = 0.0
        if not self.answers.restarted[joint]:
            self.driver.clear_fault(joint)
            return
        with contextlib.suppress(ConnectionError):
            self._found[joint] = self.driver.set_up(joint, attempts=1)
            self.answers.restarted[joint] = False

    def let_go(self) -> None:
        """Disable motors whose ``on_silence`` is free; the others receive nothing more."""
        off = self._at_drives(self._off)
        free = {k: item for k, item in off.items() if self._free[k]}
        self.driver.exchange(free)

    def close(self) -> None:
        self.driver.close()
        if self.far_end is not None:
            self.far_end.close()


def silent(axis: Axis, age: float) -> str:
    """The fault of a silent drive."""
    if math.isinf(age):
        return f"no answer from id {axis.id}; is it powered, and its id right?"
    return f"no answer from id {axis.id} for {1e3 * age:.0f} ms"


def maker(
    driver: Callable[[Options], Driver],
    *,
    bus: str,
    ids: range,
    whole: Mapping[str, str | float] | None = None,
    each: Mapping[str, str | float] | None = None,
) -> Make:
    """The ``make`` of a driver's module: from joints and options to a plant.

    Args:
        driver: Its class.
        bus: The bus that is used when none is given.
        ids: That its drives can have.
        whole: Its options for a bus; see ``axes.Options.parse``.
        each: Its options for a joint.
    """

    def make(names: Sequence[str], arguments: Mapping[str, str]) -> DrivesPlant:
        """The plant of this driver.

        Raises:
            PlantSettingsError: an argument is unknown or invalid.
        """
        options = Options.parse(names, arguments, bus=bus, whole=whole, each=each)
        for axis in options.axes:
            if axis.id not in ids:
                raise PlantSettingsError(
                    f"{axis.name}.id={axis.id}: {ids[0]} to {ids[-1]} is required"
                )
        return DrivesPlant(options.axes, driver(options))

    return make
