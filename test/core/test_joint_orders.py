# SPDX-License-Identifier: Apache-2.0
"""core.laws, what is asked of a joint: each request, and that it changes nothing else.

Some of it are C functions where the laws are compiled; here they are the same as plain Python.
"""

from __future__ import annotations

import math
from array import array
from typing import Any

import pytest
from joint_parts import read
from lone_joint import INFINITE, LAWS, changes, joint


def test_a_new_joint() -> None:
    """Bounds are unknown, no set-point is given, nothing was asked of it."""
    made = LAWS.Joint()
    assert (made.reference.lower, made.reference.upper) == (-INFINITE, INFINITE)
    assert made.direct.age == INFINITE
    for name in ("current", "torque", "velocity", "position", "stiffness", "damping"):
        assert getattr(made.set_point, name) == 0.0
    assert (made.was_on_limit, made.diverged, made.strained) == (False, False, False)
    assert made.drive.kind == LAWS.AS_PWM
    for pid in (made.position_pid, made.torque_pid, made.current_pid):
        assert [pid.kp, pid.ki_period, pid.kd, pid.kff, pid.limit, pid.fall, pid.alpha] == [0] * 7
        assert [pid.integral, pid.previous, pid.derivative, pid.error, pid.room] == [0] * 5


def test_a_pid_starts_with_an_integral_within_its_limit() -> None:
    pid = LAWS.Pid()
    pid.limit, pid.room, pid.derivative, pid.error, pid.reference = 2.0, 1.0, 1.0, 1.0, 1.0
    for given, taken in ((1.5, 1.5), (2.5, 2.0), (-2.5, -2.0)):
        pid.reset(given)
        assert (pid.integral, pid.previous) == (taken, taken)
        assert (pid.room, pid.derivative, pid.error, pid.reference) == (0.0,) * 4
    pid.kff, pid.reference, pid.kp, pid.error, pid.kd, pid.derivative = (
        2.0,
        3.0,
        5.0,
        7.0,
        11.0,
        13.0,
    )
    assert pid.feed() == 6.0 + 35.0 + 143.0


@pytest.mark.parametrize(("velocity", "followed"), [
    (0.0, 0.0), (0.0059, 0.0), (0.0061, 0.0061), (-1.0, -1.0), (5.0, 3.0), (-5.0, -3.0),
])  # fmt: skip
def test_to_hold(velocity: float, followed: float) -> None:
    """At a position, from the speed that the joint has; at rest below 0.002 of its limit."""
    one = joint(
        velocity=velocity,
        trajectory__moving=True,
        ramp__is_step=True,
        reference__active=not followed,
    )
    one.track.velocity = 8.0
    prior = one.track.acceleration if velocity == 0.0 else 0.0  # else inactive, or speeding up
    zeros = "ramp.way ramp.velocity ramp.target track.acceleration direct.velocity"
    expected = dict.fromkeys(zeros.split(), 0.0) | {
        "trajectory.moving": False,
        "ramp.is_step": False,
        "stop.ahead": False,
    }
    expected |= dict.fromkeys(
        ("trajectory.position", "reference.position", "track.position"), 1.25
    )
    speeds = ("trajectory.velocity", "reference.velocity", "track.velocity")
    expected |= dict.fromkeys(speeds, followed)
    expected |= dict.fromkeys(("stop.active", "stop.due", "reference.active"), followed != 0.0)
    expected |= {"stop.rate": 20.0, "stop.renewal_speed": INFINITE, "plan.steps": 0}
    expected |= {"stop.prior_rate": prior, "reference.comes_to_rest": True, "direct.age": INFINITE}
    assert changes(one, "hold", 1.25) == expected
    assert (one.direct.stream.count, one.direct.stream.flows) == (0.0, False)


@pytest.mark.parametrize("velocity", [1.0, -1.0])
@pytest.mark.parametrize("acceleration", [7.0, -7.0])
def test_to_hold_where_the_reference_braked(velocity: float, acceleration: float) -> None:
    """How much it braked, not how much it sped up, is known to the stop."""
    one = joint(velocity=velocity, reference__active=True, track__acceleration=acceleration)
    one.hold(1.25)
    assert one.stop.prior_rate == (7.0 if acceleration * velocity < 0.0 else 0.0)


