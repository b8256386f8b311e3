# SPDX-License-Identifier: Apache-2.0
"""calibration.py: the calibrators cycle by cycle, at a joint that does just what a test says."""

from __future__ import annotations

import re
from typing import Any, cast

import pytest
from rig import joint

from control_board_ros.core.calibration import calibration
from control_board_ros.core.calibration.calibration import (
    AbsoluteSensor,
    CalibrationError,
    Calibrator,
    HardStop,
    OffsetAndMove,
    register,
)
from control_board_ros.core.calibration.calibrations import CalibrationStatus
from control_board_ros.core.config.config import Calibration

PERIOD = 0.01
#: Of the joint, in each cycle that it is driven or moves, rad or m.
STEP = 0.004
KINDS = [("revolute", 1.0), ("prismatic", 0.05)]


class Bench:
    """A joint between two stops; it moves by one step in each cycle, and at once.

    Args:
        kind: of the joint.
        begin: the reading at which it is.
        stops: readings of both stops.
        changes: of its configuration.
    """

    def __init__(
        self,
        kind: str = "revolute",
        begin: float = 0.0,
        stops: tuple[float, float] = (-9.0, 9.0),
        **changes: Any,
    ) -> None:
        self.joint = joint("a", kind=kind, **changes)
        self.reading, self.travelled, self.current = begin, begin, 0.0
        self.offset, self.output, self.target = 0.0, 0.0, None
        self.step, self.stops, self.lags = STEP, stops, 0
        self.drawn = 1.0  # of the current of a stall, where it is stalled
        self.gives_way = 0.0  # beyond the stop, where it is pushed

    @property
    def position(self) -> float:
        return self.reading - self.offset

    def hold(self) -> None:
        self.output, self.target = 0.0, None

    def drive(self, output: float) -> None:
        self.output, self.target = output, None

    def set_offset(self, offset: float) -> None:
        self.offset = offset

    def move(self, target: float, speed: float) -> None:
        self.output, self.speed = 0.0, speed
        self.target = None if target == self.position else target

    def moving(self) -> bool:
        return self.target is not None

    def cycle(self) -> None:
        """Let a cycle pass."""
        before = self.reading
        if self.output:
            self.reading += self.step * (1.0 if self.output > 0.0 else -1.0)
        elif self.target is not None:
            left = self.target - self.position
            self.reading += max(-self.step, min(self.step, left))
            if abs(left) <= self.step:
                self.target = None
        low, high = self.stops
        self.reading = max(low - self.gives_way, min(high + self.gives_way, self.reading))
        self.travelled += self.reading - before
        stalled = self.output and self.reading == before
        amperes = self.joint.motor.stall_current(self.output)
        self.current = self.drawn * amperes if stalled else 0.1 * amperes


def run(calibrator: Calibrator, bench: Bench, cycles: int = 5000) -> list[tuple[str, float]]:
    """Step until it is done; phase and progress after each cycle."""
    seen = []
    for _ in range(cycles):
        done = calibrator.step()
        seen.append((calibrator.progress.phase, calibrator.progress.fraction))
        if done:
            return seen
        bench.cycle()
    raise AssertionError(f"never done: {seen[-1]}")


def stop_type(bench: Bench, **changes: Any) -> HardStop:
    values: dict[str, Any] = {
        "type": 5,
        "required": True,
        "output": 20.0,
        "stop": 1.0,
        "stall_time": 0.1,
        "start": 0.0,
        "speed": 1.0,
    }
    return HardStop(Calibration(**(values | changes)), cast("Any", bench), PERIOD)


def outcome(calibrator: Calibrator, bench: Bench, phase: str = "", **changes: Any) -> str:
    """Why it fails; empty where it is done.

    Args:
        calibrator: to step.
        bench: its joint.
        phase: from which on the joint is changed.
        changes: of its attributes.
    """
    try:
        for _ in range(5000):
            if calibrator.step():
                return ""
            if calibrator.progress.phase == phase:
                vars(bench).update(changes)
            bench.cycle()
    except CalibrationError as error:
        return str(error)
    raise AssertionError(f"never done: {calibrator.progress}")


