# SPDX-License-Identifier: Apache-2.0
"""The interfaces of SPEC A and D, in snake_case, as Protocols.

The in-process board (``control_board_ros.core.board.Board``) and the ROS client
(``control_board_ros.client.ControlBoardClient``) both offer all of them. In every method
``joints`` comes first: an index, a name, a sequence of them, or None for all; a single value
goes to every chosen joint. Set methods return a Reply, true when all was accepted; get methods
return one entry per joint in the order requested. Units: rad, rad/s, rad/s², N·m, N·m/rad,
N·m·s/rad, percent of PWM; m and N for prismatic joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from .core.terms import arguments, vocabs
from .core.terms.reply import MotionDone, Reply
from .core.terms.vocabs import ControlMode, InteractionMode

Joints = arguments.Joints
Mode = vocabs.Mode
Interaction = vocabs.Interaction
Values = arguments.Values
Flags = arguments.Flags
Floats = arguments.Array


@runtime_checkable
class IControlMode2(Protocol):
    """Set and get control modes."""

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply: ...

    def get_control_mode(self, joints: Joints = None) -> list[ControlMode]: ...


@runtime_checkable
class IInteractionMode(Protocol):
    """Set and get interaction modes."""

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply: ...

    def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]: ...


@runtime_checkable
class IImpedanceControl(Protocol):
    """Stiffness and damping of the compliant interaction mode (I6)."""

    def set_impedance(
        self, joints: Joints, stiffness: Values, damping: Values | None = None
    ) -> Reply: ...

    def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]: ...


@runtime_checkable
class IPositionControl(Protocol):
    """Position moves along a minimum-jerk trajectory (P1 to P3)."""

    def position_move(
        self, joints: Joints, positions: Values, speeds: Values | None = None
    ) -> Reply: ...

    def set_ref_speed(self, joints: Joints, speeds: Values) -> Reply: ...

    def set_ref_acceleration(self, joints: Joints, accelerations: Values) -> Reply: ...

    def get_ref_speed(self, joints: Joints = None) -> Floats: ...

    def get_ref_acceleration(self, joints: Joints = None) -> Floats: ...

    def get_target_position(self, joints: Joints = None) -> Floats: ...

    def check_motion_done(self, joints: Joints = None) -> MotionDone: ...

    def stop(self, joints: Joints = None) -> Reply: ...

    def set_position_mode(self, joints: Joints = None) -> Reply: ...


@runtime_checkable
class IPositionDirect(Protocol):
    """Position steps (P4)."""

    def set_position(self, joints: Joints, positions: Values) -> Reply: ...

    def get_ref_position(self, joints: Joints = None) -> Floats: ...

    def set_position_direct_mode(self, joints: Joints = None) -> Reply: ...


@runtime_checkable
class ITorqueControl(Protocol):
    """Joint torques (P7)."""

    def set_ref_torque(self, joints: Joints, torques: Values) -> Reply: ...

    def get_ref_torque(self, joints: Joints = None) -> Floats: ...

    def get_torque(self, joints: Joints = None) -> Floats: ...

    def set_torque_mode(self, joints: Joints = None) -> Reply: ...


@runtime_checkable
class IVelocityControl(Protocol):
    """Joint velocities (P5)."""

    def velocity_move(
        self, joints: Joints, velocities: Values, accelerations: Values | None = None
    ) -> Reply: ...

    def get_ref_velocity(self, joints: Joints = None) -> Floats: ...

    def get_target_velocity(self, joints: Joints = None) -> Floats: ...

    def set_velocity_mode(self, joints: Joints = None) -> Reply: ...


@runtime_checkable
class IVelocityDirect(Protocol):
    """Joint velocities without a ramp (Y1)."""

    def set_ref_velocity(self, joints: Joints, velocities: Values) -> Reply: ...

    def get_ref_velocity(self, joints: Joints = None) -> Floats: ...


@runtime_checkable
class ICurrentControl(Protocol):
    """Motor currents (Y2), A."""

    def set_ref_current(self, joints: Joints, currents: Values) -> Reply: ...

    def get_ref_current(self, joints: Joints = None) -> Floats: ...

    def get_current(self, joints: Joints = None) -> Floats: ...

    def get_current_range(self, joints: Joints = None) -> tuple[Floats, Floats]: ...


@runtime_checkable
class IOpenLoopControl(Protocol):
    """PWM in percent (P8)."""

    def set_output(self, joints: Joints, outputs: Values) -> Reply: ...

    def get_output(self, joints: Joints = None) -> Floats: ...

    def set_open_loop_mode(self, joints: Joints = None) -> Reply: ...


@runtime_checkable
class IJointBrake(Protocol):
    """Brakes (Y4)."""

    def is_joint_braked(self, joints: Joints = None) -> list[bool]: ...

    def set_manual_brake_active(self, joints: Joints, active: Flags) -> Reply: ...

    def set_auto_brake_enabled(self, joints: Joints, enabled: Flags) -> Reply: ...

    def get_auto_brake_enabled(self, joints: Joints = None) -> list[bool]: ...


@runtime_checkable
class IEncoders(Protocol):
    """Measured positions and velocities."""

    def get_encoder(self, joints: Joints = None) -> Floats: ...

    def get_encoder_speed(self, joints: Joints = None) -> Floats: ...


@runtime_checkable
class IControlMode(Protocol):
    """The old interface (D1): deprecated, mapped as I9."""

    def set_impedance_position_mode(self, joints: Joints = None) -> Reply: ...

    def set_impedance_velocity_mode(self, joints: Joints = None) -> Reply: ...

    def get_control_modes(self) -> list[ControlMode]: ...
