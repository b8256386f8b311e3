# SPDX-License-Identifier: Apache-2.0
"""monitor.py alone: bounds, travel, overrun and heat of one joint, to the number (SPEC F1, F6)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from control_board_ros.core.terms.measurement import CREDIBLE, MOTOR_ROWS, Array
from control_board_ros.core.terms.measurement import ROWS as READ
from control_board_ros.core.watch.causes import ROWS_OF, Check
from control_board_ros.core.watch.monitor import JointMonitor, Monitor

SLOW, PERIOD, FORGET = 4, 0.01, 0.5
ELAPSED = SLOW * PERIOD
READINGS = [check.name.lower() for check in ROWS_OF]
ROWS = ["joint_position", "joint_current", "output", "applied", "travelled", "used"]
CONSTANTS = {
    "travel_per_output": 0.01,
    "travel_per_current": 0.1,
    "travel_per_change": 0.05,
    "middle": 0.0,
    "nominal_squared": 4.0,
    "budget": 10.0,
    "warn_used": 0.8,
    "warn_temperature": 100.0,
    "max_alarm": 0.0,
    "max_current": 8.0,
    "max_encoder_age": 0.02,
    "max_jump": 0.1,
    "max_velocity": 1e9,
    "max_torque_age": 0.03,
    "max_torque": 60.0,
    "max_temperature": 120.0,
    "max_travel": 1e9,
    "max_overrun": 1e9,
    "max_overload": 1e9,
    "live": 1.0,
    "fed": 1.0,
}


def blocks(count: int) -> list[Array]:
    """What a reading is taken into: raw, measured, before, motors."""
    return [np.zeros((rows, count)) for rows in (READ, READ, READ, MOTOR_ROWS)]


def zeros(count: int) -> dict[str, Array]:
    """The rows that a monitor of some joints reads."""
    return {name: np.zeros(count) for name in [*READINGS, *ROWS]}


def monitor_of(joints: list[JointMonitor], taken: list[Array], rows: dict[str, Array]) -> Monitor:
    return Monitor(
        joints,
        taken,
        [rows[name].data for name in READINGS],
        [rows[name].data for name in ROWS],
        SLOW,
        PERIOD,
        FORGET,
    )


class Bench:
    """One joint that reads 0 everywhere, at 25 °C, and what a test sets."""

    def __init__(self, **constants: float) -> None:
        self.one = JointMonitor()
        self.one.set(CONSTANTS | constants)
        self.rows = zeros(1)
        self.rows["temperature"][0] = 25.0
        self.monitor = monitor_of([self.one], blocks(1), self.rows)

    def step(self, cycles: int = 1, periods: float = 1.0, **readings: float) -> bool:
        """Cycles, each of some periods, with these readings, which stay; whether it is healthy."""
        for name, value in readings.items():
            self.rows[name][0] = value
        return [bool(self.monitor.step(periods)) for _ in range(cycles)][-1]

    def failed(self) -> Check | None:
        found = self.one.failed()
        return Check(found) if found else None


def shows(**at: float) -> Bench:
    """A bench after its first cycle, and the cycle of these readings."""
    bench = Bench()
    assert bench.step()
    bench.step(**at)
    return bench


@pytest.mark.parametrize(
    ("reading", "most", "check"),
    [
        ("alarm", 0.0, Check.ALARM),
        ("current", 8.0, Check.CURRENT),
        ("encoder_age", 0.02, Check.ENCODER_AGE),
        ("velocity", CREDIBLE, Check.VELOCITY),
        ("torque_age", 0.03, Check.TORQUE_AGE),
        ("torque", 60.0, Check.TORQUE),
    ],
)
def test_each_reading_has_its_bound(reading: str, most: float, check: Check) -> None:
    """Either way, and the bound itself is good; what is no number is beyond any."""
    beyond = np.nextafter(most, np.inf)
    for good in (most, -most):
        bench = shows(**{reading: good})
        assert bench.failed() is None
        assert bench.step()
    for bad in (beyond, -beyond, math.nan, math.inf, -math.inf):
        bench = shows(**{reading: bad})
        assert bench.failed() is check
        assert not bench.step()


def test_a_temperature_is_bounded_above() -> None:
    for good in (120.0, -50.0, -CREDIBLE):
        assert shows(temperature=good).failed() is None
    for bad in (120.1, math.nan, math.inf, -math.inf, -1.1 * CREDIBLE):
        assert shows(temperature=bad).failed() is Check.TEMPERATURE


def test_the_first_cause_counts() -> None:
    """In the order of Check, whatever else is wrong."""
    bad = {"alarm": 3.0, "current": 9.0, "encoder_age": 1.0, "position": 5.0}
    bad |= {"velocity": math.nan, "torque_age": 1.0, "torque": 99.0, "temperature": 200.0}
    for k, check in enumerate(ROWS_OF):
        assert shows(**dict(list(bad.items())[k:])).failed() is check
    bench = Bench(max_travel=0.0, max_overrun=0.0, max_overload=0.0)
    one = bench.one
    one.slipped = one.overran = one.overloaded = True
    assert bench.failed() is Check.TRAVEL
    one.slipped = False
    assert bench.failed() is Check.OVERRUN
    one.overran = False
    assert bench.failed() is Check.OVERLOAD
    one.overloaded, one.raced = False, True
    assert bench.failed() is Check.OVERSPEED
    one.raced = False
    assert bench.failed() is None
    one.passed = int(Check.TORQUE)
    one.slipped = True
    assert bench.failed() is Check.TORQUE


# --- where the next reading may be -----------------------------------------------------------


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_reading_may_be_constant_or_continue(way: float) -> None:
    """Between both: q + min(0, Δ) − m ≤ q' ≤ q + max(0, Δ) + m."""
    for moved, low, high in ((0.0, -0.1, 0.1), (0.08, -0.1, 0.18)):
        for off, good in ((low, True), (high, True), (low - 1e-6, False), (high + 1e-6, False)):
            bench = Bench()
            bench.step()
            bench.step(position=way * moved)
            bench.step(position=way * (moved + off * (1.0 - 1e-9)))
            assert (bench.failed() is None) is good, (moved, off)


