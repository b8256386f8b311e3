# SPDX-License-Identifier: Apache-2.0
"""How a moteus approaches a commanded position: within limits of velocity and acceleration.

Written from the maker's docs/reference/registers.md, 0x028 and 0x029: a limit that is not given
is that of the configuration, a negative one is none; a fresh drive has an acceleration limit of
50 rev/s² (fw/bldc_servo_structs.h, ``default_accel_limit``). Positions are in revolutions.
"""

from __future__ import annotations

import math


def limit(commanded: float, configured: float) -> float:
    """A limit in force; infinity: none."""
    value = configured if math.isnan(commanded) else commanded
    return math.inf if math.isnan(value) or value < 0.0 else value


class Planner:
    """The way to a target that moves.

    Attributes:
        position, velocity: Where the way is, rev and rev/s; NaN: it has not begun.
        target: Where it leads, rev; NaN: its velocity alone counts.
        complete: It is there.
    """

    def __init__(self) -> None:
        self.position = self.target = math.nan
        self.velocity, self.complete = 0.0, False

    def start(self, position: float, velocity: float) -> None:
        """Begin where the motor is."""
        self.position, self.velocity, self.target = position, velocity, math.nan
        self.complete = False

    def step(self, seconds: float, rate: float, most: float, accel: float) -> None:
        """Move on.

        Args:
            seconds: Of the step.
            rate: Velocity of the target, rev/s.
            most: Limit of the velocity, rev/s; infinity: none.
            accel: That of the acceleration, rev/s².
        """
        aims = not math.isnan(self.target)
        if aims:
            self.target += rate * seconds
        if most == accel == math.inf:
            self.position = self.target if aims else self.position + rate * seconds
            self.velocity, self.complete = rate, True
            return
        ahead = self.target - self.position if aims else 0.0
        wanted = rate
        if aims:
            braking = math.sqrt(2.0 * accel * abs(ahead)) if accel < math.inf else math.inf
            wanted += math.copysign(min(braking, abs(ahead) / seconds), ahead)
        wanted = max(-most, min(most, wanted))
        change = accel * seconds
        self.velocity += max(-change, min(change, wanted - self.velocity))
        self.position += self.velocity * seconds
        near, slow = 1e-6, 1e-6
        if accel < math.inf:
            near, slow = near + 2.0 * change * seconds, slow + 2.0 * change
        self.complete = abs(self.velocity - rate) <= slow and (
            not aims or abs(self.target - self.position) <= near
        )
        if self.complete and aims:
            self.position, self.velocity = self.target, rate
