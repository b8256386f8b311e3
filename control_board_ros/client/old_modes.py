# SPDX-License-Identifier: Apache-2.0
"""The mode shortcuts of SPEC A and the old interface (SPEC D), on top of the new ones."""

from __future__ import annotations

import warnings

from control_board_ros.core.old_names import OLD_NAMES, deprecation, replacement
from control_board_ros.core.terms.reply import Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode
from control_board_ros.protocols import Joints

from .modes import ModeRequests
from .operations import operation

#: Stack frames from the warning to the caller: _deprecated, _old, its caller, the driver
#: (run, run_async), the form (blocking, awaitable).
CALLER = 6


class OldModes(ModeRequests):
    """One method per mode; those that the old IControlMode had raise a DeprecationWarning (D1)."""

    @operation
    async def set_position_direct_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION_DIRECT."""
        return await self.set_control_mode(joints, ControlMode.POSITION_DIRECT)

    @operation
    async def set_position_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION; deprecated (D1)."""
        return await self._old(joints, ControlMode.POSITION)

    @operation
    async def set_velocity_mode(self, joints: Joints = None) -> Reply:
        """Set VELOCITY; deprecated (D1)."""
        return await self._old(joints, ControlMode.VELOCITY)

    @operation
    async def set_torque_mode(self, joints: Joints = None) -> Reply:
        """Set TORQUE; deprecated (D1)."""
        return await self._old(joints, ControlMode.TORQUE)

    @operation
    async def set_open_loop_mode(self, joints: Joints = None) -> Reply:
        """Set OPENLOOP; deprecated (D1)."""
        return await self._old(joints, ControlMode.OPENLOOP)

    @operation
    async def set_impedance_position_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION with COMPLIANT (I9); deprecated (D1)."""
        return await self._old(joints, ControlMode.POSITION, InteractionMode.COMPLIANT)

    @operation
    async def set_impedance_velocity_mode(self, joints: Joints = None) -> Reply:
        """Set VELOCITY with COMPLIANT (I9); deprecated (D1)."""
        return await self._old(joints, ControlMode.VELOCITY, InteractionMode.COMPLIANT)

    @operation
    async def get_control_modes(self) -> list[ControlMode]:
        """The control modes of all joints; deprecated (D1)."""
        self._deprecated("get_control_modes", "get_control_mode()", CALLER - 1)
        return await self.get_control_mode()

    async def _old(
        self, joints: Joints, mode: ControlMode, interaction: InteractionMode | None = None
    ) -> Reply:
        self._deprecated(OLD_NAMES[mode, interaction], replacement(mode, interaction), CALLER)
        reply = await self.set_control_mode(joints, mode)
        if reply and interaction is not None:
            reply = await self.set_interaction_mode(joints, interaction)
        return reply

    def _deprecated(self, old: str, new: str, caller: int) -> None:
        text = deprecation(old, new)
        warnings.warn(text, DeprecationWarning, stacklevel=caller)
        self.log_deprecated(text)

    def log_deprecated(self, text: str) -> None:
        """Warn in the log of the user's node (D1)."""
        self._link.user.get_logger().warning(text)
