# SPDX-License-Identifier: Apache-2.0
"""What drives a joint there: the law of its mode (source Fig. 2), its bounds, the set-point.

The third to fifth phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import fabs

from ... import nocython as cython
from .formulas import INFINITE, brake_speed, clamp, is_number
from .joint import (
    CURRENT,
    HOLD_FILTER,
    IMPEDANCE,
    OFF,
    OUTPUT,
    POSITION,
    REST_SPEED,
    STARVED_PERIODS,
    WIRE_PHASE,
    Joint,
    go_on_stopping,
)
from .joint_drive import (
    AS_CURRENT,
    AS_IMPEDANCE,
    AS_POSITION,
    AS_PWM,
    AS_TORQUE,
    AS_VELOCITY,
)
from .pid import Pid, pid_step, unwind

#: Largest holding torque in TORQUE before the first reference, as a part of the torque limit.
HOLD_SHARE = cython.declare(cython.double, 0.1)
#: Likewise of a joint without stiffness under gravity compensation: covers errors of sensors and
#: masses.
REST_SHARE = cython.declare(cython.double, 0.01)
#: Periods within which the protection reduces the speed to what is allowed.
SPAN = cython.declare(cython.double, 3.0)
#: Time constant of the return from beyond a limit, s.
RETURN = cython.declare(cython.double, 0.1)
#: Part of the acceleration limit with which the protection brakes ahead of a limit.
BRAKING = cython.declare(cython.double, 0.7)
#: Greatest lead over a drive that closes the loop of position, where it bears less than its limit,
#: in leads.
DRIVE_LEADS = cython.declare(cython.double, 4.0)
#: Time constant in which the lag at a stop fades from set-points, once references follow, s.
TRAIL_FADING = cython.declare(cython.double, 0.2)
#: Largest lead of the followed reference over the joint, in errors worth the torque limit.
LEAD = cython.declare(cython.double, 1.0)
#: Way of a goal that gives way over which the load taken over fades, in hystereses of the limit
#: warning (1°, 1 mm).
FADING = cython.declare(cython.double, 3.0)
#: Speed bound of the position law, in speed limits: headroom for references at the limit.
PURSUIT = cython.declare(cython.double, 1.02)


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
    late = j.track.position - j.drive.delay * j.track.velocity  # what the drive has by now
    if j.wire.coasts:
        torque = p.kff * j.track.position + p.integral + j.feedback
    elif j.wire.blind:  # the drive has the same spring, with the present error
        torque = p.feed() + p.integral
    else:
        torque = pid_step(p, j.track.position, late - j.position, j.track.velocity - j.velocity)
        if j.wire.bandwidth_share < 1.0:
            torque = soften(j)
        keep_feedback(j)
    return torque + j.forward + j.motor.friction(j.track.velocity)


@cython.cfunc
def keep_feedback(j: Joint) -> cython.void:
    """Filter the feedback: what a joint that coasts keeps of it is its load (B7)."""
    p: Pid = j.position_pid
    feedback = (
        p.kp * p.error * j.wire.stiffness_share + p.kd * p.derivative * j.wire.bandwidth_share
    )
    j.feedback += j.clock.period / (j.clock.period + HOLD_FILTER) * (feedback - j.feedback)


@cython.cfunc
def soften(j: Joint) -> cython.double:
    """The torque of the position PID for a loop slower by ``bandwidth_share``."""
    p: Pid = j.position_pid
    p.integral -= (1.0 - j.wire.stiffness_share * j.wire.bandwidth_share) * (
        p.integral - p.previous
    )
    torque = p.kff * p.reference + p.kp * p.error * j.wire.stiffness_share
    return torque + p.integral + p.kd * p.derivative * j.wire.bandwidth_share


@cython.cfunc
def keep_near(j: Joint) -> cython.void:
    """Bound the lead of the followed reference by the torque and speed limits (P14)."""
    p: Pid = j.position_pid
    if p.kp > 0.0 and not j.wire.blind:
        late = j.drive.delay + 2.0 * j.wire.max_age + max(j.clock.hold_time - j.clock.period, 0.0)
        lead = late * fabs(j.track.velocity)  # either way
        lead += LEAD * j.limits.torque / (p.kp * j.wire.bandwidth_share)
        if fabs(j.track.position - j.position) > lead:
            if j.drive.kind == AS_POSITION:
                keep_near_drive(j, lead)
            else:
                stay(j, clamp(j.track.position, j.position - lead, j.position + lead))
        hold_back(j)


@cython.cfunc
def keep_near_drive(j: Joint, lead: cython.double) -> cython.void:
    """Bound the lead over a drive that closes the loop of position, with a stiffness of its own.

    What it sags by under a load is no lead: a reference that followed such a joint would sink with
    it. At the torque limit, by its current, the reference yields, so that it is that limit. Below,
    it goes on, up to DRIVE_LEADS leads. Beyond, and where no current is known, it waits.
    """
    error = j.track.position - j.position
    torque = j.torque if error > 0.0 else -j.torque
    if torque > j.limits.torque:
        stay(j, j.position + error * j.limits.torque / torque)
    elif not (fabs(torque) > 0.0 and fabs(error) <= DRIVE_LEADS * lead):
        wait_for_drive(j, clamp(j.track.position, j.position - lead, j.position + lead))


@cython.cfunc
def wait_for_drive(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place that it has not passed, else where it was."""
    before = j.set_point.position - j.set_point.sag - j.set_point.trail
    low = min(j.track.position, place)
    high = max(j.track.position, place)
    place = clamp(before, low, high)
    if place != j.track.position:
        stay(j, place)


