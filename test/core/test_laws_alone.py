# SPDX-License-Identifier: Apache-2.0
"""core.laws, function by function: the formulas of its docstrings, to the number.

They are C functions where the laws are compiled; here they are the same as plain Python.
"""

from __future__ import annotations

import math
from typing import Any

import pytest
from joint_parts import read, write
from lone_joint import INFINITE, LAWS, joint

OFF, POSITION, IMPEDANCE, TORQUE, OUTPUT, CURRENT = (
    getattr(LAWS, name) for name in ["OFF", "POSITION", "IMPEDANCE", "TORQUE", "OUTPUT", "CURRENT"]
)


def clip(value: float, most: float) -> float:
    return min(max(value, -most), most)


# --- loops ---------------------------------------------------------------------------------------


def pid(**values: float) -> Any:
    made = LAWS.Pid()
    for name, value in values.items():
        setattr(made, name, value)
    return made


def test_a_cycle_of_a_pid() -> None:
    """U = kff·r + kp·e + I + kd·D."""
    one = pid(
        kff=2.0,
        kp=3.0,
        ki_period=0.5,
        kd=7.0,
        alpha=0.25,
        limit=100.0,
        integral=1.0,
        derivative=4.0,
    )
    given = LAWS.pid_step(one, 0.3, 0.2, 8.0)
    assert (one.reference, one.error, one.previous) == (0.3, 0.2, 1.0)
    assert one.integral == 1.1
    assert one.derivative == 5.0
    assert given == pytest.approx(0.6 + 0.6 + 1.1 + 35.0)


@pytest.mark.parametrize(("room", "fall", "left", "integral"), [
    (0.0, 0.5, 0.0, 2.0), (1.0, 0.5, 0.5, 2.5), (0.3, 0.5, 0.0, 2.0), (5.0, 0.5, 4.5, 6.0),
])  # fmt: skip
def test_an_integral_has_room_that_shrinks(
    room: float, fall: float, left: float, integral: float
) -> None:
    """Above its limit, both ways."""
    for way in (1.0, -1.0):
        one = pid(ki_period=1.0, limit=2.0, integral=way * 5.0, room=room, fall=fall)
        LAWS.pid_step(one, 0.0, way * 1.0, 0.0)
        assert (one.room, one.integral) == (left, way * integral)


@pytest.mark.parametrize(("error", "excess", "back"), [
    (0.1, 0.2, True), (-0.1, -0.2, True), (0.1, -0.2, False), (-0.1, 0.2, False),
    (0.0, 0.2, False), (5.0, 0.2, True),
])  # fmt: skip
def test_an_integral_pushing_into_a_bound_is_unwound(
    error: float, excess: float, back: bool
) -> None:
    one = pid(error=error, integral=3.0, previous=2.0)
    LAWS.unwind(one, excess)
    assert one.integral == (2.0 if back else 3.0)


def test_friction_of_either_direction() -> None:
    """F_c v/v_slip up to F_c, and F_v v."""
    one = joint(
        motor__coulomb=2.0,
        motor__coulomb_negative=3.0,
        motor__viscous=0.5,
        motor__viscous_negative=0.25,
        motor__slip=0.1,
    )
    for velocity, expected in (
        (0.0, 0.0), (0.05, 1.0 + 0.025), (0.4, 2.0 + 0.2), (-0.05, -1.5 - 0.0125), (-0.4, -3.1),
    ):  # fmt: skip
        assert one.motor.friction(velocity) == pytest.approx(expected)
    one.motor.coulomb = one.motor.coulomb_negative = one.motor.slip = 0.0
    assert one.motor.friction(0.4) == pytest.approx(0.2)
    assert one.motor.friction(-0.4) == pytest.approx(-0.1)
    one.motor.coulomb, one.motor.slip = 0.5, 0.1
    assert one.motor.friction(0.05) == pytest.approx(0.25 + 0.025)


# --- position ------------------------------------------------------------------------------------


