# SPDX-License-Identifier: Apache-2.0
"""The state of a board: its rows, what a power-on forgets, and what has changed since when."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rig import board_config

from control_board_ros.core.state import BLOCK_ROWS, Reference, Snapshot, StateArrays
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import MOTOR_ROWS, ROWS, VALUES, Motor, Row
from control_board_ros.core.terms.modes import INITIAL_INTERACTION
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

N = 3
#: The row of each quantity; torques without a sensor are shown as no numbers.
ROW_OF = {
    "position": Row.POSITION,
    "velocity": Row.VELOCITY,
    "current": Row.CURRENT,
    "temperature": Row.TEMPERATURE,
    "position_reference": Reference.POSITION,
    "velocity_reference": Reference.VELOCITY,
    "torque_reference": Reference.TORQUE,
    "output": Reference.OUTPUT,
}


def state() -> StateArrays:
    return StateArrays(board_config().names)


def test_each_view_is_its_row_of_the_block() -> None:
    made = state()
    made.block[:] = np.arange(BLOCK_ROWS * N).reshape(BLOCK_ROWS, N)
    assert made.torque.tolist() == made.block[Row.TORQUE].tolist()
    for name, row in ROW_OF.items():
        assert getattr(made, name).tolist() == made.block[row].tolist(), name
    assert np.shares_memory(made.measured, made.block)
    assert len(made.measured) == ROWS
    assert sorted({*Row, *Reference}) == list(range(BLOCK_ROWS))
    assert Reference.VELOCITY - Reference.POSITION == 1
    assert Reference.OUTPUT - Row.CURRENT == 1


def test_at_first_nothing_is_known_and_nothing_has_power() -> None:
    made = state()
    assert np.isnan(made.external_torque).all()
    assert not made.block[: Reference.EXTERNAL_TORQUE].any()
    assert not made.powered.any()
    assert not made.calibrated.any()
    assert not made.accepts.any()
    assert not made.rejected.any()
    assert made.done.all()
    assert np.isnan(made.motors).all()
    assert made.motors.shape == (MOTOR_ROWS, N)
    assert made.set_points.shape == (VALUES, N)
    assert not made.set_points.any()
    assert made.kinds.tolist() == [SetPoint.PWM] * N
    assert made.control_modes == [ControlMode.NOT_CONFIGURED] * N
    assert made.interaction_modes == [InteractionMode.STIFF] * N
    assert made.before == [ControlMode.NOT_CONFIGURED] * N
    assert (made.time, made.cycle) == (0.0, 0)
    assert [fault.name for fault in made.faults] == ["left", "right", "bare"]
    assert (made.modes_changed, made.faults_changed) == ([0] * N, [0] * N)


def test_a_power_on_clears_the_state_of_its_joints() -> None:
    """N1, F5: offsets and modes; the record of a fault stays readable."""
    made = state()
    made.offset[:] = made.motor_offset[:] = made.travelled[:] = 1.5
    made.calibrated[:] = made.accepts[:] = True
    made.interaction_modes = [InteractionMode.COMPLIANT] * N
    made.faults = [replace(fault, active=True, code=3, text="hot") for fault in made.faults]
    before = made.faults_version
    made.power_on([0, 2])
    assert made.offset.tolist() == made.motor_offset.tolist() == [0.0, 1.5, 0.0]
    assert made.travelled.tolist() == [0.0, 1.5, 0.0]
    assert made.calibrated.tolist() == [False, True, False]
    assert (made.accepts == [False, True, False]).all()
    assert made.interaction_modes == [
        INITIAL_INTERACTION,
        InteractionMode.COMPLIANT,
        INITIAL_INTERACTION,
    ]
    assert [(fault.active, fault.code, fault.text) for fault in made.faults] == [
        (False, 3, "hot"),
        (True, 3, "hot"),
        (False, 3, "hot"),
    ]
    assert made.faults_version == before + 1
    assert made.faults_changed == [before + 1, 0, before + 1]


def test_changes_since_a_snapshot() -> None:
    """Modes and faults have versions of their own."""
    made = state()
    made.note_modes([1])
    made.note_modes([1, 2])
    made.note_faults([0])
    assert (made.modes_version, made.modes_changed) == (2, [0, 2, 2])
    assert (made.faults_version, made.faults_changed) == (1, [1, 0, 0])


def snapshot(**changes: object) -> Snapshot:
    block = np.arange(BLOCK_ROWS * N, dtype=float).reshape(BLOCK_ROWS, N)
    flags = np.array([True, False, True])
    given: dict[str, object] = {
        "time": 1.0,
        "cycle": 7,
        "block": block,
        "motion_done": flags,
        "rejected_commands": np.zeros(N, dtype=np.uint64),
        "calibrated": flags,
        "overload": np.zeros(N),
        "torque_sensor": flags,
        "unknown_commands": 0,
        "brake": flags,
        "brake_slips": flags,
        "motors": np.arange(MOTOR_ROWS * N, dtype=float).reshape(MOTOR_ROWS, N),
        "acceleration": np.zeros(N),
        "contacts": np.zeros(N, dtype=np.uint64),
    }
    return Snapshot(**(given | changes))  # type: ignore[arg-type]


def test_a_snapshot_has_the_rows_of_its_block() -> None:
    shown = snapshot()
    for name, row in ROW_OF.items():
        assert getattr(shown, name).tolist() == shown.block[row].tolist(), name
    torque = shown.block[Row.TORQUE]
    assert np.array_equal(shown.torque, [torque[0], np.nan, torque[2]], equal_nan=True)


def test_a_snapshot_has_the_rows_of_its_motors() -> None:
    shown = snapshot()
    assert shown.motor_position.tolist() == shown.motors[Motor.POSITION].tolist()
    assert shown.motor_velocity.tolist() == shown.motors[Motor.VELOCITY].tolist()
    assert shown.supply_voltage.tolist() == shown.motors[Motor.SUPPLY].tolist()
