# SPDX-License-Identifier: Apache-2.0
"""Eight bytes of position, velocity, stiffness, damping and torque, as published for MIT mode.

Command    q 16 bit · q̇ 12 · k 12 · d 12 · τ 12
Answer     id and state · q 16 · q̇ 12 · τ 12 · temperature of bridge and winding, °C

What the makes add is in ``damiao`` and ``robstride``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ...core.terms.drives import SetPoint
from ...core.terms.measurement import Value

DAMIAO = "damiao"
ENABLE, DISABLE, CLEAR, ZERO = (b"\xff" * 7 + bytes([last]) for last in (0xFC, 0xFD, 0xFB, 0xFE))


class Ranges(NamedTuple):
    """What the ends of the numbers mean: ± rad, ± rad/s, ± N·m, N·m/rad, N·m·s/rad."""

    position: float
    velocity: float
    torque: float
    stiffest: float = 500.0
    most_damped: float = 5.0


def packed(ranges: Ranges, q: float, dq: float, k: float, d: float, torque: float) -> bytes:
    """A command; what is beyond a range is cut.

    A number of 12 bits has no zero: what q and q̇ lose in their steps, the torque makes up,
    τ + k (q - q sent) + d (q̇ - q̇ sent).
    """
    place = _number(q, -ranges.position, ranges.position, 16)
    rate = _number(dq, -ranges.velocity, ranges.velocity, 12)
    spring, damper = _number(k, 0.0, ranges.stiffest, 12), _number(d, 0.0, ranges.most_damped, 12)
    if spring or damper:
        off = q - _value(place, -ranges.position, ranges.position, 16)
        if abs(off) * 65535.0 < 2.0 * ranges.position:  # not cut
            torque += _value(spring, 0.0, ranges.stiffest, 12) * off
        off = dq - _value(rate, -ranges.velocity, ranges.velocity, 12)
        if abs(off) * 4095.0 < 2.0 * ranges.velocity:
            torque += _value(damper, 0.0, ranges.most_damped, 12) * off
    force = _number(torque, -ranges.torque, ranges.torque, 12)
    bits = place << 48 | rate << 36 | spring << 24 | damper << 12 | force
    return bits.to_bytes(8, "big")


def values(kind: SetPoint, value: Sequence[float]) -> tuple[float, float, float, float, float]:
    """q, q̇, k, d, τ of a set-point; a torque is an impedance with k = d = 0."""
    springs = kind is SetPoint.IMPEDANCE
    return (
        value[Value.POSITION],
        value[Value.VELOCITY],
        value[Value.STIFFNESS] if springs else 0.0,
        value[Value.DAMPING] if springs else 0.0,
        value[Value.TORQUE],
    )


def command(ranges: Ranges, kind: SetPoint, value: Sequence[float]) -> bytes:
    """The command of a set-point."""
    return packed(ranges, *values(kind, value))


def commanded(ranges: Ranges, data: bytes) -> tuple[float, float, float, float, float]:
    """The values of a command: q, q̇, k, d, τ."""
    bits = int.from_bytes(data, "big")
    return (
        _value(bits >> 48, -ranges.position, ranges.position, 16),
        _value(bits >> 36, -ranges.velocity, ranges.velocity, 12),
        _value(bits >> 24, 0.0, ranges.stiffest, 12),
        _value(bits >> 12, 0.0, ranges.most_damped, 12),
        _value(bits, -ranges.torque, ranges.torque, 12),
    )


def answer(ranges: Ranges, head: int, q: float, dq: float, torque: float, heat: bytes) -> bytes:
    """What a drive answers: id and state first, temperatures last."""
    bits = _number(q, -ranges.position, ranges.position, 16) << 24
    bits |= _number(dq, -ranges.velocity, ranges.velocity, 12) << 12
    bits |= _number(torque, -ranges.torque, ranges.torque, 12)
    return bytes([head]) + bits.to_bytes(5, "big") + heat


def readings(ranges: Ranges, data: bytes) -> tuple[float, float, float]:
    """The values of an answer: q, q̇, τ."""
    bits = int.from_bytes(data[1:6], "big")
    return (
        _value(bits >> 24, -ranges.position, ranges.position, 16),
        _value(bits >> 12, -ranges.velocity, ranges.velocity, 12),
        _value(bits, -ranges.torque, ranges.torque, 12),
    )


def _number(value: float, low: float, high: float, bits: int) -> int:
    share = (min(high, max(low, value)) - low) / (high - low)
    return round(share * ((1 << bits) - 1))


def _value(number: int, low: float, high: float, bits: int) -> float:
    most = (1 << bits) - 1
    return low + (number & most) * (high - low) / most
