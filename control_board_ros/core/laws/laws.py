# SPDX-License-Identifier: Apache-2.0
"""The control laws of a joint.

One joint at a time, in the order of a control cycle:

1. ``observe``    motion of now, from a reading and its age (B7); acceleration and rest, from the
                  last two readings; ``weigh``: the load
2. ``advance``    the reference: moves, velocities, direct positions (P1 to P6), kept within the
                  joint's limits of position, speed and acceleration (P9, P14)
3. ``control``    the law of the mode (source Fig. 2): position PID, impedance, torque PID, output,
                  current
4. ``protect``    bounds every law: speed limit, software limits (P9, P14)
5. ``hand_down``  the set-point of the drive: the output, or one whose loop the drive closes (S1)

Plain Python in Cython's pure mode: compiled where there is a compiler, and the same numbers, bit
by bit, where there is none. Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, Any

try:
    import cython
except ImportError:
    from ... import nocython as cython

from .stopping import Stops

if cython.compiled:
    from cython.cimports.libc.math import ceil, fabs, sqrt
else:
    from math import ceil, fabs, sqrt

if TYPE_CHECKING:
    from ..model.dynamics import Arm

COMPILED = bool(cython.compiled)

#: The laws of source Fig. 2; modes.Law gives them names.
OFF = cython.declare(cython.int, 0)
POSITION = cython.declare(cython.int, 1)
IMPEDANCE = cython.declare(cython.int, 2)
TORQUE = cython.declare(cython.int, 3)
OUTPUT = cython.declare(cython.int, 4)
CURRENT = cython.declare(cython.int, 6)

#: Set-points of drives; drives.SetPoint gives them names.
AS_PWM = cython.declare(cython.int, 1)
AS_CURRENT = cython.declare(cython.int, 2)
AS_TORQUE = cython.declare(cython.int, 3)
AS_VELOCITY = cython.declare(cython.int, 4)
AS_POSITION = cython.declare(cython.int, 5)
AS_IMPEDANCE = cython.declare(cython.int, 6)

#: Longest mean interval, s, at which direct positions become a stream, and at which they remain
#: one; half of the intervals' mean deviation is added. Slower ones are steps.
SLOWEST = cython.declare(cython.double, 0.052)
SLOWER = cython.declare(cython.double, 0.060)
#: Age at which a direct position ends its stream, s: five intervals at 20 Hz.
LAST = cython.declare(cython.double, 0.25)
#: Shortest interval of a stream that the tracking assumes, s.
BRIEF = cython.declare(cython.double, 0.008)
#: Samples that a motion is fitted to, and their least distance, s.
KNOTS = cython.declare(cython.int, 6)
APART = cython.declare(cython.double, 0.012)
#: Interval above which jitter does not hide the curvature of a motion, s.
SLOW = cython.declare(cython.double, 0.025)
#: Memory of the interval; of the curvature; of residuals; in samples.
MEMORY = cython.declare(cython.double, 100.0)
BRIEF_MEMORY = cython.declare(cython.double, 12.0)
RESIDUAL_MEMORY = cython.declare(cython.double, 6.0)
#: Largest square of an error in residuals, in mean squares so far.
OUTLIER = cython.declare(cython.double, 4.0)
#: Weight of the residual against what samples tell of the curvature.
DOUBT = cython.declare(cython.double, 1e-4)
#: Last arrivals that tell the phase of a grid, and after how many their numbers are checked.
ARRIVALS = cython.declare(cython.int, 32)
CHECKED = cython.declare(cython.int, 16)
#: Error of a prediction, squared, in those of one interval, that makes numbers doubtful.
DOUBTFUL = cython.declare(cython.double, 0.05)
#: What another numbering of the arrivals must improve, in mean squares of what it leaves.
RENUMBER = cython.declare(cython.double, 35.0)
#: Cost of a sample taken for lost, with that of the first ones over their number; maximum costs
#: of the arrival and of the value; all in squares of standard deviations.
LOSS = cython.declare(cython.double, 3.0)
EARLY_LOSS = cython.declare(cython.double, 100.0)
MOST_OF_ARRIVAL = cython.declare(cython.double, 40.0)
MOST_OF_VALUE = cython.declare(cython.double, 60.0)
#: Direct positions nearer than what a joint accelerates through in this time, s, have no plan.
SHORT_STEP = cython.declare(cython.double, 0.02)
#: Natural frequency of the tracking of a stream: maximum, rad/s; its product with the interval.
QUICKEST = cython.declare(cython.double, 60.0)
QUICK = cython.declare(cython.double, 1.2)
#: A joint is at rest below this part of its speed limit, and of its torque limit in acceleration.
REST_SPEED = cython.declare(cython.double, 2e-3)
REST_TORQUE = cython.declare(cython.double, 5e-3)
#: Time at rest after which the load is known, s; time constant of the load's filter, s.
REST_TIME = cython.declare(cython.double, 0.03)
LOAD_FILTER = cython.declare(cython.double, 0.01)
#: Time to measure the load, s: minimum where a reference waits for it, maximum.
SETTLE_LEAST = cython.declare(cython.double, 0.05)
SETTLE_MOST = cython.declare(cython.double, 0.5)
#: Maximum time that a joint at rest waits for others that still brake, s.
OTHERS_MOST = cython.declare(cython.double, 3.0)
#: Time beyond the torque limit in a position mode after which the log reports it, s.
STRAIN_TIME = cython.declare(cython.double, 0.05)
#: Largest holding torque in TORQUE before the first reference, as a part of the torque limit.
HOLD_SHARE = cython.declare(cython.double, 0.1)
#: Likewise of a joint without stiffness under gravity compensation: covers errors of sensors and
#: masses.
REST_SHARE = cython.declare(cython.double, 0.01)
INFINITE = cython.declare(cython.double, 1e300)
#: Distance above which no braking is needed, rad or m.
FAR = cython.declare(cython.double, 1e9)
#: Periods within which the protection reduces the speed to what is allowed.
SPAN = cython.declare(cython.double, 3.0)
#: Time constant of the return from beyond a limit, s.
RETURN = cython.declare(cython.double, 0.1)
#: Part of the acceleration limit with which the protection brakes ahead of a limit.
BRAKING = cython.declare(cython.double, 0.7)
#: Inertia that the protection assumes: LIGHT × the least where torque grows; HEAVY × the mean
#: where torque is reduced, at most WIDE × the former.
LIGHT = cython.declare(cython.double, 0.7)
HEAVY = cython.declare(cython.double, 2.0)
WIDE = cython.declare(cython.double, 4.0)
#: Largest lead of the followed reference over the joint, in errors worth the torque limit.
LEAD = cython.declare(cython.double, 1.0)
#: Outputs above this, and NaN, are a divergence, percent.
MOST_OUTPUT = cython.declare(cython.double, 1e3)
#: Periods without a fresh reading, and between two cycles, from which on a joint coasts, and its
#: reference begins anew from where the joint is (B6, B7).
GAP = cython.declare(cython.double, 3.0)
#: Cycles over which what the feed-forward accelerated is kept, a power of two: as far as the
#: motion of an old reading is continued.
FED = cython.declare(cython.int, 64)
#: Memory of the age of readings, s, and the phase that it may cost the velocity loop, rad.
WIRE_MEMORY = cython.declare(cython.double, 0.5)
WIRE_PHASE = cython.declare(cython.double, 0.2)
#: Time over which braking fades out on a wire, in ages of late readings; at most, s.
FADE_AGES = cython.declare(cython.double, 8.0)
FADE_MOST = cython.declare(cython.double, 0.08)
#: Bandwidth of a position loop over that of the velocity loop in it, where late readings slow it.
SEPARATION = cython.declare(cython.double, 0.25)
#: Time constant of the feedback that a coasting joint keeps, s.
HOLD_FILTER = cython.declare(cython.double, 0.03)
#: Part of the torque limit that the error of a reference may be worth after a gap.
GAP_SHARE = cython.declare(cython.double, 0.05)
#: Way of a goal that gives way over which the load taken over fades, in hystereses of the limit
#: warning (1°, 1 mm); speed, as a part of the limit, up to which a drive's sag is that at rest.
FADING = cython.declare(cython.double, 3.0)
SAGGING = cython.declare(cython.double, 0.05)
#: Speed bound of the position law, in speed limits: headroom for references at the limit.
PURSUIT = cython.declare(cython.double, 1.02)


@cython.final
@cython.cclass
class Pid:
    """A PID with feed-forward, a bounded integral and a filtered rate.

    u = kff·r + kp·e + I + kd·D;   I += ki·e·T, |I| ≤ limit;   D += alpha·(rate − D)

    An integral beyond a new, smaller limit has ``room`` above it, which shrinks by ``fall`` per
    cycle.
    """

    kp = cython.declare(cython.double, visibility="public")
    ki_period = cython.declare(cython.double, visibility="public")
    kd = cython.declare(cython.double, visibility="public")
    kff = cython.declare(cython.double, visibility="public")
    limit = cython.declare(cython.double, visibility="public")
    room = cython.declare(cython.double, visibility="public")
    fall = cython.declare(cython.double, visibility="public")
    alpha = cython.declare(cython.double, visibility="public")
    integral = cython.declare(cython.double, visibility="public")
    derivative = cython.declare(cython.double, visibility="public")
    previous = cython.declare(cython.double, visibility="public")
    error = cython.declare(cython.double, visibility="public")
    reference = cython.declare(cython.double, visibility="public")

    def __init__(self) -> None:
        self.kp = self.ki_period = self.kd = self.kff = self.limit = self.fall = self.alpha = 0.0
        self.reset(0.0)

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
@cython.inline
def clamp(value: cython.double, low: cython.double, high: cython.double) -> cython.double:
    """``value`` within ``low`` to ``high``; NaN passes."""
    if value < low:
        return low
    if value > high:
        return high
    return value


@cython.cfunc
def brake_speed(
    distance: cython.double, acceleration: cython.double, period: cython.double
) -> cython.double:
    """The greatest speed from which braking in whole cycles ends within a distance.

    d = k v T − a T² k(k − 1)/2: k cycles, each slower by a·T, with the least k that ends at rest.
    """
    cycles: cython.double
    if distance <= 0.0:
        return 0.0
    if distance > FAR:  # no limit is known
        return FAR
    cycles = ceil(0.5 * (sqrt(1.0 + 8.0 * distance / (acceleration * period * period)) - 1.0))
    cycles = max(cycles, 1.0)
    return distance / (cycles * period) + 0.5 * acceleration * period * (cycles - 1.0)


@cython.final
@cython.cclass
class TimeBase:
    """The last samples of a stream, at the times of one hypothesis on when they were made (P4).

    Motion: x + v S(t) + a C(t), S = sin(ωt)/ω, C = (1 − cos ωt)/ω², t from the last sample: a
    parabola whose acceleration turns with ω² = −jerk/velocity, fitted by least squares; ω² by a
    step of Gauss and Newton per sample.
    """

    times: cython.double[::1]
    turned = cython.declare(cython.double, visibility="public")  # Σ of ω² and its weight
    run = cython.declare(cython.double, visibility="public")  # Σ of the weights
    turning = cython.declare(cython.double, visibility="public")  # ω²
    ss = cython.declare(cython.double, visibility="public")  # sums of the fit
    cc = cython.declare(cython.double, visibility="public")
    sc = cython.declare(cython.double, visibility="public")
    s1 = cython.declare(cython.double, visibility="public")
    c1 = cython.declare(cython.double, visibility="public")
    x = cython.declare(cython.double, visibility="public")
    v = cython.declare(cython.double, visibility="public")
    a = cython.declare(cython.double, visibility="public")
    residual = cython.declare(cython.double, visibility="public")  # mean square, of predictions

    def __init__(self) -> None:
        self.times = memoryview(array("d", [0.0] * KNOTS))
        self.clear(0.0, 0.0)

    @cython.cfunc
    def clear(self, x: cython.double, v: cython.double) -> cython.void:
        """Restart with one sample."""
        self.times[0] = 0.0
        self.turned = self.run = self.turning = self.residual = self.a = 0.0
        self.x, self.v = x, v

    @cython.cfunc
    def at(self, time: cython.double) -> cython.double:
        """The position ``time`` s after the last sample."""
        return self.x + self.v * sine(self.turning, time) + self.a * versine(self.turning, time)

    @cython.cfunc
    def judge(self, error: cython.double, share: cython.double) -> cython.void:
        """Note the error of a prediction; a single outlier says little."""
        error *= error
        if self.residual > 0.0 and share < 0.5:
            error = min(error, OUTLIER * self.residual)
        self.residual += share * (error - self.residual)

    @cython.cfunc
    def speed_up(
        self, before: cython.double, time: cython.double, most: cython.double
    ) -> cython.void:
        """The acceleration from the velocity ``time`` s ago to the present one.

        A velocity of exactly 0 is rest: the motion ends there.
        """
        if self.v == 0.0:
            self.a = 0.0
            return
        if self.turning * time * time > 3.0:
            self.turning = 0.0
        before = self.v * (1.0 - self.turning * versine(self.turning, time)) - before
        self.a = clamp(before / sine(self.turning, time), -most, most)

    @cython.cfunc
    def fit(
        self,
        values: cython.double[::1],
        knots: cython.int,
        max_acceleration: cython.double,
        share: cython.double,
    ) -> cython.void:
        """Position, velocity and acceleration at the last sample, by least squares; then ω².

        Args:
            values: of the samples, rad.
            knots: how many there are.
            max_acceleration: rad/s².
            share: of this fit in ω²; 0: it has been taken in already.
        """
        k: cython.int
        t: cython.double
        y: cython.double
        s: cython.double
        c: cython.double
        n: cython.double = 1.0 / knots  # about the means
        ss: cython.double = 0.0
        cc: cython.double = 0.0
        sc: cython.double = 0.0
        s1: cython.double = 0.0
        c1: cython.double = 0.0
        y1: cython.double = 0.0
        ys: cython.double = 0.0
        yc: cython.double = 0.0
        span: cython.double = -self.times[knots - 1]
        self.x, self.a = values[0], 0.0
        if span <= 0.0:
            return
        scale: cython.double = 1.0 / span
        for k in range(knots):
            t = self.times[k]
            y = values[k] - values[0]
            s = sine(self.turning, t) * scale
            c = versine(self.turning, t) * scale * scale
            s1 += s
            c1 += c
            y1 += y
            ss += s * s
            sc += s * c
            cc += c * c
            ys += y * s
            yc += y * c
        ss -= s1 * s1 * n
        sc -= s1 * c1 * n
        cc -= c1 * c1 * n
        ys -= y1 * s1 * n
        yc -= y1 * c1 * n
        whole: cython.double = ss * cc - sc * sc
        if knots < 3 or whole < 1e-9:
            self.v = (values[0] - values[knots - 1]) * scale
            return
        s = (ys * cc - yc * sc) / whole
        c = (yc * ss - ys * sc) / whole
        self.x = values[0] + (y1 - s * s1 - c * c1) * n
        self.v, self.a = s * scale, c * scale * scale
        if fabs(self.a) > 1.5 * max_acceleration:  # the joint cannot move like this
            self.x, self.a = values[0], 0.0
            self.v = (values[0] - values[1]) / -self.times[1] if self.times[1] < 0.0 else 0.0
        elif share > 0.0 and knots > 3:
            self.ss, self.cc, self.sc, self.s1, self.c1 = ss, cc, sc, s1, c1
            self.curve(values, knots, share, scale)

    @cython.cfunc
    def curve(
        self,
        values: cython.double[::1],
        knots: cython.int,
        share: cython.double,
        scale: cython.double,
    ) -> cython.void:
        """ω² from what the fit leaves: Δω² = Σ g e / Σ g², with fading memory.

        e: value less fit; g: the derivative of the motion by ω², less what the fit makes up for.
        Where errors of predictions are large, ω² tends to 0.
        """
        k: cython.int
        t: cython.double
        z: cython.double
        d: cython.double
        d1: cython.double = 0.0
        ds: cython.double = 0.0
        dc: cython.double = 0.0
        gg: cython.double = 0.0
        ge: cython.double = 0.0
        for k in range(knots):
            t = self.times[k]
            z = self.turning * t * t
            d = 0.25 * self.a * t * (1.0 - z / 15.0 * (1.0 - 3.0 * z / 112.0))
            d += self.v * (1.0 - z / 10.0 * (1.0 - z / 28.0))
            d *= -t * t * t / 6.0
            d1 += d
            ds += d * sine(self.turning, t) * scale
            dc += d * versine(self.turning, t) * scale * scale
            gg += d * d
            ge += d * (values[k] - self.at(t))
        ds -= d1 * self.s1 / knots
        dc -= d1 * self.c1 / knots
        gg -= d1 * d1 / knots
        z = self.ss * self.cc - self.sc * self.sc
        gg -= (ds * ds * self.cc - 2.0 * ds * dc * self.sc + dc * dc * self.ss) / z
        gg = max(gg, 0.0)
        self.turned = (1.0 - share) * self.turned + ge + gg * self.turning
        self.run = (1.0 - share) * self.run + gg
        z = self.run + DOUBT * self.residual
        t = 3.0 * scale
        self.turning = clamp(self.turned / z, 0.0, t * t) if z > 0.0 else 0.0


@cython.cfunc
@cython.inline
def sine(turning: cython.double, t: cython.double) -> cython.double:
    """sin(ωt)/ω as a series of ω²; t where ω is zero."""
    z: cython.double = turning * t * t
    return t * (1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0)))


@cython.cfunc
@cython.inline
def versine(turning: cython.double, t: cython.double) -> cython.double:
    """(1 − cos ωt)/ω² as a series of ω²; t²/2 where ω is zero."""
    z: cython.double = turning * t * t
    return 0.5 * t * t * (1.0 - z / 12.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0)))


@cython.final
@cython.cclass
class Stream:
    """A stream of direct positions: samples of a motion (P4).

    Two hypotheses on the time of a sample: on an even grid, received late (``grid``), or at its
    arrival (``sent``). The one that predicts the next sample better applies. Interval and phase of
    the grid: regression of the arrivals over their numbers, and the earliest of them; arrival and
    value tell how many samples are lost before one, and later ones correct that.
    """

    values: cython.double[::1]
    numbers: cython.double[::1]  # intervals before the last sample
    arrivals: cython.double[::1]  # since the last sample, s
    places: cython.double[::1]  # intervals before the last sample, of arrivals
    heard = cython.declare(cython.int, visibility="public")  # arrivals
    grid = cython.declare(TimeBase, visibility="public")
    sent = cython.declare(TimeBase, visibility="public")
    count = cython.declare(cython.double, visibility="public")  # samples
    knots = cython.declare(cython.int, visibility="public")
    pushed = cython.declare(cython.double, visibility="public")  # knots so far
    last = cython.declare(cython.double, visibility="public")
    last_velocity = cython.declare(cython.double, visibility="public")  # where given
    interval = cython.declare(cython.double, visibility="public")  # s
    early = cython.declare(cython.double, visibility="public")  # envelope before last arrival, s
    late = cython.declare(cython.double, visibility="public")  # of the last sample, s
    uneven = cython.declare(cython.double, visibility="public")  # mean deviation of intervals, s
    gap = cython.declare(cython.double, visibility="public")  # the longest of late, s
    weight = cython.declare(cython.double, visibility="public")  # sums of the regression
    sum_k = cython.declare(cython.double, visibility="public")
    sum_t = cython.declare(cython.double, visibility="public")
    sum_kk = cython.declare(cython.double, visibility="public")
    sum_kt = cython.declare(cython.double, visibility="public")
    missing = cython.declare(cython.double, visibility="public")  # samples lost per sample
    share = cython.declare(cython.double, visibility="public")  # of the last sample in ω²
    mean = cython.declare(cython.double, visibility="public")  # time between samples, s
    latest = cython.declare(cython.double, visibility="public")  # most of lateness, s
    pace = cython.declare(cython.double, visibility="public")  # mean square of velocities
    surprise = cython.declare(cython.double, visibility="public")  # of values, of late
    on_grid = cython.declare(cython.bint, visibility="public")
    flows = cython.declare(cython.bint, visibility="public")  # fast enough

    def __init__(self) -> None:
        self.values = memoryview(array("d", [0.0] * KNOTS))
        self.numbers = memoryview(array("d", [0.0] * KNOTS))
        self.arrivals = memoryview(array("d", [0.0] * ARRIVALS))
        self.places = memoryview(array("d", [0.0] * ARRIVALS))
        self.grid, self.sent = TimeBase(), TimeBase()
        self.count = 0.0

    @cython.cfunc
    def take(
        self,
        x: cython.double,
        velocity: cython.double,
        given: cython.bint,
        age: cython.double,
        period: cython.double,
        max_velocity: cython.double,
        max_acceleration: cython.double,
    ) -> cython.void:
        """Add a sample.

        Args:
            x: rad.
            velocity: rad/s; ignored unless ``given``.
            given: whether the sample has a velocity.
            age: of the last sample, control cycles.
            period: of control, s.
            max_velocity: rad/s; a faster difference is a step.
            max_acceleration: rad/s².
        """
        m: cython.double
        reach: cython.double
        d: cython.double = age * period
        if self.count == 0.0 or d > LAST or d > 5.0 * self.interval > 0.0:
            self.count = 0.0
        elif self.count == 1.0:
            reach = max_velocity * d
        else:
            reach = max_velocity * (d + self.late + 0.5 * self.interval)
        if self.count > 0.0 and fabs(x - self.last) > reach:
            self.count = 0.0  # a step
        if self.count == 0.0:
            self.begin(x, velocity if given else 0.0, given)
            return
        self.count += 1.0
        m = self.clock(x, d, period)
        self.keep(x, d, m)
        self.grid.fit(self.values, self.knots, max_acceleration, self.share)
        if self.interval > 1.5 * period:
            few: cython.bint = self.knots > 5 and 0.015 < self.interval < SLOW
            self.sent.fit(self.values, 5 if few else self.knots, max_acceleration, self.share)
        if given:
            self.take_velocity(velocity, d, m, max_acceleration)
        self.last, self.last_velocity = x, velocity
        reach = SLOWER if self.flows else SLOWEST
        reach += 0.5 * self.uneven
        self.flows = self.interval < reach and (given or self.count > 2.0)  # two may be two steps

    @cython.cfunc
    def begin(self, x: cython.double, velocity: cython.double, given: cython.bint) -> cython.void:
        """Start with one sample."""
        self.count, self.knots, self.pushed, self.weight = 1.0, 1, 0.0, 1.0
        self.values[0], self.numbers[0] = x, 0.0
        self.grid.clear(x, velocity)
        self.sent.clear(x, velocity)
        self.last, self.last_velocity = x, velocity
        self.interval = self.early = self.late = self.uneven = self.gap = self.missing = 0.0
        self.sum_k = self.sum_t = self.sum_kk = self.sum_kt = self.mean = self.latest = 0.0
        self.pace = self.surprise = 0.0
        self.heard = 1
        self.on_grid = True
        self.flows = given

    @cython.cfunc
    def clock(self, x: cython.double, d: cython.double, period: cython.double) -> cython.double:
        """Update interval, lateness and time base after ``d`` s; ``d`` in intervals."""
        m: cython.double = self.intervals(x, d) if self.count > 2.0 else 1.0
        share: cython.double
        n: cython.double = self.count
        self.missing += 0.05 * (m - 1.0 - self.missing)
        self.mean += (d - self.mean) / (n - 1.0 if n < 20.0 else 20.0)
        if n > 20.0 and self.missing > (0.15 if self.surprise > DOUBTFUL else 0.25):
            # none is lost: the interval is longer
            self.missing = self.sum_k = self.sum_t = 0.0
            self.sum_kk, self.sum_kt = 20.0, 20.0 * self.mean
            self.weight, self.count, n, m = 1.0, 8.0, 8.0, 1.0
        fade: cython.double = 1.0 - 1.0 / MEMORY
        self.sum_kt += m * d * self.weight - d * self.sum_k - m * self.sum_t
        self.sum_kk += m * m * self.weight - 2.0 * m * self.sum_k
        self.sum_k -= m * self.weight
        self.sum_t -= d * self.weight
        self.sum_kt *= fade
        self.sum_kk *= fade
        self.sum_k *= fade
        self.sum_t *= fade
        self.weight = fade * self.weight + 1.0
        self.find_interval(period)
        self.gap = max(d, 0.99 * self.gap)
        share = n - 1.0 if n < 21.0 else 20.0
        self.uneven += (fabs(d - m * self.interval) - self.uneven) / share
        self.settle_phase(d, m, period)
        error: cython.double = x - self.grid.at(m * self.interval)
        self.pace += (self.grid.v * self.grid.v - self.pace) / (n if n < 12.0 else 12.0)
        self.surprise *= 1.0 - 2.0 / ARRIVALS
        if n > 6.0 and self.pace > 0.0:
            error *= error
            error /= self.interval * self.interval * self.pace
            self.surprise = max(self.surprise, min(error, 1.0))
        if n > 4.0:
            share = n - 4.0 if n < 4.0 + RESIDUAL_MEMORY else RESIDUAL_MEMORY
            self.grid.judge(x - self.grid.at(m * self.interval), 1.0 / share)
            self.sent.judge(x - self.sent.at(d), 1.0 / share)
            self.on_grid = self.interval <= 1.5 * period or self.grid.residual <= (
                self.sent.residual * (0.5 if not self.on_grid else 1.0)
            )
        return m

    @cython.cfunc
    def settle_phase(
        self, d: cython.double, m: cython.double, period: cython.double
    ) -> cython.void:
        """Lateness of the last sample; the earliest of the last ARRIVALS is in time."""
        k: cython.int
        late: cython.double
        latest: cython.double = 0.0
        if self.heard < ARRIVALS:
            self.heard += 1
        for k in range(self.heard - 1, 0, -1):
            self.arrivals[k] = self.arrivals[k - 1] - d
            self.places[k] = self.places[k - 1] + m
        if self.heard >= CHECKED and self.surprise > DOUBTFUL:
            self.renumber(d, period)
        self.early = 0.0
        for k in range(1, self.heard):
            late = self.arrivals[k] + self.places[k] * self.interval
            self.early = min(self.early, late)
            latest = max(latest, late)
        self.late = 0.1 * self.uneven - self.early
        self.latest = latest - self.early
        self.latest = min(self.latest, 0.8 * self.interval)

    @cython.cfunc
    def renumber(self, d: cython.double, period: cython.double) -> cython.void:
        """Find a loss that was not seen, or seen where none was, in the last arrivals.

        Their regression over the numbers is compared with those where a gap is longer or shorter
        by one interval.
        """
        k: cython.int
        n: cython.int = self.heard
        x: cython.double
        sum_x: cython.double = 0.0
        sum_y: cython.double = 0.0
        xx: cython.double = 0.0
        xy: cython.double = 0.0
        yy: cython.double = 0.0
        for k in range(n):
            x = -self.places[k]
            sum_x += x
            sum_y += self.arrivals[k]
            xx += x * x
            xy += x * self.arrivals[k]
            yy += self.arrivals[k] * self.arrivals[k]
        yy -= sum_y * sum_y / n
        least: cython.double = self.left_over(n, sum_x, sum_y, xx, xy, yy)
        before: cython.double = least
        best: cython.int = 0
        change: cython.double = 0.0
        tail_n: cython.double = 0.0
        tail_x: cython.double = 0.0
        tail_y: cython.double = 0.0
        left: cython.double
        for k in range(n - 1, 0, -1):
            tail_n += 1.0
            tail_x -= self.places[k]
            tail_y += self.arrivals[k]
            left = self.left_over(
                n, sum_x - tail_n, sum_y, xx - 2.0 * tail_x + tail_n, xy - tail_y, yy
            )
            if left < least:
                least, best, change = left, k, 1.0
            if self.places[k] - self.places[k - 1] < 1.5:
                continue
            left = self.left_over(
                n, sum_x + tail_n, sum_y, xx + 2.0 * tail_x + tail_n, xy + tail_y, yy
            )
            if left < least:
                least, best, change = left, k, -1.0
        if best == 0 or n * (before - least) <= RENUMBER * (least + 0.1 * n * period * period):
            return
        for k in range(self.knots):
            if self.sent.times[k] - d <= self.arrivals[best]:
                self.numbers[k] -= change
        self.missing += 0.05 * change
        self.surprise = 0.0
        self.weight = self.sum_k = self.sum_t = self.sum_kk = self.sum_kt = 0.0
        for k in range(n):
            if k >= best:
                self.places[k] += change
            self.weight += 1.0
            self.sum_k -= self.places[k]
            self.sum_t += self.arrivals[k]
            self.sum_kk += self.places[k] * self.places[k]
            self.sum_kt -= self.places[k] * self.arrivals[k]
        self.find_interval(period)

    @cython.cfunc
    def left_over(
        self,
        n: cython.double,
        sum_x: cython.double,
        sum_y: cython.double,
        xx: cython.double,
        xy: cython.double,
        yy: cython.double,
    ) -> cython.double:
        """What a regression leaves, s²; ``yy`` is about the mean."""
        xx -= sum_x * sum_x / n
        xy -= sum_x * sum_y / n
        return yy - xy * xy / xx

    @cython.cfunc
    def find_interval(self, period: cython.double) -> cython.void:
        """The slope of the regression."""
        self.interval = (self.weight * self.sum_kt - self.sum_k * self.sum_t) / (
            self.weight * self.sum_kk - self.sum_k * self.sum_k
        )
        self.interval = max(self.interval, 0.25 * period)

    @cython.cfunc
    def intervals(self, x: cython.double, d: cython.double) -> cython.double:
        """Intervals between the last sample and this one: 1, or more where samples are lost.

        The least of Σ (error/deviation)²: arrival beyond what is usual, value off the motion, and
        what each loss costs, which is rare.
        """
        k: cython.int
        cost: cython.double
        error: cython.double
        m: cython.double = 1.0
        least: cython.double = INFINITE
        interval: cython.double = self.interval
        if self.count < 7.0 and d < 2.2 * interval:
            return m
        loss: cython.double = LOSS + EARLY_LOSS / self.count
        width: cython.double = 0.1 * interval + 8.0 * self.uneven / self.count
        step: cython.double = 0.1 * interval * self.grid.v
        spread: cython.double = self.grid.residual + step * step
        for k in range(1, 7):
            cost = loss * (k - 1)
            error = self.late + d - k * interval
            if error > 0.0:
                error = max(error - self.latest, 0.0)
            error /= width
            error *= error
            cost += min(error, MOST_OF_ARRIVAL)
            if self.count > 7.0 and spread > 0.0:
                error = x - self.grid.at(k * interval)
                error *= error / spread
                cost += min(error, MOST_OF_VALUE)
            if cost < least:
                m, least = k, cost
        return m

    @cython.cfunc
    def keep(self, x: cython.double, d: cython.double, m: cython.double) -> cython.void:
        """Store a sample; it replaces the last one where that one is close to its predecessor."""
        k: cython.int
        first: cython.double
        grid: cython.double[::1] = self.grid.times
        sent: cython.double[::1] = self.sent.times
        self.share = 0.0
        apart: cython.double = 0.6 * self.interval
        apart = max(apart, APART)
        for k in range(self.knots):
            self.numbers[k] -= m
            grid[k] = self.numbers[k] * self.interval
            sent[k] -= d
        if self.knots > 1 and -sent[1] < apart and (-grid[1] < apart or not self.on_grid):
            grid[0] = sent[0] = self.numbers[0] = 0.0
            self.values[0] = x
            return
        if self.knots < KNOTS:
            self.knots += 1
        for k in range(self.knots - 1, 0, -1):
            grid[k], sent[k], self.values[k] = grid[k - 1], sent[k - 1], self.values[k - 1]
            self.numbers[k] = self.numbers[k - 1]
        grid[0] = sent[0] = self.numbers[0] = 0.0
        self.values[0] = x
        self.pushed += 1.0
        first = 0.5 * self.pushed + 1.0
        self.share = 1.0 / (first if first < BRIEF_MEMORY else BRIEF_MEMORY)

    @cython.cfunc
    def take_velocity(
        self,
        velocity: cython.double,
        d: cython.double,
        m: cython.double,
        max_acceleration: cython.double,
    ) -> cython.void:
        """The motion of samples with velocities; acceleration from the last two."""
        self.grid.x = self.sent.x = self.values[0]
        self.grid.v = self.sent.v = velocity
        self.grid.speed_up(self.last_velocity, m * self.interval, max_acceleration)
        self.sent.speed_up(self.last_velocity, d if d > 0.0 else self.interval, max_acceleration)

    @cython.cfunc
    def patience(self) -> cython.double:
        """Time after its last sample at which a stream ends, s.

        1.5 intervals of an even stream; an uneven one ends when three samples are missing.
        """
        least: cython.double = 1.5 * (self.interval if self.interval > BRIEF else BRIEF)
        longest: cython.double = 1.2 * self.gap
        if self.uneven > 0.1 * self.interval:
            longest = self.interval + 3.5 * self.uneven
            longest = 1.1 * (longest if longest > self.gap else self.gap) + 2.0 * self.interval
        return longest if longest > least else least

    @cython.cfunc
    def velocity(self) -> cython.double:
        """Velocity of the motion at the last sample, rad/s; 0 for a step."""
        if not self.flows:
            return 0.0
        return self.grid.v if self.on_grid else self.sent.v


@cython.final
@cython.cclass
class Joint:
    """State and constants of one joint; ``core.control`` sets the constants."""

    # --- constants of the configuration -----------------------------------------------------
    period = cython.declare(cython.double, visibility="public")
    limit_lower = cython.declare(cython.double, visibility="public")
    limit_upper = cython.declare(cython.double, visibility="public")
    limit_edge = cython.declare(cython.double, visibility="public")  # hysteresis of on_limit
    max_velocity = cython.declare(cython.double, visibility="public")
    max_acceleration = cython.declare(cython.double, visibility="public")
    max_jerk = cython.declare(cython.double, visibility="public")  # of moves and stops; 0: none
    max_torque = cython.declare(cython.double, visibility="public")
    max_output = cython.declare(cython.double, visibility="public")  # PWM, percent
    max_drive = cython.declare(cython.double, visibility="public")  # PWM or A, as the laws give
    inertia_min = cython.declare(cython.double, visibility="public")
    inertia = cython.declare(cython.double, visibility="public")
    # friction of motion in positive and in negative direction, N·m, N·m·s/rad, and the speed
    # from which on the dry part is whole, rad/s
    coulomb = cython.declare(cython.double, visibility="public")
    coulomb_negative = cython.declare(cython.double, visibility="public")
    viscous = cython.declare(cython.double, visibility="public")
    viscous_negative = cython.declare(cython.double, visibility="public")
    slip = cython.declare(cython.double, visibility="public")
    torque_per_ampere = cython.declare(cython.double, visibility="public")
    has_torque_sensor = cython.declare(cython.bint, visibility="public")
    per_torque = cython.declare(cython.double, visibility="public")  # drive per N·m
    per_speed = cython.declare(cython.double, visibility="public")  # drive per rad/s: back-EMF
    compensation = cython.declare(cython.double, visibility="public")  # compensated part of it
    per_feed = cython.declare(cython.double, visibility="public")  # drive per percent of u_ff
    in_amps = cython.declare(cython.bint, visibility="public")  # drive is a current
    kind = cython.declare(cython.int, visibility="public")  # the drive's set-point: AS_...
    delay = cython.declare(cython.double, visibility="public")  # of the drive, beyond a period, s
    pursuit = cython.declare(cython.double, visibility="public")  # velocity per error, 1/s
    ohms = cython.declare(cython.double, visibility="public")
    emf = cython.declare(cython.double, visibility="public")  # V·s/rad
    percent_per_volt = cython.declare(cython.double, visibility="public")
    lead = cython.declare(cython.double, visibility="public")  # a/(1 − a), a = exp(−T R/L)
    lag = cython.declare(cython.double, visibility="public")  # L/(T R) − a/(1 − a)

    external_share = cython.declare(cython.double, visibility="public")  # of a cycle; 0: off
    contact_threshold = cython.declare(cython.double, visibility="public")  # N·m; 0: none
    contact_time = cython.declare(cython.double, visibility="public")  # s
    # of a goal that gives way: torque that it is stiff below, N·m, 0: none does; share of the load
    # on top; least damping; share of a cycle in the torque felt
    dead_band = cython.declare(cython.double, visibility="public")
    load_share = cython.declare(cython.double, visibility="public")
    min_damping = cython.declare(cython.double, visibility="public")
    felt_share = cython.declare(cython.double, visibility="public")

    # --- what users and modes set -----------------------------------------------------------
    law = cython.declare(cython.int, visibility="public")
    calibrated = cython.declare(cython.bint, visibility="public")  # limits are known
    feeds = cython.declare(cython.bint, visibility="public")  # u_ff acts
    compensates = cython.declare(cython.bint, visibility="public")  # gravity's torque is added
    braked = cython.declare(cython.bint, visibility="public")  # its law waits for the brake (Y4)
    position_pid = cython.declare(Pid, visibility="public")
    torque_pid = cython.declare(Pid, visibility="public")
    current_pid = cython.declare(Pid, visibility="public")
    stiffness = cython.declare(cython.double, visibility="public")
    damping = cython.declare(cython.double, visibility="public")
    torque_offset = cython.declare(cython.double, visibility="public")  # τ_ff
    offset_given = cython.declare(cython.bint, visibility="public")  # by a user
    load_taken = cython.declare(cython.double, visibility="public")  # at the start of the law
    torque_command = cython.declare(cython.double, visibility="public")
    output_command = cython.declare(cython.double, visibility="public")
    current_command = cython.declare(cython.double, visibility="public")  # A
    output_offset = cython.declare(cython.double, visibility="public")  # u_ff, percent

    # --- reference --------------------------------------------------------------------------
    lower = cython.declare(cython.double, visibility="public")  # bounds of the reference
    upper = cython.declare(cython.double, visibility="public")
    entry_speed = cython.declare(cython.double, visibility="public")  # from outside limits, rad/s
    active = cython.declare(cython.bint, visibility="public")  # the reference moves
    moving = cython.declare(cython.bint, visibility="public")  # a position move is under way
    stopping = cython.declare(cython.bint, visibility="public")  # it brakes, and holds at rest
    stop_due = cython.declare(cython.bint, visibility="public")  # its stop is still to be planned
    stop_rate = cython.declare(cython.double, visibility="public")  # deceleration, rad/s²
    stepping = cython.declare(cython.bint, visibility="public")  # a direct position by a plan
    alone = cython.declare(cython.bint, visibility="public")  # no other came shortly before it
    sample_age = cython.declare(cython.double, visibility="public")  # of the last one, periods
    plan: cython.double[::1]  # accelerations of a stop or a step, rad/s²
    plan_steps = cython.declare(cython.int, visibility="public")  # 0: none
    plan_step = cython.declare(cython.double, visibility="public")  # s
    plan_time = cython.declare(cython.double, visibility="public")  # past, s
    move_start = cython.declare(cython.double, visibility="public")
    move_target = cython.declare(cython.double, visibility="public")
    move_velocity = cython.declare(cython.double, visibility="public")  # at its start
    move_acceleration = cython.declare(cython.double, visibility="public")  # with a jerk limit
    moved_acceleration = cython.declare(cython.double, visibility="public")  # likewise, of now
    smooth = cython.declare(cython.bint, visibility="public")  # it stops within its jerk limit
    move_time = cython.declare(cython.double, visibility="public")
    brake_time = cython.declare(cython.double, visibility="public")
    brake_even = cython.declare(cython.bint, visibility="public")  # first, at one rate
    move_cycles = cython.declare(cython.double, visibility="public")  # past
    moved = cython.declare(cython.double, visibility="public")
    moved_velocity = cython.declare(cython.double, visibility="public")
    ramped = cython.declare(cython.double, visibility="public")  # ∫v dt
    ramp_velocity = cython.declare(cython.double, visibility="public")
    ramp_target = cython.declare(cython.double, visibility="public")
    ramp_step = cython.declare(cython.double, visibility="public")  # rad/s per cycle
    driven = cython.declare(cython.bint, visibility="public")  # by a velocity without a ramp
    direct_velocity = cython.declare(cython.double, visibility="public")
    direct_age = cython.declare(cython.double, visibility="public")  # cycles since the last one
    stream = cython.declare(Stream, visibility="public")
    stream_acceleration = cython.declare(cython.double, visibility="public")  # filtered
    stream_peak = cython.declare(cython.double, visibility="public")  # decaying maximum of it
    reference = cython.declare(cython.double, visibility="public")
    reference_velocity = cython.declare(cython.double, visibility="public")
    followed = cython.declare(cython.double, visibility="public")  # within all limits
    followed_velocity = cython.declare(cython.double, visibility="public")
    followed_acceleration = cython.declare(cython.double, visibility="public")

    # --- time -------------------------------------------------------------------------------
    elapsed = cython.declare(cython.double, visibility="public")  # since the last cycle, s
    span = cython.declare(cython.double, visibility="public")  # between middles of cycles
    age = cython.declare(cython.double, visibility="public")  # of the reading, s
    wire = cython.declare(cython.double, visibility="public")  # greatest age of late, s
    missed = cython.declare(cython.double, visibility="public")  # without a fresh reading, s
    weighed_torque = cython.declare(cython.double, visibility="public")  # of the last reading
    # ∫a_ref dt of the last FED cycles, rad/s: what the feed-forward has accelerated
    fed = cython.declare(cython.double[::1], visibility="public")
    fed_now = cython.declare(cython.int, visibility="public")  # the place of the last one
    drawn = cython.declare(cython.double[::1], visibility="public")  # current references then, A
    blind = cython.declare(cython.bint, visibility="public")  # for more than GAP periods
    coasts = cython.declare(cython.bint, visibility="public")  # and by the board's loop
    calm = cython.declare(cython.double, visibility="public")  # bandwidth that the age leaves, 0…1
    spring = cython.declare(cython.double, visibility="public")  # part of kp that this allows, 0…1
    feedback = cython.declare(cython.double, visibility="public")  # filtered, without integral

    # --- measured and observed --------------------------------------------------------------
    position = cython.declare(cython.double, visibility="public")
    velocity = cython.declare(cython.double, visibility="public")
    torque = cython.declare(cython.double, visibility="public")
    current = cython.declare(cython.double, visibility="public")
    current_before = cython.declare(cython.double, visibility="public")  # a cycle ago
    sampled = cython.declare(cython.double, visibility="public")  # velocity of the reading
    behind = cython.declare(cython.double, visibility="public")  # way since the reading, rad
    acceleration = cython.declare(cython.double, visibility="public")
    load = cython.declare(cython.double, visibility="public")  # filtered, without inertia
    motion = cython.declare(cython.double, visibility="public")  # torque of the acceleration
    gravity = cython.declare(cython.double, visibility="public")  # of the arm's model, or 0
    forward = cython.declare(cython.double, visibility="public")  # feed-forward torque
    external = cython.declare(cython.double, visibility="public")  # torque from outside
    unobserved = cython.declare(cython.double, visibility="public")  # since it was observed, s
    contact_lasted = cython.declare(cython.double, visibility="public")  # beyond its threshold, s
    contact = cython.declare(cython.bint, visibility="public")  # for contact_time
    had_contact = cython.declare(cython.bint, visibility="public")  # in the last step
    feels = cython.declare(cython.bint, visibility="public")  # the torque from outside is known
    felt = cython.declare(cython.double, visibility="public")  # low-passed, N·m
    borne = cython.declare(cython.double, visibility="public")  # |load| of the model, likewise
    felt_taken = cython.declare(cython.double, visibility="public")  # at the start of the law
    felt_time = cython.declare(cython.double, visibility="public")  # in which it is taken, s
    felt_left = cython.declare(cython.double, visibility="public")  # of it
    offset_taken = cython.declare(cython.double, visibility="public")  # τ_ff before it
    goal = cython.declare(cython.double, visibility="public")  # of the drive, in COMPLIANT
    goal_velocity = cython.declare(cython.double, visibility="public")
    sag = cython.declare(cython.double, visibility="public")  # set-point beyond goal or reference
    lifts = cython.declare(cython.bint, visibility="public")  # compensates, and the arm is known
    lift = cython.declare(cython.double, visibility="public")  # compensated gravity torque
    blocked = cython.declare(cython.bint, visibility="public")  # at rest against its reference
    carried = cython.declare(cython.double, visibility="public")  # integral part while it was not
    readings = cython.declare(cython.int, visibility="public")  # since power-on
    rest_cycles = cython.declare(cython.int, visibility="public")
    settling = cython.declare(cython.bint, visibility="public")  # held until the load is known
    settle_cycles = cython.declare(cython.int, visibility="public")
    wait_cycles = cython.declare(cython.int, visibility="public")  # for others that brake
    awaited = cython.declare(cython.bint, visibility="public")  # a reference waits for the load
    holding = cython.declare(cython.bint, visibility="public")  # before a first torque or current
    hold_place = cython.declare(cython.double, visibility="public")

    # --- results ----------------------------------------------------------------------------
    torque_reference = cython.declare(cython.double, visibility="public")
    asked = cython.declare(cython.double, visibility="public")  # drive for the torque, last cycle
    output = cython.declare(cython.double, visibility="public")  # PWM, percent
    set_current = cython.declare(cython.double, visibility="public")  # of the set-point
    set_torque = cython.declare(cython.double, visibility="public")
    set_velocity = cython.declare(cython.double, visibility="public")
    set_position = cython.declare(cython.double, visibility="public")
    set_stiffness = cython.declare(cython.double, visibility="public")
    set_damping = cython.declare(cython.double, visibility="public")
    on_limit = cython.declare(cython.bint, visibility="public")
    was_on_limit = cython.declare(cython.bint, visibility="public")  # in the last step
    diverged = cython.declare(cython.bint, visibility="public")  # its output was not finite
    strain_cycles = cython.declare(cython.int, visibility="public")  # beyond the torque limit
    strained = cython.declare(cython.bint, visibility="public")  # for STRAIN_TIME

    def __init__(self) -> None:
        self.position_pid, self.torque_pid, self.current_pid = Pid(), Pid(), Pid()
        self.lower, self.upper, self.entry_speed = -INFINITE, INFINITE, INFINITE
        self.stream = Stream()
        self.plan, self.stepping = memoryview(array("d", [0.0])), False
        self.fed, self.fed_now = memoryview(array("d", [0.0] * FED)), 0
        self.drawn = memoryview(array("d", [0.0] * FED))
        self.smooth, self.max_jerk, self.moved_acceleration = False, 0.0, 0.0
        self.kind = AS_PWM
        self.set_current = self.set_torque = self.set_velocity = 0.0
        self.set_position = self.set_stiffness = self.set_damping = 0.0
        self.direct_age = self.sample_age = INFINITE
        self.alone = True
        self.was_on_limit = self.diverged = self.strained = self.blind = self.coasts = False
        self.calm = self.spring = 1.0
        self.contact = self.had_contact = False
        self.dead_band = self.sag = self.felt = self.borne = 0.0
        self.feels = False

    # --- requests ---------------------------------------------------------------------------

    @cython.ccall
    def hold(self, position: cython.double) -> cython.void:
        """Stop at a position: at rest there, or where the joint comes to rest (M9, P3).

        With a jerk limit it stops from its reference where it follows that, without a jump.
        """
        speed: cython.double = self.velocity
        smooth: cython.bint = self.max_jerk > 0.0 and self.active and self.law == POSITION
        if smooth:
            position = self.followed  # its velocity is the mean of the last cycle
            speed = self.followed_velocity + 0.5 * self.period * self.followed_acceleration
        guided: cython.bint
        moves: cython.bint = fabs(self.velocity) > REST_SPEED * self.max_velocity
        if self.dead_band > 0.0:
            guided = self.law == IMPEDANCE and not self.settling
            moves = moves and not guided  # its goal stops, whatever pushes the joint
            if fabs(self.velocity) <= SAGGING * self.max_velocity:
                self.sag = self.set_position - position
            elif guided:
                position = self.goal
        self.moving = False
        self.moved = self.reference = self.followed = position
        self.ramped = self.ramp_velocity = self.ramp_target = 0.0
        self.driven = self.stepping = self.smooth = False
        self.stopping = self.active = moves
        self.stop_due = self.stopping
        self.brake(self.max_acceleration)
        self.moved_velocity = 0.0
        if self.stopping:
            self.moved_velocity = clamp(speed, -self.max_velocity, self.max_velocity)
        self.followed_velocity = self.reference_velocity = self.moved_velocity
        self.moved_acceleration = 0.0
        if smooth and self.stopping:
            self.moved_acceleration = self.followed_acceleration
        self.followed_acceleration, self.direct_velocity = self.moved_acceleration, 0.0
        self.direct_age = INFINITE
        self.stream.count, self.stream.flows = 0.0, False

    @cython.ccall
    def brake(self, rate: cython.double) -> cython.void:
        """Stop with a deceleration, rad/s²."""
        self.stop_rate, self.plan_steps = rate, 0

    @cython.ccall
    def brake_smoothly(self, time: cython.double) -> cython.void:
        """Stop in a time, s, from the present velocity and acceleration, with bounded jerk."""
        self.smooth, self.plan_steps, self.stop_rate = True, 0, self.max_acceleration
        self.move_start, self.move_velocity = self.moved, self.moved_velocity
        self.move_acceleration, self.brake_even = self.moved_acceleration, False
        self.move_time = self.brake_time = time
        self.move_target = self.moved + braking(self.move_velocity, self.move_acceleration, time)
        self.move_cycles = 0.0

    @cython.ccall
    def brake_by(
        self, plan: cython.double[::1], steps: cython.int, step: cython.double
    ) -> cython.void:
        """Stop by a plan: accelerations (rad/s²) of steps (s); its rest at the limit."""
        self.plan, self.plan_steps, self.plan_step = plan, steps, step
        self.stop_rate, self.plan_time = self.max_acceleration, 0.0

    @cython.ccall
    def is_far(self) -> cython.bint:
        """Whether its direct position is a step: no sample of a stream, by time and distance."""
        return (
            self.alone
            and not (self.stepping or self.moving)
            and self.limit_lower <= self.followed <= self.limit_upper
            and fabs(self.reference - self.followed) > SHORT_STEP**2 * self.max_acceleration
        )

    @cython.ccall
    def step_by(
        self, plan: cython.double[::1], steps: cython.int, step: cython.double
    ) -> cython.void:
        """Approach the direct position by a plan: accelerations (rad/s²) of steps (s)."""
        self.plan, self.plan_steps, self.plan_step = plan, steps, step
        self.plan_time, self.stepping = 0.0, True

    @cython.ccall
    def give_back(self) -> cython.double:
        """Take a direct position back, to go on from the followed reference; the position."""
        position: cython.double = self.reference
        self.reference = self.moved = self.followed
        self.reference_velocity = self.moved_velocity = self.followed_velocity
        self.direct_age, self.direct_velocity = INFINITE, 0.0
        return position

    @cython.ccall
    def move(
        self, target: cython.double, time: cython.double, brake: cython.double
    ) -> cython.void:
        """Start a minimum-jerk move from the present reference (P1, P6).

        Args:
            target: rad.
            time: duration T, s; at least one period.
            brake: time to brake the present velocity, s; 0: the move starts with that velocity.
        """
        self.active = self.moving = True
        self.stopping = self.stepping = False
        self.move_start = self.reference
        self.move_velocity, self.move_acceleration = self.moved_velocity, self.moved_acceleration
        self.move_target = target
        self.move_time = time if time > self.period else self.period
        self.brake_time = brake
        self.move_cycles = 0.0
        self.moved = self.reference
        self.ramped = 0.0
        self.awaited = self.settling
        self.brake_even = False
        if brake > 0.0:
            keep_inside(self)

    @cython.ccall
    def ramp(self, velocity: cython.double, acceleration: cython.double) -> cython.void:
        """Ramp the velocity reference to a new value; to zero at the acceleration limit (P5)."""
        self.active = True
        self.ramp_target = velocity
        if velocity == 0.0:
            acceleration = self.max_acceleration
        self.ramp_step = acceleration * self.period
        self.awaited = self.settling

    @cython.ccall
    def drive_at(self, velocity: cython.double) -> cython.void:
        """Set a velocity reference without a ramp (Y1).

        The position reference equals the followed one: the distance that the acceleration limit
        costs is not made up for.
        """
        self.active = self.driven = True
        self.stopping = False
        self.ramp_target = self.ramp_velocity = self.reference_velocity = velocity
        self.ramp_step = INFINITE
        self.awaited = self.settling

    @cython.ccall
    def halt(self) -> cython.void:
        """Bring the velocity reference to zero, as a reference of zero does (P5, P12)."""
        if self.driven:
            self.drive_at(0.0)
        else:
            self.ramp(0.0, self.max_acceleration)

    @cython.ccall
    def step_to(self, position: cython.double) -> cython.void:
        """Set a direct position (P4): a step, or a sample of a stream."""
        self.take_sample(position, 0.0, False)

    @cython.ccall
    def step_with(self, position: cython.double, velocity: cython.double) -> cython.void:
        """Set a direct position with its velocity (P4)."""
        self.take_sample(position, clamp(velocity, -self.max_velocity, self.max_velocity), True)

    @cython.cfunc
    def take_sample(
        self, position: cython.double, velocity: cython.double, given: cython.bint
    ) -> cython.void:
        self.alone, self.sample_age = self.sample_age * self.period > SLOWER, 0.0
        if not given and self.goes_to(position):
            return
        self.stream.take(
            position, velocity, given, self.direct_age, self.period, self.max_velocity,
            self.max_acceleration,
        )  # fmt: skip
        self.active, self.moving, self.stopping = True, False, False
        self.stepping = False
        self.moved, self.ramped, self.moved_acceleration = position, 0.0, 0.0
        self.moved_velocity = self.ramp_velocity = self.ramp_target = 0.0
        self.reference, self.reference_velocity = position, 0.0
        self.direct_velocity = self.stream.velocity()
        self.direct_age = 0.0
        self.awaited = self.settling

    @cython.cfunc
    def goes_to(self, position: cython.double) -> cython.bint:
        """Whether a planned step, or a move, to a position is under way (P15)."""
        if self.moving:
            return position == self.move_target
        return self.stepping and position == self.moved

    @cython.ccall
    def at_rest(self) -> cython.bint:
        """Whether velocity and acceleration of the last readings are negligible."""
        return (
            self.readings > 1
            and fabs(self.velocity) <= REST_SPEED * self.max_velocity
            and fabs(self.inertia * self.acceleration) <= REST_TORQUE * self.max_torque
        )

    @cython.ccall
    def known_load(self) -> cython.double:
        """The static torque: measured torque less that of the acceleration (M9), N·m.

        On a wire, and at rest, low-passed: torque and acceleration of one reading belong to other
        times.
        """
        if self.wire > 0.0 or self.rest_cycles * self.period >= REST_TIME:
            return self.load
        return self.torque - self.motion

    @cython.ccall
    def feed_torque(self) -> cython.double:
        """u_ff as a torque, N·m."""
        if self.feeds and self.per_torque > 0.0:
            return self.output_offset * self.per_feed / self.per_torque
        return 0.0

    @cython.ccall
    def start(self, law: cython.int, resting: cython.bint = True) -> cython.void:
        """Switch to a law without a step of torque: it starts from the load (M9).

        Until all joints are at rest the position law brakes this one, or holds it; its static
        torque then becomes the torque of the new law (IMPEDANCE, TORQUE, CURRENT).

        Args:
            law: OFF, POSITION, ...
            resting: whether the other joints are at rest.
        """
        load: cython.double = self.known_load()
        if not resting and self.wire == 0.0:
            load = self.torque - self.motion
        self.law = law
        self.on_limit = self.holding = self.awaited = False
        self.settling = law in (IMPEDANCE, TORQUE, CURRENT) and not (resting and self.at_rest())
        self.settle_cycles = self.wait_cycles = self.strain_cycles = 0
        self.load = load
        self.current_pid.reset(0.0)
        self.position_pid.reset(
            load - self.gravity - self.feed_torque() - self.position_pid.kff * self.followed
        )
        self.torque_reference = self.torque_command = self.torque
        self.current_command = 0.0
        self.torque_pid.reset(0.0)
        self.asked = clamp(self.torque * self.per_torque, -self.max_drive, self.max_drive)
        if law in (OFF, OUTPUT):
            self.rest()
        if law == OFF:
            self.output = 0.0
        elif not self.settling:
            self.take(load)

    @cython.cfunc
    def rest(self) -> cython.void:
        """No law brakes the joint: the reference is at rest where it is."""
        if self.stopping:
            self.stopping = self.stop_due = self.active = False
            self.moved_velocity = self.reference_velocity = self.followed_velocity = 0.0

    @cython.cfunc
    def take(self, load: cython.double) -> cython.void:
        """Make the load the torque of the law without references."""
        self.settling = self.awaited = False
        self.load_taken = load - self.lift - self.torque_offset
        self.torque_command = load - self.lift
        self.holding = self.law in (TORQUE, CURRENT)
        self.hold_place = self.followed
        if self.dead_band > 0.0:
            self.goal, self.goal_velocity = self.followed, self.followed_velocity
            self.felt_taken, self.offset_taken = self.felt, self.torque_offset
            self.felt_left = self.felt_time
        self.torque_pid.reset(self.torque - self.torque_pid.kff * load - self.feed_torque())

    @cython.ccall
    def offer_torque(self, torque: cython.double) -> cython.void:
        """Set τ_ff (P11), which replaces the captured load."""
        if self.settling:
            self.take(self.known_load())
        self.offset_given = True
        self.torque_offset, self.load_taken = torque, 0.0
        if self.dead_band > 0.0:
            self.felt_taken = self.offset_taken = self.felt_left = 0.0

    @cython.ccall
    def command_torque(self, torque: cython.double) -> cython.void:
        """Set the torque reference, which replaces load and hold (P7)."""
        if self.settling:
            self.take(self.known_load())
        self.rest()
        self.holding = False
        self.torque_command = torque

    @cython.cfunc
    def carry(self, gravity: cython.double, known: cython.bint) -> cython.void:
        """Add the gravity torque where the joint compensates it (G1).

        Switching it on or off is offset in the load and the command: the torque makes no step.
        """
        lifts: cython.bint = self.compensates and known
        lift: cython.double = gravity if lifts else 0.0
        if lifts != self.lifts:
            self.lifts = lifts
            self.load_taken -= lift - self.lift
            self.torque_command -= lift - self.lift
        self.lift = lift

    @cython.ccall
    def command_current(self, current: cython.double) -> cython.void:
        """Set the current reference, which replaces load and hold (Y2)."""
        self.settling = self.awaited = self.holding = False
        self.rest()
        self.current_command = current

    @cython.ccall
    def give_up(self) -> cython.void:
        """Drive nothing, and reset the state that led to an output that is not finite.

        The reference is the joint's position, from which the next law starts.
        """
        self.diverged = True
        self.output = self.torque_reference = self.load = self.asked = 0.0
        self.set_current = self.set_torque = self.set_velocity = 0.0
        self.readings = self.rest_cycles = 0
        self.position_pid.reset(0.0)
        self.torque_pid.reset(0.0)
        self.current_pid.reset(0.0)
        self.hold(self.position)


NAN = cython.declare(cython.double, float("nan"))

if not cython.compiled:  # attributes start at zero, as they do compiled
    for _kind in (Pid, TimeBase, Stream, Joint):
        for _name, _value in list(vars(_kind).items()):
            if _value is None or isinstance(_value, Pid):
                setattr(_kind, _name, 0.0)


# --- 1. observe -----------------------------------------------------------------------------


@cython.cfunc
def pass_time(j: Joint, elapsed: cython.double) -> cython.void:
    """Time since the last cycle, s; 0: one control period (B6)."""
    before: cython.double = j.elapsed if j.elapsed > 0.0 else j.period
    j.elapsed = elapsed if elapsed > 0.0 else j.period
    j.span = 0.5 * (before + j.elapsed)


@cython.cfunc
def observe(
    j: Joint, position: cython.double, velocity: cython.double, age: cython.double
) -> cython.void:
    """The motion of now; acceleration and rest: a = Δq̇/Δt; torque: J·a without an arm model.

    Δt is the time between two readings. Of an old one the motion is continued, with what the
    reference has accelerated since (B7)::

        q = q(t − age) + q̇ age + ½ Δq̇ age,   q̇ = q̇(t − age) + Δq̇,   Δq̇ = ∫a_ref dt
    """
    ahead: cython.double = 0.0
    between: cython.double = j.elapsed + j.age - age
    if not is_number(position + velocity):  # there is no reading yet
        j.position, j.velocity, j.readings, j.rest_cycles = position, velocity, 0, 0
        j.behind = 0.0
        return
    if age > 0.0 or j.wire > 0.0 or j.missed > 0.0:
        note_feed(j)
        heed(j, age, between)
        ahead = fed_since(j, age)
    if j.readings == 0:
        j.acceleration = 0.0
    elif j.missed == 0.0 and between > 0.0:
        j.acceleration = (velocity - j.sampled) / between
    j.age, j.sampled = age, velocity
    j.behind = age * (velocity + 0.5 * ahead) if age > 0.0 else 0.0
    j.position, j.velocity = position + j.behind, velocity + ahead
    if not j.has_torque_sensor:
        j.torque = j.current * j.torque_per_ampere
    j.motion = j.inertia * j.acceleration
    if j.readings < 2:
        j.readings += 1
    if j.at_rest():
        if j.rest_cycles < 1000000:
            j.rest_cycles += 1
    else:
        j.rest_cycles = 0


@cython.cfunc
@cython.inline
def note_feed(j: Joint) -> cython.void:
    """Keep what the last set-point fed forward, and which current it was for, on a wire."""
    fed: cython.double = j.fed[j.fed_now]
    if j.active and (j.law == POSITION or j.settling):
        fed += j.followed_acceleration * j.elapsed
    j.fed_now = (j.fed_now + 1) & (FED - 1)
    j.fed[j.fed_now] = fed
    j.drawn[j.fed_now] = j.current_pid.reference


@cython.cfunc
def fed_since(j: Joint, age: cython.double) -> cython.double:
    """What the feed-forward has accelerated over an age, rad/s."""
    return j.fed[j.fed_now] - j.fed[place_of(j, age)]


@cython.cfunc
@cython.inline
def place_of(j: Joint, age: cython.double) -> cython.int:
    """Where what was so an age ago is kept, as far back as it is."""
    cycles: cython.int = cython.cast(cython.int, min(age / j.period + 0.5, FED - 1.0))
    return (j.fed_now - cycles) & (FED - 1)


@cython.cfunc
def heed(j: Joint, age: cython.double, between: cython.double) -> cython.void:
    """What the age of a reading means for the laws (B7).

    Without a fresh reading for GAP periods more than usual a joint is blind; where the board
    closes its loop, it coasts. Late readings take phase from the loop, age·kd/J, or age·pursuit;
    within WIRE_PHASE its gains are as configured, beyond it those of a loop slower by ``calm``,
    with a position loop in it as fast as SEPARATION allows, if not as configured.
    """
    p: Pid = j.position_pid
    speed: cython.double = p.kd / j.inertia_min  # of the loop, 1/s
    if between < 0.5 * j.elapsed:  # it is the same reading
        j.missed += j.elapsed
    else:
        j.missed = 0.0
        j.wire = max(age, j.wire * (1.0 - j.elapsed / WIRE_MEMORY))
        if j.wire < 0.1 * j.period:
            j.wire = 0.0
    if j.kind >= AS_VELOCITY:
        speed = j.pursuit
    j.calm = j.spring = 1.0
    if speed * j.wire > WIRE_PHASE:
        j.calm = WIRE_PHASE / (speed * j.wire)
        j.spring = j.calm * j.calm
        if j.kind < AS_VELOCITY and p.kp > 0.0:
            j.spring = min(j.spring * max(SEPARATION * speed * p.kd / p.kp, 1.0), j.calm)
    j.blind = j.missed > GAP * j.period + j.wire
    if j.blind and j.kind < AS_VELOCITY:
        j.coasts = True
    elif j.coasts and not j.blind:
        j.coasts = False
        take_up(j)


@cython.cfunc
def take_up(j: Joint) -> cython.void:
    """After a gap of readings: the reference goes on from the joint, without a step of torque.

    Where the joint coasted less than an error of GAP_SHARE of the torque limit off its reference,
    the loop deals with it.
    """
    p: Pid = j.position_pid
    if j.law != POSITION and not j.settling:
        return
    if p.kp * fabs(j.followed - j.position) <= GAP_SHARE * j.max_torque:
        return
    restart_at(j, j.position)
    p.integral += j.feedback
    p.room = max(fabs(p.integral) - p.limit, 0.0)
    p.fall = p.room * j.period / HOLD_FILTER
    p.derivative = j.feedback = 0.0


@cython.cfunc
def restart_at(j: Joint, place: cython.double) -> cython.void:
    """Continue the followed reference from a place, with the joint's velocity."""
    j.followed = clamp(place, j.lower, j.upper)
    j.followed_velocity = clamp(j.velocity, -j.max_velocity, j.max_velocity)
    j.followed_acceleration = 0.0
    j.stepping = False
    if j.stopping:
        go_on_stopping(j, j.followed)
    j.active = True


