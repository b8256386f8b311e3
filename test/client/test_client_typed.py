# SPDX-License-Identifier: Apache-2.0
"""Values of parameters, as the client sends them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterType

from control_board_ros.client.ros_link import typed


@pytest.mark.parametrize(
    ("value", "present", "kind", "field", "sent"),
    [
        ([0, 0, 1], [0.0, 0.0, 0.1], "DOUBLE_ARRAY", "double_array_value", [0.0, 0.0, 1.0]),
        (np.array([0, 1]), [0.5, 0.5], "DOUBLE_ARRAY", "double_array_value", [0.0, 1.0]),
        (2, 1.5, "DOUBLE", "double_value", 2.0),
        (2, 1, "INTEGER", "integer_value", 2),
        ([0, 1], [2, 3], "INTEGER_ARRAY", "integer_array_value", [0, 1]),
        (True, 0.5, "BOOL", "bool_value", True),
    ],
)
def test_whole_numbers_are_doubles_where_the_parameter_has_them(
    value: Any, present: Any, kind: str, field: str, sent: Any
) -> None:
    """A bool is none of them: the board refuses it by its own words."""
    made = typed(value, present)
    assert made.type == getattr(ParameterType, f"PARAMETER_{kind}")
    found = getattr(made, field)
    assert (list(found) if isinstance(sent, list) else found) == sent
