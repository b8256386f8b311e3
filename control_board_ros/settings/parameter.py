# SPDX-License-Identifier: Apache-2.0
"""What is known of one parameter: a row of the schema."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

from ..core.checks import HUGE

JOINT_DEFAULTS = "joint_defaults"


class Kind(StrEnum):
    """The type of a parameter, in ROS's words."""

    BOOL = "bool"
    INTEGER = "integer"
    DOUBLE = "double"
    STRING = "string"
    DOUBLES = "double_array"
    STRINGS = "string_array"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter.

    Attributes: default (None: derived, as ``derived`` says), low and high (inclusive; of
    numbers), choices (of strings), run_time (can change while the board runs), length (of
    arrays with a fixed one).
    """

    name: str
    kind: Kind
    default: Any
    description: str
    derived: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    run_time: bool = False
    length: int | None = None

    @property
    def range_text(self) -> str:
        """What is allowed, in words."""
        if self.choices:
            return ", ".join(self.choices)
        if self.kind is Kind.BOOL:
            return "true, false"
        if self.kind in (Kind.STRING, Kind.STRINGS):
            return "text" if self.kind is Kind.STRING else "a list of texts"
        noun = "a list of numbers" if self.kind is Kind.DOUBLES else "a number"
        noun = "a whole number" if self.kind is Kind.INTEGER else noun
        if self.low <= -HUGE and self.high >= HUGE:
            return noun
        if self.high >= HUGE:
            return f"{noun} of at least {self.low:g}"
        return f"{noun} from {self.low:g} to {self.high:g}"


def default_of(owner: type, name: str) -> Any:
    """The default of a dataclass's field, which is the parameter's too."""
    return next(field.default for field in fields(owner) if field.name == name)


def number(
    name: str, default: float | None, text: str, low: float = 0.0, **rest: Any
) -> Parameter:
    """A row of type double; from 0 where nothing else is said."""
    rest.setdefault("high", HUGE)
    return Parameter(
        name=name, kind=Kind.DOUBLE, default=default, description=text, low=low, **rest
    )


def flag(name: str, default: bool, text: str, **rest: Any) -> Parameter:
    """A row of type bool."""
    return Parameter(name=name, kind=Kind.BOOL, default=default, description=text, **rest)


def string(name: str, default: str, text: str, **rest: Any) -> Parameter:
    """A row of type string."""
    return Parameter(name=name, kind=Kind.STRING, default=default, description=text, **rest)


def strings(name: str, default: list[str], text: str, **rest: Any) -> Parameter:
    """A row of type string array."""
    return Parameter(name=name, kind=Kind.STRINGS, default=default, description=text, **rest)
