# SPDX-License-Identifier: Apache-2.0
"""The checks of every cycle that raise hardware faults, one joint at a time (SPEC F1, F3, F6).

1. ``take``          a reading, into the rows of the board; those of the reading before are kept
2. ``first_passed``  the bounds of a reading; NaN and infinity pass every bound, and the last
                     valid reading replaces them from here on
3. ``integrate``     of each new reading the motor's output and current, over the time since the
                     last one; ``restart`` where its bridge was switched, or readings stayed away
4. ``look``          every SLOW periods the slow checks: travel of encoder against motor, hard
                     limits, I²t; and the warnings

Plain Python in Cython's pure mode: compiled where there is a compiler, and the same numbers, bit
by bit, where there is none. Units: rad, rad/s, N·m, A, °C, s; m and N for prismatic joints.
"""

from __future__ import annotations

from math import fabs

from ... import nocython as cython
from ..terms.measurement import CREDIBLE, MOTOR_ROWS, ROWS, doubles

#: The checks, in the order of the search for a cause; causes.Check gives them names.
NOTHING = cython.declare(cython.int, 0)
ALARM = cython.declare(cython.int, 1)
CURRENT = cython.declare(cython.int, 2)
ENCODER_AGE = cython.declare(cython.int, 3)
POSITION = cython.declare(cython.int, 4)
VELOCITY = cython.declare(cython.int, 5)
TORQUE_AGE = cython.declare(cython.int, 6)
TORQUE = cython.declare(cython.int, 7)
TEMPERATURE = cython.declare(cython.int, 8)
TRAVEL = cython.declare(cython.int, 9)
OVERRUN = cython.declare(cython.int, 10)
OVERLOAD = cython.declare(cython.int, 11)
OVERSPEED = cython.declare(cython.int, 12)

#: Fresh readings in a row that are a joint's overspeed (F7).
OVERSPEED_READINGS = cython.declare(cython.int, 5)

#: Longest time between two readings over which a motor's travel is integrated, s.
MAX_GAP_S = cython.declare(cython.double, 0.03)

#: Hysteresis of the warnings: part of the budget, K.
BUDGET_HYSTERESIS = cython.declare(cython.double, 0.1)
HYSTERESIS_K = cython.declare(cython.double, 2.0)

INFINITE = cython.declare(cython.double, float("inf"))

CREDIBLE_BOUND = cython.declare(cython.double, CREDIBLE)


