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

from .requests import HOLDS, Request


@dataclass(frozen=True, slots=True)
class Lines:
    """A request in three forms; empty where a form does not support it."""

    cbctl: str = ""
    ros2: str = ""
    python: str = ""

    def shown(self) -> dict[str, str]:
        return asdict(self)


def lines_of(request: Request) -> Lines:
    """The lines of a request; empty for one that changes nothing."""
    given, board = request.given, request.board
    joints = list(given.get("joints", ()))
    write = WRITERS.get(request.do)
    return Lines() if write is None else write(board, joints, given)


def cbctl(board: str, *words: str) -> str:
    option = [] if board == "/control_board" else ["--board", board]
    return shlex.join(["cbctl", *option, *words])


def called(board: str, service: Endpoint, request: Mapping[str, Any]) -> str:
    return f"ros2 service call {shlex.quote(service.of(board))} {service.type} {quoted(request)}"


def published(board: str, topic: Endpoint, message: Mapping[str, Any], how: str = "--once") -> str:
    return f"ros2 topic pub {how} {shlex.quote(topic.of(board))} {topic.type} {quoted(message)}"


def sent(board: str, action: Endpoint, goal: Mapping[str, Any]) -> str:
    return f"ros2 action send_goal {shlex.quote(action.of(board))} {action.type} {quoted(goal)}"


def quoted(fields: Mapping[str, Any]) -> str:
    """Fields as a shell word; JSON is valid YAML."""
    return shlex.quote(json.dumps(dict(fields), ensure_ascii=False))


def python(method: str, *values: Any) -> str:
    return f"board.{method}({', '.join(map(literal, values))})"


def literal(value: Any) -> str:
    """A Python literal; an empty list of joints means all."""
    if isinstance(value, list):
        return "None" if not value else repr(value[0] if len(value) == 1 else value)
    return repr(value)


