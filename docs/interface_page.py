# SPDX-License-Identifier: Apache-2.0
"""The page docs/interface.md, the names on ROS, and the site's page of their fields.

Names, types, QoS and meaning come from control_board_ros/interface.py, fields and theirs from
msg_defs/, and which mode accepts what from the table of the core.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from control_board_ros.core.terms.modes import modes_accepting
from control_board_ros.interface import (
    ACTIONS,
    COMMAND_TOPICS,
    LATCHED,
    LIFECYCLE,
    PUBLISHED,
    SERVICES,
    STREAM,
    Endpoint,
)

ROOT = Path(__file__).resolve().parents[1]
PARTS = {
    "msg": ("Message",),
    "srv": ("Request", "Response"),
    "action": ("Goal", "Result", "Feedback"),
}
TITLES = {"msg": "Messages", "srv": "Services", "action": "Actions"}

INTRODUCTION = """\
Names that begin with `~` are below the node's name (`/control_board` by
default), others below its namespace; all can be remapped. Units are rad, rad/s and N·m; sliding
joints use m, m/s and N. Every request and command selects its joints by `names`; empty means all.
Modes are written as code (`pos`) or long name (`POSITION`). Every response begins with `success`
and `message`: joint, request, cause of the failure, and the valid values.

A link leads to the fields of a type of `control_board_msgs`, with units; where none is named, it
is as the service: `SetControlMode` of `set_control_mode`. The [site](install.md) has all.
"""

PUBLISHED_TEXT = """\
QoS is {usual} where nothing else is said. *Latched*: reliable, transient local, depth 1.
"""

COMMANDS = """\
Commands have no answer. One that a joint's mode does not accept is ignored, counted in
`rejected_commands` of `~/state`, and logged once a second. QoS: {qos}; `qos_overrides` parameters
change it.
"""


TRAJECTORIES = """\
`~/joint_trajectory` and `~/follow_joint_trajectory` have the meaning of ros2_controllers'
joint_trajectory_controller ([T1](spec.md#t1) to [T5](spec.md#t5)), joint by joint:

- Segments are linear with positions only, cubic with velocities, quintic with accelerations. A
  field is present at every point or at none; times increase; the last point is at rest. An invalid
  trajectory is refused as a whole, counted in `rejected_commands`, and the log names the point.
- `header.stamp` is the start; 0 means now. Until a start in the future the present motion goes on;
  of a start in the past, past points are dropped.
- It starts at the reference in force, with its velocity, unless its first point has the time of
  the start, and replaces the motion of its joints only. Software limits bound it, with a line in
  the log.
- On the topic, joints in another mode are counted and logged, the others follow; the action
  refuses the whole goal. With `allow_partial_joints_goal: false`, both require all joints.
- It ends for a joint that is stopped, changes a mode, faults, or receives another direct position;
  for all of its joints with a message without points.

The action adds:

- One goal at a time: a new one aborts the old with INVALID_GOAL. Joints in both continue until the
  new one starts; the others stop, as at every failure, within their acceleration limits.
- `path_tolerance` is checked in every cycle until the last point, then `goal_tolerance`, for
  `goal_time_tolerance` (0: unlimited). 0 selects the default, a negative number removes the limit.
  Defaults: `<joint>.constraints.trajectory` and `.goal`,
  `constraints.stopped_velocity_tolerance`, `constraints.goal_time`. Accelerations are not checked.
- Feedback, 20 times a second, has desired, actual and error of all joints in the board's order.
- A refused goal is accepted and aborts at once, so that its result can state the reason
  ([why](decisions/0018-a-refused-goal-says-why.md)).

"""

JOINT_COMMANDS_TEXT = """\
Each joint uses the array of its control mode (`position` in POSITION, POSITION_DIRECT and MIXED,
`velocity` in VELOCITY and MIXED, `effort` in TORQUE; in MIXED a position before a velocity). An
array is empty, or has one number per joint; a shorter one has the joints, in order, whose mode
accepts it, and is refused where their number differs ([ros2_control](howto/ros2_control.md)).
"""

#: Error codes of ~/follow_joint_trajectory.
CODES = (
    ("0 SUCCESSFUL", "reached; or cancelled, with the status CANCELED"),
    (
        "−1 INVALID_GOAL",
        "wrong points or tolerances; joints in another mode, or one left it; preempted; effort, "
        "or joints of several degrees of freedom",
    ),
    (
        "−2 INVALID_JOINTS",
        "an unknown joint, one named twice; some missing, with `allow_partial_joints_goal: false`",
    ),
    ("−3 OLD_HEADER_TIMESTAMP", "the last point is past"),
    ("−4 PATH_TOLERANCE_VIOLATED", "beyond a tolerance on the path; the joints stop"),
    ("−5 GOAL_TOLERANCE_VIOLATED", "beyond a tolerance after the goal time; the joints stop"),
)

MANAGED = """\
With `lifecycle: true` the node is a managed one ([why
so](decisions/0018-a-refused-goal-says-why.md)). It becomes active at its start; with `autostart:
false` it waits. It publishes its topics in every state; unless it is active, requests that need
power are refused with the reason.

| transition | resulting state | joints |
|---|---|---|
| (start) | unconfigured | NOT_CONFIGURED |
| configure | inactive | IDLE, without power |
| activate | active | calibrate, or enter the `startup_mode`, or the mode of the calibrator |
| deactivate | inactive | IDLE at once, without power; a calibration is aborted |
| cleanup | unconfigured | NOT_CONFIGURED: a power-on |
| shutdown | finalized | NOT_CONFIGURED, permanently: the process waits for its SIGINT |

A joint in HW_FAULT stays there until FORCE_IDLE or cleanup. `~/configure` is refused while the
node is unconfigured; `~/power_cycle` and `~/reset` return the joints to what the state allows. The
log has the possible transitions where one is refused.

"""

TIME = """\
Stamps never go backwards, and their distances are those of the readings. At `real_time_factor` 1
they are the system's time; with another factor at the start, or with `publish_clock` or
`use_sim_time`, they are simulated time, published on `/clock`. A factor set at run time changes
the pace without a jump, and `/clock` is published from then on
([why](decisions/0014-one-time-base.md)).

"""

#: Heads the page that only the site has.
FIELDS = """\
# Fields of the messages

The definitions of `control_board_msgs`, as `ros2 interface show` prints them: messages, services
and actions of [the ROS interface](../interface.md).
"""


@dataclass
class Definition:
    """One interface file: its text, and its parts, each rows (name, type, text)."""

    package: str
    kind: str
    name: str
    about: str = ""
    parts: list[list[tuple[str, str, str]]] = field(default_factory=lambda: [[]])

    @property
    def title(self) -> str:
        return f"{self.name}.{self.kind}"

    @property
    def path(self) -> str:
        """Its file, from the root of the project."""
        return f"msg_defs/{self.kind}/{self.title}"


def read(path: Path) -> Definition:
    """Read an interface file; a field's text is the comment right above it."""
    made = Definition("control_board_msgs", path.parent.name, path.stem)
    comment: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            comment.append(line.removeprefix("#").strip())
            continue
        text = " ".join(comment)
        comment = []
        if line == "---":
            made.parts.append([])
        elif line:
            kind, name = line.split()
            made.parts[-1].append((name, kind, text))
        elif text and not any(made.parts):
            made.about = text
    return made


def definitions() -> dict[str, Definition]:
    """All of them, by the full name of their type."""
    files = sorted(path for kind in TITLES for path in (ROOT / "msg_defs" / kind).iterdir())
    return {f"control_board_msgs/{p.parent.name}/{p.stem}": read(p) for p in files}


def meaning(endpoint: Endpoint) -> str:
    """The purpose of an endpoint, and for a command its modes."""
    if endpoint.reference is None:
        return endpoint.meaning
    modes = ", ".join(mode.name for mode in modes_accepting(endpoint.reference))
    return f"{endpoint.meaning} Accepted in {modes}."


def qos(endpoint: Endpoint) -> str:
    """What is said of an endpoint's QoS: nothing of the usual one."""
    if endpoint.kind != "topic" or endpoint.qos in (STREAM, LATCHED):
        return "Latched. " if endpoint.qos == LATCHED else ""
    found = str(endpoint.qos)
    return f"{found[0].upper()}{found[1:]}. "


def page() -> str:
    """The page of names."""
    known = definitions()

    def link(endpoint: Endpoint) -> str:
        ours = known.get(endpoint.type)
        package, _, kind = endpoint.type.split("/")
        if ours is None:
            return f"`{endpoint.name}`, {package}/{kind}"
        if ours.name == endpoint.short.title().replace("_", ""):
            return f"[`{endpoint.name}`](../{ours.path})"
        return f"`{endpoint.name}`, [{ours.name}](../{ours.path})"

    def rows(endpoints: Iterable[Endpoint]) -> list[str]:
        return [f"- {link(e)}: {qos(e)}{meaning(e)}" for e in endpoints]

    lines = ["# The ROS interface", "", INTRODUCTION]
    lines += ["## Published", "", PUBLISHED_TEXT.format(usual=STREAM)]
    lines += rows(PUBLISHED)
    lines += ["", "## Command topics", "", COMMANDS.format(qos=STREAM)]
    lines += rows(COMMAND_TOPICS)
    for title, endpoints in (("Services", SERVICES), ("Actions", ACTIONS)):
        lines += ["", f"## {title}", "", *rows(endpoints)]
    lines += ["", "## Trajectories", "", TRAJECTORIES.rstrip("\n"), ""]
    lines += [
        *header("error code", "when; `error_string` says which joint, by how much, what to do")
    ]
    lines += [row(*code) for code in CODES]
    lines += ["", "## Joint commands", "", JOINT_COMMANDS_TEXT.rstrip("\n")]
    names = ", ".join(f"`{e.name}`" for e in LIFECYCLE)
    lines += ["", "## Managed nodes", "", f"{MANAGED}Names of lifecycle_msgs: {names}."]
    lines += ["", "## Time", "", TIME.rstrip("\n")]
    return "\n".join(lines) + "\n"


def fields() -> str:
    """The page of the definitions, for the site."""
    return "\n".join([FIELDS, *("\n".join([*section(d), ""]) for d in definitions().values())])


def section(definition: Definition) -> list[str]:
    """One definition: its text and its fields."""
    lines = [f"## {definition.title}", "", definition.about]
    for title, rows in zip(PARTS[definition.kind], definition.parts, strict=True):
        lines += ["", *header("field" if title == "Message" else title, "type", "meaning")]
        lines += [row(f"`{name}`", f"`{kind}`", text) for name, kind, text in rows]
    return lines


def header(*titles: str) -> list[str]:
    return [row(*titles), "|" + "---|" * len(titles)]


def row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
