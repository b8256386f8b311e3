# SPDX-License-Identifier: Apache-2.0
"""core/laws.py: what no law may ask for: too much speed, a way beyond a limit (SPEC P9, P14)."""

from __future__ import annotations

import numpy as np
import pytest
from joints import Body, OneJoint, outputs, started

from control_board_ros.core.modes import Law

SPEED, ACCELERATION = 3.0, 20.0


def commanded(torque: float, **constants: float) -> OneJoint:
    """A joint in TORQUE with a torque reference, whose loop gives just that."""
    one = started(Law.TORQUE, **constants)
    one.joint.command_torque(torque)
    return one


# --- the bound by hand -----------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_torque_near_the_speed_limit(sign: float) -> None:
    """P14: τ ≤ τ_last + ½ J_min (v_top − q̇)/horizon, horizon 5 ms, or three periods."""
    for period, horizon in ((0.001, 0.008), (0.004, 0.012)):
        one = commanded(sign * 50.0, inertia_min=0.8, period=period)
        one.set(velocity=sign * 2.9, torque=sign * 4.0, current=sign * 4.0)
        one.step()
        assert outputs(one, 3) == pytest.approx(sign * (4.0 + 0.8 * 0.1 / horizon))
        one.set(velocity=sign * 3.2)
        one.step()
        assert outputs(one, 3) == pytest.approx(sign * (4.0 - 0.8 * 0.2 / horizon))


def test_what_accelerates_already_counts() -> None:
    """P14: the bound is taken from the load, τ_last − 0.8 J·q̈."""
    one = commanded(50.0)
    one.set(velocity=2.8, torque=10.0, current=10.0)
    one.step(2)
    one.set(velocity=2.81)  # 10 rad/s²
    assert outputs(one, 1)[0] == pytest.approx(10.0 - 0.8 * 10.0 + 0.8 * 0.19 / 0.008)


def test_slow_joints_get_what_they_ask_for() -> None:
    """P14: below 0.3 of the speed limit and far from a limit nothing is taken away."""
    one = commanded(50.0, inertia_min=0.01)
    one.set(velocity=0.89)
    one.step()
    assert outputs(one, 3) == pytest.approx(50.0)
    one.set(velocity=0.92)
    one.step()
    assert outputs(one, 3)[-1] < 5.0


def test_the_bound_as_a_drive() -> None:
    """P10, P14: torque bound · per_torque + per_speed·q̇: the back-EMF is there anyway."""
    one = commanded(50.0, per_torque=0.5, per_speed=4.0)
    one.set(velocity=2.9, torque=4.0, current=4.0)
    one.step()
    assert outputs(one, 2) == pytest.approx(0.5 * 14.0 + 4.0 * 2.9)


@pytest.mark.parametrize("velocity", [-0.2, 0.0, 0.2])
def test_beyond_a_limit_it_is_taken_back(velocity: float) -> None:
    """P9: towards the speed −room/0.1 s, whatever is commanded."""
    one = commanded(50.0)
    one.set(position=2.03, velocity=velocity)
    one.step()
    assert outputs(one, 3) == pytest.approx(0.8 * (-0.03 / 0.1 - velocity) / 0.008)


def test_a_joint_without_calibration_knows_no_limit() -> None:
    """P9, K7: only its speed is bounded."""
    one = commanded(50.0, calibrated=False)
    one.set(position=7.0)
    one.step()
    assert outputs(one, 3) == pytest.approx(50.0)
    assert not one.joint.on_limit


def test_the_position_law_is_bounded_in_speed_only() -> None:
    """P9, P14: its reference keeps to the limits; 2 % more speed leaves it room to follow."""
    one = started(Law.POSITION)
    pid = one.joint.position_pid
    pid.kp = 100.0
    one.set(position=2.1, velocity=0.0)
    one.joint.hold(2.3)
    one.step()
    assert outputs(one, 3) == pytest.approx(20.0)
    one.set(velocity=3.04)
    one.step()
    assert outputs(one, 3) == pytest.approx(0.8 * (1.02 * 3.0 - 3.04) / 0.008)


# --- bodies ----------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.001, 0.002])
@pytest.mark.parametrize("inertia", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("torque", [60.0, 15.0, -60.0])
def test_no_torque_drives_a_joint_too_fast(period: float, inertia: float, torque: float) -> None:
    """P14: within 5 % of the speed limit, at the least inertia and above; and it gets there."""
    one = commanded(torque, period=period, limit_lower=-99.0, limit_upper=99.0)
    speeds = Body(one, inertia=inertia).step(round(1.5 / period))[:, 1]
    assert np.abs(speeds).max() <= 1.05 * SPEED
    assert speeds[-1] == pytest.approx(np.sign(torque) * SPEED, rel=0.01)


@pytest.mark.parametrize("period", [0.001, 0.002])
@pytest.mark.parametrize("inertia", [1.0, 2.5])
@pytest.mark.parametrize("load", [-10.0, 0.0, 10.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("law", [Law.TORQUE, Law.OUTPUT, Law.IMPEDANCE], ids=lambda law: law.name)
def test_no_law_drives_a_joint_over_a_limit(
    law: Law, sign: float, load: float, inertia: float, period: float
) -> None:
    """P9, P14: it brakes ahead, arrives at rest, and is held there against any load."""
    one = started(law, period=period)
    one.joint.command_torque(sign * 50.0)
    one.joint.output_command = sign * 50.0
    one.joint.offer_torque(sign * 50.0)
    rows = Body(one, inertia=inertia, load=load).step(round(4.0 / period))
    assert np.abs(rows[:, 0]).max() <= 2.002
    assert rows[-1, 0] == pytest.approx(sign * 2.0, abs=1e-6)
    assert rows[-1, 1] == pytest.approx(0.0, abs=1e-6)
    assert rows[-1, 2] == pytest.approx(-load, abs=1e-3)
    assert one.joint.on_limit


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_found_beyond_a_limit_comes_back(sign: float) -> None:
    """P9: without passing the limit to the inside when nothing else is asked for."""
    one = commanded(sign * 5.0)
    body = Body(one)
    body.position = sign * 2.1
    rows = body.step(3000)
    assert np.abs(rows[-1, 0]) == pytest.approx(2.0, abs=1e-5)
    assert np.abs(rows[:, 0]).min() >= 2.0 - 1e-5
    assert np.abs(np.diff(rows[:, 1])).max() / 0.001 <= 6.0 * ACCELERATION


def test_leaving_a_limit_is_free() -> None:
    """P9: the protection acts outwards only."""
    one = commanded(50.0)
    body = Body(one)
    body.step(3000)
    assert body.position == pytest.approx(2.0, abs=1e-6)
    one.joint.command_torque(-12.0)
    assert body.step(1)[0, 2] == pytest.approx(-12.0)
    body.step(200)
    assert body.position < 1.8
    assert not one.joint.on_limit


def test_on_the_limit_until_it_is_left() -> None:
    """P9: noted beyond it, kept on its edge (a degree, or a hundredth of the range)."""
    one = commanded(0.0)
    seen = []
    for position in (1.995, 2.001, 1.995, 1.98, 1.995, -2.001, -1.99, -1.9):
        one.set(position=position)
        one.step()
        seen.append(bool(one.joint.on_limit))
    assert seen == [False, True, True, False, False, True, True, False]
    narrow = commanded(0.0, limit_lower=-0.1, limit_upper=0.1)
    seen = []
    for position in (0.101, 0.099, 0.097):
        narrow.set(position=position)
        narrow.step()
        seen.append(bool(narrow.joint.on_limit))
    assert seen == [True, True, False]
