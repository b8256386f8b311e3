# SPDX-License-Identifier: Apache-2.0
"""Where a joint is to be now (SPEC P1 to P6): moves, stops, ramps, direct positions, streams.

The second phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import fabs, sqrt

from ... import nocython as cython
from .formulas import INFINITE, brake_speed, clamp, speed_ahead
from .joint import REST_SPEED, REST_TIME, Joint, cross_gap, go_on_stopping
from .joint_constants import Limits
from .joint_drive import AS_POSITION, AS_VELOCITY
from .joint_reference import Trajectory
from .joint_timing import GAP, Clock
from .stream import MIN_STREAM_INTERVAL, STREAM_END_AGE, Stream, TimeBase, sine, versine

#: Natural frequency of the tracking of a stream: maximum, rad/s; its product with the interval.
MAX_FREQUENCY = cython.declare(cython.double, 60.0)
FREQUENCY_INTERVAL = cython.declare(cython.double, 1.2)
#: Time over which braking fades out on a wire, in ages of late readings, or of those that were
#: not there; at most, s.
FADE_TIME_AGES = cython.declare(cython.double, 16.0)
MAX_FADE_TIME = cython.declare(cython.double, 0.16)
#: Part of that time for a drive that closes a loop of its own.
DRIVE_FADE_SHARE = cython.declare(cython.double, 0.75)
#: Of a swing whose middle is near: way, of the limit's edge, speed and torque, of their limits.
SWING = cython.declare(cython.double, 0.04)
SWING_SPEED = cython.declare(cython.double, 0.01)
SWING_TORQUE = cython.declare(cython.double, 0.05)
#: Speed at which a stop may begin anew, as a part of that where it last did.
RENEWAL_SHARE = cython.declare(cython.double, 0.98)
#: Time in which a reference that brakes on a wire yields to a joint ahead of it, s.
YIELD_TIME = cython.declare(cython.double, 0.015)


@cython.cfunc
def advance(j: Joint) -> cython.void:
    """One cycle of the reference: trajectory + ∫v dt, or the direct position (P1 to P6)."""
    periods = j.clock.elapsed / j.clock.period
    j.direct.sample_age += periods
    if j.clock.gap:
        cross_gap(j)
    if j.ramp.is_step:
        j.trajectory.position, j.ramp.way = j.track.position, 0.0
        j.reference.position = j.track.position
    if j.trajectory.moving:
        advance_move(j.trajectory, j.clock, j.limits)
    elif j.stop.active and j.stop.ahead:
        advance_stop_ahead(j)
        return
    elif j.stop.active:
        advance_stop(j)
    velocity = j.trajectory.velocity
    if j.ramp.target != 0.0 or j.ramp.velocity != 0.0:
        advance_ramp(j)
        velocity += j.ramp.velocity
    if j.direct.age < INFINITE:
        j.direct.age += periods
    else:
        j.reference.velocity = velocity
    place = j.trajectory.position + j.ramp.way
    j.reference.position = clamp(place, j.reference.lower, j.reference.upper)
    if j.clock.gap:
        j.clock.elapsed = j.clock.span = j.clock.period
    elif j.drive.kind == AS_POSITION and j.clock.hold_time < j.clock.elapsed:
        # a set-point is a step
        j.clock.elapsed, j.clock.span = j.clock.hold_time, min(j.clock.span, j.clock.hold_time)
    follow(j)
    if j.ramp.is_step:
        j.reference.position = j.track.position
    if j.calibrated:
        j.reference.come_in(j.track.position, j.limits)


@cython.cfunc
def rest_in_place(j: Joint) -> cython.void:
    """Where a drive of positions comes to rest becomes the reference; its set-point stays (M9).

    The drive holds beyond it by the sag, load/stiffness. A soft one swings and creeps for a
    second, and the resolution of its velocity hides when that ends: the reference follows, as
    soon as a swing is small, until there is another one.
    """
    if not j.reference.comes_to_rest or j.drive.kind != AS_POSITION:
        return
    if j.reference.active or j.braked:
        return
    off = fabs(j.position - j.track.position)
    swings: cython.bint = (
        off > SWING * j.limits.edge
        and fabs(j.velocity) <= SWING_SPEED * j.limits.velocity
        and fabs(j.motor.inertia * j.acceleration) <= SWING_TORQUE * j.limits.torque
    )
    rests: cython.bint = off > 0.0 and j.rest_cycles * j.clock.period >= REST_TIME
    if j.holds_place() and (swings or rests):
        j.set_point.sag, j.set_point.trail = j.set_point.position - j.position, 0.0
        j.trajectory.position = j.reference.position = j.track.position = j.position
        j.ramp.way, j.reference.active = 0.0, True


@cython.cfunc
def advance_move(trajectory: Trajectory, clock: Clock, limits: Limits) -> cython.void:
    """One cycle of a move (P1)."""
    trajectory.cycles += clock.elapsed / clock.period
    elapsed = trajectory.cycles * clock.period
    if elapsed >= max(trajectory.brake_time, trajectory.time) - 1e-9 * clock.period:
        trajectory.moving = False
        trajectory.arrive()
    else:
        trajectory.run(elapsed, limits.jerk > 0.0)


@cython.cfunc
def advance_stop(j: Joint) -> cython.void:
    """Brake as planned (``stopping``), to hold where the joint comes to rest (M9, P3)."""
    step = j.plan.steps
    elapsed = min(j.clock.elapsed, GAP * j.clock.period) if j.clock.gap else j.clock.elapsed
    span = min(j.clock.span, GAP * j.clock.period) if j.clock.gap else j.clock.span
    rate = fading(j, j.trajectory.velocity)
    change = min(j.stop.rate, rate) * span
    over = j.velocity - j.ramp.velocity
    if step > 0:
        step = j.plan.place()
    if j.stop.smooth:
        stop_smoothly(j.trajectory, elapsed, j.clock.period, j.limits)
    elif step < j.plan.steps:
        j.plan.time += elapsed
        if j.plan.accelerations[step] * j.trajectory.velocity >= 0.0:
            rate = INFINITE
        j.trajectory.velocity += clamp(j.plan.accelerations[step], -rate, rate) * span
    else:
        j.plan.steps = 0
        j.trajectory.velocity = clamp(
            0.0, j.trajectory.velocity - change, j.trajectory.velocity + change
        )
    if not j.stop.smooth:
        j.trajectory.position += j.trajectory.velocity * elapsed + yielded(j)
    place = clamp(
        j.trajectory.position, j.reference.lower - j.ramp.way, j.reference.upper - j.ramp.way
    )
    if place != j.trajectory.position:  # too fast to stop before a limit
        j.trajectory.position, j.trajectory.velocity, j.plan.steps = place, 0.0, 0
        j.stop.active = j.stop.smooth = False
        return
    if j.stop.smooth:
        j.stop.active = j.stop.smooth = (
            j.trajectory.cycles * j.clock.period < j.trajectory.brake_time
        )
    else:
        j.stop.active = j.trajectory.velocity != 0.0 or j.plan.steps > 0
    if not j.stop.active:
        renew_stop(j, over)


@cython.cfunc
def advance_stop_ahead(j: Joint) -> cython.void:
    """Brake by the board's torque, with the acceleration of the next cycle fed forward (M9, P3).

    The reference is where that of the last one has brought the joint by now, x += v Δt + ½ a Δt²,
    v += a Δt. A joint that comes to rest beyond it stays there.
    """
    elapsed = 0.0 if j.clock.gap else j.clock.elapsed
    before = j.track.velocity
    velocity = before + j.track.acceleration * elapsed
    if j.plan.steps > 0 and j.plan.place() >= j.plan.steps:
        j.plan.steps = 0
    if before * velocity < 0.0 and j.plan.steps == 0:
        velocity = 0.0
    place = j.track.position + 0.5 * (before + velocity) * elapsed
    limited: cython.bint = place > j.reference.upper or place < j.reference.lower
    if limited:  # too fast to stop before it
        place = clamp(place, j.reference.lower, j.reference.upper)
        velocity, j.plan.steps = 0.0, 0
    j.track.position, j.trajectory.position = place, place - j.ramp.way
    j.track.velocity = j.trajectory.velocity = velocity
    j.stop.active = velocity != 0.0 or j.plan.steps > 0
    if not j.stop.active and not limited:
        renew_stop(j, j.velocity)
    if not j.stop.active and (j.position - place) * before > 0.0:
        place = clamp(j.position, j.reference.lower, j.reference.upper)
        j.track.position, j.trajectory.position = place, place - j.ramp.way
    j.reference.position, j.reference.velocity = j.track.position, j.track.velocity
    if j.plan.steps > 0:
        j.track.acceleration = j.plan.accelerations[j.plan.place()]
        j.plan.time += j.clock.period
    else:
        rate = -j.track.velocity / j.clock.period
        j.track.acceleration = clamp(rate, -j.stop.rate, j.stop.rate)
    j.stop.ahead = j.stop.active
    if j.calibrated:
        j.reference.come_in(j.track.position, j.limits)


@cython.cfunc
def renew_stop(j: Joint, over: cython.double) -> cython.void:
    """Begin a stop anew whose joint runs past its end, for want of torque.

    One that creeps at one speed does not want it. ``over``: beyond the velocity reference, rad/s.
    """
    late = max(j.wire.max_age, j.wire.outage)  # set-points, by as much (B7)
    known_to = REST_SPEED * j.limits.velocity + j.limits.acceleration * late
    if fabs(over) <= known_to or j.drive.kind == AS_POSITION:
        return
    ahead = j.position - j.trajectory.position - j.ramp.way
    slower: cython.bint = fabs(over) <= RENEWAL_SHARE * j.stop.renewal_speed
    if slower and ahead * over > 0.0 and ahead * j.velocity > 0.0:
        j.stop.renewal_speed = fabs(over)
        go_on_stopping(j, j.position)


@cython.cfunc
@cython.inline
def fading(j: Joint, velocity: cython.double) -> cython.double:
    """The deceleration at which a stop fades out on a wire, rad/s²: √(2 a v/t), a → 0 in t (B7).

    A set-point that comes Δ late at its end then leaves a speed of a Δ²/2t backwards, not a Δ.
    """
    time = min(FADE_TIME_AGES * max(j.wire.max_age, j.wire.outage), MAX_FADE_TIME)
    if time <= 0.0:
        return INFINITE
    if j.drive.kind >= AS_VELOCITY:
        time *= DRIVE_FADE_SHARE
    return sqrt(2.0 * j.limits.acceleration * fabs(velocity) / time)


@cython.cfunc
@cython.inline
def yielded(j: Joint) -> cython.double:
    """The way by which a reference that brakes yields to a joint ahead of it, rad (B7).

    Set-points that come late brake late: what the joint runs on by is not driven back (M9). A
    drive that closes a loop of its own has a reference that does not jump.
    """
    ahead = clamp(j.position, j.reference.lower, j.reference.upper) - j.track.position
    if j.wire.max_age == 0.0 or j.wire.blind or j.drive.kind >= AS_VELOCITY:
        return 0.0
    if ahead * j.track.velocity <= 0.0:
        return 0.0
    ahead *= min(j.clock.elapsed / YIELD_TIME, 1.0)
    j.track.position += ahead
    return ahead


@cython.cfunc
def stop_smoothly(
    trajectory: Trajectory, elapsed: cython.double, period: cython.double, limits: Limits
) -> cython.void:
    """One cycle of a stop within the jerk limit; at its end the joint is at rest."""
    trajectory.cycles += elapsed / period
    if trajectory.cycles * period < trajectory.brake_time:
        trajectory.run(trajectory.cycles * period, limits.jerk > 0.0)
    else:
        trajectory.arrive()


@cython.cfunc
def advance_ramp(j: Joint) -> cython.void:
    """The velocity reference: ramped (P5), within the speed limit, braking ahead of limits (P14).

    The speed limit applies to the sum with a move's velocity.
    """
    elapsed = j.clock.elapsed
    step = j.ramp.step * (elapsed / j.clock.period)
    if j.ramp.target == 0.0 and not j.ramp.is_step:
        step = min(step, fading(j, j.ramp.velocity) * elapsed)
    v = clamp(j.ramp.target, j.ramp.velocity - step, j.ramp.velocity + step)
    top = j.wire.speed_share * j.limits.velocity
    above = j.reference.upper - j.reference.position
    below = j.reference.position - j.reference.lower
    up = speed_ahead(above, j.limits.acceleration, elapsed, top)
    down = speed_ahead(below, j.limits.acceleration, elapsed, top)
    moved = j.trajectory.velocity
    total = clamp(moved + v, -down, up)
    j.ramp.velocity = total - moved if total != moved + v else v
    j.ramp.way += j.ramp.velocity * elapsed
    if j.ramp.target == 0.0:
        j.ramp.way += yielded(j)


@cython.cfunc
@cython.inline
def top_speed(j: Joint) -> cython.double:
    """Of the followed reference, rad/s: a direct position comes in from outside limits (P16)."""
    place = j.track.position
    outside: cython.bint = place > j.limits.upper or place < j.limits.lower
    if outside and j.calibrated and j.direct.age < INFINITE:
        return j.reference.entry_speed
    return j.wire.speed_share * j.limits.velocity


@cython.cfunc
def follow(j: Joint) -> cython.void:
    """The followed reference: the reference within speed, acceleration and position limits (P14).

    It equals the reference where the limits allow; else it is the fastest approach that ends with
    the reference's velocity: v = v_ref + brake_speed(distance). Of a stream it tracks the motion
    fitted to the samples (``follow_stream``). Joints that lack the torque to step together have a
    plan (``stepping``).
    """
    max_acceleration = j.limits.acceleration
    goal = j.reference.position
    top = top_speed(j)
    goal_velocity = j.reference.velocity
    step = max_acceleration * j.clock.span
    if j.direct.age < INFINITE:
        goal_velocity = 0.0
        if (
            j.direct.stream.flows
            and (j.direct.age - 1.0) * j.clock.period > j.direct.stream.patience()
        ):
            j.direct.stream.flows = False  # it has ended
        if not j.direct.stream.flows:
            j.reference.velocity = j.direct.velocity = 0.0
    if j.direct.stepping and (j.wire.coasts or j.plan.time >= j.plan.steps * j.plan.step - 1e-9):
        j.direct.stepping = False
    if j.direct.stepping:
        velocity = j.track.velocity + j.plan.accelerations[j.plan.place()] * j.clock.span
        j.plan.time += j.clock.elapsed
    elif j.direct.age < INFINITE and j.direct.stream.flows:
        velocity = follow_stream(j)
        goal_velocity = j.reference.velocity
    else:
        j.direct.acceleration = j.direct.peak_acceleration = 0.0
        rest = goal - j.track.position - goal_velocity * j.clock.elapsed
        if rest >= 0.0:
            velocity = goal_velocity + brake_speed(rest, max_acceleration, j.clock.elapsed)
        else:
            velocity = goal_velocity - brake_speed(-rest, max_acceleration, j.clock.elapsed)
    up = speed_ahead(j.reference.upper - j.track.position, max_acceleration, j.clock.elapsed, top)
    down = speed_ahead(
        j.track.position - j.reference.lower, max_acceleration, j.clock.elapsed, top
    )
    velocity = clamp(velocity, -down, up)
    change = (
        INFINITE if j.stop.active and j.plan.steps > 0 else step
    )  # a plan has what torque allows
    velocity = clamp(velocity, j.track.velocity - change, j.track.velocity + change)
    if j.wire.coasts:  # slower at most (B7)
        up, down = max(j.track.velocity, 0.0), max(-j.track.velocity, 0.0)
        velocity = clamp(velocity, -down, up)
    j.track.acceleration = (velocity - j.track.velocity) / j.clock.span
    j.track.velocity = velocity
    j.track.position += velocity * j.clock.elapsed
    if fabs(goal - j.track.position) <= 1e-12 and goal_velocity == 0.0:
        j.track.position = goal
    if (
        j.track.position == goal
        and fabs(velocity) <= step * 1e-6
        and not (j.trajectory.moving or j.stop.active or j.ramp.target != 0.0)
        and j.ramp.velocity == 0.0
        and j.direct.velocity == 0.0
        and (j.direct.age == INFINITE or j.direct.age * j.clock.period > STREAM_END_AGE)
    ):
        j.reference.active, j.direct.sample_age = False, INFINITE
        j.track.velocity = j.track.acceleration = 0.0


@cython.cfunc
def follow_stream(j: Joint) -> cython.double:
    """The velocity of the followed reference on its way to the motion of a stream, and along it.

    e = r − x, w = v − v_r:  v̇ = a_r + 2ω (w_e − w), w_e = ½ω e near it (critically damped), and
    √(2b(|e| − 2b/ω²)) far away, b = 0.8 (a_max − peak |a_r|), which leaves the acceleration of the
    motion itself. a_r is low-passed; ω is inverse to the stream's interval.
    """
    s: Stream = j.direct.stream
    base: TimeBase = s.grid if s.on_grid else s.sent
    age = (j.direct.age - 1.0) * j.clock.period
    interval = s.interval if s.interval > MIN_STREAM_INTERVAL else MIN_STREAM_INTERVAL
    quick = FREQUENCY_INTERVAL / interval
    if s.on_grid:
        age += s.late
    quick = min(quick, MAX_FREQUENCY)
    quick = min(quick, 0.2 / j.clock.period)
    turned = versine(base.turning, age)
    cosine = 1.0 - base.turning * turned
    run = sine(base.turning, age)
    goal = base.x + base.v * run + base.a * turned
    speed = base.v * cosine + base.a * run
    speed = clamp(speed, -j.limits.velocity, j.limits.velocity)
    rate = base.a * cosine - base.turning * base.v * run
    rate = clamp(rate, -j.limits.acceleration, j.limits.acceleration)
    if (goal >= j.reference.upper and speed > 0.0) or (goal <= j.reference.lower and speed < 0.0):
        goal, speed, rate = clamp(goal, j.reference.lower, j.reference.upper), 0.0, 0.0
    j.reference.velocity = j.direct.velocity = speed
    share = 3.0 * quick * j.clock.elapsed
    j.direct.acceleration += (rate - j.direct.acceleration) * (share if share < 1.0 else 1.0)
    rate = j.direct.acceleration
    j.direct.peak_acceleration *= 1.0 - j.clock.elapsed
    j.direct.peak_acceleration = max(j.direct.peak_acceleration, fabs(rate))
    speed -= 0.5 * rate * j.clock.elapsed  # the mean over this cycle
    error = goal - j.track.position - speed * j.clock.elapsed
    off = j.track.velocity - speed + rate * j.clock.span
    brake = 0.8 * (j.limits.acceleration - j.direct.peak_acceleration)
    brake = max(brake, 0.03 * j.limits.acceleration)
    slope = 0.5 * quick
    near = brake / (slope * slope)
    wanted = slope * error
    ahead = 0.0
    if fabs(error) > near:
        wanted = sqrt(2.0 * brake * (fabs(error) - 0.5 * near))
        ahead = brake * fabs(off) / wanted
        ahead = min(ahead, brake)
        if error < 0.0:
            wanted = -wanted
        else:
            ahead = -ahead
    change = (rate + ahead + 4.0 * slope * (wanted - off)) * j.clock.span
    wanted = speed + error / j.clock.elapsed
    if fabs(wanted - j.track.velocity - change) <= 0.01 * j.limits.acceleration * j.clock.span:
        return wanted
    return j.track.velocity + change
