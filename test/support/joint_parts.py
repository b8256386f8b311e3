# SPDX-License-Identifier: Apache-2.0
"""Fields of a joint of the laws by the path to them: ``track.position``, as a keyword
``track__position``.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

#: Where the classes of a joint and its parts come from.
ROOM = "control_board_ros.core.laws."


def read(one: Any, path: str) -> Any:
    """The value of a field."""
    for name in path.replace("__", ".").split("."):
        one = getattr(one, name)
    return one


def write(one: Any, path: str, value: Any) -> None:
    """Set a field."""
    *parts, name = path.replace("__", ".").split(".")
    for part in parts:
        one = getattr(one, part)
    setattr(one, name, value)


def stand_in(**values: Any) -> SimpleNamespace:
    """An object with these fields, and the parts that they are in."""
    made = SimpleNamespace()
    for path, value in values.items():
        *parts, name = path.replace("__", ".").split(".")
        one = made
        for part in parts:
            if not hasattr(one, part):
                setattr(one, part, SimpleNamespace())
            one = getattr(one, part)
        setattr(one, name, value)
    return made


def fields(one: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """All values of an object of the laws and of its parts, rows of numbers too, with paths."""
    for name in sorted(dir(one)):
        if name.startswith("__"):
            continue
        value, where = getattr(one, name), f"{path}{name}"
        if isinstance(value, int | float | memoryview) or hasattr(value, "shape"):
            yield where, value
        elif type(value).__module__.startswith(ROOM):
            yield from fields(value, f"{where}.")


def numbers(one: Any) -> dict[str, float]:
    """The numbers of an object of the laws and of its parts, by path."""
    return {path: value for path, value in fields(one) if isinstance(value, int | float)}
