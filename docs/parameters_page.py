# SPDX-License-Identifier: Apache-2.0
"""The page docs/parameters.md and the site's full table, from the table of the parameters."""

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
All parameters of `control_board`. Start from a file in [config/](../config):
`--ros-args --params-file FILE`; single values: `-p NAME:=VALUE`. Those below *A joint* are written
as `lbr_iiwa_joint_1.limits.lower` for one joint, or as `joint_defaults.limits.lower` for all.
Later files win over earlier ones; within a file the joint's own value wins. What is not allowed
ends the start with one line: place and allowed values (exit code 2).

**Bold**: live, as with `ros2 param set /control_board lbr_iiwa_joint_1.limits.lower -1.5`; values
set together are all applied, or none. `ros2 param describe` and the [site](install.md) have types,
allowed values and every meaning. In brackets: the default with its unit, or what it is computed
from. A unit after "or" is that of sliding joints; their torques are forces in N.
"""

FULL = """\
# All about the parameters

[Parameters](../parameters.md) with types, units and allowed values. Numbers are at most 1e12;
`.inf` is accepted only where stated. *live*: can be changed at run time.
"""

#: Loops with the same parameters.
LOOPS = ("position_pid", "direct_pid", "torque_pid", "current_pid")
#: Those that are shown side by side, and what is said of the other one.
COLUMNS = ("position_pid", "torque_pid", "current_pid")
DIRECT = "`direct_pid` begins with the values of `position_pid`."

GROUPS = {
    "couplings": "Couplings",
    "limits": "Limits",
    **dict.fromkeys(LOOPS, "Control loops"),
    "impedance": "Impedance",
    "payload": "Payload",
    "contact": "Contact",
    "admittance": "Admittance",
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
    """The page of names, defaults and meanings."""
    lines = ["# Parameters", "", INTRODUCTION]
    for title, group in groups():
        lines += [f"## {title}", ""]
        lines += FORMS.get(title, short)(group)
        lines.append("")
    return "\n".join(lines)


def full() -> str:
    """The page of everything, for the site."""
    lines = [FULL]
    for title, group in groups():
        lines += [f"## {title}", ""]
        lines += header("parameter", "type", "default", "unit", "allowed", "live", "meaning")
        lines += [*map(line, group), ""]
    return "\n".join(lines)


def groups() -> list[tuple[str, list[Parameter]]]:
    """All parameters, by the titles below which they stand."""
    everything = sorted(rows(), key=lambda found: order(found.name))
    return [(t, list(g)) for t, g in groupby(everything, key=lambda found: title_of(found.name))]


def short(group: list[Parameter]) -> list[str]:
    """A line for each of a group: name, default with unit, meaning with the words allowed."""
    lines = []
    for found, text in zip(group, texts(group), strict=True):
        new = [choice for choice in found.choices if choice not in text]
        words = f" ({', '.join(found.choices)})" if new else ""
        default = default_of(found) and f" ({default_of(found)})"
        told = found.name.rpartition(".")[2].replace("_", " ") == text.lower()
        lines.append(f"- {named(found)}{default}" + ("" if told else f": {text}{words}."))
    return lines


def loops(group: list[Parameter]) -> list[str]:
    """The table of the control loops, one column each."""
    lines = [DIRECT, "", *header("parameter", *(f"`{loop}`" for loop in COLUMNS), "meaning")]
    cells: dict[str, list[Parameter]] = {}
    for found in group:
        if found.name.split(".")[-2] in COLUMNS:
            cells.setdefault(found.name.rpartition(".")[2], []).append(found)
    for name, of_loops in cells.items():
        meaning = of_loops[0].text.partition(": ")[2].capitalize()
        lines.append(row(f"**`{name}`**", *map(default_of, of_loops), f"{meaning}."))
    return lines


def brief(group: list[Parameter]) -> list[str]:
    """A paragraph of names and defaults; the meanings are on the site."""
    lines = [f"{named(found)} ({default_of(found)})" for found in group]
    return [f"{', '.join(lines)}."]


#: The form of a group on the page, if not ``short``.
FORMS = {
    "Control loops": loops,
    **dict.fromkeys(("Couplings", "Motor", "Simulated encoder", "Simulated drives"), brief),
}


def texts(group: list[Parameter]) -> list[str]:
    """The texts of a group without the words that all begin with."""
    parts = [found.text.partition(": ") for found in group]
    if len({head for head, _, _ in parts}) == 1:
        return [rest[:1].upper() + rest[1:] for _, _, rest in parts]
    return [found.text for found in group]


def named(found: Parameter) -> str:
    """The name, bold where it can change."""
    name = f"`{found.name.removeprefix('<joint>.')}`"
    return f"**{name}**" if found.run_time else name


def default_of(found: Parameter) -> str:
    """The default with its unit, or what it is derived from."""
    if found.default is None:
        return found.derived + (f"; {found.unit}" if found.unit else "")
    value = shown(found.default)
    return f"`{value}` {found.unit}".strip() if value else ""


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
    if (table := name.partition(".")[0]) in ("couplings", "poses"):
        return GROUPS[table]
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