@cython.cfunc
def cross_gap(j: Joint) -> cython.void:
    """After a gap between two cycles, in which the drive got no set-point (B6).

    A joint by torque or velocity coasted, one by position stood: the followed reference goes on
    from where the joint is between both, as if one period had passed.
    """
    end: cython.double = j.followed + j.followed_velocity * j.elapsed
    if not j.active or not is_number(j.position):
        return
    if j.kind >= AS_POSITION and j.missed > 0.0:  # where it is now is not known yet
        j.followed_velocity = j.followed_acceleration = 0.0
    else:
        restart_at(j, clamp(j.position, min(j.followed, end), max(j.followed, end)))


@cython.cfunc
def weigh(j: Joint) -> cython.void:
    """The load: τ − torque of the acceleration, low-passed from its first number on (M9).

    The acceleration is that between two readings. On a wire these are some periods apart, so τ is
    the mean of both, and no reading is weighed twice (B7).
    """
    raw: cython.double = j.torque - j.motion
    before: cython.double = j.weighed_torque
    if j.wire > 0.0:
        if j.missed > 0.0:
            return
        j.weighed_torque = j.torque
        raw += 0.5 * (before - j.torque)
    else:
        j.weighed_torque = j.torque
    if j.readings < 2 or j.period >= LOAD_FILTER or not is_number(j.load):
        j.load = raw
    else:
        j.load += j.period / LOAD_FILTER * (raw - j.load)


