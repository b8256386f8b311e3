# SPDX-License-Identifier: Apache-2.0
"""How joints that step together get there, where their torques do not suffice (SPEC P4, P14).

A direct position is approached by each joint as fast as its own limits allow. Where several joints
of an arm step from rest and that would take more torque than there is, they go on the straight
line instead, q(s) = q0 + Δs, in the shortest time that speeds, accelerations and torques allow;
from motion they move as position moves do, for as long as their torques ask for. With b = ṡ² and
u = s̈ the torques are linear in u, at each place s of the line::

    τ = (M Δ) u + c(q, Δ) b + g(q) + friction
    |τ| ≤ SHARE τ_max,   |Δ_i| √b ≤ v_i,   |Δ_i u| ≤ a_i

From the end backwards follows the greatest b of each place from which the rest can be braked, from
the start forwards the hardest acceleration below it (Pham and Pham, A new approach to time-optimal
path parameterization based on reachability analysis, 2018).

Plain Python in Cython's pure mode, as the laws are. Units: rad, rad/s, N·m, s; m and N where
joints slide.
"""

from __future__ import annotations

from math import ceil, fabs, sqrt
from typing import Any

from ... import nocython as cython
from .formulas import row

#: Part of the torque limits that a plan may use; the rest is for its control.
SHARE = cython.declare(cython.double, 0.95)
#: Times at which the joints' own ways are checked, and places of the line.
CHECKS = cython.declare(cython.int, 24)
PLACES = cython.declare(cython.int, 32)
#: Halvings of b in the search for the greatest one.
HALVINGS = cython.declare(cython.int, 24)
#: Steps of a plan at most.
MAX_STEPS = cython.declare(cython.int, 128)
#: Speed at which a joint is at rest, as a part of its limit.
REST_SPEED_SHARE = cython.declare(cython.double, 2e-3)
#: Steps from motion that last no longer have no plan, s: their want of torque passes.
MAX_UNPLANNED_TIME = cython.declare(cython.double, 0.4)
#: Change of a joint's torque along the line that is none, N·m.
NO_TORQUE_CHANGE = cython.declare(cython.double, 1e-12)


