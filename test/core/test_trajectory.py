# SPDX-License-Identifier: Apache-2.0
"""trajectory.py and the moves of core/laws/laws.py, for any numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joints import OneJoint

from control_board_ros.core.laws.trajectory import (
    NO_OVERSHOOT,
    PEAK,
    PEAK_ACCELERATION,
    _fits,
    duration,
    durations,
    durations_within,
)

PERIOD = 0.01
VELOCITY, ACCELERATION = 6.0, 50.0
POSITIONS = st.floats(-3.0, 3.0)
SPEEDS = st.floats(0.05, 3.0)
WIDE = {
    "clock.period": PERIOD,
    "limits.velocity": VELOCITY,
    "limits.acceleration": ACCELERATION,
    "limits.lower": -99.0,
    "limits.upper": 99.0,
    "reference.lower": -99.0,
    "reference.upper": 99.0,
}


def at(start: float) -> OneJoint:
    """A joint at rest at a position, which it holds."""
    one = OneJoint(**WIDE)
    one.set(position=start)
    one.joint.hold(start)
    return one


def go(one: OneJoint, target: float, speed: float) -> tuple[float, float]:
    """Start a move as the board does; its durations."""
    joint = one.joint
    times = durations(
        target - joint.reference.position, speed, joint.trajectory.velocity, VELOCITY, ACCELERATION
    )
    joint.move(target, *times)
    return times


@given(POSITIONS, POSITIONS, POSITIONS, SPEEDS, SPEEDS, st.floats(0.0, 1.0))
def test_no_move_passes_speed_or_acceleration(
    start: float, first: float, second: float, speed: float, other: float, when: float
) -> None:
    """P1, P14: also when it is led elsewhere on its way; it starts where the reference is."""
    one = at(start)
    time = max(go(one, first, speed)[0], PERIOD)
    one.step(int(when * time / PERIOD))
    before = one.joint.reference.position, one.joint.reference.velocity
    time, brake = go(one, second, other)
    cycles = math.ceil(max(time, brake, PERIOD) / PERIOD - 1e-9)
    position, velocity = one.record(cycles, "reference.position", "reference.velocity").T
    if cycles > 1:  # of one cycle no curve can be seen
        hardest = ACCELERATION * 1.02 * PERIOD + 1e-9
        assert np.abs(np.diff(velocity, prepend=before[1])).max() <= hardest
        assert np.abs(velocity).max() <= VELOCITY * 1.01
        slack = 0.55 * ACCELERATION * PERIOD**2
        assert abs(position[0] - before[0] - before[1] * PERIOD) <= slack
    assert position[-1] == second
    assert velocity[-1] == 0.0
    assert not one.joint.trajectory.moving


def test_duration_of_a_move_from_rest() -> None:
    """P1: T = |Δ|/v, and longer where peak speed or peak acceleration would pass their limits."""
    assert duration(1.0, 0.5, 6.0, 50.0) == 2.0
    assert duration(-1.0, 0.5, 6.0, 50.0) == 2.0
    assert duration(0.0, 0.5, 6.0, 50.0) == 0.0
    assert duration(1.0, 6.0, 6.0, 50.0) == pytest.approx(
        math.sqrt(PEAK_ACCELERATION * 1.0 / 50.0)
    )
    assert duration(9.0, 6.0, 6.0, 50.0) == pytest.approx(PEAK * 9.0 / 6.0)
    assert duration(1e-3, 1.0, 6.0, 50.0) == pytest.approx(math.sqrt(5.7735e-3 / 50.0), rel=1e-4)
    assert duration(1.0, 5e-324, 6.0, 50.0) == 1e6


def test_a_velocity_at_the_target_continues() -> None:
    """P1: T ≤ 2.5 Δ/v0 keeps the quintic from overshooting; else the velocity is braked."""
    time, brake = durations(1.0, 0.1, 1.0, 6.0, 50.0)
    assert brake == 0.0
    assert time <= NO_OVERSHOOT
    time, brake = durations(-1.0, 0.5, 1.0, 6.0, 50.0)
    assert brake >= 1.5 * 1.0 / 50.0
    time, brake = durations(0.001, 0.5, 3.0, 6.0, 50.0)  # too near to stop before it
    assert brake >= 1.5 * 3.0 / 50.0
    time, brake = durations(0.0, 0.5, 1.0, 6.0, 50.0)  # at it already
    assert brake >= 1.5 * 1.0 / 50.0


def test_a_braked_move_lasts_no_longer_than_its_limits_ask() -> None:
    """P1: T_b = 1.5|v0|/a_max, T as from rest over Δ − v0·T_b/2; 5 % more per try."""
    time, brake = durations(-1.0, 6.0, 0.2, VELOCITY, ACCELERATION)
    assert 1.0 <= brake / (1.5 * 0.2 / ACCELERATION) <= 1.2
    rest = duration(-1.0 - 0.5 * 0.2 * brake, 6.0, VELOCITY, ACCELERATION)
    assert 1.0 <= time / rest <= 1.2


def test_a_move_of_given_duration_continues_or_brakes() -> None:
    """P1: T is what was requested; v0 goes on into it, unless it overshoots or passes a limit."""
    limits = VELOCITY, ACCELERATION
    shortest = 1.5 * 1.0 / ACCELERATION
    assert durations_within(1.0, 2.0, 0.0, *limits) == (2.0, 0.0)  # from rest
    assert durations_within(1.0, 2.0, 1.0, *limits) == (2.0, 0.0)
    # Away from the target, beyond it, at it already, and too hard.
    for distance, lasting in ((-1.0, 2.0), (0.5, 2.0), (0.0, 2.0), (0.35, 0.15)):
        time, brake = durations_within(distance, lasting, 1.0, *limits)
        assert time == lasting
        assert brake >= shortest
    time, brake = durations_within(-1.0, 2.0, 1.0, *limits)
    assert shortest < brake <= 1.2 * shortest  # the move turns in the same direction meanwhile


def test_a_stretched_move_brakes_for_longer() -> None:
    """P1: by as much as the move, within its time; never harder than a_max."""
    limits = VELOCITY, ACCELERATION
    least = 1.5 * 0.5 / ACCELERATION
    assert durations_within(-1.0, 20.0, 0.5, *limits, stretch=3.0) == (20.0, 3.0 * least)
    assert durations_within(-1.0, 20.0, 0.5, *limits, stretch=1e4) == (20.0, 20.0)
    assert durations_within(0.0, 0.5 * least, 0.5, *limits, stretch=3.0)[1] >= least


@pytest.mark.parametrize(
    ("distance", "time", "velocity", "brake"),
    [
        (1.0, 2.0, 0.0, 0.0),
        (-1.0, 2.0, -0.9, 0.0),
        (1.0, 1.3, 1.5, 0.0),
        (1.0, 2.0, 0.2, 0.0),
        (1.0, 2.0, 0.5, 0.5),
        (-1.0, 1.0, 0.6, 0.3),
        (1.0, 1.0, 1.0, 1.0),  # fastest while it brakes
        (0.25, 5.0, 1.0, 0.5),  # all of the way is that of braking
    ],
)
def test_fitted_moves_are_within_both_limits(
    distance: float, time: float, velocity: float, brake: float
) -> None:
    """P1: speed and acceleration of the whole curve, as its ends determine it."""
    t = np.linspace(0.0, max(time, brake), 2001)
    going_on = 0.0 if brake else velocity
    powers = np.arange(6)
    slopes, bends = powers[1:], powers[2:] * powers[1:-1]
    ends = np.zeros((6, 6))
    ends[0, 0] = ends[1, 1] = ends[2, 2] = 1.0  # position, velocity, ½ acceleration at the start
    ends[3] = time**powers
    ends[4, 1:] = slopes * time ** powers[:-1]
    ends[5, 2:] = bends * time ** powers[:-2]
    way = distance - 0.5 * velocity * brake
    quintic = np.polynomial.Polynomial(np.linalg.solve(ends, [0.0, going_on, 0.0, way, 0.0, 0.0]))
    speed = np.where(t < time, quintic.deriv()(t), 0.0)
    acceleration = np.where(t < time, quintic.deriv(2)(t), 0.0)
    if brake:
        u = np.minimum(t / brake, 1.0)
        speed += velocity * (1.0 - 3.0 * u**2 + 2.0 * u**3)
        acceleration += velocity * (6.0 * u**2 - 6.0 * u) / brake
    fastest, hardest = np.abs(speed).max(), np.abs(acceleration).max()
    move = distance, time, velocity, brake
    assert _fits(*move, 1.001 * fastest, 1.001 * hardest)
    assert not _fits(*move, 1.001 * fastest, 0.99 * hardest)
    if fastest > 1.01 * abs(velocity):  # its own speed is allowed to it
        assert not _fits(*move, 0.99 * fastest, 1.001 * hardest)


def test_a_move_of_no_distance_ends_in_one_cycle() -> None:
    """P3: it is under way in the cycle that accepts it."""
    one = at(0.5)
    go(one, 0.5, 1.0)
    assert one.joint.trajectory.moving
    one.step()
    assert not one.joint.trajectory.moving
    assert one.done[0] == 1
    assert one.get("position_reference") == 0.5


def test_a_start_velocity_continues_into_the_move() -> None:
    """P1: as long as requested, or shortened to 2.5 Δ/v0 where that keeps within the limits."""
    assert durations(1.0, 0.1, 2.0, 6.0, 50.0) == (NO_OVERSHOOT * 0.5, 0.0)
    assert durations(4.0, 10.0, 2.0, 60.0, 500.0)[0] == pytest.approx(0.4)  # as requested
    assert durations(1.0, 6.0, 1.0, 6.0, 9.0) == (duration(1.0, 6.0, 6.0, 9.0), 0.0)
    for acceleration in np.linspace(3.0, 60.0, 200):
        time, brake = durations(1.0, 6.0, 1.0, 6.0, float(acceleration))
        if _fits(1.0, NO_OVERSHOOT, 1.0, 0.0, 6.0, float(acceleration)):
            assert (time <= NO_OVERSHOOT, brake) == (True, 0.0)
        else:
            assert brake > 0.0


@given(st.floats(0.01, 5.0), SPEEDS, st.floats(0.01, 0.999), st.floats(0.5, 50.0))
def test_a_velocity_towards_the_target_asks_for_no_more_time(
    way: float, speed: float, part: float, acceleration: float
) -> None:
    """P1: such a move has lower peaks than the one from rest, as long as it does not overshoot."""
    time = duration(way, speed, VELOCITY, acceleration)
    velocity = part * min(VELOCITY, NO_OVERSHOOT * way / time)
    assert durations(way, speed, velocity, VELOCITY, acceleration) == (time, 0.0)
    assert durations(-way, speed, -velocity, VELOCITY, acceleration) == (time, 0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_braking_counts_as_travel(way: float) -> None:
    """P1: Δ − v0 T_b/2 is left of the move, whichever way it goes."""
    speed, limits = 0.5, (6.0, 50.0)
    time, brake = durations(-way, speed, way * 2.0, *limits)
    assert brake >= 1.5 * 2.0 / 50.0
    assert time == pytest.approx(duration(-way * (1.0 + brake), speed, *limits))


def test_a_move_without_time_fits_nothing() -> None:
    assert not _fits(0.0, 0.0, 0.0, 0.0, 6.0, 50.0)
    assert not _fits(1.0, -1.0, 0.0, 0.0, 6.0, 50.0)


def test_after_its_end_a_move_is_at_rest() -> None:
    """P1: braking may last longer than the move, which stays at its end meanwhile."""
    assert _fits(0.35, 0.5, 1.0, 0.9, 6.0, 50.0)
    assert not _fits(0.35, 0.5, 1.0, 0.02, 6.0, 50.0)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.6, 0.7, 0.8, 0.9])
@pytest.mark.parametrize(("start", "end"), [(-0.3, 0.8), (-2.0, 0.8), (0.7, 0.8), (0.3, -0.5)])
def test_a_move_turned_back_before_a_limit_brakes_within_the_acceleration(
    start: float, end: float, share: float
) -> None:
    """P1, P14: the reference keeps its acceleration limit, and the range."""
    one = OneJoint(
        limits__velocity=4.0,
        limits__acceleration=30.0,
        reference__lower=-0.5,
        reference__upper=0.8,
    )
    one.joint.reference.lower = min(-0.5, start)
    one.set(position=start)
    one.joint.hold(start)
    limits = 4.0, 30.0
    first = durations(end - start, 9.0, 0.0, *limits)
    one.joint.move(end, *first)
    rows = [
        one.record(1, "reference.position")[0, 0] for _ in range(round(share * max(first) / 0.001))
    ]
    joint = one.joint
    joint.move(
        start,
        *durations(start - joint.reference.position, 9.0, joint.trajectory.velocity, *limits),
    )
    cycles = math.ceil(max(joint.trajectory.time, joint.trajectory.brake_time) / 0.001) + 2
    rows += [one.record(1, "reference.position")[0, 0] for _ in range(cycles)]
    assert one.joint.trajectory.moving is False or one.joint.trajectory.moving == 0
    assert rows[-1] == pytest.approx(start)
    assert max(abs(np.diff(rows, 2))) / 0.001**2 < 1.02 * 30.0