def test_the_first_reading_may_be_any() -> None:
    bench = Bench()
    assert bench.step(position=77.0)
    assert (bench.one.lowest, bench.one.highest) == (76.9, 77.1)
    bench.one.expect_anything()
    assert bench.step(position=-5.0)


def test_after_a_spike_the_motion_begins_anew() -> None:
    """The jump itself is none that goes on."""
    bench = shows(position=1.0)
    assert bench.failed() is Check.POSITION
    assert (bench.one.lowest, bench.one.highest) == (0.9, 1.1)
    assert bench.step(position=1.05)
    assert bench.one.highest == pytest.approx(1.05 + 0.05 + 0.1)


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1.1 * CREDIBLE])
def test_after_a_missing_reading_any_reading_is_good(bad: float) -> None:
    """The last one replaces it."""
    bench = shows(position=0.05)
    bench.step(position=bad)
    assert bench.failed() is Check.POSITION
    assert bench.one.last == 0.05
    assert bench.step(position=7.0)
    assert (bench.one.lowest, bench.one.highest) == (6.9, 7.1)


# --- travel of the motor against travel of the encoder ---------------------------------------


def test_the_travel_of_a_motor_by_its_own_equation() -> None:
    """Ke Δq = T Σ V − R T Σ i − L' (i_last − i_first), of the cycles since the last look."""
    bench = Bench()
    bench.one.first = bench.one.current = 1.0
    outputs, currents = [10.0, 20.0, 30.0, 40.0], [1.0, 1.5, 2.5, 3.0]
    position = 0.0
    for output, current in zip(outputs, currents, strict=True):
        position += 0.01
        bench.step(applied=output, joint_current=current, position=position)
    travelled = 0.01 * 100.0 - 0.1 * 8.0 - 0.05 * (3.0 - 1.0)
    assert bench.rows["travelled"][0] == pytest.approx(travelled)
    assert bench.one.travel == pytest.approx(travelled - 0.04)
    bench.step(SLOW, applied=0.0)  # sums begin anew, the error is forgotten by half
    more = -0.1 * 4 * 3.0
    assert bench.rows["travelled"][0] == pytest.approx(travelled + more)
    assert bench.one.travel == pytest.approx(0.5 * (travelled - 0.04) + more)


def test_checks_run_at_a_fixed_number_of_cycles() -> None:
    bench = Bench()
    seen = []
    for _ in range(3 * SLOW):
        bench.step(applied=10.0)
        seen.append(bench.monitor.countdown)
    assert seen == [3, 2, 1, 4] * 3
    assert bench.rows["travelled"][0] == pytest.approx(0.01 * 10.0 * 3 * SLOW)