@pytest.mark.parametrize(("time", "lasts"), [(2.0, 2.0), (0.001, 0.01)])
def test_to_move(time: float, lasts: float) -> None:
    """From where the reference is, with its velocity; one cycle at least."""
    one = joint(
        reference__position=0.5,
        trajectory__velocity=0.2,
        settling=True,
        reference__active=False,
        trajectory__moving=False,
    )
    assert changes(one, "move", 1.5, time, 0.3) == {
        "reference.active": True,
        "trajectory.moving": True,
        "stop.active": False,
        "trajectory.start": 0.5,
        "trajectory.start_velocity": 0.2,
        "trajectory.target": 1.5,
        "trajectory.time": lasts,
        "trajectory.brake_time": 0.3,
        "trajectory.brakes_evenly": False,
        "trajectory.cycles": 0.0,
        "trajectory.position": 0.5,
        "ramp.way": 0.0,
        "awaited": True,
    }


def test_to_ramp_a_velocity() -> None:
    one = joint(reference__active=False, settling=False)
    assert changes(one, "ramp_to", 0.4, 2.0) == {
        "reference.active": True,
        "ramp.target": 0.4,
        "ramp.step": 0.02,
        "awaited": False,
    }


def test_a_velocity_at_once_and_its_end() -> None:
    """Y1, P12: halted as it was driven; else as hard as the joint may."""
    one = joint(reference__active=False, ramp__is_step=False, settling=True)
    at_once = dict.fromkeys(("ramp.target", "ramp.velocity", "reference.velocity"), 0.4)
    at_once |= {
        "reference.active": True,
        "ramp.is_step": True,
        "ramp.step": INFINITE,
        "awaited": True,
    }
    at_once |= {"stop.active": False}
    assert changes(one, "drive_at", 0.4) == at_once
    stopped = dict.fromkeys(("ramp.target", "ramp.velocity", "reference.velocity"), 0.0)
    assert changes(one, "halt") == stopped
    other = joint(reference__active=False, ramp__is_step=False, settling=True)
    assert changes(other, "halt") == {
        "reference.active": True,
        "ramp.target": 0.0,
        "ramp.step": 0.2,
        "awaited": True,
    }


@pytest.mark.parametrize(
    ("velocity", "given"), [(None, 0.0), (0.7, 0.7), (9.0, 3.0), (-9.0, -3.0)]
)
def test_a_direct_position(velocity: float | None, given: float) -> None:
    """P4: the reference is there; its velocity is what its stream shows."""
    one = joint(
        direct__age=INFINITE, reference__active=False, trajectory__moving=True, settling=True
    )
    zeros = "ramp.way trajectory.velocity ramp.velocity ramp.target reference.velocity direct.age"
    expected = dict.fromkeys(zeros.split(), 0.0) | {
        "trajectory.position": 0.8,
        "reference.position": 0.8,
    }
    expected |= {
        "reference.active": True,
        "trajectory.moving": False,
        "awaited": True,
        "direct.velocity": given,
    }
    expected |= {"direct.alone": True, "direct.sample_age": 0.0}
    expected |= {"stop.active": False}
    arguments = (0.8,) if velocity is None else (0.8, velocity)
    method = "step_to" if velocity is None else "step_with"
    assert changes(one, method, *arguments) == expected
    assert (one.direct.stream.last, one.direct.stream.count) == (0.8, 1.0)
    one.direct.age = 2.0
    one.step_to(0.81)
    assert (one.direct.stream.last, one.direct.stream.count) == (0.81, 2.0)


# --- rest and load -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("readings", "velocity", "acceleration", "rests"),
    [
        (2, 0.006, 0.6, True),  # 0.002 of the speed, 0.005 of the torque over J
        (1, 0.0, 0.0, False),
        (2, 0.0061, 0.0, False),
        (2, -0.0061, 0.0, False),
        (2, 0.0, 0.61, False),
        (2, 0.0, -0.61, False),
    ],
)
def test_rest(readings: int, velocity: float, acceleration: float, rests: bool) -> None:
    one = joint(readings=readings, velocity=velocity, acceleration=acceleration)
    assert bool(one.at_rest()) is rests


