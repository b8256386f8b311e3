# SPDX-License-Identifier: Apache-2.0
"""Frames of moteus: those of each cycle are filled in and read without the library's objects."""

from __future__ import annotations

import math
import struct
from typing import Any

from ..interface import DriveFault

REV = 2.0 * math.pi
#: Of the register map that this driver was written for.
REGISTER_MAP = 5
#: Modes of the drive (register 0), and those in which its motor has power.
STOPPED, FAULT, TIMEOUT, POWERED = 0, 1, 11, range(5, 16)
VOLTAGE_DQ, CURRENT, POSITION = 8, 9, 10
MODES = {
    STOPPED: "stopped",
    FAULT: "fault",
    2: "enabling",
    3: "calibrating",
    4: "calibration complete",
    5: "PWM",
    6: "voltage",
    7: "voltage FOC",
    VOLTAGE_DQ: "voltage DQ",
    CURRENT: "current",
    POSITION: "position",
    TIMEOUT: "timeout",
    12: "zero velocity",
    13: "stay within",
    14: "measure inductance",
    15: "brake",
}
#: Turns of the output per turn of the rotor; the encoder at the output, -1: there is none.
ROTOR_RATIO = "motor_position.rotor_to_output_ratio"
OUTPUT_SOURCE = "motor_position.output.reference_source"
#: Part of the supply that its modulation reaches.
MODULATION = 0.5
#: A velocity or acceleration limit with which the drive plans no trajectory of its own.
UNLIMITED = -1.0
#: The library's position command: floats, and the bytes between them; made once, and filled.
POSITIONS = struct.Struct("<6s6f2s3f2sf")
NUMBERS = ("position", "velocity", "feedforward_torque", "kp_scale", "kd_scale", "maximum_torque",
           "watchdog_timeout", "velocity_limit", "accel_limit", "ilimit_scale")  # fmt: skip
#: An answer as it usually comes, and the heads of its three parts; any other is parsed in full.
USUAL = struct.Struct("<2sb3s4f2s3b")
USUAL_HEADS = (b"\x21\x00", b"\x2c\x04\x01", b"\x23\x0d")
#: The next length that CAN FD has, by length.
LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
SIZES = [next(size for size in LENGTHS if size >= n) for n in range(65)]
FAULTS = {
    32: "calibration fault",
    33: "motor driver fault",
    34: "over voltage",
    35: "encoder fault",
    36: "motor not configured",
    37: "PWM cycle overrun",
    38: "over temperature",
    39: "outside limit",
    40: "under voltage",
    41: "configuration changed",
    42: "theta invalid",
    43: "position invalid",
    44: "driver enable fault",
    45: "stop position deprecated",
    46: "timing violation",
    47: "BEMF feedforward without acceleration limit",
    48: "invalid limits",
    49: "position control error",
    50: "velocity control error",
}
WATCHDOG = DriveFault(TIMEOUT, "watchdog: no command within its timeout")


def template(drive: Any) -> tuple[bytes, bytes, bytes, bytes]:
    """The bytes between the numbers of the library's position command, and its query."""
    data = drive.make_position(**dict.fromkeys(NUMBERS, 0.5), query=True).data
    parts = POSITIONS.unpack_from(data)
    return parts[0], parts[7], parts[11], data[POSITIONS.size :]


def padded(data: bytes) -> bytes:
    """Data of a length that CAN FD has, with NOPs."""
    return data.ljust(SIZES[len(data)], b"\x50")


def spoken(data: bytes) -> bytes | None:
    """What an answer has of the diagnostic stream of a drive; None: it is none of that."""
    if len(data) < 3 or data[:2] != b"\x41\x01":
        return None
    return data[3 : 3 + data[2]]


def voltage(drive: Any, volts: float) -> bytes:
    """A command of voltage mode, which the library has no method for."""
    import io

    from moteus import multiplex as mp
    from moteus.protocol import Register, Writer

    buffer = io.BytesIO()
    writer = Writer(buffer)
    for value in (mp.WRITE_INT8 | 1, int(Register.MODE), VOLTAGE_DQ, mp.WRITE_F32 | 2):
        writer.write_int8(value)
    writer.write_varuint(int(Register.VOLTAGEDQ_D))
    writer.write_f32(0.0)
    writer.write_f32(volts)
    return buffer.getvalue() + bytes(drive.make_query().data)


def reading(data: bytes) -> tuple[int, float, float, float, float, float, int]:
    """Mode, position (rev), velocity (rev/s), torque, current, voltage and fault of an answer."""
    if len(data) >= USUAL.size:
        head, mode, floats, q, dq, torque, amps, last, volts, _, fault = USUAL.unpack_from(data)
        if (head, floats, last) == USUAL_HEADS and volts != -128:
            return mode, q, dq, torque, amps, 0.5 * volts, fault
    from moteus.protocol import parse_reply

    registers = parse_reply(data)
    q, dq, torque, amps, volts = (float(registers[r]) for r in (1, 2, 3, 4, 0x0D))
    return int(registers[0x000]), q, dq, torque, amps, volts, int(registers[0x00F])
