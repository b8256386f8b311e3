# SPDX-License-Identifier: Apache-2.0
"""core/parameter.py: the kind of a parameter is that of its field."""

from __future__ import annotations

import pytest

from control_board_ros.core import parameter
from control_board_ros.core.parameter import Kind


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
    assert parameter._kind(hint) == (kind, length)