@cython.cclass
class JointMonitor:
    """State of one joint's checks; ``fault_monitor`` sets constants and limits."""

    # --- constants of the configuration -----------------------------------------------------
    travel_per_output = cython.declare(cython.double, visibility="public")
    travel_per_current = cython.declare(cython.double, visibility="public")
    travel_per_change = cython.declare(cython.double, visibility="public")
    travel_per_age = cython.declare(cython.double, visibility="public")  # 1/s
    middle = cython.declare(cython.double, visibility="public")  # between the hard limits
    nominal_squared = cython.declare(cython.double, visibility="public")  # i_nom², A²
    budget = cython.declare(cython.double, visibility="public")  # S, A² s
    warn_used = cython.declare(cython.double, visibility="public")  # part of the budget
    warn_temperature = cython.declare(cython.double, visibility="public")

    # --- limits in force; infinite while the joint is not configured (N1) -------------------
    max_alarm = max_current = max_encoder_age = cython.declare(cython.double, visibility="public")
    max_jump = max_velocity = cython.declare(cython.double, visibility="public")
    max_torque_age = max_torque = cython.declare(cython.double, visibility="public")
    max_temperature = cython.declare(cython.double, visibility="public")
    max_travel = max_overrun = max_overload = cython.declare(cython.double, visibility="public")

    # --- state ------------------------------------------------------------------------------
    live = cython.declare(cython.double, visibility="public")  # 1 with power, 0 without
    fed = cython.declare(cython.double, visibility="public")  # the same of its motor, if coupled
    switched = cython.declare(cython.bint, visibility="public")  # no reading shows it yet
    since = cython.declare(cython.double, visibility="public")  # it was switched, s
    read = cython.declare(cython.bint, visibility="public")  # there was a position
    seen = cython.declare(cython.bint, visibility="public")  # there is a last position
    last = cython.declare(cython.double, visibility="public")  # position, no offset taken off
    moved = cython.declare(cython.double, visibility="public")  # to the last position
    age = cython.declare(cython.double, visibility="public")  # of the last reading, s
    fast = cython.declare(cython.int, visibility="public")  # readings beyond max_velocity in a row
    lowest = cython.declare(cython.double, visibility="public")  # the next position may be
    highest = cython.declare(cython.double, visibility="public")
    outputs = cython.declare(cython.double, visibility="public")  # sums since the last look
    currents = cython.declare(cython.double, visibility="public")
    mark = cython.declare(cython.double, visibility="public")  # position where they begin
    first = cython.declare(cython.double, visibility="public")  # current where they begin
    current = cython.declare(cython.double, visibility="public")  # at the last reading, A
    drove = cython.declare(cython.double, visibility="public")  # the output then, percent
    drawn = cython.declare(cython.double, visibility="public")  # that of its motor, if coupled
    travel = cython.declare(cython.double, visibility="public")  # of motor less encoder
    doubt = cython.declare(cython.double, visibility="public")  # of the motor's, where not read
    overrun = cython.declare(cython.double, visibility="public")  # position from the middle
    overload = cython.declare(cython.double, visibility="public")  # s of I²t, A² s
    used = cython.declare(cython.double, visibility="public")  # s/S
    temperature = cython.declare(cython.double, visibility="public")  # at the last look
    strained = cython.declare(cython.bint, visibility="public")  # warned of
    hot = cython.declare(cython.bint, visibility="public")  # warned of

    # --- failed checks ----------------------------------------------------------------------
    passed = cython.declare(cython.int, visibility="public")  # the first bound
    slipped = cython.declare(cython.bint, visibility="public")  # beyond max_travel
    overran = cython.declare(cython.bint, visibility="public")  # beyond max_overrun
    overloaded = cython.declare(cython.bint, visibility="public")  # beyond max_overload
    raced = cython.declare(
        cython.bint, visibility="public"
    )  # beyond max_velocity for OVERSPEED_READINGS

    def __init__(self) -> None:
        self.expect_anything()

    def set(self, values: dict[str, float]) -> None:
        """Set constants or limits: names and values of attributes."""
        for name, value in values.items():
            setattr(self, name, value)

    @cython.ccall
    def expect_anything(self) -> cython.void:
        """Accept any next position."""
        self.lowest, self.highest = -INFINITE, INFINITE

    @cython.ccall
    def failed(self) -> cython.int:
        """The first check that the joint fails; NOTHING when it is healthy."""
        if self.passed != NOTHING:
            return self.passed
        if self.slipped:
            return TRAVEL
        if self.overran:
            return OVERRUN
        if self.overloaded:
            return OVERLOAD
        if self.raced:
            return OVERSPEED
        return NOTHING

    @cython.ccall
    def forget_travel(self) -> cython.void:
        """Restart the comparison of encoder and motor."""
        self.travel, self.doubt, self.slipped = 0.0, 0.0, False


@cython.cfunc
@cython.inline
def known(value: cython.double, before: cython.double) -> cython.double:
    """The value, or the one before it where it is not valid."""
    return value if fabs(value) <= CREDIBLE_BOUND else before


@cython.cfunc
def expect(m: JointMonitor, position: cython.double) -> cython.void:
    """Set the range of the next reading: from no motion to that of the last cycle.

    q + min(0, Δ) − m ≤ q' ≤ q + max(0, Δ) + m, with Δ the last displacement and m = max_jump
    """
    moved = position - m.last if m.seen and m.passed != POSITION else 0.0
    m.lowest = position + min(moved, 0.0) - m.max_jump
    m.highest = position + max(moved, 0.0) + m.max_jump
    m.last, m.moved, m.seen = position, moved, True


