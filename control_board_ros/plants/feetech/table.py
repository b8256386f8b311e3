# SPDX-License-Identifier: Apache-2.0
"""The memory table of the STS and SMS series as published: addresses, lengths, units, models."""

from __future__ import annotations

import math

from ..drives.serial_line import Item, Library

FIRMWARE, MODEL, ID = Item(0, 2), Item(3, 2), Item(5, 1)
MIN_POSITION, MAX_POSITION, CURRENT_LIMIT = Item(9, 2), Item(11, 2), Item(28, 2)
PHASE, P, ANGULAR_RESOLUTION, HOMING = Item(18, 1), Item(21, 1), Item(30, 1), Item(31, 2)
MODE, TORQUE, ACCELERATION, LOCK, SPEED_LIMIT = (
    Item(33, 1), Item(40, 1), Item(41, 1), Item(55, 1), Item(84, 1),
)  # fmt: skip
TORQUE_LIMIT = Item(48, 2)
#: Goal position, goal time (PWM in that mode), goal velocity.
GOALS = Item(42, 6)
POSITION, VELOCITY, VOLTAGE = Item(56, 2), Item(58, 2), Item(62, 1)
TEMPERATURE, STATUS, CURRENT = Item(63, 1), Item(65, 1), Item(69, 2)
#: By which positions are not those of one turn of 4096 counts: item, mask, right value, name.
READINGS = ((PHASE, 0x10, 0, "Phase"), (ANGULAR_RESOLUTION, 0xFF, 1, "Angular_Resolution"))
#: What is read in each exchange: mode, torque switch, goals, readings.
READ = Item(MODE.address, CURRENT.address + 2 - MODE.address)

POSITION_MODE, VELOCITY_MODE, PWM_MODE = 0, 1, 2
MODES = {POSITION_MODE: "position", VELOCITY_MODE: "velocity", PWM_MODE: "PWM", 3: "step"}
#: Bits of the sign; the numbers are magnitudes.
SIGN, PWM_SIGN, HOMING_SIGN = 15, 10, 11
LIBRARY = Library(
    "scservo_sdk",
    "feetech-servo-sdk",
    "feetech",
    0,
    (),
    5,
    1,
    2,
    0,
    MODEL,
    TORQUE,
    tuple(Item(3, length) for length in (3, 5, 7, 9)),
)
COUNT = 2.0 * math.pi / 4096.0  # rad; velocities are in counts/s
CENTRE, LAST = 2048, 4095
SPEED_LIMIT_STEP = 50.0  # counts/s
AMPERE, VOLT = 6.5e-3, 0.1
FULL_PWM = 1000
#: Duty per rad of error and unit of P, and its bound, by oscilloscope: Rhoban's BAM 1b5a1ce,
#: feetech/actuator.py, with D = 0 (feetech/record.py).
GAIN, MOST_DUTY = 0.166, 0.97
MODELS = {777: "STS3215", 2825: "STS3250", 11272: "SM8512BL"}
ERRORS = {
    1: "input voltage",
    2: "angle sensor",
    4: "overheating",
    8: "over-current",
    32: "overload",
}


def signed(number: int, sign: int = SIGN) -> int:
    """The value of a magnitude with a bit for its sign."""
    return -(number & ~(1 << sign)) if number >> sign & 1 else number


def magnitude(value: float, sign: int = SIGN) -> int:
    """A value as a magnitude with a bit for its sign, at its end where it is beyond."""
    number = min((1 << sign) - 1, round(abs(value)))
    return number | (1 << sign if value < 0.0 and number else 0)