def test_the_load_is_known_after_30_ms_of_rest() -> None:
    one = joint(rest_cycles=3, load=4.0, torque=10.0, motion=3.0)
    assert one.known_load() == 4.0
    one.rest_cycles = 2
    assert one.known_load() == 7.0


def test_the_load_on_a_wire_is_the_filtered_one() -> None:
    """B7: torque and acceleration of one reading belong to other times."""
    one = joint(rest_cycles=0, load=4.0, torque=10.0, motion=3.0, wire__max_age=0.01)
    assert one.known_load() == 4.0
    one.start(LAWS.TORQUE, False)
    assert one.load == 4.0


def test_torque_of_a_feedforward() -> None:
    one = joint(feeds=True, drive__per_torque=2.0, output_offset=3.0, drive__per_feed=5.0)
    assert one.feed_torque() == 7.5
    one.feeds = False
    assert one.feed_torque() == 0.0
    one.feeds, one.drive.per_torque = True, 0.0
    assert one.feed_torque() == 0.0


def observed(one: Any, position: float, velocity: float) -> None:
    LAWS.observe(one, position, velocity, 0.0)


def test_a_reading() -> None:
    """A = Δq̇/T from the second one on; without a sensor the current is the torque."""
    one = joint(
        readings=0,
        velocity=1.0,
        motor__has_torque_sensor=False,
        current=2.0,
        motor__torque_per_ampere=3.0,
    )
    observed(one, 0.5, 1.5)
    assert (one.position, one.velocity, one.acceleration, one.motion) == (0.5, 1.5, 0.0, 0.0)
    assert (one.torque, one.readings) == (6.0, 1)
    one.motor.has_torque_sensor, one.torque = True, 9.0
    observed(one, 0.6, 1.7)
    assert one.acceleration == pytest.approx(20.0)
    assert one.motion == pytest.approx(10.0)
    assert (one.torque, one.readings) == (9.0, 2)
    observed(one, 0.6, 1.7)
    assert (one.readings, one.acceleration) == (2, 0.0)


def test_cycles_at_rest_are_counted() -> None:
    one = joint(readings=2, rest_cycles=0, motor__has_torque_sensor=True)
    for _ in range(3):
        observed(one, 0.5, 0.0)
    assert one.rest_cycles == 3
    observed(one, 0.5, 1.0)
    assert one.rest_cycles == 0
    one.rest_cycles, one.velocity, one.sampled = 999_999, 0.0, 0.0
    observed(one, 0.5, 0.0)
    observed(one, 0.5, 0.0)
    assert one.rest_cycles == 1_000_000


def test_the_load_is_filtered() -> None:
    """10 ms; at first, and in longer cycles, it is what is measured."""
    one = joint(clock__period=0.002, readings=2, torque=10.0, motion=4.0, load=1.0)
    LAWS.weigh(one)
    assert one.load == pytest.approx(1.0 + 0.2 * 5.0)
    for changed in ({"readings": 1}, {"clock.period": 0.01}, {"clock.period": 0.02}):
        one = joint(
            **({"clock.period": 0.002, "readings": 2, "torque": 10.0, "motion": 4.0} | changed)
        )
        LAWS.weigh(one)
        assert one.load == 6.0


def test_the_load_on_a_wire_is_weighed_between_two_readings() -> None:
    """B7: with the mean torque of both, and not again without a new one."""
    weighed = {"clock.period": 0.002, "readings": 2, "motion": 4.0, "wire.max_age": 0.01}
    one = joint(**weighed, torque=10.0, weighed_torque=6.0, load=1.0)
    LAWS.weigh(one)
    assert one.load == pytest.approx(1.0 + 0.2 * (8.0 - 4.0 - 1.0))
    assert one.weighed_torque == 10.0
    before, one.wire.silence = one.load, 0.002
    one.torque = 30.0
    LAWS.weigh(one)
    assert (one.load, one.weighed_torque) == (before, 10.0)
    one.wire.max_age = 0.0
    LAWS.weigh(one)
    assert one.weighed_torque == 30.0


