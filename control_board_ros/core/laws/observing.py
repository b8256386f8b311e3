# SPDX-License-Identifier: Apache-2.0
"""What a joint does now, from a reading and its age (SPEC B6, B7): motion, load, rest.

The first phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import exp, fabs, sqrt

from ... import nocython as cython
from .formulas import is_number
from .joint import (
    AS_IMPEDANCE,
    AS_POSITION,
    AS_VELOCITY,
    FEED_CYCLES,
    GAP,
    HOLD_FILTER,
    POSITION,
    REST_TIME,
    STARVED_PERIODS,
    WIRE_PHASE,
    Joint,
    friction,
    place_of,
    restart_at,
)
from .pid import Pid

#: Time constant of the load's filter, s.
LOAD_FILTER = cython.declare(cython.double, 0.01)
#: Time to measure the load, s: minimum where a reference waits for it, maximum.
MIN_SETTLING_TIME = cython.declare(cython.double, 0.05)
MAX_SETTLING_TIME = cython.declare(cython.double, 0.5)
#: Maximum time that a joint at rest waits for others that still brake, s.
MAX_WAIT_TIME = cython.declare(cython.double, 3.0)
#: Memory of the age of readings, s.
WIRE_MEMORY = cython.declare(cython.double, 0.5)
#: Speed that is added behind a drive's loop of position, over ``pursuit`` × the speed: by uneven
#: ages, of their deviation; the most of all, in speed limits (B7).
UNEVEN_SPEED = cython.declare(cython.double, 2.5)
MAX_UNEVEN_SPEED = cython.declare(cython.double, 1.04)
#: Bandwidth of a position loop over that of the velocity loop in it, where late readings slow it.
SEPARATION = cython.declare(cython.double, 0.25)
#: Part of the torque limit that the error of a reference may be worth after a gap.
GAP_SHARE = cython.declare(cython.double, 0.05)


@cython.cfunc
@cython.inline
def pass_time(j: Joint, elapsed: cython.double) -> cython.void:
    """Time since the last cycle, s; 0: one control period (B6).

    Where gaps repeat, on a computer without the time for each cycle, they are the loop's period.
    """
    before = j.elapsed if j.elapsed > 0.0 else j.period
    j.elapsed = elapsed if elapsed > 0.0 else j.period
    j.gap = j.elapsed > GAP * max(j.usual, j.period)
    hold_time = min(j.elapsed, GAP * max(j.hold_time, j.period))
    if j.usual > j.elapsed:  # a division less in simulations, where they are equal
        fade = 1.0 - min(j.elapsed / WIRE_MEMORY, 1.0)
        j.usual *= fade
        j.hold_time *= fade
    j.usual, j.hold_time = max(j.elapsed, j.usual), max(hold_time, j.hold_time)
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
    ahead = 0.0
    between = j.elapsed + j.age - age
    if not is_number(position + velocity):  # there is no reading yet
        j.position, j.velocity, j.readings, j.rest_cycles = position, velocity, 0, 0
        j.behind = 0.0
        return
    late: cython.bint = age > 0.0 or j.wire > 0.0 or j.missed > 0.0 or j.outage > 0.0
    if late or j.hold_time > STARVED_PERIODS * j.period or j.calm * j.steady < 1.0:
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
    """Keep what the last set-point fed forward, and which current it was for, on a wire.

    A gap between two cycles has its places, too: over it a torque goes on, another set-point
    stands (B6).
    """
    fed = j.fed[j.fed_now]
    gain = 0.0
    cycles: cython.int = 1
    if j.active and (j.law == POSITION or j.settling):
        gain = j.followed_acceleration * j.elapsed
    if j.elapsed > GAP * j.period:
        gain *= j.period / j.elapsed
        cycles = cython.cast(cython.int, min(j.elapsed / j.period + 0.5, FEED_CYCLES - 1.0))
    while cycles > 0:
        cycles -= 1
        fed += gain
        if j.kind >= AS_VELOCITY:
            gain = 0.0
        j.fed_now = (j.fed_now + 1) & (FEED_CYCLES - 1)
        j.fed[j.fed_now] = fed
        j.drawn[j.fed_now] = j.current_pid.reference


@cython.cfunc
def fed_since(j: Joint, age: cython.double) -> cython.double:
    """What the feed-forward has accelerated over an age, rad/s."""
    return j.fed[j.fed_now] - j.fed[place_of(j, age)]


@cython.cfunc
def heed(j: Joint, age: cython.double, between: cython.double) -> cython.void:
    """What the age of a reading means for the laws (B7).

    Without a fresh reading for GAP periods more than usual a joint is blind; where the board
    closes its loop, it coasts. Late readings take phase from the loop, age·kd/J, or age·pursuit,
    and so does a set-point that is held for more than GAP periods, by half of that time;
    within WIRE_PHASE its gains are as configured, beyond it those of a loop slower by ``calm``,
    with a position loop in it as fast as SEPARATION allows, if not as configured. Of uneven ages,
    and set-points that stand, a drive that closes the loop of position makes speed, which the
    reference leaves room for.
    """
    p: Pid = j.position_pid
    speed = p.kd / j.inertia_min  # of the loop, 1/s
    if between < 0.5 * j.elapsed:  # it is the same reading
        j.missed += j.elapsed
    else:
        note_age(j, age)
        fade = 1.0 - j.elapsed / WIRE_MEMORY
        j.wire, j.outage = max(age, j.wire * fade), max(j.missed, j.outage * fade)
        j.missed = 0.0
        if j.wire < 0.1 * j.period:
            j.wire = 0.0
        if j.outage < 0.1 * j.period:
            j.outage = 0.0
    if j.kind >= AS_VELOCITY:
        speed = j.pursuit
    late = j.wire + (0.5 * j.usual if j.usual > GAP * j.period else 0.0)
    j.calm = j.spring = 1.0
    if speed * late > WIRE_PHASE:
        j.calm = WIRE_PHASE / (speed * late)
        j.spring = j.calm * j.calm
        if j.kind < AS_VELOCITY and p.kp > 0.0:
            j.spring = min(j.spring * max(SEPARATION * speed * p.kd / p.kp, 1.0), j.calm)
    j.steady = 1.0
    if j.kind >= AS_POSITION:
        speed *= j.calm if j.kind == AS_IMPEDANCE else 1.0
        x = speed * max(j.hold_time - j.period, 0.0)  # of set-points that stand: v x/(1 − e⁻ˣ)
        peak = x / (1.0 - exp(-x)) if x > 1e-6 else 1.0
        peak += speed * UNEVEN_SPEED * sqrt(j.age_variance)
        j.steady = min(MAX_UNEVEN_SPEED / peak, 1.0)
    j.blind = j.missed > GAP * j.period + j.wire
    if j.blind and j.kind < AS_VELOCITY:
        j.coasts = True
    elif j.coasts and not j.blind:
        j.coasts = False
        take_up(j)


@cython.cfunc
def note_age(j: Joint, age: cython.double) -> cython.void:
    """Mean and variance of the ages of fresh readings, from the first late one on."""
    off = age - j.mean_age
    if j.wire == 0.0:
        j.mean_age, j.age_variance = age, 0.0
        return
    j.mean_age += off * j.elapsed / WIRE_MEMORY
    j.age_variance += (off * off - j.age_variance) * min(j.elapsed / WIRE_MEMORY, 1.0)


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
def weigh(j: Joint) -> cython.void:
    """The load: τ − torque of the acceleration, low-passed from its first number on (M9).

    The acceleration is that between two readings. On a wire these are some periods apart, so τ is
    the mean of both, and no reading is weighed twice (B7).
    """
    raw = j.torque - j.motion
    before = j.weighed_torque
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
    torque = motion - j.torque
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
    share = min(j.felt_share * j.unobserved / j.period, 1.0) if j.feels else 1.0
    j.felt += share * (j.external - j.felt)
    j.borne += share * (fabs(motion) - j.borne)
    j.feels = True


@cython.cfunc
def settle(j: Joint, braking: cython.bint, rested: cython.bint) -> cython.void:
    """Capture the load once it is known, or after MAX_SETTLING_TIME.

    Args:
        j: The joint, which settles.
        braking: Whether one of the settling joints still brakes.
        rested: Whether all of them have been at rest for REST_TIME.
    """
    if j.active and not j.awaited:
        return  # it still brakes
    if braking and not j.awaited:
        j.wait_cycles += 1
        if j.wait_cycles * j.period < MAX_WAIT_TIME:
            return
    j.settle_cycles += 1
    elapsed = j.settle_cycles * j.period
    if j.awaited:
        rested = j.rest_cycles * j.period >= REST_TIME
    if (
        (rested and elapsed >= REST_TIME)
        or elapsed >= MAX_SETTLING_TIME
        or (j.awaited and elapsed >= MIN_SETTLING_TIME)
    ):
        j.take(j.load)
