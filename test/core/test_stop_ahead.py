# SPDX-License-Identifier: Apache-2.0
"""A stop that the board's torque brakes: its acceleration is fed forward (SPEC M9, P3)."""

from __future__ import annotations

import math
from array import array
from typing import Any

import pytest
from joints import OneJoint, gains, started
from lone_joint import LAWS, joint

from control_board_ros.core.terms.modes import Law

PERIOD = 0.01
RATE = 20.0


class Mass:
    """1 kg·m² at a speed, braked by the torque that the joint's law gives, by feed-forward alone.

    ``acceleration``: its own, and the reference's, in the cycle before the stop.

    Attributes: one (the joint), position, velocity (of the mass).
    """

    def __init__(
        self, speed: float, law: int = Law.POSITION, acceleration: float = 0.0, **constants: Any
    ) -> None:
        self.one: OneJoint = started(law, **({"clock__period": PERIOD} | constants))
        gains(self.one.joint.position_pid, kp=0.0)
        self.position, self.velocity = 0.1, speed
        self.read()
        track, reference = self.one.joint.track, self.one.joint.reference
        track.acceleration, reference.active = acceleration, True
        self.one.joint.hold(self.position)
        self.step(torque=acceleration)

    def take_off(self) -> None:
        """Its reference is where it is, as that of a plan, and brakes from the next cycle on."""
        joint = self.one.joint
        joint.track.position = joint.trajectory.position = self.position
        joint.track.velocity = joint.trajectory.velocity = self.velocity
        joint.track.acceleration = 0.0
        self.step(torque=0.0)

    def read(self) -> None:
        """Measure it, and run the law."""
        self.one.set(position=self.position, velocity=self.velocity)
        self.one.step()

    def step(self, torque: float | None = None, period: float = PERIOD) -> None:
        """A period of its motion, by the law's torque unless given, then a cycle."""
        rate = self.one.get("output") if torque is None else torque
        self.position += period * (self.velocity + 0.5 * period * rate)
        self.velocity += period * rate
        self.read()

    def track(self) -> tuple[float, float]:
        """The reference's position and velocity."""
        return self.one.joint.track.position, self.one.joint.track.velocity


@pytest.mark.parametrize("speed", [1.53, -1.53, 0.05])
def test_a_reference_is_where_its_torque_brings_a_mass(speed: float) -> None:
    """From the first cycle to rest: there is nothing for the feedback to do."""
    mass = Mass(speed)
    place = mass.position
    mass.take_off()
    for _ in range(12):
        assert mass.track() == pytest.approx((mass.position, mass.velocity), abs=1e-12)
        mass.step()
    assert mass.velocity == pytest.approx(0.0, abs=1e-12)
    assert not mass.one.joint.stop.active
    way = abs(speed) * PERIOD + speed * speed / (2.0 * RATE)
    assert abs(mass.position - place) == pytest.approx(way, abs=RATE * PERIOD * PERIOD)


@pytest.mark.parametrize("speed", [1.53, -1.53])
def test_where_torque_suffices_a_reference_brakes_since_the_last_cycle(speed: float) -> None:
    """P3: the feedback makes up for what the joint has not braked yet."""
    mass = Mass(speed)
    place, velocity = mass.track()
    assert velocity == pytest.approx(speed - math.copysign(PERIOD * RATE, speed))
    assert place - 0.1 == pytest.approx(0.5 * PERIOD * (speed + velocity))


@pytest.mark.parametrize("speed", [1.53, -1.53])
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0, 1.5])
def test_where_the_joint_braked_already_there_is_less_to_make_up_for(
    speed: float, share: float
) -> None:
    """P3: the last cycle's braking counts once; no more than it is made up for."""
    rate = math.copysign(RATE, -speed)
    mass = Mass(speed, acceleration=share * rate)
    change = PERIOD * rate * max(share, 1.0)
    assert mass.track()[1] == pytest.approx(speed + change)
    if share >= 1.0:
        assert mass.track()[0] == pytest.approx(mass.position)


