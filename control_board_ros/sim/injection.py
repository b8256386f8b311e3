# SPDX-License-Identifier: Apache-2.0
"""Faults of the simulated hardware, visible in its sensors (SPEC F).

Faults enter the plant, never the board's state: the board's checks must detect them. A transient
fault lasts until detectable: some readings where one suffices, otherwise until the board disables
the joint.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..core.config.config import JointConfig, Limits
from ..core.terms.drives import SetPoint
from ..core.terms.faults import FaultCode
from ..core.terms.measurement import Array, Row
from ..text import unknown_word

#: Minimum duration of a transient fault, s; rounded to readings, at least one.
TRANSIENT = 0.02
#: Minimum duration of a transient sensor timeout, s; longer for longer timeouts of the board.
SILENCE = 0.1
#: Jump of a spike, rad or m, beyond the impossible motion per cycle.
SPIKE = 0.5
DIVERGED = "diverged"

#: Sensors that can stop sampling, as their timeouts are called.
SILENT = ("encoder", "torque_sensor")
#: Faults that appear only in driven joints: pending in an unpowered one.
TRAVEL = frozenset({"encoder_frozen", "encoder_reversed"})


@dataclass(slots=True)
class Injection:
    """An active fault.

    Attributes: joint (index), limits (of that joint), start and end (control cycles; the fault
    acts on readings of start ≤ cycle < end, and longer by kind), sample (the joint's rows at the
    start), driven (whether its bridge has been on since).
    """

    joint: int
    limits: Limits
    start: int
    end: float
    sample: list[float]
    driven: bool

    def hold(self, values: Array, *rows: Row) -> None:
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


def _spike(fault: Injection, values: Array, cycle: int, period: float) -> None:
    if (cycle - fault.start) % 2 == 0:
        values[Row.POSITION, fault.joint] += SPIKE + 16.0 * fault.limits.velocity * period


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
    """No false reading: applied by the plant to the physics."""


#: Effect of each kind of fault on the readings.
KINDS: dict[str, Corruption] = {
    "overcurrent": _overcurrent,  # shorted bridge: far above peak at any PWM
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


#: Faults of joints that have a brake: it does not open, or holds a fiftieth of its torque. They
#: last until they are cleared.
BRAKES = ("brake_stuck", "brake_worn")
#: Of joints whose drive closes loops of its own: it receives nothing until this is cleared.
DEAF = "drive_deaf"
LASTING_FAULTS = (*BRAKES, DEAF)


class Injector:
    """The active faults of a plant; ``active``: whether there are any."""

    def __init__(self, joints: Sequence[JointConfig], period: float) -> None:
        self._joints, self._period = tuple(joints), period
        self._faults: dict[tuple[int, str], Injection] = {}
        self._powered = np.zeros(len(joints), dtype=bool)
        self.active = False

    def check(self, joint: int, kind: str) -> None:
        """Raise ValueError where a joint cannot have a fault: unknown kind, or no such sensor."""
        config = self._joints[joint]
        if kind not in KINDS and kind not in LASTING_FAULTS:
            raise ValueError(unknown_word("fault", kind, (*KINDS, *LASTING_FAULTS), "faults:"))
        if kind == "torque_sensor" and not config.torque_sensor:
            raise ValueError(f"{config.name} has no torque sensor to break; choose another fault")
        if kind in BRAKES and not config.brake.present:
            raise ValueError(f"{config.name} has no brake to break; choose another fault")
        if kind == DEAF and config.set_points == (SetPoint.PWM,):
            raise ValueError(
                f"{config.name} has no drive that closes loops of its own; "
                f"set {config.name}.drive, or choose another fault"
            )

    def add(self, joint: int, kind: str, persistent: bool, cycle: int, truth: Array) -> None:
        """Start a fault, which ``check`` allows, with the reading of this cycle.

        Args:
            joint: Index of the joint.
            kind: One of KINDS.
            persistent: Until cleared; otherwise until detectable by the board.
            cycle: The present control cycle.
            truth: True readings of this cycle, shape (ROWS, n).
        """
        config = self._joints[joint]
        self._faults[joint, kind] = Injection(
            joint,
            config.limits,
            cycle,
            math.inf
            if persistent or kind in LASTING_FAULTS
            else cycle + self._least(kind, config),
            truth[:, joint].tolist(),
            driven=bool(self._powered[joint]),
        )
        self.active = True

    def _least(self, kind: str, joint: JointConfig) -> int:
        """Minimum duration of a transient fault, in readings."""
        if kind == "encoder_spike":
            return 1
        seconds = TRANSIENT
        if kind in SILENT:
            seconds = max(SILENCE, getattr(joint.timeouts, kind) + 2.0 * self._period)
        return max(1, math.ceil(seconds / self._period - 1e-9))

    def switch(self, powered: Array) -> None:
        """Record the state of the bridges, shape (n,), 1.0 or 0.0."""
        self._powered = powered > 0.0
        for fault in self._faults.values():
            fault.driven |= bool(self._powered[fault.joint])

    def clear(self, joints: Sequence[int] | None = None) -> None:
        """Remove the faults of some joints, or of all (None)."""
        kept = {} if joints is None else self._faults
        self._faults = {key: fault for key, fault in kept.items() if key[0] not in (joints or ())}
        self.active = bool(self._faults)

    def corrupt(self, values: Array, cycle: int) -> None:
        """Apply the active faults to the readings of this cycle, shape (ROWS, n)."""
        for key, fault in list(self._faults.items()):
            if cycle >= fault.end and not self._unfound(key[1], fault):
                del self._faults[key]
            else:
                KINDS.get(key[1], _nothing)(fault, values, cycle, self._period)
        self.active = bool(self._faults)

    def _unfound(self, kind: str, fault: Injection) -> bool:
        """Whether the board has not detected a fault yet: it disables the joint when it has."""
        if kind in TRAVEL:
            return not fault.driven or bool(self._powered[fault.joint])
        return kind in SILENT and bool(self._powered[fault.joint])

    def having(self, kind: str) -> set[int]:
        return {joint for joint, its in self._faults if its == kind}

    def diverged(self, cycle: int) -> list[int]:
        """Joints whose torque is not a number in this cycle."""
        return [
            joint
            for (joint, kind), fault in self._faults.items()
            if kind == DIVERGED and cycle < fault.end
        ]
