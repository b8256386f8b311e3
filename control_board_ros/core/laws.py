# SPDX-License-Identifier: Apache-2.0
"""The control laws of a joint: what to read first to know how a joint moves.

One joint at a time, in the order of a control cycle:

1. ``observe``    acceleration, load and rest, from the last two readings
2. ``advance``    the reference: moves, velocities, direct positions (P1 to P6), kept within the
                  joint's limits of position, speed and acceleration (P9, P14)
3. ``control``    the law of the mode (source Fig. 2): position PID, impedance, torque PID, output
4. ``protect``    what no law may ask for: more speed than the limit, a way beyond it (P9, P14)

Plain Python in Cython's pure mode: compiled where there is a compiler, and the same numbers, bit
by bit, where there is none. Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

try:
    import cython
except ImportError:
    from . import nocython as cython

if cython.compiled:
    from cython.cimports.libc.math import ceil, fabs, sqrt
else:
    from math import ceil, fabs, sqrt

COMPILED = bool(cython.compiled)

#: The laws of source Fig. 2; modes.Law gives them names.
OFF = cython.declare(cython.int, 0)
POSITION = cython.declare(cython.int, 1)
IMPEDANCE = cython.declare(cython.int, 2)
TORQUE = cython.declare(cython.int, 3)
OUTPUT = cython.declare(cython.int, 4)

#: Direct positions that follow each other within this time are a motion, others are steps, s.
STREAM = cython.declare(cython.double, 0.025)
#: The velocity of such a motion is the mean over at least this time, s.
STREAM_WINDOW = cython.declare(cython.double, 0.008)
#: A joint is at rest below this part of its speed limit, and of its torque limit in acceleration.
REST_SPEED = cython.declare(cython.double, 2e-3)
REST_TORQUE = cython.declare(cython.double, 5e-3)
#: How long a joint must be at rest for its load to be known, s; time constant of its filter, s.
REST_TIME = cython.declare(cython.double, 0.03)
LOAD_FILTER = cython.declare(cython.double, 0.01)
#: How long the load is looked for at least where a reference waits for it, and at most, s.
SETTLE_LEAST = cython.declare(cython.double, 0.05)
SETTLE_MOST = cython.declare(cython.double, 0.5)
#: How firmly TORQUE holds a joint before its first reference, as a part of the torque limit.
HOLD_SHARE = cython.declare(cython.double, 0.1)
#: A way so long that no braking is in sight, rad or m.
FAR = cython.declare(cython.double, 1e9)
#: Within which time the protection takes the speed to what is allowed, s.
HORIZON = cython.declare(cython.double, 0.008)
#: Time constant of the way back from beyond a limit, s.
RETURN = cython.declare(cython.double, 0.1)
#: Part of the acceleration limit that the protection brakes with, ahead of a limit.
BRAKING = cython.declare(cython.double, 0.7)
#: The inertia that it reckons with: so many times the least one, which is felt while the other
#: joints give way, but no more than this part of the mean one: the winding lags behind.
EAGER = cython.declare(cython.double, 1.3)
CAUTION = cython.declare(cython.double, 0.8)
#: Far from its limits it looks at a joint that is faster than this part of the speed limit.
NEAR = cython.declare(cython.double, 0.3)
#: How far what is followed may lead a joint, in position errors worth the torque limit.
LEAD = cython.declare(cython.double, 1.0)
#: Speed that the position law may reach, over the limit: room for a reference at the limit.
PURSUIT = cython.declare(cython.double, 1.02)


@cython.cclass
class Pid:
    """A PID with feed-forward, a bounded integral and a filtered rate.

    u = kff·r + kp·e + I + kd·D;   I += ki·e·T, |I| ≤ limit;   D += alpha·(rate − D)
    """

    kp = cython.declare(cython.double, visibility="public")
    ki_period = cython.declare(cython.double, visibility="public")
    kd = cython.declare(cython.double, visibility="public")
    kff = cython.declare(cython.double, visibility="public")
    limit = cython.declare(cython.double, visibility="public")
    alpha = cython.declare(cython.double, visibility="public")
    integral = cython.declare(cython.double, visibility="public")
    derivative = cython.declare(cython.double, visibility="public")
    previous = cython.declare(cython.double, visibility="public")
    error = cython.declare(cython.double, visibility="public")
    reference = cython.declare(cython.double, visibility="public")

    def __init__(self) -> None:
        self.kp = self.ki_period = self.kd = self.kff = self.limit = self.alpha = 0.0
        self.reset(0.0)

    @cython.ccall
    def reset(self, integral: cython.double) -> cython.void:
        """Start with an integral part, and with no rate."""
        self.integral = self.previous = clamp(integral, -self.limit, self.limit)
        self.derivative = self.error = self.reference = 0.0

    @cython.ccall
    def feed(self) -> cython.double:
        """What the last output was made of, the integral part aside."""
        return self.kff * self.reference + self.kp * self.error + self.kd * self.derivative


@cython.cfunc
@cython.inline
def clamp(value: cython.double, low: cython.double, high: cython.double) -> cython.double:
    """The value, or the bound that it passes."""
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

    In k cycles, each slower than the last by a·T:  d = k v T − a T² k(k − 1)/2, for the least k
    that ends at rest.
    """
    cycles: cython.double
    if distance <= 0.0:
        return 0.0
    if distance > FAR:  # no limit is known
        return FAR
    cycles = ceil(0.5 * (sqrt(1.0 + 8.0 * distance / (acceleration * period * period)) - 1.0))
    cycles = max(cycles, 1.0)
    return distance / (cycles * period) + 0.5 * acceleration * period * (cycles - 1.0)


