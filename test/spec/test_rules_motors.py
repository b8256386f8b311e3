# SPDX-License-Identifier: Apache-2.0
"""SPEC Y5: motor encoders, amplifiers and control loops."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from rig import LIMITS, MOTOR, Held, M, Rig, board_config, joint, ready

from control_board_ros.core.config.config import Calibration
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.measurement import Motor, Row
from control_board_ros.core.terms.motors import TERMS, Loop
from control_board_ros.core.terms.reply import Reason


@pytest.fixture
def rig() -> Rig:
    made = ready()
    made.enter("pos")
    return made


@pytest.mark.fresh("the reading of that instant")
def test_a_motor_turns_with_its_joint(rig: Rig) -> None:
    """Y5: by the gear ratio, in the state and by request."""
    rig.board.position_move("left", 0.5, 1.0)
    shown = rig.run(0.3)
    ratio = MOTOR.gear_ratio
    found = rig.board.get_motors("left")
    np.testing.assert_allclose(shown.motor_position, ratio * shown.position, atol=1e-9)
    np.testing.assert_allclose(shown.motor_velocity, ratio * shown.velocity, atol=1e-9)
    assert found.positions[0] == shown.motor_position[0] != 0.0
    assert found.accelerations[0] == pytest.approx(ratio * shown.acceleration[0])
    assert shown.acceleration[0] != 0.0
    assert found.gear_ratios[0] == ratio
    np.testing.assert_array_equal(shown.supply_voltage, [MOTOR.supply_voltage] * 3)


def test_name_plates_are_reported(rig: Rig) -> None:
    """Y5: as configured, in the order asked."""
    found = rig.board.get_motors(["right", "left"])
    assert found.nominal_currents.tolist() == [LIMITS.nominal_current] * 2
    assert found.peak_currents.tolist() == found.max_currents.tolist() == [LIMITS.peak_current] * 2
    assert found.output_limits.tolist() == [100.0] * 2
    assert found.torque_limits.tolist() == [LIMITS.torque] * 2
    assert found.torque_constants.tolist() == [MOTOR.torque_constant] * 2
    assert found.temperature_limits.tolist() == [LIMITS.temperature] * 2


@pytest.mark.parametrize("output", ["pwm", "current"])
def test_the_largest_current_is_the_set_one(output: str) -> None:
    """Y5: no user's torque drives more through the motor; a power-on forgets it."""
    made = ready(board_config(joint("left"), joint("right"), output=output))
    made.enter(M.TORQUE)
    assert made.board.set_motors("left", max_currents=4.0)
    made.board.set_ref_torque(None, 40.0)  # 8 A
    shown = made.record(0.03)[-5:]  # not at the speed limit yet
    assert max(float(one.current[0]) for one in shown) < 4.6
    assert max(float(one.current[1]) for one in shown) > 7.0
    assert made.board.get_motors().max_currents.tolist() == [4.0, LIMITS.peak_current]
    made.board.power_cycle()
    assert made.board.get_motors().max_currents.tolist() == [LIMITS.peak_current] * 2


def test_the_largest_pwm_is_the_set_one(rig: Rig) -> None:
    """Y5, P8: also in OPENLOOP."""
    rig.enter(M.OPENLOOP)
    assert rig.board.set_motors(["left", "right"], output_limits=[5.0, 0.0])
    rig.board.set_output(None, 20.0)
    assert rig.tick().output.tolist() == [5.0, 0.0, 20.0]


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"max_currents": math.nan},
        {"max_currents": 5e-324},
        {"output_limits": -1.0},
        {"output_limits": [1.0, 2.0]},
        {"max_currents": 1.0, "output_limits": math.inf},
        {"torque_constants": 0.009},
        {"viscous_positive": -0.1},
        {"max_currents": 1.0, "torque_constants": 5.0},
    ],
    ids=str,
)
def test_caps_lie_within_the_configuration(rig: Rig, given: dict[str, Any]) -> None:
    """Y5, M7: else nothing is set."""
    before = rig.board.get_motors()
    reply = rig.board.set_motors("left", **given)
    assert not reply
    assert reply.message
    after = rig.board.get_motors()
    for name in ("max_currents", "output_limits", *TERMS):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