@cython.cfunc
def observe_external(j: Joint, motion: cython.double) -> cython.double:
    """The torque from outside: what the motion took beyond what the joint gave (X1).

    r ← r + (1 − e^(−2π f T)) (M Δq̇/T + c + g + F(q̇) − τ − r)

    To the first order of the period T this is the momentum observer p̂ = ∫(τ + cᵀ − g − F + r) dt,
    r = 2π f (p − p̂), p = M q̇ (De Luca et al., IROS 2006): the velocities of the low pass telescope
    to those of p, so that no acceleration is measured. F is in it where τ is the motor's current.

    Args:
        j: The joint.
        motion: M Δq̇/T + c + g of the arm, N·m.
    """
    torque: cython.double = motion - j.torque
    j.unobserved += j.elapsed
    if j.missed > 0.0:  # no reading since
        return j.external
    if not j.has_torque_sensor:
        torque += friction(j, j.sampled)
    j.external += min(j.external_share * j.unobserved / j.period, 1.0) * (torque - j.external)
    if j.dead_band > 0.0:
        feel(j, motion)
    if j.contact_threshold <= 0.0 or fabs(j.external) <= j.contact_threshold:
        j.contact_lasted = 0.0
    else:
        j.contact_lasted += j.unobserved
    j.contact = j.contact_lasted > 0.0 and j.contact_lasted >= j.contact_time - 1e-6 * j.period
    j.unobserved = 0.0
    return j.external