@cython.cclass
class Joint:
    """Everything that the laws know of one joint; ``core.control`` fills in the constants."""

    # --- constants of the configuration -----------------------------------------------------
    period = cython.declare(cython.double, visibility="public")
    limit_lower = cython.declare(cython.double, visibility="public")
    limit_upper = cython.declare(cython.double, visibility="public")
    max_velocity = cython.declare(cython.double, visibility="public")
    max_acceleration = cython.declare(cython.double, visibility="public")
    max_torque = cython.declare(cython.double, visibility="public")
    max_output = cython.declare(cython.double, visibility="public")  # PWM, percent
    max_drive = cython.declare(cython.double, visibility="public")  # PWM or A, as the laws give
    inertia_min = cython.declare(cython.double, visibility="public")
    inertia = cython.declare(cython.double, visibility="public")
    torque_per_ampere = cython.declare(cython.double, visibility="public")
    has_torque_sensor = cython.declare(cython.bint, visibility="public")
    per_torque = cython.declare(cython.double, visibility="public")  # drive per N·m
    per_speed = cython.declare(cython.double, visibility="public")  # drive per rad/s: back-EMF
    compensation = cython.declare(cython.double, visibility="public")  # part of it made up for
    per_feed = cython.declare(cython.double, visibility="public")  # drive per percent of u_ff
    in_amps = cython.declare(cython.bint, visibility="public")  # drive is a current reference
    ohms = cython.declare(cython.double, visibility="public")
    emf = cython.declare(cython.double, visibility="public")  # V·s/rad
    percent_per_volt = cython.declare(cython.double, visibility="public")
    lead = cython.declare(cython.double, visibility="public")  # a/(1 − a), a = exp(−T R/L)

    # --- what users and modes set -----------------------------------------------------------
    law = cython.declare(cython.int, visibility="public")
    calibrated = cython.declare(cython.bint, visibility="public")  # limits are known
    feeds = cython.declare(cython.bint, visibility="public")  # u_ff acts
    position_pid = cython.declare(Pid, visibility="public")
    torque_pid = cython.declare(Pid, visibility="public")
    current_pid = cython.declare(Pid, visibility="public")
    stiffness = cython.declare(cython.double, visibility="public")
    damping = cython.declare(cython.double, visibility="public")
    torque_offset = cython.declare(cython.double, visibility="public")  # τ_ff
    offset_given = cython.declare(cython.bint, visibility="public")  # by a user
    load_taken = cython.declare(cython.double, visibility="public")  # taken over on entering
    torque_command = cython.declare(cython.double, visibility="public")
    output_command = cython.declare(cython.double, visibility="public")
    output_offset = cython.declare(cython.double, visibility="public")  # u_ff, percent

    # --- reference --------------------------------------------------------------------------
    lower = cython.declare(cython.double, visibility="public")  # bounds of the reference
    upper = cython.declare(cython.double, visibility="public")
    active = cython.declare(cython.bint, visibility="public")  # the reference moves
    moving = cython.declare(cython.bint, visibility="public")  # a position move is under way
    move_start = cython.declare(cython.double, visibility="public")
    move_target = cython.declare(cython.double, visibility="public")
    move_velocity = cython.declare(cython.double, visibility="public")  # at its start
    move_time = cython.declare(cython.double, visibility="public")
    brake_time = cython.declare(cython.double, visibility="public")
    move_cycles = cython.declare(cython.double, visibility="public")  # past
    moved = cython.declare(cython.double, visibility="public")
    moved_velocity = cython.declare(cython.double, visibility="public")
    ramped = cython.declare(cython.double, visibility="public")  # ∫v dt
    ramp_velocity = cython.declare(cython.double, visibility="public")
    ramp_target = cython.declare(cython.double, visibility="public")
    ramp_step = cython.declare(cython.double, visibility="public")  # rad/s per cycle
    direct_velocity = cython.declare(cython.double, visibility="public")
    direct_age = cython.declare(cython.double, visibility="public")  # cycles since the last one
    direct_interval = cython.declare(cython.double, visibility="public")  # s to the one before
    anchor = cython.declare(cython.double, visibility="public")  # direct position …
    anchor_age = cython.declare(cython.double, visibility="public")  # … so many cycles ago
    reference = cython.declare(cython.double, visibility="public")
    reference_velocity = cython.declare(cython.double, visibility="public")
    followed = cython.declare(cython.double, visibility="public")  # within all limits
    followed_velocity = cython.declare(cython.double, visibility="public")
    followed_acceleration = cython.declare(cython.double, visibility="public")

    # --- measured and observed --------------------------------------------------------------
    position = cython.declare(cython.double, visibility="public")
    velocity = cython.declare(cython.double, visibility="public")
    torque = cython.declare(cython.double, visibility="public")
    current = cython.declare(cython.double, visibility="public")
    acceleration = cython.declare(cython.double, visibility="public")
    load = cython.declare(cython.double, visibility="public")  # filtered, without inertia
    readings = cython.declare(cython.int, visibility="public")  # since power-on
    rest_cycles = cython.declare(cython.int, visibility="public")
    settling = cython.declare(cython.bint, visibility="public")  # held until the load is known
    settle_cycles = cython.declare(cython.int, visibility="public")
    awaited = cython.declare(cython.bint, visibility="public")  # a reference waits for the load
    holding = cython.declare(cython.bint, visibility="public")  # TORQUE before its first reference
    hold_place = cython.declare(cython.double, visibility="public")

    # --- results ----------------------------------------------------------------------------
    torque_reference = cython.declare(cython.double, visibility="public")
    asked = cython.declare(cython.double, visibility="public")  # drive for the torque, last cycle
    output = cython.declare(cython.double, visibility="public")  # PWM, percent
    on_limit = cython.declare(cython.bint, visibility="public")
    was_on_limit = cython.declare(cython.bint, visibility="public")  # in the last step

    def __init__(self) -> None:
        self.position_pid, self.torque_pid, self.current_pid = Pid(), Pid(), Pid()
        self.lower, self.upper = -INFINITE, INFINITE
        self.direct_age = self.anchor_age = INFINITE
        self.was_on_limit = False

    # --- what the board asks of a joint -----------------------------------------------------

    @cython.ccall
    def hold(self, position: cython.double) -> cython.void:
        """Let the reference stand at a position, at rest (M9, P3).

        What is followed starts with the velocity that the joint has, and brakes within the
        acceleration limit (P14).
        """
        self.moving = False
        self.moved = self.reference = self.followed = position
        self.moved_velocity = self.reference_velocity = self.ramped = 0.0
        self.ramp_velocity = self.ramp_target = 0.0
        self.followed_velocity = clamp(self.velocity, -self.max_velocity, self.max_velocity)
        self.followed_acceleration = self.direct_velocity = 0.0
        self.active = fabs(self.velocity) > REST_SPEED * self.max_velocity
        if not self.active:
            self.followed_velocity = 0.0
        self.direct_age = self.anchor_age = INFINITE

    @cython.ccall
    def move(
        self, target: cython.double, time: cython.double, brake: cython.double
    ) -> cython.void:
        """Start a minimum-jerk move from the present reference (P1, P6).

        Args:
            target: rad.
            time: duration T, s; at least one period is used.
            brake: time in which the present velocity is braked, s; 0: it goes on into the move.
        """
        self.active = self.moving = True
        self.move_start = self.reference
        self.move_velocity = self.moved_velocity
        self.move_target = target
        self.move_time = time if time > self.period else self.period
        self.brake_time = brake
        self.move_cycles = 0.0
        self.moved = self.reference
        self.ramped = 0.0
        self.awaited = self.settling

    @cython.ccall
    def ramp(self, velocity: cython.double, acceleration: cython.double) -> cython.void:
        """Ramp the velocity reference to a new value (P5)."""
        self.active = True
        self.ramp_target = velocity
        self.ramp_step = acceleration * self.period
        self.awaited = self.settling

    @cython.ccall
    def step_to(self, position: cython.double) -> cython.void:
        """Take a direct position (P4); its velocity is the mean over a stream of them.

        A difference that the joint could not follow is a step, and has no velocity.
        """
        interval: cython.double = self.direct_age * self.period
        window: cython.double = self.anchor_age * self.period
        velocity: cython.double = self.direct_velocity
        if interval > STREAM:
            velocity = 0.0
            self.anchor, self.anchor_age = position, 0.0
        elif window >= STREAM_WINDOW:
            velocity = (position - self.anchor) / window
            self.anchor, self.anchor_age = position, 0.0
        if fabs(velocity) > self.max_velocity:
            velocity = 0.0
        self.step_with(position, velocity)
        self.direct_interval = clamp(interval, STREAM_WINDOW, STREAM)

    @cython.ccall
    def step_with(self, position: cython.double, velocity: cython.double) -> cython.void:
        """Take a direct position that has a velocity of its own (P4)."""
        self.active, self.moving = True, False
        self.moved, self.ramped = position, 0.0
        self.moved_velocity = self.ramp_velocity = self.ramp_target = 0.0
        self.reference, self.reference_velocity = position, 0.0
        self.direct_velocity = velocity
        self.direct_age, self.direct_interval = 0.0, STREAM_WINDOW
        self.awaited = self.settling

    @cython.ccall
    def at_rest(self) -> cython.bint:
        """Whether the last readings show a joint that neither moves nor begins to."""
        return (
            self.readings > 1
            and fabs(self.velocity) <= REST_SPEED * self.max_velocity
            and fabs(self.inertia * self.acceleration) <= REST_TORQUE * self.max_torque
        )

    @cython.ccall
    def known_load(self) -> cython.double:
        """The torque that carries the joint: measured, without what acceleration adds (M9)."""
        if self.rest_cycles * self.period >= REST_TIME:
            return self.load
        return self.torque - self.inertia * self.acceleration

    @cython.ccall
    def feed_torque(self) -> cython.double:
        """What u_ff is worth as a torque, N·m."""
        if self.feeds and self.per_torque > 0.0:
            return self.output_offset * self.per_feed / self.per_torque
        return 0.0

    @cython.ccall
    def start(self, law: cython.int) -> cython.void:
        """Run a law from now on, without a jump: it takes over the load (M9).

        A joint that is not at rest is first brought there by the position law; what carries it
        then becomes its torque (IMPEDANCE, TORQUE).
        """
        load: cython.double = self.known_load()
        self.law = law
        self.on_limit = self.holding = self.awaited = False
        self.settling = (law in (IMPEDANCE, TORQUE)) and not self.at_rest()
        self.settle_cycles = 0
        self.current_pid.reset(0.0)
        self.position_pid.reset(load - self.feed_torque() - self.position_pid.kff * self.followed)
        self.torque_reference = self.torque_command = self.torque
        self.torque_pid.reset(0.0)
        self.asked = clamp(self.torque * self.per_torque, -self.max_drive, self.max_drive)
        if law == OFF:
            self.output = 0.0
        elif not self.settling:
            self.take(load)

    @cython.cfunc
    def take(self, load: cython.double) -> cython.void:
        """Make the load what the law of the mode gives when nothing else is asked for."""
        self.settling = self.awaited = False
        self.load_taken = load - self.torque_offset
        self.torque_command = load
        self.holding = self.law == TORQUE
        self.hold_place = self.followed
        self.torque_pid.reset(self.torque - self.torque_pid.kff * load - self.feed_torque())

    @cython.ccall
    def offer_torque(self, torque: cython.double) -> cython.void:
        """Take a τ_ff (P11); it replaces the load that was taken over."""
        if self.settling:
            self.take(self.known_load())
        self.offset_given = True
        self.torque_offset, self.load_taken = torque, 0.0

    @cython.ccall
    def command_torque(self, torque: cython.double) -> cython.void:
        """Take a torque reference: from now on nothing but it acts (P7)."""
        if self.settling:
            self.take(self.known_load())
        self.holding = False
        self.torque_command = torque


