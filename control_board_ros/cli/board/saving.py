# SPDX-License-Identifier: Apache-2.0
"""What ``cbctl param save`` writes: a parameter file that starts the same board or robot again.

A robot of several parts is one in its file, too: what its node and those of its parts show goes
into one section, which each of them reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

from .session import Session

#: Beginnings of names that rclpy has of itself: no file of ours need hold them.
OF_RCLPY = ("qos_overrides.", "start_type_description_service", "use_sim_time")
#: The section that every node of a robot reads, and the name of the robot's own node.
SECTION, ROBOT = "control_board", "robot"
JOINTS, PARTS, DEFAULTS = "joints", "parts.", "joint_defaults."
#: Without these, the same file would start another robot.
IDENTITY = ("robot", "joint_prefix", PARTS)

Values = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Saved:
    """What goes into a file, and what starts it.

    Attributes: section (name of the node, or one for all nodes of a robot), values (by name),
    renaming (ROS arguments: the names of nodes), left_out (what a file cannot hold).
    """

    section: str
    values: Values
    renaming: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def gather(session: Session) -> Saved:
    """All parameters of a board; of a robot of several parts, those of its parts, too.

    Raises:
        BoardTimeout: the robot, or a part of it, does not answer.
    """
    own, board = all_values(session), session.client.board_name
    folder, _, name = board.rpartition("/")
    if any(key.startswith(PARTS) for key in own):
        parts = [key.removeprefix(PARTS) for key in own if key.startswith(PARTS) and own[key]]
        with ExitStack() as stack:
            beside = {p: stack.enter_context(session.beside(f"{folder}/{p}")) for p in parts}
            shown = {part: all_values(one) for part, one in beside.items()}
        return of_robot(folder, own, shown)
    if "robot" not in own:
        with session.beside(f"{folder}/{ROBOT}") as whole:
            return of_one_part(folder, own, all_values(whole))
    renaming = [f"-r __ns:={folder}"] * bool(folder) + [f"-r __node:={name}"] * (name != SECTION)
    return Saved(board, own, renaming)


def of_robot(folder: str, robot: Values, parts: Mapping[str, Values]) -> Saved:
    """The file of a whole robot.

    Args:
        folder: namespace of its nodes.
        robot: what its own node shows.
        parts: what those of its parts show.
    """
    values = {name: v for name, v in robot.items() if name != JOINTS and not of_all(name)}
    left_out = []
    for part in parts.values():
        values |= of_joints(part)
    for name in sorted({name for part in parts.values() for name in part} - set(values)):
        if name == JOINTS or of_all(name):
            continue
        found = {part: shown[name] for part, shown in parts.items() if name in shown}
        first = next(iter(found.values()))
        if all(value == first for value in found.values()):
            values[name] = first
        else:
            told = ", ".join(f"{part} {value}" for part, value in found.items())
            left_out.append(f"{name}, which has one value for all parts in a file: {told}")
    return Saved(SECTION, in_order(values, robot[JOINTS]), above(folder), left_out)


def of_one_part(folder: str, part: Values, robot: Values) -> Saved:
    """The file of a part's joints; it starts the whole robot, the other parts as configured.

    Args:
        folder: namespace of the robot's nodes.
        part: what the part's node shows.
        robot: what the robot's shows.
    """
    identity = {name: v for name, v in robot.items() if name.startswith(IDENTITY)}
    values = in_order(identity | of_joints(part), robot[JOINTS])
    return Saved(SECTION, values, above(folder))


def in_order(values: Values, joints: Sequence[str]) -> Values:
    """Parameters by name, but parts as they come in the robot, whose joints these are."""
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
    """The argument for the namespace that comes before a robot's name, where there is one."""
    found = folder.rpartition("/")[0]
    return [f"-r __ns:={found}"] * bool(found)


def all_values(session: Session) -> Values:
    """All parameters of a board that have a value, as YAML has them."""
    names = [n for n in session.client.list_parameters() if not n.startswith(OF_RCLPY)]
    values = session.client.get_parameters(names)
    return {name: yaml_value(value) for name, value in values.items() if value is not None}


def yaml_value(value: Any) -> Any:
    """A value as YAML has it."""
    return value.tolist() if hasattr(value, "tolist") else value
