# SPDX-License-Identifier: Apache-2.0
"""stepping.py: how joints that step together get there (SPEC P4, P14)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from joint_parts import stand_in, write
from joints import gains, started
from pure import load_python

from control_board_ros.core.laws import stepping as compiled
from control_board_ros.core.model.arm_model import ArmModel, Link
from control_board_ros.core.terms.modes import Law
from control_board_ros.simulation import Simulation

PLAIN = load_python("control_board_ros.core.laws.stepping")
#: Two rods of 1 m and 2 kg, one on the other, on horizontal axes; rotors on both.
ROD = {"slides": False, "mass": 2.0, "moment": (1.0, 0.0, 0.0), "rotor": 0.05}
LINKS = (
    Link(parent=-1, rotation=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), offset=(0.0, 0.0, 0.0),
         tensor=(0.0, 0.67, 0.67, 0.0, 0.0, 0.0), **ROD),
    Link(parent=0, rotation=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), offset=(1.0, 0.0, 0.0),
         tensor=(0.0, 0.67, 0.67, 0.0, 0.0, 0.0), **ROD),
)  # fmt: skip
ARM = ArmModel(links=LINKS, gravity=(0.0, 0.0, 0.0))
FRICTION = 0.5


def joint(followed: float, reference: float, torque: float = 30.0, **changes: Any) -> Any:
    """What the planner reads of a joint, and what it orders."""
    made = stand_in(
        track__position=followed, reference__position=reference, track__velocity=0.0,
        clock__period=1e-3,
        limits__acceleration=20.0, limits__velocity=3.0, limits__torque=torque,
        motor__coulomb=FRICTION,
        motor__coulomb_negative=FRICTION, motor__viscous=0.0, motor__viscous_negative=0.0,
        motor__torque_per_ampere=1.0,
        motor__ohms=1.0, limits__output=100.0, motor__percent_per_volt=0.5, motor__emf=1.0,
        plan=None, step=0.0,
    )  # fmt: skip
    for name, value in changes.items():
        write(made, name, value)

    def step_by(plan: Any, steps: int, step: float) -> None:
        made.plan, made.step = np.array(plan)[:steps], step

    made.step_by = step_by
    return made


def ways(one: Any) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds at the ends of the steps of a plan."""
    speed = np.concatenate([[0.0], np.cumsum(one.plan * one.step)])
    return one.track.position + np.cumsum(0.5 * one.step * (speed[1:] + speed[:-1])), speed[1:]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_joints_with_the_torque_go_by_themselves(way: float) -> None:
    """P4: each as fast as its own limits allow."""
    pair = joint(0.1, 0.1 + 1.5 * way, 900.0), joint(-0.3, -0.3 - 0.2 * way, 900.0)
    steps = compiled.Steps(list(pair), ARM.arm())
    assert steps.plan([0, 1])
    assert steps.time == 0.0
    assert pair[0].plan is pair[1].plan is None


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_without_the_torque_they_go_on_the_line(way: float) -> None:
    """P14: to the target, at rest there, within torques and speeds; no other way is shorter."""
    pair = joint(0.1, 0.1 + 1.5 * way), joint(-0.3, -0.3 - 2.0 * way)
    steps = compiled.Steps(list(pair), ARM.arm())
    assert steps.plan([0, 1])
    (first, speed), (second, other) = map(ways, pair)
    assert first[-1] == pytest.approx(0.1 + 1.5 * way, abs=1e-9)
    assert second[-1] == pytest.approx(-0.3 - 2.0 * way, abs=1e-9)
    assert speed[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.allclose((second + 0.3) / -2.0, (first - 0.1) / 1.5, atol=1e-9)
    assert max(np.abs(speed).max(), np.abs(other).max()) <= 3.0 * 1.01
    assert max(np.abs(one.plan).max() for one in pair) <= 20.0 * 1.01
    arm = ARM.arm()
    q, v, a, torque = (np.asarray(row) for row in arm.rows)
    asked = []
    for k in range(len(speed) - 1):
        q[:], v[:] = (first[k], second[k]), (speed[k], other[k])
        a[:] = pair[0].plan[k], pair[1].plan[k]
        arm.inverse(1.0)
        asked.append(np.abs(torque + FRICTION * np.sign(v)).max() / 30.0)
    assert max(asked) <= 1.0
    assert np.mean(np.array(asked) > 0.85) + np.mean(np.abs(other) > 2.9) > 0.8


def test_the_second_joint_alone_holds_the_first() -> None:
    """P14: what a joint that stays has to hold counts, too."""
    pair = joint(0.0, 0.0, 3.0), joint(0.0, 1.5, 30.0)
    steps = compiled.Steps(list(pair), ARM.arm())
    assert steps.plan([1])
    assert steps.time > 1.5 / 3.0 + 3.0 / 20.0
    assert pair[0].plan is None
    assert pair[1].plan is not None


def test_from_motion_no_line_leads_there() -> None:
    pair = joint(0.1, 1.6), joint(-0.3, -2.3, track__velocity=0.4)
    assert not compiled.Steps(list(pair), ARM.arm()).plan([0, 1])
    strong = joint(0.1, 1.6, 900.0), joint(-0.3, -2.3, 900.0, track__velocity=0.4)
    assert compiled.Steps(list(strong), ARM.arm()).plan([0, 1])


def test_what_cannot_be_held_is_no_line() -> None:
    """Two rods lifted by motors that bear neither."""
    heavy = ArmModel(links=LINKS, gravity=(0.0, -9.81, 0.0))
    pair = joint(0.0, 1.5, 10.0), joint(0.0, 1.5, 10.0)
    assert not compiled.Steps(list(pair), heavy.arm()).plan([0, 1])


def test_a_motor_has_less_torque_at_speed() -> None:
    """P14: stall torque less the back-EMF's; the plan takes longer."""
    times = []
    for emf in (0.0, 6.0, 9.0):
        pair = (
            joint(0.0, 1.5, motor__emf=emf, limits__output=16.0),
            joint(0.0, -2.0, motor__emf=emf, limits__output=16.0),
        )
        steps = compiled.Steps(list(pair), ARM.arm())
        assert steps.plan([0, 1])
        times.append(steps.time)
    assert times[0] < times[1] < times[2]


def test_plain_python_plans_the_same() -> None:
    plans = []
    for module in (compiled, PLAIN):
        pair = joint(0.1, 1.6), joint(-0.3, -2.3)
        assert module.Steps(list(pair), ARM.arm()).plan([0, 1])
        plans.append([pair[0].plan, pair[1].plan])
    assert np.array_equal(plans[0], plans[1])


# --- the law follows it -----------------------------------------------------------------------


def stepped(target: float = 0.5) -> Any:
    """A joint that follows a plan of 100 ms to 0.5 rad: 200 rad/s² there, and back."""
    one = started(
        Law.POSITION,
        clock__period=0.001,
        reference__lower=-9.0,
        reference__upper=9.0,
        limits__acceleration=200.0,
    )
    one.joint.limits.velocity = 20.0
    gains(one.joint.position_pid, kp=0.0)
    one.joint.step_to(target)
    one.joint.step_by(memoryview(np.array([200.0, -200.0])), 2, 0.05)
    return one


def test_the_reference_follows_a_plan_to_its_end() -> None:
    one = stepped()
    places = []
    for _ in range(100):
        one.step()
        places.append((one.joint.track.position, one.joint.track.velocity))
    assert places[49][1] == pytest.approx(10.0)
    assert places[99] == (pytest.approx(0.5), pytest.approx(0.0, abs=1e-9))
    one.step(2)
    assert not one.joint.direct.stepping
    assert one.joint.track.position == 0.5


def test_the_same_position_again_is_no_new_step() -> None:
    """P15."""
    one = stepped()
    one.step(30)
    one.joint.step_to(0.5)
    assert one.joint.direct.stepping
    one.joint.step_to(0.4)
    assert not one.joint.direct.stepping


@pytest.mark.parametrize("order", ["hold", "move"])
def test_other_orders_end_a_plan(order: str) -> None:
    one = stepped()
    one.step(30)
    if order == "hold":
        one.joint.hold(0.1)
    else:
        one.joint.move(0.3, 1.0, 0.1)
    assert not one.joint.direct.stepping


# --- on an arm --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def panda() -> Iterator[Simulation]:
    with Simulation.load("panda") as simulation:
        simulation.run(0.3)
        simulation.board.set_control_mode(None, "posd")
        simulation.step()
        yield simulation


@pytest.mark.parametrize("pause", [4.0, 0.4])
def test_an_arm_that_lacks_torque_keeps_its_speeds(panda: Simulation, pause: float) -> None:
    """P14, P4: all joints step at once, from rest and from motion."""
    board = panda.board
    limits = [joint.limits for joint in board.config.joints]
    low, span, fastest = np.array(
        [(one.lower, one.upper - one.lower, one.velocity) for one in limits]
    ).T
    random = np.random.default_rng(5)
    for _ in range(6):
        before = board.snapshot().position
        target = low + span * random.uniform(0.1, 0.9, board.count)
        assert board.set_position(None, target)
        for _ in range(round(pause / board.period)):
            panda.step()
            now = board.snapshot()
            assert (np.abs(now.velocity) / fastest).max() <= 1.05
            over = np.sign(target - before) * (now.position - target)
            assert pause < 1.0 or over.max() <= 5e-3
        assert pause < 1.0 or np.abs(now.position - target).max() < 2e-3


@pytest.mark.parametrize("rate", [10, 50, 500])
def test_direct_positions_from_afar_are_caught_up_with(panda: Simulation, rate: int) -> None:
    """P4: streams are not planned, nor are short steps from motion; both arrive."""
    board, random = panda.board, np.random.default_rng(rate)
    limits = [joint.limits for joint in board.config.joints]
    low, span = np.array([(one.lower, one.upper - one.lower) for one in limits]).T
    target = low + span * random.uniform(0.25, 0.75, board.count)
    for k in range(6 * rate):
        assert board.set_position(None, target + 1e-3 * math.sin(k / rate))
        for _ in range(round(1.0 / rate / board.period)):
            panda.step()
    assert np.abs(board.snapshot().position - target).max() < 5e-3
