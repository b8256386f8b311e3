# SPDX-License-Identifier: Apache-2.0
"""core/trajectory.py: the laws of moves and ramps, for any numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from control_board_ros.core.trajectory import PEAK, Trajectories, durations, ramps

PERIOD = 0.01
ALL = np.array([0])
POSITIONS = st.floats(-3.0, 3.0)
SPEEDS = st.floats(0.05, 3.0)


def both(distance: float, speed: float, velocity: float = 0.0) -> tuple[float, float]:
    """Durations of a move and of its braking."""
    arrays = (np.array([x]) for x in (distance, speed, velocity, 6.0, 50.0))
    time, brake = durations(*arrays)
    return float(time[0]), float(brake[0])


def duration(distance: float, speed: float, velocity: float = 0.0) -> float:
    return both(distance, speed, velocity)[0]


class Follower(Trajectories):
    """Trajectories, and where they are now."""

    def __init__(self, start: np.ndarray) -> None:
        super().__init__(len(start), PERIOD)
        self.position, self.velocity = start, np.zeros(len(start))
        self.hold(np.arange(len(start)), start)

    def go(self, target: np.ndarray, time: np.ndarray, brake: np.ndarray) -> None:
        """Start moves from where the references are."""
        everyone = np.arange(len(target))
        self.move(everyone, self.position, self.velocity, target, time, brake)

    def follow(self, cycles: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities of some cycles, shape (cycles, n) each."""
        profile = np.zeros((cycles, 2, len(self.position)))
        self.profiles(profile)
        for now in profile:
            self.advance()
            self.position, self.velocity = now
        return profile[:, 0], profile[:, 1]


def follow(moves: Follower, cycles: int) -> tuple[np.ndarray, np.ndarray]:
    return moves.follow(cycles)


def go(moves: Follower, target: float, time: float, brake: float = 0.0) -> None:
    moves.go(*(np.array([x]) for x in (target, time, brake)))


def started(start: float, target: float, time: float) -> Follower:
    moves = Follower(np.array([start]))
    go(moves, target, time)
    return moves


@given(POSITIONS, POSITIONS, SPEEDS)
def test_moves_are_minimum_jerk(start: float, target: float, speed: float) -> None:
    """P1: q(s) = q0 + Δ(10s³ − 15s⁴ + 6s⁵), from rest to rest, never beyond its ends."""
    time = max(duration(target - start, speed), PERIOD)
    cycles = int(np.ceil(time / PERIOD - 1e-9))
    moves = started(start, target, time)
    position, velocity = (array[:, 0] for array in follow(moves, cycles + 5))
    s = np.minimum(np.arange(1, cycles + 6) * PERIOD / time, 1.0)
    reach = target - start
    assert position == pytest.approx(start + reach * (10 * s**3 - 15 * s**4 + 6 * s**5), abs=1e-9)
    assert np.all(
        (position - min(start, target) >= -1e-9) & (position - max(start, target) <= 1e-9)
    )
    assert np.all(np.diff(position) * np.sign(reach) >= -1e-12)
    assert position[cycles - 1] == target
    assert velocity[cycles - 1 :] == pytest.approx(0.0, abs=0)
    assert np.abs(velocity).max() <= PEAK * abs(reach) / time + 1e-9


@given(POSITIONS, POSITIONS, POSITIONS, SPEEDS, SPEEDS, st.floats(0.0, 1.0))
def test_retargeting_has_no_jump(
    start: float, first: float, second: float, speed: float, other: float, when: float
) -> None:
    """P1: a new target starts from the present reference position and velocity."""
    time = max(duration(first - start, speed), PERIOD)
    moves = started(start, first, time)
    follow(moves, int(when * time / PERIOD))
    before = float(moves.position[0]), float(moves.velocity[0])
    time, brake = both(second - before[0], other, before[1])
    go(moves, second, time, brake)
    time = max(time, PERIOD)
    assume(time > 20 * PERIOD)
    cycles = int(np.ceil(max(time, brake) / PERIOD - 1e-9))
    position, velocity = (array[:, 0] for array in follow(moves, cycles))
    # The most that can change in one cycle: what the acceleration of the polynomials allows.
    reach = abs(second - before[0]) + abs(before[1]) * brake
    hardest = 10 * reach / time**2 + 8 * abs(before[1]) / time + 1.5 * 50.0
    assert abs(position[0] - before[0] - before[1] * PERIOD) <= hardest * PERIOD**2 + 1e-9
    assert abs(velocity[0] - before[1]) <= hardest * PERIOD + 1e-9
    assert np.abs(np.diff(velocity)).max(initial=0) <= hardest * PERIOD + 1e-9
    assert position[-1] == second
    assert velocity[-1] == 0.0
    # It never leaves the way between start and target by more than it takes to stop.
    slack = 0.75 * before[1] ** 2 / 50.0 + 1e-9
    assert position.min() >= min(before[0], second) - slack
    assert position.max() <= max(before[0], second) + slack