def test_checks_run_in_periods_where_cycles_are_lost() -> None:
    """B6, F1, F6: errors are forgotten, and heat counts, by the time that passed."""
    bench = Bench(fed=1.0)
    bench.step(joint_current=1.0)
    bench.one.travel = 1.0
    bench.step(joint_current=5.0, current=5.0, periods=2.5 * SLOW)
    passed = 2.5 * SLOW + 1.0
    assert bench.one.overload == pytest.approx((25.0 - 4.0) * passed * PERIOD)
    travelled = bench.rows["travelled"][0]
    assert bench.one.travel == pytest.approx(FORGET ** (passed / SLOW) + travelled)
    assert bench.monitor.countdown == SLOW


def test_what_an_encoder_moved_unseen_is_in_doubt() -> None:
    """B6: a motor is read in one phase of each step; of an encoder that stands nothing is unseen.

    Doubt that is not needed is forgotten at once.
    """
    bench = Bench(max_travel=0.03)
    for k in range(8):
        assert bench.step(position=0.1 * k, applied=2.0, periods=3.0)  # 0.06 of it
    assert bench.one.travel < -0.1
    assert [bench.step(periods=3.0) for _ in range(2)] == [True, False]
    assert bench.failed() is Check.TRAVEL


def test_without_power_a_motor_shows_nothing() -> None:
    bench = Bench(live=0.0)
    bench.step(SLOW, applied=50.0, position=0.05)
    assert bench.rows["travelled"][0] == 0.0
    assert bench.one.travel == 0.0


def test_a_bridge_that_is_switched_is_compared_from_then_on() -> None:
    """Sums, place and current begin in that cycle."""
    bench = Bench()
    bench.step(2, applied=10.0, joint_current=2.0, position=0.05)
    bench.one.switched = True
    bench.step(joint_current=4.0, position=0.1)
    assert not bench.one.switched
    bench.step(joint_current=5.0, position=0.15)
    travelled = 0.01 * 10.0 - 0.1 * 5.0 - 0.05 * (5.0 - 4.0)
    assert bench.rows["travelled"][0] == pytest.approx(travelled)
    assert bench.one.travel == pytest.approx(travelled - 0.05)


def test_a_disagreement_is_found_either_way() -> None:
    for way in (1.0, -1.0):
        bench = Bench(max_travel=0.4)
        assert bench.step(SLOW, applied=way * 10.0)
        assert not bench.step(SLOW, applied=way * 10.0)  # 0.4 · 0.5 + 0.4
        assert bench.failed() is Check.TRAVEL
        bench.one.forget_travel()
        assert (bench.one.travel, bench.failed()) == (0.0, None)
    assert not Bench(max_travel=math.nan).step(SLOW)


def late(bench: Bench, cycles: int, speed: float, shown: float, age: float = 0.0) -> None:
    """A motor at a speed, rad a cycle, that is read every second cycle, as long ago as ``age``.

    Args:
        bench: Its travel per percent is 0.01.
        cycles: To run.
        speed: Of the motor.
        shown: Of the encoder, in its stead.
        age: Of a new reading, s.
    """
    for k in range(cycles):
        again = k % 2
        place = bench.rows["position"][0] + (0.0 if again else 2.0 * shown)
        bench.step(position=place, applied=100.0 * speed, encoder_age=age + again * PERIOD)


@pytest.mark.parametrize("age", [0.0, 0.5 * PERIOD, 1.5 * PERIOD])
def test_travel_is_compared_over_late_readings(age: float) -> None:
    """F1, B7: a frozen or reversed encoder is found by drives that answer every second cycle."""
    limits = {"max_travel": 0.12, "max_jump": 1.0, "max_encoder_age": 1.0}
    for shown, good in ((0.02, True), (0.0, False), (-0.02, False)):
        bench = Bench(**limits)
        late(bench, 10 * SLOW, 0.02, shown, age)
        assert bench.failed() is (None if good else Check.TRAVEL), shown


def test_travel_is_integrated_evenly_between_readings() -> None:
    """Output and current changed evenly in the cycles of which nothing was read."""
    bench = Bench(max_jump=1.0)
    bench.step(applied=10.0, joint_current=1.0)
    for age in (PERIOD, 2.0 * PERIOD):
        bench.step(encoder_age=age)
    bench.step(encoder_age=0.0, applied=40.0, joint_current=2.0, position=0.3)
    outputs, currents = 10.0 + 2 * 25.0 + 40.0, 1.0 + 2 * 1.5 + 2.0
    travelled = 0.01 * outputs - 0.1 * currents - 0.05 * 2.0
    assert bench.rows["travelled"][0] == pytest.approx(travelled)