def leading(**at: float) -> Any:
    """A joint at 0.2, followed from 0.3 on; too strong for hold_back to matter."""
    near = {
        "position": 0.2,
        "track.position": 0.3,
        "track.velocity": 0.5,
        "motor.inertia_min": 1e6,
    }
    near |= {"track.acceleration": 4.0, "forward": 11.0, "drive.delay": 0.0, "motor.lead": 0.0}
    near |= {
        "motor.coulomb": 0.0,
        "motor.coulomb_negative": 0.0,
        "motor.viscous": 0.0,
        "motor.viscous_negative": 0.0,
    }
    one = joint(**(near | {"reference.active": False, "blocked": False} | at))
    one.position_pid = pid(kp=100.0, limit=1e3)
    return one


def test_a_joint_that_stays_needs_no_torque_to_start_moving() -> None:
    one = leading()
    LAWS.stay(one, 0.7)
    assert (one.track.position, one.track.velocity, one.track.acceleration) == (0.7, 0.0, 0.0)
    assert one.forward == 11.0 - 0.5 * 4.0
    assert one.reference.active is True


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_followed_position_leads_by_no_more_than_the_torque(way: float) -> None:
    """P14: 60 N·m at 100 N·m/rad, and what a drive's delay is worth."""
    for lead, delay, stays in (
        (0.59, 0.0, False),
        (0.61, 0.0, True),
        (0.69, 0.2, False),
        (0.71, 0.2, True),
    ):
        one = leading(
            track__position=0.2 + way * lead, track__velocity=way * 0.5, drive__delay=delay
        )
        LAWS.keep_near(one)
        most = 0.6 + delay * 0.5
        assert one.track.position == pytest.approx(0.2 + way * (most if stays else lead))
        assert one.track.velocity == (0.0 if stays else way * 0.5)
    one = leading(track__position=0.2 + way * 5.0)
    one.position_pid.kp = 0.0
    LAWS.keep_near(one)
    assert one.track.position == 0.2 + way * 5.0
    one.position_pid.kp = 0.5
    one.track.position = 0.2 + way * 150.0
    LAWS.keep_near(one)
    assert one.track.position == pytest.approx(0.2 + way * 120.0)


BLOCKED = {
    "motor.light_inertia": 0.07, "limits.velocity": 3.0, "clock.period": 0.01, "motor.lead": 0.5,
    "drive.delay": 0.004,
    "velocity": 0.0, "position": 0.2, "track.position": 0.5, "track.velocity": 0.0, "carried": 2.0,
    "blocked": True,
}  # fmt: skip
#: J v/(T (1 + lead/2) + delay), N·m.
PUSH = 0.07 * 3.0 / (0.01 * 1.25 + 0.004)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_blocked_joint_pushes_with_limited_torque(way: float) -> None:
    """|kp·e + I − I_free| ≤ J v/T'; what is followed waits, not beyond the joint."""

    def held(**at: float) -> Any:
        one = leading(**(BLOCKED | at))
        one.position_pid = pid(kp=100.0, limit=1e3, integral=way * 3.0)
        one.carried *= way
        one.track.position = 0.2 + way * (one.track.position - 0.2)
        LAWS.hold_back(one)
        return one

    one = held()
    excess = 30.0 + 1.0
    assert excess > PUSH
    assert one.track.position == pytest.approx(0.2 + way * (0.3 - (excess - PUSH) / 100.0))
    far = held(carried=-40.0)  # more than the whole way back
    assert far.track.position == 0.2
    assert held(track__position=0.2 + (PUSH - 1.0) / 100.0 - 1e-6).reference.active is False
    assert held(track__position=0.2 + (PUSH - 1.0) / 100.0 + 1e-6).reference.active is True


