# SPDX-License-Identifier: Apache-2.0
"""cbctl param; ``save`` writes a parameter file that starts the same board or robot again.

The parameters of a robot of several parts go into one section, which all its nodes read.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from control_board_ros.text import nearest
from control_board_ros.whole_file import write_whole, yaml_text, yaml_value

from ..board.session import Session
from ..line.arguments import argument, with_arguments
from ..line.offers import joints
from ..line.words import Refused, UsageError, find_joint
from ..text.output import DONE, conclude, show

#: Prefixes of parameters of rclpy itself, which are not saved.
OF_RCLPY = ("qos_overrides.", "start_type_description_service", "use_sim_time")
#: The section that every node of a robot reads, and the name of the robot's own node.
SECTION, ROBOT = "control_board", "robot"
JOINTS, PARTS, DEFAULTS = "joints", "parts.", "joint_defaults."
#: Without these, the same file would start another robot.
IDENTITY = ("robot", "joint_prefix", PARTS)

Values = dict[str, Any]


@dataclass(frozen=True, slots=True)
class SavedFile:
    """The content of a parameter file, and how to start it.

    Attributes: section (name of the node, or one for all nodes of a robot), values (by name),
    renaming (ROS arguments: the names of nodes), left_out (what a file cannot hold).
    """

    section: str
    values: Values
    renaming: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def gather(session: Session) -> SavedFile:
    """All parameters of a board; of a robot of several parts, those of its parts, too.

    Raises:
        BoardTimeout: the robot, or a part of it, does not answer.
    """
    values, board = all_values(session), session.client.board_name
    folder, _, name = board.rpartition("/")
    if any(key.startswith(PARTS) for key in values):
        parts = [k.removeprefix(PARTS) for k in values if k.startswith(PARTS) and values[k]]
        with ExitStack() as stack:
            beside = {p: stack.enter_context(session.beside(f"{folder}/{p}")) for p in parts}
            part_values = {part: all_values(part_session) for part, part_session in beside.items()}
        return of_robot(folder, values, part_values)
    if "robot" not in values:
        with session.beside(f"{folder}/{ROBOT}") as whole:
            return of_one_part(folder, values, all_values(whole))
    renaming = [f"-r __ns:={folder}"] * bool(folder) + [f"-r __node:={name}"] * (name != SECTION)
    return SavedFile(board, values, renaming)


def of_robot(folder: str, robot: Values, parts: Mapping[str, Values]) -> SavedFile:
    """The file of a whole robot.

    Args:
        folder: namespace of its nodes.
        robot: parameters of its own node.
        parts: parameters of the nodes of its parts.
    """
    values = {name: v for name, v in robot.items() if name != JOINTS and not of_all(name)}
    left_out = []
    for part in parts.values():
        values |= of_joints(part)
    for name in sorted({name for part in parts.values() for name in part} - set(values)):
        if name == JOINTS or of_all(name):
            continue
        part_values = {part: shown[name] for part, shown in parts.items() if name in shown}
        first = next(iter(part_values.values()))
        if all(value == first for value in part_values.values()):
            values[name] = first
        else:
            each = ", ".join(f"{part} {value}" for part, value in part_values.items())
            left_out.append(f"{name}, which has one value for all parts in a file: {each}")
    return SavedFile(SECTION, in_order(values, robot[JOINTS]), above(folder), left_out)


def of_one_part(folder: str, part: Values, robot: Values) -> SavedFile:
    """The file of a part's joints; it starts the whole robot, the other parts as configured.

    Args:
        folder: namespace of the robot's nodes.
        part: parameters of the part's node.
        robot: parameters of the robot's node.
    """
    identity = {name: v for name, v in robot.items() if name.startswith(IDENTITY)}
    values = in_order(identity | of_joints(part), robot[JOINTS])
    return SavedFile(SECTION, values, above(folder))


def in_order(values: Values, joints: Sequence[str]) -> Values:
    """Parameters by name, but parts in the order of the robot's joints."""
    place = {joint: k for k, joint in enumerate(joints)}

    def key(name: str) -> tuple[str, int, str]:
        if not name.startswith(PARTS):
            return name, 0, ""
        return PARTS, place[values[name][0]] if values[name] else len(place), name

    return {name: values[name] for name in sorted(values, key=key)}


def of_joints(values: Values) -> Values:
    """The parameters of a part's joints; its poses are shares of the robot's."""
    owners = tuple(f"{joint}." for joint in values[JOINTS])
    return {name: value for name, value in values.items() if name.startswith(owners)}


