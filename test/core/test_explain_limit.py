# SPDX-License-Identifier: Apache-2.0
"""What is said where software limits act: on a joint beyond them, on a path (SPEC P9)."""

from __future__ import annotations

import pytest
from rig import joint

from control_board_ros.core.machine.explanations import explain_cut, explain_slower
from control_board_ros.core.machine.machine import explain_limit

LIMITS = {"lower": -1.0, "upper": 2.0}


@pytest.mark.parametrize(
    ("kind", "position", "text"),
    [
        ("revolute", -1.1, "at -63.0°, 5.7° beyond its software limits, -57.3° to 114.6°"),
        ("revolute", 2.001, "at 114.6°, 0.1° beyond its software limits, -57.3° to 114.6°"),
        ("revolute", 2.0008, "at 114.6°, at its software limits, -57.3° to 114.6°"),
        ("revolute", 1.999, "at 114.5°, at its software limits, -57.3° to 114.6°"),
        (
            "prismatic",
            2.5,
            "at 2500.0 mm, 500.0 mm beyond its software limits, -1000.0 mm to 2000.0 mm",
        ),
    ],
)
def test_where_it_is_and_how_far_beyond(kind: str, position: float, text: str) -> None:
    made = joint("a", kind=kind, limits=LIMITS)
    assert explain_limit(made, position) == f"{text}; the protection pushes it back"


@pytest.mark.parametrize(
    ("positions", "text"),
    [
        ((0.0, -1.0, 2.0, 1.0), ""),  # at a limit is within
        ((0.0, 2.1, 3.0), "a stays within -57.3° to 114.6° (point 1 requests 120.3°)"),
        ((-1.1, 2.1), "a stays within -57.3° to 114.6° (point 0 requests -63.0°)"),
    ],
)
def test_the_first_point_of_a_path_that_is_cut(positions: tuple[float, ...], text: str) -> None:
    """T1, P9."""
    explained = explain_cut(joint("a", limits=LIMITS), positions)
    assert explained == (f"{text}: software limit" if text else "")


@pytest.mark.parametrize(
    ("kind", "way", "time", "reported"),
    [
        ("revolute", 1.0, 2.0, False),  # the speed requested: 0.5 rad/s
        ("revolute", 1.0, 2.03, True),
        ("revolute", 4e-4, 1.0, False),  # too short for a word
        ("revolute", 6e-4, 1.0, True),
        ("prismatic", 4e-5, 1.0, False),
        ("prismatic", 6e-5, 1.0, True),
    ],
)
def test_a_slower_move_is_reported(kind: str, way: float, time: float, reported: bool) -> None:
    """P1: below 99 % of the speed requested, and longer by a visible time."""
    text = explain_slower(joint("a", kind=kind), way, 0.5, time)
    assert bool(text) is reported
    assert not reported or f"a: {time:.3g} s at" in text
