# SPDX-License-Identifier: Apache-2.0
"""PIDs for arrays of loops (SPEC P7, P10, I5)."""

from __future__ import annotations

import math

import numpy as np

from .config import Pid
from .measurement import Array
from .state import Joints


class PidLoops:
    """PIDs with feed-forward, a clamped integral and a filtered derivative, for arrays of loops.

    out = kff·r + kp·e + I + kd·d;  I += ki·e·dt, clamped;  d += α(rate − d)

    All arrays have shape (loops, n); ``gains``, shape (8, loops, n), holds kp, 1, kd, kff, ki·dt,
    α and the bounds of I, so that the law is one product and one sum. Attributes: reference (r),
    error (e) and rate (inputs), integral.
    """

    GAINS = 8

    def __init__(self, gains: Array) -> None:
        _, loops, n = gains.shape
        self._gains = gains[:4]
        self.kd, self.kff, self.ki_dt, self._alpha, self._limit, self._negative_limit = gains[2:]
        self._terms = np.zeros((4, loops, n))
        self._products = np.zeros((4, loops, n))
        self._rows = self._products.reshape(4 * loops, n)
        self._ones = np.ones(4 * loops)  # a product with ones is the cheapest sum of rows
        self.error, self._integral_term, self._derivative, self.reference = self._terms
        shape = (loops, n)
        self.rate = np.zeros(shape)
        self.integral, self._previous = np.zeros(shape), np.zeros(shape)
        self._scratch = np.zeros(shape)

    @staticmethod
    def column(pid: Pid | None, period: float) -> list[float]:
        """The gains of one loop, GAINS numbers; all zero but the unity of I for none."""
        if pid is None:
            return [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        alpha = 1.0 - math.exp(-2.0 * math.pi * pid.derivative_cutoff * period)
        limit = pid.integral_limit if pid.ki > 0.0 else 0.0
        return [pid.kp, 1.0, pid.kd, pid.kff, pid.ki * period, alpha, limit, -limit]

    def reset(self, joints: Joints, integral: Array | float) -> None:
        """Start loops at given integral parts, shape (loops, k) or one (M9: without a jump)."""
        bound = self._limit[:, joints]
        self.integral[:, joints] = np.minimum(np.maximum(integral, -bound), bound)
        self._derivative[:, joints] = 0.0

    def step(self, out: Array) -> None:
        """One period from ``error`` and ``rate``; out, shape (n,), is the sum of all loops."""
        scratch, integral = self._scratch, self._previous
        self._previous = self.integral
        np.multiply(self.ki_dt, self.error, scratch)
        np.add(self._previous, scratch, integral)
        np.minimum(integral, self._limit, out=integral)
        np.maximum(integral, self._negative_limit, out=integral)
        self.integral = integral
        self._integral_term[:] = integral
        derivative = self._derivative
        np.subtract(self.rate, derivative, scratch)
        np.multiply(scratch, self._alpha, scratch)
        np.add(derivative, scratch, derivative)
        np.multiply(self._gains, self._terms, self._products)
        np.dot(self._ones, self._rows, out)

    def unwind(self, excess: Array) -> None:
        """Anti-windup: where the output is cut, an integral that pushes further goes back.

        Args:
            excess: what was cut off, wanted minus given, shape (n,).
        """
        pushing = self.error * excess > 0.0
        self.integral[pushing] = self._previous[pushing]