@cython.cfunc
def expect_later(m: JointMonitor, periods: cython.double) -> cython.void:
    """Widen the range where the next reading comes later than in a cycle (B6, B7)."""
    more = periods - 1.0
    m.lowest += more * (min(m.moved, 0.0) - m.max_jump)
    m.highest += more * (max(m.moved, 0.0) + m.max_jump)


@cython.cfunc
def check_speed(m: JointMonitor, velocity: cython.double) -> cython.void:
    """Count fresh readings beyond max_velocity of a joint with power (F7)."""
    if fabs(velocity) <= m.max_velocity:
        m.fast, m.raced = 0, False
    elif m.live > 0.0 and not m.raced:
        m.fast += 1
        m.raced = m.fast >= OVERSPEED_READINGS


@cython.cfunc
@cython.inline
def integrate(
    m: JointMonitor, current: cython.double, output: cython.double, periods: cython.double
) -> cython.void:
    """Add a new reading to the sums, of the periods since the last one.

    What a reading shows acted in its own period; between two that are further apart it is taken
    to have changed evenly. How far their speeds differ is the doubt: a set-point that came late to
    a drive's own loop shows a voltage that is none of the motion. So is what the encoder moved:
    such a loop takes each set-point as a step, in the same phase of which it may always be read.
    """
    if periods > 1.0:
        unseen = 0.5 * (periods - 1.0)
        m.currents += unseen * (m.current + current)
        m.outputs += unseen * (m.drove + output)
        m.doubt += unseen * fabs(
            m.travel_per_output * (output - m.drove) - m.travel_per_current * (current - m.current)
        )
        m.doubt += (1.0 - 1.0 / periods) * fabs(m.moved)
        periods = 1.0
    m.currents += current * periods
    m.outputs += output * periods
    m.current, m.drove = current, output


@cython.cfunc
def restart(m: JointMonitor, position: cython.double, current: cython.double) -> cython.void:
    """Compare motor and encoder from this reading on."""
    m.mark, m.first = position, current
    m.currents = m.outputs = 0.0


@cython.cfunc
def is_shown(m: JointMonitor, elapsed: cython.double) -> cython.bint:
    """Whether a reading shows a bridge as it was switched: it went there as late as it comes."""
    m.since += elapsed
    return m.since > 2.0 * m.age


@cython.cfunc
def motor_travel(m: JointMonitor, current: cython.double) -> cython.double:
    """Travel of the motor since the last check, from its own equation; 0 without power.

    V = R i + L di/dt + Ke ω, over the cycles k of period T with the currents i_k at their ends::

        Ke Δq = T Σ V_k − R T Σ i_k − (L − w R T) (i_last − i_first)

    w is the weight of a cycle's first current in its mean (``fault_monitor.first_weight``).
    """
    return m.live * (
        m.travel_per_output * m.outputs
        - m.travel_per_current * m.currents
        - m.travel_per_change * (current - m.first)
    )


@cython.cfunc
def check_travel(
    m: JointMonitor,
    travelled: cython.double,
    position: cython.double,
    current: cython.double,
    forget: cython.double,
) -> cython.void:
    """Compare the travel of motor and encoder, with slow forgetting (F1).

    Where readings are late, the output that acts may be known that much earlier, or later. The
    doubt of what was not read fades as the travel does, and what was not needed of it at once: an
    encoder that fails amid motion is found as if there had been none.
    """
    m.travel = forget * m.travel + (travelled - (position - m.mark) * m.live)
    m.mark, m.first = position, current
    m.currents = m.outputs = 0.0
    error = fabs(m.travel)
    m.slipped = not error <= m.max_travel + m.travel_per_age * m.age + m.doubt
    m.doubt = forget * min(m.doubt, error)


@cython.cfunc
def check_overrun(m: JointMonitor, position: cython.double) -> cython.void:
    """Check the hard limits, by the distance from their middle (F1)."""
    m.overrun = position - m.middle
    m.overran = not fabs(m.overrun) <= m.max_overrun


