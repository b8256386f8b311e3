# SPDX-License-Identifier: Apache-2.0
"""Boards that break a rule of the interfaces (A, D), or the form of their messages."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

from breaking import around, breaks, replaces

from control_board_ros import interface
from control_board_ros.core.terms.vocabs import CommandKind, ControlMode

M, K = ControlMode, CommandKind


@breaks("A")
def diagnostics_elsewhere() -> None:
    interface.DIAGNOSTICS = dataclasses.replace(interface.DIAGNOSTICS, name="/diagnosis")


@replaces("D2", "core.machine.commands:Commands.command")
def a_velocity_switches(
    old: Any, self: Any, kind: CommandKind, selection: Any, *args: Any, **more: Any
) -> Any:
    reply = old(self, kind, selection, *args, **more)
    if kind is K.VELOCITY:
        for j in selection.numbers:
            if self._state.control_modes[j] is M.POSITION:
                self._machine.enter([j], M.VELOCITY)
    return reply


@breaks("A")
def answers_in_the_boards_order() -> None:
    def joints(old: Any, board: Any, request: Any) -> Any:
        chosen = old(board, request)
        return [name for name in board.names if name in chosen]

    around("operations:requested", joints)
    for name in ("get_control_mode", "get_interaction_mode"):
        around(f"node.wiring.services:Services.{name}", in_order)


def in_order(old: Any, self: Any, request: Any, response: Any) -> Any:
    """What a service answers on joints, sorted by name as the board has them."""
    request.names = sorted(request.names)
    return old(self, request, response)


@replaces("A", "node.wiring.services:Services.set_control_mode")
def refusals_in_the_boards_order(old: Any, self: Any, request: Any, response: Any) -> Any:
    old(self, request, response)
    if list(request.names) != sorted(request.names) and len(set(request.modes)) == 1:
        response.answers = list(response.answers)[::-1]
        response.reasons = list(response.reasons)[::-1]
    return response


@breaks("A")
def a_state_with_fields_of_length_one() -> None:
    from control_board_ros.node.wiring import publishing

    made = publishing.prepared_state

    def shortened(*given: Any) -> Any:
        state = made(*given)
        whole, state.fallback = state._message, "wrong"

        def short(snapshot: Any, nanoseconds: int) -> Any:
            message = whole(snapshot, nanoseconds)
            if hasattr(message, "torque"):
                message.torque = message.torque[:1]
            return message

        state._message = short
        return state

    publishing.prepared_state = shortened


@replaces("D2", "core.machine.commands:Commands.command")
def a_position_switches(
    old: Any, self: Any, kind: CommandKind, selection: Any, *args: Any, **more: Any
) -> Any:
    reply = old(self, kind, selection, *args, **more)
    if kind is K.POSITION and len(selection.names) == 1:
        for j in selection.numbers:
            if self._state.control_modes[j] is M.VELOCITY:
                self._machine.enter([j], M.POSITION)
    return reply


@breaks("")
def answers_late() -> None:
    """No rule is broken: all answers are late."""

    def late(old: Any, *args: Any) -> Any:
        time.sleep(0.2)
        return old(*args)

    for name in ("get_control_mode", "set_control_mode"):
        around(f"node.wiring.services:Services.{name}", late)
