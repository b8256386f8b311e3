# SPDX-License-Identifier: Apache-2.0
"""Data of motors, amplifiers and control loops; the words are those of the wire (Y5)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, StrEnum

from .arguments import Array, Values


class Loop(StrEnum):
    """A control loop that can be looked into, and reset."""

    POSITION = "position"
    VELOCITY = "velocity"  # of the position loop: its rate
    TORQUE = "torque"
    CURRENT = "current"


class Term(IntEnum):
    """Constants and friction of a motor that the laws use, as fields of Motors (TERMS)."""

    TORQUE_CONSTANT = 0
    BACK_EMF = 1
    VISCOUS_POSITIVE = 2
    VISCOUS_NEGATIVE = 3
    COULOMB_POSITIVE = 4
    COULOMB_NEGATIVE = 5
    VELOCITY_THRESHOLD = 6


#: Their names as fields of Motors, and of MotorTorqueParameters.
_NAMES = {
    Term.TORQUE_CONSTANT: ("torque_constants", "ktau"),
    Term.BACK_EMF: ("back_emf_constants", "bemf"),
    Term.VISCOUS_POSITIVE: ("viscous_positive", "viscous_pos"),
    Term.VISCOUS_NEGATIVE: ("viscous_negative", "viscous_neg"),
    Term.COULOMB_POSITIVE: ("coulomb_positive", "coulomb_pos"),
    Term.COULOMB_NEGATIVE: ("coulomb_negative", "coulomb_neg"),
    Term.VELOCITY_THRESHOLD: ("velocity_thresholds", "velocity_thres"),
}
TERMS = {name: term for term, (name, _) in _NAMES.items()}
#: Fields of MotorTorqueParameters, and those of Motors that they are.
YARP_TERMS = {theirs: name for name, theirs in _NAMES.values()}


@dataclass(frozen=True, slots=True, eq=False)
class Motors:
    """Motors and amplifiers of joints, an array of shape (k,) each; prismatic joints: m, N.

    Attributes:
        gear_ratios: rad of the motor per rad of the joint.
        positions: of the motor's shaft, rad; NaN without an encoder there, as the next two.
        velocities: rad/s.
        accelerations: rad/s².
        currents: measured, A.
        nominal_currents: continuous currents, A.
        peak_currents: beyond which it is an overcurrent, A.
        max_currents: the largest that the board requests at present, A.
        outputs: PWM, percent.
        output_limits: the largest PWM now, percent.
        supply_voltages: V; NaN where it is not measured.
        temperatures: of the windings, °C; NaN without a sensor.
        temperature_limits: °C.
        torque_limits: of the joints, either way, N·m.
        torque_constants: of the motors as the laws use them, N·m/A, as all below.
        back_emf_constants: of the motors, V·s/rad.
        viscous_positive, viscous_negative: friction at the joints that the laws compensate, in
            positive and negative direction, N·m·s/rad.
        coulomb_positive, coulomb_negative: likewise dry friction, N·m.
        velocity_thresholds: speeds of the joints from which on that is whole, rad/s.
    """

    gear_ratios: Array
    positions: Array
    velocities: Array
    accelerations: Array
    currents: Array
    nominal_currents: Array
    peak_currents: Array
    max_currents: Array
    outputs: Array
    output_limits: Array
    supply_voltages: Array
    temperatures: Array
    temperature_limits: Array
    torque_limits: Array
    torque_constants: Array
    back_emf_constants: Array
    viscous_positive: Array
    viscous_negative: Array
    coulomb_positive: Array
    coulomb_negative: Array
    velocity_thresholds: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorTorqueParameters:
    """The motor constants of the laws, by YARP's names: one for all joints, or shape (k,).

    Attributes:
        ktau: torque constants of the motors, N·m/A.
        bemf: back-EMF constants of the motors, V·s/rad.
        viscous_pos, viscous_neg: friction at the joints by direction, N·m·s/rad.
        coulomb_pos, coulomb_neg: likewise dry friction, N·m.
        velocity_thres: speeds from which on that is whole, rad/s.
        ktau_scale, bemf_scale: 0: values are in these units.
    """

    ktau: Values | None = None
    bemf: Values | None = None
    viscous_pos: Values | None = None
    viscous_neg: Values | None = None
    coulomb_pos: Values | None = None
    coulomb_neg: Values | None = None
    velocity_thres: Values | None = None
    ktau_scale: float = 0.0
    bemf_scale: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Pids:
    """One loop of joints, an array of shape (k,) each.

    Attributes:
        references: in its unit: rad, rad/s, N·m, A.
        errors: reference less measured value, likewise.
        outputs: N·m; of the current loop PWM, percent.
        offsets: what is added to the output, u_ff, PWM percent.
    """

    references: Array
    errors: Array
    outputs: Array
    offsets: Array
