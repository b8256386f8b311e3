# SPDX-License-Identifier: Apache-2.0
"""Frames of a virtual moteus: what a controller reads in one, and how it writes its answer.

The maker's library reads frames and writes numbers. Repeated questions and numbers of few values
are cached. The floats of its usual command are at fixed places.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping
from functools import lru_cache
from itertools import groupby
from types import SimpleNamespace
from typing import NamedTuple

from moteus import multiplex as mp
from moteus.protocol import Register, Writer, scale_register

from .frames import POSITIONS

#: Registers by name, as plain numbers: they are looked up in every step.
R = SimpleNamespace(**{name: int(register) for name, register in Register.__members__.items()})
POSITION, VELOCITY = (0.01, 1e-4, 1e-5), (0.1, 2.5e-4, 1e-5)
#: What each int8, int16 and int32 means, by register.
SCALES = {
    R.POSITION: POSITION,
    R.CONTROL_POSITION: POSITION,
    R.VELOCITY: VELOCITY,
    R.CONTROL_VELOCITY: VELOCITY,
    R.TORQUE: (0.5, 0.01, 1e-3),
    R.Q_CURRENT: (1.0, 0.1, 1e-3),
    R.D_CURRENT: (1.0, 0.1, 1e-3),
    R.VOLTAGE: (0.5, 0.1, 1e-3),
    R.TEMPERATURE: (1.0, 0.1, 1e-3),
    R.MOTOR_TEMPERATURE: (1.0, 0.1, 1e-3),
}
#: The bytes before each row of floats of the usual command, which is that of mode 10.
HEADS = (b"\x01\x00\x0a\x0c\x06\x20", b"\x0f\x27", b"\x0d\x2b")
COMMANDED = (
    R.COMMAND_POSITION,
    R.COMMAND_VELOCITY,
    R.COMMAND_FEEDFORWARD_TORQUE,
    R.COMMAND_KP_SCALE,
    R.COMMAND_KD_SCALE,
    R.COMMAND_POSITION_MAX_TORQUE,
)
F32, FLOAT = int(mp.F32), struct.Struct("<f")


class Read(NamedTuple):
    """A frame: values that it writes, by register; registers that it requests, with their
    resolutions; its diagnostic stream, and bytes of it that it requests, by channel.
    """

    writes: Mapping[int, float]
    reads: tuple[tuple[int, int], ...]
    said: tuple[bytes, ...] = ()
    wanted: tuple[tuple[int, int], ...] = ()


def read(data: bytes) -> Read:
    """Read a frame.

    Raises:
        Exception: the frame is not of the protocol.
    """
    if len(data) > POSITIONS.size:
        first, q, dq, torque, kp, kd, most, second, timeout, speed, rate, third, integral = (
            POSITIONS.unpack_from(data)
        )
        if (first, second, third) == HEADS:
            rest = question(data[POSITIONS.size :])
            if not (rest.writes or rest.said or rest.wanted):
                writes = dict(zip(COMMANDED, (q, dq, torque, kp, kd, most), strict=True))
                writes[R.MODE] = 10
                writes[R.COMMAND_VELOCITY_LIMIT], writes[R.COMMAND_ACCEL_LIMIT] = speed, rate
                writes[R.COMMAND_TIMEOUT], writes[R.COMMAND_ILIMIT_SCALE] = timeout, integral
                return Read(writes, rest.reads)
    return parse(data)


def parse(data: bytes) -> Read:
    """Read a frame as the library does, whatever is in it."""
    writes: dict[int, float] = {}
    reads, said, wanted = [], [], []
    for part in mp.parse_frame(data):
        kind = part.type
        if kind is mp.SubframeType.WRITE:
            writes[part.register] = scale_register(part.register, part.resolution, part.value)
        elif kind is mp.SubframeType.READ:
            reads.append((part.register, part.resolution))
        elif kind is mp.SubframeType.STREAM_CLIENT_TO_SERVER:
            said.append(part.data)
        elif kind is mp.SubframeType.STREAM_CLIENT_POLL_SERVER:
            wanted.append((part.channel, part.data[0]))
    return Read(writes, tuple(reads), tuple(said), tuple(wanted))


question = lru_cache(64)(parse)


def answer(reads: tuple[tuple[int, int], ...], registers: Mapping[int, float]) -> bytes:
    """Replies to a query; a register that is not there is 0."""
    parts = []
    for head, numbers, resolution in runs(reads):
        parts.append(head)
        for number in numbers:
            parts.append(mapped(number, resolution, float(registers.get(number, 0.0))))
    return b"".join(parts)


@lru_cache(64)
def runs(reads: tuple[tuple[int, int], ...]) -> list[tuple[bytes, list[int], int]]:
    """Registers of one resolution that follow each other, with the head of their subframe."""
    answers = []
    ordered = groupby(enumerate(reads), lambda each: (each[1][0] - each[0], each[1][1]))
    for (_, resolution), run in ordered:
        numbers = [register for _, (register, _) in run]
        count = len(numbers)
        writer = Writer(buffer := io.BytesIO())
        writer.write_int8(0x20 | resolution << 2 | (count if count < 4 else 0))
        if count >= 4:
            writer.write_varuint(count)
        writer.write_varuint(numbers[0])
        answers.append((buffer.getvalue(), numbers, resolution))
    return answers


def mapped(number: int, resolution: int, value: float) -> bytes:
    """A register's value as it is in a reply."""
    return FLOAT.pack(value) if resolution == F32 else whole(number, resolution, value)


@lru_cache(256)
def whole(number: int, resolution: int, value: float) -> bytes:
    """The same, of an integer."""
    Writer(buffer := io.BytesIO()).write_mapped(value, *SCALES.get(number, (1, 1, 1)), resolution)
    return buffer.getvalue()
