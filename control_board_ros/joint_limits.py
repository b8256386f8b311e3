# SPDX-License-Identifier: Apache-2.0
"""The limits of joints, as a board reports them."""

from __future__ import annotations

import math
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
        limit: float = getattr(self, names.get(kind, kind))
        return -limit, limit


FIELDS = tuple(field.name for field in fields(JointLimits))
