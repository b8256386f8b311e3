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
ROWS = ("track.position", "track.velocity", "track.acceleration")


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


def test_a_single_step_is_followed_until_it_can_be_no_stream() -> None:
    """P4: at rest at its target, a joint waits STREAM_END_AGE for the next sample of a stream."""
    one = OneJoint()
    one.step(2)
    one.joint.start(Law.POSITION)
    one.joint.step_to(1e-6)
    active = []
    for _ in range(300):
        one.step()
        active.append(bool(one.joint.reference.active))
    last = max(k for k, followed in enumerate(active) if followed)
    assert active[: last + 1] == [True] * (last + 1)
    assert 0.249 <= (last + 1) * PERIOD <= 0.252
