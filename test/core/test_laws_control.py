# SPDX-License-Identifier: Apache-2.0
"""laws.py: the law of each mode, its formula computed by hand (source Fig. 2)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joints import Body, OneJoint, gains, outputs, resting, started

from control_board_ros.core.terms.modes import Law

PERIOD = 0.001


# --- position PID ----------------------------------------------------------------------------


def test_position_pid() -> None:
    """I5, P10: u = kff·r + kp·e + Σ ki·e·T + kd·D, D += α(ė − D)."""
    one = resting()
    gains(one.joint.position_pid, kp=100.0, ki_period=0.05, kd=10.0, kff=7.0, alpha=0.25)
    one.joint.hold(0.02)
    one.joint.start(Law.POSITION)
    one.set(position=-0.01, velocity=-0.2)
    k = np.arange(1, 31)
    taken = -7.0 * 0.02  # the integral part starts at: no jump by kff (M9)
    rate = 0.2 * (1.0 - 0.75**k)
    expected = 7.0 * 0.02 + 100.0 * 0.03 + taken + 0.05 * 0.03 * k + 10.0 * rate
    assert outputs(one, 30) == pytest.approx(expected, rel=1e-12)


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


# --- impedance and torque --------------------------------------------------------------------


def test_impedance() -> None:
    """I5, P11, M9: τ = τ_ff + load + k(q_ref − q) − d·q̇; the load is the torque at its start."""
    one = started(Law.IMPEDANCE, torque=5.0)
    joint = one.joint
    joint.stiffness, joint.damping = 200.0, 3.0
    one.set(position=0.02, velocity=-0.4)
    assert outputs(one, 3) == pytest.approx(5.0 - 200.0 * 0.02 + 3.0 * 0.4)
    one.set(velocity=0.0)
    one.step()
    joint.hold(0.05)
    assert outputs(one, 1) == pytest.approx(5.0 + 200.0 * 0.03)
    joint.offer_torque(2.0)  # replaces the load
    assert outputs(one, 1) == pytest.approx(2.0 + 200.0 * 0.03)
    joint.stiffness, joint.damping = 0.0, 0.0  # I6: in the next cycle
    assert outputs(one, 1) == pytest.approx(2.0)


def test_torque_pid() -> None:
    """P7: u = kff·τ_ref + kp·e + Σ ki·e·T + kd·Δe/T, e = τ_ref − τ measured."""
    one = resting()
    gains(one.joint.torque_pid, kff=0.9, kp=0.5, ki_period=0.01, kd=1e-4)
    one.joint.start(Law.TORQUE)
    one.joint.command_torque(3.0)
    k = np.arange(1, 21)
    expected = 0.9 * 3.0 + 0.5 * 3.0 + 0.01 * 3.0 * k
    expected[0] += 1e-4 * 3.0 / PERIOD
    assert outputs(one, 20) == pytest.approx(expected)
    one.set(torque=5.0)
    change = 0.5 * -5.0 + 0.01 * -2.0 + 1e-4 * -5.0 / PERIOD
    assert outputs(one, 1)[0] - expected[-1] == pytest.approx(change)


def test_a_torque_reference_is_bounded() -> None:
    """P7: by the joint's torque limit, and shown as bounded."""
    one = started(Law.TORQUE)
    one.joint.command_torque(-1000.0)
    one.step()
    assert one.get("torque_reference") == -60.0
    assert one.get("output") == -60.0


def test_held_torque() -> None:
    """M9: load + clip(kp(q_hold − q) − kd·q̇, ± a tenth of the limit); pushed on, it gives way."""
    one = resting(torque=5.0)
    gains(one.joint.torque_pid, kff=1.0)
    gains(one.joint.position_pid, kp=100.0, kd=10.0)
    one.joint.start(Law.TORQUE)
    assert outputs(one, 2) == pytest.approx(5.0)
    one.set(position=0.02, velocity=0.1)
    assert outputs(one, 2) == pytest.approx(5.0 - 100.0 * 0.02 - 10.0 * 0.1)
    one.set(position=0.2, velocity=0.0)
    assert outputs(one, 2) == pytest.approx(5.0 - 6.0)
    one.set(position=0.15)  # it was left at 0.2 − 6/100
    assert outputs(one, 2) == pytest.approx(5.0 - 100.0 * 0.01)


