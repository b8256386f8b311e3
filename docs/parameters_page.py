# SPDX-License-Identifier: Apache-2.0
"""The page docs/parameters.md, from the table that declares the parameters."""

from __future__ import annotations

from itertools import groupby

from interface_page import header, row

from control_board_ros.settings.schema import rows

INTRODUCTION = """\
Every parameter of `control_board`: the board's own, and those of each joint. Files to start from
are in [config/](../config). The node reads them with `--ros-args --params-file FILE`, one value
with `-p NAME:=VALUE`.

The parameters of a joint are written as `lbr_iiwa_joint_1.limits.lower` for one joint, or as
`joint_defaults.limits.lower` for all. Later files win over earlier ones, and in each file the
joint's own value wins over the default. A name that does not exist, a wrong type and a value out
of range end the start with one line that says where and what is allowed (exit code 2).

*live*: `ros2 param set /control_board lbr_iiwa_joint_1.limits.lower -1.5` changes it while the
board runs. Several values set together are checked together: all are taken, or none. The other
parameters are read-only.

Units: rad, rad/s, N·m, A, V, s; m, m/s and N for sliding joints; percent for PWM. Rules of the
specification stand in brackets. A default that is "from" something is computed where nothing is
given.
"""

GROUPS = {
    "limits": "Limits",
    "position_pid": "Position control",
    "direct_pid": "Direct position control",
    "torque_pid": "Torque control",
    "current_pid": "Current control",
    "impedance": "Impedance",
    "motor": "Motor",
    "timeouts": "Timeouts",
    "calibration": "Calibration",
    "encoder": "Simulated encoder",
}


def page() -> str:
    """The whole page."""
    lines = ["# Parameters", "", INTRODUCTION]
    everything = sorted(rows(), key=lambda found: order(found[0]))
    for title, group in groupby(everything, key=lambda found: title_of(found[0])):
        lines += [f"## {title}", ""]
        lines += header("parameter", "type", "default", "allowed", "live", "meaning")
        for name, kind, default, allowed, live, text in group:
            bounds = allowed.replace("of at least 1e-09", "above 0")
            value = shown(default, kind)
            lines.append(row(f"`{name}`", kind, value, bounds, "live" if live else "", text))
        lines.append("")
    return "\n".join(lines)


def title_of(name: str) -> str:
    if not name.startswith("<joint>."):
        return "The board"
    prefix, dot, _ = name.removeprefix("<joint>.").partition(".")
    return GROUPS[prefix] if dot else "A joint"


def order(name: str) -> int:
    return ["The board", "A joint", *GROUPS.values()].index(title_of(name))


def shown(default: str, kind: str) -> str:
    """A default as YAML wants it: a double has a dot."""
    if default.startswith("from "):
        return default
    return f"`{default}.0`" if kind == "double" and default.isdigit() else f"`{default}`"