@pytest.mark.parametrize(
    ("at", "blocked", "carried"),
    [
        ({"velocity": 0.0061}, False, 3.0),
        ({"velocity": -0.0061}, False, 3.0),
        ({"velocity": 0.0059}, True, 2.0),
        ({"blocked": False}, False, 3.0),
        ({"blocked": False, "track.velocity": 0.5}, True, 2.0),
        ({"blocked": False, "track.velocity": -0.5}, True, 2.0),
    ],
)
def test_when_a_joint_is_blocked(at: dict[str, float], blocked: bool, carried: float) -> None:
    """It is at rest and is to move; until it moves. The load it carried till then is released."""
    one = leading(**(BLOCKED | at))
    one.position_pid = pid(kp=100.0, limit=1e3, integral=3.0)
    LAWS.hold_back(one)
    assert bool(one.blocked) is blocked
    assert one.carried == carried


def test_a_joint_that_is_caught_at_any_torque_is_not_held_back() -> None:
    heavy = 60.0 / PUSH * 0.07
    for inertia, changed in ((1.001 * heavy, False), (0.999 * heavy, True)):
        one = leading(**(BLOCKED | {"motor.light_inertia": inertia, "blocked": False}))
        one.position_pid = pid(kp=100.0, limit=1e3, integral=3.0)
        LAWS.hold_back(one)
        assert (one.carried == 3.0) is changed


def test_a_tenth_of_the_torque_may_always_push() -> None:
    one = leading(**(BLOCKED | {"motor.light_inertia": 1e-6}))
    one.position_pid = pid(kp=100.0, limit=1e3, integral=2.0)
    LAWS.hold_back(one)
    assert one.track.position == pytest.approx(0.2 + 6.0 / 100.0)


def test_the_position_law() -> None:
    """kp·e + I + kd·ė + what is fed forward; e is as the drive has it by now."""
    one = leading(drive__delay=0.02, velocity=0.1, motor__viscous=0.3)
    one.position_pid = pid(kp=100.0, ki_period=2.0, kd=5.0, alpha=1.0, limit=1e3, integral=1.0)
    error = 0.3 - 0.02 * 0.5 - 0.2
    torque = LAWS.position_law(one)
    assert torque == pytest.approx(100.0 * error + 1.0 + 2.0 * error + 5.0 * 0.4 + 11.0 + 0.15)


# --- torque --------------------------------------------------------------------------------------


def sprung(**at: float) -> Any:
    given = {"torque_offset": 1.0, "load_taken": 2.0, "lift": 4.0, "stiffness": 50.0}
    given |= {
        "damping": 3.0,
        "track.position": 0.5,
        "position": 0.2,
        "velocity": 0.1,
        "lifts": True,
    }
    one = joint(**(given | {"hold_place": 0.25} | at))
    one.position_pid = pid(kp=10.0, kd=2.0)
    return one


def test_a_spring_and_damper() -> None:
    """τ_ff + load + g + k (q_ref − q) − d q̇."""
    assert LAWS.impedance(sprung()) == pytest.approx(7.0 + 15.0 - 0.3)


def test_without_a_spring_a_lifted_joint_stays_where_it_is_put() -> None:
    """G1: by a hundredth of its torque."""
    hold = 10.0 * 0.05 - 2.0 * 0.1
    assert LAWS.impedance(sprung(stiffness=0.0)) == pytest.approx(7.0 - 0.3 + hold)
    assert LAWS.impedance(sprung(stiffness=0.0, lifts=False)) == pytest.approx(6.7)
    assert LAWS.impedance(sprung(stiffness=0.5)) == pytest.approx(7.0 + 0.15 - 0.3)
    assert LAWS.impedance(sprung(stiffness=0.0, velocity=-9.0)) == pytest.approx(7.0 + 27.0 + 0.6)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_hold_yields(way: float) -> None:
    """Kp (q_hold − q) − kd q̇ within its share; pushed harder, it comes along."""
    one = sprung(hold_place=0.2 + way * 0.05)
    assert LAWS.hold_torque(one, 0.1) == pytest.approx(way * 0.5 - 0.2)
    assert one.hold_place == 0.2 + way * 0.05
    one = sprung(hold_place=0.2 + way * 2.0, velocity=0.0)
    assert LAWS.hold_torque(one, 0.1) == pytest.approx(way * 6.0)
    assert one.hold_place == pytest.approx(0.2 + way * 0.6)
    one.position_pid.kp, one.hold_place, one.velocity = 0.0, 9.0, -way * 9.0
    assert LAWS.hold_torque(one, 0.1) == way * 6.0
    assert one.hold_place == 9.0
    one.position_pid.kp = 0.5
    LAWS.hold_torque(one, 0.01)
    assert one.hold_place == pytest.approx(1.4)


