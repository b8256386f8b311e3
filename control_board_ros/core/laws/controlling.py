# SPDX-License-Identifier: Apache-2.0
"""What drives a joint there: the law of its mode (source Fig. 2), its bounds, the set-point.

The third to fifth phase of a cycle, see ``laws``.
"""

from __future__ import annotations

from math import fabs

from ... import nocython as cython
from .formulas import INFINITE, brake_speed, clamp, is_number
from .joint import (
    AS_CURRENT,
    AS_IMPEDANCE,
    AS_POSITION,
    AS_PWM,
    AS_TORQUE,
    AS_VELOCITY,
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
    come_in,
    friction,
    go_on_stopping,
    place_of,
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
    late = j.followed - j.delay * j.followed_velocity  # what the drive has by now
    if j.coasts:
        torque = p.kff * j.followed + p.integral + j.feedback
    elif j.blind:  # the drive has the same spring, with the present error
        torque = p.feed() + p.integral
    else:
        torque = pid_step(p, j.followed, late - j.position, j.followed_velocity - j.velocity)
        if j.calm < 1.0:
            torque = soften(j)
        keep_feedback(j)
    return torque + j.forward + friction(j, j.followed_velocity)


@cython.cfunc
def keep_feedback(j: Joint) -> cython.void:
    """Filter the feedback: what a joint that coasts keeps of it is its load (B7)."""
    p: Pid = j.position_pid
    feedback = p.kp * p.error * j.spring + p.kd * p.derivative * j.calm
    j.feedback += j.period / (j.period + HOLD_FILTER) * (feedback - j.feedback)


@cython.cfunc
def soften(j: Joint) -> cython.double:
    """The torque of the position PID for a loop slower by ``calm``."""
    p: Pid = j.position_pid
    p.integral -= (1.0 - j.spring * j.calm) * (p.integral - p.previous)
    return (
        p.kff * p.reference + p.kp * p.error * j.spring + p.integral + p.kd * p.derivative * j.calm
    )


@cython.cfunc
def keep_near(j: Joint) -> cython.void:
    """Bound the lead of the followed reference by the torque and speed limits (P14)."""
    p: Pid = j.position_pid
    if p.kp > 0.0 and not j.blind:
        late = j.delay + 2.0 * j.wire + max(j.hold_time - j.period, 0.0)
        lead = late * fabs(j.followed_velocity)  # either way
        lead += LEAD * j.max_torque / (p.kp * j.calm)
        if fabs(j.followed - j.position) > lead:
            if j.kind == AS_POSITION:
                keep_near_drive(j, lead)
            else:
                stay(j, clamp(j.followed, j.position - lead, j.position + lead))
        hold_back(j)


@cython.cfunc
def keep_near_drive(j: Joint, lead: cython.double) -> cython.void:
    """Bound the lead over a drive that closes the loop of position, with a stiffness of its own.

    What it sags by under a load is no lead: a reference that followed such a joint would sink with
    it. At the torque limit, by its current, the reference yields, so that it is that limit. Below,
    it goes on, up to DRIVE_LEADS leads. Beyond, and where no current is known, it waits.
    """
    error = j.followed - j.position
    torque = j.torque if error > 0.0 else -j.torque
    if torque > j.max_torque:
        stay(j, j.position + error * j.max_torque / torque)
    elif not (fabs(torque) > 0.0 and fabs(error) <= DRIVE_LEADS * lead):
        wait_for_drive(j, clamp(j.followed, j.position - lead, j.position + lead))


@cython.cfunc
def wait_for_drive(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place that it has not passed, else where it was."""
    before = j.set_position - j.sag - j.trail
    low = min(j.followed, place)
    high = max(j.followed, place)
    place = clamp(before, low, high)
    if place != j.followed:
        stay(j, place)


@cython.cfunc
def stay(j: Joint, place: cython.double) -> cython.void:
    """Stop the followed reference at a place, without the feed-forward of its acceleration.

    Of a joint that brakes with less torque than that takes, it goes on with the joint's speed.
    """
    j.forward -= j.inertia * j.followed_acceleration
    j.followed = place
    j.followed_velocity = j.followed_acceleration = 0.0
    if j.stopping:
        go_on_stopping(j, place)
    j.active = True


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
    push = p.kp * (j.followed - j.position) + p.integral
    if j.kind == AS_POSITION and is_number(j.torque) and j.torque != 0.0:
        push = j.torque
    max_excess = j.light_inertia * j.max_velocity / (j.period * (1.0 + 0.5 * j.lead) + j.delay)
    if max_excess >= j.max_torque:
        return
    max_excess = max(max_excess, HOLD_SHARE * j.max_torque)
    if fabs(j.velocity) > REST_SPEED * j.max_velocity:
        j.blocked = False
    elif j.followed_velocity != 0.0:
        j.blocked = True
    elif j.kind == AS_POSITION and j.followed == j.reference:
        j.blocked = False  # it holds what it bears
    if not j.blocked:
        j.carried = push if j.kind == AS_POSITION else p.integral
        return
    excess = push - j.carried
    if fabs(excess) > max_excess:
        back = j.followed - (excess - clamp(excess, -max_excess, max_excess)) / p.kp
        # not beyond where the joint is
        back = clamp(back, min(j.followed, j.position), max(j.followed, j.position))
        if j.kind == AS_POSITION:
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
        + j.stiffness * (j.followed - j.position)
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
    time = j.period if j.gap else j.elapsed
    least = j.dead_band + j.load_share * j.borne
    speed = 0.0
    up = brake_speed(j.upper - j.goal, j.max_acceleration, time)
    down = brake_speed(j.goal - j.lower, j.max_acceleration, time)
    if j.felt_left > 0.0:  # it follows what the braking has left in the low pass
        j.felt_left -= time
        j.felt_taken = j.felt
    push = j.felt - j.felt_taken
    push -= clamp(push, -least, least)
    if j.feels and not j.blind:
        speed = push + j.torque_offset - j.offset_taken + j.stiffness * (j.followed - j.goal)
        speed /= max(j.damping, j.min_damping) + j.stiffness * time
    speed = clamp(speed, -min(down, j.max_velocity), min(up, j.max_velocity))
    if push != 0.0:
        j.felt_taken *= max(1.0 - fabs(speed) * time / (FADING * j.limit_edge), 0.0)
    j.goal = clamp(j.goal + speed * time, j.lower, j.upper)
    j.goal_velocity = speed
    if j.calibrated:
        come_in(j, j.goal)
        note_limit(j)


@cython.cfunc
def hold_torque(j: Joint, share: cython.double) -> cython.double:
    """A hold that yields: clip(kp (q_hold − q) − kd q̇, ± share·τ_max).

    Pushed harder, the joint moves, and holds where it is released.
    """
    p: Pid = j.position_pid
    firm = share * j.max_torque
    if p.kp > 0.0:
        j.hold_place = clamp(j.hold_place, j.position - firm / p.kp, j.position + firm / p.kp)
    spring = p.kp * j.spring
    damper = p.kd * j.calm
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
    reference = clamp(reference, -j.max_torque, j.max_torque)
    j.torque_reference = reference
    if j.kind >= AS_TORQUE:
        return reference
    error = reference - j.torque
    return pid_step(p, reference, error, (error - p.error) / j.period)


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
    feed = j.output_offset * j.per_feed if j.feeds else 0.0
    if j.kind in (AS_POSITION, AS_VELOCITY):
        lead_drive(j, feed)
        return
    if j.coasts and j.law != POSITION and not j.settling:
        coast(j)
        return
    if (
        j.kind == AS_IMPEDANCE
        and (j.wire > 0.0 or j.hold_time > STARVED_PERIODS * j.period)
        and (j.law == POSITION or j.settling)
    ):
        hand_down_spring(j, feed)
        return
    if j.law == OUTPUT:
        output_law(j, j.output_command + feed)
        return
    if j.law == CURRENT and not (j.settling or j.holding):
        drive = clamp(j.current_command + feed, -j.max_drive, j.max_drive)
        hand_down(j, protect(j, drive))
        return
    if j.law == POSITION or j.settling:
        loop = j.position_pid
    torque = law_torque(j)
    drive = clamp(torque, -j.max_torque, j.max_torque)
    if drive != torque:
        unwind(loop, torque - drive)
    if drive == torque or j.law != POSITION:
        j.strain_cycles = 0
    elif j.strain_cycles < 1000000:
        j.strain_cycles += 1
    drive = ahead_of_winding(j, drive * j.per_torque)
    drive += j.compensation * j.per_speed * j.velocity + feed
    bounded = protect(j, clamp(drive, -j.max_drive, j.max_drive))
    if bounded != drive:
        unwind(loop, drive - bounded)
    hand_down(j, bounded)


@cython.cfunc
def lead_drive(j: Joint, feed: cython.double) -> cython.void:
    """The set-point of a drive that closes the loop: of the reference, or of a goal (I5, S2)."""
    if j.law == IMPEDANCE and not j.settling:
        give_way(j)
        hand_down_path(j, feed, j.goal, j.goal_velocity)
    else:
        keep_near(j)
        hand_down_path(j, feed, j.followed, j.followed_velocity)


@cython.cfunc
def coast(j: Joint) -> cython.void:
    """Drive what the joint bears without its acceleration: it goes on as it moves (B7)."""
    drive: cython.double = clamp(j.load, -j.max_torque, j.max_torque) * j.per_torque
    drive = clamp(drive + j.per_speed * j.velocity, -j.max_drive, j.max_drive)
    j.asked = drive
    if j.law == OUTPUT:
        j.output = clamp(drive, -j.max_output, j.max_output)
    else:
        hand_down(j, drive)


@cython.cfunc
def output_law(j: Joint, output: cython.double) -> cython.void:
    """The given PWM u, percent; of a calibrator's drive that takes currents (K8) what it makes.

    i = (V_s u/100 − Ke q̇)/R
    """
    if j.kind == AS_CURRENT:
        output = (output / j.percent_per_volt - j.emf * j.velocity) / j.ohms
        j.set_current = protect(j, clamp(output, -j.max_drive, j.max_drive))
        return
    j.output = clamp(protect(j, output), -j.max_output, j.max_output)
    j.current_pid.integral = 0.0


@cython.cfunc
def ahead_of_winding(j: Joint, wanted: cython.double) -> cython.double:
    """The drive whose current is the wanted one at the end of the cycle.

    L di/dt = v − R i, solved for v over one period:  v = R (i' − a i)/(1 − a), a = exp(−T R/L),
    where i is the current that the last cycle wanted.
    """
    drive: cython.double = wanted
    if not j.in_amps and j.wire == 0.0:  # late, it would only add noise
        drive += j.lead * (wanted - j.asked)
    j.asked = wanted
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
        if j.wire > 0.0
        else pid_step(p, reference, reached - j.current, 0.0)
    )
    wanted = j.percent_per_volt * (
        feedback + j.ohms * (reference + j.lead * (reference - before)) + j.emf * j.velocity
    )
    bounded = clamp(wanted, -j.max_output, j.max_output)
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
    gain = p.kp + p.ki_period / j.period * j.wire
    calm = 1.0
    if j.missed == 0.0:
        error = j.drawn[place_of(j, j.age)] - j.current
    if gain > WIRE_PHASE * j.ohms:
        calm = WIRE_PHASE * j.ohms / gain
    pid_step(p, reference, error, 0.0)
    p.integral -= (1.0 - calm) * (p.integral - p.previous)
    return p.kp * calm * error + p.integral


# --- 4. protect -----------------------------------------------------------------------------


@cython.cfunc
def protect(j: Joint, drive: cython.double) -> cython.double:
    """Bound the drive by the speed limit, and by the software limits (P9, P14).

    Where no position law keeps a joint inside its limits, its speed towards one is bounded by its
    braking distance, and from beyond one it is driven back: to where it was found, where that is
    outside (P16).
    """
    top = PURSUIT * j.max_velocity
    bottom = -top
    free: cython.bint = j.law != POSITION and not j.settling
    if free:
        top, bottom = j.max_velocity, -j.max_velocity
        if j.calibrated:
            come_in(j, j.position)
            top = speed_towards(j, j.upper - j.position, top)
            bottom = -speed_towards(j, j.position - j.lower, -bottom)
            note_limit(j)
    drive = min(drive, speed_bound(j, top, 1.0))
    drive = max(drive, -speed_bound(j, -bottom, -1.0))
    return clamp(drive, -j.max_drive, j.max_drive)


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
    span = SPAN * (j.period + j.delay + j.wire)
    speed = way * j.velocity
    torque = way * j.current * j.torque_per_ampere
    grown = torque - way * j.current_before * j.torque_per_ampere
    gain = 1.0 + j.lag * j.period / span
    gained = way * j.acceleration
    if j.wire > 0.0:  # more than the motor gives is an impact, which does not last
        gained = clamp(gained, -j.max_torque / j.inertia_min, j.max_torque / j.inertia_min)
        if j.law != POSITION and not j.settling:
            speed += gained * (j.age - j.missed)
    spare = (top - speed) / span - gain * gained
    inertia = j.light_inertia
    if spare < 0.0:
        inertia = j.heavy_inertia
    bound = torque - gain * j.lag * grown + inertia * spare
    if bound >= j.max_torque:
        return INFINITE
    bound = max(bound, -j.max_torque)
    drive = j.per_torque * bound + j.per_speed * way * j.velocity
    if j.in_amps or j.wire > 0.0:
        return drive
    return drive + j.lead * j.per_torque * (bound - torque)


@cython.cfunc
def speed_towards(j: Joint, room: cython.double, top: cython.double) -> cython.double:
    """The speed allowed towards a limit at distance ``room``; negative beyond it."""
    if room < 0.0:
        return room / RETURN
    speed = brake_speed(room, BRAKING * j.max_acceleration, j.period)
    return speed if speed < top else top


@cython.cfunc
def note_limit(j: Joint) -> cython.void:
    """Whether the joint is beyond a limit, with a hysteresis (P9)."""
    room = j.limit_upper - j.position
    below = j.position - j.limit_lower
    room = min(room, below)
    edge = 0.01 * (j.limit_upper - j.limit_lower)
    edge = min(edge, j.limit_edge)
    j.on_limit = room < 0.0 or (j.on_limit and room < edge)


# --- 5. hand down ---------------------------------------------------------------------------


@cython.cfunc
def hand_down(j: Joint, drive: cython.double) -> cython.void:
    """The output of the laws as the drive's set-point (S1), or an impedance of equal torque.

    τ_ff = drive − k (q_set − q) − d (q̇_set − q̇) holds what the laws and their bounds add. Of the
    damping it subtracts the filtered rate that the law used: the raw one would return delayed.
    """
    p: Pid = j.position_pid
    spring = 0.0
    if j.kind == AS_PWM:
        j.output = current_law(j, drive) if j.in_amps else drive
    elif j.kind == AS_CURRENT:
        j.set_current = drive
    elif j.kind == AS_TORQUE:
        j.set_torque = drive
    else:
        j.set_position, j.set_velocity = j.followed, 0.0
        j.set_stiffness = j.set_damping = 0.0
        if j.law == POSITION or j.settling:
            j.set_velocity = j.followed_velocity
            j.set_stiffness, j.set_damping = p.kp, p.kd
            spring = p.kp * p.error + p.kd * p.derivative
        elif j.law == IMPEDANCE:
            j.set_stiffness, j.set_damping = j.stiffness, j.damping
            spring = j.stiffness * (j.followed - j.position) - j.damping * j.velocity
        j.set_torque = drive - spring


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
    torque += friction(j, velocity)
    j.set_torque = clamp(torque, -j.max_torque, j.max_torque)
    j.set_position, j.set_velocity = place, velocity
    if not j.comes_to_rest:
        j.trail -= j.trail * min(j.elapsed / TRAIL_FADING, 1.0)
    if j.sag + j.trail != 0.0:
        j.set_position = clamp(place + j.sag + j.trail, j.lower, j.upper)
    if j.kind == AS_VELOCITY:
        j.set_position = 0.0
        if not j.blind:
            j.set_velocity += j.calm * j.pursuit * (place - j.position)
        j.set_velocity = clamp(j.set_velocity, -PURSUIT * j.max_velocity, PURSUIT * j.max_velocity)
    j.torque_reference = j.set_torque


@cython.cfunc
def hand_down_spring(j: Joint, feed: cython.double) -> cython.void:
    """The followed reference for the drive's own spring and damper, where readings are late (B7).

    The drive knows the present error, the board an old one: of its own it adds the integral part.
    Where the loop is starved, the board knows each step in one phase only.
    """
    p: Pid = j.position_pid
    keep_near(j)
    if not j.blind:
        pid_step(p, j.followed, j.followed - j.position, j.followed_velocity - j.velocity)
        soften(j)
    hand_down_path(j, feed, j.followed, j.followed_velocity)
    j.set_stiffness, j.set_damping = p.kp * j.spring, p.kd * j.calm
