# SPDX-License-Identifier: Apache-2.0
"""The reference of a joint, and what it is made of (SPEC P1 to P6, M9).

reference = trajectory + ∫v dt, or the direct position; the track follows it within the limits.
``advancing`` moves them on by a cycle, ``joint`` starts them. Units: rad, rad/s, s; m for
prismatic joints.
"""

from __future__ import annotations

from math import fabs

from ... import nocython as cython
from .formulas import INFINITE, braking, clamp, row
from .joint_constants import Limits
from .stream import MAX_STREAM_INTERVAL, Stream

#: Places of a move at which its braking is checked against the bounds.
BRAKING_CHECKS = cython.declare(cython.int, 64)


@cython.final
@cython.cclass
class Reference:
    """The reference of a joint within its bounds."""

    position = velocity = cython.declare(cython.double, visibility="public")
    lower = upper = cython.declare(cython.double, visibility="public")  # its bounds
    entry_speed = cython.declare(cython.double, visibility="public")  # from outside limits, rad/s
    active = cython.declare(cython.bint, visibility="public")  # it moves
    comes_to_rest = cython.declare(cython.bint, visibility="public")  # none came since a hold

    def __init__(self) -> None:
        self.lower, self.upper, self.entry_speed = -INFINITE, INFINITE, INFINITE

    @cython.cfunc
    def come_in(self, place: cython.double, limits: Limits) -> cython.void:
        """The bounds of a joint found outside its limits follow it in, not out again (P9, P16)."""
        if self.lower < limits.lower:
            self.lower = clamp(place, self.lower, limits.lower)
        if self.upper > limits.upper:
            self.upper = clamp(place, limits.upper, self.upper)


@cython.final
@cython.cclass
class Track:
    """The followed reference: the reference within all limits (P14)."""

    position = velocity = acceleration = cython.declare(cython.double, visibility="public")


