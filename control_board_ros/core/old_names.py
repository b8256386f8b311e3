# SPDX-License-Identifier: Apache-2.0
"""The mode shortcuts of source §4, and the old interface of §5, which warns (SPEC D)."""

from __future__ import annotations

import warnings
from typing import Any

from .terms.arguments import Joints
from .terms.reply import Reply
from .terms.vocabs import ControlMode, InteractionMode


class ModeShortcuts:
    """The mode shortcuts of §4 and the old interface of §5, on top of the two setters.

    The class that inherits offers ``set_control_mode``, ``set_interaction_mode`` and
    ``get_control_mode``. The methods that the old IControlMode had (D1) raise a
    DeprecationWarning, those of IPositionControl, IVelocityControl, ITorqueControl and
    IOpenLoopControl of the same name included.
    """

    set_control_mode: Any
    set_interaction_mode: Any
    get_control_mode: Any

    def set_position_direct_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION_DIRECT; not deprecated (D1)."""
        reply: Reply = self.set_control_mode(joints, ControlMode.POSITION_DIRECT)
        return reply

    def set_position_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION; deprecated (D1)."""
        return self._old(joints, ControlMode.POSITION)

    def set_velocity_mode(self, joints: Joints = None) -> Reply:
        """Set VELOCITY; deprecated (D1)."""
        return self._old(joints, ControlMode.VELOCITY)

    def set_torque_mode(self, joints: Joints = None) -> Reply:
        """Set TORQUE; deprecated (D1)."""
        return self._old(joints, ControlMode.TORQUE)

    def set_open_loop_mode(self, joints: Joints = None) -> Reply:
        """Set OPENLOOP; deprecated (D1)."""
        return self._old(joints, ControlMode.OPENLOOP)

    def set_impedance_position_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION with COMPLIANT (I9); deprecated (D1)."""
        return self._old(joints, ControlMode.POSITION, InteractionMode.COMPLIANT)

    def set_impedance_velocity_mode(self, joints: Joints = None) -> Reply:
        """Set VELOCITY with COMPLIANT (I9); deprecated (D1)."""
        return self._old(joints, ControlMode.VELOCITY, InteractionMode.COMPLIANT)

    def get_control_modes(self) -> list[ControlMode]:
        """The control modes of all joints; deprecated (D1)."""
        self._deprecate("get_control_modes", "get_control_mode()")
        modes: list[ControlMode] = self.get_control_mode(None)
        return modes

    def _old(
        self, joints: Joints, mode: ControlMode, interaction: InteractionMode | None = None
    ) -> Reply:
        self._deprecate(OLD_NAMES[mode, interaction], replacement(mode, interaction))
        reply: Reply = self.set_control_mode(joints, mode)
        if reply and interaction is not None:
            reply = self.set_interaction_mode(joints, interaction)
        return reply

    def _deprecate(self, old: str, new: str) -> None:
        warnings.warn(deprecation(old, new), DeprecationWarning, stacklevel=4)


OLD_NAMES: dict[tuple[ControlMode, InteractionMode | None], str] = {
    (ControlMode.POSITION, None): "set_position_mode",
    (ControlMode.VELOCITY, None): "set_velocity_mode",
    (ControlMode.TORQUE, None): "set_torque_mode",
    (ControlMode.OPENLOOP, None): "set_open_loop_mode",
    (ControlMode.POSITION, InteractionMode.COMPLIANT): "set_impedance_position_mode",
    (ControlMode.VELOCITY, InteractionMode.COMPLIANT): "set_impedance_velocity_mode",
}


def replacement(mode: ControlMode, interaction: InteractionMode | None) -> str:
    """The replacement of the old method of a mode."""
    new = f"set_control_mode(joints, ControlMode.{mode.name})"
    if interaction is not None:
        new += f" and set_interaction_mode(joints, InteractionMode.{interaction.name})"
    return new


def deprecation(old: str, new: str) -> str:
    """The warning of an old method (D1)."""
    return f"{old} belongs to the old interface and is deprecated; use {new}"