@cython.cfunc
def stay(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place, without the feed-forward of its acceleration.

    Of a joint that brakes with less torque than that takes, it goes on with the joint's speed.
    """
    j.forward -= j.motor.inertia * j.track.acceleration
    j.track.position = place
    j.track.velocity = j.track.acceleration = 0.0
    if j.stop.active:
        go_on_stopping(j, place)
    j.reference.active = True


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
    push = p.kp * (j.track.position - j.position) + p.integral
    if j.drive.kind == AS_POSITION and is_number(j.torque) and j.torque != 0.0:
        push = j.torque
    max_excess = (
        j.motor.light_inertia
        * j.limits.velocity
        / (j.clock.period * (1.0 + 0.5 * j.motor.lead) + j.drive.delay)
    )
    if max_excess >= j.limits.torque:
        return
    max_excess = max(max_excess, HOLD_SHARE * j.limits.torque)
    if fabs(j.velocity) > REST_SPEED * j.limits.velocity:
        j.blocked = False
    elif j.track.velocity != 0.0:
        j.blocked = True
    elif j.drive.kind == AS_POSITION and j.track.position == j.reference.position:
        j.blocked = False  # it holds what it bears
    if not j.blocked:
        j.carried = push if j.drive.kind == AS_POSITION else p.integral
        return
    excess = push - j.carried
    if fabs(excess) > max_excess:
        back = j.track.position - (excess - clamp(excess, -max_excess, max_excess)) / p.kp
        # not beyond where the joint is
        back = clamp(back, min(j.track.position, j.position), max(j.track.position, j.position))
        if j.drive.kind == AS_POSITION:
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
    torque = (
        j.torque_offset
        + j.load_taken
        + j.lift
        + j.stiffness * (j.track.position - j.position)
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
    time = j.clock.period if j.clock.gap else j.clock.elapsed
    least = j.admittance.dead_band + j.admittance.load_share * j.admittance.load
    speed = 0.0
    up = brake_speed(j.reference.upper - j.admittance.position, j.limits.acceleration, time)
    down = brake_speed(j.admittance.position - j.reference.lower, j.limits.acceleration, time)
    if j.admittance.entry_left > 0.0:  # it follows what the braking has left in the low pass
        j.admittance.entry_left -= time
        j.admittance.entry_torque = j.admittance.torque
    push = j.admittance.torque - j.admittance.entry_torque
    push -= clamp(push, -least, least)
    if j.admittance.known and not j.wire.blind:
        speed = push + j.torque_offset - j.admittance.entry_offset
        speed += j.stiffness * (j.track.position - j.admittance.position)
        speed /= max(j.damping, j.admittance.min_damping) + j.stiffness * time
    speed = clamp(speed, -min(down, j.limits.velocity), min(up, j.limits.velocity))
    if push != 0.0:
        j.admittance.entry_torque *= max(1.0 - fabs(speed) * time / (FADING * j.limits.edge), 0.0)
    j.admittance.position = clamp(
        j.admittance.position + speed * time, j.reference.lower, j.reference.upper
    )
    j.admittance.velocity = speed
    if j.calibrated:
        j.reference.come_in(j.admittance.position, j.limits)
        note_limit(j)


@cython.cfunc
def hold_torque(j: Joint, share: cython.double) -> cython.double:
    """A hold that yields: clip(kp (q_hold − q) − kd q̇, ± share·τ_max).

    Pushed harder, the joint moves, and holds where it is released.
    """
    p: Pid = j.position_pid
    firm = share * j.limits.torque
    if p.kp > 0.0:
        j.hold_place = clamp(j.hold_place, j.position - firm / p.kp, j.position + firm / p.kp)
    spring = p.kp * j.wire.stiffness_share
    damper = p.kd * j.wire.bandwidth_share
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
    reference = clamp(reference, -j.limits.torque, j.limits.torque)
    j.torque_reference = reference
    if j.drive.kind >= AS_TORQUE:
        return reference
    error = reference - j.torque
    return pid_step(p, reference, error, (error - p.error) / j.clock.period)


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
    loop: Pid = j.torque_pid
    if j.law == OFF:
        j.output = 0.0
        return
    feed = j.output_offset * j.drive.per_feed if j.feeds else 0.0
    if j.drive.kind in (AS_POSITION, AS_VELOCITY):
        lead_drive(j, feed)
        return
    if j.wire.coasts and j.law != POSITION and not j.settling:
        coast(j)
        return
    if (
        j.drive.kind == AS_IMPEDANCE
        and (j.wire.max_age > 0.0 or j.clock.hold_time > STARVED_PERIODS * j.clock.period)
        and (j.law == POSITION or j.settling)
    ):
        hand_down_spring(j, feed)
        return
    if j.law == OUTPUT:
        output_law(j, j.output_command + feed)
        return
    if j.law == CURRENT and not (j.settling or j.holding):
        drive = clamp(j.current_command + feed, -j.drive.max, j.drive.max)
        hand_down(j, protect(j, drive))
        return
    if j.law == POSITION or j.settling:
        loop = j.position_pid
    torque = law_torque(j)
    drive = clamp(torque, -j.limits.torque, j.limits.torque)
    if drive != torque:
        unwind(loop, torque - drive)
    if drive == torque or j.law != POSITION:
        j.strain_cycles = 0
    elif j.strain_cycles < 1000000:
        j.strain_cycles += 1
    drive = ahead_of_winding(j, drive * j.drive.per_torque)
    drive += j.drive.compensation * j.drive.per_speed * j.velocity + feed
    bounded = protect(j, clamp(drive, -j.drive.max, j.drive.max))
    if bounded != drive:
        unwind(loop, drive - bounded)
    hand_down(j, bounded)


@cython.cfunc
def lead_drive(j: Joint, feed: cython.double) -> cython.void:
    """The set-point of a drive that closes the loop: of the reference, or of a goal (I5, S2)."""
    if j.law == IMPEDANCE and not j.settling:
        give_way(j)
        hand_down_path(j, feed, j.admittance.position, j.admittance.velocity)
    else:
        keep_near(j)
        hand_down_path(j, feed, j.track.position, j.track.velocity)


@cython.cfunc
def coast(j: Joint) -> cython.void:
    """Drive what the joint bears without its acceleration: it goes on as it moves (B7)."""
    drive: cython.double = clamp(j.load, -j.limits.torque, j.limits.torque) * j.drive.per_torque
    drive = clamp(drive + j.drive.per_speed * j.velocity, -j.drive.max, j.drive.max)
    j.set_point.request = drive
    if j.law == OUTPUT:
        j.output = clamp(drive, -j.limits.output, j.limits.output)
    else:
        hand_down(j, drive)


@cython.cfunc
def output_law(j: Joint, output: cython.double) -> cython.void:
    """The given PWM u, percent; of a calibrator's drive that takes currents (K8) what it makes.

    i = (V_s u/100 − Ke q̇)/R
    """
    if j.drive.kind == AS_CURRENT:
        output = (output / j.motor.percent_per_volt - j.motor.emf * j.velocity) / j.motor.ohms
        j.set_point.current = protect(j, clamp(output, -j.drive.max, j.drive.max))
        return
    j.output = clamp(protect(j, output), -j.limits.output, j.limits.output)
    j.current_pid.integral = 0.0


@cython.cfunc
def ahead_of_winding(j: Joint, wanted: cython.double) -> cython.double:
    """The drive whose current is the wanted one at the end of the cycle.

    L di/dt = v − R i, solved for v over one period:  v = R (i' − a i)/(1 − a), a = exp(−T R/L),
    where i is the current that the last cycle wanted.
    """
    drive: cython.double = wanted
    if not j.drive.in_amps and j.wire.max_age == 0.0:  # late, it would only add noise
        drive += j.motor.lead * (wanted - j.set_point.request)
    j.set_point.request = wanted
    return drive


@cython.cfunc
def current_law(j: Joint, reference: cython.double) -> cython.double:
    """The inner loop of a board with current output (P10).

    v = R·(i_ref + lead·Δi_ref) + Ke·q̇ + PI(i_ref, i); the lead as in ``ahead_of_winding``. A
    user's reference (Y2) is a step: the PI compares with the one before, reached by now.
    """
    p: Pid = j.current_pid
    before = p.reference
    reached = before if j.law == CURRENT else reference
    feedback = (
        late_feedback(j, reference)
        if j.wire.max_age > 0.0
        else pid_step(p, reference, reached - j.current, 0.0)
    )
    wanted = j.motor.percent_per_volt * (
        feedback
        + j.motor.ohms * (reference + j.motor.lead * (reference - before))
        + j.motor.emf * j.velocity
    )
    bounded = clamp(wanted, -j.limits.output, j.limits.output)
    if bounded != wanted:
        unwind(p, wanted - bounded)
    return bounded


@cython.cfunc
def late_feedback(j: Joint, reference: cython.double) -> cython.double:
    """The PI of the current on a wire: a reading is compared with the reference of its time (B7).

    Its gains are as configured where kp/R + age·ki/R is within WIRE_PHASE, and less beyond, as
    those of the position loop; the same reading is not integrated twice.
    """
    p: Pid = j.current_pid
    error = 0.0
    gain = p.kp + p.ki_period / j.clock.period * j.wire.max_age
    share = 1.0
    if j.wire.silence == 0.0:
        error = j.history.current_at(j.wire.age, j.clock.period) - j.current
    if gain > WIRE_PHASE * j.motor.ohms:
        share = WIRE_PHASE * j.motor.ohms / gain
    pid_step(p, reference, error, 0.0)
    p.integral -= (1.0 - share) * (p.integral - p.previous)
    return p.kp * share * error + p.integral


# --- 4. protect -----------------------------------------------------------------------------


@cython.cfunc
def protect(j: Joint, drive: cython.double) -> cython.double:
    """Bound the drive by the speed limit, and by the software limits (P9, P14).

    Where no position law keeps a joint inside its limits, its speed towards one is bounded by its
    braking distance, and from beyond one it is driven back: to where it was found, where that is
    outside (P16).
    """
    top = PURSUIT * j.limits.velocity
    bottom = -top
    free: cython.bint = j.law != POSITION and not j.settling
    if free:
        top, bottom = j.limits.velocity, -j.limits.velocity
        if j.calibrated:
            j.reference.come_in(j.position, j.limits)
            top = speed_towards(j, j.reference.upper - j.position, top)
            bottom = -speed_towards(j, j.position - j.reference.lower, -bottom)
            note_limit(j)
    drive = min(drive, speed_bound(j, top, 1.0))
    drive = max(drive, -speed_bound(j, -bottom, -1.0))
    return clamp(drive, -j.drive.max, j.drive.max)


@cython.cfunc
def speed_bound(j: Joint, top: cython.double, way: cython.double) -> cython.double:
    """The drive at which a joint just reaches a speed; speed and drive in direction ``way``, ±1.

    The motor's torque τ lags by its winding. Its excess for acceleration, n, follows from the last
    cycle, whatever load and friction are. At the end of this cycle n is at most what brings the
    joint to the speed while n decays by T/H per cycle:

    n0 = J q̈ + lag·Δτ,   n1 = (J (v_top − q̇) − lag·n0·T)/H,   τ1 = τ + n1 − n0,   H = 3 (T + delay)

    lag·Δτ is the torque at the end of the cycle beyond its mean. Torque grows as for a light
    joint, and is reduced as for a heavy one, by no more than a light one bears without swinging.
    """
    span = SPAN * (j.clock.period + j.drive.delay + j.wire.max_age)
    speed = way * j.velocity
    torque = way * j.current * j.motor.torque_per_ampere
    grown = torque - way * j.current_before * j.motor.torque_per_ampere
    gain = 1.0 + j.motor.lag * j.clock.period / span
    gained = way * j.acceleration
    if j.wire.max_age > 0.0:  # more than the motor gives is an impact, which does not last
        most = j.limits.torque / j.motor.inertia_min
        gained = clamp(gained, -most, most)
        if j.law != POSITION and not j.settling:
            speed += gained * (j.wire.age - j.wire.silence)
    spare = (top - speed) / span - gain * gained
    inertia = j.motor.light_inertia
    if spare < 0.0:
        inertia = j.motor.heavy_inertia
    bound = torque - gain * j.motor.lag * grown + inertia * spare
    if bound >= j.limits.torque:
        return INFINITE
    bound = max(bound, -j.limits.torque)
    value = j.drive.per_torque * bound + j.drive.per_speed * way * j.velocity
    if j.drive.in_amps or j.wire.max_age > 0.0:
        return value
    return value + j.motor.lead * j.drive.per_torque * (bound - torque)


@cython.cfunc
def speed_towards(j: Joint, room: cython.double, top: cython.double) -> cython.double:
    """The speed allowed towards a limit at distance ``room``; negative beyond it."""
    if room < 0.0:
        return room / RETURN
    speed = brake_speed(room, BRAKING * j.limits.acceleration, j.clock.period)
    return speed if speed < top else top


@cython.cfunc
def note_limit(j: Joint) -> cython.void:
    """Whether the joint is beyond a limit, with a hysteresis (P9)."""
    room = j.limits.upper - j.position
    below = j.position - j.limits.lower
    room = min(room, below)
    edge = 0.01 * (j.limits.upper - j.limits.lower)
    edge = min(edge, j.limits.edge)
    j.on_limit = room < 0.0 or (j.on_limit and room < edge)


# --- 5. hand down ---------------------------------------------------------------------------


@cython.cfunc
def hand_down(j: Joint, drive: cython.double) -> cython.void:
    """The output of the laws as the drive's set-point (S1), or an impedance of equal torque.

    τ_ff = drive − k (q_set − q) − d (q̇_set − q̇) holds what the laws and their bounds add. Of the
    damping it subtracts the filtered rate that the law used: the raw one would return delayed.
    """
    p: Pid = j.position_pid
    kind = j.drive.kind
    spring = 0.0
    if kind == AS_PWM:
        j.output = current_law(j, drive) if j.drive.in_amps else drive
    elif kind == AS_CURRENT:
        j.set_point.current = drive
    elif kind == AS_TORQUE:
        j.set_point.torque = drive
    else:
        j.set_point.position, j.set_point.velocity = j.track.position, 0.0
        j.set_point.stiffness = j.set_point.damping = 0.0
        if j.law == POSITION or j.settling:
            j.set_point.velocity = j.track.velocity
            j.set_point.stiffness, j.set_point.damping = p.kp, p.kd
            spring = p.kp * p.error + p.kd * p.derivative
        elif j.law == IMPEDANCE:
            j.set_point.stiffness, j.set_point.damping = j.stiffness, j.damping
            spring = j.stiffness * (j.track.position - j.position) - j.damping * j.velocity
        j.set_point.torque = drive - spring


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
    torque = p.integral + p.kff * place + j.forward + feed
    torque += j.motor.friction(velocity)
    j.set_point.torque = clamp(torque, -j.limits.torque, j.limits.torque)
    j.set_point.position, j.set_point.velocity = place, velocity
    if not j.reference.comes_to_rest:
        j.set_point.trail -= j.set_point.trail * min(j.clock.elapsed / TRAIL_FADING, 1.0)
    if j.set_point.sag + j.set_point.trail != 0.0:
        place_beyond = place + j.set_point.sag + j.set_point.trail
        j.set_point.position = clamp(place_beyond, j.reference.lower, j.reference.upper)
    if j.drive.kind == AS_VELOCITY:
        j.set_point.position = 0.0
        if not j.wire.blind:
            j.set_point.velocity += j.wire.bandwidth_share * j.drive.pursuit * (place - j.position)
        top = PURSUIT * j.limits.velocity
        j.set_point.velocity = clamp(j.set_point.velocity, -top, top)
    j.torque_reference = j.set_point.torque


@cython.cfunc
def hand_down_spring(j: Joint, feed: cython.double) -> cython.void:
    """The followed reference for the drive's own spring and damper, where readings are late (B7).

    The drive knows the present error, the board an old one: of its own it adds the integral part.
    Where the loop is starved, the board knows each step in one phase only.
    """
    p: Pid = j.position_pid
    keep_near(j)
    if not j.wire.blind:
        pid_step(p, j.track.position, j.track.position - j.position, j.track.velocity - j.velocity)
        soften(j)
    hand_down_path(j, feed, j.track.position, j.track.velocity)
    j.set_point.stiffness = p.kp * j.wire.stiffness_share
    j.set_point.damping = p.kd * j.wire.bandwidth_share
