# SPDX-License-Identifier: Apache-2.0
"""core.laws, a stream's interval, lateness and time base: each step of it by itself (SPEC P4).

The methods are C functions where the laws are compiled; here they are the same as plain Python.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import pytest
from pure import LAWS

PERIOD = 0.001
FADE = 1.0 - 1.0 / 100.0
WIDE = 1e6


def stream(**changes: Any) -> Any:
    """A stream after its first sample, at 0, at rest."""
    made = LAWS.Stream()
    made.begin(0.0, 0.0, False)
    for name, value in changes.items():
        setattr(made, name, value)
    return made


def taken(
    made: Any, x: float, d: float, velocity: float | None = None, speed: float = 10.0
) -> None:
    """One more sample, ``d`` s after the last."""
    given = velocity is not None
    made.take(x, velocity or 0.0, given, d / PERIOD, PERIOD, speed, WIDE)


# --- beginning and ending ------------------------------------------------------------------------


def test_nothing_is_known_of_a_new_stream() -> None:
    made = LAWS.Stream()
    assert made.count == 0.0
    assert list(made.values) == list(made.numbers) == [0.0] * 6


@pytest.mark.parametrize("given", [True, False])
def test_it_begins_with_one_sample(given: bool) -> None:
    made = LAWS.Stream()
    for name in ("interval", "early", "late", "uneven", "gap", "missing", "on_grid"):
        setattr(made, name, 7.0)
    made.sum_k = made.sum_t = made.sum_kk = made.sum_kt = made.pushed = 7.0
    for base in (made.grid, made.sent):
        base.x = base.v = base.a = base.residual = 7.0
    made.begin(0.5, 0.2, given)
    assert (made.count, made.knots, made.pushed, made.weight) == (1.0, 1, 0.0, 1.0)
    assert (made.values[0], made.numbers[0]) == (0.5, 0.0)
    assert (made.last, made.last_velocity) == (0.5, 0.2)
    for base in (made.grid, made.sent):
        assert (base.x, base.v, base.a, base.residual) == (0.5, 0.2, 0.0, 0.0)
    for name in ("interval", "early", "late", "uneven", "gap", "missing"):
        assert getattr(made, name) == 0.0, name
    assert (made.sum_k, made.sum_t, made.sum_kk, made.sum_kt) == (0.0,) * 4
    assert made.on_grid is True
    assert made.flows is given


@pytest.mark.parametrize(
    ("x", "d", "interval", "goes_on"),
    [
        (0.05, 0.01, 0.01, True),
        (0.05, 0.0501, 0.01, False),  # more than five intervals
        (0.05, 0.0499, 0.01, True),
        (0.05, LAWS.STREAM_END_AGE + 0.001, 1.0, False),
        (0.05, LAWS.STREAM_END_AGE - 0.001, 1.0, True),
        (0.15, 0.01, 0.01, True),  # 10 rad/s in the interval and half of one
        (0.151, 0.01, 0.01, False),
        (-0.151, 0.01, 0.01, False),
    ],
)
def test_samples_continuing_a_stream(x: float, d: float, interval: float, goes_on: bool) -> None:
    """A sample after a long silence, or one that no joint could reach, begins anew."""
    made = stream(count=2.0, interval=interval, sum_kk=1.0)
    taken(made, x, d)
    assert made.count == (3.0 if goes_on else 1.0)
    assert made.last == x


@pytest.mark.parametrize(("x", "goes_on"), [(0.1, True), (0.101, False), (-0.101, False)])
def test_the_second_sample_may_be_as_far_as_the_joint_is_fast(x: float, goes_on: bool) -> None:
    made = stream()
    taken(made, x, 0.01)
    assert made.count == (2.0 if goes_on else 1.0)


def test_lateness_adds_to_the_reachable_range() -> None:
    made = stream(count=2.0, interval=0.01, late=0.01, sum_kk=1.0)
    taken(made, 0.25, 0.01)
    assert made.count == 3.0
    made = stream(count=2.0, interval=0.01, late=0.01, sum_kk=1.0)
    taken(made, 0.251, 0.01)
    assert made.count == 1.0


@pytest.mark.parametrize("velocity", [None, 0.3])
def test_a_leap_begins_with_the_velocity_that_comes_along(velocity: float | None) -> None:
    made = stream(count=2.0, interval=0.01)
    taken(made, 5.0, 0.01, velocity)
    assert (made.grid.x, made.grid.v) == (5.0, velocity or 0.0)
    assert made.flows is (velocity is not None)


# --- interval and lateness -----------------------------------------------------------------------


def regression(steps: list[tuple[float, float]]) -> float:
    """Slope of the arrivals over their numbers, the older ones fading by 1 % a sample."""
    k = np.concatenate([[0.0], np.cumsum([m for m, _ in steps])])
    t = np.concatenate([[0.0], np.cumsum([d for _, d in steps])])
    w = FADE ** np.arange(len(k) - 1, -1, -1)
    k_mean, t_mean = (w * k).sum() / w.sum(), (w * t).sum() / w.sum()
    return float((w * (k - k_mean) * (t - t_mean)).sum() / (w * (k - k_mean) ** 2).sum())


def test_the_interval_is_the_slope_of_the_arrivals() -> None:
    """Uneven, with samples lost; with what it says of gaps, unevenness and lateness."""
    random = np.random.default_rng(2)
    made, steps = stream(), list[tuple[float, float]]()
    gap = uneven = missing = 0.0
    for n in range(2, 60):
        d = float(random.uniform(0.015, 0.025)) * (2.0 if n in (20, 30) else 1.0)
        made.count = float(n)
        m = made.clock(0.0, d, PERIOD)
        steps.append((m, d))
        assert made.interval == pytest.approx(regression(steps))
        missing += 0.05 * (m - 1.0 - missing)
        gap = max(d, 0.99 * gap)
        uneven += (abs(d - m * made.interval) - uneven) / min(n - 1.0, 20.0)
        k, t = np.cumsum([(0.0, 0.0), *steps], axis=0)[-32:].T
        late = (t - t[-1]) - made.interval * (k - k[-1])
        assert (made.gap, made.missing) == pytest.approx((gap, missing))
        assert (made.uneven, made.early) == pytest.approx((uneven, late.min()))
        assert made.late == pytest.approx(0.1 * uneven - late.min())
        assert made.latest == pytest.approx(min(np.ptp(late), 0.8 * made.interval))
    assert {m for m, _ in steps} == {1.0, 2.0}


@pytest.mark.parametrize("swing", [0.0, 0.5], ids=["at rest", "of a sine"])
@pytest.mark.parametrize("change", [1.0, -1.0])
@pytest.mark.parametrize("where", [6, 12, 20])
def test_a_wrong_number_is_found_out(change: float, where: int, swing: float) -> None:
    """A loss that was not seen, or seen where none was: by 32 arrivals, where in doubt.

    Late by half an interval they tell it alone; by 0.8 of it where values tell, too.
    """
    random, true = np.random.default_rng(where), np.arange(32.0)
    true[where:] += 1.0  # a sample is lost
    told = true - change * (true >= true[where])
    arrivals = 0.05 * true - random.uniform(0.0, 0.04 if swing else 0.025, 32)
    arrivals[0] = 0.0
    made = stream(interval=0.05, uneven=0.008, heard=32, pace=1.0)

    def settle() -> None:
        for k in range(32):
            made.arrivals[k], made.places[k] = -arrivals[k], told[k]
            made.samples[k] = swing * math.sin(-0.1 * math.pi * (true[k] + 1.0))
        made.settle_phase(0.0, 0.05, 1.0, PERIOD)

    settle()
    assert list(made.places) == [0.0, *(told[:31] + 1.0)]  # all was as predicted
    made.surprise, made.grid.residual = 1.0, 7.0
    settle()
    assert list(made.places) == [0.0, *(true[:31] + 1.0)] or not swing
    assert made.places[31] == true[30] + 1.0
    assert made.surprise == 0.0
    assert made.grid.residual < 1e-2  # what predicted so badly is mended
    assert made.interval == pytest.approx(0.05, rel=0.02)


def test_an_interval_is_a_quarter_of_a_cycle_at_least() -> None:
    made = stream(count=2.0)
    made.clock(0.0, 0.0, PERIOD)
    assert made.interval == 0.25 * PERIOD


def test_where_too_many_are_missing_the_interval_is_longer() -> None:
    """More than a quarter of them after twenty samples: it is measured anew."""

    def lost(count: float, missing: float) -> Any:
        made = stream(count=count, missing=missing, interval=0.01, weight=5.0, mean=0.03)
        made.sum_k = made.sum_t = made.sum_kk = made.sum_kt = 3.0
        made.clock(0.0, 0.01, PERIOD)
        return made

    again = lost(21.0, 0.3)
    mean = 0.03 + (0.01 - 0.03) / 20.0
    assert again.mean == pytest.approx(mean)
    assert (again.missing, again.count) == (0.0, 8.0)
    assert again.weight == FADE + 1.0
    assert again.interval == pytest.approx((20.0 * mean + 0.5 * 0.01) / 20.5, rel=1e-3)
    for other in (lost(20.0, 0.3), lost(21.0, 0.25)):
        assert other.count in (20.0, 21.0)
        assert other.weight == 5.0 * FADE + 1.0
        assert other.missing == pytest.approx(0.95 * (0.3 if other.count == 20.0 else 0.25))


@pytest.mark.parametrize(
    ("count", "share"),
    [(4.0, None), (5.0, 1.0), (6.0, 2.0), (9.0, 5.0), (10.0, 6.0), (40.0, 6.0)],
)
def test_both_readings_are_judged_from_the_fifth_sample_on(
    count: float, share: float | None
) -> None:
    """By what they foretold; over as many samples as there were, six at most."""
    made = stream(count=count, interval=0.02, weight=1.0)
    made.grid.v, made.sent.v = 1.0, 2.0
    made.grid.residual = made.sent.residual = 0.5
    made.clock(0.1, 0.02, PERIOD)
    step = made.interval
    expected = [0.5, 0.5]
    if share is not None:
        errors = 0.1 - step * 1.0, 0.1 - 0.02 * 2.0
        expected = [0.5 + (error**2 - 0.5) / share for error in errors]
    assert (made.grid.residual, made.sent.residual) == pytest.approx(tuple(expected))


@pytest.mark.parametrize(
    ("on_grid", "grid", "sent", "period", "expected"),
    [
        (True, 0.9, 1.0, PERIOD, True),
        (True, 1.1, 1.0, PERIOD, False),
        (False, 0.6, 1.0, PERIOD, False),
        (False, 0.4, 1.0, PERIOD, True),
        (True, 9.0, 1.0, 0.015, True),  # samples come in each cycle: there is one time
        (True, 9.0, 1.0, 0.012, False),
    ],
)
def test_the_reading_with_the_smaller_residual_is_used(
    on_grid: bool, grid: float, sent: float, period: float, expected: bool
) -> None:
    """To come back to the grid it must be twice as good."""
    made = stream(count=1000.0, interval=0.02, weight=1.0, on_grid=on_grid)
    made.grid.residual, made.sent.residual = grid, sent
    x = made.grid.at(0.02)
    made.clock(x, 0.02, period)
    assert bool(made.on_grid) is expected


# --- how many intervals --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("d", "late", "expected"),
    [(0.01, 0.0, 1.0), (0.014, 0.0, 1.0), (0.019, 0.0, 2.0), (0.014, 0.005, 2.0),
     (0.049, 0.0, 5.0), (0.059, 0.0, 6.0), (0.001, 0.0, 1.0)],
)  # fmt: skip
def test_a_gap_counts_as_lost_samples(d: float, late: float, expected: float) -> None:
    """Those that leave the arrival nearest to its grid; six at most."""
    made = stream(count=1000.0, interval=0.01, late=late)
    assert made.intervals(0.0, d) == expected


def test_a_late_sample_is_not_a_lost_one() -> None:
    """As late as others were is nothing; and the first losses are less likely than late ones."""
    made = stream(count=1000.0, interval=0.01, latest=0.007)
    assert [made.intervals(0.0, d) for d in (0.016, 0.017, 0.018)] == [1.0, 1.0, 1.0]
    assert made.intervals(0.0, 0.021) == 2.0
    made.count = 7.0
    assert made.intervals(0.0, 0.021) == 1.0


@pytest.mark.parametrize(("count", "d", "expected"), [
    (6.0, 0.0219, 1.0), (6.0, 0.0221, 2.0), (7.0, 0.0219, 2.0),
])  # fmt: skip
def test_at_first_a_gap_is_one_interval(count: float, d: float, expected: float) -> None:
    made = stream(count=count, interval=0.01)
    made.grid.residual = made.sent.residual = 1.0
    assert made.intervals(0.0, d) == expected


@pytest.mark.parametrize(
    ("d", "x", "expected"),
    [
        (0.018, 2.0, 2.0),  # between one and two intervals, at the place of two
        (0.018, 1.0, 1.0),  # at the place of one
        (0.018, 1.9, 2.0),
        (0.018, 1.1, 1.0),
        (0.026, 3.0, 3.0),
        (0.026, 2.0, 2.0),
        (0.011, 0.0, 1.0),  # never none
    ],
)
def test_the_value_determines_the_number_of_samples(d: float, x: float, expected: float) -> None:
    """Of a motion of 1 rad an interval, whose arrival leaves two numbers open."""
    made = stream(count=1000.0, interval=0.01, latest=0.007)
    made.grid.v, made.grid.residual = 100.0, 1e-4
    assert made.intervals(x, d) == expected
    made.grid.residual = 1e6  # predictions tell nothing
    assert made.intervals(x, d) == (1.0 if d < 0.02 else 2.0)


def test_the_value_is_not_used_for_the_first_seven_samples() -> None:
    for count, expected in ((7.0, 1.0), (8.0, 2.0)):
        made = stream(count=count, interval=0.01, latest=0.007)
        made.grid.v, made.grid.residual = 100.0, 1e-4
        assert made.intervals(2.0, 0.018) == expected


# --- what is kept --------------------------------------------------------------------------------


def kept(made: Any) -> list[tuple[float, float, float, float]]:
    """Value, number, time on the grid and as sent of each knot."""
    rows = made.values, made.numbers, made.grid.times, made.sent.times
    return [tuple(round(row[k], 9) for row in rows) for k in range(made.knots)]


def test_samples_are_kept_newest_first() -> None:
    made = stream(interval=0.1)
    for n, (x, d, m) in enumerate([(1.0, 0.12, 1.0), (2.0, 0.21, 2.0), (3.0, 0.09, 1.0)]):
        made.keep(x, d, m)
        assert (made.knots, made.pushed) == (n + 2, n + 1.0)
    assert kept(made) == [
        (3.0, 0.0, 0.0, 0.0),
        (2.0, -1.0, -0.1, -0.09),
        (1.0, -3.0, -0.3, -0.3),
        (0.0, -4.0, -0.4, -0.42),
    ]


def test_six_are_kept() -> None:
    made = stream(interval=0.1)
    for k in range(1, 9):
        made.keep(float(k), 0.1, 1.0)
    assert [row[0] for row in kept(made)] == [8.0, 7.0, 6.0, 5.0, 4.0, 3.0]
    assert [row[1] for row in kept(made)] == [0.0, -1.0, -2.0, -3.0, -4.0, -5.0]


@pytest.mark.parametrize(
    ("interval", "ways", "count"),
    [
        (0.1, (0.1, 0.05), 3),
        (0.02, (0.02, 0.007), 3),  # 0.6 of the interval, 12 ms at least
        (0.002, (0.002,) * 5, 2),
        (0.002, (0.002,) * 7, 3),
    ],
)
def test_a_close_sample_replaces_the_last(
    interval: float, ways: tuple[float, ...], count: int
) -> None:
    """Where the one before it is nearer than that, on both readings."""
    made = stream(interval=interval)
    for k, d in enumerate(ways):
        made.keep(float(k + 1), d, max(1.0, round(d / interval)))
    assert made.knots == count
    assert made.values[0] == float(len(ways))
    assert (made.numbers[0], made.grid.times[0], made.sent.times[0]) == (0.0, 0.0, 0.0)


def test_near_by_its_arrival_alone_is_not_near_on_the_grid() -> None:
    for on_grid, count in ((True, 3), (False, 2)):
        made = stream(interval=0.02, on_grid=on_grid)
        made.keep(1.0, 0.003, 1.0)  # late ones come in a burst
        made.keep(2.0, 0.003, 1.0)
        assert made.knots == count


def test_the_first_knots_count_the_more_in_how_it_turns() -> None:
    """1/(1 + k/2) of the k-th, a twelfth at least; a replaced one does not count again."""
    made = stream(interval=0.1)
    for k in range(1, 31):
        made.keep(float(k), 0.1, 1.0)
        assert made.share == pytest.approx(1.0 / min(0.5 * k + 1.0, 12.0))
    made.keep(31.0, 0.01, 0.1)
    made.keep(32.0, 0.0, 0.0)
    assert made.share == 0.0


# --- what is made of it --------------------------------------------------------------------------


def test_velocities_that_come_along_need_no_fit() -> None:
    """Acceleration from the last two, over the time that each reading gives them."""
    made = stream(interval=0.02, last_velocity=0.4)
    made.values[0] = 0.7
    made.take_velocity(0.5, 0.025, 2.0, 100.0)
    for base, time in ((made.grid, 0.04), (made.sent, 0.025)):
        assert (base.x, base.v) == (0.7, 0.5)
        assert base.a == pytest.approx(0.1 / time)
    made.take_velocity(0.6, 0.0, 1.0, 100.0)  # in one cycle
    assert made.sent.a == pytest.approx(0.2 / 0.02)


@pytest.mark.parametrize(
    ("interval", "uneven", "gap", "patience"),
    [
        (0.1, 0.0, 0.1, 0.15),  # 1.5 intervals
        (0.1, 0.0, 0.2, 0.24),  # 1.2 of the longest gap of late
        (0.002, 0.0, 0.002, 0.012),  # of 8 ms at least
        (0.1, 0.0099, 0.2, 0.24),
        (0.1, 0.0101, 0.2, 1.1 * 0.2 + 0.2),  # uneven: until three in a row are missing
        (0.1, 0.05, 0.2, 1.1 * 0.275 + 0.2),
    ],
)
def test_patience(interval: float, uneven: float, gap: float, patience: float) -> None:
    made = stream(interval=interval, uneven=uneven, gap=gap)
    assert made.patience() == pytest.approx(patience)


def test_the_velocity_is_that_of_the_reading_believed() -> None:
    made = stream(flows=True)
    made.grid.v, made.sent.v = 1.0, 2.0
    for on_grid, velocity in ((True, 1.0), (False, 2.0)):
        made.on_grid = on_grid
        assert made.velocity() == velocity
    made.flows = False
    assert made.velocity() == 0.0


@pytest.mark.parametrize("flows", [True, False])
def test_slow_streams_are_steps(flows: bool) -> None:
    """Where it begins below one interval, and ends above another one."""
    least = LAWS.MAX_STREAM_INTERVAL if flows else LAWS.MAX_BEGINNING_INTERVAL
    for factor, expected in ((0.99, True), (1.01, False)):
        d = factor * least
        made = stream()
        taken(made, 0.01, d)
        made.flows = flows
        taken(made, 0.02, d)
        assert made.interval == pytest.approx(d)
        assert made.uneven == pytest.approx(0.0)
        assert bool(made.flows) is expected


@pytest.mark.parametrize("velocity", [None, 0.3])
def test_two_samples_are_steps_unless_they_have_velocities(velocity: float | None) -> None:
    made = stream()
    taken(made, 0.001, 0.01, velocity)
    assert bool(made.flows) is (velocity is not None)
    taken(made, 0.002, 0.01, velocity)
    assert made.flows


@pytest.mark.parametrize(("ways", "flows"), [((0.9, 1.15), True), ((0.95, 1.1), False)])
def test_an_uneven_stream_may_be_slower(ways: tuple[float, float], flows: bool) -> None:
    """By half its unevenness: both are 1.025 of the limit in the mean."""
    made = stream()
    for k, way in enumerate(ways):
        taken(made, 0.01 * (k + 1), way * LAWS.MAX_BEGINNING_INTERVAL)
    assert made.interval > LAWS.MAX_BEGINNING_INTERVAL
    assert bool(made.flows) is flows


def test_positions_alone_are_fitted_on_both_readings() -> None:
    """As sent with the five newest where jitter differs from motion most."""
    for interval, few in ((0.02, True), (0.014, False), (0.03, False)):
        made = stream()
        random = np.random.default_rng(5)
        for k in range(1, 9):
            d = interval * (1.0 + float(random.uniform(-0.05, 0.05)))
            before = made.grid.turning, made.sent.turning
            taken(made, 0.1 * math.sin(2.0 * interval * k), d)
        assert made.knots == 6
        bases = (made.grid, 6, before[0]), (made.sent, 5 if few else 6, before[1])
        for base, count, turning in bases:
            alone = LAWS.TimeBase()
            alone.times[:] = array("d", base.times)
            alone.turning = turning
            alone.fit(made.values, count, WIDE, 0.0)
            assert (base.x, base.v, base.a) == (alone.x, alone.v, alone.a)


def test_samples_of_each_cycle_have_one_reading() -> None:
    """As sent is not fitted there."""
    made = stream()
    for k in range(1, 100):
        taken(made, 0.001 * k, PERIOD)
    assert made.on_grid
    assert made.grid.v == pytest.approx(1.0)
    assert made.sent.v == 0.0
    assert (made.last, made.last_velocity) == (0.099, 0.0)
