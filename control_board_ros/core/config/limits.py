# SPDX-License-Identifier: Apache-2.0
"""The limits of all joints of a board as arrays: made once from the configuration, read-only."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..terms.measurement import Array
from .config import BoardConfig


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardLimits:
    """The limits of n joints, arrays of shape (n,) that cannot be written to.

    Attributes: lower and upper (software limits of the position, rad), velocity (rad/s),
    acceleration (rad/s²), torque (N·m), output (PWM, percent), current (peak, A),
    stiffness (the greatest permitted in set_impedance, N·m/rad), damping (likewise, N·m·s/rad).
    Metres and N where a joint slides.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array
    output: Array
    current: Array
    stiffness: Array
    damping: Array

    @classmethod
    def of(cls, config: BoardConfig) -> BoardLimits:
        """The limits of a configuration."""
        limits = [joint.limits for joint in config.joints]
        impedances = [joint.impedance for joint in config.joints]
        return cls(
            lower=frozen(one.lower for one in limits),
            upper=frozen(one.upper for one in limits),
            velocity=frozen(one.velocity for one in limits),
            acceleration=frozen(one.acceleration for one in limits),
            torque=frozen(one.torque for one in limits),
            output=frozen(one.output for one in limits),
            current=frozen(one.peak_current for one in limits),
            stiffness=frozen(one.max_stiffness for one in impedances),
            damping=frozen(one.max_damping for one in impedances),
        )


def frozen(values: Iterable[float]) -> Array:
    """The values as an array that cannot be written to."""
    array = np.array(list(values), dtype=np.float64)
    array.flags.writeable = False
    return array
