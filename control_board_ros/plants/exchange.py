# SPDX-License-Identifier: Apache-2.0
"""One exchange with a third-party plant: set-points, readings, each of them checked.

No threads and no clock here: ``guarded`` calls this in a thread that may hang.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.config.config import BoardConfig
from ..core.terms.drives import DriveReport, SetPoint
from ..core.terms.measurement import MOTOR_ROWS, ROWS, VALUES, Array, Motor, Row, SetPoints
from ..text import clean
from .interface import OF_MOTORS, DrivePlant, Readings, Setup


class NonsenseError(ValueError):
    """A plant returned an invalid reading; one line."""


@dataclass(slots=True)
class Sample:
    """The result of an exchange.

    Attributes: values (shape (ROWS, n)), faults (of the drives, by joint), applied (percent of
    PWM, shape (n,)), late (which joints answered too late for this exchange, shape (n,)), dropped
    (frames to each joint's bus so far that were dropped, shape (n,)), motors
    (rows of Motor, NaN where there is no sensor; None: there is none), lost (joints whose zero is
    lost, by number), drives (what each reports of itself; empty: nothing new).
    """

    values: Array
    faults: dict[int, str]
    applied: Array
    late: NDArray[np.bool_]
    dropped: Array
    motors: Array | None = None
    lost: tuple[int, ...] = ()
    drives: tuple[DriveReport, ...] = ()


class Exchange:
    """Exchanges with a plant, in the order and the units of a board.

    Args:
        plant: The third party's.
        board: Its joints are among the plant's.
        timeout: Allowed silence of each side, s.
    """

    def __init__(self, plant: DrivePlant, board: BoardConfig, timeout: float) -> None:
        self._plant, self._period = plant, board.period
        names = [joint.name for joint in plant.describe().joints]
        self._count = len(names)
        #: The plant's number of each joint of the board.
        self.numbers = [names.index(name) for name in board.names]
        configs = dict(zip(board.names, board.joints, strict=True))
        self._setup = Setup(
            period=board.period, timeout=timeout, joints=tuple(map(configs.get, names))
        )
        motors = [joint.motor for joint in board.joints]
        self._volts = np.array([motor.supply_voltage / 100.0 for motor in motors])
        self._back_emf = np.array([motor.back_emf for motor in motors])
        self._resistance = np.array([motor.resistance for motor in motors])
        self._per_ampere = np.array([motor.torque_per_ampere for motor in motors])
        self._peak = np.array([joint.limits.peak_current for joint in board.joints])
        self._ambient = np.array([motor.ambient for motor in motors])
        self.forget()

    def forget(self) -> None:
        """Forget power and positions, after an error."""
        self._wanted = SetPoints.off(len(self.numbers))
        self._before: Array | None = None
        self._rate = np.zeros(len(self.numbers))
        self._age = np.zeros(len(self.numbers))
        self._turned: Array | None = None

    def connect(self) -> None:
        self.forget()
        self._plant.connect(self._setup)

    def run(
        self, wanted: SetPoints, faulty: dict[int, str], elapsed: float | None = None
    ) -> Sample:
        """Exchange set-points and readings, in the board's order.

        Args:
            wanted: The set-points.
            faulty: Joints whose drive reported a fault in the last exchange.
            elapsed: Since the last exchange, s; None, or 0: a control period.

        Raises:
            NonsenseError: the plant returned an invalid reading.
        """
        for j in faulty:
            if not (wanted.powered[j] or self._wanted.powered[j]):
                self._plant.clear_fault(self.numbers[j])
        self._wanted, self._elapsed = wanted, elapsed or self._period
        return self._sample(self._plant.exchange(self._in_order(wanted)), wanted)

    @property
    def drives(self) -> bool:
        """Whether a joint has power."""
        return bool(self._wanted.powered.any())

    def let_go(self) -> None:
        """Each motor does its ``on_silence``."""
        self.forget()
        self._plant.let_go()

    def _in_order(self, wanted: SetPoints) -> SetPoints:
        if self.numbers == [*range(self._count)]:
            return wanted
        kinds = np.zeros(self._count, dtype=np.int8)
        values, released = np.zeros((VALUES, self._count)), np.zeros(self._count)
        kinds[self.numbers] = wanted.kinds
        values[:, self.numbers] = wanted.values
        released[self.numbers] = wanted.released
        return SetPoints(kinds, values, released)

    def _sample(self, readings: Readings, wanted: SetPoints) -> Sample:
        if not isinstance(readings, Readings):
            raise NonsenseError(f"a reading is {type(readings).__name__}; Readings is required")
        values = np.zeros((ROWS, len(self.numbers)))
        values[Row.POSITION] = position = self._row("position", readings.position)
        zeros = np.zeros_like(position)
        age = self._row_or("ages", readings, zeros.copy())
        age[np.isnan(position) & (age == 0.0)] = self._elapsed  # not read yet
        between = self._elapsed + self._age - age  # the last two readings of each joint
        if readings.velocity is not None:
            velocity = self._row("velocity", readings.velocity)
        elif self._before is None:
            velocity = np.zeros_like(position)
        else:
            velocity = self._rate.copy()
            fresh = between > 0.5 * self._elapsed  # else the same reading again
            np.divide(position - self._before, between, out=velocity, where=fresh)
        values[Row.VELOCITY] = self._rate = velocity
        values[Row.ENCODER_AGE] = self._age = age
        self._before = position
        values[Row.TORQUE] = self._row_or("torque", readings, zeros)
        applied = self._row_or("applied", readings, wanted.pwm)
        if readings.current is not None:
            values[Row.CURRENT] = self._row("current", readings.current)
        else:
            values[Row.CURRENT] = self._settled(applied, velocity, values[Row.TORQUE], wanted)
        values[Row.TEMPERATURE] = self._row_or("temperature", readings, self._ambient)
        late = values[Row.ENCODER_AGE] > 0.0
        dropped = self._row_or("dropped", readings, zeros)
        lost = tuple(np.flatnonzero(self._row_or("lost", readings, zeros)).tolist())
        faults, motors = self._faults(readings), self._motors(readings)
        return Sample(
            values, faults, applied, late, dropped, motors, lost, self._reports(readings)
        )

    def _settled(self, applied: Array, velocity: Array, torque: Array, wanted: SetPoints) -> Array:
        """The steady current of the winding, i = (V − Ke dq)/R, or that of the torque."""
        current = (self._volts * applied - self._back_emf * velocity) / self._resistance
        current = np.where(wanted.kinds == SetPoint.PWM, current, torque / self._per_ampere)
        current[~wanted.powered] = 0.0
        settled: Array = np.clip(current, -self._peak, self._peak)
        return settled

    def _motors(self, readings: Readings) -> Array | None:
        """Readings of motors; a velocity that is not read is the change of the position."""
        rows_read = [getattr(readings, name) for name in OF_MOTORS]
        if all(value is None for value in rows_read):
            return None
        rows = np.full((MOTOR_ROWS, len(self.numbers)), np.nan)
        for row, name, value in zip(Motor, OF_MOTORS, rows_read, strict=True):
            if value is not None:
                rows[row] = self._row(name, value)
        velocity, position = rows[Motor.VELOCITY], rows[Motor.POSITION]
        if self._turned is not None:
            changed = (position - self._turned) / self._elapsed
            np.copyto(velocity, changed, where=np.isnan(velocity))
        self._turned = position.copy()
        return rows

    def _reports(self, readings: Readings) -> tuple[DriveReport, ...]:
        """What the drives report of themselves, in the board's order; empty: nothing new."""
        if readings.drives is None:
            return ()
        if len(readings.drives) != self._count:
            raise NonsenseError(
                f"drives has {len(readings.drives)} entries; {self._count} or None"
            )
        return tuple(DriveReport(*readings.drives[number]) for number in self.numbers)

    def _faults(self, readings: Readings) -> dict[int, str]:
        if len(readings.faults) not in (0, self._count):
            raise NonsenseError(
                f"faults has {len(readings.faults)} entries; {self._count} or none"
            )
        if not readings.faults:
            return {}
        texts = [clean(str(readings.faults[number] or "")) for number in self.numbers]
        return {j: text for j, text in enumerate(texts) if text}

    def _row_or(self, name: str, readings: Readings, otherwise: Array) -> Array:
        """An array of the readings; another where the plant has none."""
        value = getattr(readings, name)
        return otherwise if value is None else self._row(name, value)

    def _row(self, what: str, value: object) -> Array:
        """An array of the plant, in the board's order."""
        if value is None:
            raise NonsenseError(f"{what} is None; {self._count} numbers are required")
        try:
            row = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise NonsenseError(
                f"{what} is {clean(repr(value), 60)}; {self._count} numbers are required"
            ) from None
        if row.shape != (self._count,):
            raise NonsenseError(f"{what} has shape {row.shape}; ({self._count},) is required")
        return np.array(row[self.numbers])
