# SPDX-License-Identifier: Apache-2.0
"""control.py: bounds that users set, constants of a drive, and what the laws report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig import LIMITS, board_config, controller, joint, plain

from control_board_ros.core.config.config import Pid
from control_board_ros.core.config.parts import Payload
from control_board_ros.core.laws.control import Controller, set_gains
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.modes import Law
from control_board_ros.core.terms.motors import Term

#: N·m per ampere of the joints here.
PER_AMPERE = 5.0


def test_a_smaller_current_bounds_the_torque() -> None:
    """Y5: 3 A of 5 N·m each, of this joint and no other; nothing beyond the peak current."""
    made = controller(board_config(joint("a"), joint("b")))
    assert [one.limits.torque for one in made.joints] == [LIMITS.torque] * 2
    made.set_caps(np.array([0]), np.array([3.0]), None)
    assert [one.limits.torque for one in made.joints] == [3.0 * PER_AMPERE, LIMITS.torque]
    assert made.caps[0].tolist() == [3.0, LIMITS.peak_current]
    made.set_caps(np.array([0]), np.array([20.0]), None)
    assert made.joints[0].limits.torque == LIMITS.torque  # which is less than 100 N·m
    made.set_caps(np.array([0]), np.array([1e3]), np.array([1e3]))
    assert made.caps[:, 0].tolist() == [LIMITS.peak_current, LIMITS.output]


def test_a_smaller_pwm_bounds_the_output() -> None:
    """Y5: 40 %, from now on and after a power cycle no longer."""
    config = board_config(joint("a"), joint("b"))
    made = controller(config)
    made.set_caps(np.array([1]), None, np.array([40.0]))
    assert [one.limits.output for one in made.joints] == [LIMITS.output, 40.0]
    assert [one.drive.max for one in made.joints] == [LIMITS.output, 40.0]
    (zone,) = config.zones()
    made.power_on(zone)
    assert [one.limits.output for one in made.joints] == [LIMITS.output] * 2


def test_a_bound_leaves_the_law_that_runs_its_set_point() -> None:
    """S1, N1: a joint under torque control goes on being given torques; a power-on forgets it."""
    config = board_config(joint("a", drive=(SetPoint.POSITION, SetPoint.TORQUE)))
    made = controller(config)
    made.arm([0], Law.TORQUE, direct=False, feeds=True)
    assert made._state.kinds.tolist() == [SetPoint.TORQUE]
    made.set_caps(np.array([0]), np.array([3.0]), None)
    assert made._state.kinds.tolist() == [SetPoint.TORQUE]
    assert made.joints[0].drive.max == 3.0 * PER_AMPERE
    (zone,) = config.zones()
    made.power_on(zone)
    assert made._state.kinds.tolist() == [SetPoint.POSITION]


@pytest.mark.parametrize(
    ("drive", "per_torque", "per_feed"),
    [
        (SetPoint.TORQUE, 1.0, 0.01 * LIMITS.peak_current * PER_AMPERE),
        (SetPoint.CURRENT, 1.0 / PER_AMPERE, 0.01 * LIMITS.peak_current),
    ],
)
def test_set_points_of_a_drive_with_its_own_loops(
    drive: SetPoint, per_torque: float, per_feed: float
) -> None:
    """S1, K6: N·m or A; 1 % of a feed-forward is 1 % of the peak current."""
    (one,) = controller(board_config(joint("a", drive=(drive,)))).joints
    assert one.drive.per_torque == pytest.approx(per_torque)
    assert one.drive.per_feed == pytest.approx(per_feed)
    assert one.drive.per_speed == 0.0


@pytest.mark.parametrize(
    ("kd", "delay", "pursuit"),
    [(0.0, 0.0, 100.0), (0.0, 0.002, 50.0), (0.5, 0.0, 100.0), (0.8, 0.0, 75.0), (4.0, 0.0, 15.0)],
)
def test_a_position_error_asks_for_a_velocity(kd: float, delay: float, pursuit: float) -> None:
    """S2: k_p/k_d, and no more than a fifth of the error in the time in which it acts."""
    own = joint("a", position_pid=Pid(kp=60.0, kd=kd), drive_delay=delay)
    (one,) = controller(board_config(own)).joints
    assert one.drive.pursuit == pytest.approx(pursuit)


def test_load_of_a_joint_where_its_law_begins() -> None:
    """M9: the measured torque; of a joint without a sensor what its current makes."""
    config = board_config(joint("a"), plain("b"), plain("c"))
    state = StateArrays(config.names)
    made = Controller(config, state)
    state.torque[:], state.current[:] = 7.0, 2.0
    made.joints[2].braked, made.joints[2].gravity = True, 3.0
    made.arm([0, 1, 2], Law.TORQUE, direct=False, feeds=True)
    assert [one.torque for one in made.joints] == [7.0, 2.0 * PER_AMPERE, 3.0]
    assert made.joints[2].load == 3.0  # what its brake has carried
    expected = [one.torque_reference for one in made.joints]
    assert state.torque_reference.tolist() == expected


def test_gravity_compensation_is_a_joint_s_own() -> None:
    """G1: as configured; without a word about it there is none."""
    config = board_config(joint("a", gravity_compensation=True), joint("b"))
    made = controller(config)
    assert [bool(one.compensates) for one in made.joints] == [True, False]


def test_friction_is_whole_from_a_part_of_the_speed_limit_on() -> None:
    """Y5: 1 % of it."""
    made = controller(board_config(joint("a")))
    assert made.terms_in_force(0)[Term.VELOCITY_THRESHOLD] == pytest.approx(0.01 * LIMITS.velocity)


def test_a_payload_of_a_joint_whose_masses_are_not_known() -> None:
    """G1: is taken, and changes nothing."""
    config = board_config(joint("a"))
    made = controller(config)
    loaded = replace(config.joints[0], payload=Payload(mass=1.0))
    made.reconfigure(replace(config, joints=(loaded,)))
    assert made.joints[0].gravity == 0.0


def test_new_gains_within_their_limits_leave_no_room_beyond() -> None:
    """I5: an integral part may be beyond its limit only where it was before."""
    made = controller(board_config(joint("a")))
    loop = made.joints[0].torque_pid
    set_gains(loop, Pid(kp=1.0, ki=2.0, integral_limit=3.0), 0.002)
    assert (loop.room, loop.fall) == (0.0, 0.0)
    loop.integral = 5.0
    set_gains(loop, Pid(kp=1.0, ki=2.0, integral_limit=4.0), 0.002)
    assert (loop.room, loop.fall) == (1.0, pytest.approx(1.0 * 0.002 / 0.5))