@cython.final
@cython.cclass
class Trajectory:
    """The part of the reference that moves, stops and direct positions set (P1, P6).

    A move is the quintic from velocity v0 to rest::

        q(s) = q0 + v0 T s + (10 R − 6 v0 T) s³ + (8 v0 T − 15 R) s⁴ + (6 R − 3 v0 T) s⁵,  s = t/T

    With a brake time T_b the initial velocity is braked by v0 (1 − 3u² + 2u³), u = t/T_b. Where
    that would pass a limit, it is braked by v0 (1 − u) first, and the quintic takes T − T_b.

    With a jerk limit the acceleration a0 at the start goes on: B = a0 T²/2 adds B (s² − 3s³ + 3s⁴
    − s⁵), in braking a0 T_b u (1 − u)² to the velocity.
    """

    position = velocity = cython.declare(cython.double, visibility="public")
    acceleration = cython.declare(cython.double, visibility="public")  # with a jerk limit
    moving = cython.declare(cython.bint, visibility="public")  # a position move is under way
    start = target = cython.declare(cython.double, visibility="public")
    start_velocity = cython.declare(cython.double, visibility="public")
    start_acceleration = cython.declare(cython.double, visibility="public")  # with a jerk limit
    time = brake_time = cython.declare(cython.double, visibility="public")
    brakes_evenly = cython.declare(cython.bint, visibility="public")  # first, at one rate
    cycles = cython.declare(cython.double, visibility="public")  # past

    @cython.cfunc
    def run(self, elapsed: cython.double, has_jerk: cython.bint) -> cython.void:
        """Position and velocity at a time from the start, s; acceleration with a jerk limit."""
        bend = 0.0
        change = 0.0
        run = 0.0
        way = 0.0
        speed = 0.0
        time = self.time
        reach = self.target - self.start
        if self.brakes_evenly:
            u = elapsed / self.brake_time
            if u < 1.0:
                self.position = self.start + self.start_velocity * elapsed * (1.0 - 0.5 * u)
                self.velocity = self.start_velocity * (1.0 - u)
                self.acceleration = 0.0
                return
            way = 0.5 * self.start_velocity * self.brake_time
            reach -= way
            elapsed -= self.brake_time
            time -= self.brake_time
        elif self.brake_time > 0.0:
            u = elapsed / self.brake_time
            bend = self.start_acceleration * self.brake_time
            way = braking(self.start_velocity, self.start_acceleration, self.brake_time)
            reach -= way
            if u < 1.0:
                way = self.start_velocity * self.brake_time * u * (1.0 + u * u * (0.5 * u - 1.0))
                way += bend * self.brake_time * u * u * (0.5 + u * (0.25 * u - 2.0 / 3.0))
                speed = self.start_velocity * (1.0 + u * u * (2.0 * u - 3.0))
                speed += bend * u * (1.0 - u) * (1.0 - u)
                change = 6.0 * self.start_velocity * u * (u - 1.0) / self.brake_time
                change += self.start_acceleration * (1.0 + u * (3.0 * u - 4.0))
            bend = 0.0
        else:
            run = self.start_velocity * time
            bend = 0.5 * self.start_acceleration * time * time
        s = elapsed / time
        if s >= 1.0:
            self.position, self.velocity = self.start + way + reach, speed
            self.acceleration = change if has_jerk else 0.0
            return
        a = 10.0 * reach - 6.0 * run - 3.0 * bend
        b = 8.0 * run - 15.0 * reach + 3.0 * bend
        c = 6.0 * reach - 3.0 * run - bend
        self.position = self.start + way + s * (run + s * s * (a + s * (b + s * c))) + s * s * bend
        self.velocity = speed + (run + s * s * (3.0 * a + s * (4.0 * b + s * 5.0 * c))) / time
        self.velocity, self.acceleration = self.velocity + 2.0 * s * bend / time, 0.0
        if has_jerk:
            change += (2.0 * bend + s * (6.0 * a + s * (12.0 * b + s * 20.0 * c))) / (time * time)
            self.acceleration = change

    @cython.cfunc
    def begin(
        self,
        start: cython.double,
        target: cython.double,
        time: cython.double,
        brake_time: cython.double,
    ) -> cython.void:
        """Start a move with the present velocity and acceleration.

        Args:
            start: rad.
            target: rad.
            time: Duration T, s.
            brake_time: To brake the present velocity, s; 0: the move starts with it.
        """
        self.position = self.start = start
        self.start_velocity, self.start_acceleration = self.velocity, self.acceleration
        self.target, self.time, self.brake_time = target, time, brake_time
        self.cycles, self.brakes_evenly = 0.0, False

    @cython.cfunc
    def arrive(self) -> cython.void:
        """Rest at the target."""
        self.position, self.velocity, self.acceleration = self.target, 0.0, 0.0

    @cython.cfunc
    def brake(self, time: cython.double) -> cython.void:
        """Stop in a time, s, from the present velocity and acceleration, with bounded jerk."""
        self.start, self.start_velocity = self.position, self.velocity
        self.start_acceleration, self.brakes_evenly = self.acceleration, False
        self.time = self.brake_time = time
        self.target = self.position + braking(self.start_velocity, self.start_acceleration, time)
        self.cycles = 0.0

    @cython.cfunc
    def keep_inside(self, reference: Reference, limits: Limits) -> cython.void:
        """Brake evenly, then move, where braking within the move would pass a limit (P14)."""
        way = 1.0 if self.start_velocity > 0.0 else -1.0
        room = (reference.upper if way > 0.0 else -reference.lower) - way * self.start
        step = (self.time if self.time > self.brake_time else self.brake_time) / BRAKING_CHECKS
        slack = 0.125 * limits.acceleration * step * step
        last = 0.0
        before = 0.0
        speed = self.velocity
        passes: cython.bint = False
        if room <= 0.0 or 0.5 * fabs(speed) * self.brake_time < room:
            return
        for k in range(1, BRAKING_CHECKS + 1):
            self.run(k * step, limits.jerk > 0.0)
            place = way * (self.position - self.start)
            if last >= place and last >= before and last > room - slack:
                passes = True
                break
            before, last = last, place
        self.position, self.velocity = self.start, speed
        self.acceleration = self.start_acceleration
        if passes:
            self.brakes_evenly = True
            self.brake_time = 2.0 * room / fabs(speed)
            self.time += self.brake_time


