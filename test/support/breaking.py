# SPDX-License-Identifier: Apache-2.0
"""How a board is broken: a registry of wrong boards, and a wrapper for what they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any


@dataclass(frozen=True, slots=True)
class Wrong:
    """A board with one rule broken.

    Attributes: change (breaks it, before the node is made), rule (that must be found; empty: none
    is broken), robot (a named one; empty: the arm of arm.yaml), options (of the session that finds
    it: joint, allowed).
    """

    change: Callable[[], None]
    rule: str
    robot: str = ""
    options: dict[str, Any] = field(default_factory=dict)


#: All wrong boards, by the names of their functions.
WRONG: dict[str, Wrong] = {}


def breaks(
    rule: str, *, robot: str = "", **options: Any
) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """Register a wrong board under the name of its function."""

    def register(function: Callable[[], None]) -> Callable[[], None]:
        WRONG[function.__name__] = Wrong(function, rule, robot, options)
        return function

    return register


def around(owner: Any, name: str, new: Callable[..., Any]) -> None:
    """Put ``new(old, *args)`` in the place of a function or method, and of a command's start."""
    from control_board_ros.core.machine.commands import COMMANDS

    old = getattr(owner, name)

    @wraps(old)
    def replaced(*args: Any, **kwargs: Any) -> Any:
        return new(old, *args, **kwargs)

    setattr(owner, name, replaced)
    for kind, row in COMMANDS.items():
        if row.start is old:
            COMMANDS[kind] = replace(row, start=replaced)