def begins(seen: list[tuple[str, float]]) -> dict[str, float]:
    """Each phase with the progress that it begins with."""
    found: dict[str, float] = {}
    for phase, fraction in seen:
        found.setdefault(phase, fraction)
    return found


def test_it_is_done_when_it_has_been_at_its_start_for_a_while() -> None:
    """K2: 50 ms without a break, 5 cycles here."""
    bench = Bench(begin=0.5)
    calibrator = OffsetAndMove(
        Calibration(type=3, zero=0.2, start=0.1, speed=0.7), cast("Any", bench), PERIOD
    )
    done = []
    for k in range(200):
        done.append(calibrator.step())
        if done[-1]:
            break
        bench.cycle()
        if k == 53:  # there for 3 cycles: a push
            bench.offset -= 0.03
        if k == 54:
            bench.offset += 0.03
    assert bench.speed == 0.7
    assert bench.position == pytest.approx(0.1)
    # 0.2 rad in 50 cycles, looked at before each; 4 cycles there, one pushed, 5 there
    assert len(done) == 60


@pytest.mark.parametrize(("kind", "scale"), KINDS)
def test_how_near_its_start_it_must_be(kind: str, scale: float) -> None:
    """K2: within 0.02 rad, or 1 mm, at rest."""
    for off, there in ((0.019 * scale, True), (0.021 * scale, False)):
        bench = Bench(kind, begin=0.1)
        calibrator = OffsetAndMove(Calibration(type=3, start=0.1), cast("Any", bench), PERIOD)
        calibrator.step()
        bench.target = None
        bench.reading += off
        assert any(calibrator.step() for _ in range(10)) is there
    bench = Bench(kind, begin=0.1)
    calibrator = OffsetAndMove(Calibration(type=3, start=0.1), cast("Any", bench), PERIOD)
    calibrator.step()
    bench.target = 0.2  # it is there, and moves
    assert not any(calibrator.step() for _ in range(10))


def test_a_joint_already_at_its_target_stays_there_for_a_while() -> None:
    """K2: 50 ms, where no profile is needed."""
    bench = Bench(begin=0.1)
    calibrator = OffsetAndMove(Calibration(type=3, start=0.1), cast("Any", bench), PERIOD)
    assert len(run(calibrator, bench)) == round(0.05 / PERIOD)


def test_progress_of_the_way_to_its_start() -> None:
    """K2: from 0.5 to 1 with the way, and never back."""
    bench = Bench(begin=0.4)
    calibrator = OffsetAndMove(Calibration(type=3, start=0.0), cast("Any", bench), PERIOD)
    seen = [fraction for _, fraction in run(calibrator, bench)]
    assert seen[0] == pytest.approx(0.5)
    assert seen[50] == pytest.approx(0.75)
    assert seen[-1] == pytest.approx(1.0)
    assert seen == sorted(seen)
    bench.reading = 0.2
    calibrator.step()
    assert calibrator.progress.fraction == pytest.approx(1.0)


