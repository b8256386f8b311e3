# SPDX-License-Identifier: Apache-2.0
"""The limits of joints, as a board reports them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class JointLimits:
    """The limits of a joint, by the names of its parameters ``<joint>.limits.*``.

    Attributes: lower, upper (software limits), hard_lower, hard_upper (stops), in rad; velocity
    (rad/s), acceleration (rad/s²), torque (N·m), output (PWM percent), peak_current (A); m and N
    of a sliding joint. Infinite: unknown.
    """

    lower: float = -math.inf
    upper: float = math.inf
    hard_lower: float = -math.inf
    hard_upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    torque: float = math.inf
    output: float = math.inf
    peak_current: float = math.inf

    def range(self, kind: str) -> tuple[float, float]:
        """The minimum and maximum of a kind: ``position``, ``speed``, …"""
        if kind == "position":
            return self.lower, self.upper
        names = {"speed": "velocity", "current": "peak_current"}
        most: float = getattr(self, names.get(kind, kind))
        return -most, most


FIELDS = tuple(field.name for field in fields(JointLimits))


def limit_parameters(joints: Iterable[str]) -> list[str]:
    return [f"{joint}.limits.{field}" for joint in joints for field in FIELDS]


def limits_of(joints: Sequence[str], values: Iterable[object]) -> dict[str, JointLimits | None]:
    """The limits by joint; None where one of them is not a number.

    Args:
        joints: names.
        values: of the parameters that ``limit_parameters`` names for them, in its order.
    """
    numbers = [
        float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
        for value in values
    ]
    found: dict[str, JointLimits | None] = dict.fromkeys(joints)
    for k, joint in enumerate(joints):
        known = [x for x in numbers[len(FIELDS) * k : len(FIELDS) * (k + 1)] if x is not None]
        if len(known) == len(FIELDS):
            found[joint] = JointLimits(*known)
    return found
