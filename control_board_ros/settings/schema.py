# SPDX-License-Identifier: Apache-2.0
"""Every parameter by its full name: those of the node here, all others from the configurations.

The settings, the ROS declarations and docs/parameters.md come from here. Parameters of the board
and of its plant have plain names; those of a joint are written as ``<joint>.limits.lower`` for one
joint, or as ``joint_defaults.limits.lower`` for all.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from ..core.config.config import BoardConfig, JointConfig
from ..core.config.parameter import Bound, Kind, Parameter, parameters_of, parts_of
from ..core.terms.vocabs import Vocab
from ..sim.config import JointSimulation, SimulationConfig
from .poses import pose_row

__all__ = [
    "BOARD",
    "BOARD_BY_NAME",
    "JOINT",
    "JOINT_BY_NAME",
    "JOINT_DEFAULTS",
    "PART_ROWS",
    "ROBOT_ROWS",
    "Kind",
    "Parameter",
    "find_row",
]

JOINT_DEFAULTS = "joint_defaults"

#: A name on ROS: /arm, ~/arm, arm, ~.
ROS_NAME = r"~/?|(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"
#: What only the node must know.
NODE = (
    Parameter(
        name="robot",
        kind=Kind.STRING,
        default="iiwa",
        text="Robot: iiwa, panda, icub, panda_pair, iiwa_gripper, icub_left_arm, icub_right_arm, "
        "or the path of a URDF or xacro file; of a xacro file arguments may follow, name:=value",
    ),
    Parameter(
        name="robot_name",
        kind=Kind.STRING,
        default="",
        text="What the names of a robot's nodes begin with, where it has parts; empty: as robot",
        pattern=r"([A-Za-z][A-Za-z0-9_]*)?",
        form="a name of letters, digits and _",
    ),
    Parameter(
        name="startup_levels",
        kind=Kind.STRINGS,
        default=[],
        text='Parts that start up together, level after level: each "part,part,…"; the others '
        "last",
    ),
    Parameter(
        name="joint_prefix",
        kind=Kind.STRING,
        default="",
        text="Put before the name of every joint; parameter files name joints without it",
        pattern=r"[A-Za-z0-9_]*",
        form="letters, digits and _",
    ),
    Parameter(
        name="frame_prefix",
        kind=Kind.STRING,
        default="",
        text="Put before the name of every frame in /tf, as by robot_state_publisher",
    ),
    Parameter(
        name="joints",
        kind=Kind.STRINGS,
        default=[],
        text="Joints of the board in its order; empty: all that move",
    ),
    Parameter(
        name="plant",
        kind=Kind.STRING,
        default="",
        text="What the board drives: the name of somebody else's plant; empty: the simulation",
    ),
    Parameter(
        name="plant_arguments",
        kind=Kind.STRINGS,
        default=[],
        text="For that plant, name=value each",
    ),
    Parameter(
        name="plant_timeout",
        kind=Kind.DOUBLE,
        default=0.1,
        text="A plant that does not answer for so long is a fault of its joints; one that hears "
        "nothing of the control loop for so long, and three cycles, takes the power off",
        unit="s",
        low=0.001,
        high=60.0,
    ),
    Parameter(
        name="plant_process",
        kind=Kind.BOOL,
        default=True,
        text="That plant runs in a process of its own, which takes the power off also when the "
        "board's is stopped, hangs or ends; false: in a thread of the board's",
    ),
    Parameter(
        name="state_rate",
        kind=Kind.DOUBLE,
        default=100.0,
        text="Rate of joint_states and ~/state",
        unit="Hz",
        low=0.1,
        high=1000.0,
        run_time=True,
    ),
    Parameter(
        name="real_time_factor",
        kind=Kind.DOUBLE,
        default=1.0,
        text="Simulated seconds per second; 0: as fast as every state can be published",
        low=0.001,
        or_zero=True,
        high=1000.0,
        run_time=True,
    ),
    Parameter(
        name="realtime_priority",
        kind=Kind.INTEGER,
        default=0,
        text="SCHED_FIFO priority of the node, 0: none; needs CAP_SYS_NICE",
        low=0,
        high=98,
    ),
    Parameter(
        name="niceness",
        kind=Kind.INTEGER,
        default=-20,
        text="Niceness of the node where it is granted, as to root; not at real_time_factor 0",
        low=-20,
        high=19,
    ),
    Parameter(
        name="publish_clock",
        kind=Kind.BOOL,
        default=False,
        text="Publish /clock, also at real_time_factor 1",
    ),
    Parameter(
        name="publish_tf",
        kind=Kind.BOOL,
        default=False,
        text="Publish /tf and /tf_static, in place of robot_state_publisher",
    ),
    Parameter(
        name="lifecycle",
        kind=Kind.BOOL,
        default=False,
        text="Be a managed node: its transitions configure the board and allow power",
    ),
    Parameter(
        name="autostart",
        kind=Kind.BOOL,
        default=True,
        text="A managed node configures and activates itself at its start",
    ),
    Parameter(
        name="allow_fault_injection",
        kind=Kind.BOOL,
        default=False,
        text="Offer ~/inject_fault; for tests, in simulation",
    ),
    Parameter(
        name="park_on_exit",
        kind=Kind.BOOL,
        default=False,
        text="Go to the pose park at the first SIGINT or SIGTERM, then end; a second one ends "
        "at once",
    ),
    Parameter(
        name="yarp_interface",
        kind=Kind.BOOL,
        default=False,
        text="Offer the topics and services of YARP's controlBoard_nws_ros2, too",
    ),
    Parameter(
        name="yarp_msgs_name",
        kind=Kind.STRING,
        default="~",
        text="What YARP's topics and services are below, as msgs_name there; empty: offer none",
        pattern=rf"(?=.{{0,200}}$)({ROS_NAME})?",
        form="a ROS name such as /icub/left_arm, or '~' for the node's own",
    ),
)


def rows_of(made: type) -> Iterator[Parameter]:
    """The parameters of a configuration and of its parts; defaults as YAML has them."""
    for row in parameters_of(made):
        yield replace(row, default=None if row.derived else _plain(row.default))
    for part in parts_of(made):
        for row in parameters_of(part.made):
            derived = part.derived.get(row.name, row.derived)
            default = _plain(getattr(part.in_files, row.name, row.default))
            yield replace(
                row,
                name=f"{part.name}.{row.name}",
                text=part.text + row.text,
                unit=part.units.get(row.name, row.unit),
                derived=derived,
                default=None if derived else default,
                low=_full(row.low, part.name),
                high=_full(row.high, part.name),
                above=None if row.above is None else _full(row.above, part.name),
            )


def _full(bound: Bound, part: str) -> Bound:
    """A bound with the full name of the parameter that it is."""
    return f"{part}.{bound}" if isinstance(bound, str) and "." not in bound else bound


def _plain(value: Any) -> Any:
    """A default as a parameter file has it: modes by their codes, lists."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value.code if isinstance(value, Vocab) else value


BOARD = (*NODE, *rows_of(BoardConfig), *rows_of(SimulationConfig))
JOINT = (*rows_of(JointConfig), *rows_of(JointSimulation))
BOARD_BY_NAME = {row.name: row for row in BOARD}
#: Of a robot of several parts: what belongs to each part, and what its own node shows.
PART_ONLY = ("allow_partial_joints_goal", "constraints.")
PART_ROWS = tuple(r for r in BOARD if r.name.startswith(("joints", "calibration_", *PART_ONLY)))
ROBOT_ROWS = tuple(row for row in BOARD if not row.name.startswith(PART_ONLY))
JOINT_BY_NAME = {row.name: row for row in JOINT}


def find_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a full parameter name, None where there is none."""
    if name in BOARD_BY_NAME:
        return BOARD_BY_NAME[name]
    if (row := pose_row(name, joints)) is not None:
        return row
    for owner in (JOINT_DEFAULTS, *joints):
        if name.startswith(owner + "."):
            row = JOINT_BY_NAME.get(name[len(owner) + 1 :])
            if row is not None:
                return row
    return None