@cython.cfunc
def feel(j: Joint, motion: cython.double) -> cython.void:
    """What a goal gives way to, and the load: low-passed from their first numbers on."""
    share: cython.double = min(j.felt_share * j.unobserved / j.period, 1.0) if j.feels else 1.0
    j.felt += share * (j.external - j.felt)
    j.borne += share * (fabs(motion) - j.borne)
    j.feels = True


@cython.cfunc
def settle(j: Joint, braking: cython.bint, rested: cython.bint) -> cython.void:
    """Capture the load once it is known, or after SETTLE_MOST.

    Args:
        j: The joint, which settles.
        braking: Whether one of the settling joints still brakes.
        rested: Whether all of them have been at rest for REST_TIME.
    """
    elapsed: cython.double
    if j.active and not j.awaited:
        return  # it still brakes
    if braking and not j.awaited:
        j.wait_cycles += 1
        if j.wait_cycles * j.period < OTHERS_MOST:
            return
    j.settle_cycles += 1
    elapsed = j.settle_cycles * j.period
    if j.awaited:
        rested = j.rest_cycles * j.period >= REST_TIME
    if (
        (rested and elapsed >= REST_TIME)
        or elapsed >= SETTLE_MOST
        or (j.awaited and elapsed >= SETTLE_LEAST)
    ):
        j.take(j.load)