def test_before_a_first_reference_the_load_is_held() -> None:
    one = sprung(torque_command=5.0)
    assert LAWS.rubbing_torque(one) == pytest.approx(5.0 + 4.0 + 0.5 - 0.2)


@pytest.mark.parametrize(("asked", "reference"), [(20.0, 20.0), (70.0, 60.0), (-70.0, -60.0)])
def test_the_torque_loop(asked: float, reference: float) -> None:
    """kff·τ_ref + kp·e + I + kd·ė; a drive that closes it is given the reference."""
    one = joint(torque=12.0, drive__kind=LAWS.AS_PWM)
    one.torque_pid = pid(kff=1.0, kp=0.5, ki_period=0.1, kd=0.01, alpha=1.0, limit=1e3, error=3.0)
    error = reference - 12.0
    expected = reference + 0.5 * error + 0.1 * error + 0.01 * (error - 3.0) / 0.01
    assert LAWS.torque_law(one, asked) == pytest.approx(expected)
    assert one.torque_reference == reference
    for kind in (LAWS.AS_TORQUE, LAWS.AS_IMPEDANCE):
        one.drive.kind = kind
        assert LAWS.torque_law(one, asked) == reference
        assert one.torque_pid.error == error
    one.drive.kind = LAWS.AS_CURRENT
    assert LAWS.torque_law(one, asked) != reference


def test_torque_requested_by_a_law() -> None:
    """Its own; while it settles that of the position law."""

    def asked(law: int, **at: float) -> float:
        one = sprung(law=law, drive__kind=LAWS.AS_TORQUE, torque_command=5.0, lifts=False, **at)
        one.forward, one.drive.delay, one.blocked = 11.0, 0.0, False
        for name in (
            "motor.coulomb",
            "motor.coulomb_negative",
            "motor.viscous",
            "motor.viscous_negative",
        ):
            write(one, name, 0.0)
        one.motor.inertia_min, one.track.velocity = 1e6, 0.0
        return float(LAWS.law_torque(one))

    position = 10.0 * 0.3 + 2.0 * 0.0 + 11.0
    assert asked(POSITION, settling=False) == pytest.approx(position)
    for law in (IMPEDANCE, TORQUE, CURRENT):
        assert asked(law, settling=True, holding=True) == pytest.approx(position)
    assert asked(IMPEDANCE, settling=False) == pytest.approx(21.7)
    assert asked(TORQUE, settling=False, holding=False) == pytest.approx(9.0)
    assert asked(TORQUE, settling=False, holding=True) == pytest.approx(9.3)
    assert asked(CURRENT, settling=False, holding=True) == pytest.approx(9.3)


# --- drives --------------------------------------------------------------------------------------


def test_the_drive_is_ahead_of_the_winding() -> None:
    """V = R (i' − a i)/(1 − a); not where the drive takes amperes."""
    one = joint(drive__in_amps=False, motor__lead=0.5, set_point__request=3.0)
    assert LAWS.ahead_of_winding(one, 5.0) == 5.0 + 0.5 * 2.0
    assert one.set_point.request == 5.0
    one.drive.in_amps = True
    assert LAWS.ahead_of_winding(one, 9.0) == 9.0
    assert one.set_point.request == 9.0