INFINITE = cython.declare(cython.double, 1e300)

if not cython.compiled:  # attributes start at zero, as they do compiled
    for _kind in (Pid, Joint):
        for _name, _value in list(vars(_kind).items()):
            if _value is None or isinstance(_value, Pid):
                setattr(_kind, _name, 0.0)


# --- 1. observe -----------------------------------------------------------------------------


@cython.cfunc
def observe(j: Joint, position: cython.double, velocity: cython.double) -> cython.void:
    """Acceleration, load and rest: a = Δq̇/T; load = τ − J·a through a low pass."""
    raw: cython.double
    j.acceleration = (velocity - j.velocity) / j.period if j.readings > 0 else 0.0
    j.position, j.velocity = position, velocity
    if not j.has_torque_sensor:
        j.torque = j.current * j.torque_per_ampere
    raw = j.torque - j.inertia * j.acceleration
    if j.readings == 0 or j.period >= LOAD_FILTER:
        j.load = raw
    else:
        j.load += j.period / LOAD_FILTER * (raw - j.load)
    if j.readings < 2:
        j.readings += 1
    if j.at_rest():
        if j.rest_cycles < 1000000:
            j.rest_cycles += 1
    else:
        j.rest_cycles = 0


@cython.cfunc
def settle(j: Joint) -> cython.void:
    """Take the load over once it is known, or has been waited for long enough."""
    elapsed: cython.double
    if j.active and not j.awaited:
        return  # it still brakes
    j.settle_cycles += 1
    elapsed = j.settle_cycles * j.period
    if (
        (j.rest_cycles * j.period >= REST_TIME and elapsed >= REST_TIME)
        or elapsed >= SETTLE_MOST
        or (j.awaited and elapsed >= SETTLE_LEAST)
    ):
        j.take(j.load)


