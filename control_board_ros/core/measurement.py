# SPDX-License-Identifier: Apache-2.0
"""What crosses between the board and its plant, as whole arrays.

The plant fills one block of shape (ROWS, n) per control cycle; the board answers with the
PWM of each motor and whether its bridge is on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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


@dataclass(slots=True)
class Measurement:
    """One reading of the whole plant: time (s) and values, shape (ROWS, n), see Row.

    The plant may reuse the array from one reading to the next. ``reasons`` says in words why a
    joint (by its number) has an ALARM, where the plant knows more than the fault code.
    """

    time: float
    values: Array
    reasons: Mapping[int, str] | None = None


@dataclass(slots=True)
class Actuation:
    """What the board asks of the plant for the next period.

    Attributes: pwm (percent, shape (n,)) and powered (1.0 where the bridge is on, 0.0 where it
    is open and no current can flow, shape (n,)). The board reuses the arrays.
    """

    pwm: Array
    powered: Array


class Plant(Protocol):
    """Whatever the board drives: a simulation here, real motors elsewhere."""

    def read(self) -> Measurement:
        """The readings of now."""
        ...

    def write(self, actuation: Actuation) -> None:
        """Apply the actuation and let one control period pass."""
        ...

    def close(self) -> None:
        """Let go of what the plant holds; safe to call twice."""
        ...
