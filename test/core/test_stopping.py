# SPDX-License-Identifier: Apache-2.0
"""stopping.py: how joints that stop together come to rest (SPEC M9, P3, P14)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from joint_parts import stand_in, write
from pure import load_python

from control_board_ros.core.laws import stopping as compiled
from control_board_ros.core.model.arm_model import ArmModel, Link

PLAIN = load_python("control_board_ros.core.laws.stopping")
KEEPING = 0.029
#: Two rods of 1 m and 2 kg, one on the other, on horizontal axes; rotors on both.
ROD = {"slides": False, "mass": 2.0, "moment": (1.0, 0.0, 0.0), "rotor": 0.05}
LINKS = (
    Link(parent=-1, rotation=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), offset=(0.0, 0.0, 0.0),
         tensor=(0.0, 0.67, 0.67, 0.0, 0.0, 0.0), **ROD),
    Link(parent=0, rotation=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), offset=(1.0, 0.0, 0.0),
         tensor=(0.0, 0.67, 0.67, 0.0, 0.0, 0.0), **ROD),
)  # fmt: skip
ARM = ArmModel(links=LINKS, gravity=(0.0, 0.0, -9.81))


def joint(velocity: float, acceleration: float = 10.0, **changes: Any) -> Any:
    """What the planner reads of a joint, and what it orders."""
    made = stand_in(
        position=0.2, track__position=0.2, track__velocity=velocity, reference__active=True,
        clock__period=1e-3,
        stop__due=True, stop__active=True, limits__acceleration=acceleration, limits__velocity=5.0,
        limits__jerk=0.0, trajectory__acceleration=0.0,
        torque=0.0, drive__delay=0.0, motor__lead=0.0, motor__lag=0.0,
        limits__torque=100.0, motor__coulomb=0.0, motor__coulomb_negative=0.0,
        motor__viscous=0.0, motor__viscous_negative=0.0,
        reference__lower=-math.inf, reference__upper=math.inf, rate=None,
        plan__accelerations=None, step=0.0,
    )  # fmt: skip
    for name, value in changes.items():
        write(made, name, value)

    def brake(rate: float) -> None:
        made.rate = rate

    def brake_by(plan: Any, steps: int, step: float) -> None:
        made.plan.accelerations, made.step = np.array(plan)[:steps], step

    made.brake_since, made.brake_by, made.take_off = brake, brake_by, lambda: None
    return made


def planned(*joints: Any, model: ArmModel | None = None, module: Any = compiled) -> Any:
    stops = module.Stops(list(joints), None if model is None else model.arm())
    stops.plan(model is not None)
    return stops


def test_joints_come_to_rest_together_on_their_path() -> None:
    """M9: v_i/a_i differ little; all decelerations are in proportion to the speeds."""
    slow, quick = joint(1.0, 5.0), joint(-0.2, 8.0)
    planned(slow, quick)
    assert (slow.rate, quick.rate) == (5.0, pytest.approx(0.2 / 0.2))
    assert not slow.stop.due
    assert not quick.stop.due


@pytest.mark.parametrize("velocity", [3.0, -3.0])
def test_the_path_costs_no_joint_more_than_30_mrad(velocity: float) -> None:
    """P3: a joint that would have to wait long for a slow one stops before it."""
    late = {"drive.delay": 2e-3, "motor.lag": 0.5}
    slow, quick, other = joint(1.0, 1.0), joint(velocity, 20.0), joint(velocity, 20.0, **late)
    planned(slow, quick, other)
    assert slow.rate == 1.0
    assert 4.5 / quick.rate == pytest.approx(4.5 / 20.0 + KEEPING)
    assert 4.5 / other.rate == pytest.approx(4.5 / 20.0 + KEEPING - 3.0 * 2.5e-3)


def test_a_joint_that_is_too_fast_for_its_drive_brakes_fully() -> None:
    """P3: its way until the motor brakes is all that keeping the path may cost."""
    slow, quick = joint(1.0, 1.0), joint(3.0, 20.0, drive__delay=0.01)
    planned(slow, quick)
    assert quick.rate == pytest.approx(20.0)


def test_a_stop_takes_off_before_it_is_planned() -> None:
    """M9: from where the joint is by then."""
    slow, one = joint(1.0, 1.0), joint(3.0, 20.0)
    one.take_off = lambda: setattr(one.track, "velocity", 2.0)
    planned(slow, one)
    assert 2.0 / one.rate == pytest.approx(2.0 / 20.0 + KEEPING)


@pytest.mark.parametrize("velocity", [2.0, -2.0])
def test_a_joint_stops_before_its_limit(velocity: float) -> None:
    """P9, P14: also where its path would end beyond; never harder than it may."""
    places = {"reference.lower": -0.01, "reference.upper": 0.41}
    slow, quick = joint(1.0, 2.5), joint(velocity, 10.0, **places)
    planned(slow, quick)
    assert 2.0 / quick.rate == pytest.approx(0.21)
    late = joint(velocity, 10.0, reference__lower=0.19, reference__upper=0.21)
    planned(joint(1.0, 2.5), late)
    assert late.rate == 10.0


def test_a_joint_alone_brakes_at_its_limit() -> None:
    """P3: what does not stop has no say, as long as there is the torque."""
    one, other = joint(1.0, 5.0), joint(-3.0, 2.0, stop__due=False, stop__active=False)
    for model in (None, ARM):
        planned(one, other, model=model)
        assert (one.rate, other.rate) == (5.0, None)
        one.stop.due = True


@pytest.mark.parametrize("module", [compiled, PLAIN], ids=["compiled", "plain"])
def test_where_torque_suffices_the_path_is_kept(module: Any) -> None:
    """M9: the model only says that it does."""
    one, other = joint(1.0, 5.0), joint(-0.5, 5.0)
    stops = planned(one, other, model=ARM, module=module)
    assert (one.rate, other.rate, stops.rounds) == (5.0, pytest.approx(2.5), 0)


def run(joints: list[Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions and speeds after each step of the plans, and the torque that they take."""
    arm = ARM.arm()
    q, v, a, torque = (np.asarray(row) for row in arm.rows)
    q[:] = [one.track.position for one in joints]
    v[:] = [one.track.velocity for one in joints]
    places, speeds, torques = [q.copy()], [v.copy()], []
    step = joints[0].step
    for rates in np.array([one.plan.accelerations for one in joints]).T:
        a[:] = rates
        arm.inverse(1.0)
        torques.append(torque.copy())
        q += step * (v + 0.5 * step * rates)
        v += step * rates
        places.append(q.copy())
        speeds.append(v.copy())
    return np.array(places), np.array(speeds), np.array(torques)


