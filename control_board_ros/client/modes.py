# SPDX-License-Identifier: Apache-2.0
"""Control modes and interaction modes, over the services (SPEC M, I)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from control_board_ros.core.reply import Answer, Reply, refused
from control_board_ros.core.selection import RequestError, Selection
from control_board_ros.core.vocabs import (
    ControlMode,
    InteractionMode,
    Vocab,
    parse_control_mode,
    parse_interaction_mode,
)
from control_board_ros.interface import (
    GET_AVAILABLE_MODES,
    GET_CONTROL_MODE,
    GET_INTERACTION_MODE,
    SET_CONTROL_MODE,
    SET_INTERACTION_MODE,
)
from control_board_ros.protocols import Interaction, Joints, Mode

from .services import Services, reply_of
from .waiting import Steps

Available = tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]


class ModeRequests:
    """IControlMode2 and IInteractionMode."""

    def __init__(self, services: Services) -> None:
        self._services, self._view = services, services.modes

    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Steps[Reply]:
        """Ask for control modes (M1, M5 to M8, F2, F4).

        Args:
            joints: whose modes they are.
            modes: enumeration, code (``"pos"``), name (``"POSITION"``) or vocab; one for all
                joints, or one each.

        Returns:
            The board's answer and reason for each joint.
        """
        services = self._services
        try:
            selection = yield from services.select(joints)
            texts = mode_texts(modes, parse_control_mode)
        except ValueError as error:
            return refused(str(error))
        response = yield from services.call(SET_CONTROL_MODE, selection, modes=texts)
        services.states.changed()
        self._view.on_answer(response.names, response.modes)
        return reply_of(response, selection)

    def get_control_mode(self, joints: Joints = None) -> Steps[list[ControlMode]]:
        """The modes that joints are in, also the statuses HW_FAULT, CALIBRATING, …"""
        response = yield from self.ask((yield from self._services.select(joints)))
        return [ControlMode(vocab) for vocab in response.vocabs]

    def ask(self, selection: Selection) -> Steps[Any]:
        """Ask for control modes, and remember them; the response."""
        response = yield from self._services.call(GET_CONTROL_MODE, selection)
        if not response.success:
            raise RequestError(response.message)
        self._view.on_answer(response.names, response.modes)
        return response

    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Steps[Reply]:
        """Ask for interaction modes; in an active mode a change stops the joint (I1 to I7).

        Args:
            joints: whose modes they are.
            modes: enumeration, code (``"stif"``), name (``"STIFF"``) or vocab; one for all
                joints, or one each.

        Returns:
            The board's answer and reason for each joint.
        """
        services = self._services
        try:
            selection = yield from services.select(joints)
            texts = mode_texts(modes, parse_interaction_mode)
        except ValueError as error:
            return refused(str(error))
        reply = yield from services.change(SET_INTERACTION_MODE, selection, modes=texts)
        if Answer.UNSUPPORTED in reply.answers:  # the response has no control modes
            self._view.doubt()
        return reply

    def get_interaction_mode(self, joints: Joints = None) -> Steps[list[InteractionMode]]:
        """The interaction modes as stored, also where they do not act (I2)."""
        response = yield from self._services.read(GET_INTERACTION_MODE, joints)
        return [InteractionMode(vocab) for vocab in response.vocabs]

    def get_available_modes(self, joints: Joints = None) -> Steps[list[Available]]:
        """What each joint implements: control modes, and interaction modes."""
        response = yield from self._services.read(GET_AVAILABLE_MODES, joints)
        return [
            (
                tuple(parse_control_mode(code) for code in control.split(",") if code),
                tuple(parse_interaction_mode(code) for code in interaction.split(",") if code),
            )
            for control, interaction in zip(
                response.control_modes, response.interaction_modes, strict=True
            )
        ]


def mode_texts(modes: Any, parse: Callable[[Any], Vocab]) -> list[str]:
    """The modes of a request as the wire has them; what they mean is the board's to say.

    Raises:
        ValueError: a number that is no vocab.
    """
    given = [modes] if isinstance(modes, str | int) else list(modes)
    return [
        mode.encode(errors="replace").decode() if isinstance(mode, str) else parse(mode).code
        for mode in given
    ]
