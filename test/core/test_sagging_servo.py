# SPDX-License-Identifier: Apache-2.0
"""A drive that closes the loop of position with a stiffness of its own (SPEC S2, P14).

The board's ``position_pid.kp`` is what it derived; such a servo is several times softer, and has
no integral part: it holds below its goal by load/stiffness.
"""

from __future__ import annotations

import math

import pytest
from joints import OneJoint, gains

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.modes import Law

#: N·m/rad of the board's gains and of the servo; N·m of its load, and that it gives at most.
KP, STIFFNESS, LOAD, LIMIT = 100.0, 20.0, 1.0, 1.6
PERIOD, GUARD = 0.005, 2000


class Servo(OneJoint):
    """A servo that moves at once to where its loop holds the load, up to an obstacle, if any.

    Attributes: load, N·m; wall and place, rad; senses, whether it reads its current.
    """

    def __init__(self, load: float = LOAD, *, senses: bool = True, **constants: float) -> None:
        own = {"period": PERIOD, "kind": int(SetPoint.POSITION), "max_torque": LIMIT}
        super().__init__(**(own | {"has_torque_sensor": False, "inertia_min": 0.02} | constants))
        gains(self.joint.position_pid, kp=KP)
        self.load, self.wall, self.place, self.senses = load, math.inf, 0.0, senses
        self.joint.start(Law.POSITION)
        self.run(400)

    @property
    def goal(self) -> float:
        return float(self.joint.set_position)

    def run(self, cycles: int = GUARD) -> None:
        for _ in range(cycles):
            place = min(self.goal - self.load / STIFFNESS, self.wall)
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
    servo = Servo(inertia_min=inertia)
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
