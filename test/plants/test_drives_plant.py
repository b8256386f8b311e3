# SPDX-License-Identifier: Apache-2.0
"""What all makes have in common, over a scripted driver: no bus, no codec, no time but its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drive_bench import Bench
from manual_clock import ManualClock

from control_board_ros.core.terms.drives import DriveReport, OnSilence, SetPoint
from control_board_ros.core.terms.measurement import SetPoints, Value
from control_board_ros.plants.drives.axes import Axis
from control_board_ros.plants.drives.driver import Answers, Identity, Order, Traits
from control_board_ros.plants.drives.faults import RESTARTED
from control_board_ros.plants.drives.interview import PAUSE, Question, Questions
from control_board_ros.plants.drives.plant import DrivesPlant
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.interface import DriveFault, DriveLimits, Readings, Setup
from control_board_ros.testing.plant_contract import set_points

OFF, POSITION, TORQUE = SetPoint.OFF, SetPoint.POSITION, SetPoint.TORQUE
PERIOD, TIMEOUT = 0.002, 0.021
#: Exchanges, after the first, until something lasts longer than the timeout.
LASTING = 11
AXES = (
    Axis(name="a", id=3, direction=-1, ratio=2.0, offset=0.5, motor_turns=4.0),
    Axis(name="b", id=4),
)


class Scripted:
    """A driver whose drives do what they are told, but for what a test says.

    Attributes:
        mute, deaf: Drives that say nothing, or hear nothing.
        weak, stuck, dropping: That take no power, keep it, or lose it when they have it.
        surplus: More answers of each per exchange.
        slow: Questions of a set-up; refusal: what it ends with; asked: told of each order.
        told: The orders of the last exchange; at: when each was, s.
    """

    def __init__(self, axes: tuple[Axis, ...], *, live: bool = True, **traits: Any) -> None:
        self.live, self.power_lost = live, RESTARTED
        self.traits = Traits(
            set_points=(POSITION, TORQUE), on_silence=(OnSilence.FREE, OnSilence.BRAKED),
            resolution=0.01, torque=True, current=True, temperature=True, voltage=True,
            laws={1: "position"}, **traits,
        )  # fmt: skip
        self.line: Any = SimpleNamespace(clock=None, dropped=0)
        self.mute, self.deaf, self.weak = set[int](), set[int](), set[int]()
        self.stuck, self.dropping = set[int](), set[int]()
        self.power, self.act = [False] * len(axes), [0] * len(axes)
        self.faults: list[DriveFault | None] = [None] * len(axes)
        self.confirms, self.surplus = [True] * len(axes), [0] * len(axes)
        limits = DriveLimits(lower=-1.0, upper=2.0, velocity=4.0)
        self.found = [Identity(id=a.id, type="made", firmware="2", limits=limits) for a in axes]
        self.slow, self.refusal, self.laws = 0, "", list[Any]()
        self.asked: Any = lambda order: None
        self.told: Mapping[int, Order] = {}
        self.at = list[float]()
        self.closed, self._count = 0, 0

    def open(self, setup: Setup, answers: Answers) -> None:
        self.setup, self.answers = setup, answers

    def law(self, k: int, kind: SetPoint) -> int:
        del k
        return {POSITION: 1, TORQUE: 2}[kind]

    def set_up(self, k: int) -> Questions[Identity]:
        asked = 0
        while asked < self.slow:
            asked += 1
            yield PAUSE
        if self.refusal:
            raise ValueError(self.refusal)
        return self.found[k]

    def confirm(self, k: int) -> Questions[bool]:
        yield from ()
        return self.confirms[k]

    def set_law(self, k: int, law: Any) -> Questions[Any]:
        yield from ()
        self.laws.append(law)
        self.act[k] = law
        return law

    def exchange(self, orders: Mapping[int, Order]) -> None:
        self.told = dict(orders)
        self.at.append(self.line.clock.now() if self.line.clock else 0.0)
        for k, order in orders.items():
            self.answers.asked[k] += 1
            self.asked(order)
            if k not in self.deaf:
                self._obey(k, order)
            if k not in self.mute:
                self._say(k)

    def _obey(self, k: int, order: Order) -> None:
        if order.action in (Action.POWER_ON, Action.GOAL):
            self.power[k] = k not in self.weak
            if self.live and self.act[k] != 9:
                self.act[k] = self.law(k, order.kind)
        elif order.action in (Action.OFF, Action.RESET) and k not in self.stuck:
            self.power[k] = False
        if order.action is Action.RESET:
            self.faults[k] = None
        if k in self.dropping:
            self.power[k] = False

    def _say(self, k: int) -> None:
        reported = self.answers.reported[k]
        reported.power, reported.fault = self.power[k], self.faults[k]
        if math.isnan(self.answers.position[k]):
            self.answers.position[k] = 0.0
        if self.live:
            reported.law = self.act[k]
        for _ in range(1 + self.surplus[k]):
            self._count += 1
            self.answers.came(k, b"%d" % self._count)

    def close(self) -> None:
        self.closed += 1


class Rig:
    """A plant over scripted drives, connected."""

    def __init__(
        self,
        axes: tuple[Axis, ...] = AXES,
        joints: tuple[Any, ...] = (None, None),
        period: float = PERIOD,
        **changes: Any,
    ) -> None:
        self.driver = Scripted(axes, live=changes.pop("live", True), **changes.pop("traits", {}))
        for name, value in changes.items():
            setattr(self.driver, name, value)
        self.plant = DrivesPlant(axes, self.driver)
        self.plant.clock = self.clock = ManualClock()
        self.begin = self.clock.now()
        self.plant.connect(Setup(period=period, timeout=TIMEOUT, joints=joints))

    def go(self, kind: SetPoint, cycles: int = 1, **rows: list[float]) -> Readings:
        """The same set-points for some exchanges."""
        values = {name: np.array(row) for name, row in rows.items()}
        wanted = SetPoints.off(2) if kind is OFF else set_points([kind] * 2, **values)
        for _ in range(cycles):
            self.clock.pass_by(PERIOD)
            found = self.plant.exchange(wanted)
        return found

    @property
    def actions(self) -> list[Action]:
        return [order.action for order in self.driver.told.values()]


def powered(**changes: Any) -> Rig:
    """Both drives have power, and follow."""
    rig = Rig(**changes)
    rig.go(POSITION, 3)
    assert rig.actions == [Action.GOAL] * 2
    return rig


def test_readings_are_those_at_the_joints() -> None:
    rig = Rig()
    answers = rig.plant.answers
    answers.position[:], answers.velocity[:], answers.torque[:] = 2.0, 2.0, 3.0
    answers.current[:], answers.temperature[:], answers.voltage[:] = 1.5, 40.0, 24.0
    found = rig.go(OFF)
    assert found.position.tolist() == [-0.5, 2.0]
    assert [row.tolist() for row in (found.velocity, found.torque, found.current)] == [
        [-1.0, 2.0], [-6.0, 3.0], [-1.5, 1.5],
    ]  # fmt: skip
    assert found.temperature is not None
    assert found.temperature.tolist() == [40.0, 40.0]
    assert found.voltage is not None
    assert found.voltage.tolist() == [24.0, 24.0]
    assert found.dropped is found.lost is None
    np.testing.assert_array_equal(found.motor_position, [-8.0, math.nan])
    np.testing.assert_array_equal(found.motor_velocity, [-8.0, math.nan])
    rig.plant._zeros[0].shift = 0.5
    found = rig.go(OFF)
    assert found.position.tolist() == [-0.75, 2.0]
    np.testing.assert_array_equal(found.motor_position, [-10.0, math.nan])
    rig.driver.line.dropped = 1
    assert rig.go(OFF).dropped is not None
    del rig.driver.line.dropped  # as on a serial bus
    assert rig.go(OFF).dropped is None
    bare = Rig((AXES[1], Axis(name="c", id=5)))
    assert bare.go(OFF).motor_position is None


def test_what_a_make_does_not_measure_is_none() -> None:
    rig = Rig()
    rig.driver.traits = Traits(set_points=(), on_silence=())
    joint, found = rig.plant.describe().joints[1], rig.go(OFF)
    assert not any((joint.torque_estimate, joint.current_sensor, joint.temperature_sensor))
    assert (joint.resolution, joint.turn, joint.stiffness) == (0.0, 0.0, None)
    assert [found.torque, found.current, found.temperature, found.voltage] == [None] * 4


def test_an_encoder_of_the_drive_s_own_at_the_motor_is_shown_as_it_reads() -> None:
    axes = (Axis(name="a", id=1, direction=-1, ratio=3.0), AXES[1])
    rig = Rig(axes, traits={"motor_encoders": frozenset({0})})
    rig.plant.answers.motor_position[0], rig.plant.answers.velocity[:] = 0.75, 1.0
    found = rig.go(OFF)
    np.testing.assert_array_equal(found.motor_position, [-0.75, math.nan])
    np.testing.assert_array_equal(found.motor_velocity, [math.nan, math.nan])
    assert [joint.motor_encoder for joint in rig.plant.describe().joints] == [True, False]
    axes = (Axis(name="c", id=1, motor_turns=1.0),)
    assert DrivesPlant(axes, Scripted(axes)).describe().joints[0].motor_encoder


def test_the_description_has_what_was_found() -> None:
    before = DrivesPlant(AXES, Scripted(AXES, stiffness=True)).describe().joints[0]
    assert (before.drive, before.limits, before.turn) == ("", DriveLimits(), 0.0)
    assert before.stiffness == 0.0  # not known
    found = Identity(id=3, type="made", limits=DriveLimits(lower=-1.0, upper=2.0), turn=0.5,
                     stiffness=3.0)  # fmt: skip
    rig = Rig(found=[found, found], traits={"stiffness": True})
    first, second = rig.plant.describe().joints
    assert first.drive == "made"
    assert (first.limits.lower, first.limits.upper) == (-0.5, 1.0)
    assert (first.resolution, second.resolution) == (0.005, 0.01)
    assert (first.turn, second.turn) == (0.25, 0.5)
    assert (first.stiffness, second.stiffness) == (12.0, 3.0)
    assert [first.motor_encoder, second.motor_encoder] == [True, False]
    rig.plant._zeros[0].shift = 3.0
    turned = rig.plant.describe().joints[0]
    assert (turned.turned, turned.limits.upper) == (-1.5, -0.5)
    assert turned.torque_estimate
    assert turned.current_sensor
    assert turned.temperature_sensor


def test_who_is_late_was_lost_until_then() -> None:
    answers = Answers(AXES)
    answers.came(0, b"of the last program")
    for asked, came, lost, late in (
        (1, 1, 0, 0), (0, 1, 0, 0), (1, 0, 1, 0), (1, 0, 2, 0), (0, 1, 1, 1), (0, 2, 0, 2),
        (1, 0, 1, 2), (1, 1, 1, 2), (0, 1, 1, 2),
    ):  # fmt: skip
        answers.begin()
        answers.asked[0] = asked
        for _ in range(came):
            answers.came(0, b"")
        if asked:
            answers.miss(0)
        assert (answers.lost[0], answers.late[0]) == (lost, late)


def test_a_bus_has_a_socket_or_its_exchange_alone() -> None:
    rig = Rig()
    assert rig.actions == [Action.OFF] * 2
    assert rig.plant.fileno() is None
    with pytest.raises(TypeError, match="no socket"):
        rig.plant.begin(SetPoints.off(2))
    with Bench("mit_can") as bench:
        bench.connect()
        wanted = set_points([bench.accepts[0]] * 2)
        for _ in range(20):
            bench.clock.pass_by(PERIOD)
            bench.plant.begin(wanted)
            assert bench.plant.read(bench.clock.now() + PERIOD)
            found = bench.plant.finish()
        assert not any(found.faults)
        assert not any(found.ages)
        assert [one.power for one in bench.plant.answers.reported] == [True, True]


def test_power_comes_with_a_goal_of_rest_then_goals_follow() -> None:
    rig = Rig()
    rig.plant.answers.position[:] = 0.125
    wanted = {"position": [0.25, 0.1], "velocity": [1.0, 1.0], "torque": [4.0, 4.0]}
    rig.go(POSITION, **wanted)
    order = rig.driver.told[0]
    assert (order.action, order.kind) == (Action.POWER_ON, POSITION)
    assert (order.values[Value.POSITION], order.values[Value.VELOCITY]) == (0.125, 0.0)
    rig.go(POSITION, **wanted)
    order = rig.driver.told[0]
    assert order.action is Action.GOAL
    assert (order.values[Value.POSITION], order.values[Value.VELOCITY]) == (0.5, -2.0)
    assert order.values[Value.TORQUE] == -2.0
    rig.plant._zeros[0].shift = 0.25
    rig.go(POSITION, **wanted)
    assert rig.driver.told[0].values[Value.POSITION] == 0.25


def test_a_silent_drive_ages_and_is_a_fault_after_the_timeout() -> None:
    rig = powered()
    rig.driver.mute.add(0)
    for exchange in range(1, LASTING + 1):
        found = rig.go(POSITION)
        assert found.ages is not None
        assert found.ages.tolist() == pytest.approx([min(PERIOD * exchange, TIMEOUT), 0.0])
        assert not any(found.faults)
    found = rig.go(POSITION)
    assert found.faults == ["no answer from id 3 for 24 ms", None]
    assert found.ages is not None
    assert found.ages[0] == TIMEOUT
    assert rig.actions == [Action.ASK, Action.GOAL]
    rig.driver.slow = 1000
    assert rig.go(OFF).faults[0] == "no answer from id 3 for 26 ms"
    assert rig.actions[0] is Action.SET_UP
    rig.driver.mute.clear()
    rig.driver.slow = 0
    rig.go(OFF, 20)
    assert rig.go(OFF).faults[0] is not None
    rig.plant.clear_fault(0)
    assert not any(rig.go(OFF).faults)


def test_a_bus_that_is_connected_again_begins_anew() -> None:
    rig = powered()
    rig.driver.mute.add(0)
    assert any(rig.go(POSITION, LASTING + 1).faults)
    rig.driver.mute.clear()
    rig.plant.connect(rig.driver.setup)
    assert not any(rig.go(POSITION).faults)
    assert rig.plant.answers.lost == [0, 0]


def test_a_slower_set_up_is_waited_for_and_asks_once() -> None:
    requests = list[Any]()

    def slower(k: int) -> Questions[Identity]:
        if k:
            yield Question("who", lambda *_: None, patience=5 * PERIOD)
        return Identity(id=k, type="made")

    rig = Rig(set_up=slower, asked=lambda order: requests.append(order.request))
    assert [joint.drive for joint in rig.plant.describe().joints] == ["made", "made"]
    assert [request for request in requests if request] == ["who"]


def test_a_law_that_is_not_wanted_any_more_is_not_set() -> None:
    laws = list[Any]()

    def slowly(_: int, law: Any) -> Questions[Any]:
        yield PAUSE
        laws.append(law)
        return law

    rig = Rig(live=False, set_law=slowly)
    for kind, cycles in ((POSITION, 2), (OFF, 1), (TORQUE, 10)):
        rig.go(kind, cycles)
    assert laws == [2, 2]
    assert rig.actions == [Action.GOAL] * 2


@pytest.mark.parametrize(
    ("turn", "way", "restarts"),
    [(0.1, 0.07, False), (0.1, 0.09, True), (0.5, 0.12, False), (0.5, 0.13, True),
     (0.0, 3.0, False)],
)  # fmt: skip
def test_a_reading_that_jumps_is_a_restart_where_turns_can_be_lost(
    turn: float, way: float, restarts: bool
) -> None:
    """S9: by more than a fourth of what may be lost, four times as fast as its limit."""
    joint: Any = SimpleNamespace(
        on_silence=OnSilence.FREE, limits=SimpleNamespace(velocity=5.0), calibration=True,
        requires_calibration=False,
    )  # fmt: skip
    found = [Identity(id=k, type="made", turn=turn) for k in (3, 4)]
    rig = Rig(AXES[1:] + AXES[1:], joints=(joint, joint), found=found)
    assert not any(rig.go(OFF, 3).faults)
    rig.plant.answers.position[0] += way
    assert [fault is not None for fault in rig.go(OFF).faults] == [restarts, False]


def test_a_loop_that_pauses_hears_no_silence() -> None:
    rig = powered()
    rig.clock.pass_by(1.0)
    rig.driver.mute.add(0)
    found = rig.go(POSITION)
    assert not any(found.faults)
    assert found.ages is not None
    assert found.ages[0] == PERIOD
    rig.driver.mute.clear()
    rig.go(POSITION)
    rig.clock.pass_by(1.0)
    rig.driver.mute.add(0)
    assert not any(rig.go(POSITION).faults)


def test_a_drive_that_never_answered_is_said_so() -> None:
    rig = Rig(mute={1})
    found = rig.go(OFF, LASTING + 1)
    assert found.faults == [None, "no answer from id 4; is it powered, and its id right?"]


def test_a_drive_that_was_never_read_has_no_position_and_gets_no_power() -> None:
    """B7: its goal of rest would be 0."""
    rig = Rig(mute={1})
    found = rig.go(POSITION, position=[0.0, 0.0])
    assert np.isnan(found.position).tolist() == [False, True]
    assert found.ages[1] > 0.0
    assert rig.actions[1] is Action.OFF
    rig.driver.mute = set()
    rig.go(POSITION, 3, position=[0.0, 0.0])
    assert rig.actions == [Action.GOAL] * 2


@pytest.mark.parametrize(
    ("weak", "stuck", "law", "kind", "text"),
    [
        (True, False, 1, POSITION, "does not take power"),
        (False, True, 1, OFF, "keeps its power, although switched off"),
        (False, False, 9, POSITION, "acts in mode 9, not in 1"),
    ],
)
def test_what_a_drive_does_not_confirm_is_a_fault_after_the_timeout(
    weak: bool, stuck: bool, law: int, kind: SetPoint, text: str
) -> None:
    rig = powered() if stuck else Rig()
    rig.driver.weak, rig.driver.stuck = {0} if weak else set(), {0} if stuck else set()
    rig.driver.act[0] = law
    found = rig.go(kind, LASTING)
    assert not any(found.faults)
    found = rig.go(kind)
    assert [str(fault) for fault in found.faults] == [text, "None"]
    rig.plant.clear_fault(0)  # without power only
    assert (rig.go(OFF).faults[0] is None) is weak
    if stuck:
        return
    rig.plant.clear_fault(0)
    rig.driver.act[0] = law
    assert not any(rig.go(kind, LASTING).faults)
    assert rig.go(kind).faults[0] is not None


def test_what_is_confirmed_between_begins_anew() -> None:
    rig = powered()
    for act, exchanges in ((9, LASTING - 3), (1, 1), (9, LASTING)):
        rig.driver.act[0] = act
        assert not any(rig.go(POSITION, exchanges).faults)
    assert rig.go(POSITION).faults[0] is not None


def test_what_is_not_heard_is_not_unconfirmed() -> None:
    rig = Rig(weak={0})
    rig.driver.mute.add(0)
    assert not any(rig.go(POSITION, 8).faults)
    rig.driver.mute.clear()
    assert not any(rig.go(POSITION, LASTING).faults)
    assert str(rig.go(POSITION).faults[0]) == "does not take power"


def test_power_that_goes_by_itself_is_a_restart() -> None:
    rig = powered()
    rig.driver.dropping.add(0)
    found = rig.go(POSITION)
    assert found.faults == [RESTARTED, None]
    assert rig.plant.answers.reported[0].lost
    assert rig.go(POSITION).faults[0] is RESTARTED
    assert rig.actions == [Action.OFF, Action.GOAL]
    rig.plant.clear_fault(0)
    assert not any(rig.go(OFF).faults)


def test_power_that_was_switched_off_is_none() -> None:
    rig = powered()
    assert not any(rig.go(OFF, 3).faults)
    assert not any(rig.go(POSITION, 3).faults)
    assert rig.driver.power == [True, True]


def test_power_that_was_switched_off_while_unheard_is_none() -> None:
    rig = powered()
    rig.driver.mute.add(0)
    rig.go(OFF, 2)
    rig.go(POSITION)
    assert rig.actions[0] is Action.ASK
    rig.driver.mute.clear()
    assert not any(rig.go(POSITION, 4).faults)
    assert rig.actions[0] is Action.GOAL


def test_what_a_drive_said_before_its_set_up_was_lost_is_forgotten() -> None:
    rig = powered()
    rig.driver.faults[0] = DriveFault(7, "hot")
    rig.go(POSITION)
    reported = rig.plant.answers.reported[0]
    assert (reported.lost, reported.power, reported.law) == (False, True, 1)
    assert reported.fault is not None
    rig.driver.mute.add(0)
    rig.go(POSITION, LASTING + 1)
    assert (reported.lost, reported.power, reported.law) == (True, False, None)
    assert reported.fault is None


def test_power_that_was_taken_unheard_is_taken_back() -> None:
    """S11: it may have come from a queue, after a restart."""
    rig = Rig()
    rig.driver.mute.add(0)
    rig.go(POSITION, 3)
    assert rig.actions[0] is Action.ASK
    rig.driver.mute.clear()
    seen = []
    for _ in range(4):
        assert not any(rig.go(POSITION).faults)
        seen.append(rig.actions[0])
    assert seen == [Action.ASK, Action.OFF, Action.POWER_ON, Action.GOAL]


def test_a_drive_that_forgot_its_watchdog_gets_no_power() -> None:
    rig = Rig()
    rig.driver.confirms[0], rig.driver.slow = False, 1
    assert rig.go(POSITION).faults == [RESTARTED, None]
    assert rig.driver.power == [False, True]
    rig = powered()  # each time it was off
    rig.driver.confirms[0], rig.driver.slow = False, 1
    assert not any(rig.go(OFF).faults)
    assert rig.go(POSITION).faults == [RESTARTED, None]


def test_a_fault_of_a_drive_is_reset_once() -> None:
    rig = powered()
    hot = DriveFault(7, "hot")
    rig.driver.faults[0], rig.driver.dropping = hot, {0}
    assert rig.go(POSITION).faults == [hot, None]
    rig.driver.dropping.clear()
    rig.plant.clear_fault(1)
    rig.go(OFF)
    assert rig.actions == [Action.OFF, Action.OFF]
    rig.plant.clear_fault(0)
    assert not any(rig.go(OFF).faults)
    assert rig.actions == [Action.RESET, Action.OFF]
    rig.go(OFF)
    assert rig.actions == [Action.OFF, Action.OFF]


def test_a_fault_does_not_count_as_unconfirmed() -> None:
    rig = Rig(weak={0})
    rig.go(POSITION, LASTING - 2)
    rig.driver.faults[0] = DriveFault(7, "hot")
    rig.go(POSITION)
    rig.driver.faults[0] = None
    assert not any(rig.go(POSITION, LASTING).faults)
    assert str(rig.go(POSITION).faults[0]) == "does not take power"


def surplus(rig: Rig, exchanges: int) -> Any:
    """Exchanges in which the first drive answers twice."""
    rig.driver.surplus[0] = 1
    found = rig.go(OFF, exchanges)
    rig.driver.surplus[0] = 0
    return found.faults[0]


def test_three_surplus_answers_are_those_of_a_second_drive() -> None:
    rig = Rig()
    assert surplus(rig, 2) is None
    assert surplus(rig, 1) == "two drives answer as id 3; change that of one"
    assert rig.go(OFF, 20).faults[0] is not None
    rig.plant.clear_fault(0)
    assert surplus(rig, 2) is None
    rig = Rig(surplus=[1, 0])  # twice while it is connected
    rig.driver.surplus[0] = 0
    assert not any(rig.go(OFF).faults)


def test_surplus_answers_are_forgiven_in_time() -> None:
    rig = Rig()
    surplus(rig, 2)
    rig.go(OFF, 4)  # 2 - 4 · 0.3 = 0.8
    assert surplus(rig, 2) is None
    assert surplus(rig, 1) is not None


def test_one_surplus_answer_is_forgiven_whole() -> None:
    rig = Rig()
    surplus(rig, 1)
    rig.go(OFF, 4)  # 1 - 4 · 0.3 < 0
    assert surplus(rig, 3) is None
    assert surplus(rig, 1) is not None


def test_late_answers_and_copies_are_no_surplus() -> None:
    rig = Rig()
    for _ in range(5):
        rig.driver.mute.add(0)
        rig.go(OFF, 2)
        rig.driver.mute.clear()
        rig.driver.surplus[0] = 2
        assert not any(rig.go(OFF).faults)
        rig.driver.surplus[0] = 0
        rig.driver._count -= 2  # the last answers come again
        assert not any(rig.go(OFF).faults)


def test_a_copy_beside_a_new_answer_is_surplus() -> None:
    rig = Rig()
    rig.driver.surplus[0] = 1
    assert not any(rig.go(OFF).faults)
    for _ in range(2):
        rig.driver._count -= 2  # the last one again, and one more
        found = rig.go(OFF)
    assert found.faults == ["two drives answer as id 3; change that of one", None]


def test_a_copy_is_one_answer_however_many_are_owed() -> None:
    rig = Rig()
    for _ in range(12):
        last = rig.driver._count
        rig.driver.mute.add(0)
        rig.go(OFF)
        rig.driver.mute.clear()
        rig.driver._count = last - 2 - rig.driver.surplus[0]
        rig.driver.surplus[0] = 0
        rig.go(OFF)
        rig.driver._count, rig.driver.surplus[0] = last + 10, 1
        assert not any(rig.go(OFF).faults)


def test_what_drives_report_comes_when_it_changes_and_each_second() -> None:
    found = [Identity(id=3, type="made", turn=2.0 * math.pi)] * 2
    rig = Rig((AXES[0], Axis(name="b", id=4, turns="absolute")), found=found)
    assert rig.go(OFF).drives is None
    assert rig.go(POSITION).drives == [
        DriveReport(zero="one turn", power=True, law="1 position", lost=0, late=0),
        DriveReport(zero="absolute", power=True, law="1 position", lost=0, late=0),
    ]
    assert rig.go(POSITION, 3).drives is None
    reports = rig.go(TORQUE).drives
    assert reports is not None
    assert reports[0].law == "2"
    rig.clock.pass_by(0.9)
    assert rig.go(TORQUE).drives is None
    rig.clock.pass_by(0.2)
    assert rig.go(TORQUE).drives is not None
    rig.driver.mute.add(0)
    assert rig.go(TORQUE).drives is None
    reports = rig.go(TORQUE).drives
    assert reports is not None
    assert (reports[0].power, reports[0].law, reports[0].lost) == (None, None, 2)
    assert (reports[1].power, reports[1].law) == (True, "2")


def test_a_drive_that_does_not_say_is_not_shown() -> None:
    found = Identity(id=3, type="made", says_power=False, says_law=False, turn=math.nan)
    rig = Rig(found=[found, found])
    reports = rig.go(POSITION).drives
    assert reports is not None
    assert reports[0] == DriveReport(zero=None, power=None, law=None, lost=0, late=0)
    assert rig.plant.describe().joints[0].turn == 0.0
    before = DrivesPlant(AXES, Scripted(AXES))
    assert before._report(0, True, 1, silent=False) == DriveReport(lost=0, late=0)


def test_a_set_up_that_is_refused_faults_its_joint_alone() -> None:
    rig = powered()
    rig.driver.dropping, rig.driver.refusal = {0}, "its table is odd"
    rig.go(POSITION)
    assert rig.go(POSITION, 9).faults == ["its table is odd", None]
    assert rig.actions == [Action.OFF, Action.GOAL]
    rig.driver.slow = 1
    rig.go(POSITION, 20)
    assert rig.plant.answers.reported[0].lost
    with pytest.raises(ValueError, match="its table is odd"):
        Rig(refusal="its table is odd")


@pytest.mark.parametrize("period", [PERIOD, 0.1])
def test_a_set_up_asks_a_question_per_exchange_at_its_pace(period: float) -> None:
    rig = Rig(period=period, slow=3)
    assert rig.driver.line.clock is rig.clock
    assert rig.driver.closed == 1
    assert np.diff(rig.driver.at[:-1]).tolist() == pytest.approx(
        [min(period, 5e-3)] * (len(rig.driver.at) - 2)
    )
    assert len(rig.driver.at) > 3


def test_a_law_that_does_not_come_with_its_goal_is_changed_without_power() -> None:
    rig = Rig(live=False)
    seen = []
    for kind in (POSITION, POSITION, TORQUE, TORQUE, TORQUE, OFF, TORQUE):
        assert not any(rig.go(kind).faults)
        seen.append(rig.actions[0])
    assert seen == [Action.POWER_ON, Action.GOAL, Action.OFF, Action.POWER_ON, Action.GOAL,
                    Action.OFF, Action.POWER_ON]  # fmt: skip
    assert rig.driver.laws == [1, 1, 2, 2, 2, 2]


def test_motors_that_are_free_are_let_go() -> None:
    def joint(silence: OnSilence) -> Any:
        return SimpleNamespace(on_silence=silence, limits=SimpleNamespace(velocity=1.0))

    rig = powered(joints=(joint(OnSilence.BRAKED), joint(OnSilence.FREE)))
    rig.plant.let_go()
    assert rig.driver.told == {1: Order(Action.OFF, OFF, ())}
    everyone = powered()
    everyone.plant.let_go()
    assert set(everyone.driver.told) == {0, 1}


def test_the_far_end_is_closed_with_it() -> None:
    rig, ended = Rig(), list[bool]()
    rig.plant.close()
    rig.plant.far_end = SimpleNamespace(close=lambda: ended.append(True))
    rig.plant.close()
    assert ended == [True]
    assert rig.driver.closed == 3