# --- 2. advance -----------------------------------------------------------------------------


@cython.cfunc
def advance(j: Joint) -> cython.void:
    """One cycle of the reference: trajectory + ∫v dt, or the direct position (P1 to P6)."""
    velocity: cython.double
    if j.moving:
        advance_move(j)
    velocity = j.moved_velocity
    if j.ramp_target != 0.0 or j.ramp_velocity != 0.0:
        advance_ramp(j)
        velocity += j.ramp_velocity
    if j.direct_age < INFINITE:
        j.direct_age += 1.0
        j.anchor_age += 1.0
    else:
        j.reference_velocity = velocity
    j.reference = clamp(j.moved + j.ramped, j.lower, j.upper)
    follow(j)
    # A joint found outside its limits may come in, not go out again (P9).
    if j.lower < j.limit_lower and j.calibrated:
        j.lower = clamp(j.reference, j.lower, j.limit_lower)
    if j.upper > j.limit_upper and j.calibrated:
        j.upper = clamp(j.reference, j.limit_upper, j.upper)


@cython.cfunc
def advance_move(j: Joint) -> cython.void:
    """The quintic of a move: leaves with v0, ends at rest (P1).

    q(s) = q0 + v0 T s + (10 R − 6 v0 T) s³ + (8 v0 T − 15 R) s⁴ + (6 R − 3 v0 T) s⁵, s = t/T; a
    velocity that is no part of it is braked by v0 (1 − 3u² + 2u³), u = t/T_b.
    """
    s: cython.double
    u: cython.double
    run: cython.double = 0.0
    way: cython.double = 0.0
    speed: cython.double = 0.0
    reach: cython.double
    time: cython.double = j.move_time
    j.move_cycles += 1.0
    elapsed: cython.double = j.move_cycles * j.period
    if elapsed >= (time if time > j.brake_time else j.brake_time) - 1e-9 * j.period:
        j.moving = False
        j.moved, j.moved_velocity = j.move_target, 0.0
        return
    reach = j.move_target - j.move_start
    if j.brake_time > 0.0:
        u = elapsed / j.brake_time
        reach -= 0.5 * j.move_velocity * j.brake_time
        if u >= 1.0:
            way = 0.5 * j.move_velocity * j.brake_time
        else:
            way = j.move_velocity * j.brake_time * u * (1.0 + u * u * (0.5 * u - 1.0))
            speed = j.move_velocity * (1.0 + u * u * (2.0 * u - 3.0))
    else:
        run = j.move_velocity * time
    s = elapsed / time
    if s >= 1.0:
        j.moved, j.moved_velocity = j.move_start + way + reach, speed
        return
    a: cython.double = 10.0 * reach - 6.0 * run
    b: cython.double = 8.0 * run - 15.0 * reach
    c: cython.double = 6.0 * reach - 3.0 * run
    j.moved = j.move_start + way + s * (run + s * s * (a + s * (b + s * c)))
    j.moved_velocity = speed + (run + s * s * (3.0 * a + s * (4.0 * b + s * 5.0 * c))) / time