def test_the_course_to_a_hard_stop() -> None:
    """K5, type 5: each phase with its progress; the stop is where the configuration says."""
    bench = Bench(begin=0.3, stops=(-9.0, 0.7))
    seen = run(stop_type(bench), bench)
    assert begins(seen) == {
        "driving to the hard stop": 0.05,
        "backing off the stop": 0.25,
        "approaching the stop again": 0.3,
        "pushing against the stop": 0.45,
        "moving to the start position": 0.5,
    }
    assert bench.offset == pytest.approx(0.7 - 1.0)
    assert bench.position == pytest.approx(0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_backs_off_and_pushes_towards_its_stop(way: float) -> None:
    """K5: the way back is 0.1 rad, away from the stop; the push is half as strong again."""
    bench = Bench(begin=0.0, stops=(-0.4, 0.4))
    outputs, least, pushes = [], 9.0, 0
    calibrator = stop_type(bench, output=way * 16.0, stop=way * 1.0, speed=0.3)
    for _ in range(2000):
        if calibrator.step():
            break
        if calibrator.progress.phase == "backing off the stop":
            assert bench.output == 0.0
            assert bench.target is None or bench.speed == 0.3
            least = min(least, way * bench.reading)
        pushes += calibrator.progress.phase == "pushing against the stop"
        if bench.output and bench.output not in outputs:
            outputs.append(bench.output)
        bench.cycle()
    assert least == pytest.approx(0.3, abs=1.1 * STEP)
    assert outputs == pytest.approx([way * 16.0, way * 24.0])
    assert pushes == round(2 * 0.1 / PERIOD)  # K5: for twice the time of a stall


@pytest.mark.parametrize(("kind", "scale"), KINDS)
def test_a_creeping_joint_has_not_met_a_stop(kind: str, scale: float) -> None:
    """K5, K6: encoder and motor must be at rest, 0.002 and 0.01 rad in the time of a stall."""
    for reading, motor, cycles in (
        (0.0019, 0.0019, 10),
        (0.0021, 0.0021, 15),
        (0.0, 0.0099, 10),
        (0.0, 0.0101, 15),
    ):
        for way in (1.0, -1.0):
            bench = Bench(kind)
            bench.current = bench.joint.motor.stall_current(20.0)
            calibrator = stop_type(bench)
            calibrator._begin = 0.0
            passed = 0
            for passed, _ in enumerate(calibrator._meet("driving", 0.05), 1):
                if passed in (4, 5):  # it moves by halves: counted anew from the second
                    bench.reading += 0.5 * way * reading * scale
                    bench.travelled += 0.5 * way * motor * scale
            assert passed == cycles


def test_a_joint_that_meets_no_stop_fails_within_its_range() -> None:
    """K5: the way to a stop is no longer than the range and its margin."""
    bench = Bench(begin=0.3)
    limits = bench.joint.limits
    with pytest.raises(CalibrationError, match="no stop within"):
        run(stop_type(bench, timeout=1e3), bench)
    longest = limits.hard_upper - limits.hard_lower + limits.hard_margin
    assert longest < bench.reading - 0.3 <= longest + 3 * STEP


def test_a_joint_that_does_not_come_back_fails_after_a_second() -> None:
    """K5: it must move the other way; counted from the end of the profile."""
    bench = Bench(begin=0.0, stops=(-9.0, 0.1))
    calibrator = stop_type(bench, timeout=1e3)
    while not bench.moving():
        bench.cycle()
        calibrator.step()
    place = bench.reading - 0.004
    for cycle in range(70 + round(1.0 / PERIOD)):
        calibrator.step()
        bench.reading = place
        if cycle == 50:
            bench.target = 5.0  # a second profile: counted from its end
        elif cycle in (20, 69):
            bench.target = None
    with pytest.raises(CalibrationError, match=r"moved back by 0.004 rad instead of 0.1 rad"):
        calibrator.step()


def test_a_joint_that_does_not_begin_to_come_back_fails_after_a_second() -> None:
    """K5: counted from the first cycle where no profile is on its way."""
    bench = Bench(begin=0.0, stops=(-9.0, 0.1))
    calibrator = stop_type(bench, timeout=1e3)
    while not bench.moving():
        bench.cycle()
        calibrator.step()
    bench.target = None
    for _ in range(round(1.0 / PERIOD)):
        calibrator.step()
    with pytest.raises(CalibrationError, match="moved back by 0 rad"):
        calibrator.step()


def test_half_of_the_way_back_is_enough_when_the_profile_has_ended() -> None:
    """K5: a joint that comes back by 0.06 of 0.1 rad moves the other way; by 0.04 it does not."""
    for back, enough in ((0.051, True), (0.049, False)):
        bench = Bench(begin=0.0, stops=(-9.0, 0.1))
        calibrator = stop_type(bench)
        while bench.target is None:
            calibrator.step()
            bench.cycle()
        assert calibrator.progress.phase == "backing off the stop"
        bench.reading, bench.target = 0.1 - back, None
        calibrator.step()
        assert (calibrator.progress.phase != "backing off the stop") is enough


@pytest.mark.parametrize(("kind", "scale"), KINDS)
def test_a_yielding_obstacle_is_no_stop(kind: str, scale: float) -> None:
    """K5: 0.005 rad, or 0.25 mm."""
    for gives_way, is_stop in ((0.0049, True), (0.0051, False)):
        bench = Bench(kind, begin=0.0, stops=(-9.0, 0.1))
        bench.step = 0.0005
        push = "pushing against the stop"
        found = outcome(stop_type(bench), bench, push, gives_way=gives_way * scale)
        assert ("then moved by" in found) is not is_stop


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("phase", "output"), [("driving to the hard stop", 16.0), ("pushing against the stop", 24.0)]
)
def test_a_stall_draws_at_least_half_of_its_current(phase: str, output: float, way: float) -> None:
    """K5, K6: a drive that is not at its torque, I = V/R, finds no stop, and confirms none."""
    ends = (-9.0, 0.1) if way > 0.0 else (-0.1, 9.0)

    def found(drawn: float) -> str:
        bench = Bench(begin=0.0, stops=ends)
        calibrator = stop_type(bench, output=way * 16.0, stop=way)
        return outcome(calibrator, bench, phase, drawn=drawn)

    assert found(0.55) == ""
    text = r"stalled, but the motor draws (\S+) A at (\S+) %, where a stall needs (\S+) A"
    matched = re.match(text, found(0.45))
    assert matched is not None
    needs = way * output * 0.48
    numbers = pytest.approx([0.45 * needs, way * output, needs], rel=0.01)
    assert [*map(float, matched.groups())] == numbers


