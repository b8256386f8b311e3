# SPDX-License-Identifier: Apache-2.0
"""core.laws: direct positions as programs send them, steps and streams (SPEC P4)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from joints import OneJoint

from control_board_ros.core.terms.modes import Law

PERIOD, ACCELERATION = 0.001, 20.0
CYCLES = 2000
_RANDOM = np.random.default_rng(7)

#: In which control cycles a position comes; the board runs at 1 kHz.
EVEN = {
    "1 kHz": np.arange(CYCLES),
    "500 Hz": np.arange(0, CYCLES, 2),
    "100 Hz": np.arange(0, CYCLES, 10),
    "50 Hz": np.arange(0, CYCLES, 20),
    "100 Hz, 2 ms": np.arange(10, CYCLES, 10) + _RANDOM.integers(-1, 2, CYCLES // 10 - 1),
}
ROWS = ("followed", "followed_velocity", "followed_acceleration")


def fed(path: Callable[[float], float], due: Iterable[int], cycles: int = CYCLES) -> np.ndarray:
    """What is followed while positions of a path come when they are due, shape (cycles, 3)."""
    one = OneJoint()
    one.step(2)
    one.joint.hold(path(0.0))
    one.joint.start(Law.POSITION)
    coming, rows = set(np.asarray(list(due)).tolist()), []
    for k in range(cycles):
        if k in coming:
            one.joint.step_to(path(k * PERIOD))
        rows.append(one.record(1, *ROWS)[0])
    assert np.abs(np.diff([row[1] for row in rows])).max() <= ACCELERATION * PERIOD + 1e-9
    return np.array(rows)


@pytest.mark.parametrize("name", EVEN)
def test_an_even_motion_stays_even(name: str) -> None:
    """P4: positions on a straight line give its speed, to the last digit, at any rate."""
    rows = fed(lambda t: t - 1.0, EVEN[name])[400:1900]
    assert np.abs(rows[:, 1] - 1.0).max() < 1e-6
    assert np.abs(rows[:, 0] - (np.arange(400, 1900) * PERIOD - 1.0)).max() < 1e-9


@pytest.mark.parametrize("every", [2, 10])
def test_a_stream_far_away_is_caught_without_passing_it(every: int) -> None:
    """P4, P14: braking to its motion needs 0.8 of the acceleration; the rest is the motion's."""
    rows = fed(lambda t: 0.5 + 0.1 * t if t else 0.0, range(0, CYCLES, every))
    ahead = rows[:, 0] - (0.5 + 0.1 * np.arange(CYCLES) * PERIOD)
    assert ahead[1:].max() <= 1e-9
    assert np.abs(ahead[600:]).max() < 1e-4
    assert np.diff(rows[:, 1]).min() >= -0.8 * ACCELERATION * PERIOD


@pytest.mark.parametrize("every", [1, 10, 20])
def test_the_end_of_a_stream_is_a_stop(every: int) -> None:
    """P4, P14: 1.5 intervals later it ends; the joint brakes, and rests at its last position.

    It passes that by no more than the way of those intervals and of braking.
    """
    due = np.arange(0, 800, every)
    rows = fed(lambda t: t, due, 1600)
    last = due[-1] * PERIOD
    interval = max(0.008, every * PERIOD)
    most = 1.5 * interval + 2 * PERIOD + 1.0 / (2.0 * ACCELERATION)
    assert rows[:, 0].max() - last <= most
    assert rows[-1].tolist() == [last, 0.0, 0.0]


@pytest.mark.parametrize("gap", [60, 100, 200])
def test_positions_that_come_slowly_are_steps(gap: int) -> None:
    """P4: below 20 Hz they have no velocity: each is reached, and not passed."""
    path = dict(zip(range(0, CYCLES, gap), np.arange(CYCLES) * 0.01, strict=False))
    rows = fed(lambda t: path[round(t / PERIOD)], path)
    ends = [rows[k + gap - 1, 0] for k in path if k + gap <= CYCLES]
    wanted = [path[k] for k in path if k + gap <= CYCLES]
    for k, position in path.items():
        assert rows[k : k + gap, 0].max() <= position + 1e-9
    if gap > 50:  # 10 mrad take 45 ms
        assert ends == pytest.approx(wanted, abs=1e-12)


def test_a_leap_within_a_stream_is_a_step() -> None:
    """P4: a difference faster than the speed limit has no velocity, and is not passed."""
    one = OneJoint()
    one.step(2)
    one.joint.hold(0.0)
    one.joint.start(Law.POSITION)
    for position in (0.0, 0.5):
        one.joint.step_to(position)
        one.step(10)
    assert one.joint.direct_velocity == 0.0
    rows = one.record(1000, *ROWS)
    assert rows[:, 0].max() <= 0.5 + 1e-12
    assert rows[-1, 0] == 0.5


def test_the_same_position_again_and_again_is_rest() -> None:
    """P4: a program that sends where the joint is moves nothing."""
    rows = fed(lambda t: 0.4, range(CYCLES))
    assert (rows == [0.4, 0.0, 0.0]).all()


def test_a_velocity_that_comes_along_is_used_as_it_is() -> None:
    """P4: followed between the positions, and shown as the reference's velocity."""
    one = OneJoint()
    one.step(2)
    one.joint.hold(0.0)
    one.joint.start(Law.POSITION)
    seen = []
    for k in range(100):
        one.joint.step_with(0.5 * (k * 0.01), 0.5)
        seen.append(one.record(10, "followed", "followed_velocity", "reference_velocity"))
    rows = np.concatenate(seen)[300:]
    assert rows[:, 1] == pytest.approx(0.5, abs=1e-6)
    assert rows[:, 2] == pytest.approx(0.5)
    assert rows[:, 0] == pytest.approx(0.5 * np.arange(300, 1000) * PERIOD, abs=1e-9)


def test_a_stream_into_a_limit_ends_there() -> None:
    """P9, P14: accepted positions are bounded; their velocity does not lead beyond."""
    rows = fed(lambda t: min(1.5 * t, 2.0), range(CYCLES))
    assert rows[:, 0].max() <= 2.0 + 1e-12
    assert rows[-1].tolist() == [2.0, 0.0, 0.0]


def test_a_single_step_is_followed_until_it_can_be_no_stream() -> None:
    """P4: at rest at its target, a joint waits STREAM_END_AGE for the next sample of a stream."""
    one = OneJoint()
    one.step(2)
    one.joint.start(Law.POSITION)
    one.joint.step_to(1e-6)
    active = []
    for _ in range(300):
        one.step()
        active.append(bool(one.joint.active))
    last = max(k for k, followed in enumerate(active) if followed)
    assert active[: last + 1] == [True] * (last + 1)
    assert 0.249 <= (last + 1) * PERIOD <= 0.252