@pytest.mark.parametrize("law", [POSITION, CURRENT])
def test_the_current_loop(law: int) -> None:
    """R (i + lead Δi) + Ke q̇ + PI; a user's step is compared with the last one."""
    one = joint(
        law=law,
        motor__ohms=2.0,
        motor__lead=0.5,
        motor__emf=0.3,
        velocity=4.0,
        current=1.0,
        motor__percent_per_volt=2.0,
    )
    one.limits.output = 100.0
    one.current_pid = pid(kp=0.5, ki_period=0.1, limit=1e3, integral=0.2, reference=1.5)
    error = (1.5 if law == CURRENT else 3.0) - 1.0
    volts = 0.5 * error + 0.2 + 0.1 * error + 2.0 * (3.0 + 0.5 * 1.5) + 1.2
    assert LAWS.current_law(one, 3.0) == pytest.approx(2.0 * volts)
    assert one.current_pid.integral == pytest.approx(0.2 + 0.1 * error)
    for way in (1.0, -1.0):
        one.current_pid = pid(kp=0.5, ki_period=0.1, limit=1e3, integral=0.2, reference=way * 90.0)
        assert LAWS.current_law(one, way * 90.0) == way * 100.0
        assert one.current_pid.integral == 0.2


# --- protection ----------------------------------------------------------------------------------


BOUND = {
    "clock.period": 0.01, "drive.delay": 0.002, "current": 4.0, "current_before": 3.0,
    "motor.torque_per_ampere": 2.0, "motor.lag": 0.3, "velocity": 1.0, "acceleration": 0.5,
    "motor.light_inertia": 0.14, "motor.heavy_inertia": 0.5,
    "drive.per_torque": 1.5, "drive.per_speed": 0.7, "drive.in_amps": False, "motor.lead": 0.6,
    "limits.torque": 60.0,
}  # fmt: skip


def bounded(top: float, way: float, **at: float) -> float:
    """The formula of the module: τ + n1 − n0 with H = 3 (T + delay)."""
    v = {**BOUND, **at}
    span = 3.0 * (v["clock.period"] + v["drive.delay"])
    torque = way * v["current"] * v["motor.torque_per_ampere"]
    grown = torque - way * v["current_before"] * v["motor.torque_per_ampere"]
    gain = 1.0 + v["motor.lag"] * v["clock.period"] / span
    spare = (top - way * v["velocity"]) / span - gain * way * v["acceleration"]
    inertia = v["motor.light_inertia" if spare >= 0.0 else "motor.heavy_inertia"]
    most = torque - gain * v["motor.lag"] * grown + inertia * spare
    if most >= v["limits.torque"]:
        return float(INFINITE)
    most = max(most, -v["limits.torque"])
    drive = v["drive.per_torque"] * most + v["drive.per_speed"] * way * v["velocity"]
    return (
        drive
        if v["drive.in_amps"]
        else drive + v["motor.lead"] * v["drive.per_torque"] * (most - torque)
    )


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("top", "at"),
    [
        (3.0, {}),
        (1.2, {}),
        (0.2, {}),
        (-1.0, {}),
        (0.2, {"motor.heavy_inertia": 0.56}),
        (3.0, {"drive.in_amps": True}),
        (0.2, {"drive.in_amps": True, "current": -7.0, "current_before": -6.0}),
        (90.0, {}),
        (-90.0, {"motor.heavy_inertia": 5.0}),
    ],
)
def test_the_drive_that_brings_a_joint_to_a_speed(
    top: float, way: float, at: dict[str, float]
) -> None:
    one = joint(**(BOUND | at))
    assert LAWS.speed_bound(one, top, way) == pytest.approx(bounded(top, way, **at))


def test_the_speed_towards_a_limit() -> None:
    """As it can be braked with 0.7 of the acceleration; from beyond it back within 0.1 s."""
    one = joint(limits__acceleration=20.0)
    assert LAWS.speed_towards(one, -0.02, 3.0) == pytest.approx(-0.2)
    assert LAWS.speed_towards(one, 5.0, 3.0) == 3.0
    assert LAWS.speed_towards(one, 0.1, 3.0) == LAWS.brake_speed(0.1, 14.0, 0.01) < 3.0
    assert LAWS.speed_towards(one, 0.0, 3.0) == 0.0


