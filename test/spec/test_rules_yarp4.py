# SPDX-License-Identifier: Apache-2.0
"""What YARP 4 added (SPEC Y): velocities that act at once, and motor currents."""

from __future__ import annotations

import numpy as np
import pytest
from rig import (
    COMPLIANT,
    LIMITS,
    MOTOR,
    STIFF,
    M,
    Rig,
    board_config,
    column,
    held,
    joint,
    plain,
    ready,
)

from control_board_ros.core.config.config import Timeouts
from control_board_ros.core.terms.measurement import Row
from control_board_ros.core.terms.modes import SELECTABLE
from control_board_ros.core.terms.reply import Reason

BOTH = {"control_modes": SELECTABLE}
NO_TORQ = {"control_modes": tuple(m for m in SELECTABLE if m is not M.TORQUE)}
DIRECT, CURRENT = M.VELOCITY_DIRECT, M.CURRENT
PEAK = LIMITS.peak_current


def rig(output: str = "pwm", **changes: object) -> Rig:
    """Left has both modes, bare has them without a torque sensor, right has neither."""
    joints = joint("left", **(BOTH | changes)), joint("right"), plain("bare", **NO_TORQ)
    return ready(board_config(*joints, output=output))


@pytest.mark.parametrize("mode", [DIRECT, CURRENT], ids=str)
def test_a_joint_implements_them_where_it_lists_them(mode: M) -> None:
    """Y1, Y2, M5: requested one that it does not list, a joint is in HW_FAULT."""
    made = rig()
    reply = made.board.set_control_mode(None, mode)
    assert list(reply.codes) == ["", Reason.UNSUPPORTED, ""]
    assert made.modes() == [mode, M.HW_FAULT, mode]
    assert mode in made.board.get_available_modes("left")[0][0]


@pytest.mark.fresh("at once")
def test_a_direct_velocity_acts_at_once() -> None:
    """Y1: the reference is there in the next cycle, the joint as soon as its limits let it."""
    made = rig()
    made.enter(DIRECT, "left")
    assert made.board.set_ref_velocity("left", 1.0)
    assert made.tick().velocity_reference[0] == 1.0
    shown = made.record(0.12)
    speeds = column(shown, "velocity")
    assert speeds[-1] == pytest.approx(1.0, abs=0.03)
    assert speeds.max() < 1.05  # what the acceleration limit took is not caught up
    assert made.board.get_ref_velocity("left")[0] == 1.0
    assert made.board.get_target_velocity("left")[0] == 0.0  # of VELOCITY: none came
    assert made.board.set_ref_velocity("left", -1.0)
    assert made.tick().velocity_reference[0] == -1.0


def test_a_direct_velocity_needs_no_reference_acceleration() -> None:
    """Y1, P5: an acceleration as slow as can be ramps VELOCITY and not VELOCITY_DIRECT."""
    made = rig()
    assert made.board.set_ref_acceleration("left", 0.01)
    made.enter(M.VELOCITY, "left")
    made.board.velocity_move("left", 1.0)
    slow = float(made.run(0.1).velocity[0])
    made.enter(DIRECT, "left")
    made.board.set_ref_velocity("left", 1.0)
    assert slow < 0.01
    assert float(made.run(0.1).velocity[0]) > 0.9


@pytest.mark.parametrize("interaction", [STIFF, COMPLIANT], ids=str)
def test_a_direct_velocity_is_bounded_and_expires(interaction: object) -> None:
    """Y1, P12, P14: never faster than the limit; without the next one the joint stops."""
    made = rig()
    made.board.set_interaction_mode("left", interaction)
    made.enter(DIRECT, "left")
    reply = made.board.set_ref_velocity("left", 100.0)
    assert reply
    assert reply.values == (LIMITS.velocity,)
    assert "bounded" in reply.message
    shown = made.record(0.5)
    assert np.abs(column(shown, "velocity")).max() < 1.05 * LIMITS.velocity
    rest = made.run(4.0)
    assert abs(float(rest.velocity[0])) < 1e-3
    assert made.modes()[0] is DIRECT
    place = float(rest.position[0])
    assert abs(float(made.run(0.5).position[0]) - place) < 1e-3


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_direct_velocity_brakes_ahead_of_a_limit(way: float) -> None:
    """Y1, P9, P14: the joint comes to rest at its software limit."""
    made = rig(timeouts=Timeouts(velocity=0.0))
    made.enter(DIRECT, "left")
    made.board.set_ref_velocity("left", way * 3.0)
    shown = made.record(3.0)
    assert (way * column(shown, "position")).max() < LIMITS.upper + 0.01
    assert shown[-1].position[0] == pytest.approx(way * LIMITS.upper, abs=0.01)
    assert abs(float(shown[-1].velocity[0])) < 0.01
    assert made.modes()[0] is DIRECT


