# SPDX-License-Identifier: Apache-2.0
"""Moves, moves amid moves, and stops within a jerk limit (limits.jerk; SPEC P1, P3, M9)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from joints import OneJoint, started

from control_board_ros.core.laws.stopping import smooth_time
from control_board_ros.core.laws.trajectory import duration, durations, durations_within
from control_board_ros.core.terms.modes import Law
from control_board_ros.simulation import Simulation

PERIOD, VELOCITY, ACCELERATION, JERK = 0.002, 2.0, 20.0, 300.0
LIMITS = VELOCITY, ACCELERATION
WIDE = {"clock.period": PERIOD, "limits.velocity": VELOCITY, "limits.acceleration": ACCELERATION}
WIDE |= {
    "limits.lower": -99.0,
    "limits.upper": 99.0,
    "reference.lower": -99.0,
    "reference.upper": 99.0,
}


def at(place: float) -> OneJoint:
    one = started(Law.POSITION, **WIDE, limits__jerk=JERK)
    one.joint.hold(place)
    return one


def go(one: OneJoint, target: float, speed: float) -> None:
    joint = one.joint
    time, brake = durations(
        target - joint.reference.position, speed, joint.trajectory.velocity, *LIMITS,
        acceleration=joint.trajectory.acceleration, max_jerk=JERK,
    )  # fmt: skip
    joint.move(target, time, brake)


def rates(places: np.ndarray, period: float = PERIOD) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed, acceleration and jerk between cycles."""
    speed = np.diff(places, axis=0) / period
    change = np.diff(speed, axis=0) / period
    return speed, change, np.diff(change, axis=0) / period


def test_from_rest_it_is_a_cubic_root() -> None:
    """T = ∛(60 |Δ|/j), where speed and acceleration allow it."""
    assert duration(0.01, 9.0, *LIMITS, JERK) == pytest.approx(math.cbrt(60.0 * 0.01 / JERK))
    assert duration(1.0, 0.1, *LIMITS, JERK) == 10.0
    assert duration(0.01, 9.0, *LIMITS) < duration(0.01, 9.0, *LIMITS, JERK)


@settings(max_examples=40)
@given(
    st.lists(
        st.tuples(st.floats(-2.0, 2.0), st.floats(0.5, 2.0), st.floats(0.002, 1.5)),
        min_size=2,
        max_size=6,
    )
)
def test_moves_amid_moves_keep_it(moves: list[tuple[float, float, float]]) -> None:
    """P1: position, velocity and acceleration go on; the last one arrives at rest."""
    one, places = at(0.0), [np.zeros(4)]
    for target, speed, time in moves:
        go(one, target, speed)
        places.append(one.record(max(round(time / PERIOD), 1), "track.position")[:, 0])
    places.append(one.record(4500, "track.position")[:, 0])
    speed, change, jerk = rates(np.concatenate(places))
    assert np.abs(speed).max() <= 1.001 * VELOCITY
    assert np.abs(change).max() <= 1.001 * ACCELERATION
    assert np.abs(jerk).max() <= 1.02 * JERK + 1e-3
    assert places[-1][-1] == moves[-1][0]
    assert not one.joint.trajectory.moving


def test_a_limit_that_is_taken_away_amid_a_move() -> None:
    """The move goes on as it began, its speed that of its way; the next one knows no jerk."""
    one = at(0.0)
    go(one, 1.0, 1.0)
    one.step(150)
    go(one, 1.5, 1.0)
    assert one.joint.trajectory.start_acceleration != 0.0
    one.step(5)
    one.joint.limits.jerk = 0.0
    places = one.record(100, "trajectory.position", "trajectory.velocity")
    speed = np.diff(places[:, 0]) / PERIOD
    assert speed == pytest.approx(0.5 * (places[1:, 1] + places[:-1, 1]), abs=1e-3)
    assert one.joint.trajectory.acceleration == 0.0


@given(st.floats(-2.0, 2.0), st.floats(-20.0, 20.0), st.floats(0.5, 5.0))
def test_a_move_of_given_time_keeps_it(velocity: float, change: float, time: float) -> None:
    """Where its time suffices for that."""
    own, brake = durations_within(0.3, time, velocity, *LIMITS, acceleration=change, max_jerk=JERK)
    assert own == time
    assert brake in (0.0, pytest.approx(brake))
    if brake:
        assert brake >= 0.999 * smooth_time(abs(velocity), abs(change), ACCELERATION, JERK)


def test_the_shortest_braking() -> None:
    """1.5 v/T within a, 6 v/T² + 4 a0/T within the jerk."""
    assert smooth_time(1.0, 0.0, 1e9, 600.0) == pytest.approx(0.1)
    assert smooth_time(1.0, 0.0, 5.0, 1e9) == pytest.approx(0.3)
    time = smooth_time(1.0, 10.0, 1e9, 600.0)
    assert 6.0 / time**2 + 40.0 / time == pytest.approx(600.0)
    assert smooth_time(0.0, 10.0, 20.0, 600.0) == pytest.approx(4.0 * 10.0 / 600.0)


# --- on a board -------------------------------------------------------------------------------


def driven(jerk: float) -> tuple[Simulation, np.ndarray]:
    """The iiwa with a jerk limit, and its speed limits."""
    names = [f"lbr_iiwa_joint_{k}" for k in range(1, 8)]
    made = Simulation.load("iiwa", **{f"{name}__limits__jerk": jerk for name in names})
    made.run(0.3)
    return made, np.array([joint.limits.velocity for joint in made.board.config.joints])


@pytest.mark.parametrize("stop", ["stop", "mode"])
def test_stops_keep_it(stop: str) -> None:
    """P3, M9: all joints amid fast moves; they rest where the stop ends."""
    simulation, fastest = driven(JERK)
    board, places, random = simulation.board, [], np.random.default_rng(4)

    def watch(seconds: float) -> None:
        for _ in range(round(seconds / board.period)):
            simulation.step()
            places.append(board.snapshot().position_reference.copy())

    with simulation:
        for _ in range(4):
            board.set_control_mode(None, "pos")
            simulation.run(0.1)
            target = random.uniform(-0.8, 0.8, 7) - [0, 0, 0, 0.9, 0, 0, 0]
            assert board.position_move(None, target, 0.6 * fastest)
            watch(random.uniform(0.2, 0.5))
            if stop == "mode":
                board.set_control_mode(None, "posd")
            else:
                board.stop(None)
            watch(1.0)
            now = board.snapshot()
            assert np.abs(now.position - now.position_reference).max() < 1e-3
            assert np.abs(now.velocity).max() < 1e-3
            speed, _, jerk = rates(np.array(places), board.period)
            moving = (np.abs(speed[:-2]) > 0.01) & (np.abs(speed[2:]) > 0.01)
            assert np.abs(jerk[moving]).max() <= 1.02 * JERK
            places.clear()


def test_before_a_limit_it_brakes_harder() -> None:
    """P9, P14: where no room is left for a stop within the jerk limit."""
    simulation, fastest = driven(20.0)
    with simulation:
        board, upper = simulation.board, simulation.board.config.joints[0].limits.upper
        board.set_control_mode(0, "vel")
        simulation.step()
        for _ in range(4000):
            assert board.velocity_move(0, fastest[0], 15.0)
            simulation.step()
            if board.snapshot().position[0] > upper - 0.15:
                break
        board.stop(0)
        simulation.run(1.0)
        assert upper - 0.16 < board.snapshot().position[0] <= upper + 1e-3