@pytest.mark.parametrize(
    ("position", "was", "on"),
    [
        (0.0, False, False), (2.001, False, True), (-2.001, False, True), (1.99, False, False),
        (1.99, True, True), (-1.99, True, True), (1.982, True, False), (-1.982, True, False),
        (1.983, True, True), (0.0, True, False),
    ],
)  # fmt: skip
def test_a_joint_is_on_a_limit_until_it_is_off_its_edge(
    position: float, was: bool, on: bool
) -> None:
    """1° from it, or a hundredth of the range."""
    edge = math.radians(1.0)
    one = joint(
        limits__lower=-2.0, limits__upper=2.0, limits__edge=edge, position=position, on_limit=was
    )
    LAWS.note_limit(one)
    assert bool(one.on_limit) is on
    short = joint(
        limits__lower=-0.5, limits__upper=0.5, limits__edge=edge, position=0.4901, on_limit=True
    )
    LAWS.note_limit(short)
    assert short.on_limit
    short.position = 0.4899
    LAWS.note_limit(short)
    assert not short.on_limit


@pytest.mark.parametrize("law", [POSITION, TORQUE])
@pytest.mark.parametrize("settling", [True, False])
@pytest.mark.parametrize("calibrated", [True, False])
def test_admissible_reference_of_a_joint(law: int, settling: bool, calibrated: bool) -> None:
    """1.02 of its speed where a position law has it; else as far as limits let it."""
    at = BOUND | {
        "limits.lower": -2.0,
        "limits.upper": 2.0,
        "position": 1.9,
        "limits.velocity": 3.0,
    }
    at |= {"reference.lower": -2.0, "reference.upper": 2.0}
    at |= {
        "drive.max": 500.0,
        "velocity": 2.5,
        "limits.acceleration": 20.0,
        "limits.torque": 600.0,
    }
    for position, limited in ((1.9, True), (-1.9, False), (0.0, False)):
        one = joint(**(at | {"position": position, "velocity": 2.5}))
        one.law, one.settling, one.calibrated, one.on_limit = law, settling, calibrated, False
        free = law != POSITION and not settling
        top = 3.0 if free else 3.06
        if free and calibrated and limited:
            top = LAWS.brake_speed(0.1, 14.0, 0.01)
        bottom = 3.0 if free else 3.06
        if free and calibrated and position < -1.0:
            bottom = LAWS.brake_speed(0.1, 14.0, 0.01)
        most = LAWS.speed_bound(one, top, 1.0)
        least = -LAWS.speed_bound(one, bottom, -1.0)
        for drive in (-1e4, -100.0, 0.0, 100.0, 1e4):
            expected = clip(max(min(drive, most), least), 500.0)
            assert LAWS.protect(one, drive) == pytest.approx(expected)
    beyond = joint(**(at | {"position": 2.1, "velocity": 0.0}))
    beyond.law, beyond.settling, beyond.calibrated, beyond.on_limit = TORQUE, False, True, False
    LAWS.protect(beyond, 0.0)
    assert beyond.on_limit


# --- what is handed down -------------------------------------------------------------------------


def handing(kind: str, law: int = POSITION, **at: float) -> Any:
    given = {"track.position": 0.5, "track.velocity": 0.3, "position": 0.2, "velocity": 0.1}
    given |= {
        "stiffness": 50.0,
        "damping": 3.0,
        "settling": False,
        "drive.in_amps": False,
        "law": law,
    }
    one = joint(**(given | at))
    one.drive.kind = getattr(LAWS, f"AS_{kind}")
    one.position_pid = pid(kp=100.0, kd=5.0, error=0.25, derivative=0.4)
    return one


def test_a_drive_of_one_number() -> None:
    for kind, name in (
        ("PWM", "output"),
        ("CURRENT", "set_point.current"),
        ("TORQUE", "set_point.torque"),
    ):
        one = handing(kind)
        LAWS.hand_down(one, 7.0)
        assert read(one, name) == 7.0
    one = handing("PWM", drive__in_amps=True)
    one.limits.output = 1e9
    alone = handing("PWM", drive__in_amps=True)
    alone.limits.output = 1e9
    LAWS.hand_down(one, 7.0)
    assert one.output == LAWS.current_law(alone, 7.0)


