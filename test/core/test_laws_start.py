# SPDX-License-Identifier: Apache-2.0
"""core.laws: how a law begins: it takes over the load, from rest or from motion (SPEC M9)."""

from __future__ import annotations

import numpy as np
import pytest
from joints import Body, OneJoint, gains, outputs, resting

from control_board_ros.core.terms.modes import Law

LAWS = (Law.POSITION, Law.IMPEDANCE, Law.TORQUE)
FREE = (Law.IMPEDANCE, Law.TORQUE)


def tuned(one: OneJoint, *, kff: float = 1.0) -> OneJoint:
    """With gains of every loop, as a well-tuned joint of 1 kg·m² has them."""
    gains(one.joint.position_pid, kp=900.0, kd=50.0, ki_period=0.9, alpha=0.9, limit=60.0)
    gains(one.joint.torque_pid, kp=0.3, ki_period=0.02, kff=kff, limit=60.0)
    one.joint.stiffness, one.joint.damping = 100.0, 15.0
    return one


# --- from rest -------------------------------------------------------------------------------


@pytest.mark.parametrize("kff", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("feed", [0.0, 4.0])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_at_rest_a_law_begins_with_the_load(law: Law, feed: float, kff: float) -> None:
    """M9: neither drop nor jerk, whatever gains the loops have and whatever u_ff gives."""
    one = tuned(resting(7.0), kff=kff)
    one.joint.position_pid.kff = kff
    one.joint.hold(0.0)
    one.joint.output_offset = feed
    one.joint.torque_offset = 3.0
    one.joint.start(law)
    assert not one.joint.settling
    assert one.joint.torque_reference == 7.0
    assert outputs(one, 20) == pytest.approx(7.0, abs=1e-9)


def test_the_load_is_the_filtered_torque_of_a_joint_at_rest() -> None:
    """M9: sensor noise is not taken over as load: a mean over about 10 ms is."""
    random = np.random.default_rng(4)
    taken = []
    for _ in range(40):
        one = tuned(OneJoint())
        for noise in random.normal(0.0, 1.0, 60):
            one.set(torque=5.0 + noise)
            one.step()
        one.joint.start(Law.IMPEDANCE)
        taken.append(one.joint.load_taken)
    assert np.mean(taken) == pytest.approx(5.0, abs=0.15)
    assert np.std(taken) < 0.35  # √(0.1 / 1.9) = 0.23


# --- from motion -----------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 1.0])
@pytest.mark.parametrize("load", [-8.0, 0.0, 8.0])
@pytest.mark.parametrize("law", FREE, ids=lambda law: law.name)
def test_a_joint_in_motion_comes_to_rest_and_stays(law: Law, load: float, friction: float) -> None:
    """M9: what is taken over is what carries it, not what braking or friction added."""
    one = tuned(OneJoint())
    body = Body(one, load=load, friction=friction)
    one.step(2)
    one.joint.start(Law.POSITION)
    body.step(500)
    one.joint.ramp_to(0.6, 10.0)
    body.step(300)
    assert body.velocity == pytest.approx(0.6, abs=0.01)
    one.joint.hold(body.position)
    one.joint.start(law)
    assert one.joint.settling
    here = body.position
    rows = body.step(3000)
    assert not one.joint.settling
    assert np.abs(rows[-500:, 1]).max() < 1e-3
    assert np.ptp(rows[-500:, 0]) < 1e-4
    assert np.abs(rows[:, 0] - here).max() < 0.05
    assert one.joint.known_load() == pytest.approx(-load, abs=friction + 0.2)
