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
from .parts import part_row
from .poses import pose_row

JOINT_DEFAULTS = "joint_defaults"

#: Plants of the box that move a simulated body, by the beginning of their names.
VIRTUAL = "virtual/"
#: Default of plant_timeout, s; virtual drives have no motor to protect from a busy computer.
PLANT_TIMEOUT, VIRTUAL_TIMEOUT = 0.1, 1.0

#: Pattern of a ROS name: /arm, ~/arm, arm, ~.
ROS_NAME = r"~/?|(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"


def _row(name: str, default: Any, text: str, unit: str = "", **more: Any) -> Parameter:
    """A parameter of the node, of its default's kind; one that is derived has none."""
    kind, default = KINDS[type(default)], None if "derived" in more else default
    return Parameter(name=name, kind=kind, default=default, text=text, unit=unit, **more)


KINDS = {
    bool: Kind.BOOL,
    int: Kind.INTEGER,
    float: Kind.DOUBLE,
    str: Kind.STRING,
    list: Kind.STRINGS,
}
#: Parameters of the node only.
NODE = (
    _row(
        "robot",
        "iiwa",
        "Robot: iiwa, panda, icub, panda_pair, iiwa_gripper, icub_left_arm, icub_right_arm, "
        "icub_hand, icub_hand_mk3, icub_hands, or the path of a URDF or xacro file; xacro "
        "arguments follow the path, name:=value",
    ),
    _row(
        "robot_name",
        "",
        "Prefix of the node names of a robot with parts; empty: from robot",
        pattern=r"([A-Za-z][A-Za-z0-9_]*)?",
        form="a name of letters, digits and _",
    ),
    _row(
        "startup_levels",
        [],
        'Start-up levels in order, each "part,part,…"; unlisted parts start last',
    ),
    _row(
        "joint_prefix",
        "",
        "Prefix of every joint name; parameter files omit the prefix",
        pattern=r"[A-Za-z0-9_]*",
        form="letters, digits and _",
    ),
    _row("frame_prefix", "", "Prefix of every frame name in /tf, as of robot_state_publisher"),
    _row("joints", [], "Joints of the board in its order; empty: all movable joints"),
    _row("plant", "", "Plant driven by the board, by its registered name; empty: the simulation"),
    _row("plant_arguments", [], "Arguments of the plant, name=value each"),
    _row(
        "plant_timeout",
        PLANT_TIMEOUT,
        "Response timeout: without a response of the plant the joints fault; without "
        "commands for this time plus three cycles the plant disables the motors",
        "s",
        low=0.001,
        high=60.0,
        derived=f"the plant: {PLANT_TIMEOUT}; virtual drives: {VIRTUAL_TIMEOUT}",
    ),
    _row(
        "plant_process",
        True,
        "Run the plant in a separate process, which disables the motors also when the "
        "board's process stops, hangs or ends; false: in a thread of the board's process",
    ),
    _row(
        "state_rate",
        100.0,
        "Rate of joint_states and ~/state",
        "Hz",
        low=0.1,
        high=1000.0,
        run_time=True,
    ),
    _row(
        "timing",
        False,
        "Time the phases of each control cycle, for /diagnostics and cbctl watch --timing",
        run_time=True,
    ),
    _row(
        "real_time_factor",
        1.0,
        "Simulated seconds per second; 0: as fast as every state can be published",
        low=0.001,
        or_zero=True,
        high=1000.0,
        run_time=True,
    ),
    _row(
        "realtime_priority",
        0,
        "SCHED_FIFO priority of the node, 0: none; needs CAP_SYS_NICE",
        low=0,
        high=98,
    ),
    _row(
        "niceness",
        -20,
        "Niceness of the node, where permitted (root); not at real_time_factor 0",
        low=-20,
        high=19,
    ),
    _row("publish_clock", False, "Publish /clock, also at real_time_factor 1"),
    _row("publish_tf", False, "Publish /tf and /tf_static, in place of robot_state_publisher"),
    _row(
        "lifecycle",
        False,
        "Managed node: lifecycle transitions configure the board and enable power",
    ),
    _row("autostart", True, "Configure and activate a managed node at start"),
    _row("allow_fault_injection", False, "Offer ~/inject_fault; for tests, in simulation"),
    _row(
        "park_on_exit",
        False,
        "Move to the pose park on SIGINT or SIGTERM, then exit; a second signal exits immediately",
    ),
    _row(
        "yarp_interface",
        False,
        "Offer the topics and services of YARP's controlBoard_nws_ros2",
    ),
    _row(
        "pwm_name",
        ControlMode.OPENLOOP.code,
        "Name of OPENLOOP in answers of ~/get_control_mode: open (YARP 3) or ipwm (YARP 4)",
        choices={name: name for name in (ControlMode.OPENLOOP.code, YARP_4_PWM)},
    ),
    _row(
        "yarp_msgs_name",
        "~",
        "Namespace of YARP's topics and services, msgs_name in YARP; empty: none",
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
PART_ONLY = ("allow_partial_joints_goal", "constraints.", "out_of_range")
PART_ROWS = tuple(r for r in BOARD if r.name.startswith(("joints", "calibration_", *PART_ONLY)))
ROBOT_ROWS = tuple(row for row in BOARD if not row.name.startswith(PART_ONLY))
JOINT_BY_NAME = {row.name: row for row in JOINT}


def table_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a parameter of a coupling, a pose or a part; None for other names."""
    return coupling_row(name) or pose_row(name, joints) or part_row(name)


def find_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a full parameter name; None if unknown."""
    if (row := BOARD_BY_NAME.get(name) or table_row(name, joints)) is not None:
        return row
    for owner in (JOINT_DEFAULTS, *joints):
        if name.startswith(owner + "."):
            row = JOINT_BY_NAME.get(name[len(owner) + 1 :])
            if row is not None:
                return row
    return None
