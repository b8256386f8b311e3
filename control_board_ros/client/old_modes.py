# SPDX-License-Identifier: Apache-2.0
"""The mode shortcuts of SPEC A and the old interface (SPEC D), on top of ModeRequests."""

from __future__ import annotations

import warnings
from collections.abc import Callable

from control_board_ros.core.reply import Reply
from control_board_ros.core.vocabs import ControlMode, InteractionMode
from control_board_ros.protocols import OLD_NAMES, Joints, deprecation, replacement

from .modes import ModeRequests
from .waiting import Steps

#: Frames from the warning to the line that called: _deprecated, _old, its caller, the method.
CALLER = 5


class OldModes:
    """One method per mode; those that the old IControlMode had raise a DeprecationWarning (D1).

    Args:
        modes: what they are made of.
        log: where the text goes besides the warning.
    """

    def __init__(self, modes: ModeRequests, log: Callable[[str], None]) -> None:
        self._modes, self._log = modes, log

    def set_position_direct_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set POSITION_DIRECT."""
        return self._modes.set_control_mode(joints, ControlMode.POSITION_DIRECT)

    def set_position_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set POSITION; deprecated (D1)."""
        return self._old(joints, ControlMode.POSITION)

    def set_velocity_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set VELOCITY; deprecated (D1)."""
        return self._old(joints, ControlMode.VELOCITY)

    def set_torque_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set TORQUE; deprecated (D1)."""
        return self._old(joints, ControlMode.TORQUE)

    def set_open_loop_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set OPENLOOP; deprecated (D1)."""
        return self._old(joints, ControlMode.OPENLOOP)

    def set_impedance_position_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set POSITION with COMPLIANT (I9); deprecated (D1)."""
        return self._old(joints, ControlMode.POSITION, InteractionMode.COMPLIANT)

    def set_impedance_velocity_mode(self, joints: Joints = None) -> Steps[Reply]:
        """Set VELOCITY with COMPLIANT (I9); deprecated (D1)."""
        return self._old(joints, ControlMode.VELOCITY, InteractionMode.COMPLIANT)

    def get_control_modes(self) -> Steps[list[ControlMode]]:
        """The control modes of all joints; deprecated (D1)."""
        self._deprecated("get_control_modes", "get_control_mode()", CALLER - 1)
        return self._modes.get_control_mode(None)

    def _old(
        self, joints: Joints, mode: ControlMode, interaction: InteractionMode | None = None
    ) -> Steps[Reply]:
        self._deprecated(OLD_NAMES[mode, interaction], replacement(mode, interaction), CALLER)
        return self._set(joints, mode, interaction)

    def _set(
        self, joints: Joints, mode: ControlMode, interaction: InteractionMode | None
    ) -> Steps[Reply]:
        reply = yield from self._modes.set_control_mode(joints, mode)
        if reply and interaction is not None:
            reply = yield from self._modes.set_interaction_mode(joints, interaction)
        return reply

    def _deprecated(self, old: str, new: str, caller: int) -> None:
        text = deprecation(old, new)
        warnings.warn(text, DeprecationWarning, stacklevel=caller)
        self._log(text)
