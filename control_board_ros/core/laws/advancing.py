# SPDX-License-Identifier: Apache-2.0
"""Where a joint is to be now (SPEC P1 to P6): moves, stops, ramps, direct positions, streams.

The second phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import fabs, sqrt

from ... import nocython as cython
from .formulas import INFINITE, brake_speed, clamp, speed_ahead
from .joint import (
    AS_POSITION,
    AS_VELOCITY,
    GAP,
    REST_SPEED,
    REST_TIME,
    Joint,
    come_in,
    cross_gap,
    go_on_stopping,
    run_move,
)
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
    periods = j.elapsed / j.period
    j.sample_age += periods
    if j.gap:
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
    if j.gap:
        j.elapsed = j.span = j.period
    elif j.kind == AS_POSITION and j.hold_time < j.elapsed:  # a set-point is a step
        j.elapsed, j.span = j.hold_time, min(j.span, j.hold_time)
    follow(j)
    if j.driven:
        j.reference = j.followed
    if j.calibrated:
        come_in(j, j.followed)


@cython.cfunc
def rest_in_place(j: Joint) -> cython.void:
    """Where a drive of positions comes to rest becomes the reference; its set-point stays (M9).

    The drive holds beyond it by the sag, load/stiffness. A soft one swings and creeps for a
    second, and the resolution of its velocity hides when that ends: the reference follows, as
    soon as a swing is small, until there is another one.
    """
    if not j.comes_to_rest or j.kind != AS_POSITION or j.active or j.braked:
        return
    off = fabs(j.position - j.followed)
    swings: cython.bint = (
        off > SWING * j.limit_edge
        and fabs(j.velocity) <= SWING_SPEED * j.max_velocity
        and fabs(j.inertia * j.acceleration) <= SWING_TORQUE * j.max_torque
    )
    if j.holds_place() and (swings or (off > 0.0 and j.rest_cycles * j.period >= REST_TIME)):
        j.sag, j.trail = j.set_position - j.position, 0.0
        j.moved = j.reference = j.followed = j.position
        j.ramped, j.active = 0.0, True


@cython.cfunc
def advance_move(j: Joint) -> cython.void:
    """One cycle of a move (P1)."""
    time = j.move_time
    j.move_cycles += j.elapsed / j.period
    elapsed = j.move_cycles * j.period
    if elapsed >= (time if time > j.brake_time else j.brake_time) - 1e-9 * j.period:
        j.moving = False
        j.moved, j.moved_velocity, j.moved_acceleration = j.move_target, 0.0, 0.0
        return
    run_move(j, elapsed)


@cython.cfunc
def advance_stop(j: Joint) -> cython.void:
    """Brake as planned (``stopping``), to hold where the joint comes to rest (M9, P3)."""
    step = j.plan_steps
    elapsed = min(j.elapsed, GAP * j.period) if j.gap else j.elapsed
    span = min(j.span, GAP * j.period) if j.gap else j.span
    rate = fading(j, j.moved_velocity)
    change = min(j.stop_rate, rate) * span
    over = j.velocity - j.ramp_velocity
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
        j.moved += j.moved_velocity * elapsed + yielded(j)
    place = clamp(j.moved, j.lower - j.ramped, j.upper - j.ramped)
    if place != j.moved:  # too fast to stop before a limit
        j.moved, j.moved_velocity, j.plan_steps = place, 0.0, 0
        j.stopping = j.smooth = False
        return
    if j.smooth:
        j.stopping = j.smooth = j.move_cycles * j.period < j.brake_time
    else:
        j.stopping = j.moved_velocity != 0.0 or j.plan_steps > 0
    late = max(j.wire, j.outage)  # set-points, by as much (B7)
    known_to = REST_SPEED * j.max_velocity + j.max_acceleration * late
    if not j.stopping and fabs(over) > known_to and j.kind != AS_POSITION:
        ahead = j.position - j.moved - j.ramped
        # it runs past the end, for want of torque; one that creeps at one speed does not want it
        slower: cython.bint = fabs(over) <= RENEWAL_SHARE * j.renewal_speed
        if slower and ahead * over > 0.0 and ahead * j.velocity > 0.0:
            j.renewal_speed = fabs(over)
            go_on_stopping(j, j.position)


@cython.cfunc
@cython.inline
def fading(j: Joint, velocity: cython.double) -> cython.double:
    """The deceleration at which a stop fades out on a wire, rad/s²: √(2 a v/t), a → 0 in t (B7).

    A set-point that comes Δ late at its end then leaves a speed of a Δ²/2t backwards, not a Δ.
    """
    time = min(FADE_TIME_AGES * max(j.wire, j.outage), MAX_FADE_TIME)
    if time <= 0.0:
        return INFINITE
    if j.kind >= AS_VELOCITY:
        time *= DRIVE_FADE_SHARE
    return sqrt(2.0 * j.max_acceleration * fabs(velocity) / time)


@cython.cfunc
@cython.inline
def yielded(j: Joint) -> cython.double:
    """The way by which a reference that brakes yields to a joint ahead of it, rad (B7).

    Set-points that come late brake late: what the joint runs on by is not driven back (M9). A
    drive that closes a loop of its own has a reference that does not jump.
    """
    ahead = clamp(j.position, j.lower, j.upper) - j.followed
    if j.wire == 0.0 or j.blind or j.kind >= AS_VELOCITY or ahead * j.followed_velocity <= 0.0:
        return 0.0
    ahead *= min(j.elapsed / YIELD_TIME, 1.0)
    j.followed += ahead
    return ahead


@cython.cfunc
def stop_smoothly(j: Joint, elapsed: cython.double) -> cython.void:
    """One cycle of a stop within the jerk limit; at its end the joint is at rest."""
    j.move_cycles += elapsed / j.period
    if j.move_cycles * j.period < j.brake_time:
        run_move(j, j.move_cycles * j.period)
    else:
        j.moved, j.moved_velocity, j.moved_acceleration = j.move_target, 0.0, 0.0


@cython.cfunc
def advance_ramp(j: Joint) -> cython.void:
    """The velocity reference: ramped (P5), within the speed limit, braking ahead of limits (P14).

    The speed limit applies to the sum with a move's velocity.
    """
    step = j.ramp_step * (j.elapsed / j.period)
    if j.ramp_target == 0.0 and not j.driven:
        step = min(step, fading(j, j.ramp_velocity) * j.elapsed)
    v = clamp(j.ramp_target, j.ramp_velocity - step, j.ramp_velocity + step)
    top = j.steady * j.max_velocity
    up = speed_ahead(j.upper - j.reference, j.max_acceleration, j.elapsed, top)
    down = speed_ahead(j.reference - j.lower, j.max_acceleration, j.elapsed, top)
    total = clamp(j.moved_velocity + v, -down, up)
    j.ramp_velocity = total - j.moved_velocity if total != j.moved_velocity + v else v
    j.ramped += j.ramp_velocity * j.elapsed
    if j.ramp_target == 0.0:
        j.ramped += yielded(j)


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
    return j.steady * j.max_velocity


@cython.cfunc
def follow(j: Joint) -> cython.void:
    """The followed reference: the reference within speed, acceleration and position limits (P14).

    It equals the reference where the limits allow; else it is the fastest approach that ends with
    the reference's velocity: v = v_ref + brake_speed(distance). Of a stream it tracks the motion
    fitted to the samples (``follow_stream``). Joints that lack the torque to step together have a
    plan (``stepping``).
    """
    goal = j.reference
    top = top_speed(j)
    goal_velocity = j.reference_velocity
    step = j.max_acceleration * j.span
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
    up = speed_ahead(j.upper - j.followed, j.max_acceleration, j.elapsed, top)
    down = speed_ahead(j.followed - j.lower, j.max_acceleration, j.elapsed, top)
    velocity = clamp(velocity, -down, up)
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
        and (j.direct_age == INFINITE or j.direct_age * j.period > STREAM_END_AGE)
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
    age = (j.direct_age - 1.0) * j.period
    interval = s.interval if s.interval > MIN_STREAM_INTERVAL else MIN_STREAM_INTERVAL
    quick = FREQUENCY_INTERVAL / interval
    if s.on_grid:
        age += s.late
    quick = min(quick, MAX_FREQUENCY)
    quick = min(quick, 0.2 / j.period)
    turned = versine(base.turning, age)
    cosine = 1.0 - base.turning * turned
    run = sine(base.turning, age)
    goal = base.x + base.v * run + base.a * turned
    speed = base.v * cosine + base.a * run
    speed = clamp(speed, -j.max_velocity, j.max_velocity)
    rate = base.a * cosine - base.turning * base.v * run
    rate = clamp(rate, -j.max_acceleration, j.max_acceleration)
    if (goal >= j.upper and speed > 0.0) or (goal <= j.lower and speed < 0.0):
        goal, speed, rate = clamp(goal, j.lower, j.upper), 0.0, 0.0
    j.reference_velocity = j.direct_velocity = speed
    share = 3.0 * quick * j.elapsed
    j.stream_acceleration += (rate - j.stream_acceleration) * (share if share < 1.0 else 1.0)
    rate = j.stream_acceleration
    j.stream_peak *= 1.0 - j.elapsed
    j.stream_peak = max(j.stream_peak, fabs(rate))
    speed -= 0.5 * rate * j.elapsed  # the mean over this cycle
    error = goal - j.followed - speed * j.elapsed
    off = j.followed_velocity - speed + rate * j.span
    brake = 0.8 * (j.max_acceleration - j.stream_peak)
    brake = max(brake, 0.03 * j.max_acceleration)
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
    change = (rate + ahead + 4.0 * slope * (wanted - off)) * j.span
    wanted = speed + error / j.elapsed
    if fabs(wanted - j.followed_velocity - change) <= 0.01 * j.max_acceleration * j.span:
        return wanted
    return j.followed_velocity + change
