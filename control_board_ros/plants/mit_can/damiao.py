# SPDX-License-Identifier: Apache-2.0
"""Damiao motors: registers, states and faults as published."""

from __future__ import annotations

import struct
from typing import Any

from ..drives.can_line import CanLine

#: Where registers are read and written: frame, orders.
REGISTERS, GET, SET, REFRESH = 0x7FF, 0x33, 0x55, 0xCC
MASTER_ID, DRIVE_ID, TIMEOUT, CONTROL_MODE, SOFTWARE = 7, 8, 9, 10, 14
RANGES = POSITION_RANGE, VELOCITY_RANGE, TORQUE_RANGE = 21, 22, 23
#: Registers that hold whole numbers; the others are floats.
WHOLE = {MASTER_ID, DRIVE_ID, TIMEOUT, CONTROL_MODE, SOFTWARE}
LAST_REGISTER = 81
#: s per count of TIMEOUT; the control mode of MIT frames.
TIMEOUT_STEP, MIT_MODE = 50e-6, 1
DISABLED, ENABLED = 0, 1
FAULTS = {
    0x8: "over-voltage",
    0x9: "under-voltage",
    0xA: "over-current",
    0xB: "bridge over-temperature",
    0xC: "winding over-temperature",
    0xD: "watchdog: communication lost",
    0xE: "overload",
}


def masters(line: CanLine, drive: int, attempts: int = 1) -> list[int]:
    """The id that motors with this id answer to: none, one, or several."""
    found = line.answers(
        REGISTERS, _question(drive, MASTER_ID), lambda m: _pick(m, drive, MASTER_ID), attempts
    )
    return [int.from_bytes(data, "little") for data in found]


def refresh(drive: int) -> bytes:
    """A question for the motion of a motor, which commands nothing."""
    return bytes([drive, 0, REFRESH, 0, 0, 0, 0, 0])


def get(line: CanLine, drive: int, number: int) -> float:
    """A register of a motor.

    Raises:
        ConnectionError: it does not answer.
    """
    data = _ask(line, drive, _question(drive, number), number)
    return float(struct.unpack("<I" if number in WHOLE else "<f", data)[0])


def put(line: CanLine, drive: int, number: int, value: int) -> None:
    """Write a register of whole numbers, until it is lost with the power.

    Raises:
        ConnectionError: it does not answer.
    """
    _ask(line, drive, struct.pack("<BBBBI", drive, 0, SET, number, value), number)


def is_register(data: bytes, drive: int) -> bool:
    """Whether a frame of a motor is the answer to a question for a register.

    It has the motor's id without a state, 0, the order, and the number of the register; at this
    place a motion has a position of the range's lower end and a velocity beyond a third of its
    range, of a motor without power.
    """
    return data[:2] == bytes([drive, 0]) and data[2] in (GET, SET) and data[3] <= LAST_REGISTER


def _question(drive: int, number: int) -> bytes:
    return bytes([drive, 0, GET, number, 0, 0, 0, 0])


def _ask(line: CanLine, drive: int, data: bytes, number: int) -> bytes:
    found = line.ask(REGISTERS, data, lambda m: _pick(m, drive, number))
    if found is None:
        raise ConnectionError(f"id {drive} does not answer for register {number}")
    return found


def _pick(message: Any, drive: int, number: int) -> bytes | None:
    data = bytes(message.data)
    if len(data) == 8 and is_register(data, drive):
        return data[4:] if data[3] == number and message.arbitration_id < REGISTERS else None
    return None
