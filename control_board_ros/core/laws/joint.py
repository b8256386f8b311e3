# SPDX-License-Identifier: Apache-2.0
"""A joint as the laws see it: what it does now, what is asked of it, and its parts.

Its parts are constants (``joint_constants``), the set-point of its drive (``joint_drive``), time
(``joint_timing``), the reference (``joint_reference``), and the torque from outside
(``joint_contact``). The phases of a cycle (``laws``) read and write the fields; ``control`` sets
the constants. Units: rad, rad/s, N·m, A, s; m and N for prismatic joints.
"""

from __future__ import annotations

from math import fabs, sqrt

from ... import nocython as cython
from .formulas import INFINITE, clamp, is_number
from .joint_constants import Limits, Motor
from .joint_contact import Admittance, ExternalTorque
from .joint_drive import AS_POSITION, AS_VELOCITY, Drive, SetPoint
from .joint_reference import Direct, Plan, Ramp, Reference, Stop, Track, Trajectory
from .joint_timing import Clock, History, Wire
from .pid import Pid

#: The laws of source Fig. 2; modes.Law gives them names.
OFF = cython.declare(cython.int, 0)
POSITION = cython.declare(cython.int, 1)
IMPEDANCE = cython.declare(cython.int, 2)
TORQUE = cython.declare(cython.int, 3)
OUTPUT = cython.declare(cython.int, 4)
CURRENT = cython.declare(cython.int, 6)
#: Direct positions nearer than what a joint accelerates through in this time, s, have no plan.
SHORT_STEP = cython.declare(cython.double, 0.02)
#: A joint is at rest below this part of its speed limit, and of its torque limit in acceleration.
REST_SPEED = cython.declare(cython.double, 2e-3)
REST_TORQUE = cython.declare(cython.double, 5e-3)
#: Time at rest after which the load is known, s.
REST_TIME = cython.declare(cython.double, 0.03)
#: Speed, as a part of the limit, up to which the sag of a drive is that at rest.
SAGGING = cython.declare(cython.double, 0.05)
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

    limits = cython.declare(Limits, visibility="public")
    motor = cython.declare(Motor, visibility="public")
    drive = cython.declare(Drive, visibility="public")
    clock = cython.declare(Clock, visibility="public")
    wire = cython.declare(Wire, visibility="public")
    history = cython.declare(History, visibility="public")
    reference = cython.declare(Reference, visibility="public")
    track = cython.declare(Track, visibility="public")
    trajectory = cython.declare(Trajectory, visibility="public")
    stop = cython.declare(Stop, visibility="public")
    plan = cython.declare(Plan, visibility="public")
    ramp = cython.declare(Ramp, visibility="public")
    direct = cython.declare(Direct, visibility="public")
    external = cython.declare(ExternalTorque, visibility="public")
    admittance = cython.declare(Admittance, visibility="public")
    set_point = cython.declare(SetPoint, visibility="public")

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

    # --- measured and observed --------------------------------------------------------------
    position = velocity = torque = current = cython.declare(cython.double, visibility="public")
    current_before = cython.declare(cython.double, visibility="public")  # a cycle ago
    sampled = cython.declare(cython.double, visibility="public")  # velocity of the reading
    behind = cython.declare(cython.double, visibility="public")  # way since the reading, rad
    acceleration = cython.declare(cython.double, visibility="public")
    weighed_torque = cython.declare(cython.double, visibility="public")  # of the last reading
    load = cython.declare(cython.double, visibility="public")  # filtered, without inertia
    motion = cython.declare(cython.double, visibility="public")  # torque of the acceleration
    gravity = cython.declare(cython.double, visibility="public")  # of the arm's model, or 0
    readings = cython.declare(cython.int, visibility="public")  # since power-on
    rest_cycles = cython.declare(cython.int, visibility="public")

    # --- state of the laws ------------------------------------------------------------------
    forward = cython.declare(cython.double, visibility="public")  # feed-forward torque
    feedback = cython.declare(cython.double, visibility="public")  # filtered, without integral
    lifts = cython.declare(cython.bint, visibility="public")  # compensates, and the arm is known
    lift = cython.declare(cython.double, visibility="public")  # compensated gravity torque
    blocked = cython.declare(cython.bint, visibility="public")  # at rest against its reference
    carried = cython.declare(cython.double, visibility="public")  # integral part while it was not
    settling = cython.declare(cython.bint, visibility="public")  # held until the load is known
    settle_cycles = cython.declare(cython.int, visibility="public")
    wait_cycles = cython.declare(cython.int, visibility="public")  # for others that brake
    awaited = cython.declare(cython.bint, visibility="public")  # a reference waits for the load
    holding = cython.declare(cython.bint, visibility="public")  # before a first torque or current
    hold_place = cython.declare(cython.double, visibility="public")

    # --- results ----------------------------------------------------------------------------
    torque_reference = cython.declare(cython.double, visibility="public")
    output = cython.declare(cython.double, visibility="public")  # PWM, percent
    on_limit = cython.declare(cython.bint, visibility="public")
    was_on_limit = cython.declare(cython.bint, visibility="public")  # in the last step
    diverged = cython.declare(cython.bint, visibility="public")  # its output was not finite
    strain_cycles = cython.declare(cython.int, visibility="public")  # beyond the torque limit
    strained = cython.declare(cython.bint, visibility="public")  # for STRAIN_TIME

    def __init__(self) -> None:
        self.limits, self.motor, self.drive = Limits(), Motor(), Drive()
        self.clock, self.wire, self.history = Clock(), Wire(), History()
        self.reference, self.track, self.trajectory = Reference(), Track(), Trajectory()
        self.stop, self.plan, self.ramp, self.direct = Stop(), Plan(), Ramp(), Direct()
        self.external, self.admittance, self.set_point = ExternalTorque(), Admittance(), SetPoint()
        self.position_pid, self.torque_pid, self.current_pid = Pid(), Pid(), Pid()

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
        held: cython.bint = self.drive.kind == AS_POSITION and (guided or self.holds_place())
        smooth: cython.bint = (
            self.limits.jerk > 0.0 and self.reference.active and self.law == POSITION
        )
        if smooth or held:  # its velocity is the mean of the last cycle
            speed = self.track.velocity + 0.5 * self.clock.period * self.track.acceleration
        moves: cython.bint = fabs(self.velocity) > REST_SPEED * self.limits.velocity
        if held:
            if not smooth:
                lag = self.set_point.position - self.set_point.sag - position
                if self.wire.max_age > 0.0:
                    lag -= self.velocity * self.wire.mean_age
                speed = self.speed_left(speed, lag)
            moves = speed != 0.0 and not guided  # its goal stops, whatever pushes the joint
        if smooth:
            position = self.track.position
        elif held and not moves and fabs(self.velocity) <= SAGGING * self.limits.velocity:
            self.set_point.sag, self.set_point.trail = self.set_point.position - position, 0.0
        elif held and guided:
            position = self.admittance.position
        elif held:
            self.set_point.trail = self.set_point.position - self.set_point.sag - position
        self.reference.comes_to_rest = True
        self.trajectory.moving = False
        self.trajectory.position = self.reference.position = self.track.position = position
        self.ramp.clear()
        self.ramp.is_step = self.direct.stepping = False
        self.stop.smooth = self.stop.ahead = False
        self.stop.renewal_speed, self.stop.prior_rate = INFINITE, 0.0
        if self.reference.active:
            rate = -self.track.acceleration if self.velocity > 0.0 else self.track.acceleration
            self.stop.prior_rate = max(rate, 0.0)
        self.stop.active = self.stop.due = self.reference.active = moves
        self.brake(self.limits.acceleration)
        self.trajectory.velocity = 0.0
        if self.stop.active:
            self.trajectory.velocity = clamp(speed, -self.limits.velocity, self.limits.velocity)
        self.track.velocity = self.reference.velocity = self.trajectory.velocity
        self.trajectory.acceleration = 0.0
        if smooth and self.stop.active:
            self.trajectory.acceleration = self.track.acceleration
        self.track.acceleration = self.trajectory.acceleration
        self.direct.end()
        self.direct.stream.end()

    @cython.cfunc
    def speed_left(self, speed: cython.double, lag: cython.double) -> cython.double:
        """Of a stop whose set-point is ahead by a lag: ±√(v² − 2 a lag), v at most the joint's."""
        v = clamp(speed, min(self.velocity, 0.0), max(self.velocity, 0.0))
        spent = 2.0 * self.limits.acceleration * (lag if v > 0.0 else -lag)
        left = sqrt(max(v * v - max(spent, 0.0), 0.0))
        return left if v > 0.0 else -left

    @cython.ccall
    def take_off(self) -> cython.void:
        """Begin a stop that is due, in the cycle that brakes first.

        Where the board's torque brakes the joint, from where that is now: a reference that braked
        since the request would be ahead of what any torque can do.
        """
        self.stop.ahead = (
            self.stop.active
            and not self.stop.smooth
            and self.drive.kind < AS_VELOCITY
            and self.wire.max_age == 0.0
            and self.limits.jerk == 0.0
        )
        if self.stop.ahead:
            go_on_stopping(self, self.position - self.velocity * self.clock.elapsed)

    @cython.ccall
    def brake_since(self, rate: cython.double) -> cython.void:
        """Stop with a deceleration, rad/s², by a reference that brakes since the last cycle.

        The feedback makes up for what the joint did not brake in it: there is the torque for that.
        """
        self.brake(rate)
        if self.stop.ahead:
            rate = max(rate - self.stop.prior_rate, 0.0)
            rate = min(rate, fabs(self.track.velocity) / self.clock.elapsed)
            self.track.acceleration = -rate if self.track.velocity > 0.0 else rate

    @cython.ccall
    def brake(self, rate: cython.double) -> cython.void:
        """Stop with a deceleration, rad/s²."""
        self.stop.rate, self.plan.steps = rate, 0

    @cython.ccall
    def brake_smoothly(self, time: cython.double) -> cython.void:
        """Stop in a time, s, from the present velocity and acceleration, with bounded jerk."""
        self.stop.smooth, self.plan.steps, self.stop.rate = True, 0, self.limits.acceleration
        self.trajectory.brake(time)

    @cython.ccall
    def brake_by(
        self, plan: cython.double[::1], steps: cython.int, step: cython.double
    ) -> cython.void:
        """Stop by a plan: accelerations (rad/s²) of steps (s); its rest at the limit."""
        self.plan.begin(plan, steps, step)
        self.stop.rate = self.limits.acceleration

    @cython.ccall
    def is_far(self) -> cython.bint:
        """Whether its direct position is a step: no sample of a stream, by time and distance."""
        return (
            self.direct.alone
            and not (self.direct.stepping or self.trajectory.moving)
            and self.limits.lower <= self.track.position <= self.limits.upper
            and fabs(self.reference.position - self.track.position)
            > SHORT_STEP**2 * self.limits.acceleration
        )

    @cython.ccall
    def step_by(
        self, plan: cython.double[::1], steps: cython.int, step: cython.double
    ) -> cython.void:
        """Approach the direct position by a plan: accelerations (rad/s²) of steps (s)."""
        self.plan.begin(plan, steps, step)
        self.direct.stepping = True

    @cython.ccall
    def give_back(self) -> cython.double:
        """Take a direct position back, to go on from the followed reference; the position."""
        position = self.reference.position
        self.reference.position = self.trajectory.position = self.track.position
        self.reference.velocity = self.trajectory.velocity = self.track.velocity
        self.direct.end()
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
        self.reference.active = self.trajectory.moving = True
        self.stop.active = self.direct.stepping = False
        self.ramp.way = 0.0
        self.trajectory.begin(self.reference.position, target, max(self.clock.period, time), brake)
        if brake > 0.0:
            self.trajectory.keep_inside(self.reference, self.limits)
        self.expect_motion()

    @cython.cfunc
    def expect_motion(self) -> cython.void:
        """A reference has come: it waits for the load where the joint settles."""
        self.awaited, self.reference.comes_to_rest = self.settling, False

    @cython.ccall
    def ramp_to(self, velocity: cython.double, acceleration: cython.double) -> cython.void:
        """Ramp the velocity reference to a new value; to zero at the acceleration limit (P5)."""
        self.reference.active = True
        self.ramp.target = velocity
        if velocity == 0.0:
            acceleration = self.limits.acceleration
        self.ramp.step = acceleration * self.clock.period
        self.expect_motion()

    @cython.ccall
    def drive_at(self, velocity: cython.double) -> cython.void:
        """Set a velocity reference without a ramp (Y1).

        The position reference equals the followed one: the distance that the acceleration limit
        costs is not made up for.
        """
        self.reference.active = self.ramp.is_step = True
        self.stop.active = False
        self.ramp.target = self.ramp.velocity = self.reference.velocity = velocity
        self.ramp.step = INFINITE
        self.expect_motion()

    @cython.ccall
    def halt(self) -> cython.void:
        """Bring the velocity reference to zero, as a reference of zero does (P5, P12)."""
        if self.ramp.is_step:
            self.drive_at(0.0)
        else:
            self.ramp_to(0.0, self.limits.acceleration)

    @cython.ccall
    def step_to(self, position: cython.double) -> cython.void:
        """Set a direct position (P4): a step, or a sample of a stream."""
        self.take_sample(position, 0.0, False)

    @cython.ccall
    def step_with(self, position: cython.double, velocity: cython.double) -> cython.void:
        """Set a direct position with its velocity (P4)."""
        self.take_sample(
            position, clamp(velocity, -self.limits.velocity, self.limits.velocity), True
        )

    @cython.cfunc
    def take_sample(
        self, position: cython.double, velocity: cython.double, has_velocity: cython.bint
    ) -> cython.void:
        self.direct.note_arrival(self.clock.period)
        if not has_velocity and self.goes_to(position):
            return
        self.direct.take(position, velocity, has_velocity, self.clock.period, self.limits)
        self.reference.active, self.trajectory.moving, self.stop.active = True, False, False
        self.trajectory.position = position
        self.trajectory.velocity = self.trajectory.acceleration = 0.0
        self.ramp.clear()
        self.reference.position, self.reference.velocity = position, 0.0
        self.expect_motion()

    @cython.cfunc
    def goes_to(self, position: cython.double) -> cython.bint:
        """Whether a planned step, or a move, to a position is under way (P15)."""
        if self.trajectory.moving:
            return position == self.trajectory.target
        return self.direct.stepping and position == self.trajectory.position

    @cython.ccall
    def at_rest(self) -> cython.bint:
        """Whether velocity and acceleration of the last readings are negligible."""
        return (
            self.readings > 1
            and fabs(self.velocity) <= REST_SPEED * self.limits.velocity
            and fabs(self.motor.inertia * self.acceleration) <= REST_TORQUE * self.limits.torque
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
        if self.wire.max_age > 0.0 or self.rest_cycles * self.clock.period >= REST_TIME:
            return self.load
        return self.torque - self.motion

    @cython.ccall
    def feed_torque(self) -> cython.double:
        """u_ff as a torque, N·m."""
        if self.feeds and self.drive.per_torque > 0.0:
            return self.output_offset * self.drive.per_feed / self.drive.per_torque
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
        if not resting and self.wire.max_age == 0.0:
            load = self.torque - self.motion
        self.law = law
        self.on_limit = self.holding = self.awaited = False
        self.settling = law in (IMPEDANCE, TORQUE, CURRENT) and not (resting and self.at_rest())
        self.settle_cycles = self.wait_cycles = self.strain_cycles = 0
        self.load = load
        self.current_pid.reset(0.0)
        integral = self.position_pid.integral
        if not held:
            integral = load - self.gravity - self.feed_torque()
            integral -= self.position_pid.kff * self.track.position
        self.position_pid.reset(integral)
        self.torque_reference = self.torque_command = self.torque
        self.current_command = 0.0
        self.torque_pid.reset(0.0)
        self.set_point.request = clamp(
            self.torque * self.drive.per_torque, -self.drive.max, self.drive.max
        )
        if law in (OFF, OUTPUT):
            self.rest()
        if law == OFF:
            self.output = 0.0
        elif not self.settling:
            self.take(load)

    @cython.cfunc
    def rest(self) -> cython.void:
        """No law brakes the joint: the reference is at rest where it is."""
        if self.stop.active:
            self.stop.active = self.stop.due = self.reference.active = False
            self.trajectory.velocity = self.reference.velocity = self.track.velocity = 0.0

    @cython.cfunc
    def take(self, load: cython.double) -> cython.void:
        """Make the load the torque of the law without references."""
        self.settling = self.awaited = False
        self.load_taken = load - self.lift - self.torque_offset
        self.torque_command = load - self.lift
        self.holding = self.law in (TORQUE, CURRENT)
        self.hold_place = self.track.position
        if self.admittance.dead_band > 0.0:  # its drive bears the load
            self.load_taken = 0.0
            self.admittance.enter(self.track, self.torque_offset)
        self.torque_pid.reset(self.torque - self.torque_pid.kff * load - self.feed_torque())

    @cython.ccall
    def offer_torque(self, torque: cython.double) -> cython.void:
        """Set τ_ff (P11), which replaces the captured load."""
        if self.settling:
            self.take(self.known_load())
        self.offset_given = True
        self.torque_offset, self.load_taken = torque, 0.0
        if self.admittance.dead_band > 0.0:
            self.admittance.forget_entry()

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
        self.output = self.torque_reference = self.load = self.set_point.request = 0.0
        self.set_point.current = self.set_point.torque = self.set_point.velocity = 0.0
        self.readings = self.rest_cycles = 0
        self.position_pid.reset(0.0)
        self.torque_pid.reset(0.0)
        self.current_pid.reset(0.0)
        self.hold(self.position)


@cython.cfunc
def go_on_stopping(j: Joint, place: cython.double) -> cython.void:
    """Stop from a place and the joint's speed, at the acceleration limit."""
    j.stop.active, j.stop.smooth = True, False
    j.brake(j.limits.acceleration)
    j.track.position, j.trajectory.position = place, place - j.ramp.way
    j.trajectory.velocity = clamp(j.velocity, -j.limits.velocity, j.limits.velocity)
    j.track.velocity, j.track.acceleration = j.trajectory.velocity, 0.0


@cython.cfunc
def restart_at(j: Joint, place: cython.double) -> cython.void:
    """Continue the followed reference from a place, with the joint's velocity."""
    j.track.position = clamp(place, j.reference.lower, j.reference.upper)
    j.track.velocity = clamp(j.velocity, -j.limits.velocity, j.limits.velocity)
    j.track.acceleration = 0.0
    j.direct.stepping = False
    if j.stop.active:
        go_on_stopping(j, j.track.position)
    j.reference.active = True


@cython.cfunc
def cross_gap(j: Joint) -> cython.void:
    """After a gap between two cycles, in which the drive got no set-point (B6).

    A joint by torque or velocity coasted, one by position stood: the followed reference goes on
    from where the joint is between both, as if one period had passed.
    """
    end = j.track.position + j.track.velocity * j.clock.elapsed
    if not j.reference.active or not is_number(j.position):
        return
    if j.drive.kind >= AS_POSITION and j.wire.silence > 0.0:  # where it is now is not known yet
        j.track.velocity = j.track.acceleration = 0.0
    else:
        restart_at(j, clamp(j.position, min(j.track.position, end), max(j.track.position, end)))
