# SPDX-License-Identifier: Apache-2.0
"""Parameters: each is defined on its field only.

    @configuration
    class Limits:
        velocity: float = positive_amount("Speed limit", "rad/s or m/s", derived="URDF")

The check of a configuration, the ROS parameters and docs/parameters.md are made from it. A bound
is a number, or the name of the parameter that bounds: ``upper`` of the same class, or
``limits.velocity`` of the joint.

The checks are below: each error names key, value and what is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from enum import StrEnum
from functools import cache
from types import NoneType
from typing import Any, TypeVar, dataclass_transform, get_args, get_origin, get_type_hints

T = TypeVar("T")
Bound = float | str

#: The largest finite number of a configuration, and the minimum distance of an exclusive bound:
#: products and quotients of two numbers stay finite.
HUGE, TINY = 1e12, 1e-12


class Kind(StrEnum):
    """The type of a parameter, as ROS names it."""

    BOOL = "bool"
    INTEGER = "integer"
    DOUBLE = "double"
    STRING = "string"
    DOUBLES = "double_array"
    STRINGS = "string_array"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter.

    Attributes:
        name: Of the field; with the names of its parts and dots before it.
        kind: Its type.
        default: Of the field.
        text: Description, without unit and full stop.
        unit: Of numbers; empty where there is none.
        low, high: Minimum and maximum, inclusive; of numbers.
        above: Exclusive minimum; the value exceeds it by TINY at least.
        or_zero: Whether 0 is allowed, too, where ``low`` is above it.
        choices: Of strings: the text of each allowed value, and the value; of flags the values
            allowed in addition to true and false.
        pattern: Of strings: the regular expression of the whole value; empty: any text.
        form: What the pattern allows, in words.
        length: Of arrays with a fixed one.
        run_time: Whether it can change while the board runs.
        derived: Source of the value where a parameter file has none; empty: the default.
    """

    name: str
    kind: Kind
    default: Any
    text: str
    unit: str = ""
    low: Bound = -HUGE
    high: Bound = HUGE
    above: Bound | None = None
    or_zero: bool = False
    choices: Mapping[str, Any] = field(default_factory=dict)
    pattern: str = ""
    form: str = ""
    length: int | None = None
    run_time: bool = False
    derived: str = ""

    @property
    def description(self) -> str:
        """Text and unit."""
        return f"{self.text} [{self.unit}]." if self.unit else f"{self.text}."

    @property
    def bounds(self) -> tuple[float, float]:
        """Both ends of the range, inclusive; of HUGE where another parameter is the bound."""
        low = 0.0 if self.or_zero else self.low
        high = HUGE if isinstance(self.high, str) else self.high
        if self.above is not None:
            low = self.above if isinstance(self.above, str) else self.above + TINY
        return -HUGE if isinstance(low, str) else low, high

    @property
    def range_text(self) -> str:
        """What is allowed, in words."""
        if self.kind is Kind.BOOL and self.choices:
            return ", ".join(("true", "false", *self.choices))
        if self.choices:
            return ", ".join(self.choices)
        if self.form:
            return self.form
        nouns = {Kind.DOUBLES: "a list of numbers", Kind.INTEGER: "a whole number"}
        words = {Kind.BOOL: "true, false", Kind.STRING: "text", Kind.STRINGS: "a list of texts"}
        noun = nouns.get(self.kind, "a number")
        zero = "0, or " if self.or_zero else ""
        return words.get(self.kind) or zero + range_text(noun, self.low, self.high, self.above)

    def allows(self, number: float) -> bool:
        """Whether a number is within the bounds."""
        low, high = self.bounds
        if self.or_zero and 0.0 < number < float(self.low):
            return False
        return low <= number <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A configuration that is a field of another one.

    Attributes:
        name: Of the field.
        made: Its class.
        in_files: Its parameters where a parameter file leaves them out; None: as its class.
        text: What comes before the text of each of its parameters.
        units: Of its parameters, by name; over their own.
        derived: What its parameters are derived from, by name; before their own texts.
    """

    name: str
    made: type
    in_files: Any
    text: str
    units: Mapping[str, str]
    derived: Mapping[str, str]


def range_text(noun: str, low: Bound, high: Bound, above: Bound | None) -> str:
    """A range in words; bounds of HUGE and more are none."""
    lowest = None if not isinstance(low, str) and low <= -HUGE else _shown(low)
    highest = None if not isinstance(high, str) and high >= HUGE else _shown(high)
    if above is not None:
        return f"{noun} above {_shown(above)}" + (f" and up to {highest}" if highest else "")
    if lowest and highest:
        return f"{noun} from {lowest} to {highest}"
    if highest:
        return f"{noun} of at most {highest}"
    return f"{noun} of at least {lowest}" if lowest else noun


def size_text(value: Any) -> str:
    """``, no larger than 1e+12``, where a value is; the end of what is allowed."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return f", no larger than {HUGE:g}" if is_number and abs(value) > HUGE else ""


def _shown(bound: Bound) -> str:
    return bound if isinstance(bound, str) else f"{bound:g}"


# Fields ---------------------------------------------------------------------------------------