def test_a_plan_is_followed_as_it_was_predicted() -> None:
    """M9: also beyond the acceleration limit."""
    mass = Mass(1.0)
    mass.take_off()
    plan = [-30.0, -25.0, -30.0, -15.0]
    mass.one.joint.brake_by(memoryview(array("d", plan)), len(plan), PERIOD)
    mass.one.joint.track.acceleration = 0.0
    mass.step(torque=0.0)
    for k, rate in enumerate(plan):
        assert mass.track() == pytest.approx((mass.position, mass.velocity), abs=1e-12)
        assert mass.one.joint.track.acceleration == rate, k
        mass.step()
    assert mass.track() == pytest.approx((mass.position, 0.0), abs=1e-12)
    assert not mass.one.joint.stop.active


def test_a_joint_that_rests_beyond_its_reference_stays_there() -> None:
    """M9: 5 % of the braking is missing; it is not driven back by the end of the stop."""
    mass = Mass(1.0)
    while mass.one.joint.stop.active:
        mass.step(torque=0.95 * mass.one.get("output"))
    planned = 0.1 + 1.0 / (2.0 * RATE)
    assert mass.track()[0] == mass.position > planned + 1e-3


def test_a_joint_that_runs_on_is_stopped_anew() -> None:
    """M9: half of the braking is missing; each stop begins from the joint's own motion."""
    mass = Mass(2.0)
    for _ in range(100):
        mass.step(torque=0.5 * mass.one.get("output"))
    assert abs(mass.velocity) < 0.02
    assert mass.track()[0] == pytest.approx(mass.position, abs=5e-3)


def test_a_gap_between_cycles_begins_it_where_the_joint_is() -> None:
    """B6: the drive had no set-point; the reference has not run ahead."""
    mass = Mass(1.0)
    mass.step()
    mass.position += 0.05
    mass.one.set(position=mass.position, velocity=mass.velocity)
    mass.one._laws.step(0.06)
    place, speed = mass.track()
    assert speed == pytest.approx(mass.velocity)
    assert place <= mass.position
    assert mass.one.joint.track.acceleration == -RATE


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_too_fast_before_a_limit(way: float) -> None:
    """P9: the reference ends at the limit."""
    mass = Mass(2.0 * way, reference__lower=0.1 - 0.08, reference__upper=0.1 + 0.08)
    for _ in range(20):
        mass.step()
        assert abs(mass.track()[0] - 0.1) <= 0.08
    assert mass.track() == (pytest.approx(0.1 + 0.08 * way), 0.0)


@pytest.mark.parametrize(
    ("changes", "ahead"),
    [
        ({}, True),
        ({"drive.kind": LAWS.AS_CURRENT}, True),
        ({"drive.kind": LAWS.AS_TORQUE}, True),
        ({"drive.kind": LAWS.AS_VELOCITY}, False),
        ({"drive.kind": LAWS.AS_POSITION}, False),
        ({"drive.kind": LAWS.AS_IMPEDANCE}, False),
        ({"wire.max_age": 0.01}, False),  # its set-points come late, too
        ({"limits.jerk": 5.0}, False),
        ({"stop.active": False}, False),  # it is at rest
    ],
)
def test_where_the_board_brakes_it_takes_off_from_where_it_is(
    changes: dict[str, Any], ahead: bool
) -> None:
    one = joint(
        **{"drive.kind": LAWS.AS_PWM, "stop.active": True, "stop.ahead": False,
           "position": 0.5, "velocity": 2.0, "track.position": 0.3, "track.velocity": 1.0,
           "ramp.way": 0.0} | changes
    )  # fmt: skip
    one.take_off()
    assert bool(one.stop.ahead) is ahead
    place = (0.5 - 2.0 * one.clock.elapsed, 2.0) if ahead else (0.3, 1.0)
    assert (one.track.position, one.track.velocity) == pytest.approx(place)
