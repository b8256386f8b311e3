# SPDX-License-Identifier: Apache-2.0
"""laws.py, the motion that the samples of a stream show: each step of it by itself (SPEC P4).

The methods are C functions where the laws are compiled; here they are the same as plain Python.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import pytest
from pure import LAWS

KNOTS = 6


def base(*times: float, **changes: float) -> Any:
    """A time base whose samples were made at these times, s, the last one at 0."""
    made = LAWS.TimeBase()
    made.times[: len(times)] = array("d", times)
    for name, value in changes.items():
        setattr(made, name, value)
    return made


def knots(*values: float) -> memoryview:
    return memoryview(array("d", [*values, *[0.0] * (KNOTS - len(values))]))


def test_sine_and_versine_of_a_turning_motion() -> None:
    """sin(ωt)/ω and (1 − cos ωt)/ω²; without turning t and t²/2."""
    for t in (-0.5, 0.0, 0.3, 1.0):
        assert LAWS.sine(0.0, t) == t
        assert LAWS.versine(0.0, t) == 0.5 * t * t
    for omega in (0.5, 1.0, 2.0):
        for t in (-0.5, 0.2, 0.5, 1.0 / omega):
            assert LAWS.sine(omega**2, t) == pytest.approx(math.sin(omega * t) / omega, rel=4e-6)
            versine = (1.0 - math.cos(omega * t)) / omega**2
            assert LAWS.versine(omega**2, t) == pytest.approx(versine, rel=8e-7)


def test_it_starts_with_one_sample() -> None:
    made = base(7.0, -1.0, x=9.0, v=9.0, a=9.0, turning=9.0, turned=9.0, run=9.0, residual=9.0)
    made.clear(0.5, -0.2)
    assert (made.x, made.v, made.times[0]) == (0.5, -0.2, 0.0)
    assert (made.a, made.turning, made.turned, made.run, made.residual) == (0.0,) * 5
    fresh = LAWS.TimeBase()
    assert list(fresh.times) == [0.0] * KNOTS
    assert (fresh.x, fresh.v, fresh.a, fresh.turning, fresh.run) == (0.0,) * 5


def test_continuation_of_the_motion() -> None:
    """X + v S + a C."""
    made = base(x=1.0, v=2.0, a=-3.0)
    assert made.at(0.5) == pytest.approx(1.0 + 1.0 - 0.375)
    made.turning = 4.0
    sine, versine = math.sin(1.0) / 2.0, (1.0 - math.cos(1.0)) / 4.0
    assert made.at(0.5) == pytest.approx(1.0 + 2.0 * sine - 3.0 * versine, rel=1e-5)


def test_residuals_are_mean_squares() -> None:
    made = base()
    made.judge(2.0, 0.25)
    assert made.residual == 1.0
    made.judge(-4.0, 0.5)
    assert made.residual == 0.5 * 1.0 + 0.5 * 16.0


def test_acceleration_by_the_velocity_before() -> None:
    """Of an even change; of a motion that turns, that of now; at most what a joint can."""
    made = base(v=0.5)
    made.speed_up(0.3, 0.1, 100.0)
    assert made.a == pytest.approx(2.0)
    made.speed_up(0.3, 0.1, 1.5)
    assert made.a == 1.5
    made.speed_up(0.7, 0.1, 1.5)
    assert made.a == -1.5
    omega, phase, before = 3.0, 0.7, 0.2
    made = base(v=math.cos(phase), turning=omega**2)
    made.speed_up(math.cos(phase - omega * before), before, 100.0)
    assert made.a == pytest.approx(-omega * math.sin(phase), rel=1e-4)
    assert made.turning == omega**2


def test_motion_too_fast_to_resolve_is_treated_as_uniform() -> None:
    """Beyond ω²τ² = 3."""
    made = base(v=0.5, turning=301.0)
    made.speed_up(0.3, 0.1, 100.0)
    assert (made.turning, made.a) == (0.0, pytest.approx(2.0))
    made = base(v=0.5, turning=299.0)
    made.speed_up(0.3, 0.1, 100.0)
    assert made.turning == 299.0
    assert made.a != pytest.approx(2.0)


def test_a_velocity_of_zero_is_rest() -> None:
    """It is given so: the motion ends there."""
    made = base(v=0.0, a=5.0, turning=4.0)
    made.speed_up(0.3, 0.1, 100.0)
    assert (made.a, made.at(1.0)) == (0.0, 0.0)


# --- how it turns --------------------------------------------------------------------------------


def turned(omega: float, *times: float, phase: float = 0.6, share: float = 1.0) -> Any:
    """After a sine with samples at these times."""
    made = base(*times)
    made.turn(knots(*(math.sin(omega * t + phase) for t in times)), len(times), share)
    return made


@pytest.mark.parametrize("phase", [0.0, 0.6, 2.0, -1.0])
@pytest.mark.parametrize("omega", [0.5, 2.0, 6.0])
def test_four_even_samples_of_a_sine_show_its_frequency(omega: float, phase: float) -> None:
    """ω² to within its series: u² = s + s²/3 + 8 s³/45, s = sin² u."""
    made = turned(omega, 0.0, -0.1, -0.2, -0.3, phase=phase)
    s = math.sin(omega * 0.05) ** 2
    series = 4.0 * s * (1.0 + s * (1.0 / 3.0 + s * 8.0 / 45.0)) / 0.01
    assert made.turning == pytest.approx(series, rel=1e-9)
    assert made.turning == pytest.approx(omega**2, rel=4e-4)


def test_it_turns_no_faster_than_samples_can_show() -> None:
    """R ≤ 1.5; and what runs away does not turn."""
    made = turned(18.0, 0.0, -0.1, -0.2, -0.3)
    s = 3.0 * 1.5 / (4.0 * 2.5)
    assert made.turning == pytest.approx(400.0 * s * (1.0 + s * (1.0 / 3.0 + s * 8.0 / 45.0)))
    made = base(0.0, -0.1, -0.2, -0.3)
    made.turn(knots(*(math.exp(5.0 * t) for t in made.times[:4])), 4, 1.0)
    assert made.turning == 0.0


def test_older_samples_fade() -> None:
    """Σ −jerk v and Σ v², each step with its share."""
    made = base(0.0, -0.1, -0.2, -0.3, turned=8.0, run=2.0)
    x = [0.0, -0.1, -0.3, -0.4]
    rates = [(x[k] - x[k + 1]) / 0.1 for k in range(3)]
    jerk = 2.0 * ((rates[0] - rates[1]) / 0.2 - (rates[1] - rates[2]) / 0.2) / 0.1
    velocity = (x[0] - x[3]) / 0.3
    made.turn(knots(*x), 4, 0.25)
    assert made.turned == pytest.approx(6.0 - jerk * velocity)
    assert made.run == pytest.approx(1.5 + velocity**2)
    r = min(max(made.turned / made.run * 0.01 / 3.0, 0.0), 1.5)
    s = 3.0 * r / (4.0 * (1.0 + r))
    assert made.turning == pytest.approx(400.0 * s * (1.0 + s * (1.0 / 3.0 + s * 8.0 / 45.0)))


def test_uneven_samples_are_reckoned_with() -> None:
    """Each difference has its own time; τ is their mean."""
    times = [0.0, -0.08, -0.2, -0.3]
    made = base(*times)
    x = [1.0, 0.8, 0.9, 0.2]
    made.turn(knots(*x), 4, 1.0)
    rates = [(x[k] - x[k + 1]) / (times[k] - times[k + 1]) for k in range(3)]
    jerk = (rates[0] - rates[1]) / 0.2 - (rates[1] - rates[2]) / 0.22
    assert made.turned == pytest.approx(-2.0 * jerk / 0.1 * (0.8 / 0.3))
    assert made.run == pytest.approx((0.8 / 0.3) ** 2)


@pytest.mark.parametrize(
    "times",
    [(0.0, -0.049, -0.2, -0.3), (0.0, -0.1, -0.149, -0.3), (0.0, -0.15, -0.251, -0.3), (0.0,) * 4],
)
def test_samples_too_uneven_are_not_used(times: tuple[float, ...]) -> None:
    """One interval below half their mean; or all of them at once."""
    made = base(*times, turned=8.0, run=2.0, turning=3.0)
    made.turn(knots(1.0, 0.0, 1.0, 0.0), 4, 0.5)
    assert (made.turned, made.run, made.turning) == (8.0, 2.0, 3.0)


def test_a_last_sample_that_is_only_just_there_is_left_out() -> None:
    """Where there are more than four; nearer than half the interval before."""
    omega, times = 2.0, (0.0, -0.04, -0.14, -0.24, -0.34)
    values = knots(*(math.sin(omega * t + 0.6) for t in times))
    made = base(*times)
    made.turn(values, 5, 1.0)
    s = math.sin(omega * 0.05) ** 2
    series = 400.0 * s * (1.0 + s * (1.0 / 3.0 + s * 8.0 / 45.0))
    assert made.turning == pytest.approx(series, rel=1e-9)
    four = base(*times)
    four.turn(values, 4, 1.0)
    assert four.run == pytest.approx(((values[0] - values[3]) / 0.24) ** 2)
    even = base(0.0, -0.06, -0.16, -0.26, -0.36)  # not near enough: it counts
    even.turn(values, 5, 1.0)
    alone = base(0.0, -0.06, -0.16, -0.26)
    alone.turn(values, 4, 1.0)
    assert (even.turned, even.run) == (alone.turned, alone.run)
    assert even.run != 0.0


def test_constant_samples_have_no_frequency() -> None:
    made = base(0.0, -0.1, -0.2, -0.3, turning=5.0)
    made.turn(knots(1.0, 1.0, 1.0, 1.0), 4, 0.5)
    assert made.turning == 0.0
    assert made.run == 0.0


# --- the fit -------------------------------------------------------------------------------------


@pytest.mark.parametrize("turning", [0.0, 9.0])
@pytest.mark.parametrize("count", [3, 4, 6])
def test_a_motion_of_its_form_is_found(count: int, turning: float) -> None:
    """X + v S + a C, whatever the times of the samples."""
    times = [0.0, -0.05, -0.16, -0.2, -0.33, -0.4][:count]
    truth = base(x=0.7, v=-0.4, a=1.5, turning=turning)
    made = base(*times, turning=turning)
    made.fit(knots(*(truth.at(t) for t in times)), count, 100.0)
    assert (made.x, made.v, made.a) == pytest.approx((0.7, -0.4, 1.5))


def test_noise_is_met_by_least_squares() -> None:
    random = np.random.default_rng(4)
    for turning in (0.0, 16.0):
        times = np.array([0.0, -0.05, -0.13, -0.2, -0.31, -0.4])
        values = random.normal(size=6) * 0.1
        made = base(*times, turning=turning)
        made.fit(knots(*values), 6, 1e3)
        columns = [[1.0, LAWS.sine(turning, t), LAWS.versine(turning, t)] for t in times]
        expected, *_ = np.linalg.lstsq(np.array(columns), values, rcond=None)
        assert (made.x, made.v, made.a) == pytest.approx(tuple(expected))


def test_two_samples_have_a_velocity() -> None:
    made = base(0.0, -0.2, a=9.0)
    made.fit(knots(1.0, 0.5), 2, 100.0)
    assert (made.x, made.v, made.a) == (1.0, 2.5, 0.0)


def test_samples_at_one_time_have_none() -> None:
    """The velocity stays; and where they are too few times for a parabola it is the mean one."""
    made = base(0.0, 0.0, 0.0, v=3.0, a=9.0)
    made.fit(knots(1.0, 0.5, 0.2), 3, 100.0)
    assert (made.x, made.v, made.a) == (1.0, 3.0, 0.0)
    made = base(0.0, 0.0, -0.2, a=9.0)
    made.fit(knots(1.0, 1.0, 0.5), 3, 100.0)
    assert (made.x, made.v, made.a) == (1.0, 2.5, 0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_beyond_the_acceleration_limit_the_last_two_samples_count(way: float) -> None:
    """Beyond 1.5 of the limit: the last two samples are believed."""
    times = (0.0, -0.1, -0.2)
    values = knots(*(way * (1.0 + t + 0.5 * 15.0 * t * t) for t in times))
    made = base(*times)
    made.fit(values, 3, 10.01)
    assert made.a == pytest.approx(way * 15.0)
    made.fit(values, 3, 9.99)
    assert (made.x, made.a) == (way, 0.0)
    assert made.v == pytest.approx(way * 0.25)
    two = base(0.0, 0.0, -0.1, -0.2)
    two.fit(knots(2.0, 1.0, 3.0, -5.0), 4, 1e-3)
    assert (two.x, two.v, two.a) == (2.0, 0.0, 0.0)
