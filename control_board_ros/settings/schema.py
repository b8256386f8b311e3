# SPDX-License-Identifier: Apache-2.0
"""Every parameter by its full name: those of the node here, the others from the configurations.

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
from ..core.terms.vocabs import YARP_4_PWM, ControlMode, Vocab
from ..sim.config import JointSimulation, SimulationConfig
from .couplings import coupling_row
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

#: Pattern of a ROS name: /arm, ~/arm, arm, ~.
ROS_NAME = r"~/?|(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"
#: Parameters of the node only.
NODE = (
    Parameter(
        name="robot",
        kind=Kind.STRING,
        default="iiwa",
        text="Robot: iiwa, panda, icub, panda_pair, iiwa_gripper, icub_left_arm, icub_right_arm, "
        "icub_hand, icub_hand_mk3, icub_hands, or the path of a URDF or xacro file; of a xacro "
        "file arguments may follow, name:=value",
    ),
    Parameter(
        name="robot_name",
        kind=Kind.STRING,
        default="",
        text="Prefix of the names of a robot's nodes, where it has parts; empty: as robot",
        pattern=r"([A-Za-z][A-Za-z0-9_]*)?",
        form="a name of letters, digits and _",
    ),
    Parameter(
        name="startup_levels",
        kind=Kind.STRINGS,
        default=[],
        text='Start-up levels in order, each "part,part,…"; other parts are last',
    ),
    Parameter(
        name="joint_prefix",
        kind=Kind.STRING,
        default="",
        text="Prefix of every joint name; parameter files name joints without it",
        pattern=r"[A-Za-z0-9_]*",
        form="letters, digits and _",
    ),
    Parameter(
        name="frame_prefix",
        kind=Kind.STRING,
        default="",
        text="Prefix of every frame name in /tf, as of robot_state_publisher",
    ),
    Parameter(
        name="joints",
        kind=Kind.STRINGS,
        default=[],
        text="Joints of the board in its order; empty: all movable joints",
    ),
    Parameter(
        name="plant",
        kind=Kind.STRING,
        default="",
        text="Plant driven by the board, by its registered name; empty: the simulation",
    ),
    Parameter(
        name="plant_arguments",
        kind=Kind.STRINGS,
        default=[],
        text="Arguments of the plant, name=value each",
    ),
    Parameter(
        name="plant_timeout",
        kind=Kind.DOUBLE,
        default=0.1,
        text="Response timeout: without an answer of the plant its joints fault; without "
        "commands for this time plus three cycles the plant disables the motors",
        unit="s",
        low=0.001,
        high=60.0,
    ),
    Parameter(
        name="plant_process",
        kind=Kind.BOOL,
        default=True,
        text="Run the plant in a separate process, which disables the motors also when the "
        "board's process stops, hangs or ends; false: in a thread of the board's",
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
        text="Niceness of the node, where permitted (root); not at real_time_factor 0",
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
        text="Managed node: its transitions configure the board and enable power",
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
        name="pwm_name",
        kind=Kind.STRING,
        default=ControlMode.OPENLOOP.code,
        text="Name of OPENLOOP in answers of ~/get_control_mode: open, as in YARP 3, or ipwm, as "
        "YARP 4 reads back",
        choices={name: name for name in (ControlMode.OPENLOOP.code, YARP_4_PWM)},
    ),
    Parameter(
        name="yarp_msgs_name",
        kind=Kind.STRING,
        default="~",
        text="Namespace of YARP's topics and services, msgs_name in YARP; empty: none",
        pattern=rf"(?=.{{0,200}}$)({ROS_NAME})?",
        form="a ROS name such as /icub/left_arm, or '~' for the node's own",
    ),
)


def rows_of(made: type) -> Iterator[Parameter]:
    """The parameters of a configuration and of its parts; defaults as in YAML."""
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
    """A bound, with the full name where it is a parameter."""
    return f"{part}.{bound}" if isinstance(bound, str) and "." not in bound else bound


def _plain(value: Any) -> Any:
    """A default as in a parameter file: codes for modes, lists for tuples."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value.code if isinstance(value, Vocab) else value


BOARD = (*NODE, *rows_of(BoardConfig), *rows_of(SimulationConfig))
JOINT = (*rows_of(JointConfig), *rows_of(JointSimulation))
BOARD_BY_NAME = {row.name: row for row in BOARD}
#: Robots of several parts: parameters of each part, and of the robot's own node.
PART_ONLY = ("allow_partial_joints_goal", "constraints.")
PART_ROWS = tuple(r for r in BOARD if r.name.startswith(("joints", "calibration_", *PART_ONLY)))
ROBOT_ROWS = tuple(row for row in BOARD if not row.name.startswith(PART_ONLY))
JOINT_BY_NAME = {row.name: row for row in JOINT}


def find_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a full parameter name; None if unknown."""
    if name in BOARD_BY_NAME:
        return BOARD_BY_NAME[name]
    if (row := coupling_row(name) or pose_row(name, joints)) is not None:
        return row
    for owner in (JOINT_DEFAULTS, *joints):
        if name.startswith(owner + "."):
            row = JOINT_BY_NAME.get(name[len(owner) + 1 :])
            if row is not None:
                return row
    return None
