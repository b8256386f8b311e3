# SPDX-License-Identifier: Apache-2.0
"""How long minimum-jerk moves last (SPEC P1, P6); ``laws.advance_move`` runs them.

A move is the quintic that leaves a position with a velocity (and no acceleration) and ends at
rest after a duration T. From rest it is q(s) = q0 + Δ(10s³ − 15s⁴ + 6s⁵), s = t/T, with the peak
speed 1.875 |Δ|/T and the peak acceleration 5.774 |Δ|/T². A velocity that leads away from the
target, or that is too high to end there, is braked to zero by a second polynomial,
v0(1 − 3u² + 2u³), u = t/T_b, whose distance the quintic covers as well.

Joints that move together load each other. The torque
of the arm's motion grows with the square of its speed, so moves that are k times as long
need 1/k² of it (Hollerbach, Dynamic scaling of manipulator trajectories, 1984); gravity and
friction do not change. What brakes a velocity at the start lasts k times as long, too. Where other
moves are under way, only the new ones are stretched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..model.dynamics import Arm
from .joint import Joint
from .stepping import Steps
from .stopping import smooth_time

#: The longest move, s: keeps a denormal speed from making an infinite duration.
LONGEST = 1e6

#: Peak over mean speed, peak acceleration over Δ/T², and jerk over Δ/T³, of a move from rest.
PEAK = 1.875
PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
PEAK_JERK = 60.0

#: A move that starts with velocity v0 towards its target does not overshoot while
#: T ≤ 2.5 Δ/v0 (the factor (1−s)² of its velocity stays positive).
NO_OVERSHOOT = 2.5

#: By how much a duration grows from one try to the next, and how many tries there are.
LONGER, TRIES = 1.05, 200

_S = np.linspace(0.0, 1.0, 33)


def duration(
    distance: float,
    speed: float,
    max_velocity: float,
    max_acceleration: float,
    max_jerk: float = 0.0,
) -> float:
    """Duration of a move from rest, s (P1).

    T = max(|Δ|/v, 1.875 |Δ|/v_max, √(5.774 |Δ|/a_max), ∛(60 |Δ|/j_max)), at most LONGEST

    Args:
        distance: Δ, target minus start, rad.
        speed: v, the mean speed requested, rad/s, positive.
        max_velocity: limit of the peak speed, rad/s.
        max_acceleration: limit of the peak acceleration, rad/s².
        max_jerk: limit of the peak jerk, rad/s³; 0: none.
    """
    way = abs(distance)
    if way >= LONGEST * speed:
        return LONGEST
    smooth = math.cbrt(PEAK_JERK * way / max_jerk) if max_jerk else 0.0
    return min(
        LONGEST,
        max(
            way / speed,
            PEAK * way / max_velocity,
            math.sqrt(PEAK_ACCELERATION * way / max_acceleration),
            smooth,
        ),
    )


def durations(
    distance: float,
    speed: float,
    velocity: float,
    max_velocity: float,
    max_acceleration: float,
    *,
    acceleration: float = 0.0,
    max_jerk: float = 0.0,
) -> tuple[float, float]:
    """Durations of a move that starts with a velocity, and of its braking, s (P1).

    A start velocity towards the target continues in the move, which is then shortened to
    2.5|Δ|/|v0| where that keeps it from overshooting. Where speed or acceleration would pass
    their limits that way, or the velocity points away from the target, it is braked within
    T_b ≥ 1.5|v0|/a_max.

    Args:
        distance: Δ, target minus start, rad.
        speed: v, the mean speed requested, rad/s, positive.
        velocity: v0, reference velocity at the start, rad/s.
        max_velocity: limit of the peak speed, rad/s.
        max_acceleration: limit of the peak acceleration, rad/s².
        acceleration: a0, reference acceleration at the start, rad/s²; it ends at once where there
            is no limit of the jerk.
        max_jerk: limit of the jerk, rad/s³; 0: none.

    Returns:
        T and T_b (0 where nothing is braked), s, at most LONGEST.
    """
    limits = max_velocity, max_acceleration, max_jerk
    if velocity == 0.0 and acceleration == 0.0:
        return duration(distance, speed, *limits), 0.0
    if velocity * distance > 0.0:
        time = duration(distance, speed, *limits)
        time = min(time, NO_OVERSHOOT * distance / velocity)
        if _fits(distance, time, velocity, 0.0, *limits, acceleration):
            return time, 0.0
    stretch, shortest = 1.0, braking(velocity, acceleration, max_acceleration, max_jerk)
    for _ in range(TRIES):
        brake = stretch * shortest
        rest = distance - 0.5 * velocity * brake - acceleration * brake**2 / 12.0
        least = duration(rest, math.inf, *limits)
        time = max(duration(rest, speed, *limits), stretch * least)
        if _fits(distance, time, velocity, brake, *limits, acceleration):
            break
        stretch *= LONGER
    return min(time, LONGEST), min(brake, LONGEST)


def braking(
    velocity: float, acceleration: float, max_acceleration: float, max_jerk: float
) -> float:
    """The shortest braking of a velocity within the limits, s (``stopping.smooth_time``)."""
    if not max_jerk:
        return 1.5 * abs(velocity) / max_acceleration
    return float(smooth_time(abs(velocity), abs(acceleration), max_acceleration, max_jerk))


def durations_within(
    distance: float,
    time: float,
    velocity: float,
    max_velocity: float,
    max_acceleration: float,
    *,
    acceleration: float = 0.0,
    max_jerk: float = 0.0,
    stretch: float = 1.0,
) -> tuple[float, float]:
    """Durations of a move that arrives at a given time, and of its braking, s.

    T is the time given. A start velocity continues in the move where that neither overshoots nor
    passes a limit within T; else it is braked within T_b ≥ 1.5|v0|/a_max, times ``stretch`` where
    that is within T.

    Other arguments and results are those of :func:`durations`; T is no less than what that asks
    for.
    """
    limits = max_velocity, max_acceleration, max_jerk
    if velocity == 0.0 and acceleration == 0.0:
        return time, 0.0
    smooth = velocity * distance > 0.0 and abs(velocity) * time <= NO_OVERSHOOT * abs(distance)
    if smooth and _fits(distance, time, velocity, 0.0, *limits, acceleration):
        return time, 0.0
    brake = braking(velocity, acceleration, max_acceleration, max_jerk)
    brake = max(brake, min(stretch * brake, time))
    while brake < time and not _fits(distance, time, velocity, brake, *limits, acceleration):
        brake *= LONGER
    return time, brake


def _fits(
    distance: float,
    time: float,
    velocity: float,
    brake: float,
    max_velocity: float,
    max_acceleration: float,
    max_jerk: float = 0.0,
    acceleration: float = 0.0,
) -> bool:
    """Whether a move keeps within its limits, sampled over both of its parts."""
    if time <= 0.0:
        return False
    t = np.concatenate([_S * time, _S * brake])
    s, u = np.minimum(t / time, 1.0), np.minimum(t / brake, 1.0) if brake else 0.0 * t
    reach = distance - 0.5 * velocity * brake - acceleration * brake**2 / 12.0
    run, bend = (0.0, 0.0) if brake else (velocity * time, 0.5 * acceleration * time**2)
    a, b = 10 * reach - 6 * run - 3 * bend, 8 * run - 15 * reach + 3 * bend
    c = 6 * reach - 3 * run - bend
    speed = (run + s * (2 * bend + s * (3 * a + s * (4 * b + s * 5 * c)))) / time
    change = (2 * bend + s * (6 * a + s * (12 * b + s * 20 * c))) / time**2
    jerk = (6 * a + s * (24 * b + s * 60 * c)) / time**3 * (t <= time)
    if brake:
        speed += velocity * (1 + u**2 * (2 * u - 3)) + acceleration * brake * u * (1 - u) ** 2
        change += 6 * velocity * u * (u - 1) / brake + acceleration * (1 + u * (3 * u - 4))
        braking_jerk = velocity * (12 * u - 6) / brake**2 + acceleration * (6 * u - 4) / brake
        jerk += braking_jerk * (t <= brake)
    elif acceleration:
        place = s * (run + s * (bend + s * (a + s * (b + s * c)))) / distance
        if place.max() > 1.0 + 1e-9:
            return False
    slack = 1.0 + 1e-6
    return bool(
        np.abs(speed).max() <= slack * max(max_velocity, abs(velocity))
        and np.abs(change).max() <= slack * max(max_acceleration, abs(acceleration))
        and (not max_jerk or np.abs(jerk).max() <= slack * max_jerk)
    )


#: Part of a joint's torque that a planned motion may use; the rest is for its control.
SHARE = 0.9
#: Points at which a move is evaluated; maximum number of stretches, and the least one.
SAMPLES, STRETCHES, MIN_STRETCH = 14, 16, 1.02

#: Durations of a move and of its braking, s; see ``trajectory.durations``.
Plan = tuple[float, float]


class Effort:
    """The torque that moves of one arm need.

    Args:
        arm: the dynamics of its joints.
        joints: which move.
        first: the board's number of the first of them.
    """

    def __init__(self, arm: Arm, joints: Sequence[Joint], first: int) -> None:
        self._arm, self._joints, self._first = arm, joints, first
        self._steps = Steps(list(joints), arm)

    def step(self, numbers: Sequence[int]) -> bool:
        """Plan direct steps that need more torque together than there is (``stepping``).

        Args:
            numbers: the board's numbers of the joints that step.

        Returns:
            Whether they get there: False where they are to move instead.
        """
        if not all(joint.calibrated for joint in self._joints):
            return True
        return self._steps.plan([j - self._first for j in numbers])

    def stretched(
        self,
        numbers: Sequence[int],
        targets: Sequence[float],
        plan: Callable[[float], list[Plan]],
    ) -> tuple[float, list[Plan]]:
        """Moves stretched by one factor until no joint needs more torque than it has.

        Args:
            numbers: the board's numbers of the joints that start to move.
            targets: where to.
            plan: their moves, stretched by a factor.

        Returns:
            The factor, and the plan with it.
        """
        factor, moves = 1.0, plan(1.0)
        if not all(joint.calibrated for joint in self._joints):
            return factor, moves
        self._note_others()
        for _ in range(STRETCHES):
            for j, target, (time, brake) in zip(numbers, targets, moves, strict=True):
                self._note_move(j, target, time, brake)
            excess = self._arm.excess(SAMPLES)
            if excess <= 1.0:
                break
            factor *= max(math.sqrt(excess), MIN_STRETCH)
            moves = plan(factor)
        return factor, moves

    def _note_others(self) -> None:
        """Read positions, running moves, and the torques that the motors have."""
        for body, joint in zip(self._arm.bodies, self._joints, strict=True):
            motor, move = joint.motor, joint.trajectory
            volts = joint.limits.output / motor.percent_per_volt
            torque_per_volt = motor.torque_per_ampere / motor.ohms
            body.limit = SHARE * joint.limits.torque
            body.stall = SHARE * volts * torque_per_volt
            body.fading = SHARE * motor.emf * torque_per_volt
            body.lower, body.upper = joint.reference.lower, joint.reference.upper
            body.drift = joint.ramp.velocity
            if move.moving:
                body.start, body.start_velocity = move.start, move.start_velocity
                body.start_acceleration, body.target = move.start_acceleration, move.target
                body.time, body.brake = move.time, move.brake_time
                body.past = move.cycles * joint.clock.period
            else:
                body.start = body.target = joint.reference.position
                body.start_velocity = body.start_acceleration = 0.0
                body.time = body.brake = body.past = 0.0

    def _note_move(self, j: int, target: float, time: float, brake: float) -> None:
        """Add a move that begins now."""
        body, joint = self._arm.bodies[j - self._first], self._joints[j - self._first]
        body.start, body.start_velocity = joint.reference.position, joint.trajectory.velocity
        body.start_acceleration = joint.trajectory.acceleration
        body.target, body.time, body.brake, body.past = target, time, brake, 0.0
