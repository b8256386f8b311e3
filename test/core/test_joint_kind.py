# SPDX-License-Identifier: Apache-2.0
"""What the numbers of a joint are, and how they are written for people."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from control_board_ros.core.terms.joint_kind import JointKind as K


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (lambda: K.REVOLUTE.position(0.2153), "12.3°"),
        (lambda: K.CONTINUOUS.position(-1e-5), "0.0°"),  # no -0.0
        (lambda: K.PRISMATIC.position(0.04), "40.0 mm"),
        (lambda: K.REVOLUTE.velocity(1.0), "57.3°/s"),
        (lambda: K.PRISMATIC.velocity(-0.25), "-250.0 mm/s"),
        (lambda: K.REVOLUTE.acceleration(1.0), "57.3°/s²"),
        (lambda: K.PRISMATIC.acceleration(1.0), "1000.0 mm/s²"),
        (lambda: K.REVOLUTE.force(1.234), "1.23 N·m"),
        (lambda: K.PRISMATIC.force(-0.001), "0.00 N"),
        (lambda: K.REVOLUTE.travel(-2.0, 2.0), "-114.6…114.6°"),
        (lambda: K.PRISMATIC.travel(0.0, 0.04), "0.0…40.0 mm"),
        (lambda: K.CONTINUOUS.travel(-math.inf, math.inf), "endless"),
        (lambda: K.PRISMATIC.travel(-60.0e3, 60.0e3), "endless"),  # beyond 100,000 m
        (lambda: K.PRISMATIC.travel(-40.0e3, 40.0e3), "-40000000.0…40000000.0 mm"),
        (lambda: K.REVOLUTE.position(1e300), "5.73e+301°"),
        (lambda: K.PRISMATIC.force(-1e12), "-1e+12 N"),
        (lambda: K.REVOLUTE.position(math.nan), "-"),
        (lambda: K.PRISMATIC.force(math.inf), "-"),
    ],
)
def test_texts(text: Callable[[], str], expected: str) -> None:
    """One resolution: 0.1°, 0.1 mm, 0.01 N·m."""
    assert text() == expected


def test_units() -> None:
    """Those of the board, and those that people read."""
    assert [kind.unit for kind in K] == ["rad", "rad", "m"]
    assert [kind.force_unit for kind in K] == ["N·m", "N·m", "N"]
    assert [kind.shown_unit for kind in K] == ["°", "°", "mm"]
    assert [kind.choose(1, 2) for kind in K] == [1, 1, 2]
    for kind in K:
        steps = {kind.position(n * kind.resolution) for n in range(11)}
        assert len(steps) == 11, "each step of the resolution is another text"


@pytest.mark.parametrize("described", ["fixed", "", None, "Prismatic"])
def test_joints_of_unknown_kind_are_revolute(described: str | None) -> None:
    """Units of a joint that is unknown are those of most."""
    assert K.of(described) is K.REVOLUTE
    assert K.of("prismatic") is K.PRISMATIC