@pytest.mark.parametrize("kp", [0.0, 100.0])
def test_a_torque_reference_ends_the_hold(kp: float) -> None:
    """P7, M9: from the first reference on nothing else acts, wherever the joint is."""
    one = started(Law.TORQUE, torque=5.0)
    gains(one.joint.position_pid, kp=kp, kd=10.0)
    one.joint.command_torque(2.0)
    one.set(position=0.3, velocity=0.4)
    one.step()
    assert outputs(one, 5) == pytest.approx(2.0)


# --- output and drive ------------------------------------------------------------------------


def test_open_loop() -> None:
    """P8, P11: the PWM that was given and u_ff, within the limit, whatever is measured."""
    one = started(Law.OUTPUT, max_output=40.0)
    assert outputs(one, 1)[0] == 0.0
    one.joint.output_command = 12.0
    one.set(position=0.4, torque=3.0, current=2.0)
    assert outputs(one, 1)[0] == 12.0
    one.joint.output_offset = 5.0
    assert outputs(one, 1)[0] == 17.0
    one.joint.feeds = False  # K6
    assert outputs(one, 1)[0] == 12.0
    one.joint.output_command = -90.0
    assert outputs(one, 1)[0] == -40.0


def test_off_is_zero() -> None:
    """M10: whatever is commanded, fed forward or measured."""
    one = started(Law.OFF)
    one.joint.output_command, one.joint.output_offset = 50.0, 20.0
    one.set(position=0.4, velocity=1.0, torque=3.0)
    assert outputs(one, 5).tolist() == [0.0] * 5


def test_torque_becomes_a_drive() -> None:
    """P10: drive = τ·per_torque + compensation·per_speed·q̇ + u_ff."""
    one = started(Law.TORQUE, per_torque=0.4, per_speed=3.0, compensation=0.5, per_feed=0.1)
    one.joint.command_torque(10.0)
    one.joint.output_offset = 20.0
    one.set(velocity=0.2)
    one.step()
    assert outputs(one, 3) == pytest.approx(0.4 * 10.0 + 0.5 * 3.0 * 0.2 + 0.1 * 20.0)


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


def test_current_loop() -> None:
    """P10: v = R·i_ref + kp·e + Σ ki·e·T + Ke·q̇, e = i_ref − i, in percent of the supply."""
    one = resting(in_amps=True, ohms=2.0, emf=0.5, percent_per_volt=4.0)
    gains(one.joint.torque_pid, kff=1.0)
    gains(one.joint.current_pid, kp=0.3, ki_period=0.02)
    one.joint.start(Law.TORQUE)
    one.joint.command_torque(3.0)
    one.set(current=1.0, velocity=0.2)
    k = np.arange(1, 11)
    expected = 4.0 * (2.0 * 3.0 + 0.3 * 2.0 + 0.02 * 2.0 * k + 0.5 * 0.2)
    assert outputs(one, 10) == pytest.approx(expected)


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


def test_without_a_sensor_the_current_is_the_torque() -> None:
    """I7: τ = torque_per_ampere·i, in what is taken over too."""
    one = OneJoint(has_torque_sensor=False, torque_per_ampere=2.5)
    gains(one.joint.position_pid)
    one.set(torque=99.0, current=1.2)
    one.step(40)
    assert one.joint.torque == pytest.approx(3.0)
    one.joint.start(Law.POSITION)
    assert outputs(one, 1)[0] == pytest.approx(3.0)


def test_acceleration_and_load_are_observed() -> None:
    """M9: a = Δq̇/T; load = τ − J·a through a low pass of 10 ms."""
    one = OneJoint(inertia=2.0)
    one.set(torque=4.0)
    one.step(2)
    assert one.joint.load == 4.0
    loads, load = [], 4.0
    for k in range(1, 20):
        one.set(velocity=0.01 * k, torque=7.0)  # 10 rad/s², 20 N·m
        one.step()
        load += 0.1 * (7.0 - 2.0 * 10.0 - load)
        loads.append((one.joint.acceleration, one.joint.load))
        assert loads[-1] == pytest.approx((10.0, load))


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
