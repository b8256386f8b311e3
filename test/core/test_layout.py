# SPDX-License-Identifier: Apache-2.0
"""layout.py: the parts of a robot on one board, and limits as arrays (SPEC R1, R2)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rig import board_config, joint

from control_board_ros.core.config.config import (
    BoardConfig,
    BoardLimits,
    ConfigError,
    Impedance,
    frozen,
    joined,
)
from control_board_ros.core.model.coupling import Coupling


def arm(**changes: Any) -> BoardConfig:
    return board_config(joint("a"), joint("b"), **changes)


def hand(**changes: Any) -> BoardConfig:
    return board_config(joint("c"), **changes)


#: Motors 0 and 1 both move axis b.
COUPLED = Coupling(("a", "b"), ("a", "b"), ((1.0, 0.0), (1.0, 1.0)))


def test_the_joints_of_all_parts_in_their_order() -> None:
    parts = {"arm": arm(), "hand": hand()}
    config = joined(parts)
    assert config.names == ("a", "b", "c")
    assert config.parts == parts
    assert [(zone.name, list(zone.joints)) for zone in config.zones()] == [
        ("arm", [0, 1]),
        ("hand", [2]),
    ]
    assert [zone.columns for zone in config.zones()] == [slice(0, 2), slice(2, 3)]
    assert [zone.config for zone in config.zones()] == list(parts.values())


def test_a_board_without_parts_is_one_zone() -> None:
    config = arm()
    [(name, columns, own)] = config.zones()
    assert (name, columns) == ("", slice(0, 2))
    assert own is config


def test_rate_and_output_are_those_of_the_parts() -> None:
    config = joined({"arm": arm(control_rate=250.0, output="current")})
    assert (config.control_rate, config.output) == (250.0, "current")


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        ({}, "parts: [] is not allowed; at least one part"),
        (
            {"arm": arm(), "other": board_config(joint("b"))},
            "parts.other: 'b' is not allowed; each joint in one part; arm has it",
        ),
        (
            {"arm": arm(), "hand": hand(control_rate=250.0)},
            "parts.hand.control_rate: 250.0 is not allowed; the same for all parts",
        ),
        (
            {"arm": arm(), "hand": hand(output="current")},
            "parts.hand.output: 'current' is not allowed; the same for all parts",
        ),
    ],
)
def test_incompatible_parts(parts: dict[str, BoardConfig], text: str) -> None:
    with pytest.raises(ConfigError) as error:
        joined(parts)
    assert str(error.value) == text


@pytest.mark.parametrize(
    ("one", "other", "both"), [(True, True, True), (True, False, False), (False, True, False)]
)
def test_it_configures_itself_where_all_parts_do(one: bool, other: bool, both: bool) -> None:
    config = joined({"arm": arm(autoconfigure=one), "hand": hand(autoconfigure=other)})
    assert config.autoconfigure is both


def test_a_heartbeat_is_expected_where_a_part_expects_one() -> None:
    """E2: the shortest of their timeouts."""
    config = joined({"arm": arm(heartbeat_timeout=0.5), "hand": hand(heartbeat_timeout=2.0)})
    assert config.heartbeat_timeout == 0.5
    mixed = joined({"arm": arm(heartbeat_timeout=0.5), "hand": hand()})
    assert mixed.heartbeat_timeout == 0.5
    assert joined({"arm": arm(), "hand": hand()}).heartbeat_timeout == 0.0


def test_motors_are_coupled_where_those_of_a_part_are() -> None:
    """Y3: the motors of the others are their own."""
    assert joined({"arm": arm(), "hand": hand()}).motor_coupling is None
    config = joined({"hand": hand(), "arm": arm(motor_coupling=COUPLED)})
    assert config.motor_coupling is not None
    assert config.motor_coupling.matrix.tolist() == [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 1.0],
    ]


def test_axes_are_coupled_where_those_of_a_part_are() -> None:
    plain = joined({"arm": arm(), "hand": hand()})
    assert plain.coupling is not None
    assert plain.coupling.physical_joints == ("a", "b", "c")
    two = Coupling(("c",), ("c1", "c2"), ((1.0,), (0.5,)))
    coupled = joined({"arm": arm(), "hand": hand(coupling=two)})
    assert coupled.coupling is not None
    assert coupled.coupling.physical_joints == ("a", "b", "c1", "c2")


def test_the_limits_of_all_joints() -> None:
    """Each row is that of its own name, and cannot be written to."""
    impedance = Impedance(stiffness=5.0, damping=1.0, max_stiffness=77.0, max_damping=8.0)
    first, second = arm().joints
    second = replace(second, impedance=impedance)
    limits = BoardLimits.of(board_config(first, second))
    own = first.limits
    expected = {
        "lower": own.lower,
        "upper": own.upper,
        "velocity": own.velocity,
        "acceleration": own.acceleration,
        "torque": own.torque,
        "output": own.output,
        "current": own.peak_current,
    }
    for name, value in expected.items():
        assert getattr(limits, name).tolist() == [value, value]
        with pytest.raises(ValueError, match="read-only"):
            getattr(limits, name)[0] = 1.0
    assert limits.stiffness.tolist() == [first.impedance.max_stiffness, 77.0]
    assert limits.damping.tolist() == [first.impedance.max_damping, 8.0]


def test_frozen_values_are_numbers() -> None:
    values = frozen(x for x in (1, 2))
    assert values.dtype == np.float64
    assert values.tolist() == [1.0, 2.0]
