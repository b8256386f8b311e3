# SPDX-License-Identifier: Apache-2.0
"""Control modes, interaction modes and impedance, and the old interface (SPEC M, I, D)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from control_board_ros.core.old_names import OLD_NAMES, deprecation, replacement
from control_board_ros.core.selection import listed, requested_control_mode
from control_board_ros.core.terms.drives import LAW_FIELDS, DriveReport, DriveUse
from control_board_ros.core.terms.reply import Reply, refused
from control_board_ros.core.terms.vocabs import (
    ControlMode,
    InteractionMode,
    Vocab,
    parse_control_mode,
    parse_interaction_mode,
)
from control_board_ros.interface import (
    GET_AVAILABLE_MODES,
    GET_CONTROL_MODE,
    GET_DRIVES,
    GET_IMPEDANCE,
    GET_INTERACTION_MODE,
    SET_CONTROL_MODE,
    SET_IMPEDANCE,
    SET_INTERACTION_MODE,
    Endpoint,
)
from control_board_ros.protocols import Floats, Interaction, Joints, Mode, Values

from .operations import Interface, operation, request
from .services import arrays

Available = tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]

#: Stack frames from the warning to the caller: _deprecated, _old, its caller, the driver
#: (run, run_async), the form (blocking, awaitable).
CALLER = 6


@dataclass(frozen=True, slots=True, eq=False)
class ImpedanceSettings:
    """The impedance of joints, an array of shape (k,) each; N/m, N·s/m and N where a joint slides.

    Attributes:
        stiffness: N·m/rad.
        damping: N·m·s/rad.
        torque_offset: τ_ff of the impedance law, N·m: as set, or the captured load.
        max_stiffness: the largest permitted, N·m/rad.
        max_damping: likewise, N·m·s/rad.
    """

    stiffness: Floats
    damping: Floats
    torque_offset: Floats
    max_stiffness: Floats
    max_damping: Floats


class ModeRequests(Interface):
    """IControlMode2, IInteractionMode, IImpedanceControl, and the old IControlMode."""

    @operation
    async def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Reply:
        """Set control modes (M1, M5 to M8, F2, F4).

        Args:
            joints: target joints.
            modes: enumeration, code (``"pos"``), name (``"POSITION"``) or vocab; one for all
                joints, or one each.

        Returns:
            The board's answer and reason for each joint, and the modes after the call.
        """
        return await self._set(SET_CONTROL_MODE, joints, modes, requested_control_mode)

    @operation
    async def get_control_mode(self, joints: Joints = None) -> list[ControlMode]:
        """Current modes, including the statuses HW_FAULT, CALIBRATING, …"""
        response = await self._services.read(GET_CONTROL_MODE, joints)
        return [parse_control_mode(vocab) for vocab in response.vocabs]

    @operation
    async def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Reply:
        """Set interaction modes; in an active mode a change stops the joint (I1 to I7).

        Args:
            joints: target joints.
            modes: enumeration, code (``"stif"``), name (``"STIFF"``) or vocab; one for all
                joints, or one each.

        Returns:
            The board's answer and reason for each joint, and the modes after the call.
        """
        return await self._set(SET_INTERACTION_MODE, joints, modes, parse_interaction_mode)

    async def _set(
        self, service: Endpoint, joints: Joints, modes: Any, parse: Callable[[str], Vocab]
    ) -> Reply:
        try:
            names = (await self._services.select(joints)).names
            texts = mode_texts(modes, parse)
        except ValueError as error:
            return self._services.refuse(joints, error)
        reply, response = await self._services.ask(service, names, modes=texts)
        return reply.with_modes([parse(code) for code in response.modes])

    @operation
    async def get_interaction_mode(self, joints: Joints = None) -> list[InteractionMode]:
        """The interaction modes as stored, also where inactive (I2)."""
        response = await self._services.read(GET_INTERACTION_MODE, joints)
        return [InteractionMode(vocab) for vocab in response.vocabs]

    @operation
    async def get_available_modes(self, joints: Joints = None) -> list[Available]:
        """Control modes and interaction modes that each joint implements."""
        response = await self._services.read(GET_AVAILABLE_MODES, joints)
        return [
            (
                tuple(parse_control_mode(code) for code in control.split(",") if code),
                tuple(parse_interaction_mode(code) for code in interaction.split(",") if code),
            )
            for control, interaction in zip(
                response.control_modes, response.interaction_modes, strict=True
            )
        ]

    @operation
    async def get_drives(self, joints: Joints = None) -> list[DriveUse]:
        """Set-points that the drives accept, which loop runs where (S1), and what they report."""
        response = await self._services.read(GET_DRIVES, joints)
        return [
            DriveUse(
                set_points=tuple(response.set_points[k].split(",")),
                **{law: getattr(response, law)[k] or None for law in LAW_FIELDS},
                on_silence=response.on_silence[k],
                reported=DriveReport(
                    zero=response.zero[k] or None,
                    power={"on": True, "off": False}.get(response.power[k]),
                    law=response.law[k] or None,
                    lost=None if response.lost[k] < 0 else response.lost[k],
                    late=None if response.late[k] < 0 else response.late[k],
                ),
            )
            for k in range(len(response.names))
        ]

    # --- impedance of the compliant interaction mode (I6) ----------------------------------------

    @request
    async def set_impedance(
        self, joints: Joints, stiffness: Values | None = None, damping: Values | None = None
    ) -> Reply:
        """Set stiffness and damping at any time; effective in the next cycle (I6).

        Args:
            joints: target joints.
            stiffness: N·m/rad (N/m), one for all joints or one each; None: unchanged.
            damping: N·m·s/rad (N·s/m), likewise; None: the board's choice for the stiffness.
        """
        if stiffness is None and damping is None:
            return refused("neither stiffness nor damping given; send one of them, or both")
        if stiffness is None:
            stiffness = (await self.get_impedance_settings(joints)).stiffness
        values = {"stiffness": stiffness, "damping": damping}
        return await self._services.change(SET_IMPEDANCE, joints, values)

    @operation
    async def get_impedance_settings(self, joints: Joints = None) -> ImpedanceSettings:
        """Stiffness, damping, τ_ff and limits, in one request."""
        response = await self._services.read(GET_IMPEDANCE, joints)
        return ImpedanceSettings(**arrays(response, ImpedanceSettings))

    @operation
    async def get_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """Stiffness and damping, N·m/rad and N·m·s/rad, two arrays of shape (k,)."""
        settings = await self.get_impedance_settings(joints)
        return settings.stiffness, settings.damping

    @operation
    async def get_max_impedance(self, joints: Joints = None) -> tuple[Floats, Floats]:
        """The largest permitted stiffness and damping, two arrays of shape (k,)."""
        settings = await self.get_impedance_settings(joints)
        return settings.max_stiffness, settings.max_damping

    get_torque_offset = get_impedance_settings.field(
        "torque_offset",
        "τ_ff of the impedance law, N·m, shape (k,): as set, or the captured load.",
    )

    # --- one method per mode; those of the old IControlMode are deprecated (D1) ------------------

    @operation
    async def set_position_direct_mode(self, joints: Joints = None) -> Reply:
        """Set POSITION_DIRECT; not deprecated (D1)."""
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
        self._link.log_warning(text)


def mode_texts(modes: Any, parse: Callable[[Any], Vocab]) -> list[str]:
    """The modes of a request as sent; the board interprets them.

    Raises:
        ValueError: a number that is no vocab.
    """
    return [
        mode.encode(errors="replace").decode() if isinstance(mode, str) else parse(mode).code
        for mode in listed(modes)
    ]