def test_an_old_reading_goes_on_with_what_was_accelerated_since() -> None:
    """B7: ∫a_ref dt over its age, of the laws that feed the reference's acceleration forward."""
    one = joint(law=LAWS.POSITION, reference__active=True, clock__period=0.01)
    for acceleration in (5.0, 2.0, 3.0):
        one.track.acceleration = acceleration
        LAWS.note_feed(one)
    for age, expected in ((0.0, 0.0), (0.01, 0.03), (0.024, 0.05), (0.03, 0.1), (9.0, 0.1)):
        assert one.history.speed_since(age, one.clock.period) == pytest.approx(
            expected, abs=1e-12
        ), age
    for fed in ({"reference.active": False}, {"law": LAWS.TORQUE, "settling": False}):
        idle = joint(
            **({"law": LAWS.POSITION, "reference.active": True, "track.acceleration": 5.0} | fed)
        )
        LAWS.note_feed(idle)
        assert idle.history.speed_since(0.01, idle.clock.period) == 0.0
    one.track.acceleration = 0.0
    for _ in range(LAWS.HISTORY_CYCLES):  # the oldest are forgotten
        LAWS.note_feed(one)
    assert one.history.speed_since(9.0, one.clock.period) == 0.0
    one.track.acceleration, one.wire.silence = 4.0, 0.0
    LAWS.observe(one, 1.0, 2.0, 0.01)
    assert one.velocity == pytest.approx(2.0 + 0.04)
    assert one.position == pytest.approx(1.0 + 0.01 * (2.0 + 0.02))


# --- a law begins --------------------------------------------------------------------------------


STARTED = {
    "torque": 12.0,
    "motion": 2.0,
    "gravity": 3.0,
    "feeds": False,
    "track.position": 0.5,
    "drive.per_torque": 1.0,
    "rest_cycles": 0,
    "readings": 2,
    "acceleration": 0.0,
    "lift": 1.0,
    "torque_offset": 4.0,
}


@pytest.mark.parametrize("law", ["POSITION", "IMPEDANCE", "TORQUE", "OUTPUT", "CURRENT"])
def test_a_law_takes_over_the_load(law: str) -> None:
    """M9: a joint at rest; what its loops integrate begins with what carries it."""
    number = getattr(LAWS, law)
    one = joint(**STARTED)
    found = changes(one, "start", number)
    expected = dict.fromkeys(("on_limit", "awaited", "settling"), False)
    expected |= dict.fromkeys(("settle_cycles", "wait_cycles", "strain_cycles"), 0)
    expected |= {"load": 10.0, "torque_reference": 12.0, "torque_command": 9.0}
    expected |= {
        "current_command": 0.0,
        "set_point.request": 12.0,
        "load_taken": 5.0,
        "hold_place": 0.5,
    }
    expected |= {"holding": number in (LAWS.TORQUE, LAWS.CURRENT)}
    if number != LAWS.POSITION:
        expected |= {"law": number}
    if number == LAWS.OUTPUT:  # it brakes nothing
        speeds = ("trajectory.velocity", "reference.velocity", "track.velocity")
        expected |= dict.fromkeys(speeds, 0.0) | dict.fromkeys(
            ("reference.active", "stop.active", "stop.due"), False
        )
    assert found == expected
    assert one.position_pid.integral == 10.0 - 3.0 - 0.5 * 0.5
    assert one.torque_pid.integral == 12.0 - 0.5 * 10.0
    assert one.current_pid.integral == 0.0


def test_a_law_that_ends() -> None:
    """Its output is nothing, and nothing is taken over."""
    one = joint(**STARTED)
    found = changes(one, "start", LAWS.OFF)
    assert (one.output, one.law) == (0.0, LAWS.OFF)
    assert "load_taken" not in found
    assert one.torque_command == 12.0
    assert not one.holding
    assert one.torque_pid.integral == 0.0


@pytest.mark.parametrize(("torque", "asked"), [(300.0, 80.0), (-300.0, -80.0)])
def test_the_requested_drive_is_bounded(torque: float, asked: float) -> None:
    one = joint(**(STARTED | {"torque": torque}))
    one.start(LAWS.POSITION)
    assert one.set_point.request == asked


