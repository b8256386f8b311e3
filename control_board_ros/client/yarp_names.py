# SPDX-License-Identifier: Apache-2.0
"""Equivalents of YARP methods: snake_case, one name for one joint and for all."""

from __future__ import annotations

import re
from collections.abc import Collection

#: YARP names with a different word.
OTHER_WORDS = {
    "get_encoder_timed": "get_state",
    "get_encoders_timed": "get_state",
    "get_axis_name": "names",
    "set_ref_duty_cycle": "set_output",
    "get_ref_duty_cycle": "get_output",
    "get_duty_cycle": "get_state",
    "get_impedance_offset": "get_torque_offset",
    "set_impedance_offset": "set_feedforward",
    "get_last_joint_fault": "get_faults",
    "calibrate_axis_with_params": "calibrate",
    "calibrate_robot": "calibrate",
    "calibrate_whole_part": "calibrate",
    "homing_whole_part": "home",
    "park_whole_part": "park",
    "enable_amp": "set_control_mode",
    "disable_amp": "set_control_mode",
    "get_amp_status": "get_control_mode",
    "get_available_control_mode": "get_available_modes",
    "get_current_impedance_limit": "get_max_impedance",
    "calibration_done": "get_calibration",
    "get_pid": "get_gains",
    "set_pid": "set_parameters",
    "set_limits": "set_pos_limits",
    "get_pwmlimit": "get_pwm_limit",
    "set_pwmlimit": "set_pwm_limit",
    "get_last_position_error": "get_pid_error",
    "update_virtual_analog_sensor_measure": "update_torque_sensor",
    "get_target_velocitie": "get_target_velocity",
    "get_power_supply_voltages": "get_power_supply_voltage",
    "get_ref_velocitie": "get_ref_velocity",
}

#: Names that no library has, and that are tried first.
GUESSES = {
    "get_position": "get_encoder",
    "get_joint_position": "get_encoder",
    "get_velocity": "get_encoder_speed",
    "get_velocitie": "get_encoder_speed",
    "get_joint_name": "names",
    "get_mode": "get_control_mode",
    "set_mode": "set_control_mode",
    "set_velocity": "velocity_move",
    "set_torque": "set_ref_torque",
    "set_speed": "set_ref_speed",
    "set_target": "position_move",
    "move_to": "move",
    "clear_fault": "recover",
    "wait_motion_done": "move",
}


def snake_case(name: str) -> str:
    """``setRefSpeeds`` as ``set_ref_speeds``."""
    return re.sub(r"(?<=[a-z0-9])([A-Z])", r"_\1", name).lower()


def name_here(name: str, known: Collection[str]) -> str | None:
    """The equivalent of a method of YARP, or of one guessed; None if there is none."""
    snake = snake_case(name)
    for word in (snake, snake.removesuffix("s")):
        renamed = OTHER_WORDS.get(word) or GUESSES.get(word, word)
        if renamed in known and renamed != name:
            return renamed
    return None
