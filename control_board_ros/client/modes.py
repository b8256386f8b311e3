# SPDX-License-Identifier: Apache-2.0
"""Control modes, interaction modes and impedance, over the services."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from control_board_msgs.srv import (
    GetAvailableModes,
    GetControlMode,
    GetImpedance,
    GetInteractionMode,
    SetControlMode,
    SetImpedance,
    SetInteractionMode,
)

from control_board_ros.core.reply import Answer, Reply, refused
from control_board_ros.core.selection import RequestError, Selection, spread
from control_board_ros.core.vocabs import (
    ControlMode,
    InteractionMode,
    Vocab,
    parse_control_mode,
    parse_interaction_mode,
)
from control_board_ros.interfaces import Floats, Interaction, Joints, Mode, Values

from .base import ClientBase, reply_of
from .waiting import Steps, operation

Available = tuple[tuple[ControlMode, ...], tuple[InteractionMode, ...]]


class ModeOperations(ClientBase):
    """IControlMode2, IInteractionMode and IImpedanceControl."""

    @operation
    def set_control_mode(self, joints: Joints, modes: Mode | Sequence[Mode]) -> Steps[Reply]:
        """Ask for control modes: enumeration, code, name or vocab (M1, M5 to M8, F2, F4)."""
        try:
            selection = yield from self._select(joints)
            texts = mode_texts(modes, parse_control_mode)
        except ValueError as error:
            return refused(str(error))
        response = yield from self._request(
            SetControlMode, "set_control_mode", selection, modes=texts
        )
        self._changed()
        self._view.on_answer(response.names, response.modes)
        return reply_of(response, selection)

    @operation
    def get_control_mode(self, joints: Joints = None) -> Steps[list[ControlMode]]:
        """The modes that joints are in, also the statuses HW_FAULT, CALIBRATING, …"""
        response = yield from self._control_modes((yield from self._select(joints)))
        return [ControlMode(vocab) for vocab in response.vocabs]

    def _control_modes(self, selection: Selection) -> Steps[Any]:
        """Ask for control modes, and remember them."""
        response = yield from self._request(GetControlMode, "get_control_mode", selection)
        if not response.success:
            raise RequestError(response.message)
        self._view.on_answer(response.names, response.modes)
        return response

    @operation
    def set_interaction_mode(
        self, joints: Joints, modes: Interaction | Sequence[Interaction]
    ) -> Steps[Reply]:
        """Ask for interaction modes; in an active mode a change stops the joint (I1 to I7)."""
        try:
            selection = yield from self._select(joints)
            texts = mode_texts(modes, parse_interaction_mode)
        except ValueError as error:
            return refused(str(error))
        response = yield from self._request(
            SetInteractionMode, "set_interaction_mode", selection, modes=texts
        )
        self._changed()
        if Answer.UNSUPPORTED in response.answers:  # these are in HW_FAULT now (I7)
            self._view.doubt()
        return reply_of(response, selection)

    @operation
    def get_interaction_mode(self, joints: Joints = None) -> Steps[list[InteractionMode]]:
        """The interaction modes as stored, also where they do not act (I2)."""
        response = yield from self._get(GetInteractionMode, "get_interaction_mode", joints)
        return [InteractionMode(vocab) for vocab in response.vocabs]

    @operation
    def get_available_modes(self, joints: Joints = None) -> Steps[list[Available]]:
        """What each joint implements: control modes, and interaction modes."""
        available = yield from self._available(joints)
        return available

    def _available(self, joints: Joints) -> Steps[list[Available]]:
        response = yield from self._get(GetAvailableModes, "get_available_modes", joints)
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
    def set_impedance(
        self, joints: Joints, stiffness: Values | None = None, damping: Values | None = None
    ) -> Steps[Reply]:
        """Set spring and damper, at any time; they act in the next cycle (I6).

        Without ``damping`` the board chooses one that fits the stiffness; without ``stiffness``
        this one stays as it is.
        """
        if stiffness is None and damping is None:
            return refused("neither stiffness nor damping given; send one of them, or both")
        try:
            selection = yield from self._select(joints)
            if stiffness is None:
                present = yield from self._get(GetImpedance, "get_impedance", joints)
                stiffness = present.stiffness
            count = len(selection.names)
            fields = {
                "stiffness": for_each(stiffness, count, "stiffness"),
                "damping": [] if damping is None else for_each(damping, count, "damping"),
            }
        except RequestError as error:
            return refused(str(error))
        reply = yield from self._change(SetImpedance, "set_impedance", selection, **fields)
        return reply

    @operation
    def get_impedance(self, joints: Joints = None) -> Steps[tuple[Floats, Floats]]:
        """Stiffness and damping, two arrays."""
        response = yield from self._get(GetImpedance, "get_impedance", joints)
        return np.array(response.stiffness), np.array(response.damping)

    @operation
    def get_max_impedance(self, joints: Joints = None) -> Steps[tuple[Floats, Floats]]:
        """The largest stiffness and damping that a joint takes, two arrays."""
        response = yield from self._get(GetImpedance, "get_impedance", joints)
        return np.array(response.max_stiffness), np.array(response.max_damping)

    @operation
    def get_torque_offset(self, joints: Joints = None) -> Steps[Floats]:
        """τ_ff of the impedance law: as a user set it, else the load on entering COMPLIANT."""
        response = yield from self._get(GetImpedance, "get_impedance", joints)
        return np.array(response.torque_offset)


def for_each(values: Values, count: int, what: str) -> list[float]:
    """A value for each joint; one value, alone or in a list, goes to all.

    Raises:
        RequestError: the length fits neither, or the values are no numbers.
    """
    alone = values[0] if isinstance(values, Sequence | np.ndarray) and len(values) == 1 else values
    spread_out: list[float] = spread(alone, count, what).tolist()
    return spread_out


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
