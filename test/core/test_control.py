# SPDX-License-Identifier: Apache-2.0
"""control.py: gains that change under way, constants, the drive."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joints import OneJoint, gains, outputs, resting
from rig import LIMITS, MOTOR, board_config, controller, joint

from control_board_ros.core.config.config import Impedance, Pid
from control_board_ros.core.laws.control import Controller, set_constants, set_gains, set_winding
from control_board_ros.core.state import StateArrays
from control_board_ros.core.terms.modes import Law
from control_board_ros.settings.loading import load

PERIOD = 0.001
LOOPS = {"position_pid": Law.POSITION, "torque_pid": Law.TORQUE, "current_pid": Law.TORQUE}
PIDS = st.builds(
    Pid,
    kp=st.floats(0.0, 50.0),
    ki=st.floats(0.0, 20.0),
    kd=st.floats(0.0, 2.0),
    kff=st.floats(0.0, 1.0),
    derivative_cutoff=st.floats(1.0, 300.0),
    integral_limit=st.just(1e6),
)


# --- gains that change under way -------------------------------------------------------------


@given(before=PIDS, after=PIDS, loop=st.sampled_from(list(LOOPS)))
def test_new_gains_make_no_jump(before: Pid, after: Pid, loop: str) -> None:
    """M9, I6: the next output is the last one and a period's integral and rate, no more."""
    law = LOOPS[loop]
    one = resting(
        drive__in_amps=loop == "current_pid", motor__percent_per_volt=1.0, limits__torque=1e9
    )
    one.joint.drive.max = one.joint.limits.output = 1e9
    gains(one.joint.torque_pid, kff=1.0)
    pid = getattr(one.joint, loop)
    set_gains(pid, before, PERIOD)
    one.joint.start(law)
    one.joint.hold(0.3)
    one.joint.command_torque(0.4)
    one.set(position=0.1, velocity=0.2, torque=0.1, current=0.25)
    last = outputs(one, 20)[-1]
    rate = pid.derivative
    set_gains(pid, after, PERIOD)
    now = outputs(one, 1)[0]
    integrated = after.ki * PERIOD * pid.error
    assert now - last == pytest.approx(integrated + after.kd * (pid.derivative - rate), abs=1e-6)


@pytest.mark.parametrize("kp", [0.0, 200.0])
def test_a_lowered_integral_limit_reduces_the_integral(kp: float) -> None:
    """I5, M9: the output makes no jump; what is beyond the new limit leaves evenly in 0.5 s."""
    one = resting()
    before = Pid(kp=0.0, ki=1000.0, integral_limit=30.0)
    set_gains(one.joint.position_pid, before, PERIOD)
    one.joint.start(Law.POSITION)
    one.set(position=-0.1)
    assert outputs(one, 400)[-1] == pytest.approx(30.0)
    set_gains(one.joint.position_pid, replace(before, kp=kp, integral_limit=4.0), PERIOD)
    values = np.array([30.0, *outputs(one, 600)])
    steps = np.diff(values)
    span = 30.0 - (4.0 + kp * 0.1)
    assert np.abs(steps).max() == pytest.approx(abs(span) * PERIOD / 0.5, rel=1e-6)
    assert (steps <= 0.0).all()
    assert values[250] == pytest.approx(30.0 - span / 2.0)
    np.testing.assert_allclose(values[501:], 4.0 + kp * 0.1)


def test_an_integral_on_its_way_below_a_new_limit_may_leave_faster() -> None:
    """I5: an error of the other sign takes it there sooner; it does not grow back."""
    one = resting()
    before = Pid(kp=0.0, ki=1000.0, integral_limit=30.0)
    set_gains(one.joint.position_pid, before, PERIOD)
    one.joint.start(Law.POSITION)
    one.set(position=-0.1)
    outputs(one, 400)
    set_gains(one.joint.position_pid, replace(before, integral_limit=4.0), PERIOD)
    outputs(one, 100)
    one.set(position=0.1)
    assert outputs(one, 250)[-1] == pytest.approx(0.0, abs=1.0)
    one.set(position=-0.1)
    assert max(outputs(one, 600)) <= 30.0 - 26.0 * 350 / 500
    assert outputs(one, 1)[0] == pytest.approx(4.0)