#: The elbow has a fifth of the torque that braking both at their limits takes.
WEAK = {"limits.torque": 14.0}


def test_where_torque_does_not_suffice_no_motor_is_asked_for_more() -> None:
    """M9: they come to rest within torque, acceleration and speed of each."""
    joints = [joint(3.0, 20.0, limits__torque=200.0), joint(3.0, 20.0, **WEAK)]
    stops = planned(*joints, model=ARM)
    assert stops.rounds > 1
    places, speeds, torques = run(joints)
    assert (np.abs(torques) <= 1.001 * np.array([200.0, 14.0])).all()
    assert np.abs(speeds[-1]).max() < 1e-9
    assert np.abs(speeds).max() <= 5.0
    assert max(np.abs(one.plan.accelerations).max() for one in joints) <= 2.0 * 20.0
    beyond = places.max(axis=0) - 0.2 - 4.5 / 20.0
    assert stops.furthest == pytest.approx(beyond.max())
    assert stops.back == pytest.approx((places.max(axis=0) - places[-1]).max(), abs=1e-12)


@pytest.mark.parametrize("module", [compiled, PLAIN], ids=["compiled", "plain"])
@pytest.mark.parametrize(("shoulder", "elbow"), [(40.0, 14.0), (40.0, 20.0), (200.0, 20.0)])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_joint_rests_where_it_came_to_rest(
    way: float, shoulder: float, elbow: float, module: Any
) -> None:
    """M9: none turns round to help another, which would bring it back by 45 to 300 mrad."""
    for other in (-3.0, -1.0):
        joints = [
            joint(3.0 * way, 20.0, limits__torque=shoulder),
            joint(other * way, 20.0, limits__torque=elbow),
        ]
        stops = planned(*joints, model=ARM, module=module)
        if stops.rounds == 0:
            continue
        places, _, _ = run(joints)
        ahead = (places - 0.2) * np.sign([3.0 * way, other * way])
        assert ahead.max(axis=0) - ahead[-1] == pytest.approx(0.0, abs=1e-3)
        assert stops.back < 1e-3


@pytest.mark.parametrize("module", [compiled, PLAIN], ids=["compiled", "plain"])
@pytest.mark.parametrize(
    ("way", "torque", "share"),
    [
        (1.0, 14.0, 0.991),  # the whole torque is turned round: Δτ (L/R)/T is 2 × 2 ms / 0.44 s
        (-1.0, -14.0, 0.991),
        (1.0, -14.0, 1.0),  # it brakes already
        (1.0, math.nan, 1.0),  # not measured
    ],
)
def test_a_stop_leaves_the_torque_that_its_motor_takes_to_turn_round(
    way: float, torque: float, share: float, module: Any
) -> None:
    """M9: L/R is 2 ms; the most that the weak elbow is planned with, of its torque limit."""
    weak = joint(3.0 * way, 20.0, torque=torque, motor__lead=1.5, motor__lag=0.5, **WEAK)
    joints = [joint(3.0 * way, 20.0, limits__torque=200.0), weak]
    assert planned(*joints, model=ARM, module=module).rounds > 1
    _, _, torques = run(joints)
    assert np.abs(torques[:, 1]).max() / 14.0 == pytest.approx(share, abs=2e-3)


def test_the_best_of_some_predictions_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """M9: more predictions never make it worse; here they make it better."""
    found = []
    for rounds in (1, 2, 4, 6):
        monkeypatch.setattr(PLAIN, "ROUNDS", rounds)
        joints = [joint(3.0, 20.0, limits__torque=200.0), joint(3.0, 20.0, **WEAK)]
        found.append(planned(*joints, model=ARM, module=PLAIN).furthest)
    assert found == sorted(found, reverse=True)
    assert found[-1] < 0.95 * found[0]


def test_compiled_and_plain_python_plan_the_same_bits() -> None:
    both = []
    for module in (compiled, PLAIN):
        joints = [
            joint(3.0, 20.0, limits__torque=200.0, motor__coulomb=1.0),
            joint(-3.0, 20.0, **WEAK),
        ]
        planned(*joints, model=ARM, module=module)
        both.append([one.plan.accelerations.tolist() for one in joints])
    assert both[0] == both[1]


def test_a_joint_that_has_just_come_to_rest_is_where_it_is_measured() -> None:
    """The others stop as if it stayed there."""
    rest = joint(
        4.0, stop__due=False, stop__active=False, reference__active=False, track__position=9.0
    )
    one = joint(1.0, 5.0)
    planned(one, rest, model=ARM)
    assert one.rate == 5.0
