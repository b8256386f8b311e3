# SPDX-License-Identifier: Apache-2.0
"""How values of a configuration are checked: every error names key, value and what is allowed."""

from __future__ import annotations

import math
from typing import Any

from .parameter import Bound, Kind, parameters_of, parts_of, range_text


class ConfigError(ValueError):
    """A configuration value that is not allowed; one line: key, value, what is allowed."""

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        super().__init__(f"{key}: {value!r} is not allowed; {allowed}")
        self.key, self.value, self.allowed = key, value, allowed


def check_number(
    key: str,
    value: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float | None = None,
) -> None:
    """Raise ConfigError unless ``low <= value <= high`` (and ``value > above``, if given).

    NaN and values that are not numbers fail; infinity passes only where the range holds it.
    """
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    if good and low <= value <= high and (above is None or value > above):
        return
    raise ConfigError(key, value, range_text("a number", low, high, above))


def check_parameters(key: str, config: Any, joint: Any = None) -> None:
    """Raise ConfigError unless every number of a configuration and of its parts is allowed.

    Args:
        key: Prefix of its parameters' names, including the dot.
        config: The configuration.
        joint: What it is a part of: bounds with a dot in their name are parameters of that.
    """
    joint = config if joint is None else joint
    for part in parts_of(type(config)):
        if (one := getattr(config, part.name)) is not None:
            check_parameters(f"{key}{part.name}.", one, joint)
    plain, others = _numbers(type(config))
    for name, low, high, above in plain:
        value = getattr(config, name)
        if type(value) is not float or not low <= value <= high:
            check_number(key + name, value, low, high, above=above)
    for name, low, high, above, length in others:
        value = getattr(config, name)
        if length is not None and len(value) != length:
            raise ConfigError(key + name, value, f"{length} numbers")
        ends = _resolve(low, config, joint), _resolve(high, config, joint)
        for number in (value,) if length is None else value:
            check_number(key + name, number, *ends, above=_resolve(above, config, joint))


_Ranges = list[tuple[Any, ...]]
_NUMBERS: dict[type, tuple[_Ranges, _Ranges]] = {}


def _numbers(made: type) -> tuple[_Ranges, _Ranges]:
    """Name, low, high, above of the parameters that numbers bound; of the others, length too.

    The others are lists of numbers, and parameters that are bounded by parameters.
    """
    if (found := _NUMBERS.get(made)) is not None:
        return found
    plain: _Ranges = []
    others: _Ranges = []
    for row in parameters_of(made):
        if row.length is not None or str in map(type, (row.low, row.high, row.above)):
            given = zip((row.low, row.high), row.bounds, strict=True)
            low, high = (bound if isinstance(bound, str) else end for bound, end in given)
            others.append((row.name, low, high, row.above, row.length))
        elif row.kind in (Kind.DOUBLE, Kind.INTEGER):
            plain.append((row.name, *row.bounds, row.above))
    return _NUMBERS.setdefault(made, (plain, others))


def _resolve(bound: Bound | None, config: Any, joint: Any) -> Any:
    """The value of a bound: a number, or a parameter; with a dot in its name, one of the joint."""
    if type(bound) is not str:
        return bound
    part, _, name = bound.rpartition(".")
    return getattr(getattr(joint, part) if part else config, name)
