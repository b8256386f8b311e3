# SPDX-License-Identifier: Apache-2.0
"""PID controllers of the laws."""

from __future__ import annotations

from ... import nocython as cython
from .formulas import clamp


@cython.final
@cython.cclass
class Pid:
    """A PID with feed-forward, a bounded integral and a filtered rate.

    u = kff·r + kp·e + I + kd·D;   I += ki·e·T, |I| ≤ limit;   D += alpha·(rate − D)

    An integral beyond a new, smaller limit has ``room`` above it, which shrinks by ``fall`` per
    cycle.
    """

    kp = ki_period = kd = kff = cython.declare(cython.double, visibility="public")
    limit = cython.declare(cython.double, visibility="public")
    room = cython.declare(cython.double, visibility="public")
    fall = cython.declare(cython.double, visibility="public")
    alpha = cython.declare(cython.double, visibility="public")
    integral = derivative = previous = cython.declare(cython.double, visibility="public")
    error = reference = cython.declare(cython.double, visibility="public")

    @cython.ccall
    def reset(self, integral: cython.double) -> cython.void:
        """Start from an integral part, at rest."""
        self.room = 0.0
        self.integral = self.previous = clamp(integral, -self.limit, self.limit)
        self.derivative = self.error = self.reference = 0.0

    @cython.ccall
    def feed(self) -> cython.double:
        """The last output without its integral part."""
        return self.kff * self.reference + self.kp * self.error + self.kd * self.derivative


@cython.cfunc
def pid_step(
    p: Pid, reference: cython.double, error: cython.double, rate: cython.double
) -> cython.double:
    """One period of a PID: u = kff·r + kp·e + I + kd·D."""
    p.reference, p.error = reference, error
    p.previous = p.integral
    if p.room > 0.0:
        p.room = max(p.room - p.fall, 0.0)
    bound = p.limit + p.room
    p.integral = clamp(p.integral + p.ki_period * error, -bound, bound)
    p.derivative += p.alpha * (rate - p.derivative)
    return p.kff * reference + p.kp * error + p.integral + p.kd * p.derivative


@cython.cfunc
def unwind(p: Pid, excess: cython.double) -> cython.void:
    """Anti-windup: undo the integral's last step where it drives a saturated output further."""
    if p.error * excess > 0.0:
        p.integral = p.previous
