# SPDX-License-Identifier: Apache-2.0
"""The page docs/parameters.md, from the table that declares the parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from typing import Any

from interface_page import header, row

from control_board_ros.core.config.parameter import Parameter
from control_board_ros.settings.couplings import ROWS as COUPLING_ROWS
from control_board_ros.settings.poses import POSITION_ROW, SPEED_ROW
from control_board_ros.settings.schema import BOARD, JOINT

INTRODUCTION = """\
All parameters of `control_board`: the board's own, and those of each joint. Start from a file in
[config/](../config): `--ros-args --params-file FILE`; single values: `-p NAME:=VALUE`.

A joint's parameter is written as `lbr_iiwa_joint_1.limits.lower` for one joint, or as
`joint_defaults.limits.lower` for all. Later files win over earlier ones; within a file the joint's
own value wins over the default. An unknown name, a wrong type or a value out of range ends the
start with one line that states the place and the allowed values (exit code 2).

*live*: can be changed at run time, as with
`ros2 param set /control_board lbr_iiwa_joint_1.limits.lower -1.5`. Values set together are checked
together: all are applied, or none. Other parameters are read-only.

A unit after "or" is that of sliding joints; their torques are forces in N. Rules of the
specification are in brackets. A default "from" something is computed where no value is given.
Numbers are at most 1e12; `.inf` is accepted only where stated.
"""

GROUPS = {
    "limits": "Limits",
    "position_pid": "Position control",
    "direct_pid": "Direct position control",
    "torque_pid": "Torque control",
    "current_pid": "Current control",
    "impedance": "Impedance",
    "payload": "Payload",
    "contact": "Contact",
    "motor": "Motor",
    "brake": "Brake",
    "timeouts": "Timeouts",
    "constraints": "Trajectories",
    "calibration": "Calibration",
    "encoder": "Simulated encoder",
    "drive_model": "Simulated drives",
    "poses": "Poses",
}


def page() -> str:
    """The whole page."""
    lines = ["# Parameters", "", INTRODUCTION]
    everything = sorted(rows(), key=lambda found: order(found.name))
    for title, group in groupby(everything, key=lambda found: title_of(found.name)):
        lines += [f"## {title}", ""]
        lines += header("parameter", "type", "default", "unit", "allowed", "live", "meaning")
        lines += [line(found) for found in group]
        lines.append("")
    return "\n".join(lines)


def rows() -> Iterator[Parameter]:
    """All parameters, by the names that the page gives them."""
    yield from BOARD
    for found in JOINT:
        yield replace(found, name=f"<joint>.{found.name}")
    yield from (POSITION_ROW, SPEED_ROW)
    yield from COUPLING_ROWS.values()


def line(found: Parameter) -> str:
    """The line of one parameter."""
    default = f"from {found.derived}" if found.default is None else f"`{shown(found.default)}`"
    allowed = found.range_text + ", or infinite" * (math.inf in map(abs, found.bounds))
    live = "live" if found.run_time else ""
    return row(f"`{found.name}`", found.kind, default, found.unit, allowed, live, f"{found.text}.")


def title_of(name: str) -> str:
    if name.startswith("poses."):
        return GROUPS["poses"]
    if not name.startswith("<joint>."):
        return "The board"
    prefix, dot, _ = name.removeprefix("<joint>.").partition(".")
    return GROUPS[prefix] if dot else "A joint"


def order(name: str) -> int:
    return ["The board", "A joint", *GROUPS.values()].index(title_of(name))


def shown(value: Any) -> str:
    """A value in YAML: a double has a dot."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(shown, value)) + "]"
    return str(value)