@cython.cfunc
def check_overload(m: JointMonitor, current: cython.double, elapsed: cython.double) -> cython.void:
    """I²t: s' = max(0, s + (p i² − i_nom²) Δt), p 1 with power and 0 without (F1).

    A current beyond the peak counts as the peak: its joint loses power by overcurrent.
    """
    current = min(fabs(current), m.max_current)
    m.overload += (current * current * m.fed - m.nominal_squared) * elapsed
    m.overload = max(m.overload, 0.0)
    m.used = m.overload / m.budget
    m.overloaded = not m.overload <= m.max_overload


@cython.cfunc
def warn(m: JointMonitor, temperature: cython.double) -> cython.bint:
    """Whether a warning of heat begins or ends (F6)."""
    strained: cython.bint = m.used > m.warn_used - (BUDGET_HYSTERESIS if m.strained else 0.0)
    hot: cython.bint = temperature > m.warn_temperature - (HYSTERESIS_K if m.hot else 0.0)
    news: cython.bint = strained != m.strained or hot != m.hot
    m.temperature, m.strained, m.hot = temperature, strained, hot
    return news


@cython.cclass
class Monitor:
    """The checks of n joints, on views of the board's arrays.

    Args:
        joints: Of class JointMonitor.
        blocks: A reading as measured, no offset taken off; the rows of the board that it goes to;
            their values before it, shape (ROWS, n) each; what is measured at the motors, shape
            (MOTOR_ROWS, n); all C-contiguous.
        readings: Rows of the first block: alarm, current, encoder age, position, velocity, age of
            the torque, torque, temperature: a buffer of n doubles each.
        rows: Position, current and output asked for of the joint (read; the current differs
            from that of its motor where motors are coupled), output that acts, travel of the
            motors since power-on and part of the I²t budget used (written), the same.
        slow: Periods from one slow check to the next.
        period: Of control, s.
        forget: Factor of a travel error from one slow check to the next.

    Attributes:
        news: A warning of heat has begun or ended since this was set to false.
        countdown: Periods until the next slow check.
    """

    news = cython.declare(cython.bint, visibility="public")
    countdown = cython.declare(cython.double, visibility="public")
    slow: cython.double
    period: cython.double
    forget: cython.double
    joints: list[JointMonitor]
    sources: tuple[object, object]  # of the views below: made anew where other arrays come
    readings = cython.declare("const double[:, :]")
    motor_readings = cython.declare("const double[:, :]")
    raw: cython.double[:, ::1]
    measured: cython.double[:, ::1]
    before: cython.double[:, ::1]
    motors: cython.double[:, ::1]
    alarm = current = encoder_age = position = velocity = cython.declare(cython.double[::1])
    torque_age = torque = temperature = cython.declare(cython.double[::1])
    joint_position = joint_current = cython.declare(cython.double[::1])
    output = applied = travelled = used = cython.declare(cython.double[::1])

    def __init__(
        self,
        joints: list[JointMonitor],
        blocks: list[object],
        readings: list[object],
        rows: list[object],
        slow: float,
        period: float,
        forget: float,
    ) -> None:
        self.joints = joints
        self.slow = self.countdown = slow
        self.period, self.forget = period, forget
        self.news = False
        self.sources = (None, None)
        self.raw, self.measured, self.before, self.motors = blocks
        self.alarm, self.current, self.encoder_age, self.position, self.velocity = readings[:5]
        self.torque_age, self.torque, self.temperature = readings[5:]
        self.joint_position, self.joint_current, self.output = rows[:3]
        self.applied, self.travelled, self.used = rows[3:]

    def look_at(self, values: object, motors: object) -> None:
        """View other arrays; a copy of what is no such array is made again in every cycle."""
        n = len(self.joints)
        plain = doubles(values, (ROWS, n))
        shafts = None if motors is None else doubles(motors, (MOTOR_ROWS, n))
        self.sources = (values, motors) if plain is values and shafts is motors else (None, None)
        self.readings, self.motor_readings = plain, self.motors if shafts is None else shafts

    def take(self, values: object, motors: object) -> None:
        """Store a reading, shapes (ROWS, n) and (MOTOR_ROWS, n), the latter or None.

        Unless the plant reports otherwise, the last output acts.
        """
        if values is not self.sources[0] or motors is not self.sources[1]:
            self.look_at(values, motors)
        for row in range(len(self.raw)):
            for k in range(len(self.joints)):
                self.before[row, k] = self.measured[row, k]
                self.raw[row, k] = self.measured[row, k] = self.readings[row, k]
        for row in range(len(self.motors)):
            for k in range(len(self.joints)):
                self.motors[row, k] = self.motor_readings[row, k]
        for k in range(len(self.joints)):
            self.applied[k] = self.output[k]

    def step(self, periods: cython.double = 1.0) -> bool:
        """Check the reading of all joints; false when one of them has a cause of a fault.

        Args:
            periods: Of control that passed since the last one.
        """
        m: JointMonitor
        healthy: cython.bint = True
        self.countdown -= periods
        slowly: cython.bint = self.countdown < 0.5
        for k in range(len(self.joints)):
            m = self.joints[k]
            between = periods
            if self.encoder_age[k] > 0.0 or m.age > 0.0:
                between = max(periods + (m.age - self.encoder_age[k]) / self.period, 0.0)
                m.age = known(self.encoder_age[k], 0.0)
            again: cython.bint = between < 0.5 and self.position[k] == m.last  # the same reading
            if between > 1.0:
                expect_later(m, between)
            m.passed = self.first_passed(m, k)
            if fabs(self.position[k]) <= CREDIBLE_BOUND:
                m.read = True
                if not again:
                    expect(m, self.position[k])
                    check_speed(m, self.velocity[k])
            else:
                m.seen = False
                m.expect_anything()
            m.drawn = known(self.current[k], m.drawn)
            if not again:
                current = known(self.joint_current[k], m.current)
                integrate(m, current, self.applied[k], between)
            if m.switched or (between > 1.5 and between * self.period > MAX_GAP_S):
                restart(m, m.last, m.current)
                m.switched = m.switched and not is_shown(m, periods * self.period)
            if slowly:
                self.look(m, k, m.last, m.current)
            if m.passed or m.slipped or m.overran or m.overloaded or m.raced:
                healthy = False
        if slowly:
            self.countdown = self.slow
        return healthy

    @cython.cfunc
    def first_passed(self, m: JointMonitor, k: cython.Py_ssize_t) -> cython.int:  # noqa: PLR0911
        """The first bound that the reading of a joint exceeds; a value that is not finite does."""
        if not fabs(self.alarm[k]) <= m.max_alarm:
            return ALARM
        if not m.read and m.age > 0.0 and self.position[k] != self.position[k]:  # B7
            return ENCODER_AGE if m.age > m.max_encoder_age else NOTHING
        if not fabs(self.current[k]) <= m.max_current:
            return CURRENT
        if not fabs(self.encoder_age[k]) <= m.max_encoder_age:
            return ENCODER_AGE
        if not (
            m.lowest <= self.position[k] <= m.highest and fabs(self.position[k]) <= CREDIBLE_BOUND
        ):
            return POSITION
        if not fabs(self.velocity[k]) <= CREDIBLE_BOUND:
            return VELOCITY
        if not fabs(self.torque_age[k]) <= m.max_torque_age:
            return TORQUE_AGE
        if not fabs(self.torque[k]) <= m.max_torque:
            return TORQUE
        if not (
            self.temperature[k] <= m.max_temperature
            and fabs(self.temperature[k]) <= CREDIBLE_BOUND
        ):
            return TEMPERATURE
        return NOTHING

    @cython.cfunc
    def look(
        self,
        m: JointMonitor,
        k: cython.Py_ssize_t,
        position: cython.double,
        current: cython.double,
    ) -> cython.void:
        """The slow checks of a joint, from its position and current of the last reading."""
        travelled = motor_travel(m, current)
        periods = self.slow - self.countdown  # since the last
        self.travelled[k] += travelled
        check_travel(m, travelled, position, current, self.forget ** (periods / self.slow))
        if fabs(self.joint_position[k]) <= CREDIBLE_BOUND:
            check_overrun(m, self.joint_position[k])
        check_overload(m, m.drawn, periods * self.period)
        self.used[k] = m.used
        if warn(m, known(self.temperature[k], m.temperature)):
            self.news = True
