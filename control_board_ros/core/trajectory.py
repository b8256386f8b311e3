# SPDX-License-Identifier: Apache-2.0
"""Minimum-jerk moves and velocity ramps for all joints at once (SPEC P1, P5, P6).

A move is the quintic that leaves a position with a velocity (and no acceleration) and ends at
rest after a duration T. From rest it is q(s) = q0 + Δ(10s³ − 15s⁴ + 6s⁵), s = t/T. A velocity
that leads away from the target is no part of it: it is braked to zero by a second polynomial,
v0(1 − 3u² + 2u³), u = t/T_b, and the quintic makes up for the way that this takes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .measurement import Array

#: Indices of joints, shape (k,), or a slice of k.
Joints = NDArray[np.intp] | slice

#: The longest move, s: keeps a denormal speed from making an infinite duration.
LONGEST = 1e6

#: Peak over mean speed of a minimum-jerk move from rest to rest.
PEAK = 1.875

#: A move that starts with velocity v0 towards its target does not overshoot while
#: T ≤ 2.5 Δ/v0 (the factor (1−s)² of its velocity stays positive).
NO_OVERSHOOT = 2.5


def durations(
    distance: Array, speed: Array, velocity: Array, max_velocity: Array, max_acceleration: Array
) -> tuple[Array, Array]:
    """Durations of moves and of their braking (P1): T = |Δ|/v, bounded by what the joint can do.

    T = max(|Δ|/v, 1.875|Δ|/v_max). A start velocity that points at the target goes on into the
    move, which is then shortened to 2.5|Δ|/|v0| where that keeps it from overshooting, but lasts
    at least 1.5|v0|/a_max. One that points away is braked within T_b = 1.5|v0|/a_max.

    Args:
        distance: Δ, target minus start, shape (k,), rad.
        speed: v, the mean speed asked for, shape (k,), rad/s, positive.
        velocity: v0, reference velocity at the start, shape (k,), rad/s.
        max_velocity: limit of the peak velocity, shape (k,), rad/s.
        max_acceleration: shape (k,), rad/s².

    Returns:
        T and T_b (0 where nothing is braked), shape (k,), s, at most LONGEST.
    """
    stopping = 1.5 * np.abs(velocity) / max_acceleration
    ahead = velocity * distance > 0.0
    brake = np.where(ahead, 0.0, stopping)
    far = np.abs(distance - 0.5 * velocity * brake)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        short = np.where(ahead, NO_OVERSHOOT * far / np.abs(velocity), np.inf)
        time = np.minimum(far / speed, short)
    floor = np.maximum(np.where(ahead, stopping, 0.0), PEAK * far / max_velocity)
    result: Array = np.minimum(np.maximum(time, floor), LONGEST)
    return result, np.minimum(brake, LONGEST)


class Trajectories:
    """The moves of n joints.

    Attributes: done (shape (n,), bool), moving (whether any joint is on its way).
    """

    def __init__(self, n: int, period: float) -> None:
        self._period = period
        # Highest power first; the move and its braking; position and velocity.
        self._coefficients = np.zeros((6, 2, 2, n))
        self._step = np.zeros((2, n))  # s and u grow by this much in each cycle
        self._start = np.zeros(n)  # cycle in which each move began
        self._end = np.full(n, np.inf)  # cycle in which it ends
        self._next_end = np.inf
        self._target = np.zeros(n)
        self._cycle = 0
        self.done: NDArray[np.bool_] = np.ones(n, dtype=bool)
        self.moving = False

    def hold(self, joints: Joints, position: Array) -> None:
        """Stay at a position, at once; done.

        Args:
            joints: k of them.
            position: shape (k,), rad.
        """
        self._coefficients[..., joints] = 0.0
        self._coefficients[5, 0, 0, joints] = position
        self._step[:, joints] = 0.0
        self._end[joints] = np.inf
        self._changed()

    def move(
        self,
        joints: Joints,
        start: Array,
        velocity: Array,
        target: Array,
        time: Array,
        brake: Array,
    ) -> None:
        """Start moves (P1).

        Args:
            joints: k of them.
            start: position of the reference now, shape (k,), rad.
            velocity: of the reference now, shape (k,), rad/s.
            target: shape (k,), rad.
            time: duration, shape (k,), s; a duration 0 (no distance at rest) ends in one cycle.
            brake: time in which the velocity is braked, 0 where it goes on, shape (k,), s.
        """
        time = np.maximum(time, self._period)
        braking = brake > 0.0
        run = np.where(braking, 0.0, velocity) * time  # v0 T
        stop = velocity * brake  # v0 T_b, of which half is the way until standstill
        reach = target - start - 0.5 * stop
        none = 0.0 * run
        move = [6 * reach - 3 * run, 8 * run - 15 * reach, 10 * reach - 6 * run, none, run, start]
        self._set(0, joints, np.array(move), time)
        stopping = [none, 0.5 * stop, -stop, none, stop, none]
        self._set(1, joints, np.array(stopping), np.where(braking, brake, np.inf))
        self._target[joints] = target
        self._start[joints] = self._cycle
        last = np.maximum(time, brake) / self._period
        self._end[joints] = self._cycle + np.ceil(last - 1e-9)
        self._changed()

    def _set(self, part: int, joints: Joints, position: Array, time: Array) -> None:
        """The polynomial of a part, shape (6, k), and its derivative."""
        powers = np.arange(5.0, 0.0, -1.0)[:, None]
        self._coefficients[:, part, 0, joints] = position
        self._coefficients[0, part, 1, joints] = 0.0
        self._coefficients[1:, part, 1, joints] = position[:5] * powers / time
        self._step[part, joints] = self._period / time

    def remaining(self, joints: Joints) -> Array:
        """Time until the moves end, shape (k,), s; 0 where there is none."""
        left = (self._end[joints] - self._cycle) * self._period
        result: Array = np.where(self.done[joints], 0.0, left)
        return result

    def advance(self) -> None:
        """Take all moves one control period further."""
        self._cycle += 1
        if self._cycle >= self._next_end:
            ended = np.flatnonzero(self._end <= self._cycle)
            self.hold(ended, self._target[ended])

    def _changed(self) -> None:
        self._next_end = float(self._end.min())
        self.moving = self._next_end < np.inf
        np.isinf(self._end, out=self.done)

    def profiles(self, out: Array) -> None:
        """Where the moves lead in the next cycles.

        Args:
            out: position and velocity of each cycle, shape (cycles, 2, n), rad and rad/s.
        """
        cycles = np.arange(self._cycle + 1, self._cycle + 1 + len(out))[:, None]
        s = (cycles - self._start)[:, None, :] * self._step
        s = np.minimum(s, 1.0)[:, :, None, :]
        coefficients = self._coefficients
        parts = coefficients[0] * s  # Horner's rule
        for k in range(1, 5):
            np.add(parts, coefficients[k], out=parts)
            np.multiply(parts, s, out=parts)
        np.add(parts, coefficients[5], out=parts)
        np.add(parts[:, 0], parts[:, 1], out=out)
        over = cycles >= self._end
        np.copyto(out[:, 0], self._target, where=over)
        np.copyto(out[:, 1], 0.0, where=over)


def ramps(velocity: Array, target: Array, step: Array, cycles: int) -> Array:
    """Velocities on their way to their targets in the next cycles, by at most a step each (P5).

    v(k) = clip(target, v − k·step, v + k·step)

    Args:
        velocity: v, shape (n,), rad/s.
        target: shape (n,), rad/s.
        step: acceleration times the control period, shape (n,), rad/s.
        cycles: how many.

    Returns:
        Shape (cycles, n), rad/s.
    """
    reach = np.arange(1, cycles + 1)[:, None] * step
    result: Array = np.minimum(np.maximum(target, velocity - reach), velocity + reach)
    return result
