# SPDX-License-Identifier: Apache-2.0
"""core.laws: COMPLIANT of a drive that takes positions only: its goal gives way (SPEC I5, I7)."""

from __future__ import annotations

import math
from array import array

import numpy as np
import pytest
from joint_parts import write
from joints import CONSTANTS, ROWS, gains
from pure import LAWS

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.modes import Law

PERIOD, DEAD_BAND, DAMPING = 0.005, 0.1, 0.5
SERVO = {
    "clock.period": PERIOD,
    "clock.elapsed": PERIOD,
    "clock.span": PERIOD,
    "drive.kind": int(SetPoint.POSITION),
    "motor.has_torque_sensor": False,
    "motor.torque_per_ampere": 2.0,
    "limits.edge": math.radians(1.0),
    "admittance.dead_band": DEAD_BAND,
    "admittance.load_share": 0.1,
    "admittance.min_damping": DAMPING,
    "admittance.share": 1.0,
    "external.share": 1.0,
    "limits.acceleration": 20.0,
}


class Weight:
    """An arm of one joint with a weight that its pose does not change."""

    def __init__(self, torque: float) -> None:
        self.rows = [memoryview(array("d", [0.0])) for _ in range(4)]
        self._torque = torque

    def inverse(self, gravity: float) -> None:
        self.rows[3][0] = gravity * self._torque


