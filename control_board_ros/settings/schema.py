# SPDX-License-Identifier: Apache-2.0
"""Every parameter, in one table: name, type, default, range, unit, and when it can change.

The settings, the ROS declarations and the parameter reference all come from here. Board
parameters have plain names; joint parameters stand once, in JOINT, and are written as
``<joint>.limits.lower`` for one joint or ``joint_defaults.limits.lower`` for all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from ..core.config import BoardConfig
from ..sim.config import SimulationConfig
from .parameter import JOINT_DEFAULTS, Kind, Parameter, default_of, flag, number, string, strings
from .schema_joint import JOINT

__all__ = [
    "BOARD",
    "BOARD_BY_NAME",
    "JOINT",
    "JOINT_BY_NAME",
    "JOINT_DEFAULTS",
    "Kind",
    "Parameter",
    "find_row",
    "rows",
]

BOARD = (
    string("robot", "iiwa", "Robot: iiwa, panda, icub_left_arm, icub_right_arm or a URDF's path."),
    strings("joints", [], "Joints of the board in its order; empty: all that move."),
    number(
        "control_rate",
        default_of(BoardConfig, "control_rate"),
        "Control cycles, Hz; the gains hold from 200 to 4000, the log warns below.",
        10,
        high=2e4,
    ),
    number(
        "state_rate", 100.0, "Rate of joint_states and ~/state, Hz.", 0.1, high=1e3, run_time=True
    ),
    number(
        "real_time_factor",
        1.0,
        "Simulated seconds per second; 0: as fast as possible.",
        high=1000.0,
        run_time=True,
    ),
    Parameter(
        name="realtime_priority",
        kind=Kind.INTEGER,
        default=0,
        description="SCHED_FIFO priority of the node, 0: none; needs CAP_SYS_NICE.",
        low=0,
        high=98,
    ),
    Parameter(
        name="niceness",
        kind=Kind.INTEGER,
        default=-20,
        description="Niceness of the node where it is granted, as to root; not at "
        "real_time_factor 0.",
        low=-20,
        high=19,
    ),
    flag("gui", False, "Show the arm in pybullet's window."),
    flag("autoconfigure", True, "Leave NOT_CONFIGURED at start (N2); else by ~/configure."),
    string(
        "output",
        "pwm",
        "What the control laws give: pwm, or current to an inner loop (P10).",
        choices=("pwm", "current"),
    ),
    flag("publish_clock", False, "Publish /clock, also at real_time_factor 1."),
    flag("allow_fault_injection", False, "Offer ~/inject_fault; for tests, in simulation."),
    strings(
        "calibration_groups",
        [],
        'Joints that calibrate together, group after group: each "joint,joint,…".',
    ),
    number(
        "physics_rate",
        None,
        "Physics steps, Hz; a whole multiple of control_rate.",
        10,
        high=1e5,
        derived="control_rate: its first multiple from 1000",
    ),
    Parameter(
        name="gravity",
        kind=Kind.DOUBLES,
        default=list(default_of(SimulationConfig, "gravity")),
        description="Gravity along the world's x, y, z, m/s².",
        low=-1000.0,
        high=1000.0,
        length=3,
    ),
    flag("base_fixed", default_of(SimulationConfig, "base_fixed"), "The base link cannot move."),
)


BOARD_BY_NAME = {parameter.name: parameter for parameter in BOARD}
JOINT_BY_NAME = {parameter.name: parameter for parameter in JOINT}


def find_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a full parameter name, None where there is none."""
    if name in BOARD_BY_NAME:
        return BOARD_BY_NAME[name]
    for owner in (JOINT_DEFAULTS, *joints):
        if name.startswith(owner + "."):
            row = JOINT_BY_NAME.get(name[len(owner) + 1 :])
            if row is not None:
                return row
    return None


def rows() -> Iterator[tuple[str, str, str, str, bool, str]]:
    """The parameter reference: name, type, default, range, changes at run time, description."""
    for prefix, table in (("", BOARD), ("<joint>.", JOINT)):
        for row in table:
            default = row.derived and f"from {row.derived}" if row.default is None else row.default
            yield (
                prefix + row.name,
                str(row.kind),
                _written(default),
                row.range_text,
                row.run_time,
                row.description,
            )


def _written(value: Any) -> str:
    """A value as YAML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_written, value)) + "]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