@pytest.mark.parametrize("mode", [DIRECT, CURRENT], ids=str)
@pytest.mark.parametrize("output", ["pwm", "current"])
def test_entering_in_motion_brings_a_joint_to_rest(mode: M, output: str) -> None:
    """M9: within its limits; it stays there until a reference comes."""
    made = rig(output)
    made.enter(M.VELOCITY, "left")
    made.board.velocity_move("left", 1.5, 15.0)
    made.run(0.15)
    assert made.board.set_control_mode("left", mode)
    shown = made.record(1.5)
    assert abs(float(shown[-1].velocity[0])) < 1e-3
    assert abs(float(shown[-1].position[0]) - float(shown[0].position[0])) < 0.2
    assert made.modes()[0] is mode


@pytest.mark.fresh("within 20 ms")
@pytest.mark.parametrize("output", ["pwm", "current"])
@pytest.mark.parametrize("name", ["left", "bare"])
def test_a_current_reference_is_the_motor_s_current(output: str, name: str) -> None:
    """Y2: also where the board's output is a PWM, and without a torque sensor."""
    made = rig(output)
    made.enter(CURRENT, name)
    j = made.config.names.index(name)
    assert made.board.set_ref_current(name, 0.4)
    shown = made.run(0.06)
    assert shown.current[j] == pytest.approx(0.4, abs=0.02)
    assert made.board.get_current(name)[0] == shown.current[j]
    assert made.board.get_ref_current(name)[0] == 0.4


def test_a_current_reference_stays_within_the_peak() -> None:
    """Y2, F6: as much as the range says is taken, and is no overcurrent."""
    made = rig()
    low, high = made.board.get_current_range(["left", "bare"])
    np.testing.assert_array_equal(high, [PEAK, PEAK])
    np.testing.assert_array_equal(low, [-PEAK, -PEAK])
    made.enter(CURRENT, "left")
    reply = made.board.set_ref_current("left", 1e3)
    assert reply
    assert reply.values == (PEAK,)
    assert made.board.get_ref_current("left")[0] == PEAK
    shown = made.record(0.3)
    assert np.abs(column(shown, "current")).max() < PEAK
    assert made.modes()[0] is CURRENT


def test_nothing_is_driven_before_a_current_comes() -> None:
    """M9, Y2: a joint that carries a load goes on carrying it, sensor or none."""
    made = rig()
    made.board.set_control_mode(None, "pos")
    for name, load in (("left", 5.0), ("bare", -4.0)):
        made.plant.push(name, load)
    before = made.run(1.0)
    for name in ("left", "bare"):
        assert made.board.set_control_mode(name, CURRENT)
    after = made.run(1.0)
    assert np.abs(after.position - before.position)[[0, 2]].max() < 2e-3


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("output", ["pwm", "current"])
def test_a_current_drives_no_joint_beyond_its_limits(way: float, output: str) -> None:
    """Y2, P9, P14: neither faster than the limit, nor out of its software limits; a warning."""
    made = rig(output)
    made.enter(CURRENT, "left")
    made.board.take_events()
    made.board.set_ref_current("left", way * 0.6 * PEAK)
    shown = made.record(4.0)
    assert np.abs(column(shown, "velocity")).max() < 1.05 * LIMITS.velocity
    assert (way * column(shown, "position")).max() < LIMITS.upper + 0.03
    assert made.modes()[0] is CURRENT
    assert any("software limits" in text for text in made.warnings())


def test_a_feed_forward_adds_to_a_current() -> None:
    """P11, Y2: u_ff in percent of the peak current."""
    made = held(joint("left", **BOTH))
    made.enter(CURRENT, "left")
    made.board.set_ref_current("left", 1.0)
    alone = float(made.tick().output[0])
    made.board.set_feedforward("left", outputs=4.0)
    made.plant.values[Row.CURRENT] = 0.0
    more = float(made.tick().output[0])
    assert more - alone > 0.9 * 100.0 * 0.04 * PEAK * MOTOR.resistance / MOTOR.supply_voltage


@pytest.mark.fresh("at once")
@pytest.mark.parametrize("mode", [DIRECT, CURRENT], ids=str)
def test_stop_and_leaving(mode: M) -> None:
    """P3, M9: stop holds where a position is followed; the next mode holds in either case."""
    made = rig(timeouts=Timeouts(velocity=0.0))
    made.enter(mode, "left")
    send = made.board.set_ref_velocity if mode is DIRECT else made.board.set_ref_current
    send("left", 0.5)
    made.run(0.2)
    reply = made.board.stop("left")
    assert bool(reply) is (mode is DIRECT)
    if mode is DIRECT:
        assert abs(float(made.run(0.5).velocity[0])) < 1e-3
    assert made.board.set_control_mode("left", M.POSITION)
    place = float(made.run(1.0).position[0])
    assert abs(float(made.run(0.5).position[0]) - place) < 1e-3
