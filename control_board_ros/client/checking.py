# SPDX-License-Identifier: Apache-2.0
"""Validation of a board's responses."""

from __future__ import annotations

from typing import Any

from control_board_ros.core.terms.vocabs import (
    YARP_4_PWM,
    BrakeMode,
    ControlMode,
    InteractionMode,
    encode,
)
from control_board_ros.interface import MOST_JOINTS, Endpoint
from control_board_ros.text import clean, clean_names

from .errors import InvalidAnswer

CODES = {
    "control": frozenset({YARP_4_PWM, *(mode.code for mode in ControlMode)}),
    "interaction": frozenset(mode.code for mode in InteractionMode),
    "brake": frozenset({"", *BrakeMode}),
}
VOCABS = {
    "control": frozenset({encode(YARP_4_PWM), *map(int, ControlMode)}),
    "interaction": frozenset(map(int, InteractionMode)),
}
#: Fields whose length differs from that of ``names``.
FIELDS_OF_OTHER_LENGTH = frozenset({"poses"})


def check_response(service: Endpoint, response: Any, board: str) -> None:
    """Reject a response with inconsistent lengths or unknown modes; sanitise its names.

    Raises:
        InvalidAnswer: one line: board, service, problem.
    """
    wrong_form = _lengths(response)
    problem = wrong_form or _modes(service, response)
    if problem:
        text = f"{service.of(board)} sent an invalid response: {problem}; is it a control board?"
        raise InvalidAnswer(text, unknown_mode=not wrong_form)
    if hasattr(response, "names"):
        response.names = list(clean_names(response.names))


def check_asked(service: Endpoint, response: Any, count: int, board: str) -> None:
    """Reject a response of a getter without one entry per requested joint.

    Raises:
        InvalidAnswer: one line: board, service, problem.
    """
    if not hasattr(response, "names"):
        return
    for field, kind in response.get_fields_and_field_types().items():
        entries = len(getattr(response, field)) if kind.startswith("sequence") else count
        if entries != count and not (field == "vocabs" and entries == 0):
            where, asked = service.of(board), f"{count} requested joints"
            text = f"{where} sent an invalid response: {entries} {field} for {asked}"
            raise InvalidAnswer(text)


def _lengths(response: Any) -> str:
    """Problem with the lengths of its lists; empty if valid."""
    if not hasattr(response, "names"):
        return ""
    count = len(response.names)
    if count > MOST_JOINTS:
        return f"{count} joints, {MOST_JOINTS} at most"
    for field, kind in response.get_fields_and_field_types().items():
        if kind.startswith("sequence") and field not in FIELDS_OF_OTHER_LENGTH:
            entries = len(getattr(response, field))
            if entries not in (0, count):
                return f"{entries} {field} for {count} names"
    return ""


def _modes(service: Endpoint, response: Any) -> str:
    """Problem with its modes; empty if valid."""
    kind = next((kind for kind in CODES if kind in service.short), "control")
    codes_of = {kind: list(getattr(response, "modes", ()))}
    for other in CODES:
        for modes in getattr(response, f"{other}_modes", ()):
            codes_of.setdefault(other, []).extend(filter(None, modes.split(",")))
    for which, codes in codes_of.items():
        for code in codes:
            if code not in CODES[which]:
                return f"{clean(code, 20)!r} is no {which} mode"
    for vocab in getattr(response, "vocabs", ()):
        if vocab not in VOCABS[kind]:
            return f"{vocab} is no {kind} mode"
    return ""
