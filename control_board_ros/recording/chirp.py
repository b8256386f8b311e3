# SPDX-License-Identifier: Apache-2.0
"""A frequency sweep as trajectory points within a joint's limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from control_board_ros.core.goals.path import MAX_POINTS, minimum_jerk
from control_board_ros.protocols import Floats

from .figures import LEAST_LINES

#: Share of the joint's limits of speed and acceleration used by a sweep.
SHARE = 0.4
#: Points per period, and minimum per second.
PER_PERIOD, PER_SECOND = 16, 20
#: Share of the time for the rise from and the fall to zero amplitude.
FADE = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Times (s), offsets from the present position (rad), velocities (rad/s), shape (m,) each."""

    times: Floats
    offsets: Floats
    velocities: Floats


def sweep(
    low: float, high: float, seconds: float, amplitude: float, speed: float, acceleration: float
) -> Sweep:
    """An exponential sweep, x = a(f) sin φ with dφ/dt = 2π f and f = low (high/low)^(t/T).

    The amplitude falls with the frequency, so that 2π f a ≤ SHARE · speed and
    (2π f)² a ≤ SHARE · acceleration.

    Args:
        low: First frequency, Hz.
        high: Last frequency, Hz.
        seconds: T.
        amplitude: Maximum amplitude, rad.
        speed: The joint's limit, rad/s.
        acceleration: The joint's limit, rad/s².

    Raises:
        ValueError: more points than permitted, or too short; one line.
    """
    rate = math.log(high / low) / seconds
    times = times_of(low, rate, seconds)
    if times.size > MAX_POINTS:
        raise ValueError(
            f"a sweep to {high:g} Hz in {seconds:g} s needs more than a trajectory's {MAX_POINTS} "
            "points; make it shorter, or end at a lower frequency"
        )
    if (high - low) * seconds < LEAST_LINES:
        raise ValueError(
            f"a sweep from {low:g} to {high:g} Hz in {seconds:g} s shows no response; "
            f"give it {LEAST_LINES / (high - low):.3g} s or more"
        )

    def offset(t: Floats) -> Floats:
        omega = 2.0 * math.pi * low * np.exp(rate * t)
        phase = (omega - 2.0 * math.pi * low) / rate
        reach = np.minimum(SHARE * speed / omega, SHARE * acceleration / omega**2)
        fade = minimum_jerk(np.minimum(t, seconds - t) / (FADE * seconds))
        return np.asarray(np.minimum(amplitude, reach) * fade * np.sin(phase))

    small = 1e-5
    velocities = (offset(times + small) - offset(times - small)) / (2.0 * small)
    velocities[[0, -1]] = 0.0
    return Sweep(times, offset(times), velocities)


def times_of(low: float, rate: float, seconds: float) -> Floats:
    """Times with a constant number of points per period; no more than are refused."""
    times, t, step = list[float](), 0.0, 0.0
    while t < seconds - 0.5 * step and len(times) <= MAX_POINTS:
        times.append(t)
        step = min(1.0 / (PER_PERIOD * low * math.exp(rate * t)), 1.0 / PER_SECOND)
        t += step
    return np.array([*times, seconds])
