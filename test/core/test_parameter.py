# SPDX-License-Identifier: Apache-2.0
"""parameter.py: the kind of a parameter is that of its field."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

from control_board_ros.core.config import parameter as module
from control_board_ros.core.config.parameter import Kind, configuration, parameter, parameters_of


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


def test_what_changes_while_the_board_runs_says_so() -> None:
    assert [one.run_time for one in parameters_of(Small)] == [False, True]


def test_a_configuration_is_frozen_slotted_and_made_by_keywords() -> None:
    made = Small(live=3.0)
    assert (made.fixed, made.live) == (1.0, 3.0)
    assert not hasattr(made, "__dict__")
    with pytest.raises(FrozenInstanceError):
        made.live = 4.0  # type: ignore[misc]
    with pytest.raises(TypeError):
        Small(1.0)  # type: ignore[misc]