def parameter(
    text: str,
    unit: str = "",
    *,
    default: Any = MISSING,
    low: Bound = -HUGE,
    high: Bound = HUGE,
    above: Bound | None = None,
    choices: Iterable[Any] = (),
    run_time: bool = False,
    derived: str = "",
) -> Any:
    """A field that is a parameter, with the attributes of :class:`Parameter`.

    Without ``default`` it must be given; ``choices`` are the values allowed: texts, or modes,
    which users write by their code.
    """
    known = {
        "text": text,
        "unit": unit,
        "default": _or_none(default),
        "low": low,
        "high": high,
        "above": above,
        "choices": {getattr(choice, "code", choice): choice for choice in choices},
        "run_time": run_time,
        "derived": derived,
    }
    return field(default=default, metadata={"parameter": known})


def amount(text: str, unit: str = "", *, default: float = 0.0, **more: Any) -> Any:
    """A parameter that is a number from 0 on, with others of its attributes."""
    return parameter(text, unit, default=default, low=0.0, **more)


def positive_amount(text: str, unit: str = "", *, default: Any = MISSING, **more: Any) -> Any:
    """A parameter that is a number above 0, likewise."""
    return parameter(text, unit, default=default, above=0.0, **more)


def part(
    text: str = "",
    *,
    default: Any = MISSING,
    in_files: Any = None,
    units: Mapping[str, str] | None = None,
    derived: Mapping[str, str] | None = None,
) -> Any:
    """A field that is a configuration of its own, with the attributes of :class:`Part`.

    Its parameters have its name and a dot in front of theirs. Without ``default`` it must be
    given; ``in_files`` None: as the default's.
    """
    in_files = in_files or _or_none(default)
    known = {"text": text, "in_files": in_files, "units": units or {}, "derived": derived or {}}
    return field(default=default, metadata={"part": known})


def _or_none(default: Any) -> Any:
    return None if default is MISSING else default


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(parameter, part, field)
)
def configuration(cls: type[T]) -> type[T]:
    """A dataclass that is frozen and slotted, made by keywords: a configuration."""
    cls = dataclass(frozen=True, slots=True, kw_only=True)(cls)
    types = get_type_hints(cls, localns={cls.__name__: cls})  # a field may be of its own kind
    parameters, parts = [], []
    for item in fields(cls):  # type: ignore[arg-type]  # it is a dataclass
        if (known := item.metadata.get("parameter")) is not None:
            kind, length = _kind(types[item.name])
            parameters.append(Parameter(name=item.name, kind=kind, length=length, **known))
        elif (known := item.metadata.get("part")) is not None:
            parts.append(Part(name=item.name, made=_part_class(types[item.name]), **known))
    _PARAMETERS[cls], _PARTS[cls] = tuple(parameters), tuple(parts)
    return cls


_PARAMETERS: dict[type, tuple[Parameter, ...]] = {}
_PARTS: dict[type, tuple[Part, ...]] = {}


def parameters_of(made: type) -> tuple[Parameter, ...]:
    """The parameters that are fields of a configuration, those of its parts left out."""
    return _PARAMETERS[made]


def parts_of(made: type) -> tuple[Part, ...]:
    """The fields of a configuration that are configurations of their own."""
    return _PARTS[made]


def _kind(hint: Any) -> tuple[Kind, int | None]:
    """Kind and length of a field's type."""
    if get_origin(hint) is tuple:
        first, *rest = get_args(hint)
        if first is float:
            return Kind.DOUBLES, 1 + len(rest)
        return Kind.STRINGS, None
    kinds = {bool: Kind.BOOL, int: Kind.INTEGER, float: Kind.DOUBLE}
    return kinds.get(hint, Kind.STRING), None


def _part_class(hint: Any) -> type:
    """The class of a part, None left out."""
    made: type = next((option for option in get_args(hint) if option is not NoneType), hint)
    return made


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
    raise ConfigError(key, value, range_text("a number", low, high, above) + size_text(value))


def check_parameters(key: str, config: Any, joint: Any = None) -> None:
    """Raise ConfigError unless every number of a configuration and of its parts is allowed.

    Args:
        key: Prefix of its parameters' names, including the dot.
        config: The configuration.
        joint: The configuration that has it as a part; bounds with a dot name its parameters.
    """
    joint = config if joint is None else joint
    made: type = type(config)
    for part in parts_of(made):
        if (settings := getattr(config, part.name)) is not None:
            check_parameters(f"{key}{part.name}.", settings, joint)
    for name, low, high, above, length in _numbers(made):
        value = getattr(config, name)
        if length is not None and len(value) != length:
            raise ConfigError(key + name, value, f"{length} numbers")
        ends = _resolve(low, config, joint), _resolve(high, config, joint)
        for number in (value,) if length is None else value:
            check_number(key + name, number, *ends, above=_resolve(above, config, joint))


@cache
def _numbers(made: type) -> list[tuple[Any, ...]]:
    """Name, low, high, above and length of the parameters that are numbers, or lists of them.

    Those that numbers bound come first: they may be the bounds of others.
    """
    numbers = []
    for row in parameters_of(made):
        if row.kind in (Kind.DOUBLE, Kind.INTEGER, Kind.DOUBLES):
            ranges = zip((row.low, row.high), row.bounds, strict=True)
            low, high = (bound if isinstance(bound, str) else end for bound, end in ranges)
            numbers.append((row.name, low, high, row.above, row.length))
    return sorted(numbers, key=lambda row: str in map(type, row[1:4]))


def _resolve(bound: Bound | None, config: Any, joint: Any) -> Any:
    """The value of a bound: a number, or a parameter; with a dot in its name, one of the joint."""
    if type(bound) is not str:
        return bound
    part, _, name = bound.rpartition(".")
    return getattr(getattr(joint, part) if part else config, name)
