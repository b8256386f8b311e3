# SPDX-License-Identifier: Apache-2.0
"""The requests of browsers: one row each, and their validation. Pure.

A message is ``{"id": 7, "do": "position", "board": "/control_board", "joints": ["a"], …}``. The
board validates the numbers; only their form is checked here.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from control_board_ros.interface import (
    CURRENT_COMMAND,
    OUTPUT_COMMAND,
    TORQUE_COMMAND,
    VELOCITY_COMMAND,
    VELOCITY_DIRECT_COMMAND,
    Endpoint,
)
from control_board_ros.text import clean, unknown_word

#: The fields of a request.
Fields = Mapping[str, Any]

MAX_NAMES = 256
MAX_TEXT = 200
HALVES = re.compile("[\ud800-\udfff]")


class BadRequest(ValueError):  # noqa: N818  (HTTP's word)
    """An invalid request; one line for its sender.

    Attributes: id (of the request; None if unreadable).
    """

    def __init__(self, text: str, id_: int | None = None) -> None:
        super().__init__(clean(text))
        self.id = id_


@dataclass(frozen=True, slots=True)
class Request:
    """A request of a browser: id, verb, board, fields."""

    id: int
    do: str
    board: str
    fields: Fields


@dataclass(frozen=True, slots=True)
class Kind:
    """Definition of a request.

    Attributes: needed and optional (field -> check), commands (may change something: operator
    only, never in read-only mode), to_all (no board required).
    """

    needed: Mapping[str, Callable[[Any], Any]]
    optional: Mapping[str, Callable[[Any], Any]]
    commands: bool = True
    to_all: bool = False


def text(value: Any) -> str:
    """A text of limited length, without halves of characters (lone surrogates)."""
    if not isinstance(value, str) or not 0 < len(value) <= MAX_TEXT or HALVES.search(value):
        raise ValueError(f"a text of 1 to {MAX_TEXT} characters of Unicode")
    return value


def names(value: Any) -> list[str]:
    """Names of joints; empty means all."""
    if not isinstance(value, list) or len(value) > MAX_NAMES:
        raise ValueError(f"a list of at most {MAX_NAMES} names")
    return [text(entry) for entry in value]


def number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("a finite number")
    if not -sys.float_info.max <= value <= sys.float_info.max:  # an int may have any size
        raise ValueError("a finite number")
    return float(value)


def numbers(value: Any) -> list[float]:
    """Numbers, one per joint."""
    if not isinstance(value, list) or not 0 < len(value) <= MAX_NAMES:
        raise ValueError(f"a list of 1 to {MAX_NAMES} numbers")
    return [number(entry) for entry in value]


def gains(value: Any) -> dict[str, float]:
    if not isinstance(value, dict) or not 0 < len(value) <= 10:
        raise ValueError("an object of 1 to 10 gains")
    return {text(key): number(entry) for key, entry in value.items()}


def flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("true or false")
    return value


def one_of(*words: str) -> Callable[[Any], str]:

    def check(value: Any) -> str:
        if value not in words:
            raise ValueError(f"one of {', '.join(words)}")
        return str(value)

    return check


#: Kinds of held references: topic, its field, the client's method.
HOLDS: dict[str, tuple[Endpoint, str, str]] = {
    "velocity": (VELOCITY_COMMAND, "velocities", "velocity_move"),
    "torque": (TORQUE_COMMAND, "torques", "set_ref_torque"),
    "output": (OUTPUT_COMMAND, "outputs", "set_output"),
    "veldirect": (VELOCITY_DIRECT_COMMAND, "velocities", "set_ref_velocity"),
    "current": (CURRENT_COMMAND, "currents", "set_ref_current"),
}
JOINTS = {"joints": names}

KINDS: dict[str, Kind] = {
    # For watchers
    "watch": Kind({"boards": names}, {}, commands=False, to_all=True),
    "details": Kind({"joint": text}, {}, commands=False),
    "frame": Kind({"joint": text}, {}, commands=False),
    "poses": Kind({}, {"pose": text}, commands=False),
    "targets": Kind({}, {}, commands=False),
    "operate": Kind({}, {}, commands=False, to_all=True),
    "hand_over": Kind({"yes": flag}, {}, commands=False, to_all=True),
    "step_back": Kind({}, {}, commands=False, to_all=True),
    # For the operator
    "stop": Kind({}, JOINTS, to_all=True),
    "estop": Kind({"on": flag}, {}, to_all=True),
    "recover": Kind(JOINTS, {"partial": flag}),
    "mode": Kind(JOINTS | {"mode": text}, {}),
    "interaction": Kind(JOINTS | {"mode": text}, {}),
    "position": Kind(JOINTS | {"positions": numbers}, {"speeds": numbers, "live": flag}),
    "direct": Kind(JOINTS | {"positions": numbers}, {"live": flag}),
    "move": Kind(JOINTS | {"positions": numbers}, {"speeds": numbers}),
    "hold": Kind({"joint": text, "kind": one_of(*HOLDS), "value": number}, {}),
    "release": Kind({"joint": text, "kind": one_of(*HOLDS)}, {}),
    "impedance": Kind(JOINTS, {"stiffness": number, "damping": number}),
    "speed": Kind(JOINTS, {"speed": number, "acceleration": number}),
    "gains": Kind({"joint": text, "controller": text, "gains": gains}, {}),
    "calibrate": Kind(JOINTS, {}),
    "configure": Kind({}, {}),
    "pose": Kind({"pose": text}, {"speed": number}),
    "save_pose": Kind({"pose": text}, {}),
    "record": Kind({"on": flag}, {"boards": names}, to_all=True),
    "note": Kind({"text": text}, {}, to_all=True),
    "step": Kind({"joint": text, "size": number}, {}),
    "chirp": Kind({"joint": text}, {"amplitude": number}),
    "cancel": Kind({"request": number}, {}, to_all=True),
}


def joints_of(fields: Fields) -> list[str] | None:
    """The joints of a request as an argument of the client; None means all."""
    return fields.get("joints") or None


def one_or_many(fields: Fields) -> list[Any]:
    """Positions, and speeds if given; a single value applies to every joint."""
    values = [fields["positions"], *([fields["speeds"]] if fields.get("speeds") else [])]
    return [value[0] if len(value) == 1 else value for value in values]


def parameters(fields: Fields) -> dict[str, float]:
    """Gains by the names of their parameters."""
    front = f"{fields['joint']}.{fields['controller']}_pid"
    return {f"{front}.{gain}": value for gain, value in fields["gains"].items()}


#: The client's method for a request, with its arguments.
CALLS: dict[str, Callable[[Fields], tuple[Any, ...]]] = {
    "mode": lambda g: ("set_control_mode", joints_of(g), g["mode"]),
    "interaction": lambda g: ("set_interaction_mode", joints_of(g), g["mode"]),
    "position": lambda g: ("position_move", joints_of(g), *one_or_many(g)),
    "direct": lambda g: ("set_position", joints_of(g), *one_or_many(g)),
    "move": lambda g: ("move", joints_of(g), *one_or_many(g)),
    "hold": lambda g: (HOLDS[g["kind"]][2], g["joint"], g["value"]),
    "impedance": lambda g: ("set_impedance", joints_of(g), g.get("stiffness"), g.get("damping")),
    "speed": lambda g: (
        "set_reference_speed",
        joints_of(g),
        g.get("speed"),
        g.get("acceleration"),
    ),
    "gains": lambda g: ("set_parameters", parameters(g)),
    "stop": lambda g: ("stop", joints_of(g)),
    "estop": lambda g: ("emergency_stop", *([] if g["on"] else [False])),
    "recover": lambda g: ("recover", joints_of(g), *([True] if g.get("partial") else [])),
    "calibrate": lambda g: ("calibrate", joints_of(g)),
    "configure": lambda _: ("configure",),
    "pose": lambda g: ("go_to_pose", g["pose"], *([g["speed"]] if g.get("speed") else [])),
    "save_pose": lambda g: ("save_pose", g["pose"]),
}


def parse(message: str) -> Request:
    """The request in a message; raises BadRequest where it is invalid."""
    try:
        fields = json.loads(message)
    except (ValueError, RecursionError):
        raise BadRequest("this is no JSON") from None
    if not isinstance(fields, dict):
        raise BadRequest("a request is a JSON object")
    id_ = fields.pop("id", None)
    if isinstance(id_, bool) or not isinstance(id_, int) or not 0 <= id_ < 2**53:
        raise BadRequest("a request has an id: a whole number, 0 or more")
    do = fields.pop("do", None)
    kind = KINDS.get(do) if isinstance(do, str) else None
    if kind is None:
        raise BadRequest(unknown_word("request", do, KINDS), id_)
    board = fields.pop("board", "")
    if not isinstance(board, str) or len(board) > MAX_TEXT or not (board or kind.to_all):
        raise BadRequest(f"{do} needs the name of a board", id_)
    return Request(id_, do, board, checked(do, kind, fields, id_))


def checked(do: str, kind: Kind, fields: dict[str, Any], id_: int) -> dict[str, Any]:
    """Validate the fields of a request.

    Raises:
        BadRequest: a field is missing, invalid, or unknown.
    """
    values = {}
    for name, check in {**kind.needed, **kind.optional}.items():
        value = fields.pop(name, None)
        if value is None:
            if name in kind.needed:
                raise BadRequest(f"{do} needs {name}", id_)
            continue
        try:
            values[name] = check(value)
        except ValueError as error:
            raise BadRequest(f"{name} of {do} is not valid; give {error}", id_) from None
    if fields:
        raise BadRequest(f"{do} has no field {', '.join(sorted(map(str, fields)))[:80]}", id_)
    return values