def test_travel_begins_anew_after_a_long_silence() -> None:
    """What a motor did in it is not known; what was found before counts on."""
    bench = Bench(max_jump=10.0, max_encoder_age=1.0)
    bench.step(SLOW, applied=10.0)
    before = bench.one.travel
    for k in range(1, SLOW):
        bench.step(encoder_age=k * PERIOD)
    bench.step(encoder_age=0.0, position=3.0, applied=50.0)
    assert bench.one.travel == pytest.approx(0.5 * before)


def test_late_readings_show_a_bridge_that_is_switched_later() -> None:
    """An order reaches a drive as late as its readings come: twice their age has to pass."""
    bench = Bench(max_encoder_age=1.0)
    bench.step(encoder_age=1.5 * PERIOD)
    bench.one.switched, bench.one.since = True, 0.0
    seen = []
    for _ in range(5):
        bench.step(applied=10.0)
        seen.append(bench.one.switched)
    assert seen == [True, True, True, False, False]


def test_late_readings_allow_for_the_output_in_between() -> None:
    """Of a joint that turns round: twice its speed for the age."""
    bench = Bench(max_travel=0.25, travel_per_age=10.0, max_encoder_age=1.0)
    late(bench, 2 * SLOW, 0.06, 0.0, 0.02)
    assert bench.one.travel > 0.25
    assert bench.failed() is None


def test_what_is_not_read_between_unlike_readings_is_doubted() -> None:
    """B7: half the difference of their speeds, for as long as they are apart; it fades."""
    bench = Bench(max_jump=1.0, max_travel=0.25, max_encoder_age=1.0)
    bench.step()
    for age in (PERIOD, 2.0 * PERIOD):
        bench.step(encoder_age=age)
    bench.step(encoder_age=0.0, applied=30.0, joint_current=1.0)
    doubt = 0.5 * 2 * (0.01 * 30.0 - 0.1 * 1.0)
    assert bench.one.doubt == pytest.approx(FORGET * doubt)
    assert bench.one.travel > 0.25
    assert bench.failed() is None
    bench.one.travel = 0.9
    bench.step(SLOW)
    assert bench.failed() is Check.TRAVEL
    bench.one.forget_travel()
    assert bench.one.doubt == 0.0


# --- limits and heat -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("position", "good"), [(3.0, True), (-1.0, True), (3.1, False), (-1.1, False)]
)
def test_an_overrun_is_of_the_joint_s_position(position: float, good: bool) -> None:
    """Offset and all; from the middle of its limits."""
    bench = Bench(middle=1.0, max_overrun=2.0)
    assert bench.step(SLOW, joint_position=position) is good
    assert bench.one.overrun == pytest.approx(position - 1.0)
    assert bench.failed() is (None if good else Check.OVERRUN)
    bench.step(SLOW, joint_position=math.nan)
    assert bench.one.overrun == pytest.approx(position - 1.0)


def test_heat_adds_up_and_decays() -> None:
    """Overload: s' = max(0, s + (i² − i_nom²) Δt), of the motor's own current."""
    bench = Bench(max_overload=10.0)
    bench.step(SLOW, current=6.0, joint_current=0.0)
    once = (36.0 - 4.0) * ELAPSED
    assert bench.one.overload == pytest.approx(once)
    assert bench.rows["used"][0] == bench.one.used == pytest.approx(once / 10.0)
    bench.step(SLOW, current=-6.0)
    assert bench.one.overload == pytest.approx(2.0 * once)
    bench.one.fed = 0.0
    bench.step(SLOW)
    assert bench.one.overload == pytest.approx(2.0 * once - 4.0 * ELAPSED)
    bench.step(100 * SLOW)
    assert bench.one.overload == 0.0


def test_a_current_beyond_the_peak_heats_as_the_peak() -> None:
    bench = Bench()
    bench.step(SLOW, current=80.0)
    assert bench.one.overload == pytest.approx((64.0 - 4.0) * ELAPSED)
    bench.step(SLOW, current=math.nan)  # the last one replaces it
    assert bench.one.overload == pytest.approx(2.0 * (64.0 - 4.0) * ELAPSED)


def test_an_overload_is_found() -> None:
    bench = Bench(max_overload=2.0)
    assert bench.step(SLOW, current=6.0)
    assert not bench.step(SLOW)
    assert bench.failed() is Check.OVERLOAD
    assert not Bench(max_overload=math.nan).step(SLOW)


