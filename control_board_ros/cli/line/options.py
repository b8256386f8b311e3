# SPDX-License-Identifier: Apache-2.0
"""The options of every verb, at any place of the line."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field

from .arguments import Parser, argument, number
from .words import UsageError

#: The board of a line that names none, and the environment variable that names another.
DEFAULT, VARIABLE = "control_board", "CONTROL_BOARD"
BOARD = argument(
    "--board",
    default="",
    metavar="NAME",
    help="Name of the board's node, or a pattern for several boards: '/icub/*'; default: that of "
    "the environment variable CONTROL_BOARD, control_board, or the only board or robot there is.",
)
NAMESPACE = argument(
    "--namespace", default="", metavar="NAMESPACE", help="Namespace of the board."
)
TIMEOUT = argument(
    "--timeout",
    type=number,
    default=5.0,
    metavar="SECONDS",
    help="Timeout for finding the board, for each answer, and in scripts for a paused board.",
)
DOMAIN = argument(
    "--domain", type=int, metavar="NUMBER", help="ROS domain; default: ROS_DOMAIN_ID."
)
JSON = argument("--json", action="store_true", help="Print only JSON on stdout.")
VERSION = argument("--version", action="store_true", help="Print the version and exit.")

#: Options that have a value, and those that do not.
VALUED = ("--board", "--namespace", "--timeout", "--domain")
PLAIN = ("--json", "--version")
ARGUMENTS = (BOARD, NAMESPACE, TIMEOUT, DOMAIN, JSON, VERSION)
ROS_ARGUMENTS = "--ros-args"


@dataclass(slots=True)
class Options:
    """The common options of a line.

    Attributes: board (name of the node), namespace (of cbctl's own node: relative names start
    there), only (the only board or robot there is takes the place of a default one that is not
    there), timeout (s, to find the board and for each answer), domain (ROS_DOMAIN_ID; None: of
    the environment), json, ros_arguments (the words after --ros-args).
    """

    board: str = DEFAULT
    namespace: str = ""
    timeout: float = 5.0
    domain: int | None = None
    json: bool = False
    only: bool = False
    ros_arguments: list[str] = field(default_factory=list)

    @property
    def board_named(self) -> bool:
        """Whether the line names a board other than the default."""
        return self.board not in (DEFAULT, os.environ.get(VARIABLE))

    @property
    def address(self) -> str:
        """The options that select the same board, as typed; often none."""
        options = [f"--board {self.board}"] if self.board_named else []
        if self.namespace:
            options.append(f"--namespace {self.namespace}")
        if self.domain is not None:
            options.append(f"--domain {self.domain}")
        return " ".join(options)


def read_options(words: Sequence[str], ros_arguments: list[str]) -> tuple[Options, bool]:
    """The options in words, and whether the version is requested.

    Raises:
        UsageError: a value that is out of its range.
    """
    values = Parser("cbctl", ARGUMENTS).read(words)
    version = values.pop("version")
    if not values["board"]:
        variable = os.environ.get(VARIABLE, "")
        values |= {"board": variable or DEFAULT, "only": not variable}
    options = Options(**values, ros_arguments=ros_arguments)
    if not 0.0 < options.timeout <= 3600.0:
        raise UsageError(
            f"--timeout {options.timeout:g} is not valid; give seconds above 0, up to 3600"
        )
    if options.domain is not None and not 0 <= options.domain <= 232:
        raise UsageError(f"--domain {options.domain} is not valid; ROS domains are 0 to 232")
    return options, version


def split_ros_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split the line at --ros-args."""
    line = list(arguments)
    if ROS_ARGUMENTS not in line:
        return line, []
    k = line.index(ROS_ARGUMENTS)
    return line[:k], line[k:]


def hoist(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Separate the common options from the verb and its words."""
    front: list[str] = []
    rest: list[str] = []
    left = iter(words)
    for word in left:
        name, _, value = word.partition("=")
        if word == "--":
            rest += [word, *left]
        elif word in PLAIN or (name in VALUED and value):
            front.append(word)
        elif word in VALUED:
            front += [word, *[w for w in [next(left, None)] if w is not None]]
        else:
            rest.append(word)
    return front, rest