@cython.cfunc
def advance_ramp(j: Joint) -> cython.void:
    """The velocity reference: ramped (P5), and no more than speed and limits leave (P14).

    Together with a move it keeps to the speed limit, and brakes ahead of a position limit.
    """
    total: cython.double
    up: cython.double
    down: cython.double
    v: cython.double = clamp(
        j.ramp_target, j.ramp_velocity - j.ramp_step, j.ramp_velocity + j.ramp_step
    )
    up = brake_speed(j.upper - j.reference, j.max_acceleration, j.period)
    down = brake_speed(j.reference - j.lower, j.max_acceleration, j.period)
    total = clamp(
        j.moved_velocity + v,
        -(down if down < j.max_velocity else j.max_velocity),
        up if up < j.max_velocity else j.max_velocity,
    )
    j.ramp_velocity = total - j.moved_velocity if total != j.moved_velocity + v else v
    j.ramped += j.ramp_velocity * j.period


@cython.cfunc
def follow(j: Joint) -> cython.void:
    """What the laws follow: the reference, within speed, acceleration and limits (P14).

    Where the joint can, it is the reference itself; else the fastest way there that ends with
    the reference's velocity: v = v_ref + brake_speed(rest of the way).
    """
    goal: cython.double = j.reference
    goal_velocity: cython.double = 0.0 if j.direct_age < INFINITE else j.reference_velocity
    velocity: cython.double
    rest: cython.double
    up: cython.double
    down: cython.double
    step: cython.double = j.max_acceleration * j.period
    if j.direct_velocity != 0.0:
        if (j.direct_age - 1.0) * j.period <= 1.5 * j.direct_interval:
            goal_velocity = j.direct_velocity
            goal = clamp(goal + goal_velocity * (j.direct_age - 1.0) * j.period, j.lower, j.upper)
        else:
            j.direct_velocity = 0.0  # the stream has ended
    if j.direct_age < INFINITE:
        j.reference_velocity = goal_velocity
    rest = goal - j.followed - goal_velocity * j.period
    if rest >= 0.0:
        velocity = goal_velocity + brake_speed(rest, j.max_acceleration, j.period)
    else:
        velocity = goal_velocity - brake_speed(-rest, j.max_acceleration, j.period)
    up = brake_speed(j.upper - j.followed, j.max_acceleration, j.period)
    down = brake_speed(j.followed - j.lower, j.max_acceleration, j.period)
    velocity = clamp(
        velocity,
        -(down if down < j.max_velocity else j.max_velocity),
        up if up < j.max_velocity else j.max_velocity,
    )
    velocity = clamp(velocity, j.followed_velocity - step, j.followed_velocity + step)
    j.followed_acceleration = (velocity - j.followed_velocity) / j.period
    j.followed_velocity = velocity
    j.followed += velocity * j.period
    if fabs(goal - j.followed) <= 1e-12 and goal_velocity == 0.0:
        j.followed = goal
    if (
        j.followed == goal
        and fabs(velocity) <= step * 1e-6
        and not (j.moving or j.ramp_target != 0.0 or j.ramp_velocity != 0.0)
        and j.direct_velocity == 0.0
        and (j.direct_age == INFINITE or j.direct_age * j.period > STREAM)
    ):
        j.active = False
        j.followed_velocity = j.followed_acceleration = 0.0