# --- 2. advance -----------------------------------------------------------------------------


@cython.cfunc
def advance(j: Joint) -> cython.void:
    """One cycle of the reference: trajectory + ∫v dt, or the direct position (P1 to P6)."""
    velocity: cython.double
    periods: cython.double = j.elapsed / j.period
    j.sample_age += periods
    if periods > GAP:
        cross_gap(j)
    if j.driven:
        j.moved, j.ramped, j.reference = j.followed, 0.0, j.followed
    if j.moving:
        advance_move(j)
    elif j.stopping:
        advance_stop(j)
    velocity = j.moved_velocity
    if j.ramp_target != 0.0 or j.ramp_velocity != 0.0:
        advance_ramp(j)
        velocity += j.ramp_velocity
    if j.direct_age < INFINITE:
        j.direct_age += periods
    else:
        j.reference_velocity = velocity
    j.reference = clamp(j.moved + j.ramped, j.lower, j.upper)
    if periods > GAP:
        j.elapsed = j.span = j.period
    follow(j)
    if j.driven:
        j.reference = j.followed
    if j.calibrated:
        come_in(j, j.followed)


@cython.cfunc
@cython.inline
def come_in(j: Joint, place: cython.double) -> cython.void:
    """The bounds of a joint found outside its limits follow it in, not out again (P9, P16)."""
    if j.lower < j.limit_lower:
        j.lower = clamp(place, j.lower, j.limit_lower)
    if j.upper > j.limit_upper:
        j.upper = clamp(place, j.limit_upper, j.upper)


@cython.cfunc
def advance_move(j: Joint) -> cython.void:
    """One cycle of a move (P1)."""
    time: cython.double = j.move_time
    j.move_cycles += j.elapsed / j.period
    elapsed: cython.double = j.move_cycles * j.period
    if elapsed >= (time if time > j.brake_time else j.brake_time) - 1e-9 * j.period:
        j.moving = False
        j.moved, j.moved_velocity, j.moved_acceleration = j.move_target, 0.0, 0.0
        return
    run_move(j, elapsed)


@cython.cfunc
def run_move(j: Joint, elapsed: cython.double) -> cython.void:
    """The quintic of a move, from velocity v0 to rest (P1).

    q(s) = q0 + v0 T s + (10 R − 6 v0 T) s³ + (8 v0 T − 15 R) s⁴ + (6 R − 3 v0 T) s⁵, s = t/T; with
    a brake time T_b the initial velocity is braked by v0 (1 − 3u² + 2u³), u = t/T_b. Where that
    would pass a limit, it is braked by v0 (1 − u) first, and the quintic takes T − T_b.

    With a jerk limit the acceleration a0 at the start goes on: B = a0 T²/2 adds B (s² − 3s³ + 3s⁴
    − s⁵), in braking a0 T_b u (1 − u)² to the velocity.
    """
    s: cython.double
    u: cython.double
    bend: cython.double = 0.0
    change: cython.double = 0.0
    run: cython.double = 0.0
    way: cython.double = 0.0
    speed: cython.double = 0.0
    reach: cython.double
    time: cython.double = j.move_time
    reach = j.move_target - j.move_start
    if j.brake_even:
        u = elapsed / j.brake_time
        if u < 1.0:
            j.moved = j.move_start + j.move_velocity * elapsed * (1.0 - 0.5 * u)
            j.moved_velocity = j.move_velocity * (1.0 - u)
            j.moved_acceleration = 0.0
            return
        way = 0.5 * j.move_velocity * j.brake_time
        reach -= way
        elapsed -= j.brake_time
        time -= j.brake_time
    elif j.brake_time > 0.0:
        u = elapsed / j.brake_time
        bend = j.move_acceleration * j.brake_time
        way = braking(j.move_velocity, j.move_acceleration, j.brake_time)
        reach -= way
        if u < 1.0:
            way = j.move_velocity * j.brake_time * u * (1.0 + u * u * (0.5 * u - 1.0))
            way += bend * j.brake_time * u * u * (0.5 + u * (0.25 * u - 2.0 / 3.0))
            speed = j.move_velocity * (1.0 + u * u * (2.0 * u - 3.0))
            speed += bend * u * (1.0 - u) * (1.0 - u)
            change = 6.0 * j.move_velocity * u * (u - 1.0) / j.brake_time
            change += j.move_acceleration * (1.0 + u * (3.0 * u - 4.0))
        bend = 0.0
    else:
        run = j.move_velocity * time
        bend = 0.5 * j.move_acceleration * time * time
    s = elapsed / time
    if s >= 1.0:
        j.moved, j.moved_velocity = j.move_start + way + reach, speed
        j.moved_acceleration = change if j.max_jerk > 0.0 else 0.0
        return
    a: cython.double = 10.0 * reach - 6.0 * run - 3.0 * bend
    b: cython.double = 8.0 * run - 15.0 * reach + 3.0 * bend
    c: cython.double = 6.0 * reach - 3.0 * run - bend
    j.moved = j.move_start + way + s * (run + s * s * (a + s * (b + s * c))) + s * s * bend
    j.moved_velocity = speed + (run + s * s * (3.0 * a + s * (4.0 * b + s * 5.0 * c))) / time
    j.moved_velocity, j.moved_acceleration = j.moved_velocity + 2.0 * s * bend / time, 0.0
    if j.max_jerk > 0.0:
        change += (2.0 * bend + s * (6.0 * a + s * (12.0 * b + s * 20.0 * c))) / (time * time)
        j.moved_acceleration = change


@cython.cfunc
@cython.inline
def braking(
    velocity: cython.double, acceleration: cython.double, time: cython.double
) -> cython.double:
    """The way of a braking within a time, from velocity and acceleration."""
    return 0.5 * velocity * time + acceleration * time * time / 12.0


@cython.cfunc
def keep_inside(j: Joint) -> cython.void:
    """Brake evenly, then move, where braking within the move would pass a limit (P14)."""
    k: cython.int
    way: cython.double = 1.0 if j.move_velocity > 0.0 else -1.0
    room: cython.double = (j.upper if way > 0.0 else -j.lower) - way * j.move_start
    step: cython.double = (j.move_time if j.move_time > j.brake_time else j.brake_time) / 64.0
    slack: cython.double = 0.125 * j.max_acceleration * step * step
    place: cython.double
    last: cython.double = 0.0
    before: cython.double = 0.0
    speed: cython.double = j.moved_velocity
    passes: cython.bint = False
    if room <= 0.0 or 0.5 * fabs(speed) * j.brake_time < room:
        return
    for k in range(1, 65):
        run_move(j, k * step)
        place = way * (j.moved - j.move_start)
        if last >= place and last >= before and last > room - slack:
            passes = True
            break
        before, last = last, place
    j.moved, j.moved_velocity, j.moved_acceleration = j.move_start, speed, j.move_acceleration
    if passes:
        j.brake_even = True
        j.brake_time = 2.0 * room / fabs(speed)
        j.move_time += j.brake_time