@given(POSITIONS, st.floats(0.01, 3.0), SPEEDS, st.floats(0.1, 0.9))
def test_retargeting_further_the_same_way_does_not_overshoot(
    start: float, reach: float, speed: float, when: float
) -> None:
    """P1: a move that is led further on in its direction never passes the new target."""
    time = max(duration(reach, speed), PERIOD)
    moves = started(start, start + reach, time)
    follow(moves, int(when * time / PERIOD))
    here, velocity = float(moves.position[0]), float(moves.velocity[0])
    target = start + 2 * reach
    time = duration(target - here, speed, velocity)
    assume(time <= 2.5 * abs(target - here) / max(abs(velocity), 1e-9))
    go(moves, target, time)
    position, _ = follow(moves, int(np.ceil(time / PERIOD)) + 2)
    assert position.max() <= target + 1e-9


def test_duration_is_distance_over_mean_speed() -> None:
    """P1: T = |Δ|/v, and longer only where the peak velocity, 1.875 v, would pass the limit."""
    assert duration(1.0, 0.5) == 2.0
    assert duration(-1.0, 0.5) == 2.0
    assert duration(0.0, 0.5) == 0.0
    assert duration(1.0, 6.0) == pytest.approx(1.875 / 6.0)
    assert duration(1.0, 5e-324) == 1e6


def test_done_until_the_profile_ends() -> None:
    """P3: not done from the start of the move to its last cycle."""
    moves = started(0.0, 1.0, 10.5 * PERIOD)
    assert not moves.done[0]
    assert moves.moving
    follow(moves, 10)
    assert not moves.done[0]
    assert moves.remaining(ALL)[0] == pytest.approx(PERIOD)
    follow(moves, 1)
    assert moves.done[0]
    assert not moves.moving
    assert moves.remaining(ALL)[0] == 0.0
    assert moves.position[0] == 1.0


def test_a_move_of_no_distance_ends_in_one_cycle() -> None:
    moves = started(0.5, 0.5, 0.0)
    assert not moves.done[0]
    follow(moves, 1)
    assert moves.done[0]
    assert moves.position[0] == 0.5


def test_joints_move_on_their_own() -> None:
    """Joints given together move as each alone, in any order of the joints."""
    start, target = np.array([0.0, 1.0, -1.0]), np.array([1.0, 0.9, 2.0])
    time = np.array([0.1, 0.02, 0.3])
    together = Follower(start)
    together.go(target, time, np.zeros(3))
    order = np.array([2, 0, 1])
    mixed = Follower(start[order])
    mixed.go(target[order], time[order], np.zeros(3))
    alone = started(1.0, 0.9, 0.02)
    for _ in range(200):
        for moves in (together, mixed, alone):
            moves.follow(1)
        assert np.array_equal(together.position[order], mixed.position)
        assert np.array_equal(together.velocity[order], mixed.velocity)
        assert np.array_equal(together.done[order], mixed.done)
        assert alone.position[0] == together.position[1]


def test_looking_ahead_is_what_will_be() -> None:
    """The profiles of many cycles are those of each cycle by itself, past the ends of moves."""
    start, target = np.array([0.0, 1.0]), np.array([1.0, 0.9])
    moves = Follower(start)
    moves.go(target, np.array([0.3, 0.055]), np.zeros(2))
    ahead = np.zeros((40, 2, 2))
    moves.profiles(ahead)
    for k in range(40):
        moves.follow(1)
        assert np.array_equal(ahead[k, 0], moves.position)
        assert np.array_equal(ahead[k, 1], moves.velocity)
    assert moves.position.tolist() == target.tolist()


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.001, 1))
def test_ramp_arrives_and_never_passes(velocity: float, target: float, step: float) -> None:
    """P5: v moves towards its target by at most a step per cycle and stays there."""
    cycles = int(abs(target - velocity) / step) + 2
    way = ramps(np.array([velocity]), np.array([target]), np.array([step]), cycles)[:, 0]
    assert np.all(np.abs(np.diff(way, prepend=velocity)) <= step * (1 + 1e-9) + 1e-12)
    assert np.all((way >= min(velocity, target)) & (way <= max(velocity, target)))
    assert way[-1] == target
