# SPDX-License-Identifier: Apache-2.0
"""How joints that stop together come to rest (SPEC M9, P3).

They keep their path: joint i comes to rest with the slowest one, after T = max |v_i|/a_i, or
sooner, so that the path costs it no more than KEEPING beyond its own braking distance::

    T_i = min(T, |v_i|/a_i + 2 KEEPING/|v_i|)

Where a motor lacks the torque for that, the stop is the best of some that are predicted with the
model of the arm. In each step of a prediction few joints yield, and the others brake fully::

    min Σ w_i (q̈_i + 2 a_i sign q̇_i)²,  |M(q) q̈ + h(q, q̇)| ≤ τ_max,  |q̈_i| ≤ a_i
    w_i = ω_i (|q̇_i|/a_i + EASE) (1 + URGE z_i)²

The aim lies beyond full braking, so that a joint yields only where it relieves the motor by enough
for what it costs; |q̇_i|/a_i is how long it pays for it. Torque comes before a_i: a light joint
that heavy ones pull along may have LEAP a_i, and its reference does too. z_i: what the joint runs
beyond its braking distance v²/(2a), or comes back. The further a joint runs, the greater its ω_i
in the next prediction. The best one is that whose furthest joint runs least, the way back of
another counted as BACK_WEIGHT, time as LATE_WEIGHT. In the first predictions no joint turns round,
so that it rests, or goes on; where torque does not suffice for that, or a joint runs little
further than KEEPING, others follow in which joints may. Turning its torque round takes a motor its
winding's time, L/R, in which the plan brakes already; the torque to make up for it is left, Δτ
(L/R)/T, and at most LOST of it.

Plain Python in Cython's pure mode, as the laws are. Units: rad, rad/s, N·m, s; m and N where
joints slide.
"""

from __future__ import annotations

from array import array
from math import ceil, fabs, sqrt
from typing import Any

from ... import nocython as cython
from .formulas import braking, row

#: What keeping the path may cost a joint, beyond its own braking distance, rad or m; with what
#: control errs by it is 30 mrad.
KEEPING = cython.declare(cython.double, 0.029)
#: Part of a change of torque, at most, that a stop leaves for what the winding loses of it.
LOST = cython.declare(cython.double, 0.02)
#: Steps of a prediction until the slowest joint would rest, and the most.
STEPS = cython.declare(cython.int, 24)
MAX_STEPS = cython.declare(cython.int, 64)
#: Number of predictions in which no joint turns round, and of others; and when one is good enough:
#: way beyond the braking distance, and back, rad or m.
ROUNDS = cython.declare(cython.int, 6)
GOOD_SCORE = cython.declare(cython.double, 1e-3)
#: Weights: of joints at rest, s; of the way beyond the braking distance, 1/rad.
EASE = cython.declare(cython.double, 0.02)
URGE = cython.declare(cython.double, 20.0)
#: Factor of ω from one prediction to the next: from this, to this and 1 for the furthest joint.
GROWTH = cython.declare(cython.double, 0.3)
#: Sweeps of the solver at most; error of torque that ends it, as a part of the limit.
SWEEPS = cython.declare(cython.int, 60)
MAX_TORQUE_ERROR = cython.declare(cython.double, 2e-3)
#: Torque and speed beyond the limit that a plan may have, as a part of it; more counts as z does.
SLACK = cython.declare(cython.double, 0.03)
#: Acceleration of a plan beyond the limit that torque may ask for, as a multiple of the limit.
LEAP = cython.declare(cython.double, 2.0)
#: A later rest counts as way beyond the braking distance, rad/s.
LATE_WEIGHT = cython.declare(cython.double, 0.2)
#: The longest way back counts as this part of a way beyond the braking distance.
BACK_WEIGHT = cython.declare(cython.double, 0.5)
#: Speed at which a joint that may not turn round rests; error of its rest; as parts of what one
#: step of braking takes away.
RESTING_SHARE = cython.declare(cython.double, 0.05)
MAX_REST_ERROR = cython.declare(cython.double, 0.02)
#: Slower than this is at rest, as a part of what one step of braking takes away.
REST_SPEED_SHARE = cython.declare(cython.double, 1e-9)


