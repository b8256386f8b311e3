# SPDX-License-Identifier: Apache-2.0
"""Set-points of a drive (SPEC S1).

A drive accepts set-points of some kinds, and closes the loops behind them::

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

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from .drives import SetPoint

Array = NDArray[np.float64]


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

#: Which values each kind has, shape (kinds, VALUES); the others are 0.
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
    """What each joint of a plant follows from this exchange on; the arrays cannot be written.

    Law and set-point come in one exchange (S3). The kind OFF disables the motor, any other kind
    gives it. Values that a kind does not have are 0.

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
            array.flags.writeable = False

    @classmethod
    def off(cls, count: int) -> SetPoints:
        """No joint has power."""
        return cls(np.zeros(count, dtype=np.int8), np.zeros((VALUES, count)), np.zeros(count))

    @property
    def powered(self) -> NDArray[np.bool_]:
        """Which joints have power."""
        powered: NDArray[np.bool_] = self.kinds != SetPoint.OFF
        return powered

    @property
    def pwm(self) -> Array:
        return self._row(Value.PWM)

    @property
    def current(self) -> Array:
        return self._row(Value.CURRENT)

    @property
    def torque(self) -> Array:
        """τ, or the τ_ff beside a position, a velocity or an impedance."""
        return self._row(Value.TORQUE)

    @property
    def velocity(self) -> Array:
        return self._row(Value.VELOCITY)

    @property
    def position(self) -> Array:
        return self._row(Value.POSITION)

    @property
    def stiffness(self) -> Array:
        return self._row(Value.STIFFNESS)

    @property
    def damping(self) -> Array:
        return self._row(Value.DAMPING)

    def _row(self, value: Value) -> Array:
        row: Array = self.values[value]
        return row