class Rippled(Bench):
    """One whose current flows in every second cycle only, at twice its mean."""

    flows = False

    def cycle(self) -> None:
        super().cycle()
        self.flows = not self.flows
        self.current *= 2.0 * self.flows


@pytest.mark.parametrize("flows", [False, True])
def test_a_ripple_of_the_current_is_averaged(flows: bool) -> None:
    """K6: the current that counts is filtered, whatever the last reading is."""
    bench = Rippled(begin=0.0, stops=(-9.0, 0.1))
    bench.flows = flows
    assert outcome(stop_type(bench, stall_time=0.5), bench) == ""


@pytest.mark.parametrize(
    ("kind", "half", "same"),
    [("revolute", 2.2, 0.01), ("revolute", 0.06, 0.0075), ("prismatic", 0.02, 0.0005)],
)
def test_a_place_further_away_the_second_time_is_no_stop(
    kind: str, half: float, same: float
) -> None:
    """K5, K6: 0.01 rad, or 0.5 mm; less in a small range: a quarter of the way back."""
    limits = {"lower": -0.9 * half, "upper": 0.9 * half, "hard_margin": 0.05 * half}
    limits |= {"hard_lower": -half, "hard_upper": half}
    for apart, is_stop in ((0.9 * same, True), (1.1 * same, False)):
        bench = Bench(kind, stops=(-9.0, 0.1 * half), limits=limits)
        bench.step = 0.05 * same
        calibrator = stop_type(bench, stop=half, start=0.8 * half)
        again, stops = "approaching the stop again", (-9.0, 0.1 * half + apart)
        found = outcome(calibrator, bench, again, stops=stops)
        assert (found == "") is is_stop
        assert ("on the second approach" in found) is not is_stop


def test_a_small_range_makes_the_way_back_small() -> None:
    """K5: at most a quarter of the hard range."""
    small = {"lower": -0.05, "upper": 0.05, "hard_lower": -0.06, "hard_upper": 0.06}
    calibrator = stop_type(Bench(limits=small), stop=0.05)
    assert calibrator._back == pytest.approx(0.25 * 0.12)
    assert calibrator._same == pytest.approx(0.25 * 0.25 * 0.12)
    assert stop_type(Bench())._back == pytest.approx(0.1)
    assert stop_type(Bench("prismatic"))._back == pytest.approx(0.1 * 0.05)


