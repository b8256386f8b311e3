# SPDX-License-Identifier: Apache-2.0
"""A joint as the laws see it: its constants, its state, and what is asked of it.

The phases of a cycle (``laws``) read and write the fields; ``control`` sets the constants. Units:
rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from math import fabs, sqrt

from ... import nocython as cython
from .formulas import INFINITE, braking, clamp, is_number, row
from .pid import Pid
from .stream import MAX_STREAM_INTERVAL, Stream

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
#: Direct positions nearer than what a joint accelerates through in this time, s, have no plan.
SHORT_STEP = cython.declare(cython.double, 0.02)
#: A joint is at rest below this part of its speed limit, and of its torque limit in acceleration.
REST_SPEED = cython.declare(cython.double, 2e-3)
REST_TORQUE = cython.declare(cython.double, 5e-3)
#: Time at rest after which the load is known, s.
REST_TIME = cython.declare(cython.double, 0.03)
#: Cycles over which what the feed-forward accelerated is kept, a power of two: as far as the
#: motion of an old reading is continued.
FEED_CYCLES = cython.declare(cython.int, 64)
#: Speed, as a part of the limit, up to which the sag of a drive is that at rest.
SAGGING = cython.declare(cython.double, 0.05)
#: Periods without a fresh reading, and between two cycles, from which on a joint coasts, and its
#: reference begins anew from where the joint is (B6, B7).
GAP = cython.declare(cython.double, 3.0)
#: Periods between two cycles, more than once, from which on a loop is starved (B6).
STARVED_PERIODS = cython.declare(cython.double, 1.5)
#: Phase that the age of readings may cost the velocity loop, rad.
WIRE_PHASE = cython.declare(cython.double, 0.2)
#: Time constant of the feedback that a coasting joint keeps, s.
HOLD_FILTER = cython.declare(cython.double, 0.03)


@cython.final
@cython.cclass
class Joint:
    """State and constants of one joint."""

    # --- constants of the configuration -----------------------------------------------------
    period = cython.declare(cython.double, visibility="public")
    limit_lower = limit_upper = cython.declare(cython.double, visibility="public")
    limit_edge = cython.declare(cython.double, visibility="public")  # hysteresis of on_limit
    max_velocity = max_acceleration = cython.declare(cython.double, visibility="public")
    max_jerk = cython.declare(cython.double, visibility="public")  # of moves and stops; 0: none
    max_torque = cython.declare(cython.double, visibility="public")
    max_output = cython.declare(cython.double, visibility="public")  # PWM, percent
    max_drive = cython.declare(cython.double, visibility="public")  # PWM or A, as the laws give
    inertia_min = inertia = cython.declare(cython.double, visibility="public")
    # by which the protection makes speed, and reduces it
    light_inertia = heavy_inertia = cython.declare(cython.double, visibility="public")
    # friction of motion in positive and in negative direction, N·m, N·m·s/rad, and the speed
    # from which on the dry part is whole, rad/s
    coulomb = coulomb_negative = cython.declare(cython.double, visibility="public")
    viscous = viscous_negative = cython.declare(cython.double, visibility="public")
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
    position_pid = torque_pid = current_pid = cython.declare(Pid, visibility="public")
    stiffness = damping = cython.declare(cython.double, visibility="public")
    torque_offset = cython.declare(cython.double, visibility="public")  # τ_ff
    offset_given = cython.declare(cython.bint, visibility="public")  # by a user
    load_taken = cython.declare(cython.double, visibility="public")  # at the start of the law
    torque_command = output_command = cython.declare(cython.double, visibility="public")
    current_command = cython.declare(cython.double, visibility="public")  # A
    output_offset = cython.declare(cython.double, visibility="public")  # u_ff, percent

    # --- reference --------------------------------------------------------------------------
    lower = upper = cython.declare(cython.double, visibility="public")  # bounds of the reference
    entry_speed = cython.declare(cython.double, visibility="public")  # from outside limits, rad/s
    active = cython.declare(cython.bint, visibility="public")  # the reference moves
    moving = cython.declare(cython.bint, visibility="public")  # a position move is under way
    stopping = cython.declare(cython.bint, visibility="public")  # it brakes, and holds at rest
    stop_due = cython.declare(cython.bint, visibility="public")  # its stop is still to be planned
    stop_rate = cython.declare(cython.double, visibility="public")  # deceleration, rad/s²
    renewal_speed = cython.declare(cython.double, visibility="public")  # where it began anew
    stepping = cython.declare(cython.bint, visibility="public")  # a direct position by a plan
    alone = cython.declare(cython.bint, visibility="public")  # no other came shortly before it
    sample_age = cython.declare(cython.double, visibility="public")  # of the last one, periods
    plan: cython.double[::1]  # accelerations of a stop or a step, rad/s²
    plan_steps = cython.declare(cython.int, visibility="public")  # 0: none
    plan_step = cython.declare(cython.double, visibility="public")  # s
    plan_time = cython.declare(cython.double, visibility="public")  # past, s
    move_start = move_target = cython.declare(cython.double, visibility="public")
    move_velocity = cython.declare(cython.double, visibility="public")  # at its start
    move_acceleration = cython.declare(cython.double, visibility="public")  # with a jerk limit
    moved_acceleration = cython.declare(cython.double, visibility="public")  # likewise, of now
    smooth = cython.declare(cython.bint, visibility="public")  # it stops within its jerk limit
    move_time = cython.declare(cython.double, visibility="public")
    brake_time = cython.declare(cython.double, visibility="public")
    brake_even = cython.declare(cython.bint, visibility="public")  # first, at one rate
    move_cycles = cython.declare(cython.double, visibility="public")  # past
    moved = moved_velocity = cython.declare(cython.double, visibility="public")
    ramped = cython.declare(cython.double, visibility="public")  # ∫v dt
    ramp_velocity = ramp_target = cython.declare(cython.double, visibility="public")
    ramp_step = cython.declare(cython.double, visibility="public")  # rad/s per cycle
    driven = cython.declare(cython.bint, visibility="public")  # by a velocity without a ramp
    direct_velocity = cython.declare(cython.double, visibility="public")
    direct_age = cython.declare(cython.double, visibility="public")  # cycles since the last one
    stream = cython.declare(Stream, visibility="public")
    stream_acceleration = cython.declare(cython.double, visibility="public")  # filtered
    stream_peak = cython.declare(cython.double, visibility="public")  # decaying maximum of it
    reference = reference_velocity = cython.declare(cython.double, visibility="public")
    # within all limits
    followed = followed_velocity = followed_acceleration = cython.declare(
        cython.double, visibility="public"
    )

    # --- time -------------------------------------------------------------------------------
    elapsed = cython.declare(cython.double, visibility="public")  # since the last cycle, s
    usual = cython.declare(cython.double, visibility="public")  # the longest of late, s
    hold_time = cython.declare(cython.double, visibility="public")  # likewise, no single one, s
    gap = cython.declare(cython.bint, visibility="public")  # elapsed is more than GAP of those
    span = cython.declare(cython.double, visibility="public")  # between middles of cycles
    age = cython.declare(cython.double, visibility="public")  # of the reading, s
    wire = cython.declare(cython.double, visibility="public")  # greatest age of late, s
    outage = cython.declare(cython.double, visibility="public")  # likewise, without a reading, s
    mean_age = cython.declare(cython.double, visibility="public")  # of fresh readings of late, s
    age_variance = cython.declare(cython.double, visibility="public")  # likewise, s²
    steady = cython.declare(cython.double, visibility="public")  # top speed that this allows, 0…1
    missed = cython.declare(cython.double, visibility="public")  # without a fresh reading, s
    weighed_torque = cython.declare(cython.double, visibility="public")  # of the last reading
    # ∫a_ref dt of the last FEED_CYCLES cycles, rad/s: what the feed-forward has accelerated
    fed = cython.declare(cython.double[::1], visibility="public")
    fed_now = cython.declare(cython.int, visibility="public")  # the place of the last one
    drawn = cython.declare(cython.double[::1], visibility="public")  # current references then, A
    blind = cython.declare(cython.bint, visibility="public")  # for more than GAP periods
    coasts = cython.declare(cython.bint, visibility="public")  # and by the board's loop
    calm = cython.declare(cython.double, visibility="public")  # bandwidth that the age leaves, 0…1
    spring = cython.declare(cython.double, visibility="public")  # part of kp that this allows, 0…1
    feedback = cython.declare(cython.double, visibility="public")  # filtered, without integral

    # --- measured and observed --------------------------------------------------------------
    position = velocity = torque = current = cython.declare(cython.double, visibility="public")
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
    goal = goal_velocity = cython.declare(
        cython.double, visibility="public"
    )  # of the drive, in COMPLIANT
    sag = cython.declare(cython.double, visibility="public")  # set-point beyond goal or reference
    trail = cython.declare(cython.double, visibility="public")  # of a stop, fading, likewise
    comes_to_rest = cython.declare(cython.bint, visibility="public")  # no reference since a hold
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
    # of the set-point
    set_current = set_torque = set_velocity = cython.declare(cython.double, visibility="public")
    set_position = set_stiffness = set_damping = cython.declare(cython.double, visibility="public")
    on_limit = cython.declare(cython.bint, visibility="public")
    was_on_limit = cython.declare(cython.bint, visibility="public")  # in the last step
    diverged = cython.declare(cython.bint, visibility="public")  # its output was not finite
    strain_cycles = cython.declare(cython.int, visibility="public")  # beyond the torque limit
    strained = cython.declare(cython.bint, visibility="public")  # for STRAIN_TIME

    def __init__(self) -> None:
        self.position_pid, self.torque_pid, self.current_pid = Pid(), Pid(), Pid()
        self.lower, self.upper, self.entry_speed = -INFINITE, INFINITE, INFINITE
        self.stream = Stream()
        self.plan = row(1)
        self.fed = row(FEED_CYCLES)
        self.drawn = row(FEED_CYCLES)
        self.kind = AS_PWM
        self.direct_age = self.sample_age = INFINITE
        self.alone = True
        self.calm = self.spring = self.steady = 1.0

    # --- requests ---------------------------------------------------------------------------

    @cython.ccall
    def hold(self, position: cython.double) -> cython.void:
        """Stop at a position: at rest there, or where the joint comes to rest (M9, P3).

        With a jerk limit it stops from its reference where it follows that, without a jump. A
        drive that closes the loop of position goes on from its set-point, which is beyond the
        joint by sag and lag; of the braking distance the set-point has gone that lag already, but
        for what a wire has not brought yet (B7).
        """
        speed = self.velocity
        guided: cython.bint = self.law == IMPEDANCE and not self.settling
        held: cython.bint = self.kind == AS_POSITION and (guided or self.holds_place())
        smooth: cython.bint = self.max_jerk > 0.0 and self.active and self.law == POSITION
        if smooth or held:  # its velocity is the mean of the last cycle
            speed = self.followed_velocity + 0.5 * self.period * self.followed_acceleration
        moves: cython.bint = fabs(self.velocity) > REST_SPEED * self.max_velocity
        if held:
            if not smooth:
                lag = self.set_position - self.sag - position
                if self.wire > 0.0:
                    lag -= self.velocity * self.mean_age
                speed = self.speed_left(speed, lag)
            moves = speed != 0.0 and not guided  # its goal stops, whatever pushes the joint
        if smooth:
            position = self.followed
        elif held and not moves and fabs(self.velocity) <= SAGGING * self.max_velocity:
            self.sag, self.trail = self.set_position - position, 0.0
        elif held and guided:
            position = self.goal
        elif held:
            self.trail = self.set_position - self.sag - position
        self.comes_to_rest = True
        self.moving = False
        self.moved = self.reference = self.followed = position
        self.ramped = self.ramp_velocity = self.ramp_target = 0.0
        self.driven = self.stepping = self.smooth = False
        self.stopping = self.active = moves
        self.stop_due = self.stopping
        self.renewal_speed = INFINITE
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

    @cython.cfunc
    def speed_left(self, speed: cython.double, lag: cython.double) -> cython.double:
        """Of a stop whose set-point is ahead by a lag: ±√(v² − 2 a lag), v at most the joint's."""
        v = clamp(speed, min(self.velocity, 0.0), max(self.velocity, 0.0))
        spent = 2.0 * self.max_acceleration * (lag if v > 0.0 else -lag)
        left = sqrt(max(v * v - max(spent, 0.0), 0.0))
        return left if v > 0.0 else -left

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
        position = self.reference
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
        self.awaited, self.comes_to_rest = self.settling, False
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
        self.awaited, self.comes_to_rest = self.settling, False

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
        self.awaited, self.comes_to_rest = self.settling, False

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
        self, position: cython.double, velocity: cython.double, has_velocity: cython.bint
    ) -> cython.void:
        self.alone, self.sample_age = self.sample_age * self.period > MAX_STREAM_INTERVAL, 0.0
        if not has_velocity and self.goes_to(position):
            return
        self.stream.take(
            position, velocity, has_velocity, self.direct_age, self.period, self.max_velocity,
            self.max_acceleration,
        )  # fmt: skip
        self.active, self.moving, self.stopping = True, False, False
        self.stepping = False
        self.moved, self.ramped, self.moved_acceleration = position, 0.0, 0.0
        self.moved_velocity = self.ramp_velocity = self.ramp_target = 0.0
        self.reference, self.reference_velocity = position, 0.0
        self.direct_velocity = self.stream.velocity()
        self.direct_age = 0.0
        self.awaited, self.comes_to_rest = self.settling, False

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

    @cython.cfunc
    def holds_place(self) -> cython.bint:
        """Whether the position law drives it."""
        return self.law == POSITION or self.settling

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
    def start(
        self, law: cython.int, resting: cython.bint = True, held: cython.bint = False
    ) -> cython.void:
        """Switch to a law without a step of torque: it starts from the load (M9).

        Until all joints are at rest the position law brakes this one, or holds it; its static
        torque then becomes the torque of the new law (IMPEDANCE, TORQUE, CURRENT).

        Args:
            law: OFF, POSITION, ...
            resting: whether the other joints are at rest.
            held: whether the drive goes on with the set-point that it has.
        """
        load = self.known_load()
        if not resting and self.wire == 0.0:
            load = self.torque - self.motion
        self.law = law
        self.on_limit = self.holding = self.awaited = False
        self.settling = law in (IMPEDANCE, TORQUE, CURRENT) and not (resting and self.at_rest())
        self.settle_cycles = self.wait_cycles = self.strain_cycles = 0
        self.load = load
        self.current_pid.reset(0.0)
        self.position_pid.reset(
            self.position_pid.integral
            if held
            else load - self.gravity - self.feed_torque() - self.position_pid.kff * self.followed
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
        if self.dead_band > 0.0:  # its drive bears the load
            self.load_taken = 0.0
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
        lift = gravity if lifts else 0.0
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


@cython.cfunc
def run_move(j: Joint, elapsed: cython.double) -> cython.void:
    """The quintic of a move, from velocity v0 to rest (P1).

    q(s) = q0 + v0 T s + (10 R − 6 v0 T) s³ + (8 v0 T − 15 R) s⁴ + (6 R − 3 v0 T) s⁵, s = t/T; with
    a brake time T_b the initial velocity is braked by v0 (1 − 3u² + 2u³), u = t/T_b. Where that
    would pass a limit, it is braked by v0 (1 − u) first, and the quintic takes T − T_b.

    With a jerk limit the acceleration a0 at the start goes on: B = a0 T²/2 adds B (s² − 3s³ + 3s⁴
    − s⁵), in braking a0 T_b u (1 − u)² to the velocity.
    """
    bend = 0.0
    change = 0.0
    run = 0.0
    way = 0.0
    speed = 0.0
    time = j.move_time
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
    a = 10.0 * reach - 6.0 * run - 3.0 * bend
    b = 8.0 * run - 15.0 * reach + 3.0 * bend
    c = 6.0 * reach - 3.0 * run - bend
    j.moved = j.move_start + way + s * (run + s * s * (a + s * (b + s * c))) + s * s * bend
    j.moved_velocity = speed + (run + s * s * (3.0 * a + s * (4.0 * b + s * 5.0 * c))) / time
    j.moved_velocity, j.moved_acceleration = j.moved_velocity + 2.0 * s * bend / time, 0.0
    if j.max_jerk > 0.0:
        change += (2.0 * bend + s * (6.0 * a + s * (12.0 * b + s * 20.0 * c))) / (time * time)
        j.moved_acceleration = change


@cython.cfunc
def keep_inside(j: Joint) -> cython.void:
    """Brake evenly, then move, where braking within the move would pass a limit (P14)."""
    way = 1.0 if j.move_velocity > 0.0 else -1.0
    room = (j.upper if way > 0.0 else -j.lower) - way * j.move_start
    step = (j.move_time if j.move_time > j.brake_time else j.brake_time) / 64.0
    slack = 0.125 * j.max_acceleration * step * step
    last = 0.0
    before = 0.0
    speed = j.moved_velocity
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
def go_on_stopping(j: Joint, place: cython.double) -> cython.void:
    """Stop from a place and the joint's speed, at the acceleration limit."""
    j.stopping, j.smooth = True, False
    j.brake(j.max_acceleration)
    j.followed, j.moved = place, place - j.ramped
    j.moved_velocity = clamp(j.velocity, -j.max_velocity, j.max_velocity)
    j.followed_velocity = j.moved_velocity


@cython.cfunc
@cython.inline
def come_in(j: Joint, place: cython.double) -> cython.void:
    """The bounds of a joint found outside its limits follow it in, not out again (P9, P16)."""
    if j.lower < j.limit_lower:
        j.lower = clamp(place, j.lower, j.limit_lower)
    if j.upper > j.limit_upper:
        j.upper = clamp(place, j.limit_upper, j.upper)


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
    end = j.followed + j.followed_velocity * j.elapsed
    if not j.active or not is_number(j.position):
        return
    if j.kind >= AS_POSITION and j.missed > 0.0:  # where it is now is not known yet
        j.followed_velocity = j.followed_acceleration = 0.0
    else:
        restart_at(j, clamp(j.position, min(j.followed, end), max(j.followed, end)))


@cython.cfunc
@cython.inline
def place_of(j: Joint, age: cython.double) -> cython.int:
    """Where what was so an age ago is kept, as far back as it is."""
    cycles = cython.cast(cython.int, min(age / j.period + 0.5, FEED_CYCLES - 1.0))
    return (j.fed_now - cycles) & (FEED_CYCLES - 1)


@cython.cfunc
def friction(j: Joint, velocity: cython.double) -> cython.double:
    """Friction at a velocity: clip(F_c v/v_slip, ± F_c) + F_v v, with F of its direction."""
    ahead: cython.bint = velocity >= 0.0
    dry = j.coulomb if ahead else j.coulomb_negative
    wet = j.viscous if ahead else j.viscous_negative
    if dry == 0.0:
        return wet * velocity
    return dry * clamp(velocity / j.slip, -1.0, 1.0) + wet * velocity
