# SPDX-License-Identifier: Apache-2.0
"""Control modes and interaction modes, over the services (SPEC M, I)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from control_board_ros.core.terms.drives import DriveUse
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
    GET_INTERACTION_MODE,
    SET_CONTROL_MODE,
    SET_INTERACTION_MODE,
    Endpoint,
)
from control_board_ros.protocols import Interaction, Joints, Mode

from .operations import Interface, operation
from .services import reply_of

Available = tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]


class ModeRequests(Interface):
    """IControlMode2 and IInteractionMode."""

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
        return await self._set(SET_CONTROL_MODE, joints, modes, parse_control_mode)

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
        services = self._services
        try:
            selection = await services.select(joints)
            texts = mode_texts(modes, parse)
        except ValueError as error:
            return refused(str(error))
        response = await self._link.call(service, names=list(selection.names), modes=texts)
        services.states.changed()
        now = tuple(parse(code) for code in response.modes)
        return replace(reply_of(response, selection), modes=now)

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
        """Which set-points the drives accept, and which loop runs where (S1)."""
        found = await self._services.read(GET_DRIVES, joints)
        return [
            DriveUse(
                set_points=tuple(found.set_points[k].split(",")),
                position=found.position[k] or None,
                impedance=found.impedance[k] or None,
                torque=found.torque[k] or None,
                current=found.current[k] or None,
                output=found.output[k] or None,
                on_silence=found.on_silence[k],
            )
            for k in range(len(found.names))
        ]


def mode_texts(modes: Any, parse: Callable[[Any], Vocab]) -> list[str]:
    """The modes of a request as sent; the board interprets them.

    Raises:
        ValueError: a number that is no vocab.
    """
    given = [modes] if isinstance(modes, str | int) else list(modes)
    return [
        mode.encode(errors="replace").decode() if isinstance(mode, str) else parse(mode).code
        for mode in given
    ]
