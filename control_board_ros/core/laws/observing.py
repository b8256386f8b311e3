# SPDX-License-Identifier: Apache-2.0
"""What a joint does now, from a reading and its age (SPEC B6, B7): motion, load, rest.

The first phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import exp, fabs, sqrt

from ... import nocython as cython
from .formulas import is_number
from .joint import HOLD_FILTER, POSITION, REST_TIME, STARVED_PERIODS, WIRE_PHASE, Joint, restart_at
from .joint_drive import AS_IMPEDANCE, AS_POSITION, AS_VELOCITY
from .joint_timing import GAP, HISTORY_CYCLES
from .pid import Pid

#: Time constant of the load's filter, s.
LOAD_FILTER = cython.declare(cython.double, 0.01)
#: Time to measure the load, s: minimum where a reference waits for it, maximum.
MIN_SETTLING_TIME = cython.declare(cython.double, 0.05)
MAX_SETTLING_TIME = cython.declare(cython.double, 0.5)
#: Maximum time that a joint at rest waits for others that still brake, s.
MAX_WAIT_TIME = cython.declare(cython.double, 3.0)
#: Speed that is added behind a drive's loop of position, over ``pursuit`` × the speed: by uneven
#: ages, of their deviation; the most of all, in speed limits (B7).
UNEVEN_SPEED = cython.declare(cython.double, 2.5)
MAX_UNEVEN_SPEED = cython.declare(cython.double, 1.04)
#: Bandwidth of a position loop over that of the velocity loop in it, where late readings slow it.
SEPARATION = cython.declare(cython.double, 0.25)
#: Part of the torque limit that the error of a reference may be worth after a gap.
GAP_SHARE = cython.declare(cython.double, 0.05)


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
    between = j.clock.elapsed + j.wire.age - age
    if not is_number(position + velocity):  # there is no reading yet
        j.position, j.velocity, j.readings, j.rest_cycles = position, velocity, 0, 0
        j.behind = 0.0
        return
    late: cython.bint = (
        age > 0.0 or j.wire.max_age > 0.0 or j.wire.silence > 0.0 or j.wire.outage > 0.0
    )
    slow: cython.bint = j.wire.bandwidth_share * j.wire.speed_share < 1.0
    if late or slow or j.clock.hold_time > STARVED_PERIODS * j.clock.period:
        note_feed(j)
        heed(j, age, between)
        ahead = j.history.speed_since(age, j.clock.period)
    if j.readings == 0:
        j.acceleration = 0.0
    elif j.wire.silence == 0.0 and between > 0.0:
        j.acceleration = (velocity - j.sampled) / between
    j.wire.age, j.sampled = age, velocity
    j.behind = age * (velocity + 0.5 * ahead) if age > 0.0 else 0.0
    j.position, j.velocity = position + j.behind, velocity + ahead
    if not j.motor.has_torque_sensor:
        j.torque = j.current * j.motor.torque_per_ampere
    j.motion = j.motor.inertia * j.acceleration
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
    gain = 0.0
    cycles: cython.int = 1
    if j.reference.active and (j.law == POSITION or j.settling):
        gain = j.track.acceleration * j.clock.elapsed
    if j.clock.elapsed > GAP * j.clock.period:
        gain *= j.clock.period / j.clock.elapsed
        past = min(j.clock.elapsed / j.clock.period + 0.5, HISTORY_CYCLES - 1.0)
        cycles = cython.cast(cython.int, past)
    while cycles > 0:
        cycles -= 1
        j.history.note(gain, j.current_pid.reference)
        if j.drive.kind >= AS_VELOCITY:
            gain = 0.0


@cython.cfunc
def heed(j: Joint, age: cython.double, between: cython.double) -> cython.void:
    """What the age of a reading means for the laws (B7).

    Without a fresh reading for GAP periods more than usual a joint is blind; where the board
    closes its loop, it coasts. Late readings take phase from the loop, age·kd/J, or age·pursuit,
    and so does a set-point that is held for more than GAP periods, by half of that time;
    within WIRE_PHASE its gains are as configured, beyond it those of a loop slower by
    ``bandwidth_share``, with a position loop in it as fast as SEPARATION allows, if not as
    configured. Of uneven ages, and set-points that stand, a drive that closes the loop of position
    makes speed, which the reference leaves room for.
    """
    p: Pid = j.position_pid
    kind = j.drive.kind
    speed = j.drive.pursuit if kind >= AS_VELOCITY else p.kd / j.motor.inertia_min  # of the loop
    j.wire.note(age, between, j.clock)
    late = j.wire.max_age
    late += 0.5 * j.clock.max_elapsed if j.clock.max_elapsed > GAP * j.clock.period else 0.0
    j.wire.bandwidth_share = j.wire.stiffness_share = 1.0
    if speed * late > WIRE_PHASE:
        share = WIRE_PHASE / (speed * late)
        j.wire.bandwidth_share, j.wire.stiffness_share = share, share * share
        if kind < AS_VELOCITY and p.kp > 0.0:
            slower = j.wire.stiffness_share * max(SEPARATION * speed * p.kd / p.kp, 1.0)
            j.wire.stiffness_share = min(slower, share)
    j.wire.speed_share = 1.0
    if kind >= AS_POSITION:
        speed *= j.wire.bandwidth_share if kind == AS_IMPEDANCE else 1.0
        # of set-points that stand: v x/(1 − e⁻ˣ)
        x = speed * max(j.clock.hold_time - j.clock.period, 0.0)
        peak = x / (1.0 - exp(-x)) if x > 1e-6 else 1.0
        peak += speed * UNEVEN_SPEED * sqrt(j.wire.age_variance)
        j.wire.speed_share = min(MAX_UNEVEN_SPEED / peak, 1.0)
    j.wire.blind = j.wire.silence > GAP * j.clock.period + j.wire.max_age
    if j.wire.blind and kind < AS_VELOCITY:
        j.wire.coasts = True
    elif j.wire.coasts and not j.wire.blind:
        j.wire.coasts = False
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
    if p.kp * fabs(j.track.position - j.position) <= GAP_SHARE * j.limits.torque:
        return
    restart_at(j, j.position)
    p.integral += j.feedback
    p.room = max(fabs(p.integral) - p.limit, 0.0)
    p.fall = p.room * j.clock.period / HOLD_FILTER
    p.derivative = j.feedback = 0.0


@cython.cfunc
def weigh(j: Joint) -> cython.void:
    """The load: τ − torque of the acceleration, low-passed from its first number on (M9).

    The acceleration is that between two readings. On a wire these are some periods apart, so τ is
    the mean of both, and no reading is weighed twice (B7).
    """
    raw = j.torque - j.motion
    before = j.weighed_torque
    if j.wire.max_age > 0.0:
        if j.wire.silence > 0.0:
            return
        j.weighed_torque = j.torque
        raw += 0.5 * (before - j.torque)
    else:
        j.weighed_torque = j.torque
    if j.readings < 2 or j.clock.period >= LOAD_FILTER or not is_number(j.load):
        j.load = raw
    else:
        j.load += j.clock.period / LOAD_FILTER * (raw - j.load)


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
    j.external.interval += j.clock.elapsed
    if j.wire.silence > 0.0:  # no reading since
        return j.external.torque
    if not j.motor.has_torque_sensor:
        torque += j.motor.friction(j.sampled)
    interval = j.external.interval
    j.external.observe(torque, j.clock.period)
    if j.admittance.dead_band > 0.0:
        j.admittance.feel(j.external.torque, motion, interval, j.clock.period)
    return j.external.torque


@cython.cfunc
def settle(j: Joint, braking: cython.bint, rested: cython.bint) -> cython.void:
    """Capture the load once it is known, or after MAX_SETTLING_TIME.

    Args:
        j: The joint, which settles.
        braking: Whether one of the settling joints still brakes.
        rested: Whether all of them have been at rest for REST_TIME.
    """
    if j.reference.active and not j.awaited:
        return  # it still brakes
    if braking and not j.awaited:
        j.wait_cycles += 1
        if j.wait_cycles * j.clock.period < MAX_WAIT_TIME:
            return
    j.settle_cycles += 1
    elapsed = j.settle_cycles * j.clock.period
    if j.awaited:
        rested = j.rest_cycles * j.clock.period >= REST_TIME
    if (
        (rested and elapsed >= REST_TIME)
        or elapsed >= MAX_SETTLING_TIME
        or (j.awaited and elapsed >= MIN_SETTLING_TIME)
    ):
        j.take(j.load)
