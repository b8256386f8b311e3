# SPDX-License-Identifier: Apache-2.0
"""Requests as lines for cbctl, ros2 and Python. Pure."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from control_board_ros.interface import (
    CALIBRATE,
    CONFIGURE,
    EMERGENCY_STOP,
    GO_TO_POSE,
    MOVE,
    POSITION_COMMAND,
    POSITION_DIRECT_COMMAND,
    RECOVER,
    SAVE_POSE,
    SET_CONTROL_MODE,
    SET_IMPEDANCE,
    SET_INTERACTION_MODE,
    SET_REFERENCE_SPEED,
    STOP,
    Endpoint,
)

from .protocol import CALLS, HOLDS, Fields, Request, parameters


@dataclass(frozen=True, slots=True)
class CommandLines:
    """A request in three forms; empty where a form does not support it."""

    cbctl: str = ""
    ros2: str = ""
    python: str = ""


#: The words of ros2 before a name, by the kind of endpoint.
ROS2 = {
    "service": "ros2 service call",
    "command": "ros2 topic pub --once",
    "action": "ros2 action send_goal",
}
#: The lines of cbctl and ros2.
Shell = tuple[str, str]
#: Writes them for a request: board, joints, fields.
Writer = Callable[[str, list[str], Fields], Shell]


def command_lines(request: Request) -> CommandLines:
    """The lines of a request; empty for one that changes nothing."""
    fields, do = request.fields, request.do
    if do not in WRITERS:
        return CommandLines()
    shell = WRITERS[do](request.board, list(fields.get("joints", ())), fields)
    return CommandLines(*shell, python(*CALLS[do](fields)) if do in CALLS else "")


def cbctl(board: str, *words: str) -> str:
    option = [] if board == "/control_board" else ["--board", board]
    return shlex.join(["cbctl", *option, *words])


def ros2(board: str, endpoint: Endpoint, message: Mapping[str, Any], words: str = "") -> str:
    """A line of ros2; JSON is valid YAML."""
    name, values = shlex.quote(endpoint.of(board)), json.dumps(message, ensure_ascii=False)
    return f"{words or ROS2[endpoint.kind]} {name} {endpoint.type} {shlex.quote(values)}"


def python(method: str, *values: Any) -> str:
    arguments = [v[0] if isinstance(v, list) and len(v) == 1 else v for v in values]
    return f"board.{method}({', '.join(map(repr, arguments))})"


def pairs(joints: list[str], numbers: list[float]) -> list[str]:
    """``JOINT=VALUE`` words; a single value applies to every joint."""
    each = numbers * len(joints) if len(numbers) == 1 else numbers
    return [f"{name}={value:.6g}" for name, value in zip(joints, each, strict=False)]


def option(name: str, value: float | None) -> list[str]:
    return [] if value is None else [f"{name}={value:.6g}"]


def present(fields: Fields, **keys: str) -> dict[str, list[float]]:
    """Fields of numbers for ros2, by their names in the request; empty: unchanged."""
    return {name: [fields[key]] if key in fields else [] for name, key in keys.items()}


def move_words(joints: list[str], fields: Fields) -> list[str]:
    speeds = fields.get("speeds", [])
    speed = option("--speed", speeds[0]) if len(speeds) == 1 else []
    return ["move", *pairs(joints, fields["positions"]), *speed]


def positions(joints: list[str], fields: Fields) -> Mapping[str, Any]:
    speeds = {"speeds": fields["speeds"]} if fields.get("speeds") else {}
    return {"names": joints, "positions": fields["positions"], **speeds}


@dataclass(frozen=True, slots=True)
class Row:
    """A request as one command of cbctl and one of ros2.

    Attributes: words (of cbctl) and message (of ros2) of the joints and fields of a request,
    endpoint (of the message; None: ros2 has no line), needs (a field without which it has none).
    """

    words: Callable[[list[str], Fields], list[str]]
    endpoint: Endpoint | None = None
    message: Callable[[list[str], Fields], Mapping[str, Any]] = lambda j, _: {"names": j}
    needs: str = ""

    def __call__(self, board: str, joints: list[str], fields: Fields) -> Shell:
        line = cbctl(board, *self.words(joints, fields))
        if self.endpoint is None or (self.needs and self.needs not in fields):
            return line, ""
        return line, ros2(board, self.endpoint, self.message(joints, fields))


def of_hold(board: str, _: list[str], fields: Fields) -> Shell:
    joint, kind, value = fields["joint"], fields["kind"], fields["value"]
    topic, field, _method = HOLDS[kind]
    return (
        cbctl(board, kind, f"{joint}={value:.6g}"),
        ros2(board, topic, {"names": [joint], field: [value]}, "ros2 topic pub -r 25"),
    )


def of_speed(board: str, joints: list[str], fields: Fields) -> Shell:
    """Speed and acceleration are two commands of cbctl."""
    commands = [
        cbctl(board, "speed", *pairs(joints, [fields[key]]), *words)
        for key, words in (("speed", []), ("acceleration", ["--acceleration"]))
        if key in fields
    ]
    message = {"names": joints, **present(fields, speeds="speed", accelerations="acceleration")}
    return " && ".join(commands), ros2(board, SET_REFERENCE_SPEED, message)


def of_gains(board: str, _: list[str], fields: Fields) -> Shell:
    gains = {name: f"{value:.9g}" for name, value in parameters(fields).items()}
    commands = [shlex.join(["ros2", "param", "set", board, *gain]) for gain in gains.items()]
    line = cbctl(board, "param", "set", *map("=".join, gains.items()))
    return line, " && ".join(commands)


WRITERS: dict[str, Writer] = {
    "mode": Row(
        lambda j, g: ["mode", *(j or ["all"]), g["mode"]],
        SET_CONTROL_MODE,
        lambda j, g: {"names": j, "modes": [g["mode"]]},
    ),
    "interaction": Row(
        lambda j, g: ["interaction", *(j or ["all"]), g["mode"]],
        SET_INTERACTION_MODE,
        lambda j, g: {"names": j, "modes": [g["mode"]]},
    ),
    "position": Row(move_words, POSITION_COMMAND, positions),
    "direct": Row(
        lambda j, g: ["direct", *pairs(j, g["positions"])], POSITION_DIRECT_COMMAND, positions
    ),
    "move": Row(move_words, MOVE, positions),
    "hold": of_hold,
    "impedance": Row(
        lambda j, g: [
            *("impedance", *j),
            *option("--stiffness", g.get("stiffness")),
            *option("--damping", g.get("damping")),
        ],
        SET_IMPEDANCE,
        lambda j, g: {"names": j, **present(g, stiffness="stiffness", damping="damping")},
        needs="stiffness",
    ),
    "speed": of_speed,
    "gains": of_gains,
    "stop": Row(lambda j, _: ["stop", *j], STOP),
    "estop": Row(
        lambda _, g: ["estop", *([] if g["on"] else ["release"])],
        EMERGENCY_STOP,
        lambda _, g: {"data": g["on"]},
    ),
    "recover": Row(
        lambda j, g: ["recover", *j, *(["--partial"] if g.get("partial") else [])],
        RECOVER,
        lambda j, g: {"names": j, "partial": g.get("partial", False)},
    ),
    "calibrate": Row(lambda j, _: ["calibrate", *j], CALIBRATE),
    "configure": Row(lambda *_: ["configure"], CONFIGURE, lambda *_: {}),
    "pose": Row(
        lambda _, g: ["pose", g["pose"], *option("--speed", g.get("speed"))],
        GO_TO_POSE,
        lambda _, g: {"pose": g["pose"], "speed": g.get("speed", 0.0)},
    ),
    "save_pose": Row(
        lambda _, g: ["pose", "save", g["pose"]], SAVE_POSE, lambda _, g: {"name": g["pose"]}
    ),
    "step": Row(lambda _, g: ["step", g["joint"], *option("--size", g["size"])]),
    "chirp": Row(lambda _, g: ["chirp", g["joint"], *option("--amplitude", g.get("amplitude"))]),
}