# --- 3. control -----------------------------------------------------------------------------


@cython.cfunc
def pid_step(
    p: Pid, reference: cython.double, error: cython.double, rate: cython.double
) -> cython.double:
    """One period of a PID: u = kff·r + kp·e + I + kd·D."""
    p.reference, p.error = reference, error
    p.previous = p.integral
    p.integral = clamp(p.integral + p.ki_period * error, -p.limit, p.limit)
    p.derivative += p.alpha * (rate - p.derivative)
    return p.kff * reference + p.kp * error + p.integral + p.kd * p.derivative


@cython.cfunc
def unwind(p: Pid, excess: cython.double) -> cython.void:
    """Anti-windup: where the output is cut, an integral that pushes further goes back."""
    if p.error * excess > 0.0:
        p.integral = p.previous


@cython.cfunc
def position_law(j: Joint) -> cython.double:
    """Position PID with the inertia's share fed forward (I5, first row of source Fig. 2).

    τ = kp·e + ∫ki·e dt + kd·ė + J·a_ref, e = q_ref − q

    What is followed leads the joint by no more than the torque limit is worth: one that was held
    back goes on from where it is, at the speed of a reference, when it is free again (P14).
    """
    p: Pid = j.position_pid
    lead: cython.double
    if p.kp > 0.0:
        lead = LEAD * j.max_torque / p.kp
        if fabs(j.followed - j.position) > lead:
            j.followed = clamp(j.followed, j.position - lead, j.position + lead)
            j.followed_velocity = j.followed_acceleration = 0.0
            j.active = True
    return (
        pid_step(p, j.followed, j.followed - j.position, j.followed_velocity - j.velocity)
        + j.inertia * j.followed_acceleration
    )