def of_mode(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    mode = given["mode"]
    return Lines(
        cbctl(board, "mode", *(joints or ["all"]), mode),
        called(board, SET_CONTROL_MODE, {"names": joints, "modes": [mode]}),
        python("set_control_mode", joints, mode),
    )


def of_interaction(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    mode = given["mode"]
    return Lines(
        cbctl(board, "interaction", *(joints or ["all"]), mode),
        called(board, SET_INTERACTION_MODE, {"names": joints, "modes": [mode]}),
        python("set_interaction_mode", joints, mode),
    )


def of_position(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    positions, speeds = given["positions"], given.get("speeds", [])
    speed = [f"--speed={speeds[0]:.6g}"] if len(speeds) == 1 else []
    fields = {"names": joints, "positions": positions} | ({"speeds": speeds} if speeds else {})
    return Lines(
        cbctl(board, "move", *pairs(joints, positions), *speed),
        published(board, POSITION_COMMAND, fields),
        python("position_move", joints, positions, *([speeds] if speeds else [])),
    )


def of_move(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    positions, speeds = given["positions"], given.get("speeds", [])
    fields = {"names": joints, "positions": positions} | ({"speeds": speeds} if speeds else {})
    return Lines(
        of_position(board, joints, given).cbctl,
        sent(board, MOVE, fields),
        python("move", joints, positions, *([speeds] if speeds else [])),
    )


def of_direct(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    positions = given["positions"]
    return Lines(
        cbctl(board, "direct", *pairs(joints, positions)),
        published(board, POSITION_DIRECT_COMMAND, {"names": joints, "positions": positions}),
        python("set_position", joints, positions),
    )


def of_hold(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
    joint, kind, value = given["joint"], given["kind"], given["value"]
    topic, field, method = HOLDS[kind]
    return Lines(
        cbctl(board, kind, f"{joint}={value:.6g}"),
        published(board, topic, {"names": [joint], field: [value]}, "-r 25"),
        python(method, joint, value),
    )


def of_impedance(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    stiffness, damping = given.get("stiffness"), given.get("damping")
    options = [f"--stiffness={stiffness:.6g}"] if stiffness is not None else []
    options += [f"--damping={damping:.6g}"] if damping is not None else []
    fields = {
        "names": joints,
        "stiffness": [] if stiffness is None else [stiffness],
        "damping": [] if damping is None else [damping],
    }
    return Lines(
        cbctl(board, "impedance", *joints, *options),
        called(board, SET_IMPEDANCE, fields) if stiffness is not None else "",
        python("set_impedance", joints, stiffness, damping),
    )


def of_speed(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    speed, acceleration = given.get("speed"), given.get("acceleration")
    fields = {
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
    return Lines(
        " && ".join(commands),
        called(board, SET_REFERENCE_SPEED, fields),
        python("set_reference_speed", joints, speed, acceleration),
    )


def of_gains(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
    front = f"{given['joint']}.{given['controller']}_pid"
    values = {f"{front}.{gain}": value for gain, value in given["gains"].items()}
    words = [f"{name}={value:.9g}" for name, value in values.items()]
    ros2 = [
        shlex.join(["ros2", "param", "set", board, name, f"{value:.9g}"])
        for name, value in values.items()
    ]
    return Lines(
        cbctl(board, "param", "set", *words),
        " && ".join(ros2),
        f"board.set_parameters({values!r})",
    )


def of_stop(board: str, joints: list[str], _: Mapping[str, Any]) -> Lines:
    return Lines(
        cbctl(board, "stop", *joints),
        called(board, STOP, {"names": joints}),
        python("stop", joints),
    )


def of_estop(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
    on = bool(given["on"])
    return Lines(
        cbctl(board, "estop", *([] if on else ["release"])),
        called(board, EMERGENCY_STOP, {"data": on}),
        python("emergency_stop", *([] if on else [False])),
    )


def of_recover(board: str, joints: list[str], given: Mapping[str, Any]) -> Lines:
    partial = bool(given.get("partial"))
    return Lines(
        cbctl(board, "recover", *joints, *(["--partial"] if partial else [])),
        called(board, RECOVER, {"names": joints, "partial": partial}),
        python("recover", joints, *([True] if partial else [])),
    )


def of_calibrate(board: str, joints: list[str], _: Mapping[str, Any]) -> Lines:
    return Lines(
        cbctl(board, "calibrate", *joints),
        sent(board, CALIBRATE, {"names": joints}),
        python("calibrate", joints),
    )


def of_pose(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
    name, speed = given["pose"], given.get("speed")
    option = [] if speed is None else [f"--speed={speed:.6g}"]
    return Lines(
        cbctl(board, "pose", name, *option),
        sent(board, GO_TO_POSE, {"pose": name, "speed": speed or 0.0}),
        python("go_to_pose", name, *([speed] if speed else [])),
    )


def of_save_pose(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
    name = given["pose"]
    return Lines(
        cbctl(board, "pose", "save", name),
        called(board, SAVE_POSE, {"name": name}),
        python("save_pose", name),
    )


def of_configure(board: str, *_: Any) -> Lines:
    return Lines(cbctl(board, "configure"), called(board, CONFIGURE, {}), python("configure"))


def of_measure(verb: str, option: str, size: str) -> Callable[..., Lines]:
    """The line of a step or chirp, for cbctl only."""

    def write(board: str, _: list[str], given: Mapping[str, Any]) -> Lines:
        options = [f"{option}={given[size]:.6g}"] if size in given else []
        return Lines(cbctl(board, verb, given["joint"], *options))

    return write


def pairs(joints: list[str], values: list[float]) -> list[str]:
    """``JOINT=VALUE`` words; a single value applies to every joint."""
    each = values * len(joints) if len(values) == 1 else values
    return [f"{name}={value:.6g}" for name, value in zip(joints, each, strict=False)]


WRITERS = {
    "mode": of_mode,
    "interaction": of_interaction,
    "position": of_position,
    "direct": of_direct,
    "move": of_move,
    "hold": of_hold,
    "impedance": of_impedance,
    "speed": of_speed,
    "gains": of_gains,
    "stop": of_stop,
    "estop": of_estop,
    "recover": of_recover,
    "calibrate": of_calibrate,
    "configure": of_configure,
    "pose": of_pose,
    "save_pose": of_save_pose,
    "step": of_measure("step", "--size", "size"),
    "chirp": of_measure("chirp", "--amplitude", "amplitude"),
}
