# SPDX-License-Identifier: Apache-2.0
"""Streams of direct positions (SPEC P4): which motion late and lost samples belong to.

Decision 25 says what was measured, and what was not taken.
"""

from __future__ import annotations

from math import exp, fabs, log

from ... import nocython as cython
from .formulas import INFINITE, clamp, row

#: Longest mean interval, s, at which direct positions become a stream, and at which they remain
#: one; half of the intervals' mean deviation is added. Slower ones are steps.
MAX_BEGINNING_INTERVAL = cython.declare(cython.double, 0.052)
MAX_STREAM_INTERVAL = cython.declare(cython.double, 0.060)
#: Age at which a direct position ends its stream, s: five intervals at 20 Hz.
STREAM_END_AGE = cython.declare(cython.double, 0.25)
#: Shortest interval of a stream that the tracking assumes, s.
MIN_STREAM_INTERVAL = cython.declare(cython.double, 0.008)
#: Samples that a motion is fitted to, and their least distance, s.
KNOTS = cython.declare(cython.int, 6)
MIN_KNOT_DISTANCE = cython.declare(cython.double, 0.012)
#: Interval above which jitter does not hide the curvature of a motion, s.
JITTER_INTERVAL = cython.declare(cython.double, 0.025)
#: Memory of the interval; of the curvature; of residuals; in samples.
MEMORY = cython.declare(cython.double, 100.0)
CURVATURE_MEMORY = cython.declare(cython.double, 12.0)
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
#: What another numbering must improve, in twice the logarithm of a likelihood; mean square of
#: predictions then, at most, in those of third differences.
RENUMBER = cython.declare(cython.double, 15.0)
RENUMBERED_RESIDUAL = cython.declare(cython.double, 4.0)
#: Cost of a sample taken for lost, with that of the first ones over their number; maximum costs
#: of the arrival and of the value; all in squares of standard deviations.
LOSS = cython.declare(cython.double, 3.0)
EARLY_LOSS = cython.declare(cython.double, 100.0)
MAX_ARRIVAL_COST = cython.declare(cython.double, 40.0)
MAX_VALUE_COST = cython.declare(cython.double, 60.0)


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
    ss = cc = sc = s1 = c1 = cython.declare(cython.double, visibility="public")  # sums of the fit
    x = v = a = cython.declare(cython.double, visibility="public")
    residual = cython.declare(cython.double, visibility="public")  # mean square, of predictions

    def __init__(self) -> None:
        self.times = row(KNOTS)
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
        self, before: cython.double, time: cython.double, max_acceleration: cython.double
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
        self.a = clamp(before / sine(self.turning, time), -max_acceleration, max_acceleration)

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
        n = 1.0 / knots  # about the means
        ss = 0.0
        cc = 0.0
        sc = 0.0
        s1 = 0.0
        c1 = 0.0
        y1 = 0.0
        ys = 0.0
        yc = 0.0
        span = -self.times[knots - 1]
        self.x, self.a = values[0], 0.0
        if span <= 0.0:
            return
        scale = 1.0 / span
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
        whole = ss * cc - sc * sc
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
        d1 = 0.0
        ds = 0.0
        dc = 0.0
        gg = 0.0
        ge = 0.0
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
    z = turning * t * t
    return t * (1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0)))


