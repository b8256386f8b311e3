# SPDX-License-Identifier: Apache-2.0
"""The options that every verb takes, wherever they stand on the line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

#: Options that take a value, and those that do not.
VALUED = ("--board", "--namespace", "--timeout", "--domain")
PLAIN = ("--json",)
ROS_ARGUMENTS = "--ros-args"


@dataclass(slots=True)
class Options:
    """What was asked for in front of the verb.

    Attributes: board (name of the node), namespace (of cbctl's own node: relative names start
    there), timeout (s, to find the board and for each answer), domain (ROS_DOMAIN_ID; None: of
    the environment), json, ros_arguments (as they stand after --ros-args).
    """

    board: str = "control_board"
    namespace: str = ""
    timeout: float = 5.0
    domain: int | None = None
    json: bool = False
    ros_arguments: list[str] = field(default_factory=list)


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The line without, and with only, what stands from --ros-args on."""
    line = list(arguments)
    if ROS_ARGUMENTS not in line:
        return line, []
    k = line.index(ROS_ARGUMENTS)
    return line[:k], line[k:]


def hoist(arguments: Sequence[str]) -> list[str]:
    """Move the options of every verb to the front: ``modes --json`` is ``--json modes``."""
    front: list[str] = []
    rest: list[str] = []
    words = iter(arguments)
    for word in words:
        name, _, value = word.partition("=")
        if word == "--":
            rest += [word, *words]
        elif word in PLAIN or (name in VALUED and value):
            front.append(word)
        elif word in VALUED:
            front += [word, *[w for w in [next(words, None)] if w is not None]]
        else:
            rest.append(word)
    return front + rest
