# SPDX-License-Identifier: Apache-2.0
"""The data between board and plant, as whole arrays.

The plant fills one block of shape (ROWS, n) per control cycle; the board answers with the
set-point of each drive and whether its bridge is on.

A drive accepts set-points of some kinds (S1), and closes the loops behind them::

    PWM         pwm                     percent of the supply voltage
    CURRENT     current                 i
    TORQUE      torque                  τ
    VELOCITY    velocity, torque        q̇, τ_ff
    POSITION    position, velocity, torque                        q, q̇, τ_ff
    IMPEDANCE   position, velocity, stiffness, damping, torque   q, q̇, k, d, τ_ff

The torque of an impedance is τ = τ_ff + k (q_set − q) + d (q̇_set − q̇). All of them are at the
joint: rad, rad/s, N·m, N·m/rad, N·m·s/rad, for prismatic joints m and N; the current is the
motor's, A.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from . import arguments
from .drives import DriveReport, SetPoint
from .faults import FaultCode

Array = arguments.Array


class BlockRow:
    """A row of a block of values, as an attribute of the object that has the block.

    Args:
        block: Name of the attribute that is the block, shape (rows, n).
        row: Of the block.
    """

    def __init__(self, block: str, row: int) -> None:
        self.block, self.row = block, row

    def __get__(self, owner: Any, _: Any = None) -> Array:
        values: Array = getattr(owner, self.block)[self.row]
        return values


class Value(IntEnum):
    """Rows of a block of set-points."""

    PWM = 0
    CURRENT = 1
    TORQUE = 2
    VELOCITY = 3
    POSITION = 4
    STIFFNESS = 5
    DAMPING = 6


VALUES = len(Value)

#: The values of each kind, shape (kinds, VALUES); the others are 0.
HAS = np.zeros((len(SetPoint), VALUES))
for _kind, _values in {
    SetPoint.PWM: (Value.PWM,),
    SetPoint.CURRENT: (Value.CURRENT,),
    SetPoint.TORQUE: (Value.TORQUE,),
    SetPoint.VELOCITY: (Value.VELOCITY, Value.TORQUE),
    SetPoint.POSITION: (Value.POSITION, Value.VELOCITY, Value.TORQUE),
    SetPoint.IMPEDANCE: [*Value][Value.TORQUE :],
}.items():
    HAS[_kind, _values] = 1.0


@dataclass(frozen=True, slots=True)
class SetPoints:
    """The set-points of one exchange; the arrays are read-only.

    Law and set-point come in one exchange (S3). The kind OFF disables the motor, any other kind
    enables it. Values that a kind does not have are 0.

    Attributes:
        kinds: SetPoint of each joint, shape (n,).
        values: Shape (VALUES, n), see Value.
        released: 1.0 where a brake is to be open, shape (n,).
    """

    kinds: NDArray[np.int8]
    values: Array
    released: Array

    def __post_init__(self) -> None:
        for array in (self.kinds, self.values, self.released):
            array.setflags(write=False)

    @classmethod
    def off(cls, count: int) -> SetPoints:
        """No joint has power."""
        return cls(np.zeros(count, dtype=np.int8), np.zeros((VALUES, count)), np.zeros(count))

    @property
    def powered(self) -> NDArray[np.bool_]:
        """Which joints have power."""
        powered: NDArray[np.bool_] = self.kinds != SetPoint.OFF
        return powered

    pwm = BlockRow("values", Value.PWM)
    current = BlockRow("values", Value.CURRENT)
    #: τ, or the τ_ff beside a position, a velocity or an impedance.
    torque = BlockRow("values", Value.TORQUE)
    velocity = BlockRow("values", Value.VELOCITY)
    position = BlockRow("values", Value.POSITION)
    stiffness = BlockRow("values", Value.STIFFNESS)
    damping = BlockRow("values", Value.DAMPING)


DOUBLE = np.dtype(np.float64)

#: Readings beyond this are invalid: their products need not be finite.
CREDIBLE = 1e9


def doubles(values: Any, shape: tuple[int, ...]) -> Array:
    """The array itself where it is float64 of this shape, else a copy of it that is.

    Raises:
        ValueError: it has another shape, and is no number for all.
    """
    if type(values) is np.ndarray and values.dtype is DOUBLE and values.shape == shape:
        return values
    return np.array(np.broadcast_to(values, shape), dtype=np.float64)


class Row(IntEnum):
    """Rows of a measurement; the order serves the control cycle, which slices it.

    POSITION is what the encoder reads, zero offset included (rad); TORQUE the joint torque
    sensor (N·m); VELOCITY (rad/s); CURRENT of the motor (A); TEMPERATURE of its winding (°C);
    ENCODER_AGE and TORQUE_AGE the age of the samples (s); ALARM 0, or 1 + the fault code that
    the hardware itself raises (emergency stop, diverged simulation).
    """

    POSITION = 0
    TORQUE = 1
    TEMPERATURE = 2
    ENCODER_AGE = 3
    TORQUE_AGE = 4
    ALARM = 5
    VELOCITY = 6
    CURRENT = 7


ROWS = len(Row)
#: Rows that are NaN before a joint's first reading.
UNREAD = [Row.POSITION, Row.VELOCITY, Row.TORQUE, Row.CURRENT]


class Motor(IntEnum):
    """Rows of further readings of motors: position and velocity of the shaft (rad, rad/s, before
    the gearbox), supply voltage of the amplifier (V).
    """

    POSITION = 0
    VELOCITY = 1
    SUPPLY = 2


MOTOR_ROWS = len(Motor)


@dataclass(slots=True)
class Measurement:
    """One reading of the whole plant: time (s) and values, shape (ROWS, n), see Row.

    Time is that of one clock, which never goes back; ``elapsed`` is the time since the reading
    before, s. None is one control period: simulations, whose clock has no error. A joint's
    reading may be older than the cycle, by its ENCODER_AGE; before its first one it is NaN (B7).
    The plant may reuse the array from one reading to the next. ``reasons`` has in words why a
    joint (by its number) has an ALARM, where the plant has more than the fault code. ``brakes``
    are the brakes by their switches, 1.0 where closed, NaN where there is no switch, shape
    (n,); None: there is none. ``applied`` is the PWM that acted since the last reading, percent,
    shape (n,), where measured. ``motors`` has the rows of Motor, shape (MOTOR_ROWS, n),
    NaN where there is no sensor. ``lost`` are joints whose angle is not known any more (S9).
    ``drives`` is what each drive reports of itself, shape (n,); empty: nothing new.
    """

    time: float
    values: Array
    reasons: Mapping[int, str] | None = None
    brakes: Array | None = None
    applied: Array | None = None
    motors: Array | None = None
    elapsed: float | None = None
    lost: Sequence[int] = ()
    drives: Sequence[DriveReport] = ()


class Intake:
    """Checks the readings of a plant; an invalid one becomes an alarm of all joints (B3).

    Args:
        count: Of joints.
        period: From one reading to the next, s.
    """

    def __init__(self, count: int, period: float) -> None:
        self._shape, self._period = (ROWS, count), period
        self._shapes = {"applied": (count,), "brakes": (count,), "motors": (MOTOR_ROWS, count)}
        self._time = 0.0

    def _fault_of(self, measurement: Measurement) -> str:
        """Why a reading is invalid; empty where it is not."""
        if not -CREDIBLE <= measurement.time <= CREDIBLE:
            return f"its reading is stamped {measurement.time:g} s"
        for name, shape in self._shapes.items():
            row = getattr(measurement, name)
            if row is not None and np.shape(row) != shape:
                return f"its reading has {name} of shape {np.shape(row)}; {shape} is wanted"
        values = measurement.values
        if type(values) is np.ndarray and values.shape == self._shape and values.dtype is DOUBLE:
            return ""
        shape, kind = np.shape(values), getattr(values, "dtype", type(values).__name__)
        return f"its reading is {kind} of shape {shape}; float64 of {self._shape} is wanted"

    def take(self, measurement: Measurement) -> Measurement:
        """The reading; where it is invalid an alarm of all joints, with the reason."""
        if not (reason := self._fault_of(measurement)):
            self._time = measurement.time
            return measurement
        self._time += self._period
        unread = np.full(self._shape, np.nan)
        unread[Row.ALARM] = 1.0 + FaultCode.PLANT
        return Measurement(self._time, unread, dict.fromkeys(range(self._shape[1]), reason))


@dataclass(slots=True)
class Actuation:
    """The board's request to the plant for the next period; the arrays are reused.

    Attributes:
        pwm: Percent, shape (n,).
        powered: 1.0 where the bridge is on, 0.0 where it is open and no current can flow, (n,).
        kinds: SetPoint that each joint's drive follows, shape (n,); None: PWM everywhere.
        values: Of the set-points of other kinds, shape (VALUES, n), see Value.
        brakes: 1.0 where the brake is to be closed, shape (n,); None: all of them.
    """

    pwm: Array
    powered: Array
    kinds: NDArray[np.int8] | None = None
    values: Array | None = None
    brakes: Array | None = None

    def set_points(self) -> SetPoints:
        """A copy of it, as drives follow it."""
        on = self.powered > 0.0
        values = np.zeros((VALUES, len(on))) if self.values is None else self.values.copy()
        values[Value.PWM] = self.pwm
        kinds = SetPoint.PWM if self.kinds is None else self.kinds
        kinds = np.where(on, kinds, SetPoint.OFF).astype(np.int8)
        released = self.powered.copy() if self.brakes is None else 1.0 - self.brakes
        return SetPoints(kinds, values * HAS[kinds].T, released)


class Plant(Protocol):
    """The controlled system: a simulation, or real motors."""

    def read(self) -> Measurement:
        """The present readings."""
        ...

    def write(self, actuation: Actuation) -> None:
        """Apply the actuation and advance by one control period."""
        ...

    def close(self) -> None:
        """Release the resources of the plant; safe to call twice."""
        ...


#: Why a plant that is not a :class:`Simulation` refuses what only a simulation supports (B4).
NO_SIMULATION = (
    "this board drives a plant that is no simulation: its time and its faults are real; "
    "to simulate, start it without a plant"
)


@runtime_checkable
class Simulation(Plant, Protocol):
    """A plant whose time can be paused and reset, and that can be disturbed (B4)."""

    def push(self, joint: int | str, torque: float) -> None:
        """Push a joint from outside with a torque, N·m, until it is set to 0."""
        ...

    def inject(
        self, joints: int | str | Sequence[int | str], kind: str, persistent: bool = False
    ) -> None:
        """Inject a fault into joints: into all of them, or (ValueError) into none."""
        ...

    def clear_injected(self, joints: Sequence[int | str] | None = None) -> None:
        """Remove the injected faults of some joints, or (None) of all."""
        ...

    def reset(self) -> None:
        """Return to the initial pose; time continues."""
        ...