def test_warnings_have_a_relief() -> None:
    """From 80 % on until 70 %, from 100 °C on until 98 °C; each change is news."""
    bench = Bench()
    news = []

    def look(overload: float, temperature: float) -> tuple[bool, bool]:
        bench.one.overload = overload + 4.0 * ELAPSED  # which decays in this look
        bench.monitor.news = False
        bench.step(SLOW, temperature=temperature)
        news.append(bool(bench.monitor.news))
        return bool(bench.one.strained), bool(bench.one.hot)

    assert look(8.0 - 1e-6, 100.0) == (False, False)
    assert look(8.0 + 1e-6, 100.0) == (True, False)
    assert look(7.0 + 1e-6, 100.1) == (True, True)
    assert look(7.0 - 1e-6, 98.1) == (False, True)
    assert look(7.5, 97.9) == (False, False)
    assert look(7.5, 97.9) == (False, False)
    assert news == [False, True, True, True, True, False]
    assert bench.one.temperature == 97.9
    bench.step(SLOW, temperature=math.nan)
    assert bench.one.temperature == 97.9


def test_any_joint_s_cause_counts() -> None:
    """Of two joints, each reads its own column."""
    joints = [JointMonitor(), JointMonitor()]
    rows = zeros(2)
    for one in joints:
        one.set(CONSTANTS)
    monitor = monitor_of(joints, blocks(2), rows)
    assert not monitor.news
    assert monitor.step()
    rows["torque"][0] = 99.0
    rows["applied"][:] = [10.0, 20.0]
    assert not monitor.step()
    assert [one.failed() for one in joints] == [Check.TORQUE, 0]
    rows["torque"][:] = [0.0, 99.0]
    assert not monitor.step()
    assert [one.failed() for one in joints] == [0, Check.TORQUE]
    monitor.step()
    assert rows["travelled"].tolist() == pytest.approx([0.3, 0.6])


def test_a_reading_is_copied_and_the_previous_one_kept() -> None:
    """Also where the plant fills the same arrays again, and where another array comes."""
    taken = blocks(2)
    raw, measured, before, motors = taken
    monitor = monitor_of([JointMonitor(), JointMonitor()], taken, zeros(2))
    reused, shafts = np.arange(16.0).reshape(8, 2), np.arange(6.0).reshape(3, 2)
    monitor.take(reused, shafts)
    np.testing.assert_array_equal(raw, np.arange(16.0).reshape(8, 2))
    np.testing.assert_array_equal(measured, raw)
    np.testing.assert_array_equal(before, 0.0)
    np.testing.assert_array_equal(motors, shafts)
    measured += 0.5  # an offset is taken off
    reused += 1.0
    shafts += 1.0
    monitor.take(reused, shafts)
    np.testing.assert_array_equal(before, raw - 0.5)
    np.testing.assert_array_equal(measured, raw)
    np.testing.assert_array_equal(raw, reused)
    np.testing.assert_array_equal(motors, shafts)
    other = np.full((2, 8), 7.0).T  # columns lie together
    other.flags.writeable = False
    monitor.take(other, None)
    np.testing.assert_array_equal(before, reused)
    np.testing.assert_array_equal(raw, 7.0)
    np.testing.assert_array_equal(motors, shafts)
    monitor.take(other, np.full((3, 2), np.nan))
    np.testing.assert_array_equal(raw, 7.0)
    assert np.isnan(motors).all()
    monitor.take(other + 1.0, np.zeros((3, 2)))
    np.testing.assert_array_equal(raw, 8.0)
    np.testing.assert_array_equal(motors, 0.0)


def test_other_array_types_of_readings_are_converted_or_refused() -> None:
    """Never read beyond their ends: a plant may be wrong, and may reuse what is copied here."""
    taken = blocks(2)
    raw, motors = taken[0], taken[3]
    monitor = monitor_of([JointMonitor(), JointMonitor()], taken, zeros(2))
    single, whole = np.ones((READ, 2), dtype=np.float32), np.zeros((READ, 2))
    turns = np.ones((MOTOR_ROWS, 2), dtype=np.int64)
    for value in (1, 2):
        single[:] = turns[:] = value
        monitor.take(single, None)
        np.testing.assert_array_equal(raw, value)
        monitor.take(whole, turns)
        np.testing.assert_array_equal(motors, value)
        single[:] = turns[:] = -value
        monitor.take(whole, turns)
        np.testing.assert_array_equal(motors, -value)
        monitor.take(single, None)
        single[:] = value
        monitor.take(single, None)
        np.testing.assert_array_equal(raw, value)
    for values, shafts in (
        (np.zeros((READ, 1 + 2)), None),
        (np.zeros((READ - 1, 2)), None),
        (np.zeros((READ, 2)), np.zeros((MOTOR_ROWS - 1, 2))),
    ):
        with pytest.raises(ValueError, match="could not be broadcast"):
            monitor.take(values, shafts)
    np.testing.assert_array_equal(raw, 2.0)
