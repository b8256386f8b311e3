# SPDX-License-Identifier: Apache-2.0
"""parameter.py: the kind of a parameter is that of its field."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from typing import Any

import pytest

from control_board_ros.core.config import parameter as module
from control_board_ros.core.config.parameter import (
    HUGE,
    TINY,
    ConfigError,
    Kind,
    Parameter,
    check_number,
    check_parameters,
    configuration,
    parameter,
    parameters_of,
    part,
)


@pytest.mark.parametrize(
    ("hint", "kind", "length"),
    [
        (bool, Kind.BOOL, None),
        (int, Kind.INTEGER, None),
        (float, Kind.DOUBLE, None),
        (str, Kind.STRING, None),
        (tuple[float, float, float], Kind.DOUBLES, 3),
        (tuple[float], Kind.DOUBLES, 1),
        (tuple[str, ...], Kind.STRINGS, None),
    ],
)
def test_kinds(hint: object, kind: Kind, length: int | None) -> None:
    """A tuple of numbers is a list of that length; of texts, one of any."""
    assert module._kind(hint) == (kind, length)


@configuration
class Small:
    """Two parameters."""

    fixed: float = parameter("Fixed", default=1.0)
    live: float = parameter("Live", default=2.0, run_time=True)


def test_parameters_that_change_at_run_time_are_marked() -> None:
    assert [one.run_time for one in parameters_of(Small)] == [False, True]


def test_a_configuration_is_frozen_slotted_and_made_by_keywords() -> None:
    made = Small(live=3.0)
    assert (made.fixed, made.live) == (1.0, 3.0)
    assert not hasattr(made, "__dict__")
    with pytest.raises(FrozenInstanceError):
        made.live = 4.0  # type: ignore[misc]
    with pytest.raises(TypeError):
        Small(1.0)  # type: ignore[misc]


def row(**changes: Any) -> Parameter:
    """A parameter, a number by default."""
    given = {"name": "it", "kind": Kind.DOUBLE, "default": 1.0, "text": "What it is"}
    return Parameter(**(given | changes))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, "a number"),
        ({"low": 1.0}, "a number of at least 1"),
        ({"high": 2.0}, "a number of at most 2"),
        ({"low": 1.0, "high": "limits.velocity"}, "a number from 1 to limits.velocity"),
        ({"above": 0.0}, "a number above 0"),
        ({"above": "lower", "high": 5.0}, "a number above lower and up to 5"),
        ({"low": 10.0, "high": 100.0, "or_zero": True}, "0, or a number from 10 to 100"),
        ({"kind": Kind.INTEGER, "low": 0.0}, "a whole number of at least 0"),
        ({"kind": Kind.DOUBLES, "high": 1.0}, "a list of numbers of at most 1"),
        ({"kind": Kind.BOOL}, "true, false"),
        ({"kind": Kind.BOOL, "choices": {"external": None}}, "true, false, external"),
        ({"kind": Kind.STRING}, "text"),
        ({"kind": Kind.STRINGS}, "a list of texts"),
        ({"kind": Kind.STRING, "choices": {"a": 1, "b": 2}}, "a, b"),
        ({"kind": Kind.STRING, "form": "a name"}, "a name"),
    ],
)
def test_ranges_in_words(changes: dict[str, Any], words: str) -> None:
    assert row(**changes).range_text == words


@pytest.mark.parametrize(
    ("changes", "bounds"),
    [
        ({}, (-HUGE, HUGE)),
        ({"low": 1.0, "high": 2.0}, (1.0, 2.0)),
        ({"low": "lower", "high": "upper"}, (-HUGE, HUGE)),
        ({"above": 3.0}, (3.0 + TINY, HUGE)),
        ({"above": "lower", "high": 2.0}, (-HUGE, 2.0)),
        ({"low": 10.0, "high": 20.0, "or_zero": True}, (0.0, 20.0)),
    ],
)
def test_bounds_as_ros_has_them(changes: dict[str, Any], bounds: tuple[float, float]) -> None:
    assert row(**changes).bounds == bounds


def test_allowed_values_of_a_parameter() -> None:
    """Both ends; 0 besides where that is meant, and nothing between."""
    one = row(low=10.0, high=20.0)
    assert [one.allows(x) for x in (9.9, 10.0, 20.0, 20.1, 0.0)] == [
        False, True, True, False, False,
    ]  # fmt: skip
    two = row(low=10.0, high=20.0, or_zero=True)
    assert [two.allows(x) for x in (0.0, 0.5, 5.0, 9.9, 10.0, 20.0, -1.0)] == [
        True, False, False, False, True, True, False,
    ]  # fmt: skip
    assert not row(above=0.0).allows(0.0)
    assert row(above=0.0).allows(1e-9)


def test_the_description_has_the_unit() -> None:
    assert row(unit="rad").description == "What it is [rad]."
    assert row().description == "What it is."


@configuration
class Inner:
    """What another one has."""

    size: float = parameter("Size", default=1.0, low=0.0, high="most")
    most: float = parameter("Most", default=2.0, above=0.0)
    place: tuple[float, float] = parameter("Place", default=(0.0, 0.0), low=-1.0, high=1.0)


@configuration
class Outer:
    """A configuration with a part."""

    speed: float = parameter("Speed", default=1.0, above=0.0, high="inner.most")
    inner: Inner = part(default=Inner())
    spare: Inner | None = part(default=None)


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (Outer(speed=2.1), "j.speed: 2.1 is not allowed; a number above 0 and up to 2"),
        (Outer(speed=True), "j.speed: True is not allowed; a number above 0 and up to 2"),
        (Outer(inner=Inner(size=2.1)), "j.inner.size: 2.1 is not allowed; a number from 0 to 2"),
        (Outer(inner=Inner(most=0.0)), "j.inner.most: 0.0 is not allowed; a number above 0"),
        (Outer(spare=Inner(size=-1.0)), "j.spare.size: -1.0 is not allowed; a number from 0 to 2"),
        (
            Outer(inner=Inner(place=(0.0, 1.1))),
            "j.inner.place: 1.1 is not allowed; a number from -1 to 1",
        ),
        (
            Outer(inner=Inner(place=(0.0,))),  # type: ignore[arg-type]
            "j.inner.place: (0.0,) is not allowed; 2 numbers",
        ),
    ],
)
def test_numbers_of_a_configuration_and_its_parts(made: Outer, text: str) -> None:
    """Bounds may be parameters, of the same class or of a part."""
    with pytest.raises(ConfigError) as error:
        check_parameters("j.", made)
    assert str(error.value) == text


def test_a_valid_configuration() -> None:
    check_parameters("", Outer(speed=2.0, inner=Inner(size=2.0, place=(-1.0, 1.0))))
    check_parameters("", Outer(speed=2))


@pytest.mark.parametrize("value", [True, "1", None, 1.1e12, -1.1e12, math.inf, math.nan])
def test_invalid_numbers_of_a_configuration(value: Any) -> None:
    """Numbers of more than 1e12 neither, which their error names; nothing else is refused."""
    huge = isinstance(value, float) and abs(value) > 1e12
    end = r", no larger than 1e\+12" if huge else ""
    with pytest.raises(ConfigError, match=rf"live: .* is not allowed; a number{end}$"):
        check_parameters("", Small(live=value))
    for good in (1e12, -1e12, 0, 7):
        check_parameters("", Small(live=good))
    check_number("key", -5.0)
    check_number("key", -math.inf)