def of_all(name: str) -> bool:
    """Whether a parameter is one of all joints; in a file it would act on those of other parts."""
    return name.startswith(DEFAULTS)


def above(folder: str) -> list[str]:
    """The argument for the namespace above a robot's name, if any."""
    parent = folder.rpartition("/")[0]
    return [f"-r __ns:={parent}"] * bool(parent)


def all_values(session: Session) -> Values:
    names = [n for n in session.client.list_parameters() if not n.startswith(OF_RCLPY)]
    values = session.client.get_parameters(names)
    return {name: plain(value) for name, value in values.items() if value is not None}


def plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


@with_arguments(
    argument(
        "words",
        nargs="+",
        metavar="show|set|save [NAME…]",
        help="show [PART…], set NAME=VALUE…, or save FILE [PART…].",
        offers=lambda typed: joints(typed) if typed.before else ("show", "set", "save"),
    )
)
def param(session: Session, words: list[str]) -> int:
    """Show parameters, set them, or save them to a file that control_board reads.

    A name may begin with a short joint name: joint_1.limits.upper. A part of a name selects
    all parameters that contain it.
    """
    doing, *rest = words
    if doing == "show":
        values = read_parameters(session, rest)
        show(session, values, lambda: lines(values))
        return DONE
    if doing == "set" and rest:
        return conclude(session, *assign(session, rest))
    if doing == "save" and rest:
        return save(session, Path(rest[0]), rest[1:])
    raise UsageError("write param show [PART…], param set NAME=VALUE…, or param save FILE [PART…]")


def read_parameters(session: Session, parts: list[str]) -> dict[str, Any]:
    """Values by name of the parameters that contain one of the parts; none: all."""
    names = [n for n in session.client.list_parameters() if not n.startswith(OF_RCLPY)]
    held = holding(parts, names, session.names)
    return {name: plain(value) for name, value in session.client.get_parameters(held).items()}


def holding(parts: list[str], names: list[str], joints: tuple[str, ...]) -> list[str]:
    """The names that contain one of the parts; none: all.

    Raises:
        Refused: no such name.
    """
    full_names = [full_name(part, names, joints) for part in parts]
    matches = [n for n in names if not full_names or any(part in n for part in full_names)]
    if not matches:
        words = {word for name in names for word in name.split(".")}
        hint = nearest(parts[0], words)
        raise Refused(
            f"no parameter contains {' or '.join(map(repr, parts))}{hint}; try: cbctl param show"
        )
    return matches


def full_name(word: str, names: list[str], joints: tuple[str, ...]) -> str:
    """A name whose joint may be short or an index: ``1.limits`` as ``…joint_2.limits``."""
    joint, dot, field = word.partition(".")
    if not dot or any(name == word or name.startswith(f"{joint}.") for name in names):
        return word
    return ".".join((*find_joint(joint, joints)[:1], field))


def assign(session: Session, words: list[str]) -> tuple[Any, str]:
    """Set ``NAME=VALUE`` words, all or none; returns the reply, and the report."""
    names = session.client.list_parameters()
    values = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name:
            raise UsageError(f"{word[:60]!r} is not valid; write NAME=VALUE")
        try:
            values[full_name(name, names, session.names)] = yaml_value(text)
        except yaml.YAMLError:
            raise UsageError(f"value {text[:40]!r} is no YAML; quote it") from None
    reply = session.client.set_parameters(values)
    return reply, lines(values)


def save(session: Session, path: Path, parts: list[str]) -> int:
    """Write a parameter file that starts the same board, or the same robot of several parts."""
    saved = gather(session)
    selected = holding(parts, list(saved.values), session.names)
    values = {n: v for n, v in saved.values.items() if n in selected or n.startswith(IDENTITY)}
    node = {saved.section: {"ros__parameters": values}}
    try:
        write_whole(path, yaml_text(node))
    except OSError as error:
        raise Refused(f"cannot write {path}: {error.strerror}; give another file") from None
    command = " ".join(
        ["control_board --ros-args", *saved.renaming, "--params-file", shlex.quote(str(path))]
    )
    result = {
        "success": True,
        "file": str(path),
        "parameters": len(values),
        "left_out": saved.left_out,
        "command": command,
    }
    text = [f"{len(values)} parameters in {path}; start with: {command}"]
    show(session, result, lambda: "\n".join([*(f"left out: {o}" for o in saved.left_out), *text]))
    return DONE


def lines(values: dict[str, Any]) -> str:
    return "\n".join(f"{name}: {value}" for name, value in values.items())
