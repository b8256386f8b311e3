# SPDX-License-Identifier: Apache-2.0
"""Paths through points: what is refused, and what they are between the points (SPEC T1, P13)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from control_board_ros.core.goals.path import Path, Sample, Spline, make_path
from control_board_ros.core.selection import RequestError

TIMES = [0.5, 1.0, 2.5]
POSITIONS = [[0.1, -1.0], [0.4, -0.5], [0.2, 0.25]]
VELOCITIES = [[0.3, 0.2], [-0.1, 0.6], [0.0, 0.0]]
ACCELERATIONS = [[1.0, -2.0], [0.5, 0.3], [-0.4, 0.0]]
NONE: list[list[float]] = [[], [], []]


def path(velocities: Any = NONE, accelerations: Any = NONE) -> Path:
    return make_path(("a", "b"), TIMES, POSITIONS, velocities, accelerations)


KINDS = {
    "linear": path(),
    "cubic": path(VELOCITIES),
    "quintic": path(VELOCITIES, ACCELERATIONS),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_meets_its_points(kind: str) -> None:
    """T1: positions always, velocities and accelerations where the points give them."""
    chosen = KINDS[kind]
    spline = Spline(chosen)
    for i, time in enumerate(TIMES[:-1]):
        here = spline.at(time)
        np.testing.assert_allclose(here.positions, POSITIONS[i], atol=1e-12)
        if chosen.velocities is not None:
            np.testing.assert_allclose(here.velocities, VELOCITIES[i], atol=1e-12)
        if chosen.accelerations is not None:
            np.testing.assert_allclose(here.accelerations, ACCELERATIONS[i], atol=1e-12)
        before = spline.at(time - 1e-9) if i else here
        np.testing.assert_allclose(before.positions, here.positions, atol=1e-8)
        if chosen.velocities is not None:
            np.testing.assert_allclose(before.velocities, VELOCITIES[i], atol=1e-6)
        if chosen.accelerations is not None:
            np.testing.assert_allclose(before.accelerations, ACCELERATIONS[i], atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_the_rates_are_those_of_the_positions(kind: str) -> None:
    """T1: velocity and acceleration are the derivatives of the position."""
    spline, h = Spline(KINDS[kind]), 1e-4
    for time in np.arange(0.5 + 3 * h, 2.5 - 3 * h, 0.037):
        if min(abs(time - t) for t in TIMES) < 2 * h:
            continue
        before, here, after = (spline.at(time + k * h) for k in (-1, 0, 1))
        slope = (after.positions - before.positions) / (2 * h)
        bend = (after.positions - 2 * here.positions + before.positions) / h**2
        np.testing.assert_allclose(here.velocities, slope, atol=1e-6)
        np.testing.assert_allclose(here.accelerations, bend, atol=1e-5)


def test_known_values_between_two_points() -> None:
    """T1: a line, a cubic and a quintic from 0 to 1 in 2 s, from rest to rest."""
    rest = [[0.0], [0.0]]
    for velocities, accels, quarter in (
        ([[], []], [[], []], 0.25),
        (rest, [[], []], 3 * 0.25**2 - 2 * 0.25**3),
        (rest, rest, 10 * 0.25**3 - 15 * 0.25**4 + 6 * 0.25**5),
    ):
        spline = Spline(make_path(["a"], [0.0, 2.0], [[0.0], [1.0]], velocities, accels))
        assert spline.at(0.5).positions[0] == pytest.approx(quarter, abs=1e-15)
        assert spline.at(1.0).positions[0] == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize("kind", KINDS)
def test_a_path_ends_at_rest(kind: str) -> None:
    """T1: from its last time on the path stays at the last point, with no velocity."""
    spline = Spline(KINDS[kind])
    for time in (2.5, 2.6, 1e6):
        end = spline.at(time)
        np.testing.assert_array_equal(end.positions, POSITIONS[-1])
        np.testing.assert_array_equal(end.velocities, 0.0)
        np.testing.assert_array_equal(end.accelerations, 0.0)


def present(position: float, velocity: float, acceleration: float) -> Sample:
    return Sample(*(np.full(2, value) for value in (position, velocity, acceleration)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("time", "left"), [(0.0, 3), (-1.0, 3), (0.7, 2), (2.0, 1)])
def test_joining_leaves_out_past_points(kind: str, time: float, left: int) -> None:
    """T1: the present leads to the points to come, each at its own time."""
    joined = KINDS[kind].joined(time, present(0.3, 0.25, -0.5))
    assert joined.times.tolist() == [time, *TIMES[-left:]]
    spline = Spline(joined)
    begin = spline.at(time)
    np.testing.assert_allclose(begin.positions, 0.3, atol=1e-12)
    if kind != "linear":
        np.testing.assert_allclose(begin.velocities, 0.25, atol=1e-12)
    if kind == "quintic":
        np.testing.assert_allclose(begin.accelerations, -0.5, atol=1e-12)
    for t, row in zip(TIMES[-left:], POSITIONS[-left:], strict=True):
        np.testing.assert_allclose(spline.at(t).positions, row, atol=1e-12)


def test_a_point_of_now_is_where_the_path_begins() -> None:
    """T1: a first point at the present time counts, not the present."""
    joined = KINDS["cubic"].joined(0.5, present(9.0, 9.0, 9.0))
    assert joined.times.tolist() == TIMES
    np.testing.assert_array_equal(joined.positions, POSITIONS)


def test_some_joints_of_a_path() -> None:
    """M4: what is left of a path when joints leave it is the same for the others."""
    whole, part = KINDS["quintic"], KINDS["quintic"].of(np.array([False, True]))
    for time in (0.6, 1.7, 3.0):
        for of_all, of_one in zip(Spline(whole).at(time), Spline(part).at(time), strict=True):
            np.testing.assert_allclose(of_all[1:], of_one, atol=1e-12)


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("times", "positions", "velocities", "accels", "text"),
    [
        ([], [], [], [], "no points"),
        ([1.0, 1.0], [[0.0, 0.0]] * 2, [[]] * 2, [[]] * 2, "point 1 .* rise from point to point"),
        ([1.0, 0.5], [[0.0, 0.0]] * 2, [[]] * 2, [[]] * 2, "point 1 has time_from_start 0.5 s"),
        ([-0.5], [[0.0, 0.0]], [[]], [[]], "point 0 has time_from_start -0.5 s; send 0 or more"),
        (
            [1.0, NAN],
            [[0.0, 0.0]] * 2,
            [[]] * 2,
            [[]] * 2,
            "point 1 has time_from_start nan; send",
        ),
        ([INF], [[0.0, 0.0]], [[]], [[]], "point 0 has time_from_start inf; send a number of s"),
        ([1.0], [[]], [[0.0, 0.0]], [[]], "no positions"),
        ([1.0], [[0.1]], [[]], [[]], "point 0 has 1 position for 2 joints"),
        ([1.0, 2.0], [[0.1, 0.1], []], [[]] * 2, [[]] * 2, "point 1 has no positions and others"),
        (
            TIMES,
            POSITIONS,
            [[0.0, 0.0], [], [0.0, 0.0]],
            NONE,
            "point 1 has no velocities and others have",
        ),
        (TIMES, POSITIONS, [[], [0.0], []], NONE, "point 0 has no velocities and others have"),
        (TIMES, POSITIONS, [[0.0, 0.0]] * 2 + [[0.0]], NONE, "point 2 has 1 velocity for 2"),
        (TIMES, POSITIONS, VELOCITIES, [[0.0, 0.0], [], []], "point 1 has no accelerations"),
        (TIMES, POSITIONS, VELOCITIES, [[0.0] * 3] * 3, "point 0 has 3 accelerations for 2"),
        (TIMES, POSITIONS, NONE, ACCELERATIONS, "accelerations and no velocities"),
        ([1.0], [[0.0, NAN]], [[]], [[]], "point 0 has nan in positions of b"),
        ([1.0], [[-1.1e9, 0.0]], [[]], [[]], "1100000000.0 in positions of a; send numbers from"),
        (TIMES, POSITIONS, [[0.0, 0.0], [INF, 0.0], [0.0, 0.0]], NONE, "point 1 has inf in veloc"),
        (TIMES, POSITIONS, VELOCITIES, [[0.0, 0.0], [0.0, -INF], [0.0, 0.0]], "-inf in accel"),
        (TIMES, POSITIONS, VELOCITIES[::-1], NONE, "velocity 0.3 of a; a trajectory ends at rest"),
    ],
)
def test_refusals_name_the_point(
    times: Any, positions: Any, velocities: Any, accels: Any, text: str
) -> None:
    """P13: lengths, times and numbers, each with its point and what would be right."""
    with pytest.raises(RequestError, match=text) as caught:
        make_path(("a", "b"), times, positions, velocities, accels)
    assert "\n" not in str(caught.value)


def test_ten_thousand_points_are_the_most() -> None:
    times = [0.001 * k for k in range(10_001)]
    rows: list[list[float]] = [[0.0]] * 10_001
    none: list[list[float]] = [[]] * 10_001
    assert make_path(("a",), times[:-1], rows[:-1], none[:-1], none[:-1]).duration == 9.999
    with pytest.raises(RequestError, match="it has 10001 points; send at most 10000"):
        make_path(("a",), times, rows, none, none)