@cython.cfunc
@cython.inline
def versine(turning: cython.double, t: cython.double) -> cython.double:
    """(1 − cos ωt)/ω² as a series of ω²; t²/2 where ω is zero."""
    z = turning * t * t
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
    samples: cython.double[::1]  # their values
    bends: cython.double[::1]  # ln(1 + D²/s²) from each of them on
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
    # sums of the regression
    weight = sum_k = sum_t = sum_kk = sum_kt = cython.declare(cython.double, visibility="public")
    missing = cython.declare(cython.double, visibility="public")  # samples lost per sample
    share = cython.declare(cython.double, visibility="public")  # of the last sample in ω²
    mean = cython.declare(cython.double, visibility="public")  # time between samples, s
    latest = cython.declare(cython.double, visibility="public")  # most of lateness, s
    pace = cython.declare(cython.double, visibility="public")  # mean square of velocities
    surprise = cython.declare(cython.double, visibility="public")  # of values, of late
    on_grid = cython.declare(cython.bint, visibility="public")
    flows = cython.declare(cython.bint, visibility="public")  # fast enough

    def __init__(self) -> None:
        self.values = row(KNOTS)
        self.numbers = row(KNOTS)
        self.arrivals = row(ARRIVALS)
        self.samples = row(ARRIVALS)
        self.bends = row(ARRIVALS)
        self.places = row(ARRIVALS)
        self.grid, self.sent = TimeBase(), TimeBase()
        self.count = 0.0

    @cython.cfunc
    def take(
        self,
        x: cython.double,
        velocity: cython.double,
        has_velocity: cython.bint,
        age: cython.double,
        period: cython.double,
        max_velocity: cython.double,
        max_acceleration: cython.double,
    ) -> cython.void:
        """Add a sample.

        Args:
            x: rad.
            velocity: rad/s; ignored unless ``has_velocity``.
            has_velocity: whether the sample has a velocity.
            age: of the last sample, control cycles.
            period: of control, s.
            max_velocity: rad/s; a faster difference is a step.
            max_acceleration: rad/s².
        """
        d = age * period
        if self.count == 0.0 or d > STREAM_END_AGE or d > 5.0 * self.interval > 0.0:
            self.count = 0.0
        elif self.count == 1.0:
            reach = max_velocity * d
        else:
            reach = max_velocity * (d + self.late + 0.5 * self.interval)
        if self.count > 0.0 and fabs(x - self.last) > reach:
            self.count = 0.0  # a step
        if self.count == 0.0:
            self.begin(x, velocity if has_velocity else 0.0, has_velocity)
            return
        self.count += 1.0
        m = self.clock(x, d, period)
        self.keep(x, d, m)
        self.grid.fit(self.values, self.knots, max_acceleration, self.share)
        if self.interval > 1.5 * period:
            few: cython.bint = self.knots > 5 and 0.015 < self.interval < JITTER_INTERVAL
            self.sent.fit(self.values, 5 if few else self.knots, max_acceleration, self.share)
        if has_velocity:
            self.take_velocity(velocity, d, m, max_acceleration)
        self.last, self.last_velocity = x, velocity
        reach = MAX_STREAM_INTERVAL if self.flows else MAX_BEGINNING_INTERVAL
        reach += 0.5 * self.uneven
        self.flows = self.interval < reach and (
            has_velocity or self.count > 2.0
        )  # two may be two steps

    @cython.cfunc
    def begin(
        self, x: cython.double, velocity: cython.double, has_velocity: cython.bint
    ) -> cython.void:
        """Start with one sample."""
        self.count, self.knots, self.pushed, self.weight = 1.0, 1, 0.0, 1.0
        self.values[0], self.numbers[0], self.samples[0] = x, 0.0, x
        self.grid.clear(x, velocity)
        self.sent.clear(x, velocity)
        self.last, self.last_velocity = x, velocity
        self.interval = self.early = self.late = self.uneven = self.gap = self.missing = 0.0
        self.sum_k = self.sum_t = self.sum_kk = self.sum_kt = self.mean = self.latest = 0.0
        self.pace = self.surprise = 0.0
        self.heard = 1
        self.on_grid = True
        self.flows = has_velocity

    @cython.cfunc
    def clock(self, x: cython.double, d: cython.double, period: cython.double) -> cython.double:
        """Update interval, lateness and time base after ``d`` s; ``d`` in intervals."""
        m = self.intervals(x, d) if self.count > 2.0 else 1.0
        n = self.count
        self.missing += 0.05 * (m - 1.0 - self.missing)
        self.mean += (d - self.mean) / (n - 1.0 if n < 20.0 else 20.0)
        if n > 20.0 and self.missing > (0.15 if self.surprise > DOUBTFUL else 0.25):
            # none is lost: the interval is longer
            self.missing = self.sum_k = self.sum_t = 0.0
            self.sum_kk, self.sum_kt = 20.0, 20.0 * self.mean
            self.weight, self.count, n, m = 1.0, 8.0, 8.0, 1.0
        fade = 1.0 - 1.0 / MEMORY
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
        self.settle_phase(x, d, m, period)
        error = x - self.grid.at(m * self.interval)
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
        self, x: cython.double, d: cython.double, m: cython.double, period: cython.double
    ) -> cython.void:
        """Lateness of the last sample; the earliest of the last ARRIVALS is in time."""
        latest = 0.0
        if self.heard < ARRIVALS:
            self.heard += 1
        for k in range(self.heard - 1, 0, -1):
            self.arrivals[k] = self.arrivals[k - 1] - d
            self.samples[k] = self.samples[k - 1]
            self.places[k] = self.places[k - 1] + m
        self.samples[0] = x
        if self.heard >= CHECKED and self.surprise > DOUBTFUL:
            for _ in range(4):  # several may be wrong
                if not self.renumber(d, period):
                    break
        self.early = 0.0
        for k in range(1, self.heard):
            late = self.arrivals[k] + self.places[k] * self.interval
            self.early = min(self.early, late)
            latest = max(latest, late)
        self.late = 0.1 * self.uneven - self.early
        self.latest = latest - self.early
        self.latest = min(self.latest, 0.8 * self.interval)

    @cython.cfunc
    def renumber(self, d: cython.double, period: cython.double) -> cython.bint:
        """Find a loss that was not seen, or seen where none was, in the last arrivals.

        The cost of a numbering is n ln(Σ e²) of the arrivals, e: what their regression over the
        numbers leaves, and Σ ln(1 + D²/s²) of the values, D: their third differences, s²: the
        geometric mean of D². It is compared with those where a gap is longer or shorter by one
        interval.
        """
        n = self.heard
        sum_x = 0.0
        sum_y = 0.0
        xx = 0.0
        xy = 0.0
        yy = 0.0
        for k in range(n):
            x = -self.places[k]
            sum_x += x
            sum_y += self.arrivals[k]
            xx += x * x
            xy += x * self.arrivals[k]
            yy += self.arrivals[k] * self.arrivals[k]
        yy -= sum_y * sum_y / n
        steps = 0.1 * n * period * period
        scale = self.weigh_bends()
        least = n * log(self.left_over(n, sum_x, sum_y, xx, xy, yy) + steps) - RENUMBER
        first = 0
        change = 0.0
        tail_n = 0.0
        tail_x = 0.0
        tail_y = 0.0
        for k in range(n - 1, 0, -1):
            tail_n += 1.0
            tail_x -= self.places[k]
            tail_y += self.arrivals[k]
            for sign in range(-1, 2, 2):
                if sign < 0 and self.places[k] - self.places[k - 1] < 1.5:
                    continue
                left = self.left_over(
                    n,
                    sum_x - sign * tail_n,
                    sum_y,
                    xx - 2.0 * sign * tail_x + tail_n,
                    xy - sign * tail_y,
                    yy,
                )
                left = n * log(left + steps)
                left += self.bend_more(k, sign, scale, least - left)
                if left < least:
                    least, first, change = left, k, sign
        if first == 0:
            return False
        self.missing += 0.05 * change
        self.surprise = 0.0
        self.grid.residual = min(self.grid.residual, RENUMBERED_RESIDUAL * scale)
        for k in range(self.knots):
            if self.sent.times[k] - d <= self.arrivals[first]:
                self.numbers[k] -= change
        for k in range(first, n):
            self.places[k] += change
        self.regress()
        self.find_interval(period)
        return True

    @cython.cfunc
    def regress(self) -> cython.void:
        """The sums of the regression, of the last arrivals alone."""
        self.weight = self.sum_k = self.sum_t = self.sum_kk = self.sum_kt = 0.0
        for k in range(self.heard):
            self.weight += 1.0
            self.sum_k -= self.places[k]
            self.sum_t += self.arrivals[k]
            self.sum_kk += self.places[k] * self.places[k]
            self.sum_kt -= self.places[k] * self.arrivals[k]

    @cython.cfunc
    def weigh_bends(self) -> cython.double:
        """s², rad²; ln(1 + D²/s²) of each sample goes into ``bends``."""
        scale = 0.0
        n = self.heard - 3
        least = 1e-9 * self.interval * self.interval * self.pace
        for k in range(n):
            self.bends[k] = self.bend(k, 0, 0.0)
            scale += log(self.bends[k] + least)
        scale = exp(scale / n)
        for k in range(n):
            self.bends[k] = log(1.0 + self.bends[k] / scale)
        return scale

    @cython.cfunc
    def bend_more(
        self, first: cython.int, change: cython.double, scale: cython.double, limit: cython.double
    ) -> cython.double:
        """What Σ ln(1 + D²/s²) grows by where samples are earlier; too much if > ``limit``."""
        begin = max(first - 3, 0)
        end = min(first, self.heard - 3)
        more = 0.0
        for k in range(begin, end):
            more -= self.bends[k]
        if more < limit:
            for k in range(begin, end):
                more += log(1.0 + self.bend(k, first, change) / scale)
        return more

    @cython.cfunc
    def bend(self, k: cython.int, first: cython.int, change: cython.double) -> cython.double:
        """D², D: three intervals' difference of the values of the samples k to k + 3, rad.

        Sample ``first`` and those before it (0: none) are ``change`` intervals earlier.
        """
        p0 = self.places[k] + (change if k >= first > 0 else 0.0)
        p1 = self.places[k + 1] + (change if k + 1 >= first > 0 else 0.0)
        p2 = self.places[k + 2] + (change if k + 2 >= first > 0 else 0.0)
        p3 = self.places[k + 3] + (change if k + 3 >= first > 0 else 0.0)
        a = (self.samples[k] - self.samples[k + 1]) / (p1 - p0)
        b = (self.samples[k + 1] - self.samples[k + 2]) / (p2 - p1)
        c = (self.samples[k + 2] - self.samples[k + 3]) / (p3 - p2)
        a = (a - b) / (p2 - p0)
        b = (b - c) / (p3 - p1)
        a = 6.0 * (a - b) / (p3 - p0)
        return a * a

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
        m = 1.0
        least = INFINITE
        interval = self.interval
        if self.count < 7.0 and d < 2.2 * interval:
            return m
        loss = LOSS + EARLY_LOSS / self.count
        width = 0.1 * interval + 8.0 * self.uneven / self.count
        step = 0.1 * interval * self.grid.v
        spread = self.grid.residual + step * step
        for k in range(1, 7):
            cost = loss * (k - 1)
            error = self.late + d - k * interval
            if error > 0.0:
                error = max(error - self.latest, 0.0)
            error /= width
            error *= error
            cost += min(error, MAX_ARRIVAL_COST)
            if self.count > 7.0 and spread > 0.0:
                error = x - self.grid.at(k * interval)
                error *= error / spread
                cost += min(error, MAX_VALUE_COST)
            if cost < least:
                m, least = k, cost
        return m

    @cython.cfunc
    def keep(self, x: cython.double, d: cython.double, m: cython.double) -> cython.void:
        """Store a sample; it replaces the last one where that one is close to its predecessor."""
        grid = self.grid.times
        sent = self.sent.times
        self.share = 0.0
        apart = 0.6 * self.interval
        apart = max(apart, MIN_KNOT_DISTANCE)
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
        self.share = 1.0 / (first if first < CURVATURE_MEMORY else CURVATURE_MEMORY)

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
        least = 1.5 * (
            self.interval if self.interval > MIN_STREAM_INTERVAL else MIN_STREAM_INTERVAL
        )
        longest = 1.2 * self.gap
        if self.uneven > 0.1 * self.interval:
            longest = self.interval + 3.5 * self.uneven
            longest = 1.1 * (longest if longest > self.gap else self.gap) + 2.0 * self.interval
        return longest if longest > least else least

    @cython.cfunc
    def end(self) -> cython.void:
        """Forget the samples: the next one begins another stream."""
        self.count, self.flows = 0.0, False

    @cython.cfunc
    def velocity(self) -> cython.double:
        """Velocity of the motion at the last sample, rad/s; 0 for a step."""
        if not self.flows:
            return 0.0
        return self.grid.v if self.on_grid else self.sent.v
