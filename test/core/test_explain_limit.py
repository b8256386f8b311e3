# SPDX-License-Identifier: Apache-2.0
"""What the log says of a joint that its protection pushes back (SPEC P9)."""

from __future__ import annotations

import pytest
from rig import joint

from control_board_ros.core.explanations import explain_limit

LIMITS = {"lower": -1.0, "upper": 2.0}


@pytest.mark.parametrize(
    ("kind", "position", "text"),
    [
        ("revolute", -1.1, "at -63.03°, 5.73° beyond its software limits, -57.3° to 114.6°"),
        ("revolute", 2.001, "at 114.6°, 0.0573° beyond its software limits, -57.3° to 114.6°"),
        ("revolute", 1.999, "at 114.5°, at its software limits, -57.3° to 114.6°"),
        ("prismatic", 2.5, "at 2.5 m, 0.5 m beyond its software limits, -1 m to 2 m"),
    ],
)
def test_where_it_is_and_how_far_beyond(kind: str, position: float, text: str) -> None:
    made = joint("a", kind=kind, limits=LIMITS)
    assert explain_limit(made, position) == f"{text}; the protection pushes it back"
