# SPDX-License-Identifier: Apache-2.0
"""A drive that closes the loop of position with a stiffness of its own (SPEC S2, P14).

The board's ``position_pid.kp`` is what it derived; such a servo is several times softer, and has
no integral part: it holds below its goal by load/stiffness.
"""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from joints import OneJoint, gains

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.modes import Law

#: N·m/rad of the board's gains and of the servo; N·m of its load, and that it gives at most.
KP, STIFFNESS, LOAD, LIMIT = 100.0, 20.0, 1.0, 1.6
PERIOD, GUARD = 0.005, 2000
#: s of a servo's lag: (kt²/R + friction)/stiffness of an STS3215 is 0.034; rad/s of a reference.
LAG, SPEED = 0.034, 0.3


class Servo(OneJoint):
    """A servo that moves at once to where its loop holds the load, up to an obstacle, if any.

    Attributes: load, N·m; wall and place, rad; senses, whether it reads its current; lag, s.
    """

    def __init__(self, load: float = LOAD, *, senses: bool = True, **constants: float) -> None:
        own = {
            "clock.period": PERIOD,
            "drive.kind": int(SetPoint.POSITION),
            "limits.torque": LIMIT,
        }
        super().__init__(
            **(own | {"motor.has_torque_sensor": False, "motor.inertia_min": 0.02} | constants)
        )
        gains(self.joint.position_pid, kp=KP)
        self.load, self.wall, self.place, self.senses = load, math.inf, 0.0, senses
        self.lag = 0.0
        self.joint.start(Law.POSITION)
        self.run(400)

    @property
    def goal(self) -> float:
        return float(self.joint.set_point.position)

    def run(self, cycles: int = GUARD) -> None:
        for _ in range(cycles):
            place = min(self.goal - self.load / STIFFNESS, self.wall)
            place = self.place + (place - self.place) * PERIOD / max(self.lag, PERIOD)
            current = STIFFNESS * (self.goal - place) if self.senses else 0.0
            velocity = (place - self.place) / PERIOD
            self.place = place
            self.set(position=place, velocity=velocity, current=current)
            self.step()

    def move(self, target: float) -> None:
        self.joint.move(target, 1.0, 0.0)
        self.run()


@pytest.mark.parametrize("senses", [True, False])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_does_not_sink(senses: bool, way: float) -> None:
    """It sags by 50 mrad, where the error worth the torque limit is 16 mrad."""
    servo = Servo(way * LOAD, senses=senses)
    assert LOAD / STIFFNESS > LIMIT / KP
    before = servo.goal
    servo.run()
    assert servo.goal == before == 0.0


@pytest.mark.parametrize("inertia", [2e-2, 1e-3])
@pytest.mark.parametrize("target", [0.8, -0.8])
def test_its_moves_arrive(target: float, inertia: float) -> None:
    """A light one, too, which pushes gently where it is blocked; with a load taken up at rest."""
    servo = Servo(motor__inertia_min=inertia)
    for load, place in ((LOAD, target), (-0.5 * LOAD, 0.0), (LOAD, target)):
        servo.load = load
        servo.run(100)
        servo.move(place)
        assert servo.goal == pytest.approx(place, abs=1e-6)


def test_it_yields_where_its_current_shows_the_torque_limit() -> None:
    """A load that is too great is held with the torque limit, and goes on sinking."""
    servo = Servo(0.99 * LIMIT)
    assert servo.goal == 0.0
    servo.load = 1.05 * LIMIT
    servo.run(100)
    assert servo.goal < -1e-3
    servo.load = 0.99 * LIMIT
    servo.run(5)
    before = servo.goal
    servo.run()
    assert servo.goal == before


@pytest.mark.parametrize("senses", [True, False])
def test_its_goal_does_not_run_ahead_of_a_blocked_joint(senses: bool) -> None:
    """P14: when the obstacle goes it moves on at the speed of a reference."""
    servo = Servo(0.0, senses=senses)
    servo.wall = 0.2
    servo.move(1.0)
    assert servo.place == 0.2
    assert 0.2 < servo.goal < 0.2 + 1.1 * LIMIT / STIFFNESS
    servo.wall = math.inf
    servo.run()
    assert servo.goal == pytest.approx(1.0, abs=1e-6)