@cython.cfunc
def impedance(j: Joint) -> cython.double:
    """Torque of a virtual spring and damper (I5; second row of source Fig. 2).

    τ = τ_ff + load + k (q_ref − q) − d q̇; the load is what was taken over on entering (M9).
    """
    return (
        j.torque_offset
        + j.load_taken
        + j.stiffness * (j.followed - j.position)
        - j.damping * j.velocity
    )


@cython.cfunc
def held_torque(j: Joint) -> cython.double:
    """TORQUE before its first reference: the load, and a hold as firm as a gearbox rubs (M9).

    τ = load + clip(kp (q_hold − q) − kd q̇, ± HOLD_SHARE·τ_max); pushed harder, the joint gives
    way and stays where it is left.
    """
    p: Pid = j.position_pid
    firm: cython.double = HOLD_SHARE * j.max_torque
    if p.kp > 0.0:
        j.hold_place = clamp(j.hold_place, j.position - firm / p.kp, j.position + firm / p.kp)
    return j.torque_command + clamp(
        p.kp * (j.hold_place - j.position) - p.kd * j.velocity, -firm, firm
    )


@cython.cfunc
def torque_law(j: Joint, reference: cython.double) -> cython.double:
    """Torque PID: u = kff·τ_ref + kp·e + ∫ki·e dt + kd·ė, e = τ_ref − τ (P7)."""
    p: Pid = j.torque_pid
    error: cython.double
    reference = clamp(reference, -j.max_torque, j.max_torque)
    j.torque_reference = reference
    error = reference - j.torque
    return pid_step(p, reference, error, (error - p.error) / j.period)


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
    if j.law == OUTPUT:
        drive = j.output_command + given
        j.output = clamp(protect(j, drive), -j.max_output, j.max_output)
        j.current_pid.integral = 0.0
        return
    if j.settling:
        settle(j)
    if j.law == POSITION or j.settling:
        loop = j.position_pid
        torque = position_law(j)
    elif j.law == IMPEDANCE:
        torque = torque_law(j, impedance(j))
    elif j.holding:
        torque = torque_law(j, held_torque(j))
    else:
        torque = torque_law(j, j.torque_command)
    drive = clamp(torque, -j.max_torque, j.max_torque)
    if drive != torque:
        unwind(loop, torque - drive)
    drive = ahead_of_winding(j, drive * j.per_torque)
    drive += j.compensation * j.per_speed * j.velocity + given
    given = protect(j, clamp(drive, -j.max_drive, j.max_drive))
    if given != drive:
        unwind(loop, drive - given)
    j.output = current_law(j, given) if j.in_amps else given


@cython.cfunc
def ahead_of_winding(j: Joint, wanted: cython.double) -> cython.double:
    """The drive that brings the current within a cycle to what is wanted at its end.

    L di/dt = v − R i, solved for v over one period:  v = R (i' − a i)/(1 − a), a = exp(−T R/L);
    the current is taken to be where the last cycle sent it.
    """
    drive: cython.double = wanted
    if not j.in_amps:
        drive += j.lead * (wanted - j.asked)
    j.asked = wanted
    return drive


@cython.cfunc
def current_law(j: Joint, reference: cython.double) -> cython.double:
    """The inner loop of a board with current output (P10).

    v = R·(i_ref + lead·Δi_ref) + Ke·q̇ + PI(i_ref, i); the lead as in ``ahead_of_winding``.
    """
    p: Pid = j.current_pid
    before: cython.double = p.reference
    wanted: cython.double = j.percent_per_volt * (
        pid_step(p, reference, reference - j.current, 0.0)
        + j.ohms * (reference + j.lead * (reference - before))
        + j.emf * j.velocity
    )
    given: cython.double = clamp(wanted, -j.max_output, j.max_output)
    if given != wanted:
        unwind(p, wanted - given)
    return given


# --- 4. protect -----------------------------------------------------------------------------


