# SPDX-License-Identifier: Apache-2.0
"""What users read of a board: modes, faults, what is measured, references, settings (SPEC A, M11).

Each method returns one entry per joint in the order asked, arrays of shape (k,), and raises a
RequestError for a joint that does not exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ..protocols import Floats, Joints
from .calibration import CalibrationStatus
from .faults import FaultRecord
from .machine import Machine
from .selection import Selector
from .state import Indices
from .vocabs import CommandKind, ControlMode, InteractionMode

K = CommandKind
T = TypeVar("T")


class GetMethods:
    """Reads the joints of a board.

    Args:
        machine: whose joints are read.
        selector: of the same joints.
    """

    def __init__(self, machine: Machine, selector: Selector) -> None:
        self._machine, self._selector = machine, selector
        self._state, self._references = machine.state, machine.references
        self._laws = machine.controller.joints

    # --- modes and faults ---------------------------------------------------------------------

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """The modes that joints are in, also the statuses HW_FAULT, CALIBRATING, …"""
        return self._pick(joints, self._state.control_modes)

    def get_available_modes(
        self, joints: Joints = None
    ) -> list[tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]]:
        """What each joint implements: control modes, and interaction modes."""
        chosen = self._pick(joints, self._machine.config.joints)
        return [(joint.control_modes, joint.interaction_modes) for joint in chosen]

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """The interaction modes as stored, also where they do not act (I2)."""
        return self._pick(joints, self._state.interaction_modes)

    def get_faults(self, joints: Joints = None) -> list[FaultRecord]:
        """The last fault of each joint, active or not (F5)."""
        return self._pick(joints, self._state.faults)

    def get_calibration(self, joints: Joints = None) -> list[CalibrationStatus]:
        """How the last calibration of each joint stands, and whether it is calibrated (K7)."""
        return [self._machine.calibrations.status(j) for j in self._numbers(joints)]

    # --- what is measured ---------------------------------------------------------------------

    def get_encoder(self, joints: Joints = None) -> Floats:
        """Measured positions."""
        return self._state.position[self._chosen(joints)]

    def get_encoder_speed(self, joints: Joints = None) -> Floats:
        """Measured velocities."""
        return self._state.velocity[self._chosen(joints)]

    def get_torque(self, joints: Joints = None) -> Floats:
        """Measured torques; NaN without a torque sensor."""
        sensed = [joint.torque_sensor for joint in self._pick(joints, self._machine.config.joints)]
        return np.where(sensed, self._state.torque[self._chosen(joints)], np.nan)

    # --- references -----------------------------------------------------------------------------

    def get_target_position(self, joints: Joints = None) -> Floats:
        """The last accepted target of a position move (M11)."""
        return self._last(K.POSITION, joints)

    def get_ref_position(self, joints: Joints = None) -> Floats:
        """The last accepted direct position (M11)."""
        return self._last(K.POSITION_DIRECT, joints)

    def get_ref_velocity(self, joints: Joints = None) -> Floats:
        """The last accepted velocity (M11)."""
        return self._last(K.VELOCITY, joints)

    def get_ref_torque(self, joints: Joints = None) -> Floats:
        """The last accepted torque (M11)."""
        return self._last(K.TORQUE, joints)

    def get_output(self, joints: Joints = None) -> Floats:
        """The last accepted output (M11)."""
        return self._last(K.OUTPUT, joints)

    def check_motion_done(self, joints: Joints = None) -> list[bool]:
        """False from the cycle that accepts a move until its profile ends (P3)."""
        return [bool(self._state.done[j]) for j in self._numbers(joints)]

    def get_remaining_time(self, joints: Joints = None) -> Floats:
        """Time until the position moves end, s."""
        return self._references.remaining(self._chosen(joints))

    # --- settings -------------------------------------------------------------------------------

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Stiffness and damping, two arrays."""
        own = self._pick(joints, self._laws)
        return np.array([j.stiffness for j in own]), np.array([j.damping for j in own])

    def get_torque_offset(self, joints: Joints = None) -> Floats:
        """τ_ff of the impedance law: as a user set it, else the load on entering COMPLIANT."""
        own = self._pick(joints, self._laws)
        return np.array([j.torque_offset if j.offset_given else j.load_taken for j in own])

    def get_ref_speed(self, joints: Joints = None) -> Floats:
        """Mean speeds of position moves."""
        return self._references.speed[self._chosen(joints)]

    def get_ref_acceleration(self, joints: Joints = None) -> Floats:
        """Accelerations of velocity references."""
        return self._references.acceleration[self._chosen(joints)]

    # --- helpers --------------------------------------------------------------------------------

    def _chosen(self, joints: Joints) -> Indices:
        return self._selector.select(joints).joints

    def _numbers(self, joints: Joints) -> list[int]:
        numbers: list[int] = self._chosen(joints).tolist()
        return numbers

    def _pick(self, joints: Joints, values: Sequence[T]) -> list[T]:
        return [values[j] for j in self._numbers(joints)]

    def _last(self, kind: CommandKind, joints: Joints) -> Floats:
        values: Floats = self._references.last[kind, self._chosen(joints)]
        return values