def changed(servo: Servo) -> None:
    """A real change of mode: the position law anew (M9)."""
    servo.joint.hold(servo.place)
    servo.joint.start(Law.POSITION, True, True)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_change_of_mode_leaves_its_set_point(way: float) -> None:
    """M9: at rest, however often; what it holds beyond the joint is no step of the reference."""
    servo = Servo(way * LOAD)
    before = servo.goal
    for _ in range(5):
        changed(servo)
        servo.run(50)
        assert servo.goal == before
        assert servo.joint.reference.position == servo.place == before - servo.load / STIFFNESS


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_reference_is_where_it_creeps_and_swings(way: float) -> None:
    """M9: 10 mrad of creep, and the middle of a swing that has not ended; its set-point stays."""
    servo = Servo(LOAD)
    changed(servo)
    servo.run(100)
    before, joint = servo.goal, servo.joint
    for _ in range(400):
        servo.load += way * 5e-4
        servo.run(1)
    assert joint.reference.position == pytest.approx(before - servo.load / STIFFNESS, abs=2.5e-3)
    middle, turning = servo.place - way * 0.03, 8.0
    for k in range(200):
        angle = turning * k * PERIOD
        swing, speed = 2.5e-3 * math.cos(angle), -2.5e-3 * turning * math.sin(angle)
        servo.set(position=middle + swing, velocity=speed, current=LOAD)
        servo.step()
    assert joint.reference.position == pytest.approx(middle, abs=2.5e-3)
    assert servo.goal == pytest.approx(before, abs=1e-12)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("cycles", [20, 60, 90, 130, 138])
def test_it_stops_from_where_its_set_point_is(cycles: int, way: float) -> None:
    """M9, P5: no step and no way back; where it comes to rest is the reference."""
    servo = Servo(LOAD)
    servo.lag = LAG
    changed(servo)
    servo.run(100)
    servo.joint.move(servo.joint.reference.position + way * 0.2, 0.2 / SPEED, 0.0)
    servo.run(cycles)
    speed, goals = servo.joint.track.velocity, [servo.goal]
    changed(servo)
    speeds = [servo.joint.reference.velocity]
    for _ in range(200):
        servo.run(1)
        goals.append(servo.goal)
        speeds.append(servo.joint.reference.velocity)
    ways = [way * (b - a) for a, b in pairwise(goals)]
    assert min(ways) >= -1e-12
    assert max(ways) <= abs(speed) * PERIOD + 1e-12
    assert max(way * (b - a) for a, b in pairwise(speeds)) <= 1e-12
    most = speed**2 / (2.0 * servo.joint.limits.acceleration) + abs(speed) * PERIOD
    assert abs(goals[-1] - goals[0]) <= most
    assert servo.joint.reference.position == pytest.approx(servo.place, abs=1e-4)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_its_set_point_does_not_trail(way: float) -> None:
    """A lag beyond the error worth the torque limit is no obstacle: up the load, and down it."""
    servo = Servo(LOAD)
    servo.lag = LAG
    changed(servo)
    servo.joint.move(servo.joint.reference.position + way * 0.3, 1.0, 0.0)
    lags = []
    for _ in range(300):
        servo.run(1)
        lags.append(abs(servo.joint.reference.position - servo.place))
        assert servo.goal == pytest.approx(
            servo.joint.reference.position + LOAD / STIFFNESS, abs=1e-4
        )
    assert max(lags) > LIMIT / KP


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        ("move", (0.5, 1.0, 0.0)),
        ("ramp_to", (0.1, 1.0)),
        ("drive_at", (0.1,)),
        ("step_to", (0.1,)),
    ],
)
def test_a_reference_is_not_moved_to_where_it_rests(
    command: str, arguments: tuple[float, ...]
) -> None:
    """Only a joint that was stopped takes its place over; then it has a reference of the user."""
    servo = Servo(LOAD)
    changed(servo)
    assert servo.joint.reference.comes_to_rest
    getattr(servo.joint, command)(*arguments)
    assert not servo.joint.reference.comes_to_rest


def test_a_drive_that_held_nothing_begins_where_the_joint_is() -> None:
    """From IDLE its set-point is the place; what it then sags by is taken over at rest (M9)."""
    servo = Servo(LOAD)
    servo.joint.start(Law.OFF)
    servo.place = 0.3
    servo.set(position=0.3, velocity=0.0)
    servo.step()
    servo.joint.hold(0.3)
    assert servo.joint.reference.position == servo.joint.track.position == 0.3
    servo.joint.set_point.sag, servo.joint.set_point.position = 0.0, 0.3
    servo.joint.start(Law.POSITION)
    servo.run(100)
    assert servo.goal == 0.3
    assert servo.joint.reference.position == servo.place == pytest.approx(0.3 - LOAD / STIFFNESS)