@pytest.mark.parametrize(
    ("law", "settling", "expected"),
    [
        (POSITION, False, (0.5, 0.3, 100.0, 5.0, 70.0 - 25.0 - 2.0)),
        (IMPEDANCE, True, (0.5, 0.3, 100.0, 5.0, 70.0 - 25.0 - 2.0)),
        (IMPEDANCE, False, (0.5, 0.0, 50.0, 3.0, 70.0 - 15.0 + 0.3)),
        (TORQUE, False, (0.5, 0.0, 0.0, 0.0, 70.0)),
        (CURRENT, False, (0.5, 0.0, 0.0, 0.0, 70.0)),
    ],
)
def test_a_drive_that_closes_an_impedance(
    law: int, settling: bool, expected: tuple[float, ...]
) -> None:
    """What its own spring and damper make is taken off the torque (S1)."""
    one = handing("IMPEDANCE", law, settling=settling)
    LAWS.hand_down(one, 70.0)
    found = (
        one.set_point.position,
        one.set_point.velocity,
        one.set_point.stiffness,
        one.set_point.damping,
        one.set_point.torque,
    )
    assert found == pytest.approx(expected)


def test_a_drive_that_closes_the_position() -> None:
    """S2: what is followed, with its torque; as a velocity with what it pursues."""
    at = {"forward": 11.0, "motor.viscous": 2.0, "motor.coulomb": 0.0, "drive.pursuit": 4.0}
    one = handing("POSITION", **at)
    one.position_pid.integral, one.position_pid.kff = 3.0, 0.5
    LAWS.hand_down_path(one, 1.5, one.track.position, one.track.velocity)
    torque = 3.0 + 0.25 + 11.0 + 1.5 + 0.6
    assert (one.set_point.position, one.set_point.velocity) == (0.5, 0.3)
    assert one.set_point.torque == one.torque_reference == pytest.approx(torque)
    one = handing("VELOCITY", **at)
    LAWS.hand_down_path(one, 1.5, one.track.position, one.track.velocity)
    assert (one.set_point.position, one.set_point.velocity) == (
        0.0,
        pytest.approx(0.3 + 4.0 * 0.3),
    )
    for way in (1.0, -1.0):
        one = handing("VELOCITY", **(at | {"position": 0.5 - way * 5.0, "forward": way * 500.0}))
        LAWS.hand_down_path(one, 0.0, one.track.position, one.track.velocity)
        assert one.set_point.velocity == pytest.approx(way * 3.06)
        assert one.set_point.torque == way * 60.0


# --- the whole of a cycle's control --------------------------------------------------------------


def controlled(law: int, kind: str = "PWM", **at: float) -> Any:
    """A joint of 1 N·m per percent, far from each bound, whose laws ask for what a test says."""
    quiet = {
        "drive.per_torque": 1.0,
        "drive.per_feed": 0.5,
        "output_offset": 4.0,
        "feeds": True,
        "motor.lead": 0.0,
    }
    quiet |= {
        "drive.compensation": 0.5,
        "drive.per_speed": 2.0,
        "velocity": 0.1,
        "position": 0.2,
        "motor.lag": 0.0,
    }
    quiet |= {
        "track.position": 0.2,
        "track.velocity": 0.1,
        "forward": 0.0,
        "drive.delay": 0.0,
        "lift": 0.0,
    }
    quiet |= {"limits.output": 100.0, "drive.max": 90.0, "current": 0.0, "current_before": 0.0}
    quiet |= {
        "acceleration": 0.0,
        "motor.inertia_min": 1e6,
        "calibrated": False,
        "drive.in_amps": False,
    }
    quiet |= {
        "settling": False,
        "holding": False,
        "torque": 0.0,
        "strain_cycles": 5,
        "set_point.request": 0.0,
    }
    one = joint(**(quiet | at))
    for name in (
        "motor.coulomb",
        "motor.coulomb_negative",
        "motor.viscous",
        "motor.viscous_negative",
    ):
        write(one, name, 0.0)
    one.law, one.drive.kind = law, getattr(LAWS, f"AS_{kind}")
    one.position_pid = pid(limit=1e3, integral=10.0, previous=9.0, ki_period=1e-9)
    one.torque_pid = pid(kff=1.0, limit=1e3)
    one.current_pid = pid(integral=5.0)
    LAWS.control(one)
    return one


