# SPDX-License-Identifier: Apache-2.0
"""How a board is broken: a registry of wrong boards, and a wrapper for what they change."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import wraps
from pkgutil import resolve_name
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


def breaks(rule: str, **options: Any) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """Register a wrong board under the name of the function that changes it."""

    def register(function: Callable[[], None]) -> Callable[[], None]:
        WRONG[function.__name__] = Wrong(function, rule, options=options)
        return function

    return register


def replaces(
    rule: str, target: str, *, robot: str = "", **options: Any
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register a wrong board with one function replaced, under the name of the new one."""

    def register(new: Callable[..., Any]) -> Callable[..., Any]:
        WRONG[new.__name__] = Wrong(lambda: around(target, new), rule, robot, options)
        return new

    return register


def around(target: str, new: Callable[..., Any]) -> None:
    """Put ``new(old, *args)`` in place of a function or method, and where others have imported it.

    Args:
        target: ``core.machine.machine:Machine.enter``; in a module that has imported a function,
            of this module alone.
        new: its replacement.
    """
    from control_board_ros.core.machine.commands import COMMANDS

    module, _, path = target.partition(":")
    *owners, name = path.split(".")
    place = resolve_name(":".join([f"control_board_ros.{module}", *owners]))
    old = getattr(place, name)

    @wraps(old)
    def replaced(*args: Any, **kwargs: Any) -> Any:
        return new(old, *args, **kwargs)

    setattr(place, name, replaced)
    if old.__module__ == f"control_board_ros.{module}":
        for holder in [one for one in sys.modules.values() if vars(one).get(name) is old]:
            setattr(holder, name, replaced)
    for kind, row in COMMANDS.items():
        if row.start is old:
            COMMANDS[kind] = replace(row, start=replaced)