@pytest.mark.parametrize("output", ["pwm", "current"])
def test_laws_drive_by_the_constants_that_are_set(output: str) -> None:
    """Y5, P10: i = τ/(k_t N), u = 100/V (R i + k_e N dq); one joint, until the next power-on."""
    config = board_config(joint("left"), joint("right"), output=output)
    made = Rig(config, Held(config))
    made.tick(3)
    made.enter(M.TORQUE)
    made.plant.values[Row.VELOCITY] = 0.2
    assert made.board.set_motors("left", torque_constants=0.2, back_emf_constants=0.05)
    made.board.set_ref_torque(None, 10.0)
    laws = made.board.engine.controller.joints
    made.tick(2)
    assert made.board.get_motors().torque_constants.tolist() == [0.2, 0.1]
    assert made.board.get_motors().back_emf_constants.tolist() == [0.05, 0.1]
    assert laws[0].drive.per_torque == pytest.approx(0.5 * laws[1].drive.per_torque)
    assert laws[0].motor.emf == pytest.approx(0.5 * laws[1].motor.emf)
    if output == "pwm":
        assert laws[0].drive.per_speed == pytest.approx(100.0 / 48.0 * 0.05 * MOTOR.gear_ratio)
    made.board.reconfigure(config)  # of other parameters: what was set stays
    assert laws[0].motor.torque_per_ampere == pytest.approx(2.0 * laws[1].motor.torque_per_ampere)
    made.board.power_cycle()
    assert made.board.get_motors().torque_constants.tolist() == [0.1, 0.1]
    assert made.board.engine.controller.joints[0].drive.per_torque == laws[1].drive.per_torque


@pytest.mark.parametrize(("speed", "friction"), [(0.5, 3.0 + 2.0 * 0.5), (-0.5, -5.0)])
def test_friction_that_is_set_is_fed_forward(speed: float, friction: float) -> None:
    """Y5: F_c clamp(v/v_s) + F_v v of its direction, beside a joint that has none."""
    config = board_config(joint("left"), joint("right"))
    made = Rig(config, Held(config))
    made.tick(3)
    made.enter(M.VELOCITY)
    given = {
        "viscous_positive": 2.0,
        "viscous_negative": 0.0,
        "coulomb_positive": 3.0,
        "coulomb_negative": 5.0,
        "velocity_thresholds": 0.05,
    }
    assert made.board.set_motors("left", **given)
    found = made.board.get_motors()
    for name, value in given.items():
        assert getattr(found, name)[0] == value
    made.board.velocity_move(None, speed, 20.0)
    left, right = made.tick(16).output.tolist()
    per_torque = made.board.engine.controller.joints[1].drive.per_torque
    assert (left - right) / per_torque == pytest.approx(friction)


@pytest.mark.fresh("the reading of that instant")
def test_a_motor_encoder_reads_its_set_value(rig: Rig) -> None:
    """Y5: and goes on from there; the joint's angle is another thing."""
    rig.board.position_move("left", 0.2, 1.0)
    angle = float(rig.run(1.0).position[0])
    assert rig.board.set_encoders("left", 3.0, motor=True)
    shown = rig.tick()
    assert shown.motor_position[0] == pytest.approx(3.0, abs=1e-3)
    assert shown.position[0] == pytest.approx(angle, abs=1e-3)
    rig.board.position_move("left", 0.3, 1.0)
    shown = rig.run(1.0)
    turned = MOTOR.gear_ratio * (shown.position[0] - angle)
    assert shown.motor_position[0] == pytest.approx(3.0 + turned, abs=0.05)
    rig.board.power_cycle()
    shown = rig.tick(2)
    assert shown.motor_position[0] == pytest.approx(MOTOR.gear_ratio * shown.position[0], abs=1e-6)


def test_the_angle_of_a_joint_without_power_can_be_set(rig: Rig) -> None:
    """Y5: it is there, and holds there; with power, or beyond its stops, it is refused."""
    assert rig.board.set_encoders("left", 1.0).codes == (Reason.OTHER_MODE,)
    rig.enter("idl")
    assert rig.board.set_encoders("left", 9.0).codes == (Reason.OUT_OF_RANGE,)
    assert rig.board.get_encoder("left")[0] == pytest.approx(0.0, abs=1e-3)
    assert rig.board.set_encoders(["left", "right"], [1.0, -1.0])
    assert rig.tick().position[:2].tolist() == pytest.approx([1.0, -1.0], abs=1e-3)
    rig.enter("pos")
    shown = rig.run(0.5)
    assert shown.position[:2].tolist() == pytest.approx([1.0, -1.0], abs=5e-3)
    assert rig.modes()[:2] == [M.POSITION] * 2
    assert not rig.board.set_encoders("left", math.nan)
    rig.enter("idl")
    assert rig.board.set_encoders()
    assert rig.tick().position.tolist() == pytest.approx([0.0] * 3, abs=1e-3)


@pytest.mark.fresh("the reading of that instant")
def test_loops_report_their_references(rig: Rig) -> None:
    """Y5: reference, error and output of each loop."""
    rig.plant.push("left", 8.0)
    shown = rig.run(1.0)
    found = rig.board.get_pids("position", "left")
    assert found.references[0] == pytest.approx(shown.position_reference[0], abs=1e-6)
    assert found.errors[0] == pytest.approx(found.references[0] - shown.position[0], abs=1e-9)
    assert found.outputs[0] == pytest.approx(-8.0, abs=0.5)
    rig.enter("torq", "left")
    rig.board.set_ref_torque("left", -8.0)
    rig.run(0.2)
    found = rig.board.get_pids(Loop.TORQUE, "left")
    assert found.references[0] == -8.0
    assert abs(found.errors[0]) < 0.5
    with pytest.raises(RequestError, match="loop 'pwm' unknown; one of position"):
        rig.board.get_pids("pwm")