def test_off_gives_nothing() -> None:
    assert controlled(OFF, output=7.0).output == 0.0


@pytest.mark.parametrize("kind", ["POSITION", "VELOCITY"])
def test_drives_of_positions_are_given_the_path(kind: str) -> None:
    one = controlled(TORQUE, kind, output=7.0, track__position=0.5)
    assert one.set_point.torque == pytest.approx(10.0 + 2.0)
    assert one.output == 7.0


@pytest.mark.parametrize("feeds", [True, False])
def test_an_output_is_passed_unchanged(feeds: bool) -> None:
    """P8: with what is fed; the current loop begins anew after it."""
    one = controlled(OUTPUT, output_command=30.0, feeds=feeds)
    assert one.output == pytest.approx(30.0 + (2.0 if feeds else 0.0))
    assert one.current_pid.integral == 0.0
    for way in (1.0, -1.0):
        most = controlled(OUTPUT, output_command=way * 300.0, limits__output=70.0)
        assert most.output == way * 70.0


@pytest.mark.parametrize(("settling", "holding"), [(False, False), (True, False), (False, True)])
def test_a_current_is_passed_unchanged(settling: bool, holding: bool) -> None:
    """Y2: once one was asked for; before, the joint is held."""
    at: dict[str, float] = {"current_command": 30.0, "settling": settling, "holding": holding}
    one = controlled(CURRENT, "CURRENT", torque_command=6.0, hold_place=0.2, **at)
    if settling:
        expected = 10.0 + 0.1 + 2.0
    elif holding:
        expected = 6.0 + 0.1 + 2.0
    else:
        expected = 32.0
    assert one.set_point.current == pytest.approx(expected, abs=1e-6)
    for way in (1.0, -1.0):
        most = controlled(
            CURRENT, "CURRENT", **(at | {"current_command": way * 300.0, "feeds": False})
        )
        if not (settling or holding):
            assert most.set_point.current == way * 90.0


def test_a_torque_becomes_a_drive() -> None:
    """With the part of back-EMF that is made up for, and what is fed."""
    one = controlled(TORQUE, torque_command=20.0)
    assert one.output == pytest.approx(20.0 + 0.5 * 2.0 * 0.1 + 2.0)
    assert one.strain_cycles == 0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_torque_beyond_the_limit_strains_the_joint(way: float) -> None:
    """And winds nothing up; only in a position mode it is counted."""
    one = controlled(POSITION, forward=way * 80.0, feeds=False)
    assert one.output == pytest.approx(way * 60.0 + 0.1)
    assert one.strain_cycles == 6
    other = controlled(
        IMPEDANCE,
        torque_offset=way * 99.0,
        load_taken=0.0,
        stiffness=0.0,
        lifts=False,
        damping=0.0,
        feeds=False,
    )
    assert other.strain_cycles == 0
    assert (
        controlled(POSITION, forward=way * 80.0, strain_cycles=1_000_000).strain_cycles
        == 1_000_000
    )


def test_a_saturated_drive_reduces_the_integral() -> None:
    """Of the loop that runs, where it pushes further: by the torque's limit, by the drive's."""
    for at in ({"forward": 70.0}, {"drive.max": 5.0}):
        for error, integral in ((0.1, 10.0), (-0.1, 10.0 - 1e-10)):
            one = controlled(POSITION, track__position=0.2 + error, **at)
            assert one.position_pid.previous == 10.0
            assert (one.position_pid.integral == 10.0) is (error > 0.0)
            assert one.position_pid.integral == pytest.approx(integral, abs=1e-12)
