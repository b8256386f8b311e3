# SPDX-License-Identifier: Apache-2.0
"""What is told of motors, amplifiers and control loops; the words are those of the wire (Y5)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Loop(StrEnum):
    """A control loop that can be looked into, and reset."""

    POSITION = "position"
    VELOCITY = "velocity"  # of the position loop: its rate
    TORQUE = "torque"
    CURRENT = "current"


@dataclass(frozen=True, slots=True, eq=False)
class Motors:
    """Motors and amplifiers of joints, an array of shape (k,) each; prismatic joints: m, N.

    Attributes:
        gear_ratios: rad of the motor per rad of the joint.
        positions: of the motor's shaft, rad; NaN without an encoder there, as the next two.
        velocities: rad/s.
        accelerations: rad/s².
        currents: measured, A.
        nominal_currents: that can flow for ever, A.
        peak_currents: beyond which it is an overcurrent, A.
        max_currents: the largest that the board asks for now, A.
        outputs: PWM, percent.
        output_limits: the largest PWM now, percent.
        supply_voltages: V; NaN where it is not measured.
        temperatures: of the windings, °C; NaN without a sensor.
        temperature_limits: °C.
        torque_limits: of the joints, either way, N·m.
        torque_constants: of the motors, N·m/A.
    """

    gear_ratios: Floats
    positions: Floats
    velocities: Floats
    accelerations: Floats
    currents: Floats
    nominal_currents: Floats
    peak_currents: Floats
    max_currents: Floats
    outputs: Floats
    output_limits: Floats
    supply_voltages: Floats
    temperatures: Floats
    temperature_limits: Floats
    torque_limits: Floats
    torque_constants: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Pids:
    """One loop of joints, an array of shape (k,) each.

    Attributes:
        references: what it follows, in its unit: rad, rad/s, N·m, A.
        errors: reference less measured value, likewise.
        outputs: what it puts out: N·m; of the current loop PWM, percent.
        offsets: what is added to the output, u_ff, PWM percent.
    """

    references: Floats
    errors: Floats
    outputs: Floats
    offsets: Floats