class Servo:
    """A joint at rest at 0 that carries a weight, in COMPLIANT; its current is what is set."""

    def __init__(self, weight: float = 0.0, **constants: float) -> None:
        self.joint = LAWS.Joint()
        for name, value in (CONSTANTS | SERVO | constants).items():
            write(self.joint, name, value)
        self.rows = {name: array("d", [0.0]) for name in ROWS}
        self._handed = [array("d", [0.0]) for _ in range(6)]
        self._external = array("d", [math.nan])
        views = [memoryview(row) for row in self.rows.values()]
        done, handed = memoryview(array("B", [1])), [memoryview(row) for row in self._handed]
        arm, external = Weight(weight), memoryview(self._external)
        self._laws = LAWS.Laws([self.joint], views, done, arm, False, handed, external)
        gains(self.joint.position_pid, kp=100.0)
        self.weight = weight
        self.feel(0.0)
        self.joint.start(Law.POSITION)
        self.step(20)
        self.enter()

    def enter(self) -> None:
        self.joint.hold(self.rows["position"][0])
        self.joint.start(Law.IMPEDANCE)

    def feel(self, torque: float) -> None:
        """What a hand gives, N·m: the motor gives so much less."""
        self.rows["current"][0] = (self.weight - torque) / self.joint.motor.torque_per_ampere

    def step(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            self._laws.step()

    @property
    def set_point(self) -> float:
        return self._handed[3][0]


def test_speed_and_software_limits_hold() -> None:
    """P9, P14: however hard the hand pushes; it brakes ahead of the limit."""
    servo, places = Servo(), [0.0]
    servo.feel(30.0)
    for _ in range(1000):
        servo.step()
        places.append(servo.set_point)
    speeds = np.diff(places) / PERIOD
    assert speeds.max() == pytest.approx(3.0)
    assert np.diff(speeds).min() >= -20.0 * PERIOD - 1e-9
    assert places[-1] == pytest.approx(2.0)
    assert max(places) <= 2.0


@pytest.mark.parametrize("stiffness", [0.0, 5.0, 1000.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_below_the_dead_band_it_is_stiff(stiffness: float, way: float) -> None:
    """I5: whatever the stiffness."""
    servo = Servo()
    servo.joint.stiffness = stiffness
    servo.feel(0.99 * way * DEAD_BAND)
    servo.step(100)
    assert servo.set_point == 0.0


@pytest.mark.parametrize("damping", [0.0, 0.5, 2.0])
def test_beyond_it_the_goal_moves_by_its_damping(damping: float) -> None:
    """I5, I6: d ġ = |τ| − D, with the least damping where d is less."""
    servo = Servo()
    servo.joint.damping = damping
    servo.feel(0.6)
    servo.step(41)
    before = servo.set_point
    servo.step(20)
    speed = (servo.set_point - before) / (20 * PERIOD)
    assert speed == pytest.approx((0.6 - DEAD_BAND) / max(damping, DAMPING))
    servo.joint.damping = 5.0
    before = servo.set_point
    servo.step()
    assert (servo.set_point - before) / PERIOD == pytest.approx(0.1)  # in the next cycle


def test_a_load_widens_the_dead_band() -> None:
    """What is known of a load is a share of it."""
    servo = Servo(weight=3.0)
    servo.feel(DEAD_BAND + 0.29)
    servo.step(100)
    assert servo.set_point == 0.0
    servo.feel(DEAD_BAND + 0.31)
    servo.step(10)
    assert servo.set_point > 0.0


def test_a_spring_balances_the_push_and_returns() -> None:
    """I5: at rest k (q_ref − g) + |τ| − D = 0; let go, the goal goes back to the reference."""
    servo = Servo()
    servo.joint.stiffness = 2.0
    servo.feel(0.5)
    servo.step(2000)
    assert servo.set_point == pytest.approx((0.5 - DEAD_BAND) / 2.0, abs=1e-6)
    servo.feel(0.0)
    servo.step(2000)
    assert servo.set_point == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("stiffness", [0.0, 1e6])
def test_no_stiffness_makes_it_unstable(stiffness: float) -> None:
    """I6: a move is followed within the speed limit, or with k = 0 not at all."""
    servo = Servo()
    servo.joint.stiffness = stiffness
    servo.joint.move(0.5, 1.0, 0.0)
    places = []
    for _ in range(400):
        servo.step()
        places.append(servo.set_point)
    assert np.abs(np.diff(places)).max() <= 3.0 * PERIOD + 1e-12
    assert places[-1] == pytest.approx(0.5 if stiffness else 0.0, abs=1e-3)


def test_tau_ff_pushes_and_what_was_set_before_does_not() -> None:
    """P11, M9."""
    servo = Servo()
    servo.joint.offer_torque(0.2)
    servo.step(11)
    assert servo.set_point == pytest.approx(11 * PERIOD * 0.2 / DAMPING)
    servo.rows["position"][0] = servo.set_point
    servo.step(20)
    servo.enter()
    before = servo.set_point
    servo.step(50)
    assert servo.set_point == pytest.approx(before)


@pytest.mark.parametrize("why", ["old", "not known"])
def test_without_a_torque_it_stays(why: str) -> None:
    """B7, I7: readings that stay away, or an angle of the arm that is not known."""
    servo = Servo()
    servo.feel(0.6)
    servo.step(40)
    assert servo.set_point > 0.0
    if why == "not known":
        servo.joint.calibrated = False
    for k in range(60):
        if why == "old":
            servo.rows["age"][0] = (k + 1) * PERIOD
        servo.step()
        if k == 10:
            frozen = servo.set_point
    assert servo.set_point == frozen
    servo.rows["age"][0], servo.joint.calibrated = 0.0, True
    servo.step()
    assert servo.set_point - frozen <= 3.0 * PERIOD
    servo.step(20)
    assert servo.set_point > frozen


@pytest.mark.parametrize("load", [0.0, 0.5, -0.7])
def test_entering_takes_the_load_over(load: float) -> None:
    """M9, I10: a payload that nobody knows moves nothing on entering, nor does a stop."""
    servo = Servo()
    servo.feel(load)
    servo.joint.start(Law.POSITION)
    servo.step(20)
    for _ in range(5):
        servo.enter()
        servo.step(50)
        assert servo.set_point == 0.0
    servo.feel(load + 0.3)
    servo.step(5)
    assert servo.set_point > 0.0


def test_the_load_taken_over_fades_as_the_goal_gives_way() -> None:
    """M9: a push that was taken for load does not drive the joint when it ends, but for degrees.

    x = 3 edge ln(τ₀/D), with an edge of 1°.
    """
    servo = Servo()
    servo.feel(1.0)
    servo.joint.start(Law.POSITION)
    servo.step(20)
    servo.enter()
    servo.feel(0.0)
    servo.step(2000)
    way = 3.0 * math.radians(1.0) * math.log(1.0 / DEAD_BAND)
    assert servo.set_point == pytest.approx(-way, rel=0.05)


def test_the_load_is_taken_over_for_a_while() -> None:
    """M9: what braking has left in the low pass is not taken for the load."""
    servo = Servo(admittance__entry_time=0.1)
    servo.enter()
    servo.feel(0.8)  # 20 cycles
    servo.step(200)
    assert servo.set_point == 0.0
    servo.joint.offer_torque(0.0)  # which replaces it
    servo.step(20)
    assert servo.set_point > 0.1


def test_what_the_drive_sags_by_stays() -> None:
    """M9: the measured place becomes the reference, and the drive's goal does not move."""
    servo = Servo()
    servo.joint.start(Law.POSITION)
    servo.rows["position"][0] = -0.04
    servo.step(20)
    for law in (Law.IMPEDANCE, Law.POSITION, Law.POSITION, Law.IMPEDANCE):
        servo.joint.hold(-0.04)
        servo.joint.start(law)
        servo.step(20)
        assert servo.joint.track.position == -0.04
        assert servo.set_point == pytest.approx(0.0, abs=1e-12)


def test_a_joint_in_motion_keeps_no_lag() -> None:
    """M9: what its set-point is ahead of it at speed is no sag."""
    servo = Servo()
    servo.rows["position"][0], servo.rows["velocity"][0] = -0.2, 1.0
    servo.step()
    servo.joint.hold(-0.2)
    assert servo.joint.set_point.sag == 0.0


def test_without_a_dead_band_it_is_a_drive_by_position() -> None:
    """I7: nothing is observed, nothing gives way."""
    servo = Servo(admittance__dead_band=0.0)
    servo.feel(5.0)
    servo.step(50)
    assert not servo.joint.admittance.known
    assert math.isnan(servo._external[0])
