# SPDX-License-Identifier: Apache-2.0
"""One exchange with somebody else's plant: power, outputs, readings, each of them checked.

No threads and no clock here: ``guarded`` calls this in a thread that may hang.
"""

from __future__ import annotations

import numpy as np

from ..core.config import BoardConfig
from ..core.measurement import ROWS, Array, Row
from ..text import clean
from .interface import JointDescription, Readings, RobotPlant


class NonsenseError(ValueError):
    """A plant returned what is no reading; one line."""


class Sample:
    """What an exchange gave: values, shape (ROWS, n), and the drives' own faults by joint."""

    __slots__ = ("applied", "faults", "values")

    def __init__(self, values: Array, faults: dict[int, str], applied: Array) -> None:
        self.values, self.faults, self.applied = values, faults, applied


class Exchange:
    """Exchanges with a plant, in the order and the units of a board.

    Args:
        plant: Of somebody else.
        board: Its joints are among the plant's.
        period: From one exchange to the next, s.
    """

    def __init__(self, plant: RobotPlant, board: BoardConfig, period: float) -> None:
        self._plant, self._period = plant, period
        joints = plant.describe().joints
        names = [joint.name for joint in joints]
        self._count = len(joints)
        #: The plant's number of each joint of the board.
        self.numbers = [names.index(name) for name in board.names]
        self._has: list[JointDescription] = [joints[number] for number in self.numbers]
        motors = [joint.motor for joint in board.joints]
        self._volts = np.array([motor.supply_voltage / 100.0 for motor in motors])
        self._back_emf = np.array([motor.back_emf for motor in motors])
        self._resistance = np.array([motor.resistance for motor in motors])
        self._peak = np.array([joint.limits.peak_current for joint in board.joints])
        self._ambient = np.array([motor.ambient for motor in motors])
        self._outputs = np.zeros(self._count)
        self.forget()

    def forget(self) -> None:
        """After an error: nothing is known of bridges and positions."""
        self._on: list[bool | None] = [None] * len(self.numbers)
        self._before: Array | None = None

    def run(self, pwm: Array, powered: Array, faulty: dict[int, str]) -> Sample:
        """Power, outputs, readings.

        Args:
            pwm: Percent, shape (n,), in the board's order.
            powered: 1 where the bridge is to be closed, shape (n,).
            faulty: Joints whose drive reported a fault in the last exchange.

        Raises:
            NonsenseError: what came back is no reading.
        """
        plant = self._plant
        for j, (number, has) in enumerate(zip(self.numbers, self._has, strict=True)):
            on = bool(powered[j] > 0.0)
            if has.power_switch and on is not self._on[j]:
                (plant.enable if on else plant.disable)(number)
            self._on[j] = on
            if j in faulty and not on:
                plant.clear_fault(number)
        self._outputs[self.numbers] = np.where(powered > 0.0, pwm, 0.0)
        applied = self._row("write", plant.write(self._outputs.copy()))
        return self._sample(plant.read(), applied)

    def _sample(self, found: Readings, applied: Array) -> Sample:
        if not isinstance(found, Readings):
            raise NonsenseError(f"read returned {type(found).__name__}; Readings are wanted")
        values = np.zeros((ROWS, len(self.numbers)))
        values[Row.POSITION] = position = self._row("position", found.position)
        if found.velocity is not None:
            velocity = self._row("velocity", found.velocity)
        elif self._before is None:
            velocity = np.zeros_like(position)
        else:
            velocity = (position - self._before) / self._period
        values[Row.VELOCITY] = velocity
        self._before = position
        if found.torque is not None:
            values[Row.TORQUE] = self._row("torque", found.torque)
        if found.current is not None:
            values[Row.CURRENT] = self._row("current", found.current)
        else:  # what the winding settles at: i = (V − Ke dq)/R
            current = (self._volts * applied - self._back_emf * velocity) / self._resistance
            current[[not on for on in self._on]] = 0.0
            values[Row.CURRENT] = np.clip(current, -self._peak, self._peak)
        warm = found.temperature
        values[Row.TEMPERATURE] = self._ambient if warm is None else self._row("temperature", warm)
        return Sample(values, self._faults(found), applied)

    def _faults(self, found: Readings) -> dict[int, str]:
        if len(found.faults) not in (0, self._count):
            raise NonsenseError(f"faults has {len(found.faults)} entries; {self._count} or none")
        if not found.faults:
            return {}
        texts = [clean(found.faults[number]) for number in self.numbers]
        return {j: text for j, text in enumerate(texts) if text}

    def _row(self, what: str, found: object) -> Array:
        """An array of the plant, in the board's order."""
        if found is None:
            raise NonsenseError(f"{what} is None; {self._count} numbers are wanted")
        try:
            row = np.array(found, dtype=np.float64)
        except (TypeError, ValueError):
            raise NonsenseError(
                f"{what} is {clean(repr(found), 60)}; {self._count} numbers are wanted"
            ) from None
        if row.shape != (self._count,):
            raise NonsenseError(f"{what} has shape {row.shape}; ({self._count},) is wanted")
        return np.array(row[self.numbers])