@pytest.mark.parametrize("law", ["POSITION", "IMPEDANCE", "TORQUE", "OUTPUT", "CURRENT"])
@pytest.mark.parametrize(("velocity", "resting"), [(1.0, True), (0.0, False), (1.0, False)])
def test_laws_that_follow_a_torque_wait_for_rest(law: str, velocity: float, resting: bool) -> None:
    """Of the joint and of the others; meanwhile nothing is taken over."""
    number = getattr(LAWS, law)
    waits = number in (LAWS.IMPEDANCE, LAWS.TORQUE, LAWS.CURRENT)
    one = joint(**(STARTED | {"velocity": velocity, "load_taken": 77.0}))
    one.start(number, resting)
    assert bool(one.settling) is waits
    assert (one.load_taken == 77.0) is waits


def test_a_load_that_is_known_counts_where_the_others_rest() -> None:
    for resting, load in ((True, 6.0), (False, 10.0)):
        one = joint(**(STARTED | {"rest_cycles": 3, "load": 6.0}))
        one.start(LAWS.POSITION, resting)
        assert one.load == load


def test_a_feed_is_no_load() -> None:
    one = joint(**(STARTED | {"feeds": True, "output_offset": 2.0, "drive.per_feed": 1.0}))
    one.start(LAWS.POSITION)
    assert one.position_pid.integral == 10.0 - 3.0 - 2.0 - 0.25
    assert one.torque_pid.integral == 12.0 - 5.0 - 2.0


# --- torques and currents ------------------------------------------------------------------------


@pytest.mark.parametrize("settling", [True, False])
def test_a_torque_offset_replaces_the_load(settling: bool) -> None:
    """P11: one that waits for its rest takes the load that is known."""
    one = joint(**STARTED, settling=settling, offset_given=False)
    one.offer_torque(7.0)
    assert (one.torque_offset, one.load_taken, one.offset_given) == (7.0, 0.0, True)
    assert not one.settling
    assert (one.torque_command == 9.0) is settling


@pytest.mark.parametrize("settling", [True, False])
def test_a_torque_command_ends_holding(settling: bool) -> None:
    one = joint(**STARTED, settling=settling, holding=True, load_taken=77.0)
    one.law = LAWS.TORQUE
    one.command_torque(7.0)
    assert (one.torque_command, one.holding, one.settling) == (7.0, False, False)
    assert (one.load_taken == 77.0) is not settling


def test_a_current_command_ends_waiting() -> None:
    one = joint(settling=True, awaited=True, holding=True, stop__active=False)
    assert changes(one, "command_current", 2.0) == {
        "settling": False,
        "awaited": False,
        "holding": False,
        "current_command": 2.0,
    }


def test_gravity_is_added_without_a_jump() -> None:
    """G1: where the joint compensates it, and the arm is known."""
    one = joint(compensates=True, lifts=False, lift=0.0, load_taken=10.0, torque_command=20.0)
    one.carry(3.0, False)
    assert (one.lifts, one.lift, one.load_taken, one.torque_command) == (False, 0.0, 10.0, 20.0)
    one.carry(3.0, True)
    assert (one.lifts, one.lift, one.load_taken, one.torque_command) == (True, 3.0, 7.0, 17.0)
    one.carry(5.0, True)  # it changes with the pose
    assert (one.lift, one.load_taken, one.torque_command) == (5.0, 7.0, 17.0)
    one.compensates = False
    one.carry(5.0, True)
    assert (one.lifts, one.lift, one.load_taken, one.torque_command) == (False, 0.0, 12.0, 22.0)


def test_to_give_up() -> None:
    """What led to an output that is no number is forgotten; the joint is where it is."""
    one = joint(diverged=False, position=0.3, velocity=1.0)
    one.give_up()
    zeros = "output torque_reference load set_point.request"
    zeros += " set_point.current set_point.torque set_point.velocity"
    assert all(read(one, name) == 0.0 for name in zeros.split())
    assert (one.readings, one.rest_cycles, one.diverged) == (0, 0, True)
    for pid in (one.position_pid, one.torque_pid, one.current_pid):
        assert (pid.integral, pid.error, pid.derivative) == (0.0, 0.0, 0.0)
    assert (one.reference.position, one.track.position, one.track.velocity) == (0.3, 0.3, 1.0)


# --- the end of settling -------------------------------------------------------------------------


SETTLING = {
    "settling": True,
    "awaited": False,
    "reference.active": False,
    "wait_cycles": 0,
    "load": 5.0,
}
SETTLING |= {"lift": 0.0, "torque_offset": 0.0, "torque": 0.0, "feeds": False, "rest_cycles": 0}


