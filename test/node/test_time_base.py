# SPDX-License-Identifier: Apache-2.0
"""One time base: stamps never go backwards and are as far apart as their readings."""

from __future__ import annotations

import itertools

import pytest

from control_board_ros.node.loop.timing import (
    MAX_LEAD_NS,
    NANOSECONDS,
    OFFSET_GROWTH,
    Divider,
    TimeBase,
)

START = 1_700_000_000 * NANOSECONDS
PERIOD = 0.001


def run(base: TimeBase, begin: float, cycles: int, system: int) -> list[int]:
    """Stamps of some cycles at real time, corrected in every tenth."""
    stamps = []
    for k in range(cycles):
        now = begin + k * PERIOD
        if k % 10 == 0:
            base.note(now, system + round(k * PERIOD * NANOSECONDS))
        stamps.append(base.stamp(now))
    return stamps


def made() -> TimeBase:
    return TimeBase(simulated=False, shrinkage=round(0.5 * PERIOD * NANOSECONDS))


def test_simulated_time_is_the_stamp() -> None:
    """With simulated time, the system's clock does not count."""
    base = TimeBase(simulated=True, shrinkage=1)
    base.note(1.5, START)
    assert base.stamp(2.25) == 2_250_000_000
    assert not base.follows_system


def test_the_first_reading_sets_the_offset() -> None:
    """From then on stamps are the system's time, and exactly evenly spaced."""
    base = made()
    stamps = run(base, 0.0, 100, START)
    assert stamps[0] == START
    assert {b - a for a, b in itertools.pairwise(stamps)} == {1_000_000}


def test_lost_time_is_made_up_smoothly() -> None:
    """Skipped periods: the offset grows by a tenth of the time that passes, until it is right."""
    base = made()
    run(base, 0.0, 100, START)
    lost = 200_000_000
    stamps = run(base, 0.1, 4000, START + 100_000_000 + lost)
    steps = [b - a for a, b in itertools.pairwise(stamps)]
    assert min(steps) == 1_000_000
    assert max(steps) <= 1_000_000 + OFFSET_GROWTH * 10_000_000
    assert stamps[-1] == START + lost + 4_099_000_000


def test_a_clock_that_is_set_back_slows_stamps_down() -> None:
    """They never go backwards, and come together with the clock again."""
    base = made()
    run(base, 0.0, 100, START)
    stamps = run(base, 0.1, 10_000, START + 100_000_000 - 100_000_000)
    assert all(b > a for a, b in itertools.pairwise(stamps))
    assert stamps[-1] == START + 9_999_000_000


@pytest.mark.parametrize("ahead", [MAX_LEAD_NS + 10**9, 3600 * NANOSECONDS])
def test_a_clock_far_ahead_is_followed_at_once(ahead: int) -> None:
    """After a suspend or a setting of the clock, stamps jump, forwards only."""
    base = made()
    run(base, 0.0, 100, START)
    assert run(base, 0.1, 1, START + ahead)[0] == START + ahead


@pytest.mark.parametrize("ahead", [500_000_000, 60 * NANOSECONDS])
def test_after_a_pause_stamps_jump_to_the_clock(ahead: int) -> None:
    """A joint at rest has no speed that a jump could falsify; once, and never backwards."""
    base = made()
    run(base, 0.0, 100, START)
    base.resume()
    assert run(base, 0.1, 1, START + 100_000_000 + ahead)[0] == START + 100_000_000 + ahead
    base.resume()
    before = base.stamp(0.1)
    assert run(base, 0.101, 1, START)[0] > before


def test_a_free_time_base_continues_by_itself() -> None:
    """Once simulated and real time have parted, only simulated time counts."""
    base = made()
    run(base, 0.0, 100, START)
    base.free()
    stamps = run(base, 0.1, 1000, START + 10**12)
    assert stamps[0] == START + 100_000_000
    assert {b - a for a, b in itertools.pairwise(stamps)} == {1_000_000}


@pytest.mark.parametrize(
    ("rate", "control_rate"), [(333.0, 1000.0), (300.0, 1000.0), (99.9, 1000.0), (1000.0, 1000.0)]
)
def test_a_divider_keeps_the_average(rate: float, control_rate: float) -> None:
    """The corrections in ten thousand cycles, each at most one away from its even place."""
    divider = Divider(rate, control_rate)
    picked = [k for k in range(10_000) if divider.pick()]
    assert picked[0] == 0
    assert len(picked) == pytest.approx(10_000 * rate / control_rate, abs=1)
    for n, k in enumerate(picked):
        assert abs(k - n * control_rate / rate) < 1.0 + 1e-6


def test_a_divider_picks_no_more_than_there_are() -> None:
    """What is in force is the control rate."""
    divider = Divider(500.0, 100.0)
    assert divider.rate == 100.0
    assert all(divider.pick() for _ in range(10))
