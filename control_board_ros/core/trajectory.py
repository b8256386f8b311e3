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

#: The longest move, s: keeps a denormal speed from making an infinite duration.
LONGEST = 1e6

#: Peak over mean speed of a minimum-jerk move from rest to rest.
PEAK = 1.875

#: Cycles whose profiles are computed in one go.
AHEAD = 32

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
    """The moves of n joints: position and velocity of the reference, cycle by cycle.

    The profiles of the next AHEAD cycles are computed in one go, since the number of numpy
    calls is what a cycle costs; whatever starts or ends a move computes them anew.

    Attributes: position, velocity (shape (n,), rad and rad/s, of the present cycle), done
    (shape (n,), bool), moving (whether any joint is on its way).
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
        self._parts = np.zeros((AHEAD, 2, 2, n))
        self._profiles = np.zeros((AHEAD, 2, n))
        self._row = AHEAD
        self._value = np.zeros((2, n))
        self.position: Array = self._value[0]
        self.velocity: Array = self._value[1]
        self.done: NDArray[np.bool_] = np.ones(n, dtype=bool)
        self.moving = False

    def hold(self, joints: NDArray[np.intp] | slice, position: Array) -> None:
        """Stay at a position, at once; done.

        Args:
            joints: indices, shape (k,), or a slice of k.
            position: shape (k,), rad.
        """
        self._coefficients[..., joints] = 0.0
        self._coefficients[5, 0, 0, joints] = position
        self._target[joints] = position
        self._step[:, joints] = 0.0
        self.position[joints] = position
        self.velocity[joints] = 0.0
        self._end[joints] = np.inf
        self._changed()

    def move(
        self,
        joints: NDArray[np.intp] | slice,
        start: Array,
        target: Array,
        time: Array,
        brake: Array,
    ) -> None:
        """Start moves from the present reference velocity (P1).

        Args:
            joints: indices, shape (k,), or a slice of k.
            start: position of the reference now, shape (k,), rad.
            target: shape (k,), rad.
            time: duration, shape (k,), s; a duration 0 (no distance at rest) ends in one cycle.
            brake: time in which the velocity is braked, 0 where it goes on, shape (k,), s.
        """
        time = np.maximum(time, self._period)
        braking = brake > 0.0
        now = self.velocity[joints]
        run = np.where(braking, 0.0, now) * time  # v0 T
        stop = now * brake  # v0 T_b, of which half is the way until standstill
        reach = target - start - 0.5 * stop
        none = 0.0 * run
        move = [6 * reach - 3 * run, 8 * run - 15 * reach, 10 * reach - 6 * run, none, run, start]
        self._set(0, joints, np.array(move), time)
        stopping = [none, 0.5 * stop, -stop, none, stop, none]
        self._set(1, joints, np.array(stopping), np.where(braking, brake, np.inf))
        self._target[joints] = target
        self.position[joints] = start
        self._start[joints] = self._cycle
        last = np.maximum(time, brake) / self._period
        self._end[joints] = self._cycle + np.ceil(last - 1e-9)
        self._changed()

    def _set(
        self, part: int, joints: NDArray[np.intp] | slice, position: Array, time: Array
    ) -> None:
        """The polynomial of a part, shape (6, k), and its derivative."""
        powers = np.arange(5.0, 0.0, -1.0)[:, None]
        self._coefficients[:, part, 0, joints] = position
        self._coefficients[0, part, 1, joints] = 0.0
        self._coefficients[1:, part, 1, joints] = position[:5] * powers / time
        self._step[part, joints] = self._period / time

    def remaining(self, joints: NDArray[np.intp]) -> Array:
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
        if self._row >= AHEAD:
            self._compute()
        self._value = self._profiles[self._row]
        self.position, self.velocity = self._value
        self._row += 1

    def _changed(self) -> None:
        self._next_end = float(self._end.min())
        self.moving = self._next_end < np.inf
        np.isinf(self._end, out=self.done)
        self._row = AHEAD
        self._value = self._value.copy()  # out of the profiles, which are computed anew
        self.position, self.velocity = self._value

    def _compute(self) -> None:
        """Evaluate the polynomials of this and the next cycles, by Horner's rule."""
        elapsed = np.arange(self._cycle, self._cycle + AHEAD)[:, None] - self._start
        s = np.minimum(elapsed[:, None, :] * self._step, 1.0)[:, :, None, :]
        parts, coefficients = self._parts, self._coefficients
        np.multiply(coefficients[0], s, out=parts)
        for k in range(1, 5):
            np.add(parts, coefficients[k], out=parts)
            np.multiply(parts, s, out=parts)
        np.add(parts, coefficients[5], out=parts)
        np.add(parts[:, 0], parts[:, 1], out=self._profiles)
        self._row = 0


def ramp(velocity: Array, target: Array, up: Array, down: Array, scratch: Array) -> None:
    """Move velocities towards their targets by at most a step, in place (P5).

    v += clip(target − v, down, up)

    Args:
        velocity: v, shape (n,), rad/s, changed.
        target: shape (n,), rad/s.
        up: largest step, acceleration times the control period, shape (n,), rad/s.
        down: its negative, shape (n,).
        scratch: shape (n,), overwritten.
    """
    np.subtract(target, velocity, scratch)
    np.minimum(scratch, up, out=scratch)
    np.maximum(scratch, down, out=scratch)
    np.add(velocity, scratch, velocity)
