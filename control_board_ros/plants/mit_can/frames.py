# SPDX-License-Identifier: Apache-2.0
"""Eight bytes of position, velocity, stiffness, damping and torque, as published for MIT mode.

Command    q 16 bit · q̇ 12 · k 12 · d 12 · τ 12
Answer     id and state · q 16 · q̇ 12 · τ 12 · temperature of bridge and winding, °C

What the makes add is in ``damiao`` and ``robstride``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ...core.terms.drives import SetPoint
from ..drives.axes import Axis

DAMIAO, IMPEDANCE = "damiao", SetPoint.IMPEDANCE
#: Protocols of a RobStride motor: as it is delivered, and that which its maker's tool can set.
PRIVATE, MIT = "private", "mit"
ENABLE, DISABLE, CLEAR, ZERO = (b"\xff" * 7 + bytes([last]) for last in (0xFC, 0xFD, 0xFB, 0xFE))


@dataclass(frozen=True, kw_only=True)
class MitAxis(Axis):
    """A joint; its motor's model, and of a RobStride scales ("": of its model) and protocol."""

    model: str = DAMIAO
    scales: str = ""
    protocol: str = PRIVATE


class Ranges(NamedTuple):
    """What the ends of the numbers mean: ± rad, ± rad/s, ± N·m, N·m/rad, N·m·s/rad."""

    position: float
    velocity: float
    torque: float
    stiffest: float = 500.0
    most_damped: float = 5.0


def counts(
    ranges: Ranges, q: float, dq: float, k: float, d: float, torque: float, bits: int = 12
) -> tuple[int, int, int, int, int]:
    """The numbers of a command: q of 16 bits, the others of ``bits``; what is beyond is cut.

    They have no zero: what q and q̇ lose in their steps, the torque makes up,
    τ + k (q - q sent) + d (q̇ - q̇ sent).
    """
    place = count(q, -ranges.position, ranges.position, 16)
    rate = count(dq, -ranges.velocity, ranges.velocity, bits)
    spring, damper = count(k, 0.0, ranges.stiffest, bits), count(d, 0.0, ranges.most_damped, bits)
    if spring or damper:
        if abs(q) <= ranges.position:  # else it is cut
            off = q - value_of(place, -ranges.position, ranges.position, 16)
            torque += value_of(spring, 0.0, ranges.stiffest, bits) * off
        if abs(dq) <= ranges.velocity:
            off = dq - value_of(rate, -ranges.velocity, ranges.velocity, bits)
            torque += value_of(damper, 0.0, ranges.most_damped, bits) * off
    return place, rate, spring, damper, count(torque, -ranges.torque, ranges.torque, bits)


def packed(ranges: Ranges, q: float, dq: float, k: float, d: float, torque: float) -> bytes:
    """A command in eight bytes; see ``counts``."""
    place, rate, spring, damper, force = counts(ranges, q, dq, k, d, torque)
    data = place << 48 | rate << 36 | spring << 24 | damper << 12 | force
    return data.to_bytes(8, "big")


def values(kind: SetPoint, value: Sequence[float]) -> tuple[float, float, float, float, float]:
    """q, q̇, k, d, τ of a set-point; a torque is an impedance with k = d = 0."""
    _, _, torque, velocity, position, stiffness, damping = value
    if kind is not IMPEDANCE:
        stiffness = damping = 0.0
    return position, velocity, stiffness, damping, torque


def command(ranges: Ranges, kind: SetPoint, value: Sequence[float]) -> bytes:
    """The command of a set-point."""
    return packed(ranges, *values(kind, value))


def commanded(ranges: Ranges, data: bytes) -> tuple[float, float, float, float, float]:
    """The values of a command: q, q̇, k, d, τ."""
    word = int.from_bytes(data, "big")
    return counted(ranges, (word >> 48, word >> 36, word >> 24, word >> 12, word))


def counted(
    ranges: Ranges, numbers: Sequence[int], bits: int = 12
) -> tuple[float, float, float, float, float]:
    """The values of the numbers of a command; see ``counts``."""
    place, rate, spring, damper, force = numbers
    return (
        value_of(place, -ranges.position, ranges.position, 16),
        value_of(rate, -ranges.velocity, ranges.velocity, bits),
        value_of(spring, 0.0, ranges.stiffest, bits),
        value_of(damper, 0.0, ranges.most_damped, bits),
        value_of(force, -ranges.torque, ranges.torque, bits),
    )


def answer(ranges: Ranges, head: int, q: float, dq: float, torque: float, heat: bytes) -> bytes:
    """What a drive answers: id and state first, temperatures last."""
    word = count(q, -ranges.position, ranges.position, 16) << 24
    word |= count(dq, -ranges.velocity, ranges.velocity, 12) << 12
    word |= count(torque, -ranges.torque, ranges.torque, 12)
    return bytes([head]) + word.to_bytes(5, "big") + heat


def readings(ranges: Ranges, data: bytes) -> tuple[float, float, float]:
    """The values of an answer: q, q̇, τ."""
    word = int.from_bytes(data[1:6], "big")
    return moved(ranges, word >> 24, word >> 12, word)


def moved(
    ranges: Ranges, place: int, rate: int, force: int, bits: int = 12
) -> tuple[float, float, float]:
    """The values of the numbers of an answer: q of 16 bits, q̇ and τ of ``bits``."""
    return (
        value_of(place, -ranges.position, ranges.position, 16),
        value_of(rate, -ranges.velocity, ranges.velocity, bits),
        value_of(force, -ranges.torque, ranges.torque, bits),
    )


def count(value: float, low: float, high: float, bits: int) -> int:
    """The number of a value in a range; one beyond it is cut."""
    share = (min(high, max(low, value)) - low) / (high - low)
    return round(share * ((1 << bits) - 1))


def value_of(number: int, low: float, high: float, bits: int) -> float:
    """The value of the lowest bits of a number."""
    most = (1 << bits) - 1
    return low + (number & most) * (high - low) / most


def given(ranges: Ranges, command: Sequence[float], position: float, velocity: float) -> float:
    """Torque of a motor that follows a command, N·m: τ + k (q - position) + d (q̇ - velocity)."""
    q, dq, k, damping, torque = command
    effort = torque + k * (q - position) + damping * (dq - velocity)
    return max(-ranges.torque, min(ranges.torque, effort))
