# SPDX-License-Identifier: Apache-2.0
"""Loops and motors of virtual servos: their makers', by the values in their registers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from drive_bench import Bench

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives.serial_line import Item
from control_board_ros.plants.dynamixel import control_table
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.dynamixel.virtual import VirtualDynamixel
from control_board_ros.plants.feetech import memory
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.feetech.virtual import VirtualFeetech
from control_board_ros.plants.virtual.servo import ServoMotor
from control_board_ros.settings.loading import load

STEP = 1e-3


def sts3215(**items: int) -> VirtualFeetech:
    """One with torque, its goal in the middle of its turn."""
    servo = VirtualFeetech(1)
    servo.table.set(feetech.GOALS, feetech.CENTRE)
    servo.table.set(feetech.TORQUE, 1)
    for name, value in items.items():
        servo.table.set(memory.DELIVERED[name][0], value)
    servo.dry = servo.viscous = servo._profile = 0.0
    servo._profile = float(feetech.CENTRE)
    return servo


def xm430(mode: int = dynamixel.POSITION_MODE, **items: int) -> VirtualDynamixel:
    """One with torque, its goal in the middle of its turn, no current limit in the way."""
    servo = VirtualDynamixel(1)
    servo.table.set(dynamixel.GOAL_POSITION, dynamixel.CENTRE)
    servo.table.set(dynamixel.MODE, mode)
    servo.table.set(dynamixel.TORQUE, 1)
    for name, value in items.items():
        servo.table.set(control_table.ROWS[name.replace("_", " ")].item, value)
    return servo


def stall(motor: ServoMotor) -> float:
    return motor.constant * motor.supply / motor.resistance


def test_an_sts3215_is_as_stiff_as_bam_measured() -> None:
    """32 × 0.166 duty/rad × 3.35 N·m of stall torque; 16 is half, as LeRobot sets it."""
    assert sts3215().step(STEP, -0.1, 0.0) == pytest.approx(1.78, abs=0.005)
    assert sts3215(P_Coefficient=16).step(STEP, -0.1, 0.0) == pytest.approx(0.89, abs=0.003)


@pytest.mark.parametrize(("limit", "most"), [(1000, 0.97), (500, 0.5)])
def test_the_duty_of_an_sts3215_is_bounded(limit: int, most: float) -> None:
    servo = sts3215(Torque_Limit=limit)
    assert servo.step(STEP, -1.0, 0.0) == pytest.approx(most * stall(servo.motor))
    assert servo.step(STEP, 1.0, 0.0) == pytest.approx(-most * stall(servo.motor))


def test_an_xm430_is_as_stiff_as_its_manual_says() -> None:
    """Position P Gain/128 of PWM per count, of 885: 4.60 duty/rad × 4.1 N·m."""
    assert xm430().step(STEP, -0.1, 0.0) == pytest.approx(1.888, abs=0.005)
    assert xm430(Position_P_Gain=400).step(STEP, -0.1, 0.0) == pytest.approx(0.944, abs=0.003)
    assert xm430().step(STEP, -1.0, 0.0) == pytest.approx(4.1)
    assert xm430(Goal_PWM=443).step(STEP, -1.0, 0.0) == pytest.approx(4.1 * 443 / 885)


@pytest.mark.parametrize(
    ("make", "library", "item", "motor"),
    [("feetech", "scservo_sdk", feetech.P, (1.21164, 2.67617, 7.4)),
     ("dynamixel", "dynamixel_sdk", control_table.AT[84].item, control_table.MOTOR)],
)  # fmt: skip
def test_a_servo_reports_its_stiffness(make: str, library: str, item: Item, motor: Any) -> None:
    """Of its present gain, also after a restart, and the torque that its motor gives at most."""
    pytest.importorskip(library)
    constant, resistance, supply = motor
    config = load("iiwa").board.joints[0]
    own = replace(
        config.motor,
        gear_ratio=1.0,
        efficiency=1.0,
        torque_constant=2.0 * constant,
        resistance=resistance,
        supply_voltage=supply,
    )
    with Bench(make, names=("one",), options={"ratio": "2.0"}) as bench:
        servo = bench.drives[0]
        bench.joints = (replace(config, motor=own),)
        assert bench.plant.describe().joints[0].stiffness == 0.0
        bench.connect()
        delivered = bench.plant.describe().joints[0]
        bench.follow(SetPoint.POSITION, 20, position=0.0)
        at_rest = servo.step(STEP, -0.01, 0.0)
        assert delivered.stiffness == pytest.approx(4.0 * at_rest / 0.01, rel=0.02)
        assert delivered.limits.torque == pytest.approx(2.0 * servo.step(STEP, -3.0, 0.0))
        servo.table.set(item, servo.table.get(item) // 2)
        if make == "feetech":
            servo.store()
        servo.reboot()
        bench.recover()
        again = bench.plant.describe().joints[0].stiffness
        assert again == pytest.approx(delivered.stiffness / (2.0 if make == "feetech" else 1.0))


def test_gains_outlast_changes_of_mode() -> None:
    """S1: a change of mode resets them; those found at set-up act, and are what is reported."""
    pytest.importorskip("dynamixel_sdk")
    with Bench("dynamixel", names=("one",)) as bench:
        table = bench.drives[0].table
        names = ("Position P Gain", "Position I Gain", "Position D Gain")
        for name, value in zip(names, (400, 20, 300), strict=True):
            table.set(control_table.ROWS[name].item, value)
        bench.connect()
        for kind in (SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.POSITION):
            bench.follow(kind, 40)
            found = [table.get(control_table.ROWS[name].item) for name in names]
            assert found == ([400, 20, 300] if kind is SetPoint.POSITION else [800, 0, 0])


def test_its_other_gains_act() -> None:
    """I sums the error, once a ms, and stops where all of the supply is used; D damps."""
    still, summing = xm430(), xm430(Position_I_Gain=1000)
    before = summing.step(STEP, -0.01, 0.0)
    for _ in range(99):
        summed = summing.step(STEP, -0.01, 0.0)
    counts = 0.01 / dynamixel.COUNT
    assert still.step(STEP, -0.01, 0.0) < before
    assert summed - before == pytest.approx(4.1 * 99 * counts * 1000 / 65536 / 885)
    for _ in range(20_000):
        summed = summing.step(STEP, -0.01, 0.0)
    assert summed == pytest.approx(4.1)
    assert summing.step(STEP, 0.01, 0.0) < 4.1
    damped = xm430(Position_D_Gain=1000)
    damped.step(STEP, -0.002, 0.0)
    assert damped.step(STEP, -0.001, 0.0) < 0.0


def test_a_current_is_what_its_supply_can_drive() -> None:
    servo = xm430(dynamixel.CURRENT_MODE, Goal_Current=371)
    amps = 371 * 2.69e-3
    assert servo.step(STEP, 0.0, 0.0) == pytest.approx(amps * servo.motor.constant)
    fast = 12.0 / servo.motor.constant  # no current is left at this speed
    assert servo.step(STEP, 0.0, fast) == pytest.approx(0.0, abs=1e-9)
    bounded = xm430(5, Goal_Current=371)
    assert bounded.step(STEP, -1.0, 0.0) == pytest.approx(amps * servo.motor.constant)


@pytest.mark.parametrize("of_dynamixel", [True, False])
def test_a_velocity_is_reached_against_a_load(of_dynamixel: bool) -> None:
    """By the integral part of its loop; a light joint, 0.3 N·m."""
    servo: VirtualDynamixel | VirtualFeetech
    if of_dynamixel:
        servo = xm430(dynamixel.VELOCITY_MODE, Goal_Velocity=42)
        goal = 42 * dynamixel.SPEED
    else:
        servo = sts3215(Operating_Mode=feetech.VELOCITY_MODE)
        servo.table.set(feetech.GOALS, 652 << 32)
        goal = 652 * feetech.COUNT
    place = speed = 0.0
    for _ in range(3000):
        speed += STEP * (servo.step(STEP, place, speed) - 0.3) / 0.05
        place += STEP * speed
    assert speed == pytest.approx(goal, rel=0.01)
