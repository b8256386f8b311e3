# SPDX-License-Identifier: Apache-2.0
"""core.laws: laws from cycle to cycle: what is fed forward, drives, what is measured (P7, P10)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joints import Body, gains, outputs, resting, started

from control_board_ros.core.terms.modes import Law

PERIOD = 0.001


@pytest.mark.parametrize("inertia", [0.5, 2.0])
def test_the_inertia_s_share_is_fed_forward(inertia: float) -> None:
    """I5: J·a_ref is all that a loop without gains gives, while the reference accelerates."""
    one = started(Law.POSITION, inertia=inertia)
    one.joint.ramp(0.3, 5.0)
    expected = np.where(np.arange(100) < 60, 5.0 * inertia, 0.0)
    assert outputs(one, 100) == pytest.approx(expected, abs=1e-6)


def test_a_move_is_followed_with_all_terms() -> None:
    """I5, P1: τ = kp(q_ref − q) + kd(q̇_ref − q̇) + J·a_ref along a minimum-jerk move."""
    one = resting(inertia=1.5)
    gains(one.joint.position_pid, kp=80.0, kd=4.0)
    one.joint.start(Law.POSITION)
    one.joint.move(0.2, 0.4, 0.0)
    one.set(position=0.05)
    s = np.minimum(np.arange(401) * PERIOD / 0.4, 1.0)
    position = 0.2 * (10 * s**3 - 15 * s**4 + 6 * s**5)
    velocity = np.diff(position) / PERIOD
    acceleration = np.diff(velocity, prepend=0.0) / PERIOD
    expected = 80.0 * (position[1:] - 0.05) + 4.0 * velocity + 1.5 * acceleration
    assert outputs(one, 400) == pytest.approx(expected, abs=1e-6)


# --- output and drive ------------------------------------------------------------------------


def test_the_drive_is_ahead_of_the_winding() -> None:
    """P10: with L di/dt = v − R i the current is, at the end of a cycle, what was wanted."""
    kept = math.exp(-0.4)  # a = exp(−T R/L)
    one = started(Law.TORQUE, lead=kept / (1.0 - kept))
    current, random = 0.0, np.random.default_rng(1)
    for wanted in random.uniform(-8.0, 8.0, 30):
        one.joint.command_torque(wanted)
        one.step()
        current = kept * current + (1.0 - kept) * one.get("output")
        assert current == pytest.approx(wanted, abs=1e-9)


def test_the_current_loop_is_ahead_of_the_winding() -> None:
    """P10: R·(i_ref + lead·Δi_ref) brings the current there within the cycle, as for a PWM."""
    kept, ohms = math.exp(-0.6), 2.0
    one = started(
        Law.TORQUE, in_amps=True, ohms=ohms, percent_per_volt=1.0, lead=kept / (1.0 - kept)
    )
    current = 0.0
    for wanted in np.random.default_rng(2).uniform(-5.0, 5.0, 30):
        one.joint.command_torque(wanted)
        one.set(current=current)
        one.step()
        current = kept * current + (1.0 - kept) * one.get("output") / ohms
        assert current == pytest.approx(wanted, abs=1e-9)


# --- what is measured ------------------------------------------------------------------------


def turned_round(known: float, rubs: float = 4.0) -> float:
    """How far the velocity of a joint that rubs overshoots when it is turned round, rad/s."""
    one = started(Law.POSITION, coulomb=known, coulomb_negative=known)
    gains(one.joint.position_pid, kp=2500.0, ki_period=10.0, kd=50.0)
    body = Body(one, friction=rubs)
    one.joint.ramp(0.5, 5.0)
    body.step(600)
    one.joint.ramp(-0.5, 5.0)
    return -0.5 - float(body.step(600)[:, 1].min())


def test_friction_that_is_known_is_fed_forward() -> None:
    """Velocity turned round; a third more or less than there is leaves the joint as calm."""
    unknown, known = turned_round(0.0), turned_round(4.0)
    assert known < 0.3 * unknown
    for share in (0.7, 1.3):
        assert turned_round(share * 4.0) < unknown


def test_friction_fed_forward_leaves_a_joint_at_rest_alone() -> None:
    """It goes with what is followed, not with what is measured: noise does not drive it."""
    one = started(Law.POSITION, coulomb=4.0, coulomb_negative=4.0, viscous=3.0)
    gains(one.joint.position_pid, kp=0.0)
    one.set(velocity=0.01)
    assert outputs(one, 5) == pytest.approx(0.0)
