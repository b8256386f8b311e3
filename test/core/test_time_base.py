# SPDX-License-Identifier: Apache-2.0
"""core.laws, the motion that the samples of a stream show: each step of it by itself (SPEC P4).

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
WIDE = 1e6


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


def curved(values: Any, *times: float, share: float = 1.0, **changes: float) -> Any:
    """After one fit to samples of these times."""
    made = base(*times, **changes)
    made.fit(knots(*(values(t) for t in times)), len(times), WIDE, share)
    return made


EVEN, UNEVEN = (0.0, -0.1, -0.2, -0.3), (0.0, -0.03, -0.2, -0.24, -0.4)


@pytest.mark.parametrize("times", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("phase", [0.0, 0.6, 2.0, -1.0])
@pytest.mark.parametrize("omega", [0.5, 2.0, 4.0])
def test_samples_of_a_sine_show_its_frequency(
    omega: float, phase: float, times: tuple[float, ...]
) -> None:
    """Step by step, as Gauss and Newton do."""
    made = base(*times)
    values = knots(*(math.sin(omega * t + phase) for t in times))
    for _ in range(8):
        made.fit(values, len(times), WIDE, 1.0)
    assert made.turning == pytest.approx(omega**2, rel=5e-3)
    assert made.x == pytest.approx(math.sin(phase), abs=1e-3)
    assert made.v == pytest.approx(omega * math.cos(phase), abs=5e-3)


def test_it_turns_no_faster_than_samples_can_show() -> None:
    """ω ≤ 3 over their span; and what runs away does not turn."""
    fast = curved(lambda t: math.sin(9.0 * t), *EVEN, share=0.5, turned=1e3, run=1.0)
    assert fast.turning == pytest.approx(100.0)
    assert curved(lambda t: math.exp(5.0 * t), *EVEN).turning == 0.0


def test_older_samples_fade() -> None:
    """Σ of ω² and of weights, each step with its share."""

    def sine(t: float) -> float:
        return math.sin(2.0 * t + 0.6)

    alone = curved(sine, *UNEVEN, turning=3.0)
    made = curved(sine, *UNEVEN, share=0.25, turning=3.0, turned=8.0, run=2.0)
    assert alone.run > 0.0
    assert made.turned == pytest.approx(6.0 + alone.turned)
    assert made.run == pytest.approx(1.5 + alone.run)
    assert made.turning == pytest.approx(made.turned / made.run)


def test_large_residuals_say_that_it_does_not_turn() -> None:
    made = curved(lambda t: math.sin(2.0 * t + 0.6), *EVEN, residual=0.3)
    assert made.turned > 0.0
    assert made.turning == pytest.approx(made.turned / (made.run + LAWS.DOUBT * 0.3))


@pytest.mark.parametrize(("times", "share"), [(EVEN, 0.0), (EVEN[:3], 1.0), ((0.0,) * 4, 1.0)])
def test_what_says_nothing_of_it_changes_nothing(times: tuple[float, ...], share: float) -> None:
    """A sample that was there before, fewer than four, or all of them at once."""
    made = curved(lambda t: t**3, *times, share=share, turned=8.0, run=2.0, turning=3.0)
    assert (made.turned, made.run, made.turning) == (8.0, 2.0, 3.0)


def test_constant_samples_have_no_frequency() -> None:
    made = curved(lambda _: 1.0, *EVEN, turning=5.0)
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
    made.fit(knots(*(truth.at(t) for t in times)), count, 100.0, 0.0)
    assert (made.x, made.v, made.a) == pytest.approx((0.7, -0.4, 1.5))


def test_noise_is_met_by_least_squares() -> None:
    random = np.random.default_rng(4)
    for turning in (0.0, 16.0):
        times = np.array([0.0, -0.05, -0.13, -0.2, -0.31, -0.4])
        values = random.normal(size=6) * 0.1
        made = base(*times, turning=turning)
        made.fit(knots(*values), 6, 1e3, 0.0)
        columns = [[1.0, LAWS.sine(turning, t), LAWS.versine(turning, t)] for t in times]
        expected, *_ = np.linalg.lstsq(np.array(columns), values, rcond=None)
        assert (made.x, made.v, made.a) == pytest.approx(tuple(expected))


def test_two_samples_have_a_velocity() -> None:
    made = base(0.0, -0.2, a=9.0)
    made.fit(knots(1.0, 0.5), 2, 100.0, 0.0)
    assert (made.x, made.v, made.a) == (1.0, 2.5, 0.0)


def test_samples_at_one_time_have_none() -> None:
    """The velocity stays; and where they are too few times for a parabola it is the mean one."""
    made = base(0.0, 0.0, 0.0, v=3.0, a=9.0)
    made.fit(knots(1.0, 0.5, 0.2), 3, 100.0, 0.0)
    assert (made.x, made.v, made.a) == (1.0, 3.0, 0.0)
    made = base(0.0, 0.0, -0.2, a=9.0)
    made.fit(knots(1.0, 1.0, 0.5), 3, 100.0, 0.0)
    assert (made.x, made.v, made.a) == (1.0, 2.5, 0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_beyond_the_acceleration_limit_the_last_two_samples_count(way: float) -> None:
    """Beyond 1.5 of the limit: the last two samples are believed."""
    times = (0.0, -0.1, -0.2)
    values = knots(*(way * (1.0 + t + 0.5 * 15.0 * t * t) for t in times))
    made = base(*times)
    made.fit(values, 3, 10.01, 0.0)
    assert made.a == pytest.approx(way * 15.0)
    made.fit(values, 3, 9.99, 0.0)
    assert (made.x, made.a) == (way, 0.0)
    assert made.v == pytest.approx(way * 0.25)
    two = base(0.0, 0.0, -0.1, -0.2)
    two.fit(knots(2.0, 1.0, 3.0, -5.0), 4, 1e-3, 0.0)
    assert (two.x, two.v, two.a) == (2.0, 0.0, 0.0)