def cycles_to_settle(
    most: int = 400, *, braking: bool = False, rested: bool = False, **at: float
) -> int:
    """Cycles of 10 ms until a joint has taken its load over."""
    one = joint(**(SETTLING | {"settle_cycles": 0} | at))
    for k in range(1, most + 1):
        LAWS.settle(one, braking, rested)
        if not one.settling:
            assert one.load_taken == 5.0
            return k
    return 0


def test_how_long_a_joint_settles() -> None:
    """30 ms where all rest, half a second else; 50 ms or its own rest where a reference waits."""
    assert cycles_to_settle(rested=True) == 3
    assert cycles_to_settle() == 50
    assert cycles_to_settle(awaited=True) == 5
    assert cycles_to_settle(awaited=True, rested=True) == 5
    assert cycles_to_settle(awaited=True, rest_cycles=3) == 3
    assert cycles_to_settle(awaited=True, rest_cycles=2) == 5
    assert cycles_to_settle(reference__active=True, rested=True) == 0  # it still brakes
    assert cycles_to_settle(reference__active=True, awaited=True) == 5


def test_waiting_time_for_other_joints() -> None:
    """3 s, which do not count as settling; one whose reference waits does not."""
    assert cycles_to_settle(braking=True, rested=True) == 299 + 3
    assert cycles_to_settle(braking=True) == 299 + 50
    assert cycles_to_settle(braking=True, awaited=True) == 5


# --- moves and ramps -----------------------------------------------------------------------------


def test_braking_in_whole_cycles() -> None:
    """D = k v T − a T² k(k − 1)/2 for the least k."""
    for distance in (1e-4, 0.003, 0.02, 0.5, 7.0):
        speed = LAWS.brake_speed(distance, 20.0, 0.01)
        k = next(k for k in range(1, 10**4) if speed <= 20.0 * 0.01 * k * (1 + 1e-12))
        assert distance == pytest.approx(k * speed * 0.01 - 20.0 * 1e-4 * k * (k - 1) / 2)
    assert LAWS.brake_speed(0.0, 20.0, 0.01) == LAWS.brake_speed(-1.0, 20.0, 0.01) == 0.0
    assert LAWS.brake_speed(LAWS.FAR_DISTANCE * 1.01, 20.0, 0.01) == LAWS.FAR_DISTANCE
    assert LAWS.brake_speed(LAWS.FAR_DISTANCE, 20.0, 0.01) < LAWS.FAR_DISTANCE


@pytest.mark.parametrize(
    ("velocity", "time", "brake"),
    [(0.0, 1.0, 0.0), (0.4, 1.0, 0.0), (-0.5, 0.8, 0.3), (0.5, 0.3, 0.8)],
)
def test_a_move_from_cycle_to_cycle(velocity: float, time: float, brake: float) -> None:
    """P1: the quintic, and what is braked beside it; on its target in the last one."""
    one = joint(
        trajectory__moving=True,
        trajectory__cycles=0.0,
        trajectory__start=0.2,
        trajectory__target=1.2,
    )
    one.trajectory.start_velocity, one.trajectory.time, one.trajectory.brake_time = (
        velocity,
        time,
        brake,
    )
    one.trajectory.brakes_evenly = False
    end = max(time, brake)
    for k in range(1, round(end / 0.01) + 1):
        LAWS.advance_move(one.trajectory, one.clock, one.limits)
        t = 0.01 * k
        if k == round(end / 0.01):
            assert (one.trajectory.moving, one.trajectory.position, one.trajectory.velocity) == (
                False,
                1.2,
                0.0,
            )
            return
        u = min(t / brake, 1.0) if brake else 0.0
        reach = 1.0 - 0.5 * velocity * brake
        run = 0.0 if brake else velocity * time
        s = min(t / time, 1.0)
        a, b, c = 10 * reach - 6 * run, 8 * run - 15 * reach, 6 * reach - 3 * run
        way = run * s + a * s**3 + b * s**4 + c * s**5
        speed = (run + 3 * a * s**2 + 4 * b * s**3 + 5 * c * s**4) / time if s < 1.0 else 0.0
        way += velocity * brake * (u - u**3 + 0.5 * u**4)
        if brake and u < 1.0:
            speed += velocity * (1 - 3 * u**2 + 2 * u**3)
        assert one.trajectory.position == pytest.approx(0.2 + way)
        assert one.trajectory.velocity == pytest.approx(speed, abs=1e-12)
        assert one.trajectory.moving


