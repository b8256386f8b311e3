# SPDX-License-Identifier: Apache-2.0
"""core.laws: what the laws follow keeps to speed, acceleration and limits (SPEC P9, P14)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from joints import OneJoint, gains
from pure import LAWS

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.modes import Law

PERIOD, SPEED, ACCELERATION = 0.001, 3.0, 20.0
FOLLOWED = ("track.position", "track.velocity", "track.acceleration")


def standing(position: float = 0.0, **constants: float) -> OneJoint:
    """A powered joint at rest at a position, whose laws follow its references."""
    one = OneJoint(**constants)
    one.set(position=position)
    one.step(2)
    one.joint.hold(position)
    one.joint.start(Law.POSITION)
    return one


def keeps_its_limits(one: OneJoint, rows: np.ndarray, lower: float, upper: float) -> None:
    """P14: speed and acceleration; P9: bounds; and what is fed forward is what happens."""
    position, velocity, acceleration = rows.T
    period = one.joint.clock.period
    assert np.abs(velocity).max() <= SPEED + 1e-9
    # A joint counts as at rest from a millionth of the speed that a cycle can change: its speed
    # reads zero in the cycle that goes this last part of the way.
    assert np.abs(np.diff(velocity)).max() <= ACCELERATION * period * (1.0 + 1e-6) + 1e-9
    assert np.all((position >= lower - 1e-9) & (position <= upper + 1e-9))
    last_part = 1e-6 * ACCELERATION * period**2
    assert np.abs(np.diff(position) - velocity[1:] * period).max() < 1e-11 + last_part
    consistent = np.abs(np.diff(velocity) - acceleration[1:] * period) < 1e-9
    assert np.all(consistent | (velocity[1:] == 0.0))  # not in the cycle that comes to rest


# --- braking ---------------------------------------------------------------------------------


@given(
    distances=st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0)),
    acceleration=st.floats(0.1, 100.0),
)
def test_brake_speed_grows_with_the_distance(
    distances: tuple[float, float], acceleration: float
) -> None:
    """P14: without a gap where the number of cycles changes."""
    near, far = (LAWS.brake_speed(d, acceleration, PERIOD) for d in sorted(distances))
    assert near <= far + 1e-12


# --- steps and any sequence ------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.001, 0.002, 0.01])
@pytest.mark.parametrize("target", [1.9, 0.1, 0.001, -1.5])
def test_a_step_is_the_fastest_way_there(target: float, period: float) -> None:
    """P4, P14: bang, coast, bang, in the least time to some cycles, ending there without passing.

    T = 2√(d/a) while 2√(d·a)/2 ≤ v, else d/v + v/a
    """
    one = standing(clock__period=period)
    one.joint.step_to(target)
    way = abs(target)
    least = 2.0 * math.sqrt(way / ACCELERATION)
    if way > SPEED**2 / ACCELERATION:
        least = way / SPEED + SPEED / ACCELERATION
    rows = one.record(round(2.0 / period), *FOLLOWED)
    keeps_its_limits(one, rows, min(0.0, target), max(0.0, target))
    arrived = int(np.argmax(rows[:, 0] == target)) + 1
    assert rows[-1].tolist() == [target, 0.0, 0.0]
    assert arrived * period <= 1.02 * least + 4 * period
    assert one.joint.reference.position == target
    assert not one.joint.reference.active


COMMANDS = st.lists(
    st.tuples(
        st.sampled_from(["step_to", "step_with", "ramp_to", "move"]),
        st.floats(-2.5, 2.5),
        st.floats(-4.0, 4.0),
        st.integers(1, 300),
    ),
    min_size=1,
    max_size=8,
)


def send(one: OneJoint, kind: str, position: float, velocity: float) -> None:
    """Give a joint a reference, bounded as the board bounds it."""
    joint = one.joint
    position = min(max(position, joint.reference.lower), joint.reference.upper)
    if kind == "step_to":
        joint.step_to(position)
    elif kind == "step_with":
        joint.step_with(position, velocity)
    elif kind == "ramp_to":
        joint.ramp_to(min(max(velocity, -SPEED), SPEED), 1.0 + abs(position) * 5.0)
    else:
        joint.move(position, abs(velocity), 0.0)


@given(COMMANDS, st.sampled_from([0.001, 0.004]))
@example([("step_with", 1e-9, -1.0, 4)], 0.004)
def test_no_sequence_of_references_passes_a_limit(
    commands: list[tuple[str, float, float, int]], period: float
) -> None:
    """P9, P14: any kinds in any order, with any moves, velocities and feed-forwards."""
    one = standing(clock__period=period)
    rows = []
    for kind, position, velocity, cycles in commands:
        send(one, kind, position, velocity)
        rows.append(one.record(cycles, *FOLLOWED))
    one.joint.step_to(one.joint.reference.position)
    rows.append(one.record(round(3.0 / period), *FOLLOWED))
    keeps_its_limits(one, np.concatenate(rows), -2.0, 2.0)
    assert rows[-1][-1].tolist() == [one.joint.reference.position, 0.0, 0.0]


@given(
    step=st.floats(-1.9, 1.9),
    later=st.floats(-1.9, 1.9),
    when=st.integers(1, 400),
)
def test_a_new_step_starts_from_the_present_speed(step: float, later: float, when: int) -> None:
    """P4, P14: led back it brakes first; it passes no further than that takes, and arrives."""
    one = standing()
    one.joint.step_to(step)
    first = one.record(when, *FOLLOWED)
    one.joint.step_to(later)
    second = one.record(1500, *FOLLOWED)
    keeps_its_limits(one, np.concatenate([first, second]), -2.0, 2.0)
    start, speed = first[-1, :2]
    braked = start + speed * abs(speed) / (2.0 * ACCELERATION)
    slack = 2.0 * ACCELERATION * PERIOD**2 + abs(speed) * PERIOD + 0.1 * abs(speed) * 0.008
    assert second[:, 0].max() <= max(start, later, braked) + slack
    assert second[:, 0].min() >= min(start, later, braked) - slack
    assert second[-1, 0] == later


# --- limits ----------------------------------------------------------------------------------


def test_a_joint_without_calibration_keeps_the_bounds_it_has() -> None:
    """K7, P9: no limit is known that could close behind it."""
    one = standing(2.3, reference__upper=math.inf, calibrated=False)
    one.joint.step_to(1.0)
    one.step(1000)
    assert one.joint.reference.upper == math.inf


# --- a joint that cannot follow --------------------------------------------------------------


def test_a_blocked_joint_is_led_by_its_torque_limit_and_released_gently() -> None:
    """P14: q_ref leads by at most τ_max/kp; free again, it goes on at a reference's speed."""
    one = standing()
    gains(one.joint.position_pid, kp=200.0)
    one.joint.step_to(1.8)
    blocked = one.record(1000, "track.position", "output")
    assert blocked[:, 0].max() == pytest.approx(60.0 / 200.0, abs=SPEED * PERIOD)
    assert np.abs(blocked[:, 1]).max() <= 60.0
    assert one.joint.reference.position == 1.8
    rows = [blocked[-1, 0]]
    for _ in range(2000):
        one.set(position=one.joint.track.position)
        one.step()
        rows.append(one.joint.track.position)
    velocity = np.diff(rows) / PERIOD
    assert np.abs(velocity).max() <= SPEED + 1e-9
    assert np.abs(np.diff(velocity)).max() <= ACCELERATION * PERIOD + 1e-6
    assert rows[-1] == 1.8


@pytest.mark.parametrize("kind", [SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.IMPEDANCE])
@pytest.mark.parametrize("gaps", [1, 4])
def test_a_set_point_stands_in_a_gap_between_cycles(kind: SetPoint, gaps: int) -> None:
    """B6, B7: an old reading is continued by what the reference has accelerated, no more."""
    one = OneJoint(drive__kind=int(kind), clock__period=PERIOD)
    one.joint.start(Law.POSITION)
    one.rows["age"][0] = PERIOD
    one.step(100)
    one.joint.move(1.5, 1.5, 0.0)
    speeds = [0.0]
    for _ in range(gaps):
        for gap in (*[0.0] * 5, 0.15):
            one.set(position=0.0, velocity=0.0, age=gap or PERIOD)
            one._laws.step(gap)
            assert abs(one.joint.velocity) <= max(speeds) - min(speeds) + 1e-9
            speeds.append(one.joint.track.velocity)
    assert max(speeds) > 0.0