def test_gains_as_the_loops_hold_them() -> None:
    """I5, P7: ki·T, and the rate's low pass as α = 1 − exp(−2π f T)."""
    one = OneJoint()
    pid = Pid(kp=3.0, ki=50.0, kd=0.2, kff=0.7, derivative_cutoff=40.0, integral_limit=6.0)
    set_gains(one.joint.torque_pid, pid, 0.002)
    loop = one.joint.torque_pid
    assert (loop.kp, loop.kd, loop.kff, loop.limit) == (3.0, 0.2, 0.7, 6.0)
    assert loop.ki_period == pytest.approx(0.1)
    assert loop.alpha == pytest.approx(1.0 - math.exp(-2.0 * math.pi * 40.0 * 0.002))


# --- constants and conversions ---------------------------------------------------------------


def test_constants_of_a_joint() -> None:
    one = OneJoint()
    own = joint("a", inertia_min=0.2, inertia_mean=0.5, inertia_max=0.9)
    set_constants(one.joint, own, 0.002)
    made = one.joint
    assert (made.limits.lower, made.limits.upper) == (LIMITS.lower, LIMITS.upper)
    assert (made.limits.velocity, made.limits.acceleration) == (
        LIMITS.velocity,
        LIMITS.acceleration,
    )
    assert (made.limits.torque, made.limits.output) == (LIMITS.torque, LIMITS.output)
    assert (made.motor.inertia_min, made.motor.inertia) == (0.2, 0.5)
    assert made.motor.percent_per_volt == pytest.approx(100.0 / 48.0)
    assert made.motor.torque_per_ampere == MOTOR.torque_per_ampere == pytest.approx(5.0)


def test_how_late_a_torque_is() -> None:
    """P10, S2: the winding's a/(1 − a), a = exp(−T R/L), at most three; none of a drive's own."""
    one = OneJoint().joint
    set_winding(one.motor, 0.002, 0.002)
    assert one.motor.lead == pytest.approx(1.0 / (math.e - 1.0))
    assert one.motor.lag == pytest.approx(1.0 - one.motor.lead)
    set_winding(one.motor, 1.0, 0.002)
    assert one.motor.lead == 3.0
    set_winding(one.motor, 0.0, 0.002)
    assert one.motor.lead == one.motor.lag == 0.0


@pytest.mark.parametrize(
    ("lag", "mean", "factor"),
    [
        (0.0, 9.0, 12.0 / 7.0),
        (0.3, 9.0, (2.0 - 0.66) / (0.4 * (1.1 + 1.0 / 6.0))),
        (0.499, 9.0, 4.0),  # hardly any torque within a period
        (0.5, 9.0, 4.0),
        (0.0, 0.1, 0.2 / 0.7),  # twice the mean
    ],
)
def test_the_inertia_by_which_a_joint_is_slowed_down(
    lag: float, mean: float, factor: float
) -> None:
    """P14: no more than what 0.7 of the least inertia bears without swinging."""
    one = OneJoint(motor__lag=lag, motor__inertia_min=1.0, motor__inertia=mean).joint
    assert one.motor.light_inertia == pytest.approx(0.7)
    assert one.motor.heavy_inertia == pytest.approx(0.7 * factor)


def test_conversions_to_a_pwm() -> None:
    """P10: percent per N·m = 100/V · R/(kt·n), and of the back-EMF 100/V · Ke·n per rad/s."""
    made = controller(board_config(joint("a")))
    made.arm(np.array([0]), Law.POSITION, direct=False, feeds=True)
    one = made.joints[0]
    assert not one.drive.in_amps
    assert one.drive.per_torque == pytest.approx(100.0 / 48.0 * 1.0 / 5.0)
    assert one.drive.per_speed == pytest.approx(100.0 / 48.0 * MOTOR.back_emf)
    assert (one.drive.per_feed, one.drive.max) == (1.0, LIMITS.output)