@cython.cfunc
def advance_stop(j: Joint) -> cython.void:
    """Brake as planned (``stopping``), to hold where the joint comes to rest (M9, P3)."""
    step: cython.int = j.plan_steps
    elapsed: cython.double = min(j.elapsed, GAP * j.period)
    span: cython.double = min(j.span, GAP * j.period)
    rate: cython.double = fading(j, j.moved_velocity)
    change: cython.double = min(j.stop_rate, rate) * span
    place: cython.double
    ahead: cython.double
    over: cython.double = j.velocity - j.ramp_velocity
    known_to: cython.double
    if step > 0:
        step = cython.cast(cython.int, j.plan_time / j.plan_step + 1e-9)
    if j.smooth:
        stop_smoothly(j, elapsed)
    elif step < j.plan_steps:
        j.plan_time += elapsed
        if j.plan[step] * j.moved_velocity >= 0.0:
            rate = INFINITE
        j.moved_velocity += clamp(j.plan[step], -rate, rate) * span
    else:
        j.plan_steps = 0
        j.moved_velocity = clamp(0.0, j.moved_velocity - change, j.moved_velocity + change)
    if not j.smooth:
        j.moved += j.moved_velocity * elapsed
    place = clamp(j.moved, j.lower - j.ramped, j.upper - j.ramped)
    if place != j.moved:  # too fast to stop before a limit
        j.moved, j.moved_velocity, j.plan_steps = place, 0.0, 0
        j.stopping = j.smooth = False
        return
    if j.smooth:
        j.stopping = j.smooth = j.move_cycles * j.period < j.brake_time
    else:
        j.stopping = j.moved_velocity != 0.0 or j.plan_steps > 0
    known_to = REST_SPEED * j.max_velocity + j.max_acceleration * j.wire  # late set-points (B7)
    if not j.stopping and fabs(over) > known_to:
        ahead = j.position - j.moved - j.ramped
        # it runs past the end, for want of torque
        if ahead * over > 0.0 and ahead * j.velocity > 0.0:
            go_on_stopping(j, j.position)


@cython.cfunc
@cython.inline
def fading(j: Joint, velocity: cython.double) -> cython.double:
    """The deceleration at which a stop fades out on a wire, rad/s²: √(2 a v/t), a → 0 in t (B7).

    A set-point that comes Δ late at its end then leaves a speed of a Δ²/2t backwards, not a Δ.
    """
    time: cython.double = min(FADE_AGES * j.wire, FADE_MOST)
    if time <= 0.0:
        return INFINITE
    return sqrt(2.0 * j.max_acceleration * fabs(velocity) / time)


@cython.cfunc
def stop_smoothly(j: Joint, elapsed: cython.double) -> cython.void:
    """One cycle of a stop within the jerk limit; at its end the joint is at rest."""
    j.move_cycles += elapsed / j.period
    if j.move_cycles * j.period < j.brake_time:
        run_move(j, j.move_cycles * j.period)
    else:
        j.moved, j.moved_velocity, j.moved_acceleration = j.move_target, 0.0, 0.0


@cython.cfunc
def go_on_stopping(j: Joint, place: cython.double) -> cython.void:
    """Stop from a place and the joint's speed, at the acceleration limit."""
    j.stopping, j.smooth = True, False
    j.brake(j.max_acceleration)
    j.followed, j.moved = place, place - j.ramped
    j.moved_velocity = clamp(j.velocity, -j.max_velocity, j.max_velocity)
    j.followed_velocity = j.moved_velocity


@cython.cfunc
def advance_ramp(j: Joint) -> cython.void:
    """The velocity reference: ramped (P5), within the speed limit, braking ahead of limits (P14).

    The speed limit applies to the sum with a move's velocity.
    """
    total: cython.double
    up: cython.double
    down: cython.double
    step: cython.double = j.ramp_step * (j.elapsed / j.period)
    if j.ramp_target == 0.0 and not j.driven:
        step = min(step, fading(j, j.ramp_velocity) * j.elapsed)
    v: cython.double = clamp(j.ramp_target, j.ramp_velocity - step, j.ramp_velocity + step)
    up = brake_speed(j.upper - j.reference, j.max_acceleration, j.elapsed)
    down = brake_speed(j.reference - j.lower, j.max_acceleration, j.elapsed)
    total = clamp(
        j.moved_velocity + v,
        -(down if down < j.max_velocity else j.max_velocity),
        up if up < j.max_velocity else j.max_velocity,
    )
    j.ramp_velocity = total - j.moved_velocity if total != j.moved_velocity + v else v
    j.ramped += j.ramp_velocity * j.elapsed


@cython.cfunc
@cython.inline
def top_speed(j: Joint) -> cython.double:
    """Of the followed reference, rad/s: a direct position comes in from outside limits (P16)."""
    if (
        j.direct_age < INFINITE
        and j.calibrated
        and (j.followed > j.limit_upper or j.followed < j.limit_lower)
    ):
        return j.entry_speed
    return j.max_velocity


@cython.cfunc
def follow(j: Joint) -> cython.void:
    """The followed reference: the reference within speed, acceleration and position limits (P14).

    It equals the reference where the limits allow; else it is the fastest approach that ends with
    the reference's velocity: v = v_ref + brake_speed(distance). Of a stream it tracks the motion
    fitted to the samples (``follow_stream``). Joints that lack the torque to step together have a
    plan (``stepping``).
    """
    k: cython.int
    goal: cython.double = j.reference
    top: cython.double = top_speed(j)
    goal_velocity: cython.double = j.reference_velocity
    velocity: cython.double
    rest: cython.double
    up: cython.double
    down: cython.double
    change: cython.double
    step: cython.double = j.max_acceleration * j.span
    if j.direct_age < INFINITE:
        goal_velocity = 0.0
        if j.stream.flows and (j.direct_age - 1.0) * j.period > j.stream.patience():
            j.stream.flows = False  # it has ended
        if not j.stream.flows:
            j.reference_velocity = j.direct_velocity = 0.0
    if j.stepping and (j.coasts or j.plan_time >= j.plan_steps * j.plan_step - 1e-9):
        j.stepping = False
    if j.stepping:
        k = cython.cast(cython.int, j.plan_time / j.plan_step + 1e-9)
        velocity = j.followed_velocity + j.plan[k] * j.span
        j.plan_time += j.elapsed
    elif j.direct_age < INFINITE and j.stream.flows:
        velocity = follow_stream(j)
        goal_velocity = j.reference_velocity
    else:
        j.stream_acceleration = j.stream_peak = 0.0
        rest = goal - j.followed - goal_velocity * j.elapsed
        if rest >= 0.0:
            velocity = goal_velocity + brake_speed(rest, j.max_acceleration, j.elapsed)
        else:
            velocity = goal_velocity - brake_speed(-rest, j.max_acceleration, j.elapsed)
    up = brake_speed(j.upper - j.followed, j.max_acceleration, j.elapsed)
    down = brake_speed(j.followed - j.lower, j.max_acceleration, j.elapsed)
    velocity = clamp(velocity, -(down if down < top else top), up if up < top else top)
    change = INFINITE if j.stopping and j.plan_steps > 0 else step  # a plan has what torque allows
    velocity = clamp(velocity, j.followed_velocity - change, j.followed_velocity + change)
    if j.coasts:  # slower at most (B7)
        up, down = max(j.followed_velocity, 0.0), max(-j.followed_velocity, 0.0)
        velocity = clamp(velocity, -down, up)
    j.followed_acceleration = (velocity - j.followed_velocity) / j.span
    j.followed_velocity = velocity
    j.followed += velocity * j.elapsed
    if fabs(goal - j.followed) <= 1e-12 and goal_velocity == 0.0:
        j.followed = goal
    if (
        j.followed == goal
        and fabs(velocity) <= step * 1e-6
        and not (j.moving or j.stopping or j.ramp_target != 0.0 or j.ramp_velocity != 0.0)
        and j.direct_velocity == 0.0
        and (j.direct_age == INFINITE or j.direct_age * j.period > LAST)
    ):
        j.active, j.sample_age = False, INFINITE
        j.followed_velocity = j.followed_acceleration = 0.0


@cython.cfunc
def follow_stream(j: Joint) -> cython.double:
    """The velocity of the followed reference on its way to the motion of a stream, and along it.

    e = r − x, w = v − v_r:  v̇ = a_r + 2ω (w_e − w), w_e = ½ω e near it (critically damped), and
    √(2b(|e| − 2b/ω²)) far away, b = 0.8 (a_max − peak |a_r|), which leaves the acceleration of the
    motion itself. a_r is low-passed; ω is inverse to the stream's interval.
    """
    s: Stream = j.stream
    base: TimeBase = s.grid if s.on_grid else s.sent
    age: cython.double = (j.direct_age - 1.0) * j.period
    interval: cython.double = s.interval if s.interval > BRIEF else BRIEF
    quick: cython.double = QUICK / interval
    if s.on_grid:
        age += s.late
    quick = min(quick, QUICKEST)
    quick = min(quick, 0.2 / j.period)
    turned: cython.double = versine(base.turning, age)
    cosine: cython.double = 1.0 - base.turning * turned
    run: cython.double = sine(base.turning, age)
    goal: cython.double = base.x + base.v * run + base.a * turned
    speed: cython.double = base.v * cosine + base.a * run
    speed = clamp(speed, -j.max_velocity, j.max_velocity)
    rate: cython.double = base.a * cosine - base.turning * base.v * run
    rate = clamp(rate, -j.max_acceleration, j.max_acceleration)
    if (goal >= j.upper and speed > 0.0) or (goal <= j.lower and speed < 0.0):
        goal, speed, rate = clamp(goal, j.lower, j.upper), 0.0, 0.0
    j.reference_velocity = j.direct_velocity = speed
    share: cython.double = 3.0 * quick * j.elapsed
    j.stream_acceleration += (rate - j.stream_acceleration) * (share if share < 1.0 else 1.0)
    rate = j.stream_acceleration
    j.stream_peak *= 1.0 - j.elapsed
    j.stream_peak = max(j.stream_peak, fabs(rate))
    speed -= 0.5 * rate * j.elapsed  # the mean over this cycle
    error: cython.double = goal - j.followed - speed * j.elapsed
    off: cython.double = j.followed_velocity - speed + rate * j.span
    brake: cython.double = 0.8 * (j.max_acceleration - j.stream_peak)
    brake = max(brake, 0.03 * j.max_acceleration)
    slope: cython.double = 0.5 * quick
    near: cython.double = brake / (slope * slope)
    wanted: cython.double = slope * error
    ahead: cython.double = 0.0
    if fabs(error) > near:
        wanted = sqrt(2.0 * brake * (fabs(error) - 0.5 * near))
        ahead = brake * fabs(off) / wanted
        ahead = min(ahead, brake)
        if error < 0.0:
            wanted = -wanted
        else:
            ahead = -ahead
    change: cython.double = (rate + ahead + 4.0 * slope * (wanted - off)) * j.span
    wanted = speed + error / j.elapsed
    if fabs(wanted - j.followed_velocity - change) <= 0.01 * j.max_acceleration * j.span:
        return wanted
    return j.followed_velocity + change


# --- 3. control -----------------------------------------------------------------------------


@cython.cfunc
def pid_step(
    p: Pid, reference: cython.double, error: cython.double, rate: cython.double
) -> cython.double:
    """One period of a PID: u = kff·r + kp·e + I + kd·D."""
    p.reference, p.error = reference, error
    p.previous = p.integral
    if p.room > 0.0:
        p.room = max(p.room - p.fall, 0.0)
    most: cython.double = p.limit + p.room
    p.integral = clamp(p.integral + p.ki_period * error, -most, most)
    p.derivative += p.alpha * (rate - p.derivative)
    return p.kff * reference + p.kp * error + p.integral + p.kd * p.derivative


@cython.cfunc
def unwind(p: Pid, excess: cython.double) -> cython.void:
    """Anti-windup: undo the integral's last step where it drives a saturated output further."""
    if p.error * excess > 0.0:
        p.integral = p.previous


@cython.cfunc
def position_law(j: Joint) -> cython.double:
    """Position PID with feed-forward of the followed reference (I5, first row of Fig. 2).

    τ = kp·e + ∫ki·e dt + kd·ė + τ(q, q̇_ref, q̈_ref) + τ_friction(q̇_ref), e = q_ref − q; τ() is the
    arm's dynamics and gravity, or J·q̈_ref without a model.

    The followed reference leads the joint by at most the error that is worth the torque limit: a
    joint that was blocked continues from its place at the speed of a reference (P14).
    """
    p: Pid = j.position_pid
    keep_near(j)
    late: cython.double = j.followed - j.delay * j.followed_velocity  # what the drive has by now
    torque: cython.double
    if j.coasts:
        torque = p.kff * j.followed + p.integral + j.feedback
    elif j.blind:  # the drive has the same spring, with the present error
        torque = p.feed() + p.integral
    else:
        torque = pid_step(p, j.followed, late - j.position, j.followed_velocity - j.velocity)
        if j.calm < 1.0:
            torque = soften(j)
        keep_feedback(j)
    return torque + j.forward + friction(j, j.followed_velocity)


@cython.cfunc
def keep_feedback(j: Joint) -> cython.void:
    """Filter the feedback: what a joint that coasts keeps of it is its load (B7)."""
    p: Pid = j.position_pid
    feedback: cython.double = p.kp * p.error * j.spring + p.kd * p.derivative * j.calm
    j.feedback += j.period / (j.period + HOLD_FILTER) * (feedback - j.feedback)


@cython.cfunc
def soften(j: Joint) -> cython.double:
    """The torque of the position PID for a loop slower by ``calm``."""
    p: Pid = j.position_pid
    p.integral -= (1.0 - j.spring * j.calm) * (p.integral - p.previous)
    return (
        p.kff * p.reference + p.kp * p.error * j.spring + p.integral + p.kd * p.derivative * j.calm
    )


@cython.cfunc
def keep_near(j: Joint) -> cython.void:
    """Bound the lead of the followed reference by the torque and speed limits (P14)."""
    p: Pid = j.position_pid
    lead: cython.double
    if p.kp > 0.0 and not j.blind:
        lead = (j.delay + 2.0 * j.wire) * fabs(j.followed_velocity)  # either way
        lead += LEAD * j.max_torque / (p.kp * j.calm)
        if fabs(j.followed - j.position) > lead:
            if j.kind == AS_POSITION:
                keep_near_drive(j, lead)
            else:
                stay(j, clamp(j.followed, j.position - lead, j.position + lead))
        hold_back(j)


@cython.cfunc
def keep_near_drive(j: Joint, lead: cython.double) -> cython.void:
    """Bound the lead over a drive that closes the loop of position, with a stiffness of its own.

    What it sags by under a load is no lead: a reference that followed such a joint would sink with
    it. At the torque limit, by its current, the reference yields, so that it is that limit. Below,
    it goes on, up to WIDE leads. Beyond, and where no current is known, it waits.
    """
    error: cython.double = j.followed - j.position
    torque: cython.double = j.torque if error > 0.0 else -j.torque
    if torque > j.max_torque:
        stay(j, j.position + error * j.max_torque / torque)
    elif not (torque > 0.0 and fabs(error) <= WIDE * lead):
        wait_for_drive(j, clamp(j.followed, j.position - lead, j.position + lead))