@cython.cfunc
def protect(j: Joint, drive: cython.double) -> cython.double:
    """What a joint may get of a drive (P9, P14).

    No faster than the speed limit; where no position law keeps it inside its limits, no faster
    towards one than it can brake, and back from beyond it. The motor's torque for that follows
    from the last cycle's, whatever load and friction are:

    τ ≤ τ_last + J·((v_top − q̇)/horizon − q̈),  J = min(1.3 J_min, 0.8 J_mean)
    """
    top: cython.double = PURSUIT * j.max_velocity
    bottom: cython.double = -top
    free: cython.bint = j.law != POSITION and not j.settling
    if free:
        top, bottom = j.max_velocity, -j.max_velocity
        if j.calibrated:
            top = speed_towards(j, j.limit_upper - j.position, top)
            bottom = -speed_towards(j, j.position - j.limit_lower, -bottom)
            note_limit(j)
    coasting: cython.double = j.per_speed * j.velocity
    span: cython.double = HORIZON if 3.0 * j.period < HORIZON else 3.0 * j.period
    inertia: cython.double = min(EAGER * j.inertia_min, CAUTION * j.inertia)
    rate: cython.double = inertia / span
    base: cython.double = j.current * j.torque_per_ampere - inertia * j.acceleration
    bound: cython.double = base + rate * (top - j.velocity)
    if bound < j.max_torque and (j.velocity >= NEAR * top or top < j.max_velocity):
        bound = clamp(bound, -j.max_torque, j.max_torque) * j.per_torque + coasting
        drive = min(drive, bound)
    bound = base + rate * (bottom - j.velocity)
    if bound > -j.max_torque and (j.velocity <= NEAR * bottom or bottom > -j.max_velocity):
        bound = clamp(bound, -j.max_torque, j.max_torque) * j.per_torque + coasting
        drive = max(drive, bound)
    return clamp(drive, -j.max_drive, j.max_drive)


@cython.cfunc
def speed_towards(j: Joint, room: cython.double, top: cython.double) -> cython.double:
    """The speed allowed towards a limit that is so far away; negative beyond it: back."""
    speed: cython.double
    if room < 0.0:
        return room / RETURN
    speed = brake_speed(room, BRAKING * j.max_acceleration, j.period)
    return speed if speed < top else top


@cython.cfunc
def note_limit(j: Joint) -> cython.void:
    """Whether the joint is beyond a limit, or was and still lies on its edge (P9)."""
    room: cython.double = j.limit_upper - j.position
    below: cython.double = j.position - j.limit_lower
    room = min(room, below)
    edge: cython.double = 0.01 * (j.limit_upper - j.limit_lower)
    edge = min(edge, 0.0175)
    j.on_limit = room < 0.0 or (j.on_limit and room < edge)


# --- the cycle ------------------------------------------------------------------------------


@cython.cclass
class Laws:
    """All joints of a board, and views of the arrays that everybody reads.

    Args:
        joints: of class Joint.
        rows: measured position, velocity, torque, current; position, velocity and torque
            reference; output: a buffer of n doubles each.
        done: n bytes, 1 where no position move is under way.
    """

    joints: list[Joint]
    done: cython.uchar[::1]
    position: cython.double[::1]
    velocity: cython.double[::1]
    torque: cython.double[::1]
    current: cython.double[::1]
    position_reference: cython.double[::1]
    velocity_reference: cython.double[::1]
    torque_reference: cython.double[::1]
    output: cython.double[::1]

    def __init__(self, joints: list[Joint], rows: list[object], done: object) -> None:
        self.joints = joints
        (
            self.position,
            self.velocity,
            self.torque,
            self.current,
            self.position_reference,
            self.velocity_reference,
            self.torque_reference,
            self.output,
        ) = rows
        self.done = done

    def step(self) -> bool:
        """One control period of all joints; whether one of them came to a limit or left it."""
        k: cython.Py_ssize_t
        j: Joint
        changed: cython.bint = False
        for k in range(len(self.joints)):
            j = self.joints[k]
            j.torque, j.current = self.torque[k], self.current[k]
            observe(j, self.position[k], self.velocity[k])
            if j.active:
                advance(j)
                self.position_reference[k] = j.reference
                self.velocity_reference[k] = j.reference_velocity
                self.done[k] = not j.moving
            control(j)
            self.torque_reference[k] = j.torque_reference
            self.output[k] = j.output
            if j.on_limit != j.was_on_limit:
                j.was_on_limit = j.on_limit
                changed = True
        return changed
