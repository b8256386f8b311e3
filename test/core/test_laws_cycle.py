# SPDX-License-Identifier: Apache-2.0
"""core.laws, a cycle of several joints: what the arm's dynamics are asked for, and who gets it.

They are C functions where the laws are compiled; here they are the same as plain Python.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import pytest
from joint_parts import read, write
from joints import ROWS
from lone_joint import INFINITE, LAWS, joint

POSITION, TORQUE, IMPEDANCE = LAWS.POSITION, LAWS.TORQUE, LAWS.IMPEDANCE
NAN = math.nan


class LinearArm:
    """An arm whose torques are gravity by joint and a sum of its motion; it notes questions."""

    GRAVITY = (3.0, -7.0)

    def __init__(self) -> None:
        self.rows = [memoryview(array("d", [9.0, 9.0])) for _ in range(4)]
        self.asked: list[tuple[float, list[float], list[float], list[float]]] = []
        self.broken: set[int] = set()

    def inverse(self, weight: float) -> None:
        position, velocity, acceleration, torque = self.rows
        self.asked.append((weight, list(position), list(velocity), list(acceleration)))
        for k in range(2):
            moved = position[k] + 10.0 * velocity[k] + 100.0 * acceleration[k]
            torque[k] = NAN if k in self.broken else weight * self.GRAVITY[k] + moved


class Two:
    """Two joints with an arm, or without one."""

    def __init__(self, arm: LinearArm | None, feeds_arm: bool = True, **given: Any) -> None:
        self.arm = arm
        known = {"calibrated": True, "settling": False, "compensates": False, "lifts": False}
        self.first, self.second = (joint(**(known | given)) for _ in range(2))
        self.rows = {name: memoryview(array("d", [0.0, 0.0])) for name in ROWS}
        self.done = memoryview(array("B", [5, 5]))
        self.joints = [self.first, self.second]
        rows = list(self.rows.values())
        self.laws = LAWS.Laws(self.joints, rows, self.done, arm, feeds_arm)

    def set(self, name: str, *values: float) -> None:
        for one, value in zip(self.joints, values, strict=True):
            write(one, name, value)

    def get(self, name: str) -> list[float]:
        return [read(one, name) for one in self.joints]


@pytest.fixture
def arm() -> LinearArm:
    return LinearArm()


@pytest.fixture
def two(arm: LinearArm) -> Two:
    """At 0.1 and 0.4 rad, in motion, with references that move otherwise."""
    made = Two(arm)
    made.set("position", 0.1, 0.4)
    made.set("velocity", 0.2, 0.5)
    made.set("acceleration", 0.3, 0.6)
    made.set("track.velocity", 0.7, 0.8)
    made.set("track.acceleration", 0.9, 1.1)
    return made


# --- the arm -------------------------------------------------------------------------------------


def test_the_arm_s_dynamics_do_not_act_at_first(two: Two) -> None:
    assert not two.laws.modelled
    assert LAWS.Laws(two.joints, list(two.rows.values()), two.done, two.arm).feeds_arm


def test_references_are_fed_forward_in_position_laws(two: Two, arm: LinearArm) -> None:
    """Of a joint in another law its own motion, at the present speed."""
    two.laws.modelled = True
    two.set("law", POSITION, TORQUE)
    two.laws.feed_forward()
    assert arm.asked == [(1.0, [0.1, 0.4], [0.7, 0.5], [0.9, 0.0])]
    assert two.get("forward") == pytest.approx([3.0 + 0.1 + 7.0 + 90.0, -7.0 + 0.4 + 5.0])


def test_references_of_a_settling_joint_are_fed_forward(two: Two, arm: LinearArm) -> None:
    """It brakes first, whatever its law."""
    two.laws.modelled = True
    two.set("law", TORQUE, TORQUE)
    two.set("settling", False, True)
    two.laws.feed_forward()
    assert arm.asked == [(1.0, [0.1, 0.4], [0.2, 0.8], [0.0, 1.1])]


def test_a_torque_that_is_no_number_is_not_fed_forward(two: Two, arm: LinearArm) -> None:
    two.laws.modelled = True
    two.set("forward", 1.0, 2.0)
    arm.broken = {1}
    two.laws.feed_forward()
    assert two.get("forward") == pytest.approx([3.0 + 0.1 + 7.0 + 90.0, 2.0])


@pytest.mark.parametrize("why", ["no arm", "not in all laws", "an unknown angle", "no reading"])
def test_else_each_joint_accelerates_its_own_inertia(arm: LinearArm, why: str) -> None:
    two = Two(None if why == "no arm" else arm, feeds_arm=why != "not in all laws")
    two.set("calibrated", True, why != "an unknown angle")
    two.set("position", 0.1, NAN if why == "no reading" else 0.4)
    two.set("motor.inertia", 2.0, 3.0)
    two.set("track.acceleration", 0.5, -0.25)
    two.laws.feed_forward()
    assert two.get("forward") == [1.0, -0.75]
    assert arm.asked == []


def test_the_arm_comes_and_goes_without_a_step_of_torque(two: Two, arm: LinearArm) -> None:
    """What is fed forward leaves the integral part, and returns to it."""
    two.set("gravity", 50.0, 60.0)
    loads = [3.0 + 0.1, -7.0 + 0.4]
    assert two.laws.knows_arm()
    assert two.laws.modelled
    assert arm.asked == [(1.0, [0.1, 0.4], [0.0, 0.0], [0.0, 0.0])]
    assert two.get("gravity") == pytest.approx(loads)
    integrals = [one.position_pid.integral for one in two.joints]
    assert integrals == pytest.approx([5.0 - loads[0], 5.0 - loads[1]])
    assert two.laws.knows_arm()
    assert len(arm.asked) == 1  # it is known already
    two.second.calibrated = False
    assert not two.laws.knows_arm()
    assert [one.position_pid.integral for one in two.joints] == pytest.approx([5.0, 5.0])
    assert two.get("gravity") == [0.0, 0.0]
    assert not two.laws.knows_arm()
    assert len(arm.asked) == 2


def test_the_arm_is_forgotten_before_its_masses_change(two: Two, arm: LinearArm) -> None:
    two.laws.forget_arm()
    assert arm.asked == []
    two.laws.knows_arm()
    two.laws.forget_arm()
    assert not two.laws.modelled
    assert [one.position_pid.integral for one in two.joints] == pytest.approx([5.0, 5.0])


def test_the_torque_of_the_measured_motion(two: Two, arm: LinearArm) -> None:
    """Without gravity; one that is no number is not taken."""
    two.set("motion", 1.0, 2.0)
    arm.broken = {1}
    two.laws.sense_motion()
    assert arm.asked == [(0.0, [0.1, 0.4], [0.2, 0.5], [0.3, 0.6])]
    assert two.get("motion") == pytest.approx([0.1 + 2.0 + 30.0, 2.0])


@pytest.mark.parametrize("fast", [(), (0,), (1,), (0, 1)])
def test_before_laws_start_motion_and_gravity_are_known(
    two: Two, arm: LinearArm, fast: tuple[int, ...]
) -> None:
    """And whether all joints are at rest."""
    two.laws.modelled = True
    two.set("readings", 2, 2)
    two.set("acceleration", 0.0, 0.0)
    two.set("velocity", *(1.0 if k in fast else 0.0 for k in range(2)))
    assert bool(two.laws.prepare()) is (not fast)
    velocities = two.get("velocity")
    assert arm.asked == [
        (0.0, [0.1, 0.4], velocities, [0.0, 0.0]),
        (1.0, [0.1, 0.4], [0.0, 0.0], [0.0, 0.0]),
    ]
    assert two.get("motion") == pytest.approx(
        [0.1 + 10.0 * velocities[0], 0.4 + 10.0 * velocities[1]]
    )
    assert two.get("gravity") == pytest.approx([3.0 + 0.1, -7.0 + 0.4])


def test_an_arm_that_does_not_act_is_not_asked(two: Two, arm: LinearArm) -> None:
    two.set("gravity", 1.0, 2.0)
    two.laws.prepare()
    assert arm.asked == []
    assert two.get("gravity") == [1.0, 2.0]


# --- gravity compensation ------------------------------------------------------------------------


def test_gravity_is_compensated_where_it_is_wanted(two: Two, arm: LinearArm) -> None:
    """G1: asked for once for all joints."""
    two.set("lift", 0.0, 0.0)
    two.laws.compensate()
    assert arm.asked == []
    two.first.compensates = True
    two.laws.compensate()
    assert arm.asked == [(1.0, [0.1, 0.4], [0.0, 0.0], [0.0, 0.0])]
    assert two.get("lift") == pytest.approx([3.0 + 0.1, 0.0])
    assert two.get("lifts") == [True, False]
    two.first.compensates = False  # it ends with the next cycle
    two.laws.compensate()
    assert two.get("lift") == [0.0, 0.0]
    assert two.get("lifts") == [False, False]
    two.laws.compensate()
    assert len(arm.asked) == 2


@pytest.mark.parametrize("why", ["no arm", "an unknown angle"])
def test_gravity_that_is_not_known_is_not_compensated(arm: LinearArm, why: str) -> None:
    """G1: and no longer, where it was."""
    two = Two(None if why == "no arm" else arm, compensates=True, lifts=True, lift=4.0)
    two.set("calibrated", True, why != "an unknown angle")
    two.laws.compensate()
    assert two.get("lift") == [0.0, 0.0]
    assert two.get("lifts") == [False, False]
    assert arm.asked == []


def test_a_gravity_that_is_no_number_changes_nothing(two: Two, arm: LinearArm) -> None:
    two.set("compensates", True, True)
    two.set("lifts", True, True)
    two.set("lift", 1.0, 2.0)
    arm.broken = {0}
    two.laws.compensate()
    assert two.get("lift") == pytest.approx([1.0, -7.0 + 0.4])


# --- streams -------------------------------------------------------------------------------------


def motion(base: Any, t: float) -> tuple[float, float, float]:
    """Position, speed and acceleration after t: straight, or turning as a sine does."""
    if base.turning == 0.0:
        return base.x + base.v * t + 0.5 * base.a * t * t, base.v + base.a * t, base.a
    rate = math.sqrt(base.turning)
    sine, cosine = math.sin(rate * t) / rate, math.cos(rate * t)
    position = base.x + base.v * sine + base.a * (1.0 - cosine) / base.turning
    return (
        position,
        base.v * cosine + base.a * sine,
        base.a * cosine - base.turning * base.v * sine,
    )


def pursued(j: Any) -> tuple[dict[str, float], str]:
    """What a cycle gives by the docstring of ``follow_stream``, and on which branch of it."""
    stream, period, most = j.direct.stream, j.clock.period, j.limits.acceleration
    base = stream.grid if stream.on_grid else stream.sent
    age = (j.direct.age - 1.0) * period + (stream.late if stream.on_grid else 0.0)
    quick = min(
        LAWS.FREQUENCY_INTERVAL / max(stream.interval, LAWS.MIN_STREAM_INTERVAL),
        LAWS.MAX_FREQUENCY,
        0.2 / period,
    )
    goal, speed, rate = motion(base, age)
    speed, rate = clip(speed, j.limits.velocity), clip(rate, most)
    where = "free"
    if (goal >= j.reference.upper and speed > 0.0) or (goal <= j.reference.lower and speed < 0.0):
        goal, speed, rate, where = (
            min(max(goal, j.reference.lower), j.reference.upper),
            0.0,
            0.0,
            "limit",
        )
    filtered = j.direct.acceleration
    filtered += (rate - filtered) * min(3.0 * quick * period, 1.0)
    peak = max(j.direct.peak_acceleration * (1.0 - period), abs(filtered))
    mean = speed - 0.5 * filtered * period
    error = goal - j.track.position - mean * period
    off = j.track.velocity - mean + filtered * period
    brake = max(0.8 * (most - peak), 0.03 * most)
    slope = 0.5 * quick
    near = brake / slope**2
    wanted, ahead = slope * error, 0.0
    if abs(error) > near:
        wanted = math.copysign(math.sqrt(2.0 * brake * (abs(error) - 0.5 * near)), error)
        ahead = -math.copysign(min(brake * abs(off / wanted), brake), error)
        where += ", far"
    given = j.track.velocity + (filtered + ahead + 4.0 * slope * (wanted - off)) * period
    exact = mean + error / period
    if abs(exact - given) <= 0.01 * most * period:
        given, where = exact, where + ", there"
    found = {"reference.velocity": speed, "direct.velocity": speed, "given": given}
    return found | {"direct.acceleration": filtered, "direct.peak_acceleration": peak}, where


def clip(value: float, most: float) -> float:
    return min(max(value, -most), most)


def test_a_stream_is_approached_and_followed_by_the_formula() -> None:
    """P4, P14: critically damped near it, braking from far away, at rest at a limit."""
    random = np.random.default_rng(3)
    ways = set[str]()
    for _ in range(400):
        one = joint(
            clock__period=float(random.choice([0.001, 0.01, 0.1])),
            reference__lower=-1.0,
            reference__upper=1.0,
        )
        one.direct.stream.on_grid = bool(random.integers(2))
        one.direct.stream.interval = float(random.choice([0.001, 0.01, 0.05]))
        one.direct.stream.late = float(random.uniform(0.0, 0.02))
        for base in (one.direct.stream.grid, one.direct.stream.sent):
            base.x, base.v, base.a = map(float, random.uniform(-1.2, 1.2, 3) * (1.0, 4.0, 30.0))
            base.turning = float(random.choice([0.0, 9.0]))
        one.direct.age = float(random.integers(1, 4))
        one.direct.acceleration, one.direct.peak_acceleration = map(
            float, random.uniform(-5.0, 25.0, 2)
        )
        base = one.direct.stream.grid if one.direct.stream.on_grid else one.direct.stream.sent
        far = float(random.choice([0.0, 0.001, 0.3, 2.0]))
        one.track.position = base.x + far * float(random.uniform(-1.0, 1.0))
        one.track.velocity = base.v + far * float(random.uniform(-1.0, 1.0))
        if random.integers(3) == 0:  # already on its way along it
            base.a, one.direct.acceleration, one.direct.peak_acceleration = 0.0, 0.0, 0.0
            base.turning, base.v = 0.0, float(random.uniform(-0.5, 0.5))
            age = (one.direct.age - 1.0) * one.clock.period
            age += one.direct.stream.late if one.direct.stream.on_grid else 0.0
            one.track.position, one.track.velocity = (
                base.x + base.v * (age - one.clock.period),
                base.v,
            )
        expected, way = pursued(one)
        given = LAWS.follow_stream(one)
        found = {name: read(one, name) for name in expected if name != "given"}
        assert found | {"given": given} == pytest.approx(expected, rel=1e-6, abs=1e-6), way
        ways.add(way)
    assert ways >= {"free", "free, far", "free, there", "limit", "limit, far"}, ways


# --- references ----------------------------------------------------------------------------------


def led(**given: Any) -> Any:
    """A joint at its reference, 0.2 rad, at rest and without direct position unless given."""
    usual = {
        "reference.lower": -1.0,
        "reference.upper": 1.0,
        "reference.position": 0.2,
        "reference.velocity": 0.0,
    }
    usual |= {"track.position": 0.2, "track.velocity": 0.0, "track.acceleration": 0.0}
    usual |= {
        "reference.active": True,
        "trajectory.moving": False,
        "ramp.target": 0.0,
        "ramp.velocity": 0.0,
    }
    usual |= {"stop.active": False}
    usual |= {"direct.age": INFINITE, "direct.velocity": 0.0}
    one = joint(**(usual | given))
    one.direct.stream.flows = False
    return one


def test_a_reference_is_approached_as_fast_as_it_can_be_braked() -> None:
    """P14: v = v_ref ± brake_speed(distance), within speed, acceleration and position limits."""
    random = np.random.default_rng(4)
    bounds = set[str]()
    for _ in range(400):
        reference, speed = map(float, random.uniform(-1.0, 1.0, 2))
        goal_speed = float(random.choice([0.0, 0.5, -0.5]))
        one = led(
            reference__position=reference,
            reference__velocity=goal_speed,
            track__position=float(
                random.choice([reference, random.uniform(-1.0, 1.0), -0.999, 0.999])
            ),
            track__velocity=float(random.choice([0.0, 0.5, -0.5, 3.0 * speed])),
        )
        brake = lambda way: LAWS.brake_speed(way, 20.0, 0.01)  # noqa: E731
        rest = reference - one.track.position - goal_speed * 0.01
        wanted = goal_speed + math.copysign(brake(abs(rest)), rest)
        low, high = (
            -min(brake(one.track.position + 1.0), 3.0),
            min(brake(1.0 - one.track.position), 3.0),
        )
        inside = min(max(wanted, low), high)
        before = one.track.position, one.track.velocity
        velocity = min(max(inside, before[1] - 0.2), before[1] + 0.2)
        bounds |= (
            {"limit"} if inside != wanted else {"acceleration"} if velocity != inside else {""}
        )
        LAWS.follow(one)
        if one.reference.active:
            assert one.track.velocity == pytest.approx(velocity, abs=1e-12)
            assert one.track.acceleration == pytest.approx((velocity - before[1]) / 0.01)
        assert one.track.position == pytest.approx(before[0] + velocity * 0.01, abs=1e-12)
    assert bounds == {"limit", "acceleration", ""}


def test_a_planned_stop_is_followed_as_it_was_predicted() -> None:
    """M9: held back to the limit acceleration, 20, a joint would return to it afterwards."""
    one = led(
        stop__active=True,
        stop__ahead=False,
        trajectory__position=0.2,
        trajectory__velocity=1.0,
        track__velocity=1.0,
        velocity=1.0,
    )
    one.brake_by(memoryview(array("d", [-50.0, -30.0])), 2, 0.01)
    for speed in (0.5, 0.2):
        LAWS.advance(one)
        assert one.track.velocity == pytest.approx(speed, abs=1e-9)
    assert one.track.position == pytest.approx(0.207, abs=1e-9)


@pytest.mark.parametrize(
    "goes_on",
    [
        {},
        {"trajectory.moving": True},
        {"stop.active": True},
        {"ramp.target": 0.1},
        {"ramp.velocity": 0.1},
        {"direct.age": 2.0},  # a sample may follow
        {"track.position": 0.201},
        {"direct.velocity": 0.1, "direct.age": INFINITE},
    ],
)
def test_what_has_arrived_is_done(goes_on: dict[str, Any]) -> None:
    """It is not computed again until the next reference; nothing else moves it."""
    one = led(**goes_on)
    LAWS.follow(one)
    assert bool(one.reference.active) is (goes_on != {})
    if not goes_on:
        assert (one.track.position, one.track.velocity, one.track.acceleration) == (0.2, 0.0, 0.0)


def test_the_last_rounding_error_ends_at_the_reference() -> None:
    one = led(track__position=0.2 - 1e-13, trajectory__moving=True)
    LAWS.follow(one)
    assert one.track.position == 0.2
    one = led(track__position=0.2 - 1e-13, trajectory__moving=True, reference__velocity=0.5)
    LAWS.follow(one)
    assert one.track.position != 0.2


@pytest.mark.parametrize("late", [False, True])
def test_a_stream_ends_when_no_sample_comes(late: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """P4: after its patience, by whole cycles since the last one."""
    monkeypatch.setattr(LAWS.advancing, "follow_stream", lambda _: 0.0)
    one = led(
        direct__velocity=0.3,
        reference__velocity=0.3,
        direct__acceleration=4.0,
        direct__peak_acceleration=5.0,
    )
    one.direct.stream.flows, one.direct.stream.interval = True, 0.02
    cycles = one.direct.stream.patience() / one.clock.period
    one.direct.age = 1.0 + cycles + (0.5 if late else -0.5)
    LAWS.follow(one)
    assert bool(one.direct.stream.flows) is not late
    expected = (0.0, 0.0, 0.0, 0.0) if late else (0.3, 0.3, 4.0, 5.0)
    names = (
        "direct.velocity",
        "reference.velocity",
        "direct.acceleration",
        "direct.peak_acceleration",
    )
    assert tuple(read(one, name) for name in names) == expected


# --- loads ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settling", "awaited", "active", "rested", "expected"),
    [
        ((1, 1), (0, 0), (0, 0), (1, 1), (False, True)),
        ((1, 1), (0, 0), (1, 0), (1, 1), (True, True)),
        ((1, 1), (0, 0), (0, 1), (1, 1), (True, True)),
        ((1, 1), (0, 0), (0, 0), (0, 1), (False, False)),
        ((1, 1), (0, 0), (0, 0), (1, 0), (False, False)),
        ((1, 0), (0, 0), (0, 1), (1, 0), (False, True)),  # of those that settle
        ((1, 1), (0, 1), (0, 1), (1, 0), (False, True)),  # an awaited one is not waited for
    ],
)
def test_no_load_is_captured_before_all_are_at_rest(
    two: Two,
    monkeypatch: pytest.MonkeyPatch,
    settling: tuple[int, int],
    awaited: tuple[int, int],
    active: tuple[int, int],
    rested: tuple[int, int],
    expected: tuple[bool, bool],
) -> None:
    """M9: the joints that settle learn whether one brakes, and whether all rest."""
    told: list[tuple[Any, bool, bool]] = []
    monkeypatch.setattr(
        LAWS.laws, "settle", lambda j, braking, rests: told.append((j, braking, rests))
    )
    two.set("settling", *map(bool, settling))
    two.set("awaited", *map(bool, awaited))
    two.set("reference.active", *map(bool, active))
    cycles = math.ceil(LAWS.REST_TIME / two.first.clock.period)
    two.set("rest_cycles", *(cycles if one else cycles - 1 for one in rested))
    two.laws.settle_joints()
    assert [j for j, _, _ in told] == [one for one in two.joints if one.settling]
    assert {(bool(braking), bool(rests)) for _, braking, rests in told} == {expected}


# --- what a cycle reports ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limit", "strain", "news"),
    [
        ((False, False), (False, False), False),
        ((True, True), (True, True), False),
        ((False, True), (False, False), True),
        ((True, False), (False, False), True),
        ((False, False), (False, True), True),
        ((False, False), (True, False), True),
        ((False, True), (False, True), True),
    ],
)
def test_news_of_a_joint(limit: tuple[bool, bool], strain: tuple[bool, bool], news: bool) -> None:
    """It comes to a limit, or leaves it; of torque after STRAIN_TIME."""
    cycles = math.ceil(LAWS.STRAIN_TIME / 0.01)
    one = joint(was_on_limit=limit[0], on_limit=limit[1], strained=strain[0])
    one.strain_cycles = cycles if strain[1] else cycles - 1
    assert bool(LAWS.has_news(one)) is news
    assert (bool(one.was_on_limit), bool(one.strained)) == (limit[1], strain[1])
    assert not LAWS.has_news(one)


def test_a_contact_is_news_when_it_begins_and_ends() -> None:
    """X2: once each."""
    one = joint(strain_cycles=0, strained=False, on_limit=False, was_on_limit=False)
    for contact in (True, False):
        one.external.contact = contact
        assert LAWS.has_news(one)
        assert not LAWS.has_news(one)


@pytest.mark.parametrize(
    "value", ["current", "torque", "velocity", "position", "stiffness", "damping"]
)
def test_a_set_point_is_finite_where_all_its_values_are(value: str) -> None:
    names = ("current", "torque", "velocity", "position", "stiffness", "damping")
    one = joint(**{f"set_point.{name}": 2.0**k for k, name in enumerate(names)})
    assert one.set_point.total() == 63.0
    for wrong in (NAN, math.inf, -math.inf):
        setattr(one.set_point, value, wrong)
        assert not LAWS.is_number(one.set_point.total())


class Noted(LAWS.Laws):  # type: ignore[misc,name-defined]
    """Laws that note the steps of a cycle."""

    def note(self, name: str) -> None:
        self.steps: list[str]
        self.steps.append(name)

    def sense_motion(self) -> None:
        self.note("sense motion")

    def settle_joints(self) -> None:
        self.note("settle")

    def feed_forward(self) -> None:
        self.note("feed forward")

    def compensate(self) -> None:
        self.note("compensate")


@pytest.mark.parametrize("settling", [(False, False), (True, False), (False, True)])
@pytest.mark.parametrize("modelled", [True, False])
@pytest.mark.parametrize(
    ("active", "braked"), [((1, 1), (0, 0)), ((1, 0), (0, 0)), ((1, 1), (1, 0))]
)
def test_the_steps_of_a_cycle(
    two: Two,
    monkeypatch: pytest.MonkeyPatch,
    settling: tuple[bool, bool],
    modelled: bool,
    active: tuple[int, int],
    braked: tuple[int, int],
) -> None:
    """Observe, weigh, settle, advance, feed forward, compensate, control: joint after joint."""
    laws = Noted(two.joints, list(two.rows.values()), two.done, two.arm)
    laws.steps, laws.modelled = [], modelled
    for name in ("observe", "weigh", "advance", "control"):
        monkeypatch.setattr(
            LAWS.laws,
            name,
            lambda j, *_, name=name: laws.steps.append(f"{name} {two.joints.index(j)}"),
        )
    two.set("settling", *settling)
    two.set("reference.active", *map(bool, active))
    two.set("braked", *map(bool, braked))
    two.set("output", 12.0, 13.0)
    two.set("drive.kind", LAWS.AS_PWM, LAWS.AS_PWM)
    two.set("on_limit", False, False)
    two.set("was_on_limit", False, False)
    two.set("strained", False, False)
    two.set("strain_cycles", 0, 0)
    two.set("reference.position", 0.5, 0.6)
    two.set("reference.velocity", 0.7, 0.8)
    two.set("torque_reference", 0.9, 1.1)
    two.set("trajectory.moving", True, False)
    assert not laws.step()
    settles = any(settling)
    advanced = [k for k in range(2) if active[k] and not braked[k]]
    assert laws.steps == [
        "observe 0",
        "observe 1",
        *["sense motion"] * (settles and modelled),
        "weigh 0",
        "weigh 1",
        *["settle"] * settles,
        *[f"advance {k}" for k in advanced],
        "feed forward",
        "compensate",
        "control 0",
        "control 1",
    ]
    for k, one in enumerate(two.joints):
        moved = k in advanced
        assert two.rows["position_reference"][k] == (one.reference.position if moved else 0.0)
        assert two.rows["velocity_reference"][k] == (one.reference.velocity if moved else 0.0)
        assert two.done[k] == (not one.trajectory.moving if moved else 5)
        assert two.rows["torque_reference"][k] == one.torque_reference
        assert two.rows["output"][k] == one.output


@pytest.mark.parametrize("wrong", [{"output": NAN}, {"output": 1e9}, {"set_point.torque": NAN}])
def test_an_output_that_is_not_finite_is_never_written(
    two: Two, monkeypatch: pytest.MonkeyPatch, wrong: dict[str, float]
) -> None:
    """F1: the joint gives up at its reference, at rest, and that is news."""
    laws = Noted(two.joints, list(two.rows.values()), two.done, two.arm)
    laws.steps = []
    two.set("drive.kind", LAWS.AS_PWM, LAWS.AS_PWM)

    def control(j: Any) -> None:
        for name, value in ({"output": 1.0} | (wrong if j is two.second else {})).items():
            write(j, name, value)

    monkeypatch.setattr(LAWS.laws, "control", control)
    monkeypatch.setattr(LAWS.laws, "has_news", lambda _: False)
    two.set("reference.active", False, False)
    for name in ("current", "torque", "velocity", "position", "stiffness", "damping"):
        two.set(f"set_point.{name}", 0.0, 0.0)
    two.rows["velocity_reference"][1] = 9.0
    assert laws.step()
    assert two.rows["output"][0] == 1.0
    assert math.isfinite(two.rows["output"][1])
    assert two.rows["output"][1] == 0.0
    assert two.rows["position_reference"][1] == two.second.reference.position
    assert two.rows["velocity_reference"][1] == 0.0