@cython.cfunc
def wait_for_drive(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place that it has not passed, else where it was."""
    before: cython.double = j.set_position - j.sag
    low: cython.double = min(j.followed, place)
    high: cython.double = max(j.followed, place)
    place = clamp(before, low, high)
    if place != j.followed:
        stay(j, place)


@cython.cfunc
def friction(j: Joint, velocity: cython.double) -> cython.double:
    """Friction at a velocity: clip(F_c v/v_slip, ± F_c) + F_v v, with F of its direction."""
    ahead: cython.bint = velocity >= 0.0
    dry: cython.double = j.coulomb if ahead else j.coulomb_negative
    wet: cython.double = j.viscous if ahead else j.viscous_negative
    if dry == 0.0:
        return wet * velocity
    return dry * clamp(velocity / j.slip, -1.0, 1.0) + wet * velocity


@cython.cfunc
def stay(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place, without the feed-forward of its acceleration.

    Of a joint that brakes with less torque than that takes, it goes on with the joint's speed.
    """
    j.forward -= j.inertia * j.followed_acceleration
    j.followed = place
    j.followed_velocity = j.followed_acceleration = 0.0
    if j.stopping:
        go_on_stopping(j, place)
    j.active = True


@cython.cfunc
def hold_back(j: Joint) -> cython.void:
    """Bound the push of a blocked joint, so that its release stays within the speed limit (P14).

    |kp·e + I − I_free| ≤ J·v_top/T',  T' = T (1 + lead/2) + the drive's delay

    I_free is the integral part while the joint moved, or was at a reference at rest; T' is the
    time until the board sees the release and the winding has removed the torque. The followed
    reference waits. Of a drive that closes the loop of position, kp·e + I is what it gives by its
    current, where known, and I_free what it gave.
    """
    p: Pid = j.position_pid
    excess: cython.double
    push: cython.double = p.kp * (j.followed - j.position) + p.integral
    if j.kind == AS_POSITION and is_number(j.torque) and j.torque != 0.0:
        push = j.torque
    back: cython.double
    most: cython.double = (
        LIGHT * j.inertia_min * j.max_velocity / (j.period * (1.0 + 0.5 * j.lead) + j.delay)
    )
    if most >= j.max_torque:
        return
    most = max(most, HOLD_SHARE * j.max_torque)
    if fabs(j.velocity) > REST_SPEED * j.max_velocity:
        j.blocked = False
    elif j.followed_velocity != 0.0:
        j.blocked = True
    elif j.kind == AS_POSITION and j.followed == j.reference:
        j.blocked = False  # it holds what it bears
    if not j.blocked:
        j.carried = push if j.kind == AS_POSITION else p.integral
        return
    excess = push - j.carried
    if fabs(excess) > most:
        back = j.followed - (excess - clamp(excess, -most, most)) / p.kp
        # not beyond where the joint is
        back = clamp(back, min(j.followed, j.position), max(j.followed, j.position))
        if j.kind == AS_POSITION:
            wait_for_drive(j, back)
        else:
            stay(j, back)


@cython.cfunc
def impedance(j: Joint) -> cython.double:
    """Torque of a virtual spring and damper (I5; second row of source Fig. 2).

    τ = τ_ff + load + g(q) + k (q_ref − q) − d q̇; the load is that on entering (M9), g(q) the
    compensated gravity. With g(q) and k = 0 the joint stays where it is put, by a holding torque
    of the size of gearbox friction (G1).
    """
    torque: cython.double = (
        j.torque_offset
        + j.load_taken
        + j.lift
        + j.stiffness * (j.followed - j.position)
        - j.damping * j.velocity
    )
    return torque + hold_torque(j, REST_SHARE) if j.lifts and j.stiffness == 0.0 else torque


@cython.cfunc
def give_way(j: Joint) -> cython.void:
    """One cycle of the goal of a drive that takes positions only, in COMPLIANT (I5).

    ġ = (z(τ − τ₀) + τ_ff + k (q_ref − g))/d,   z(x) = sign x · max(|x| − D, 0)

    τ is the torque from outside, low-passed (X1), D the dead band and a share of the load. τ₀,
    what is felt on entering (M9), fades as the goal gives way: τ̇₀ = −τ₀ |ġ|/FADING. The speed
    limit and braking ahead of software limits bound ġ (P9, P14); where τ is not known, or old
    (B7), it is zero.
    """
    time: cython.double = j.elapsed if j.elapsed <= GAP * j.period else j.period
    least: cython.double = j.dead_band + j.load_share * j.borne
    push: cython.double
    speed: cython.double = 0.0
    up: cython.double = brake_speed(j.upper - j.goal, j.max_acceleration, time)
    down: cython.double = brake_speed(j.goal - j.lower, j.max_acceleration, time)
    if j.felt_left > 0.0:  # it follows what the braking has left in the low pass
        j.felt_left -= time
        j.felt_taken = j.felt
    push = j.felt - j.felt_taken
    push -= clamp(push, -least, least)
    if j.feels and not j.blind:
        speed = push + j.torque_offset - j.offset_taken + j.stiffness * (j.followed - j.goal)
        speed /= max(j.damping, j.min_damping) + j.stiffness * time
    speed = clamp(speed, -min(down, j.max_velocity), min(up, j.max_velocity))
    if push != 0.0:
        j.felt_taken *= max(1.0 - fabs(speed) * time / (FADING * j.limit_edge), 0.0)
    j.goal = clamp(j.goal + speed * time, j.lower, j.upper)
    j.goal_velocity = speed
    if j.calibrated:
        come_in(j, j.goal)
        note_limit(j)


@cython.cfunc
def hold_torque(j: Joint, share: cython.double) -> cython.double:
    """A hold that yields: clip(kp (q_hold − q) − kd q̇, ± share·τ_max).

    Pushed harder, the joint moves, and holds where it is released.
    """
    p: Pid = j.position_pid
    firm: cython.double = share * j.max_torque
    if p.kp > 0.0:
        j.hold_place = clamp(j.hold_place, j.position - firm / p.kp, j.position + firm / p.kp)
    spring: cython.double = p.kp * j.spring
    damper: cython.double = p.kd * j.calm
    return clamp(spring * (j.hold_place - j.position) - damper * j.velocity, -firm, firm)


@cython.cfunc
def rubbing_torque(j: Joint) -> cython.double:
    """TORQUE and CURRENT before a first reference: the load and a hold that yields (M9)."""
    return j.torque_command + j.lift + hold_torque(j, HOLD_SHARE)


@cython.cfunc
def torque_law(j: Joint, reference: cython.double) -> cython.double:
    """Torque PID: u = kff·τ_ref + kp·e + ∫ki·e dt + kd·ė, e = τ_ref − τ (P7).

    A drive that closes this loop itself receives the reference.
    """
    p: Pid = j.torque_pid
    error: cython.double
    reference = clamp(reference, -j.max_torque, j.max_torque)
    j.torque_reference = reference
    if j.kind >= AS_TORQUE:
        return reference
    error = reference - j.torque
    return pid_step(p, reference, error, (error - p.error) / j.period)


@cython.cfunc
def law_torque(j: Joint) -> cython.double:
    """The torque requested by the law of the mode."""
    if j.law == POSITION or j.settling:
        return position_law(j)
    if j.law == IMPEDANCE:
        return torque_law(j, impedance(j))
    if j.law == CURRENT:
        return rubbing_torque(j)
    return torque_law(j, rubbing_torque(j) if j.holding else j.torque_command + j.lift)


@cython.cfunc
def control(j: Joint) -> cython.void:
    """The output of the law that runs (source Fig. 2)."""
    torque: cython.double
    drive: cython.double
    given: cython.double
    loop: Pid = j.torque_pid
    if j.law == OFF:
        j.output = 0.0
        return
    given = j.output_offset * j.per_feed if j.feeds else 0.0
    if j.kind in (AS_POSITION, AS_VELOCITY):
        lead_drive(j, given)
        return
    if j.coasts and j.law != POSITION and not j.settling:
        coast(j)
        return
    if j.kind == AS_IMPEDANCE and j.wire > 0.0 and (j.law == POSITION or j.settling):
        hand_down_spring(j, given)
        return
    if j.law == OUTPUT:
        output_law(j, j.output_command + given)
        return
    if j.law == CURRENT and not (j.settling or j.holding):
        drive = clamp(j.current_command + given, -j.max_drive, j.max_drive)
        hand_down(j, protect(j, drive))
        return
    if j.law == POSITION or j.settling:
        loop = j.position_pid
    torque = law_torque(j)
    drive = clamp(torque, -j.max_torque, j.max_torque)
    if drive != torque:
        unwind(loop, torque - drive)
    if drive == torque or j.law != POSITION:
        j.strain_cycles = 0
    elif j.strain_cycles < 1000000:
        j.strain_cycles += 1
    drive = ahead_of_winding(j, drive * j.per_torque)
    drive += j.compensation * j.per_speed * j.velocity + given
    given = protect(j, clamp(drive, -j.max_drive, j.max_drive))
    if given != drive:
        unwind(loop, drive - given)
    hand_down(j, given)


@cython.cfunc
def lead_drive(j: Joint, feed: cython.double) -> cython.void:
    """The set-point of a drive that closes the loop: of the reference, or of a goal (I5, S2)."""
    if j.law == IMPEDANCE and not j.settling:
        give_way(j)
        hand_down_path(j, feed, j.goal, j.goal_velocity)
    else:
        keep_near(j)
        hand_down_path(j, feed, j.followed, j.followed_velocity)


@cython.cfunc
def coast(j: Joint) -> cython.void:
    """Drive what the joint bears without its acceleration: it goes on as it moves (B7)."""
    drive: cython.double = clamp(j.load, -j.max_torque, j.max_torque) * j.per_torque
    drive = clamp(drive + j.per_speed * j.velocity, -j.max_drive, j.max_drive)
    j.asked = drive
    if j.law == OUTPUT:
        j.output = clamp(drive, -j.max_output, j.max_output)
    else:
        hand_down(j, drive)


@cython.cfunc
def output_law(j: Joint, output: cython.double) -> cython.void:
    """The given PWM u, percent; of a calibrator's drive that takes currents (K8) what it makes.

    i = (V_s u/100 − Ke q̇)/R
    """
    if j.kind == AS_CURRENT:
        output = (output / j.percent_per_volt - j.emf * j.velocity) / j.ohms
        j.set_current = protect(j, clamp(output, -j.max_drive, j.max_drive))
        return
    j.output = clamp(protect(j, output), -j.max_output, j.max_output)
    j.current_pid.integral = 0.0


@cython.cfunc
def ahead_of_winding(j: Joint, wanted: cython.double) -> cython.double:
    """The drive whose current is the wanted one at the end of the cycle.

    L di/dt = v − R i, solved for v over one period:  v = R (i' − a i)/(1 − a), a = exp(−T R/L),
    where i is the current that the last cycle wanted.
    """
    drive: cython.double = wanted
    if not j.in_amps and j.wire == 0.0:  # late, it would only add noise
        drive += j.lead * (wanted - j.asked)
    j.asked = wanted
    return drive


@cython.cfunc
def current_law(j: Joint, reference: cython.double) -> cython.double:
    """The inner loop of a board with current output (P10).

    v = R·(i_ref + lead·Δi_ref) + Ke·q̇ + PI(i_ref, i); the lead as in ``ahead_of_winding``. A
    user's reference (Y2) is a step: the PI compares with the one before, reached by now.
    """
    p: Pid = j.current_pid
    before: cython.double = p.reference
    reached: cython.double = before if j.law == CURRENT else reference
    feedback: cython.double = (
        late_feedback(j, reference)
        if j.wire > 0.0
        else pid_step(p, reference, reached - j.current, 0.0)
    )
    wanted: cython.double = j.percent_per_volt * (
        feedback + j.ohms * (reference + j.lead * (reference - before)) + j.emf * j.velocity
    )
    given: cython.double = clamp(wanted, -j.max_output, j.max_output)
    if given != wanted:
        unwind(p, wanted - given)
    return given


@cython.cfunc
def late_feedback(j: Joint, reference: cython.double) -> cython.double:
    """The PI of the current on a wire: a reading is compared with the reference of its time (B7).

    Its gains are as configured where kp/R + age·ki/R is within WIRE_PHASE, and less beyond, as
    those of the position loop; the same reading is not integrated twice.
    """
    p: Pid = j.current_pid
    error: cython.double = 0.0
    gain: cython.double = p.kp + p.ki_period / j.period * j.wire
    calm: cython.double = 1.0
    if j.missed == 0.0:
        error = j.drawn[place_of(j, j.age)] - j.current
    if gain > WIRE_PHASE * j.ohms:
        calm = WIRE_PHASE * j.ohms / gain
    pid_step(p, reference, error, 0.0)
    p.integral -= (1.0 - calm) * (p.integral - p.previous)
    return p.kp * calm * error + p.integral


# --- 4. protect -----------------------------------------------------------------------------


@cython.cfunc
def protect(j: Joint, drive: cython.double) -> cython.double:
    """Bound the drive by the speed limit, and by the software limits (P9, P14).

    Where no position law keeps a joint inside its limits, its speed towards one is bounded by its
    braking distance, and from beyond one it is driven back: to where it was found, where that is
    outside (P16).
    """
    top: cython.double = PURSUIT * j.max_velocity
    bottom: cython.double = -top
    free: cython.bint = j.law != POSITION and not j.settling
    if free:
        top, bottom = j.max_velocity, -j.max_velocity
        if j.calibrated:
            come_in(j, j.position)
            top = speed_towards(j, j.upper - j.position, top)
            bottom = -speed_towards(j, j.position - j.lower, -bottom)
            note_limit(j)
    drive = min(drive, speed_bound(j, top, 1.0))
    drive = max(drive, -speed_bound(j, -bottom, -1.0))
    return clamp(drive, -j.max_drive, j.max_drive)


@cython.cfunc
def speed_bound(j: Joint, top: cython.double, way: cython.double) -> cython.double:
    """The drive at which a joint just reaches a speed; speed and drive in direction ``way``, ±1.

    The motor's torque τ lags by its winding. Its excess for acceleration, n, follows from the last
    cycle, whatever load and friction are. At the end of this cycle n is at most what brings the
    joint to the speed while n decays by T/H per cycle:

    n0 = J q̈ + lag·Δτ,   n1 = (J (v_top − q̇) − lag·n0·T)/H,   τ1 = τ + n1 − n0,   H = 3 (T + delay)

    lag·Δτ is the torque at the end of the cycle beyond its mean. Torque grows as for a light
    joint, and is reduced as for a heavy one.
    """
    drive: cython.double
    span: cython.double = SPAN * (j.period + j.delay + j.wire)
    speed: cython.double = way * j.velocity
    torque: cython.double = way * j.current * j.torque_per_ampere
    grown: cython.double = torque - way * j.current_before * j.torque_per_ampere
    gain: cython.double = 1.0 + j.lag * j.period / span
    gained: cython.double = way * j.acceleration
    if j.wire > 0.0:  # more than the motor gives is an impact, which does not last
        gained = clamp(gained, -j.max_torque / j.inertia_min, j.max_torque / j.inertia_min)
        if j.law != POSITION and not j.settling:
            speed += gained * (j.age - j.missed)
    spare: cython.double = (top - speed) / span - gain * gained
    inertia: cython.double = LIGHT * j.inertia_min
    if spare < 0.0:
        inertia = min(HEAVY * j.inertia, WIDE * inertia)
    bound: cython.double = torque - gain * j.lag * grown + inertia * spare
    if bound >= j.max_torque:
        return INFINITE
    bound = max(bound, -j.max_torque)
    drive = j.per_torque * bound + j.per_speed * way * j.velocity
    if j.in_amps or j.wire > 0.0:
        return drive
    return drive + j.lead * j.per_torque * (bound - torque)


@cython.cfunc
def speed_towards(j: Joint, room: cython.double, top: cython.double) -> cython.double:
    """The speed allowed towards a limit at distance ``room``; negative beyond it."""
    speed: cython.double
    if room < 0.0:
        return room / RETURN
    speed = brake_speed(room, BRAKING * j.max_acceleration, j.period)
    return speed if speed < top else top


@cython.cfunc
def note_limit(j: Joint) -> cython.void:
    """Whether the joint is beyond a limit, with a hysteresis (P9)."""
    room: cython.double = j.limit_upper - j.position
    below: cython.double = j.position - j.limit_lower
    room = min(room, below)
    edge: cython.double = 0.01 * (j.limit_upper - j.limit_lower)
    edge = min(edge, j.limit_edge)
    j.on_limit = room < 0.0 or (j.on_limit and room < edge)


# --- 5. hand down ---------------------------------------------------------------------------


@cython.cfunc
def hand_down(j: Joint, drive: cython.double) -> cython.void:
    """The output of the laws as the drive's set-point (S1), or an impedance of equal torque.

    τ_ff = drive − k (q_set − q) − d (q̇_set − q̇) holds what the laws and their bounds add. Of the
    damping it subtracts the filtered rate that the law used: the raw one would return delayed.
    """
    p: Pid = j.position_pid
    spring: cython.double = 0.0
    if j.kind == AS_PWM:
        j.output = current_law(j, drive) if j.in_amps else drive
    elif j.kind == AS_CURRENT:
        j.set_current = drive
    elif j.kind == AS_TORQUE:
        j.set_torque = drive
    else:
        j.set_position, j.set_velocity = j.followed, 0.0
        j.set_stiffness = j.set_damping = 0.0
        if j.law == POSITION or j.settling:
            j.set_velocity = j.followed_velocity
            j.set_stiffness, j.set_damping = p.kp, p.kd
            spring = p.kp * p.error + p.kd * p.derivative
        elif j.law == IMPEDANCE:
            j.set_stiffness, j.set_damping = j.stiffness, j.damping
            spring = j.stiffness * (j.followed - j.position) - j.damping * j.velocity
        j.set_torque = drive - spring


@cython.cfunc
def hand_down_path(
    j: Joint, feed: cython.double, place: cython.double, velocity: cython.double
) -> cython.void:
    """A place of reference or goal for a drive that closes the loop of position or velocity (S2).

    τ_ff = τ(q, q̇_ref, q̈_ref) + τ_friction(q̇_ref) + the load on entering (M9); as a velocity:
    q̇_ref + v (q_ref − q), v = kp/kd of the position PID. What the drive sagged by under the load
    on entering is added to the place of a joint that gives way (M9).
    """
    p: Pid = j.position_pid
    torque: cython.double = p.integral + p.kff * place + j.forward + feed
    torque += friction(j, velocity)
    j.set_torque = clamp(torque, -j.max_torque, j.max_torque)
    j.set_position, j.set_velocity = place, velocity
    if j.sag != 0.0:
        j.set_position = clamp(place + j.sag, j.lower, j.upper)
    if j.kind == AS_VELOCITY:
        j.set_position = 0.0
        if not j.blind:
            j.set_velocity += j.calm * j.pursuit * (place - j.position)
        j.set_velocity = clamp(j.set_velocity, -PURSUIT * j.max_velocity, PURSUIT * j.max_velocity)
    j.torque_reference = j.set_torque


@cython.cfunc
def hand_down_spring(j: Joint, feed: cython.double) -> cython.void:
    """The followed reference for the drive's own spring and damper, where readings are late (B7).

    The drive knows the present error, the board an old one: of its own it adds the integral part.
    """
    p: Pid = j.position_pid
    keep_near(j)
    if not j.blind:
        pid_step(p, j.followed, j.followed - j.position, j.followed_velocity - j.velocity)
        soften(j)
    hand_down_path(j, feed, j.followed, j.followed_velocity)
    j.set_stiffness, j.set_damping = p.kp * j.spring, p.kd * j.calm


# --- the cycle ------------------------------------------------------------------------------


@cython.final
@cython.cclass
class Laws:
    """The control cycle of n joints, on views of the board's arrays.

    Args:
        joints: of class Joint.
        rows: measured position, velocity, torque, current; position, velocity and torque
            reference; output; age of the readings: a buffer of n doubles each.
        done: n bytes, 1 where no position move is under way.
        arm: the dynamics of these joints; None: each joint is modelled by its own inertia.
        feeds_arm: whether the arm is fed forward in all laws, else only in those that compensate
            gravity.
        handed: the rows of set-points except PWM, in the order of measurement.Value; None: all
            drives accept PWM.
        external: a buffer of n doubles for the torques from outside, NaN where they are not
            known; None: they are not observed.
    """

    joints: list[Joint]
    arm: Any
    stops: Any
    feeds_arm: cython.bint
    modelled: cython.bint  # the arm's dynamics act
    done: cython.uchar[::1]
    position: cython.double[::1]
    velocity: cython.double[::1]
    torque: cython.double[::1]
    current: cython.double[::1]
    position_reference: cython.double[::1]
    velocity_reference: cython.double[::1]
    torque_reference: cython.double[::1]
    output: cython.double[::1]
    age: cython.double[::1]
    set_current: cython.double[::1]
    set_torque: cython.double[::1]
    set_velocity: cython.double[::1]
    set_position: cython.double[::1]
    set_stiffness: cython.double[::1]
    set_damping: cython.double[::1]
    observes: cython.bint
    external: cython.double[::1]
    arm_position: cython.double[::1]
    arm_velocity: cython.double[::1]
    arm_acceleration: cython.double[::1]
    arm_torque: cython.double[::1]

    def __init__(
        self,
        joints: list[Joint],
        rows: list[object],
        done: object,
        arm: Arm | None = None,
        feeds_arm: bool = True,
        handed: list[object] | None = None,
        external: object | None = None,
    ) -> None:
        self.joints, self.arm, self.modelled = joints, arm, False
        self.stops = Stops(joints, arm)
        self.observes = external is not None
        if external is not None:
            self.external = external
        self.feeds_arm = feeds_arm
        (
            self.set_current,
            self.set_torque,
            self.set_velocity,
            self.set_position,
            self.set_stiffness,
            self.set_damping,
        ) = rows[:6] if handed is None else handed
        (
            self.position,
            self.velocity,
            self.torque,
            self.current,
            self.position_reference,
            self.velocity_reference,
            self.torque_reference,
            self.output,
            self.age,
        ) = rows
        self.done = done
        if arm is not None:
            self.arm_position, self.arm_velocity, self.arm_acceleration, self.arm_torque = arm.rows

    def step(self, elapsed: cython.double = 0.0) -> bool:
        """One control cycle of all joints.

        Args:
            elapsed: since the last one, s; 0: one control period.

        An output that is not finite is never written.

        Returns:
            Whether a joint came to a limit or left it, or diverged.
        """
        k: cython.Py_ssize_t
        j: Joint
        changed: cython.bint = False
        settling: cython.bint = False
        due: cython.bint = False
        yields: cython.bint = False
        known: cython.bint = self.arm is not None
        for k in range(len(self.joints)):
            j = self.joints[k]
            j.current_before = j.current
            j.torque, j.current = self.torque[k], self.current[k]
            pass_time(j, elapsed)
            observe(j, self.position[k], self.velocity[k], self.age[k])
            settling = settling or j.settling
            due = due or j.stop_due
            yields = yields or j.dead_band > 0.0
            known = known and j.calibrated
        if due:
            self.stops.plan(self.modelled)
        if settling and self.modelled:
            self.sense_motion()
        for k in range(len(self.joints)):
            weigh(self.joints[k])
        if settling:
            self.settle_joints()
        self.sense_external(yields and known)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if j.active and not j.braked:
                advance(j)
                self.position_reference[k] = j.reference
                self.velocity_reference[k] = j.reference_velocity
                self.done[k] = not j.moving
        self.feed_forward()
        self.compensate()
        for k in range(len(self.joints)):
            j = self.joints[k]
            control(j)
            if not fabs(j.output) <= MOST_OUTPUT or not is_number(set_point_sum(j)):
                j.give_up()
                self.position_reference[k], self.velocity_reference[k] = j.reference, 0.0
                changed = True
            self.torque_reference[k] = j.torque_reference
            if j.kind == AS_PWM or j.law == OFF:
                self.output[k] = j.output
            else:
                self.output[k] = 0.0
                self.hand_over(k, j)
            if has_news(j):
                changed = True
        return changed

    def prepare(self) -> bool:
        """Update motion and gravity before laws start; whether all joints are at rest."""
        k: cython.Py_ssize_t
        j: Joint
        resting: cython.bint = True
        for j in self.joints:
            resting = resting and j.at_rest()
        if self.modelled:
            self.sense_motion()
            self.sense_gravity()
            for k in range(len(self.joints)):
                j = self.joints[k]
                j.gravity = self.arm_torque[k]
        return resting

    @cython.cfunc
    def hand_over(self, k: cython.Py_ssize_t, j: Joint) -> cython.void:
        """Write the set-point of a joint into the rows of its drive."""
        self.set_current[k], self.set_torque[k] = j.set_current, j.set_torque
        self.set_velocity[k], self.set_position[k] = j.set_velocity, j.set_position
        self.set_stiffness[k], self.set_damping[k] = j.set_stiffness, j.set_damping

    @cython.cfunc
    def settle_joints(self) -> cython.void:
        """Capture the loads, of no joint before all of them are at rest."""
        j: Joint
        braking: cython.bint = False
        rested: cython.bint = True
        for j in self.joints:
            if j.settling and not j.awaited:
                braking = braking or j.active
                rested = rested and j.rest_cycles * j.period >= REST_TIME
        for j in self.joints:
            if j.settling:
                settle(j, braking, rested)

    @cython.cfunc
    def sense_motion(self) -> cython.void:
        """Torque of each joint for the measured motion of the arm, gravity left out."""
        k: cython.Py_ssize_t
        j: Joint
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k], self.arm_velocity[k] = j.position, j.velocity
            self.arm_acceleration[k] = j.acceleration
        self.arm.inverse(0.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if is_number(self.arm_torque[k]):
                j.motion = self.arm_torque[k]

    @cython.cfunc
    def sense_external(self, yields: cython.bint = False) -> cython.void:
        """Torques from outside; NaN without a model, or a torque that the joint gives (X1).

        Args:
            yields: Whether the arm is known and a joint gives way to its torque, which is then
                observed also with a model that nothing else reckons with.
        """
        k: cython.Py_ssize_t
        j: Joint
        wanted: cython.bint = False
        if not self.observes:
            return
        if self.modelled or yields:
            for k in range(len(self.joints)):
                j = self.joints[k]
                wanted = wanted or j.external_share > 0.0
                self.arm_position[k], self.arm_velocity[k] = j.position, j.sampled
                self.arm_acceleration[k] = j.acceleration
            if wanted:
                self.arm.inverse(1.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if (
                wanted
                and j.external_share > 0.0
                and (self.modelled or j.dead_band > 0.0)
                and not (j.braked and not j.has_torque_sensor)
                and is_number(self.arm_torque[k])
            ):
                self.external[k] = observe_external(j, self.arm_torque[k])
            else:
                self.external[k] = NAN
                j.external = j.unobserved = j.contact_lasted = 0.0
                j.contact = j.feels = False

    @cython.cfunc
    def sense_gravity(self) -> cython.void:
        """Gravity torque of the arm in its measured pose."""
        k: cython.Py_ssize_t
        j: Joint
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k] = j.position
            self.arm_velocity[k] = self.arm_acceleration[k] = 0.0
        self.arm.inverse(1.0)

    @cython.cfunc
    def feed_forward(self) -> cython.void:
        """Torque of the followed references, with gravity where all angles are known."""
        k: cython.Py_ssize_t
        j: Joint
        if not self.knows_arm():
            for j in self.joints:
                j.forward = j.inertia * j.followed_acceleration
                if j.dead_band > 0.0 and j.law == IMPEDANCE and not j.settling:
                    j.forward = 0.0
            return
        for k in range(len(self.joints)):
            j = self.joints[k]
            self.arm_position[k] = j.position
            if j.law == POSITION or j.settling:
                self.arm_velocity[k] = j.followed_velocity
                self.arm_acceleration[k] = j.followed_acceleration
            else:
                self.arm_velocity[k], self.arm_acceleration[k] = j.velocity, 0.0
        self.arm.inverse(1.0)
        for k in range(len(self.joints)):
            j = self.joints[k]
            if is_number(self.arm_torque[k]):
                j.forward = self.arm_torque[k]

    @cython.cfunc
    def compensate(self) -> cython.void:
        """Gravity torque of the joints that compensate it, in the measured pose (G1)."""
        k: cython.Py_ssize_t
        j: Joint
        wanted: cython.bint = False
        known: cython.bint = self.arm is not None
        for j in self.joints:
            wanted = wanted or j.compensates or j.lifts
            known = known and j.calibrated
        if not wanted:
            return
        if known:
            self.sense_gravity()
        for k in range(len(self.joints)):
            j = self.joints[k]
            if not known:
                j.carry(0.0, False)
            elif is_number(self.arm_torque[k]):
                j.carry(self.arm_torque[k], True)

    def forget_arm(self) -> None:
        """Before the arm's masses change: integral parts hold the load until the next cycle."""
        if self.modelled:
            self.turn_arm(False)

    @cython.cfunc
    def knows_arm(self) -> cython.bint:
        """Whether the arm's dynamics act: all angles are known.

        Gravity is then fed forward, and the integral parts are reduced by it.
        """
        j: Joint
        known: cython.bint = self.arm is not None and self.feeds_arm
        for j in self.joints:
            known = known and j.calibrated
        if known != self.modelled:
            self.turn_arm(known)
        return known

    @cython.cfunc
    def turn_arm(self, known: cython.bint) -> cython.void:
        """Switch the arm's dynamics on or off without a step of torque."""
        k: cython.Py_ssize_t
        j: Joint
        sign: cython.double
        self.modelled = known
        self.sense_gravity()
        sign = 1.0 if known else -1.0
        for k in range(len(self.joints)):
            j = self.joints[k]
            j.position_pid.integral -= sign * self.arm_torque[k]
            j.gravity = self.arm_torque[k] if known else 0.0


@cython.cfunc
@cython.inline
def is_number(value: cython.double) -> cython.bint:
    """Whether a value is finite."""
    return value - value == 0.0


@cython.cfunc
def set_point_sum(j: Joint) -> cython.double:
    """Finite where all values of the set-point are."""
    return (
        j.set_current
        + j.set_torque
        + j.set_velocity
        + j.set_position
        + j.set_stiffness
        + j.set_damping
    )


@cython.cfunc
def has_news(j: Joint) -> cython.bint:
    """Whether a joint came to a limit or left it: of position, torque, or torque from outside."""
    changed: cython.bint = j.on_limit != j.was_on_limit or j.contact != j.had_contact
    strained: cython.bint = j.strain_cycles * j.period >= STRAIN_TIME
    changed = changed or strained != j.strained
    j.was_on_limit, j.strained, j.had_contact = j.on_limit, strained, j.contact
    return changed
