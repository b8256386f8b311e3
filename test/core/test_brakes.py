# SPDX-License-Identifier: Apache-2.0
"""brakes.py, alone: orders and their times to the cycle, switches, and slips (SPEC Y4)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from rig import M, board_config, joint

from control_board_ros.core.config.config import Brake, Pid
from control_board_ros.core.laws.control import Controller
from control_board_ros.core.machine.brakes import Brakes, WaitingLaw
from control_board_ros.core.machine.machine import Machine
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.modes import Law
from control_board_ros.core.terms.vocabs import BrakeMode

#: In cycles of 2 ms: to open, to close, and from one look at closed brakes to the next.
OPENS, CLOSES, LOOK = 15, 10, 25
RUN, STOP = (WaitingLaw(law, direct=False, feeds=True) for law in (Law.POSITION, Law.OFF))
DEGREE = np.pi / 180.0


class Made:
    """The brakes of joint a, which has one, and of b; a machine that notes what they ask for."""

    def __init__(self, kind: str = "revolute", rate: float = 500.0, **times: float) -> None:
        brake = Brake(present=True, **({"release_time": 0.03, "engage_time": 0.02} | times))
        first = joint(
            "a", brake=brake, kind=kind, position_pid=Pid(kp=10.0), direct_pid=Pid(kp=20.0)
        )
        self.config = board_config(first, joint("b"), control_rate=rate)
        self.state = StateArrays(self.config.names)
        self.state.control_modes[:] = [M.IDLE, M.IDLE]
        self.controller = Controller(self.config, self.state)
        self.powers: list[tuple[int, int, WaitingLaw]] = []
        self.faults: list[tuple[int, str]] = []
        self.reports: list[tuple[int, str]] = []
        self.brakes = Brakes(cast("Any", self))

    wait_for_brake, hold = Machine.wait_for_brake, Machine.hold

    def give_power(self, j: int, wanted: WaitingLaw) -> None:
        self.powers.append((self.state.cycle, j, wanted))

    def raise_fault(self, j: int, code: object, text: str) -> None:
        self.faults.append((self.state.cycle, text))

    def report(self, level: str, key: str, j: int, text: str) -> None:
        self.reports.append((self.state.cycle, text))

    def until(self, cycle: int) -> None:
        """Step in each cycle up to this one."""
        while self.state.cycle < cycle:
            self.state.cycle += 1
            self.brakes.step()

    def run(self) -> None:
        """Open the brake, and give the joint its power."""
        self.brakes.start_or_wait([0], RUN)
        self.until(self.state.cycle + OPENS)
        self.state.powered[0], self.state.control_modes[0] = 1.0, M.POSITION
        self.powers.clear()


@pytest.fixture
def made() -> Made:
    return Made()


def test_a_brake_closes_before_its_joint_loses_power(made: Made) -> None:
    """Y4: 20 ms, in which the joint is held, with the gains of POSITION."""
    made.run()
    begin = made.state.cycle
    made.controller.arm([0], Law.TORQUE, direct=True, feeds=True)
    assert list(made.brakes.start_or_wait([0, 1], STOP)) == [1]
    assert made.brakes.holding
    assert made.brakes.orders[0] == 1.0
    assert made.controller.joints[0].position_pid.kp == 10.0
    assert not made.controller.joints[0].braked
    made.until(begin + 2 * CLOSES)
    assert made.powers == [(begin + CLOSES, 0, STOP)]
    assert made.brakes.closed[0]
    assert not made.brakes.holding


@pytest.mark.parametrize("mode", [M.HW_FAULT, M.NOT_CONFIGURED])
def test_a_fault_waits_for_no_brake(mode: M, made: Made) -> None:
    """Y4: the power goes at once; a brake set by hand is automatic from then on."""
    made.run()
    made.brakes.set_mode(0, BrakeMode.OPEN)
    made.state.control_modes[0] = mode
    assert list(made.brakes.start_or_wait([0], STOP)) == [0]
    assert made.brakes.mode(0) is BrakeMode.AUTOMATIC
    assert made.brakes.orders[0] == 1.0
    made.until(made.state.cycle + CLOSES)
    assert made.brakes.closed[0]
    assert not made.powers


def test_new_times_hold_from_the_next_order_on(made: Made) -> None:
    """Y4: 50 ms instead of 30."""
    first, second = made.config.joints
    slower = replace(first, brake=replace(first.brake, release_time=0.05))
    made.config = replace(made.config, joints=(slower, second))
    made.brakes.reconfigure()
    made.brakes.start_or_wait([0], RUN)
    made.until(100)
    assert made.powers == [(25, 0, RUN)]


@pytest.mark.parametrize(("release", "patience"), [(0.03, 75), (0.01, 50)])
def test_a_brake_whose_switch_reads_closed_gets_time(release: float, patience: int) -> None:
    """Y4: five times its release time, and 100 ms at least; then it is a fault."""
    made = Made(release_time=release)
    made.until(40)
    made.brakes.switches = np.array([1.0, 0.0])
    made.brakes.start_or_wait([0], RUN)
    made.until(300)
    assert made.faults == [(40 + patience, f"it did not open within {2 * patience} ms")]
    assert made.brakes.is_stuck(0)
    assert made.brakes.closed[0]
    assert not made.powers
    made.brakes.switches = np.array([0.0, 0.0])
    made.brakes.start_or_wait([0], STOP)
    made.brakes.start_or_wait([0], RUN)
    made.until(400)
    assert not made.brakes.is_stuck(0)
    assert len(made.powers) == 1


@pytest.mark.parametrize(("kind", "least"), [("revolute", 0.5 * DEGREE), ("prismatic", 1e-3)])
def test_a_slip_is_seen_at_the_next_look(kind: str, least: float) -> None:
    """Y4: 0.5° or 1 mm from where it came to rest, checked each 50 ms; reported once."""
    made = Made(kind)
    made.state.position[0], made.state.offset[0] = 1.0, 0.5
    made.until(LOOK)
    made.state.position[0] += 0.99 * least
    made.until(2 * LOOK)
    made.state.position[0] -= 0.3  # an offset that is found moves nothing
    made.state.offset[0] += 0.3
    made.until(3 * LOOK)
    made.state.position[0] += 0.02 * least
    made.until(4 * LOOK - 1)
    assert not made.brakes.slips.any()
    made.until(4 * LOOK)
    assert made.brakes.slips.tolist() == [True, False]
    made.until(10 * LOOK)
    ((cycle, text),) = made.reports
    assert cycle == 4 * LOOK
    assert "its brake slips" in text
    made.brakes.start_or_wait([0], RUN)
    assert not made.brakes.slips.any()


@pytest.mark.parametrize(("kind", "rest"), [("revolute", 0.2 * DEGREE), ("prismatic", 1e-3)])
def test_a_brake_may_take_a_second_to_stop_its_joint(kind: str, rest: float) -> None:
    """Y4: where a joint is slow, or after 1 s, is the place that it is held at."""
    for share, marked in ((0.9, 1), (1.1, 11)):
        made = Made(kind, rate=10.0)  # looked at in each cycle
        made.state.velocity[0] = -share * rest
        places = []
        for cycle in range(1, 20):
            made.state.position[0] = 1.0 + 0.1 * rest * cycle
            made.until(cycle)
            brake = made.brakes._brakes[0]
            assert brake is not None
            places.append(brake.mark)
        assert np.isnan(places[: marked - 1]).all()
        assert places[marked - 1 :] == [1.0 + 0.1 * rest * marked] * (20 - marked)


def test_a_joint_with_a_moving_brake_is_not_checked(made: Made) -> None:
    """Y4: nor one whose brake is open."""
    made.run()
    made.until(2 * LOOK - 5)
    made.brakes.start_or_wait([0], STOP)  # closes until cycle 55
    made.until(2 * LOOK)
    made.state.position[0] += 1.0
    made.until(3 * LOOK)
    assert not made.reports
    made.brakes.start_or_wait([0], RUN)
    made.until(3 * LOOK + OPENS)
    made.state.position[0] += 1.0
    made.until(6 * LOOK)
    assert not made.reports


def test_a_slip_is_reported_at_each_closing() -> None:
    """Y4: once each time; the time to stop its joint counts from the order."""
    made = Made(rate=10.0)
    for begin in (100, 200):
        made.until(begin)
        made.run()
        made.state.control_modes[0] = M.HW_FAULT
        made.brakes.start_or_wait([0], STOP)
        order = made.state.cycle
        made.state.velocity[0] = 1.0
        made.until(order + 10)
        made.state.position[0] += 1.0  # it still comes to rest
        made.until(order + 12)
        assert len(made.reports) == (begin == 200)
        made.state.position[0] += DEGREE
        made.until(order + 20)
    assert len(made.reports) == 2


def test_one_joint_that_waits_for_its_brake_is_enough() -> None:
    """Y4: another one, asked for power meanwhile, does not hide it."""
    made = Made()
    config = board_config(*(replace(made.config.joints[0], name=name) for name in "ab"))
    made.config, made.state = config, StateArrays(config.names)
    made.controller = Controller(config, made.state)
    made.state.control_modes[:] = [M.IDLE, M.IDLE]
    made.brakes = Brakes(cast("Any", made))
    made.run()
    made.brakes.start_or_wait([0], STOP)
    made.brakes.start_or_wait([1], RUN)
    assert made.brakes.holding
    made.until(made.state.cycle + CLOSES)
    assert not made.brakes.holding