@pytest.mark.fresh("the reading of that instant")
def test_a_loop_is_reset_and_given_an_offset(rig: Rig) -> None:
    """Y5: what it has integrated is gone; an offset is u_ff."""
    rig.plant.push("left", 8.0)
    rig.run(1.0)
    laws = rig.board.engine.controller.joints[0]
    assert abs(laws.position_pid.integral) > 4.0
    assert rig.board.set_pids("position", "left", reset=True)
    assert laws.position_pid.integral == 0.0
    assert rig.board.set_pids("position", "left", offsets=3.0)
    assert rig.board.get_pids("position", "left").offsets[0] == 3.0
    assert laws.output_offset == 3.0
    assert not rig.board.set_pids("position", "left")
    assert not rig.board.set_pids("position", "left", offsets=math.nan)
    assert not rig.board.set_pids("nope", "left", reset=True)


@pytest.mark.parametrize(
    ("name", "most", "zero"),
    [
        ("max_currents", LIMITS.peak_current, False),
        ("output_limits", 100.0, True),
        ("torque_constants", 10.0 * MOTOR.torque_constant, False),
        ("back_emf_constants", 2.0 * MOTOR.torque_constant, True),
        ("viscous_positive", LIMITS.torque / LIMITS.velocity, True),
        ("viscous_negative", LIMITS.torque / LIMITS.velocity, True),
        ("coulomb_positive", LIMITS.torque, True),
        ("coulomb_negative", LIMITS.torque, True),
        ("velocity_thresholds", LIMITS.velocity, False),
    ],
)
def test_allowed_motor_values(rig: Rig, name: str, most: float, zero: bool) -> None:
    """Y5: up to the most, which is included; 0 where it means something."""
    assert rig.board.set_motors("left", **{name: most})
    assert getattr(rig.board.get_motors("left"), name)[0] == most
    assert not rig.board.set_motors("left", **{name: 1.001 * most})
    assert bool(rig.board.set_motors("left", **{name: 0.0})) is zero


def test_an_acceleration_of_a_motor_without_an_encoder_is_not_known(rig: Rig) -> None:
    """Y5: as its position is not."""
    rig.board.position_move("left", 0.5, 1.0)
    rig.tick(20)
    state = rig.board.state
    assert np.isfinite(rig.board.get_motors().accelerations).all()
    state.motors[Motor.POSITION, 1] = math.nan
    assert np.isnan(rig.board.get_motors().accelerations).tolist() == [False, True, False]
    reply = rig.board.set_encoders(["left", "right"], [1.0, 2.0], motor=True)
    assert reply.codes == ("", Reason.UNSUPPORTED)
    assert "right has no encoder at its motor" in reply.message


def test_an_angle_is_set_from_the_encoder_not_from_the_last_angle(rig: Rig) -> None:
    """Y5: twice in a row; the references go with it, within the limits."""
    rig.enter("idl")
    for angle in (1.0, -0.5, 2.1):
        assert rig.board.set_encoders("left", angle)
        shown = rig.tick()
        assert shown.position[0] == pytest.approx(angle, abs=1e-3)
        assert shown.position_reference[0] == pytest.approx(angle, abs=1e-3)
    laws = rig.board.engine.controller.joints[0]
    assert laws.reference.upper == pytest.approx(
        2.1, abs=1e-3
    )  # beyond its limit of 2, no further out


def test_a_loop_in_a_calibration_is_its_calibrator_s() -> None:
    """Y5, K2: of the joint that calibrates; of another it is taken."""
    slow = Calibration(type=3, required=False, start=1.0, speed=0.05, timeout=100.0)
    made = ready(board_config(joint("left", calibration=slow), joint("right")))
    assert made.board.calibrate("left")
    reply = made.board.set_pids("position", None, reset=True)
    assert reply.codes == (Reason.CALIBRATING, "")
    assert "its calibrator has the loop" in reply.message


def test_feed_forward_of_all_joints_or_of_none(rig: Rig) -> None:
    """P11, M7: where one of two is refused, the other gets none; nor is it counted."""
    rig.board.set_feedforward(None, outputs=[1.0, 2.0, 3.0])
    reply = rig.board.set_feedforward(["left", "right"], outputs=[4.0, math.nan], together=True)
    assert [bool(code) for code in reply.codes] == [True, True]
    assert [one.output_offset for one in rig.board.engine.controller.joints] == [1.0, 2.0, 3.0]
    assert rig.board.rejected_commands.tolist() == [0, 1, 0]