@pytest.mark.parametrize("velocity", [0.5, -0.5, 0.19, 2.9])
def test_a_stop_from_cycle_to_cycle(velocity: float) -> None:
    """M9, P3: at the acceleration limit to rest, where the joint is held; never back."""
    one = joint(reference__lower=-INFINITE, reference__upper=INFINITE, ramp__way=0.0)
    one.velocity, one.position = velocity, 0.3
    one.hold(0.3)
    way, speed = 0.0, abs(velocity)
    while one.stop.active:
        LAWS.advance_stop(one)
        one.position, one.velocity = one.trajectory.position, one.trajectory.velocity
        speed = max(speed - 0.2, 0.0)
        way += speed * 0.01
        assert one.trajectory.velocity == pytest.approx(math.copysign(speed, velocity), abs=1e-12)
        assert one.trajectory.position == pytest.approx(0.3 + math.copysign(way, velocity))
    assert one.trajectory.velocity == 0.0


def test_a_stop_by_a_plan() -> None:
    """M9: the planned accelerations, each for its step; what is left brakes at the limit."""
    one = joint(
        reference__lower=-INFINITE,
        reference__upper=INFINITE,
        ramp__way=0.0,
        velocity=1.0,
        position=0.0,
    )
    one.hold(0.0)
    one.brake_by(memoryview(array("d", [-5.0, 2.0, -40.0, 9.0])), 3, 0.02)
    speeds = []
    while one.stop.active:
        LAWS.advance_stop(one)
        one.position, one.velocity = one.trajectory.position, one.trajectory.velocity
        speeds.append(one.trajectory.velocity)
    assert speeds == pytest.approx([0.95, 0.9, 0.92, 0.94, 0.54, 0.14, 0.0])
    assert one.plan.steps == 0
    one.hold(0.0)
    one.brake_by(memoryview(array("d", [-5.0])), 1, 0.02)
    one.brake(4.0)
    LAWS.advance_stop(one)
    assert one.trajectory.velocity == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("position", "velocity", "ramp", "goes_on"),
    [
        (0.31, 0.5, 0.0, True),
        (0.29, -0.5, 0.0, True),
        (0.29, 0.5, 0.0, False),
        (0.31, 0.0059, 0.0, False),
        (0.31, 0.5, 0.1, True),
        (0.31, 0.5, 0.6, False),
        (0.29, 0.5, 0.6, False),
    ],
)
def test_a_joint_that_runs_past_the_end_of_its_stop_is_not_driven_back(
    position: float, velocity: float, ramp: float, goes_on: bool
) -> None:
    """M9: it lacked torque; it stops from where it is. What follows a ramp has not run past."""
    one = joint(
        reference__lower=-INFINITE,
        reference__upper=INFINITE,
        ramp__way=0.0,
        stop__active=True,
        plan__steps=0,
    )
    one.ramp.velocity = ramp
    one.trajectory.position, one.trajectory.velocity, one.stop.rate = 0.3, 0.0, 1.0
    one.position, one.velocity = position, velocity
    LAWS.advance_stop(one)
    assert bool(one.stop.active) is goes_on
    assert one.trajectory.position == (position if goes_on else 0.3)
    if goes_on:
        assert (one.track.position, one.track.velocity) == (position, velocity)
        assert (one.trajectory.velocity, one.stop.rate) == (velocity, 20.0)


def test_a_stop_ends_at_a_limit() -> None:
    """P9: of a joint that is too fast to come to rest before it."""
    for velocity in (2.0, -2.0):
        one = joint(
            reference__lower=0.25,
            reference__upper=0.35,
            ramp__way=0.0,
            velocity=velocity,
            position=0.3,
        )
        one.hold(0.3)
        for _ in range(5):
            LAWS.advance_stop(one)
        assert (one.trajectory.position, one.trajectory.velocity, one.stop.active) == (
            0.3 + math.copysign(0.05, velocity), 0.0, False,
        )  # fmt: skip