@cython.ccall
def smooth_time(
    speed: cython.double, change: cython.double, hardest: cython.double, jerk: cython.double
) -> cython.double:
    """The shortest braking within acceleration and jerk limits, s.

    Of v0 (1 − 3u² + 2u³) + a0 T u (1 − u)², u = t/T: 1.5 v0/T + a0 ≤ a, 6 v0/T² + 4 a0/T ≤ jerk.

    Args:
        speed: |v0|, rad/s.
        change: |a0|, rad/s².
        hardest: a, rad/s²; where a0 is no less, the braking begins from it.
        jerk: rad/s³, positive.
    """
    time: cython.double = (2.0 * change + sqrt(4.0 * change * change + 6.0 * speed * jerk)) / jerk
    return max(time, 1.5 * speed / max(hardest - change, 0.25 * hardest))


@cython.cclass
class Stops:
    """Plans the stops of the joints of one arm.

    Args:
        joints: of class ``laws.Joint``, in the order of the arm's.
        arm: their dynamics; None: torques are not known.

    Attributes: rounds (predictions of the last plan; 0: torque suffices), furthest (its longest
    way beyond the braking distance, rad or m), back (its longest way back).
    """

    rounds = cython.declare(cython.int, visibility="public")
    furthest = cython.declare(cython.double, visibility="public")
    back = cython.declare(cython.double, visibility="public")
    joints: list[Any]
    arm: Any
    plans: list[Any]
    count: cython.Py_ssize_t
    stopping: cython.Py_ssize_t  # joints that stop: the first ones of ``numbers``
    numbers: cython.long[::1]
    step: cython.double  # s
    excess: cython.double  # torque beyond the limits, as a part of them; likewise speed
    hasty: cython.double
    onward: cython.bint  # no joint may turn round
    strained: cython.bint  # a motor lacked torque in the last prediction
    overrun: cython.double  # way beyond the braking distance in the last prediction
    way_back: cython.double  # longest way back in it
    steps: cython.int  # of the last prediction
    best_steps: cython.int
    place: cython.double[::1]
    speed: cython.double[::1]
    hardest: cython.double[::1]  # a_i
    fastest: cython.double[::1]  # speed limit
    wanted: cython.double[::1]  # deceleration
    kept: cython.double[::1]  # what keeping the path may cost, less the way until a motor brakes
    smooth: cython.double[::1]  # time of a stop within the jerk limit, s; 0: none
    limit = dry = wet = cython.declare(cython.double[::1])
    urge: cython.double[::1]  # ω
    ease = q = v = cython.declare(cython.double[::1])
    max_way: cython.double[::1]  # way so far
    beyond: cython.double[::1]  # z
    mass = bias = x = cython.declare(cython.double[::1])
    relief: cython.double[::1]  # Σ M²/w: how a torque yields to its multiplier
    bottom = top = cython.declare(cython.double[::1])  # accelerations that a joint may have
    full: cython.double[::1]  # the acceleration of full braking in a step
    y = trial = best = cython.declare(cython.double[::1])
    arm_position = arm_velocity = cython.declare(cython.double[::1])
    arm_acceleration = arm_torque = cython.declare(cython.double[::1])

    def __init__(self, joints: list[Any], arm: Any) -> None:
        n = len(joints)
        self.joints, self.arm, self.count = joints, arm, n
        self.rounds, self.furthest, self.back = 0, 0.0, 0.0
        self.plans = [row(MAX_STEPS) for _ in joints]
        self.place, self.speed, self.hardest, self.wanted = row(n), row(n), row(n), row(n)
        self.fastest, self.smooth, self.kept = row(n), row(n), row(n)
        self.limit, self.dry, self.wet, self.urge = row(n), row(n), row(n), row(n)
        self.ease, self.q, self.v, self.max_way = row(n), row(n), row(n), row(n)
        self.relief, self.bottom, self.top = row(n), row(n), row(n)
        self.beyond, self.bias, self.x = row(n), row(n), row(n)
        self.numbers = memoryview(array("l", [0] * n))
        self.mass, self.y, self.full = row(n * n), row(2 * n), row(n)
        self.trial, self.best = row(n * MAX_STEPS), row(n * MAX_STEPS)
        if arm is not None:
            self.arm_position, self.arm_velocity, self.arm_acceleration, self.arm_torque = arm.rows

    def plan(self, modelled: bool) -> None:
        """Plan the stop of all joints that are due.

        Args:
            modelled: Whether the dynamics of the arm are known.
        """
        for joint in self.joints:
            if joint.stop.due:
                joint.take_off()
        longest = self.take_joints()
        self.rounds = 0
        self.smoothen()
        if not self.predict_path(longest, modelled):
            self.improve()
        for k in range(self.stopping):
            i = self.numbers[k]
            joint = self.joints[i]
            if self.rounds == 0 and self.smooth[k] > 0.0:
                joint.brake_smoothly(self.smooth[k])
            elif self.rounds == 0:
                joint.brake_since(self.wanted[k])
            else:
                plan = self.plans[i]
                for step in range(self.best_steps):
                    plan[step] = self.best[step * self.count + k]
                joint.brake_by(plan, self.best_steps, self.step)
        for joint in self.joints:
            joint.stop.due = False

    @cython.cfunc
    def take_joints(self) -> cython.double:
        """Read the joints: those that stop first, then the others; T, s."""
        k = 0
        longest = 0.0
        for due in (True, False):
            for i in range(self.count):
                joint = self.joints[i]
                if bool(joint.stop.due and joint.stop.active) is not bool(due):
                    continue
                self.numbers[k] = i
                self.place[k], self.speed[k] = joint.track.position, joint.track.velocity
                limits, motor = joint.limits, joint.motor
                self.hardest[k], self.limit[k] = limits.acceleration, limits.torque
                self.fastest[k] = limits.velocity
                delay = joint.clock.period * motor.lag + joint.drive.delay
                self.kept[k] = max(KEEPING - fabs(self.speed[k]) * delay, 0.0)
                ahead = joint.track.velocity >= 0.0
                self.dry[k] = motor.coulomb if ahead else motor.coulomb_negative
                self.wet[k] = motor.viscous if ahead else motor.viscous_negative
                if not joint.reference.active:
                    self.place[k], self.speed[k] = joint.position, 0.0
                if due:
                    longest = max(longest, fabs(self.speed[k]) / self.hardest[k])
                k += 1
            if due:
                self.stopping = k
        return longest

    @cython.cfunc
    def smoothen(self) -> cython.void:
        """Times of stops within the jerk limits, that keep the path; 0 where there is no room."""
        longest = 0.0
        for k in range(self.stopping):
            joint = self.joints[self.numbers[k]]
            self.smooth[k] = 0.0
            if joint.limits.jerk > 0.0:
                self.smooth[k] = smooth_time(
                    fabs(self.speed[k]), fabs(joint.trajectory.acceleration), self.hardest[k],
                    joint.limits.jerk,
                )  # fmt: skip
                longest = max(longest, self.smooth[k])
        for k in range(self.stopping):
            joint = self.joints[self.numbers[k]]
            if self.smooth[k] <= 0.0 or self.speed[k] == 0.0:
                continue
            self.smooth[k] = min(
                longest, self.smooth[k] + 2.0 * self.kept[k] / fabs(self.speed[k])
            )
            way = braking(self.speed[k], joint.trajectory.acceleration, self.smooth[k])
            reference = joint.reference
            room: cython.double = (
                reference.upper - self.place[k] if way > 0.0 else self.place[k] - reference.lower
            )
            if fabs(way) > room:
                self.smooth[k] = 0.0

    @cython.cfunc
    def predict_path(self, longest: cython.double, modelled: cython.bint) -> cython.bint:
        """Set decelerations that keep the path; whether there is the torque for them."""
        for k in range(self.stopping):
            speed, self.wanted[k] = fabs(self.speed[k]), self.hardest[k]
            if speed > 0.0:
                time: cython.double = min(
                    longest, speed / self.hardest[k] + 2.0 * self.kept[k] / speed
                )
                joint = self.joints[self.numbers[k]]
                if self.speed[k] > 0.0:
                    room = joint.reference.upper - self.place[k]
                else:
                    room = self.place[k] - joint.reference.lower
                time = min(time, 2.0 * max(room, 0.0) / speed)
                self.wanted[k] = min(speed / max(time, 1e-9), self.hardest[k])
        if not modelled or self.arm is None:
            return True
        self.step = self.joints[0].clock.period
        self.step *= max(ceil(longest / (STEPS * self.step)), 1.0)
        for k in range(self.stopping):
            self.urge[k] = 1.0
        self.onward = False
        self.predict()
        return not self.strained

    @cython.cfunc
    def improve(self) -> cython.void:
        """Predict stops with full braking, and keep the best."""
        for k in range(self.stopping):
            self.wanted[k] = self.hardest[k]
            self.limit[k] -= self.lost_torque(k)
        least = self.keep_best(True, 1e300)
        if self.back >= GOOD_SCORE or KEEPING < self.furthest < 2.0 * KEEPING:
            self.keep_best(False, least)

    @cython.cfunc
    def keep_best(self, onward: cython.bint, least: cython.double) -> cython.double:
        """Keep the best of some predictions in ``best``, below a score ``least``; its score."""
        self.onward = onward
        for k in range(self.stopping):
            self.urge[k] = 1.0
        for _ in range(ROUNDS):
            self.rounds += 1
            self.predict()
            score = max(self.excess - SLACK, 0.0) + max(self.hasty - SLACK, 0.0)
            score += self.overrun + BACK_WEIGHT * self.way_back
            good: cython.bint = score < GOOD_SCORE
            score += LATE_WEIGHT * self.steps * self.step
            if score < least:
                least, self.best_steps = score, self.steps
                self.furthest, self.back = self.overrun, self.way_back
                self.best[:] = self.trial
            if good:
                break
            most = 1e-9
            for k in range(self.stopping):
                most = max(most, self.beyond[k])
            for k in range(self.stopping):
                self.urge[k] *= GROWTH + self.beyond[k] / most
        return least

    @cython.cfunc
    def lost_torque(self, k: cython.Py_ssize_t) -> cython.double:
        """What turning the torque round costs, spread over the stop: Δτ (L/R)/T, N·m."""
        joint = self.joints[self.numbers[k]]
        time: cython.double = joint.clock.period * (joint.motor.lead + joint.motor.lag)
        torque: cython.double = joint.torque if self.speed[k] > 0.0 else -joint.torque
        limit: cython.double = joint.limits.torque
        change: cython.double = max(min(torque + limit, 2.0 * limit), 0.0)
        if torque - torque != 0.0:  # not measured
            return 0.0
        return change * min(time / (self.steps * self.step), LOST)

    @cython.cfunc
    def predict(self) -> cython.void:
        """Predict a stop into ``trial``."""
        moving: cython.bint = True
        self.overrun = self.way_back = 0.0
        self.excess, self.hasty, self.strained = 0.0, 0.0, False
        for k in range(self.count):
            self.q[k], self.v[k] = self.place[k], self.speed[k]
            self.max_way[k] = self.beyond[k] = 0.0
            self.y[k] = self.y[self.count + k] = 0.0
        self.steps = 0
        while moving and self.steps < MAX_STEPS:
            self.evaluate()
            self.solve()
            moving = False
            for k in range(self.stopping):
                way = LEAP * self.hardest[k]
                self.x[k] = max(min(self.x[k], way), -way)
                change = self.step * self.x[k]
                self.trial[self.steps * self.count + k] = self.x[k]
                self.q[k] += self.step * (self.v[k] + 0.5 * change)
                self.v[k] += change
                self.hasty = max(self.hasty, fabs(self.v[k]) / self.fastest[k] - 1.0)
                if fabs(self.v[k]) <= REST_SPEED_SHARE * self.step * self.hardest[k]:
                    self.v[k] = 0.0
                else:
                    moving = True
                way = self.q[k] - self.place[k]
                if self.speed[k] < 0.0:
                    way = -way
                self.max_way[k] = max(self.max_way[k], way)
                change = self.v[k] * fabs(self.v[k])  # still to go, towards the braking distance
                if self.speed[k] < 0.0:
                    change = -change
                change -= self.speed[k] * self.speed[k]
                self.beyond[k] = way + 0.5 * change / self.hardest[k]
            for k in range(self.stopping, self.count):
                self.q[k] += self.step * self.v[k]
            self.steps += 1
        for k in range(self.stopping):
            way = self.q[k] - self.place[k]
            if self.speed[k] < 0.0:
                way = -way
            change = self.max_way[k] - 0.5 * self.speed[k] * self.speed[k] / self.hardest[k]
            self.beyond[k] = max(change, 0.0) + self.max_way[k] - way
            self.overrun = max(self.overrun, change)
            self.way_back = max(self.way_back, self.max_way[k] - way)

    @cython.cfunc
    def evaluate(self) -> cython.void:
        """Mass matrix and h = c(q, q̇) + g(q) + friction of the joints that stop."""
        for k in range(self.count):
            i = self.numbers[k]
            self.arm_position[i], self.arm_velocity[i] = self.q[k], self.v[k]
            self.arm_acceleration[i] = 0.0
        self.arm.inverse(1.0)
        for k in range(self.stopping):
            i = self.numbers[k]
            self.bias[k] = self.arm_torque[i] + self.wet[k] * self.v[k]
            if self.v[k] != 0.0:
                self.bias[k] += self.dry[k] if self.v[k] > 0.0 else -self.dry[k]
        for k in range(self.count):
            self.arm_velocity[k] = 0.0
        for c in range(self.stopping):
            i = self.numbers[c]
            self.arm_acceleration[i] = 1.0
            self.arm.inverse(0.0)
            self.arm_acceleration[i] = 0.0
            for k in range(self.stopping):
                i = self.numbers[k]
                self.mass[c * self.count + k] = self.arm_torque[i]

    @cython.cfunc
    def solve(self) -> cython.void:
        """The accelerations of a step, into ``x``: dual coordinate ascent (Hildreth, 1957)."""
        for k in range(self.stopping):
            error = -self.v[k] / self.step
            self.x[k] = self.full[k] = max(min(error, self.wanted[k]), -self.wanted[k])
            error = 1.0 + URGE * max(self.beyond[k], 0.0)
            error *= error * self.urge[k]
            self.ease[k] = 1.0 / (error * (fabs(self.v[k]) / self.hardest[k] + EASE))
        error = self.torque_error()
        if error <= MAX_TORQUE_ERROR:
            for k in range(2 * self.count):
                self.y[k] = 0.0
            return
        self.strained = True
        for k in range(self.stopping):
            if self.v[k] != 0.0:
                self.x[k] += -self.hardest[k] if self.v[k] > 0.0 else self.hardest[k]
            self.allow(k)
        self.warm()
        for _ in range(SWEEPS):
            for k in range(self.stopping):
                self.bound_acceleration(k)
            for k in range(self.stopping):
                self.bound_torque(k)
            error = self.torque_error()
            if error <= MAX_TORQUE_ERROR and self.rest_error() <= MAX_REST_ERROR:
                break
        self.excess = max(self.excess, error)

    @cython.cfunc
    def warm(self) -> cython.void:
        """Start from the multipliers of the step before; with what is the same in all sweeps."""
        for k in range(self.stopping):
            pull = self.y[self.count + k]
            for i in range(self.stopping):
                pull += self.mass[i * self.count + k] * self.y[i]
            self.x[k] -= pull * self.ease[k]
            self.relief[k] = 0.0
            for i in range(self.stopping):
                pull = self.mass[k * self.count + i]
                self.relief[k] += pull * pull * self.ease[i]

    @cython.cfunc
    def torque(self, k: cython.Py_ssize_t) -> cython.double:
        torque: cython.double = self.bias[k]
        for i in range(self.stopping):
            torque += self.mass[k * self.count + i] * self.x[i]
        return torque

    @cython.cfunc
    def torque_error(self) -> cython.double:
        """The greatest torque beyond a limit, as a part of it."""
        excess = 0.0
        for k in range(self.stopping):
            excess = max(excess, fabs(self.torque(k)) / self.limit[k] - 1.0)
        return excess

    @cython.cfunc
    def rests(self, k: cython.Py_ssize_t) -> cython.bint:
        """Whether a joint that may not turn round is at rest, or beyond."""
        speed: cython.double = self.v[k] if self.speed[k] > 0.0 else -self.v[k]
        return self.onward and speed <= RESTING_SHARE * self.step * self.hardest[k]

    @cython.cfunc
    def rest_error(self) -> cython.double:
        """How far joints leave their rest, or turn round, where they may not."""
        most = 0.0
        for k in range(self.stopping if self.onward else 0):
            error: cython.double = self.v[k] + self.step * self.x[k]
            if self.rests(k):
                error = fabs(error)
            elif self.speed[k] > 0.0:
                error = -error
            most = max(most, error / (self.step * self.hardest[k]))
        return most

    @cython.cfunc
    def allow(self, k: cython.Py_ssize_t) -> cython.void:
        """No joint brakes harder than fully, turns round, or leaves its speed limit."""
        self.bottom[k], self.top[k] = -self.hardest[k], self.hardest[k]
        if self.v[k] > 0.0:
            self.bottom[k] = self.full[k]
            self.top[k] = max((self.fastest[k] - self.v[k]) / self.step, 0.0)
        if self.v[k] < 0.0:
            self.bottom[k] = min((-self.fastest[k] - self.v[k]) / self.step, 0.0)
            self.top[k] = self.full[k]
        if self.rests(k):
            self.bottom[k] = self.top[k] = -self.v[k] / self.step

    @cython.cfunc
    def bound_acceleration(self, k: cython.Py_ssize_t) -> cython.void:
        n = self.count + k
        y = self.multiplier(self.y[n], self.x[k], self.bottom[k], self.top[k], self.ease[k])
        self.x[k] -= (y - self.y[n]) * self.ease[k]
        self.y[n] = y

    @cython.cfunc
    def bound_torque(self, k: cython.Py_ssize_t) -> cython.void:
        limit = self.limit[k]
        y = self.multiplier(self.y[k], self.torque(k), -limit, limit, self.relief[k])
        change = y - self.y[k]
        self.y[k] = y
        if change != 0.0:
            for i in range(self.stopping):
                self.x[i] -= change * self.mass[k * self.count + i] * self.ease[i]

    @cython.cfunc
    def multiplier(
        self,
        y: cython.double,
        value: cython.double,
        low: cython.double,
        high: cython.double,
        scale: cython.double,
    ) -> cython.double:
        """The multiplier of low ≤ value ≤ high: positive at the upper, negative at the lower."""
        above = y + (value - high) / scale
        below = y + (value - low) / scale
        if above > 0.0:
            return above
        return below if below < 0.0 else 0.0
