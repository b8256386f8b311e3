# SPDX-License-Identifier: Apache-2.0
"""Requests as lines for cbctl, ros2 and Python. Pure."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
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

    def as_dict(self) -> dict[str, str]:
        return asdict(self)


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


def of_modes(verb: str, service: Endpoint) -> Writer:
    def write(board: str, joints: list[str], fields: Fields) -> Shell:
        mode = fields["mode"]
        return (
            cbctl(board, verb, *(joints or ["all"]), mode),
            ros2(board, service, {"names": joints, "modes": [mode]}),
        )

    return write


def of_joints(verb: str, service: Endpoint) -> Writer:
    def write(board: str, joints: list[str], _: Fields) -> Shell:
        return cbctl(board, verb, *joints), ros2(board, service, {"names": joints})

    return write


def of_move(endpoint: Endpoint) -> Writer:
    """The lines of a move, by a topic or an action."""

    def write(board: str, joints: list[str], fields: Fields) -> Shell:
        positions, speeds = fields["positions"], fields.get("speeds", [])
        speed = [f"--speed={speeds[0]:.6g}"] if len(speeds) == 1 else []
        message = {"names": joints, "positions": positions}
        return (
            cbctl(board, "move", *pairs(joints, positions), *speed),
            ros2(board, endpoint, message | ({"speeds": speeds} if speeds else {})),
        )

    return write


def of_direct(board: str, joints: list[str], fields: Fields) -> Shell:
    positions = fields["positions"]
    return (
        cbctl(board, "direct", *pairs(joints, positions)),
        ros2(board, POSITION_DIRECT_COMMAND, {"names": joints, "positions": positions}),
    )


def of_hold(board: str, _joints: list[str], fields: Fields) -> Shell:
    joint, kind, value = fields["joint"], fields["kind"], fields["value"]
    topic, field, _ = HOLDS[kind]
    return (
        cbctl(board, kind, f"{joint}={value:.6g}"),
        ros2(board, topic, {"names": [joint], field: [value]}, "ros2 topic pub -r 25"),
    )


def of_impedance(board: str, joints: list[str], fields: Fields) -> Shell:
    stiffness, damping = fields.get("stiffness"), fields.get("damping")
    options = [f"--stiffness={stiffness:.6g}"] if stiffness is not None else []
    options += [f"--damping={damping:.6g}"] if damping is not None else []
    message = {
        "names": joints,
        "stiffness": [] if stiffness is None else [stiffness],
        "damping": [] if damping is None else [damping],
    }
    return (
        cbctl(board, "impedance", *joints, *options),
        ros2(board, SET_IMPEDANCE, message) if stiffness is not None else "",
    )


def of_speed(board: str, joints: list[str], fields: Fields) -> Shell:
    speed, acceleration = fields.get("speed"), fields.get("acceleration")
    message = {
        "names": joints,
        "speeds": [] if speed is None else [speed],
        "accelerations": [] if acceleration is None else [acceleration],
    }
    commands = []
    if speed is not None:
        commands.append(cbctl(board, "speed", *pairs(joints, [speed])))
    if acceleration is not None:
        words = pairs(joints, [acceleration])
        commands.append(cbctl(board, "speed", *words, "--acceleration"))
    return " && ".join(commands), ros2(board, SET_REFERENCE_SPEED, message)


def of_gains(board: str, _: list[str], fields: Fields) -> Shell:
    values = parameters(fields)
    words = [f"{name}={value:.9g}" for name, value in values.items()]
    commands = [
        shlex.join(["ros2", "param", "set", board, name, f"{value:.9g}"])
        for name, value in values.items()
    ]
    return cbctl(board, "param", "set", *words), " && ".join(commands)


def of_estop(board: str, _: list[str], fields: Fields) -> Shell:
    on = bool(fields["on"])
    return (
        cbctl(board, "estop", *([] if on else ["release"])),
        ros2(board, EMERGENCY_STOP, {"data": on}),
    )


def of_recover(board: str, joints: list[str], fields: Fields) -> Shell:
    partial = bool(fields.get("partial"))
    return (
        cbctl(board, "recover", *joints, *(["--partial"] if partial else [])),
        ros2(board, RECOVER, {"names": joints, "partial": partial}),
    )


def of_pose(board: str, _: list[str], fields: Fields) -> Shell:
    name, speed = fields["pose"], fields.get("speed")
    option = [] if speed is None else [f"--speed={speed:.6g}"]
    return (
        cbctl(board, "pose", name, *option),
        ros2(board, GO_TO_POSE, {"pose": name, "speed": speed or 0.0}),
    )


def of_save_pose(board: str, _: list[str], fields: Fields) -> Shell:
    name = fields["pose"]
    return cbctl(board, "pose", "save", name), ros2(board, SAVE_POSE, {"name": name})


def of_configure(board: str, *_: Any) -> Shell:
    return cbctl(board, "configure"), ros2(board, CONFIGURE, {})


def of_measure(verb: str, option: str, size: str) -> Writer:
    """The line of a step or chirp, for cbctl only."""

    def write(board: str, _: list[str], fields: Fields) -> Shell:
        options = [f"{option}={fields[size]:.6g}"] if size in fields else []
        return cbctl(board, verb, fields["joint"], *options), ""

    return write


def pairs(joints: list[str], values: list[float]) -> list[str]:
    """``JOINT=VALUE`` words; a single value applies to every joint."""
    each = values * len(joints) if len(values) == 1 else values
    return [f"{name}={value:.6g}" for name, value in zip(joints, each, strict=False)]


WRITERS: dict[str, Writer] = {
    "mode": of_modes("mode", SET_CONTROL_MODE),
    "interaction": of_modes("interaction", SET_INTERACTION_MODE),
    "position": of_move(POSITION_COMMAND),
    "direct": of_direct,
    "move": of_move(MOVE),
    "hold": of_hold,
    "impedance": of_impedance,
    "speed": of_speed,
    "gains": of_gains,
    "stop": of_joints("stop", STOP),
    "estop": of_estop,
    "recover": of_recover,
    "calibrate": of_joints("calibrate", CALIBRATE),
    "configure": of_configure,
    "pose": of_pose,
    "save_pose": of_save_pose,
    "step": of_measure("step", "--size", "size"),
    "chirp": of_measure("chirp", "--amplitude", "amplitude"),
}