@cython.cclass
class Steps:
    """Plans direct steps of joints of one arm.

    Args:
        joints: of class ``laws.Joint``, in the order of the arm's.
        arm: their dynamics.

    Attributes: time (of the last plan, s; 0: there was none to make).
    """

    time = cython.declare(cython.double, visibility="public")
    joints: list[Any]
    arm: Any
    plans: list[Any]
    count: cython.Py_ssize_t
    start = speed = place = cython.declare(cython.double[::1])
    way: cython.double[::1]  # Δ
    fastest = hardest = limit = cython.declare(cython.double[::1])
    stall: cython.double[::1]  # torque at stall, and how much less per rad/s
    fading = dry = wet = cython.declare(cython.double[::1])
    gain: cython.double[::1]  # M Δ at each place
    turn: cython.double[::1]  # c(q, Δ)
    load: cython.double[::1]  # g(q) + dry friction
    max_b: cython.double[::1]  # greatest b of each place
    b: cython.double[::1]
    longest: cython.double  # time of the longest step by its own limits, s
    low: cython.double  # bounds of u
    high: cython.double
    top: cython.double  # greatest b, and u, by the joints' own limits
    hurry: cython.double
    position = velocity = acceleration = torque = cython.declare(cython.double[::1])

    def __init__(self, joints: list[Any], arm: Any) -> None:
        n = len(joints)
        self.joints, self.arm, self.count, self.time = joints, arm, n, 0.0
        self.plans = [row(MAX_STEPS) for _ in joints]
        self.start, self.way, self.fastest, self.hardest = row(n), row(n), row(n), row(n)
        self.limit, self.stall, self.fading = row(n), row(n), row(n)
        self.speed, self.place = row(n), row(n)
        self.dry, self.wet = row(n), row(n)
        self.gain, self.turn = row(n * (PLACES + 1)), row(n * (PLACES + 1))
        self.load = row(n * (PLACES + 1))
        self.max_b, self.b = row(PLACES + 1), row(PLACES + 1)
        self.position, self.velocity, self.acceleration, self.torque = arm.rows

    def plan(self, numbers: list[int]) -> bool:
        """Plan the steps of joints to their references, where they lack torque for them.

        Args:
            numbers: places of the joints in the arm.

        Returns:
            Whether they get there: from motion no line leads there, where joints lack torque for
            longer than MAX_UNPLANNED_TIME.
        """
        self.time = 0.0
        resting: cython.bint = self.take(numbers)
        if not self.strained() or not (resting or self.longest > MAX_UNPLANNED_TIME):
            return True
        if not resting or not self.line():
            return False
        self.order(numbers)
        return True

    @cython.cfunc
    def take(self, numbers: list[int]) -> cython.bint:
        """Read the joints; whether all are at rest."""
        k: cython.Py_ssize_t
        resting: cython.bint = True
        for k in range(self.count):
            joint = self.joints[k]
            self.start[k], self.way[k], self.speed[k] = joint.track.position, 0.0, 0.0
            limits, motor = joint.limits, joint.motor
            self.fastest[k], self.hardest[k] = limits.velocity, limits.acceleration
            volts: cython.double = motor.torque_per_ampere / motor.ohms
            self.limit[k] = SHARE * limits.torque
            self.stall[k] = SHARE * volts * limits.output / motor.percent_per_volt
            self.fading[k] = SHARE * volts * motor.emf
        for k in numbers:
            joint = self.joints[k]
            self.way[k] = joint.reference.position - joint.track.position
            self.speed[k] = joint.track.velocity
            resting = resting and fabs(self.speed[k]) <= REST_SPEED_SHARE * self.fastest[k]
            ahead = self.way[k] > 0.0
            self.dry[k] = joint.motor.coulomb if ahead else joint.motor.coulomb_negative
            self.wet[k] = joint.motor.viscous if ahead else joint.motor.viscous_negative
        return resting

    @cython.cfunc
    def bound(
        self, k: cython.Py_ssize_t, speed: cython.double, way: cython.double
    ) -> cython.double:
        """The torque that a motor has in a direction; driving, it loses that of the back-EMF."""
        if speed * way > 0.0:
            return min(self.limit[k], max(self.stall[k] - self.fading[k] * fabs(speed), 0.0))
        return self.limit[k]

    # --- each joint on its own way --------------------------------------------------------------

    @cython.cfunc
    def strained(self) -> cython.bint:
        """Whether a motor lacks torque where each joint steps as fast as its own limits allow."""
        step = 0.0
        moving: cython.bint = True
        for k in range(self.count):
            left = fabs(self.speed[k]) / self.hardest[k]
            if self.way[k] != 0.0:
                left += fabs(self.way[k]) / self.fastest[k] + sqrt(
                    fabs(self.way[k]) / self.hardest[k]
                )
            step = max(step, left / CHECKS)
            self.place[k] = self.start[k]
        self.longest = step * CHECKS
        for _ in range(2 * CHECKS):
            moving = False
            for k in range(self.count):
                left = self.start[k] + self.way[k] - self.place[k]
                after = self.approach(k, left, step)
                moving = moving or after != 0.0 or self.speed[k] != 0.0
                self.acceleration[k] = (after - self.speed[k]) / step
                self.velocity[k] = 0.5 * (after + self.speed[k])
                self.position[k] = self.place[k] + 0.5 * step * self.velocity[k]
                self.place[k] += step * self.velocity[k]
                self.speed[k] = after
            if not moving:
                return False
            self.arm.inverse(1.0)
            for k in range(self.count):
                left = self.torque[k]
                if self.velocity[k] != 0.0:
                    left += self.wet[k] * self.velocity[k]
                    left += self.dry[k] if self.velocity[k] > 0.0 else -self.dry[k]
                if fabs(left) > self.bound(k, self.velocity[k], left):
                    return True
        return False

    @cython.cfunc
    def approach(
        self, k: cython.Py_ssize_t, left: cython.double, step: cython.double
    ) -> cython.double:
        """The speed after a step of a joint that has a way left, within its own limits."""
        change = step * self.hardest[k]
        speed = sqrt(2.0 * self.hardest[k] * fabs(left) + 0.25 * change * change)
        speed = min(speed - 0.5 * change, self.fastest[k], fabs(left) / step)
        if left < 0.0:
            speed = -speed
        if fabs(speed) < 1e-3 * self.fastest[k]:
            speed = 0.0
        return max(min(speed, self.speed[k] + change), self.speed[k] - change)

    # --- on the line ----------------------------------------------------------------------------

    @cython.cfunc
    def line(self) -> cython.bint:
        """Find b of each place, and the time; whether there is a way."""
        step = 1.0 / PLACES
        self.measure()
        self.max_b[PLACES] = 0.0
        for i in range(PLACES - 1, -1, -1):
            self.max_b[i] = self.greatest(i, self.max_b[i + 1])
            if self.max_b[i] < 0.0:
                return False
        self.b[0] = self.time = 0.0
        for i in range(PLACES):
            self.bounds(i, self.b[i])
            rate = min(self.high, 0.5 * (self.max_b[i + 1] - self.b[i]) / step)
            self.b[i + 1] = max(self.b[i] + 2.0 * rate * step, 0.0)
            if self.b[i] + self.b[i + 1] <= 0.0:
                return False
            self.time += 2.0 * step / (sqrt(self.b[i]) + sqrt(self.b[i + 1]))
        return True

    @cython.cfunc
    def measure(self) -> cython.void:
        """What the torques are made of, at each place; and the joints' own limits."""
        n = self.count
        self.top = self.hurry = 1e300
        for k in range(n):
            if self.way[k] != 0.0:
                self.top = min(self.top, (self.fastest[k] / self.way[k]) ** 2)
                self.hurry = min(self.hurry, self.hardest[k] / fabs(self.way[k]))
        for i in range(PLACES + 1):
            for k in range(n):
                self.position[k] = self.start[k] + self.way[k] * i / PLACES
                self.velocity[k] = self.acceleration[k] = 0.0
            self.arm.inverse(1.0)
            for k in range(n):
                self.load[i * n + k] = self.torque[k]
                if self.way[k] != 0.0:
                    self.load[i * n + k] += self.dry[k] if self.way[k] > 0.0 else -self.dry[k]
                self.velocity[k] = self.way[k]
            self.arm.inverse(0.0)
            for k in range(n):
                self.turn[i * n + k] = self.torque[k]
                self.velocity[k], self.acceleration[k] = 0.0, self.way[k]
            self.arm.inverse(0.0)
            for k in range(n):
                self.gain[i * n + k] = self.torque[k]

    @cython.cfunc
    def bounds(self, i: cython.int, b: cython.double) -> cython.void:
        """Bounds of u from a place and b to the next one; without a way ``low`` is above ``high``.

        Torques are bounded at both places: at the next one b has become b + 2 u/PLACES.
        """
        root = sqrt(b)
        self.low, self.high = -self.hurry, self.hurry
        for m in range(2 * self.count):
            k = m if m < self.count else m - self.count
            ahead = 0.0 if m < self.count else 2.0 / PLACES
            n = i * self.count + m
            gain = self.gain[n] + ahead * self.turn[n]
            speed = self.way[k] * root
            rest = self.load[n] + self.turn[n] * b
            if speed != 0.0:
                rest += self.wet[k] * speed
            above = self.bound(k, speed, 1.0) - rest
            below = -self.bound(k, speed, -1.0) - rest
            if gain > NO_TORQUE_CHANGE:
                self.low, self.high = max(self.low, below / gain), min(self.high, above / gain)
            elif gain < -NO_TORQUE_CHANGE:
                self.low, self.high = max(self.low, above / gain), min(self.high, below / gain)
            elif above < 0.0 or below > 0.0:
                self.low, self.high = 1.0, -1.0
                return

    @cython.cfunc
    def greatest(self, i: cython.int, after: cython.double) -> cython.double:
        """The greatest b of a place from which the next has no more than ``after``; −1: none."""
        low = 0.0
        high = self.top
        if self.leads(i, high, after):
            return high
        if not self.leads(i, 0.0, after):
            return -1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self.leads(i, middle, after):
                low = middle
            else:
                high = middle
        return low

    @cython.cfunc
    def leads(self, i: cython.int, b: cython.double, after: cython.double) -> cython.bint:
        """Whether an acceleration leads from b of a place to 0 … ``after`` at the next."""
        self.bounds(i, b)
        return max(self.low, -0.5 * b * PLACES) <= min(self.high, 0.5 * (after - b) * PLACES)

    # --- the plan -------------------------------------------------------------------------------

    @cython.cfunc
    def order(self, numbers: list[int]) -> cython.void:
        """Give the joints their accelerations: ṡ at equal times, scaled to end at the target."""
        k: cython.Py_ssize_t
        i = 0
        period: cython.double = self.joints[0].clock.period
        span: cython.double = period * max(ceil(self.time / (MAX_STEPS * period)), 1.0)
        before = 0.0  # time at place i
        lasts = self.interval(0)
        rate: cython.double = 0.0
        last: cython.double = 0.0
        place: cython.double = 0.0
        rates: cython.double[::1] = row(MAX_STEPS)
        steps = cython.cast(cython.int, ceil(self.time / span - 1e-9))
        for step in range(steps):
            while i < PLACES and before + lasts < (step + 1) * span:
                before += lasts
                i += 1
                lasts = self.interval(i) if i < PLACES else 0.0
            rate = 0.0
            if i < PLACES:
                rate = sqrt(self.b[i])
                rate += (sqrt(self.b[i + 1]) - rate) * ((step + 1) * span - before) / lasts
            if step == steps - 1:
                rate = 0.0
            rates[step] = (rate - last) / span
            place += 0.5 * span * (rate + last)
            last = rate
        for k in numbers:
            plan: cython.double[::1] = self.plans[k]
            for step in range(steps):
                plan[step] = self.way[k] * rates[step] / place
            self.joints[k].step_by(plan, steps, span)

    @cython.cfunc
    def interval(self, i: cython.int) -> cython.double:
        """Duration from place i to the next, s."""
        return 2.0 / (PLACES * (sqrt(self.b[i]) + sqrt(self.b[i + 1])))