def test_a_stop_is_where_the_range_allows() -> None:
    """K5: the joint would have started within its hard range and its margin."""
    limits = Bench().joint.limits
    for end, way in ((limits.hard_upper, -1.0), (limits.hard_lower, 1.0)):
        for beyond, fits in ((0.9, True), (1.1, False)):
            calibrator = stop_type(Bench(), output=way * 16.0, stop=0.0)
            calibrator._begin = 0.5
            place = 0.5 - end + way * beyond * limits.hard_margin
            if fits:
                calibrator._check_way(place)
                continue
            with pytest.raises(CalibrationError, match="it would have started at"):
                calibrator._check_way(place)


def test_a_weak_output_has_a_way_too() -> None:
    """K5: its sign is the direction; a short time of a stall leaves the current unfiltered."""
    assert stop_type(Bench(), output=0.5)._way == 1.0
    assert stop_type(Bench(), output=-0.5)._way == -1.0
    assert stop_type(Bench(), stall_time=0.02)._filter == 1.0


def test_an_absolute_sensor_gives_the_angle_at_once() -> None:
    """K5, type 12."""
    bench = Bench(begin=0.4)
    calibrator = AbsoluteSensor(Calibration(type=12, zero=0.1), cast("Any", bench), PERIOD)
    assert calibrator.step()
    assert (calibrator.progress.phase, calibrator.progress.fraction) == ("done", 1.0)
    assert bench.position == pytest.approx(0.3)


@pytest.mark.parametrize(("lasting", "enough"), [(6, False), (7, True)])
def test_the_current_of_a_stall_must_last(lasting: int, enough: bool) -> None:
    """K6: half of V/R behind a low pass of a fifth of the stall time, 10 cycles of 50 here."""
    bench = Bench(stops=(-9.0, 0.0))
    calibrator = stop_type(bench, stall_time=0.5)
    failed = False
    for cycle in range(52):
        try:
            calibrator.step()
        except CalibrationError:
            failed = True
            break
        bench.drawn = float(cycle >= 50 - lasting)
        bench.cycle()
        if not bench.drawn:
            bench.current = 0.0
    assert failed is not enough
    assert enough == (calibrator.progress.phase == "backing off the stop")


def test_a_calibration_that_has_not_begun_has_no_progress() -> None:
    status = CalibrationStatus("a")
    assert (status.running, status.done, status.progress, status.message) == (
        False,
        False,
        0.0,
        "",
    )


# --- types of one's own ----------------------------------------------------------------------


@pytest.fixture
def tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Types entered by a test are gone after it."""
    for table in ("TYPES", "CALIBRATION_TYPES"):
        monkeypatch.setattr(calibration, table, dict(getattr(calibration, table)))


@pytest.mark.parametrize("number", [-1, 0, 3, 5, 12, 13])
def test_a_number_that_no_type_may_have(tables: None, number: int) -> None:
    """K: 1 to 12, and not taken; nothing is entered."""
    before = dict(calibration.TYPES)
    with pytest.raises(ValueError, match=f"calibration type {number}: choose a free one"):
        register(number, "my own")
    assert before == calibration.TYPES


@pytest.mark.parametrize("number", [1, 2, 11])
def test_a_free_number_is_entered_with_its_text(tables: None, number: int) -> None:
    """K: the decorated class is that type from then on, and no other class is."""
    assert register(number, "my own")(AbsoluteSensor) is AbsoluteSensor
    assert calibration.TYPES[number] is AbsoluteSensor
    assert calibration.CALIBRATION_TYPES[number] == "my own"
    with pytest.raises(ValueError, match="choose a free one"):
        register(number, "another")


def test_a_freed_top_number_may_be_taken(tables: None) -> None:
    """K: 12 is the last number, not the first beyond."""
    del calibration.TYPES[12]
    register(12, "my own")(AbsoluteSensor)
    assert calibration.TYPES[12] is AbsoluteSensor