@pytest.mark.parametrize("velocity", [1.5, -1.5, 9.0])
def test_a_stop_without_the_torque_for_it_goes_on_with_the_joint(velocity: float) -> None:
    """P14, M9: the reference is not left behind, to come back to."""
    one = joint(velocity=velocity, stop__active=True, ramp__way=0.1, forward=3.0)
    one.track.acceleration = 4.0
    LAWS.stay(one, 0.7)
    speed = min(velocity, 3.0)
    assert (one.track.position, one.trajectory.position) == (0.7, pytest.approx(0.6))
    assert (one.track.velocity, one.trajectory.velocity) == (speed, speed)
    assert (one.track.acceleration, one.forward) == (0.0, 3.0 - 0.5 * 4.0)


def ramped(**at: float) -> Any:
    free = {
        "reference.lower": -INFINITE,
        "reference.upper": INFINITE,
        "reference.position": 0.0,
        "trajectory.velocity": 0.0,
    }
    free |= {"ramp.velocity": 0.0, "ramp.step": 0.1, "ramp.way": 0.5}
    one = joint(**(free | at))
    LAWS.advance_ramp(one)
    return one


@pytest.mark.parametrize(
    ("at", "velocity"),
    [
        ({"ramp.target": 1.0}, 0.1),
        ({"ramp.target": -1.0}, -0.1),
        ({"ramp.target": 0.05}, 0.05),
        ({"ramp.target": 5.0, "ramp.velocity": 2.95}, 3.0),  # the speed limit
        ({"ramp.target": -5.0, "ramp.velocity": -2.95}, -3.0),
        ({"ramp.target": 1.0, "ramp.velocity": 1.0, "trajectory.velocity": 2.5}, 0.5),
        ({"ramp.target": -1.0, "ramp.velocity": -1.0, "trajectory.velocity": -2.5}, -0.5),
        ({"ramp.target": 1.0, "ramp.velocity": 1.0, "reference.upper": 0.0}, 0.0),  # on its limit
        ({"ramp.target": -1.0, "ramp.velocity": -1.0, "reference.lower": 0.0}, 0.0),
        (
            {"ramp.target": 1.0, "ramp.velocity": 1.0, "reference.upper": 0.002},
            0.2,
        ),  # one cycle from it
        ({"ramp.target": -1.0, "ramp.velocity": -1.0, "reference.lower": -0.002}, -0.2),
        (
            {
                "ramp.target": 1.0,
                "ramp.velocity": 1.0,
                "reference.upper": 0.3,
                "reference.position": 0.298,
            },
            0.2,
        ),
    ],
)
def test_a_velocity_is_ramped_within_speed_and_limits(
    at: dict[str, float], velocity: float
) -> None:
    """P5, P14."""
    one = ramped(**at)
    assert one.ramp.velocity == pytest.approx(velocity)
    assert one.ramp.way == pytest.approx(0.5 + 0.01 * velocity)


def test_a_late_current_is_compared_with_the_reference_of_its_time() -> None:
    """B7, P10: what the wire keeps is no error, and no reading is integrated twice."""
    one = joint(clock__period=0.01, motor__ohms=2.0, wire__max_age=0.03, wire__age=0.03)
    loop = one.current_pid
    loop.kp, loop.ki_period, loop.limit, loop.integral = 1.0, 0.1, 50.0, 0.0
    for reference in (1.0, 2.0, 3.0, 4.0):
        LAWS.note_feed(one)
        loop.reference = reference
    LAWS.note_feed(one)
    calm = LAWS.WIRE_PHASE * 2.0 / (1.0 + 10.0 * 0.03)
    one.current = 1.0  # as asked for three periods ago
    assert LAWS.late_feedback(one, 5.0) == 0.0
    one.current = 0.5
    assert LAWS.late_feedback(one, 5.0) == pytest.approx(0.5 * calm + 0.05 * calm)
    one.wire.silence = 0.01  # the same reading again
    assert LAWS.late_feedback(one, 5.0) == pytest.approx(0.05 * calm)
    assert loop.reference == 5.0
    one.wire.silence, loop.kp, loop.ki_period = 0.0, 0.1, 0.0  # within the phase: as configured
    assert LAWS.late_feedback(one, 5.0) == pytest.approx(0.5 * 0.1 + 0.05 * calm)
