# SPDX-License-Identifier: Apache-2.0
"""Faults of the simulated hardware: what the sensors then say (SPEC F).

Faults go into the plant, never into the board's state: the board's checks must find them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..core.config import Limits
from ..core.faults import FaultCode
from ..core.measurement import Array, Row

TRANSIENT = 0.02
#: A passing silence outlasts the time after which the board calls it a fault (0.02 s).
SILENCE = 0.1
SPIKE = 0.5
DIVERGED = "diverged"


@dataclass(slots=True)
class Injection:
    """A fault at work.

    Attributes: joint (index), limits (of that joint), start and end (control cycles; the fault
    acts on readings of start ≤ cycle < end), sample (that joint's rows at the start).
    """

    joint: int
    limits: Limits
    start: int
    end: float
    sample: list[float]

    def hold(self, values: Array, *rows: Row) -> None:
        """Keep these rows at their sample from the start."""
        for row in rows:
            values[row, self.joint] = self.sample[row]


Corruption = Callable[[Injection, Array, int, float], None]


def _overcurrent(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    values[Row.CURRENT, fault.joint] = 3.0 * fault.limits.peak_current


def _silent(fault: Injection, values: Array, cycle: int, period: float) -> None:
    fault.hold(values, Row.POSITION, Row.VELOCITY)
    values[Row.ENCODER_AGE, fault.joint] = (cycle - fault.start) * period


def _nan(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    values[Row.POSITION, fault.joint] = values[Row.VELOCITY, fault.joint] = float("nan")


def _frozen(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    fault.hold(values, Row.POSITION)
    values[Row.VELOCITY, fault.joint] = 0.0


def _spike(fault: Injection, values: Array, cycle: int, _period: float) -> None:
    if (cycle - fault.start) % 2 == 0:
        values[Row.POSITION, fault.joint] += SPIKE


def _reversed(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    position = values[Row.POSITION, fault.joint]
    values[Row.POSITION, fault.joint] = 2.0 * fault.sample[Row.POSITION] - position
    values[Row.VELOCITY, fault.joint] *= -1.0


def _torque_silent(fault: Injection, values: Array, cycle: int, period: float) -> None:
    fault.hold(values, Row.TORQUE)
    values[Row.TORQUE_AGE, fault.joint] = (cycle - fault.start) * period


def _overheating(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    values[Row.TEMPERATURE, fault.joint] = fault.limits.temperature + 10.0


def _external(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    values[Row.ALARM, fault.joint] = 1.0 + FaultCode.EXTERNAL


def _nothing(fault: Injection, values: Array, _cycle: int, _period: float) -> None:
    """Diverged: the plant itself puts it into the physics."""


#: What each kind of fault does to the readings.
KINDS: dict[str, Corruption] = {
    "overcurrent": _overcurrent,  # shorted bridge: far above peak, whatever the PWM
    "encoder": _silent,  # no samples: the last one ages
    "encoder_nan": _nan,  # samples that are not numbers
    "encoder_frozen": _frozen,  # fresh samples that never change
    "encoder_spike": _spike,  # one wild sample; persistent: every second one
    "encoder_reversed": _reversed,  # counts the wrong way
    "torque_sensor": _torque_silent,  # no samples: the last one ages
    "overheating": _overheating,  # winding above its limit
    "external": _external,  # emergency stop
    DIVERGED: _nothing,  # a torque that is not a number enters the physics
}


class Injector:
    """The faults at work on a plant; ``active`` is false while there are none."""

    def __init__(self, names: Sequence[str], limits: Sequence[Limits], period: float) -> None:
        self._names, self._limits, self._period = tuple(names), tuple(limits), period
        self._faults: dict[tuple[int, str], Injection] = {}
        self.active = False

    def add(self, joint: int, kind: str, persistent: bool, cycle: int, truth: Array) -> None:
        """Let a fault begin with the reading of this cycle.

        Args:
            joint: Index of the joint.
            kind: One of KINDS.
            persistent: Until cleared; otherwise for 20 ms (a silence: 100 ms, a spike: one
                sample).
            cycle: The present control cycle.
            truth: True readings of now, shape (ROWS, n).

        Raises:
            ValueError: the kind is unknown; the message lists what is allowed.
        """
        if kind not in KINDS:
            raise ValueError(f"fault {kind!r} unknown; faults: {', '.join(KINDS)}")
        seconds = {"encoder": SILENCE, "torque_sensor": SILENCE, "encoder_spike": 0.0}
        lasts = max(1, round(seconds.get(kind, TRANSIENT) / self._period))
        self._faults[joint, kind] = Injection(
            joint,
            self._limits[joint],
            cycle,
            float("inf") if persistent else cycle + lasts,
            truth[:, joint].tolist(),
        )
        self.active = True

    def clear(self) -> None:
        """Remove every fault."""
        self._faults.clear()
        self.active = False

    def corrupt(self, values: Array, cycle: int) -> None:
        """Make the readings of this cycle, shape (ROWS, n), what the broken sensors say."""
        for key, fault in list(self._faults.items()):
            if cycle >= fault.end:
                del self._faults[key]
            else:
                KINDS[key[1]](fault, values, cycle, self._period)
        self.active = bool(self._faults)

    def diverged(self, cycle: int) -> list[int]:
        """Joints whose torque is not a number in this cycle."""
        return [
            joint
            for (joint, kind), fault in self._faults.items()
            if kind == DIVERGED and cycle < fault.end
        ]
