# SPDX-License-Identifier: Apache-2.0
"""core.laws: what no law may ask for: too much speed, a way beyond a limit (SPEC P9, P14)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from joints import Body, OneJoint, Winding, gains, started
from lone_joint import LAWS, joint

from control_board_ros.core.terms.modes import Law

SPEED, ACCELERATION = 3.0, 20.0


def commanded(torque: float, **constants: float) -> OneJoint:
    """A joint in TORQUE with a torque reference, whose loop gives just that."""
    one = started(Law.TORQUE, **constants)
    one.joint.command_torque(torque)
    return one


# --- strong and slow -------------------------------------------------------------------------


STRONG = {
    "limits.velocity": 0.07,
    "motor.inertia_min": 1.0,
    "motor.inertia": 1.2,
    "limits.lower": -9.0,
}
STRONG |= {"limits.upper": 9.0, "reference.lower": -9.0, "reference.upper": 9.0}
WINDING = 1.5e-3  # s


def strong(law: Law, period: float, **constants: float) -> tuple[OneJoint, Winding]:
    """A joint whose torque limit brings it to its top speed within 1.2 ms, on its winding."""
    kept = math.exp(-period / WINDING)
    lead = min(kept / (1.0 - kept), 3.0)
    lag = WINDING / period - kept / (1.0 - kept)
    one = started(
        law, clock__period=period, motor__lead=lead, motor__lag=lag, **(STRONG | constants)
    )
    return one, Winding(one, WINDING)


@pytest.mark.parametrize("period", [0.00025, 0.001, 0.005])
@pytest.mark.parametrize("inertia", [1.0, 1.2, 2.4])
@pytest.mark.parametrize("push", [0.0, 5.0])
def test_a_strong_slow_joint_is_caught(period: float, inertia: float, push: float) -> None:
    """P14: half the torque limit, and all of the output, though it is fast within a cycle."""
    for law in (Law.TORQUE, Law.OUTPUT):
        one, body = strong(law, period)
        one.joint.command_torque(30.0)
        one.joint.output_command = 100.0
        speeds = body.step(round(0.6 / period), inertia=inertia, load=push)
        assert np.abs(speeds).max() <= 1.05 * 0.07
        assert speeds[-1] == pytest.approx(0.07, rel=0.02)


@pytest.mark.parametrize("period", [0.00025, 0.001, 0.005])
@pytest.mark.parametrize("inertia", [1.0, 2.4])
def test_a_strong_slow_joint_is_caught_when_it_is_freed(period: float, inertia: float) -> None:
    """P14: blocked for 2 s, then let go; the block never feels more than can be caught."""
    one, body = strong(Law.POSITION, period)
    stiff = min(600.0, 0.6 / period)
    gains(one.joint.position_pid, kp=stiff**2 / 8.0, kd=stiff, ki_period=stiff**3 / 160.0 * period)
    one.joint.ramp_to(0.035, 1.0)
    body.step(round(2.0 / period), inertia=inertia, blocked=True)
    felt = body.torque
    assert 6.0 * (1.0 - 1e-9) <= felt <= max(6.0, 0.7 * 0.07 / period)
    speeds = body.step(round(0.5 / period), inertia=inertia)
    assert np.abs(speeds).max() <= 1.05 * 0.07


@pytest.mark.parametrize("period", [0.00025, 0.001, 0.002, 0.004, 0.01])
@pytest.mark.parametrize("inertia", [0.75, 1.0, 3.0])
@pytest.mark.parametrize("by_current", [False, True])
def test_a_light_joint_at_its_top_speed_does_not_swing(
    period: float, inertia: float, by_current: bool
) -> None:
    """P14: its torque does not turn round with every cycle, however heavy it is in other poses.

    By 2.8 times its inertia it did from 250 Hz down, and so did an arm of current drives.
    """
    wide = {"limits.velocity": 3.0, "motor.inertia": 3.0}
    if by_current:
        one = started(Law.TORQUE, clock__period=period, **(STRONG | wide))
        body: Body | Winding = Body(one, inertia=inertia)
    else:
        one, body = strong(Law.TORQUE, period, **wide)
    torques, speeds = [], []
    for torque in (30.0, 40.0):
        one.joint.command_torque(torque)
        for _ in range(round(0.5 / period)):
            cycle = body.step(1, inertia=inertia) if isinstance(body, Winding) else body.step(1)
            speeds.append(float(cycle[0]) if isinstance(body, Winding) else float(cycle[0, 1]))
            torques.append(one.get("output"))
    assert np.abs(speeds).max() <= 1.05 * 3.0
    assert np.ptp(torques[-10:]) < 0.5


def test_a_push_on_a_joint_at_rest_is_held() -> None:
    """P14: what is pushed, not blocked, has all of its torque against it."""
    one, body = strong(Law.POSITION, 0.001)
    gains(one.joint.position_pid, kp=45000.0, kd=600.0, ki_period=1350.0, limit=60.0)
    body.step(1000, inertia=1.2, load=45.0)
    assert body.position == pytest.approx(0.0, abs=1e-5)
    assert body.torque == pytest.approx(-45.0, rel=1e-3)


# --- bodies ----------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [0.001, 0.002])
@pytest.mark.parametrize("inertia", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("torque", [60.0, 15.0, -60.0])
def test_no_torque_drives_a_joint_too_fast(period: float, inertia: float, torque: float) -> None:
    """P14: within 5 % of the speed limit, at the least inertia and above; and it gets there."""
    wide = {
        "limits.lower": -99.0,
        "limits.upper": 99.0,
        "reference.lower": -99.0,
        "reference.upper": 99.0,
    }
    one = commanded(torque, clock__period=period, **wide)
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
    one = started(law, clock__period=period)
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
def test_a_joint_that_gets_beyond_a_limit_comes_back(sign: float) -> None:
    """P9: without passing the limit to the inside when nothing else is requested."""
    one = commanded(sign * 5.0)
    body = Body(one)
    body.position = sign * 2.1
    rows = body.step(3000)
    assert np.abs(rows[-1, 0]) == pytest.approx(2.0, abs=1e-5)
    assert np.abs(rows[:, 0]).min() >= 2.0 - 1e-5
    assert np.abs(np.diff(rows[:, 1])).max() / 0.001 <= 6.0 * ACCELERATION


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("load", [0.0, 3.0, -3.0])
def test_a_joint_found_beyond_a_limit_goes_no_further(sign: float, load: float) -> None:
    """P16: it stays where it was found, or came in to, whatever pushes outwards."""
    found = {"reference.upper": 2.1} if sign > 0.0 else {"reference.lower": -2.1}
    one = commanded(sign * 5.0, **found)
    body = Body(one, load=load)
    body.position = sign * 2.1
    assert body.step(2000)[:, 0] == pytest.approx(sign * 2.1, abs=2e-3)
    one.joint.command_torque(-sign * 5.0)
    came = body.step(100)
    assert sign * came[-1, 0] < 2.09
    one.joint.command_torque(sign * 5.0)
    rows = body.step(5000)
    innermost = (sign * rows[:, 0]).min()
    assert sign * rows[-1, 0] == pytest.approx(max(innermost, 2.0), abs=2e-3)
    assert rows[-1, 1] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("every", [1, 10])
def test_the_torque_from_outside_takes_its_time_whatever_the_rate_of_readings(every: int) -> None:
    """X1, X2, B7: bandwidth and time of a contact are in time that passed, not in readings."""
    one = joint(
        external__share=0.01, external__threshold=1.0, external__min_duration=0.5, torque=0.0
    )
    one.external.torque = one.external.interval = one.external.duration = 0.0
    one.motor.has_torque_sensor, one.external.contact = True, False
    above, contact = 0, 0
    for cycle in range(1, 401):
        one.wire.silence = 0.0 if cycle % every == 0 else 0.01
        LAWS.observe_external(one, 2.0)
        above = above or cycle * (one.external.torque > 1.0)
        contact = contact or cycle * bool(one.external.contact)
    assert above == pytest.approx(69, abs=every)  # 2 (1 - 0.99^k) = 1
    assert contact - above == pytest.approx(49, abs=every)