def test_conversions_to_a_current_reference() -> None:
    """P8, P10: amperes below the peak current; an open-loop output stays a PWM."""
    made = controller(board_config(joint("a"), output="current"))
    made.arm(np.array([0]), Law.TORQUE, direct=False, feeds=True)
    one = made.joints[0]
    assert one.drive.in_amps
    assert (one.drive.per_torque, one.drive.per_speed) == (pytest.approx(1.0 / 5.0), 0.0)
    assert one.drive.per_feed == pytest.approx(0.01 * LIMITS.peak_current)
    assert one.drive.max == pytest.approx(0.95 * LIMITS.peak_current)
    made.arm(np.array([0]), Law.OUTPUT, direct=False, feeds=True)
    assert not one.drive.in_amps
    assert (one.drive.per_feed, one.drive.max) == (1.0, LIMITS.output)


def test_direct_gains_are_those_of_position_direct() -> None:
    """P4: the second set where there is one; a reconfiguration keeps which set runs."""
    own = joint("a", position_pid=Pid(kp=10.0), direct_pid=Pid(kp=20.0))
    config = board_config(own, joint("b", position_pid=Pid(kp=30.0)))
    made = controller(config)
    made.arm(np.array([0, 1]), Law.POSITION, direct=True, feeds=True)
    assert [one.position_pid.kp for one in made.joints] == [20.0, 30.0]
    changed = replace(own, position_pid=Pid(kp=11.0), direct_pid=Pid(kp=21.0))
    made.reconfigure(replace(config, joints=(changed, config.joints[1])))
    assert [one.position_pid.kp for one in made.joints] == [21.0, 30.0]
    made.arm(np.array([0]), Law.POSITION, direct=False, feeds=True)
    assert made.joints[0].position_pid.kp == 11.0


def test_a_law_switches_the_power_on_and_off() -> None:
    """M1, M10: of the joints that get it, and of no other."""
    config = board_config(joint("a"), joint("b"))
    state = StateArrays(config.names)
    made = Controller(config, state)
    state.output[:] = 7.0
    made.arm(np.array([1]), Law.TORQUE, direct=False, feeds=True)
    assert state.powered.tolist() == [0.0, 1.0]
    made.arm(np.array([1]), Law.OFF, direct=False, feeds=True)
    assert state.powered.tolist() == [0.0, 0.0]
    assert state.output.tolist() == [7.0, 0.0]


def test_stiffness_and_damping_outlive_a_reconfiguration() -> None:
    """I6: they start as configured and are the user's from then on."""
    own = joint(
        "a", impedance=Impedance(stiffness=40.0, damping=4.0, max_stiffness=99.0, max_damping=9.0)
    )
    config = board_config(own)
    made = controller(config)
    assert (made.joints[0].stiffness, made.joints[0].damping) == (40.0, 4.0)
    made.joints[0].stiffness = 90.0
    made.reconfigure(config)
    assert made.joints[0].stiffness == 90.0


def test_at_power_on_no_reference_is_accepted() -> None:
    """N1, M3: whatever a joint took before."""
    state = StateArrays(["a", "b"])
    state.accepts[:] = True
    state.power_on(range(2))
    assert not state.accepts.any()


def test_a_configured_payload_is_carried_from_the_start() -> None:
    """G1: and after a power-on."""
    config = load("panda", {"panda_joint7.payload.mass": 2.0}).board
    assert config.model is not None
    controller = Controller(config, StateArrays(config.names))
    k = config.names.index("panda_joint7")
    for _ in range(2):
        assert controller._bodies[k][1].mass == pytest.approx(config.model.links[k].mass + 2.0)
        (zone,) = config.zones()
        controller.power_on(zone)