@cython.final
@cython.cclass
class Stop:
    """Whether and how the reference brakes, to hold where the joint comes to rest (M9, P3)."""

    active = cython.declare(cython.bint, visibility="public")  # until it is at rest
    due = cython.declare(cython.bint, visibility="public")  # still to be planned
    rate = cython.declare(cython.double, visibility="public")  # deceleration, rad/s²
    smooth = cython.declare(cython.bint, visibility="public")  # within the jerk limit
    # its reference is where the joint is to be now, and its acceleration that of the next cycle
    ahead = cython.declare(cython.bint, visibility="public")
    # deceleration of the reference in the cycle before it, rad/s²; 0 where it did not brake
    prior_rate = cython.declare(cython.double, visibility="public")
    renewal_speed = cython.declare(cython.double, visibility="public")  # where it began anew


@cython.final
@cython.cclass
class Plan:
    """Accelerations of a stop or of a direct step, made for several joints together."""

    accelerations: cython.double[::1]  # rad/s²
    steps = cython.declare(cython.int, visibility="public")  # 0: there is no plan
    step = cython.declare(cython.double, visibility="public")  # duration of each, s
    time = cython.declare(cython.double, visibility="public")  # past, s

    def __init__(self) -> None:
        self.accelerations = row(1)

    @cython.cfunc
    def begin(
        self, accelerations: cython.double[::1], steps: cython.int, step: cython.double
    ) -> cython.void:
        """Take a plan: accelerations (rad/s²) of steps (s)."""
        self.accelerations, self.steps, self.step, self.time = accelerations, steps, step, 0.0

    @cython.cfunc
    def place(self) -> cython.int:
        """The number of the present step; there is a plan."""
        return cython.cast(cython.int, self.time / self.step + 1e-9)


@cython.final
@cython.cclass
class Ramp:
    """The velocity reference, and its integral, which is added to the trajectory (P5, Y1)."""

    way = cython.declare(cython.double, visibility="public")  # ∫v dt
    velocity = target = cython.declare(cython.double, visibility="public")
    step = cython.declare(cython.double, visibility="public")  # of v per cycle, rad/s
    is_step = cython.declare(cython.bint, visibility="public")  # a velocity without a ramp

    @cython.cfunc
    def clear(self) -> cython.void:
        """No velocity, and no way by one."""
        self.way = self.velocity = self.target = 0.0


@cython.final
@cython.cclass
class Direct:
    """Direct positions: steps, and samples of a stream (P4)."""

    velocity = cython.declare(cython.double, visibility="public")
    age = cython.declare(cython.double, visibility="public")  # cycles since the last one
    sample_age = cython.declare(cython.double, visibility="public")  # likewise, in any mode
    alone = cython.declare(cython.bint, visibility="public")  # no other came shortly before it
    stepping = cython.declare(cython.bint, visibility="public")  # by a plan
    stream = cython.declare(Stream, visibility="public")
    acceleration = cython.declare(cython.double, visibility="public")  # of the stream, filtered
    peak_acceleration = cython.declare(cython.double, visibility="public")  # of late, decaying

    def __init__(self) -> None:
        self.stream = Stream()
        self.age = self.sample_age = INFINITE
        self.alone = True

    @cython.cfunc
    def note_arrival(self, period: cython.double) -> cython.void:
        """Note that a direct position has come, and whether another came shortly before."""
        self.alone = self.sample_age * period > MAX_STREAM_INTERVAL
        self.sample_age = 0.0

    @cython.cfunc
    def take(
        self,
        position: cython.double,
        velocity: cython.double,
        has_velocity: cython.bint,
        period: cython.double,
        limits: Limits,
    ) -> cython.void:
        """Take a direct position into the stream, rad, with its velocity where it has one."""
        self.stream.take(
            position, velocity, has_velocity, self.age, period, limits.velocity,
            limits.acceleration,
        )  # fmt: skip
        self.velocity, self.age, self.stepping = self.stream.velocity(), 0.0, False

    @cython.cfunc
    def end(self) -> cython.void:
        """Hold a position: no direct one is in force."""
        self.velocity, self.age = 0.0, INFINITE
