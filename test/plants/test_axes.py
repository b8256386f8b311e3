# SPDX-License-Identifier: Apache-2.0
"""Options of drives: ids, directions, ratios, zeros, and those of a driver."""

from __future__ import annotations

import numpy as np
import pytest

from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.drives.axes import Axes, Axis, Options
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import DriveLimits

JOINTS = ("shoulder", "elbow")


def parsed(**arguments: str) -> Options:
    given = {key.replace("__", "."): value for key, value in arguments.items()}
    return Options.parse(JOINTS, given, bus="here", whole={"speed": 1.0}, each={"kt": 0.5})


def test_omitted_values_have_a_default() -> None:
    found = parsed()
    assert (found.bus, found.own) == ("here", {"speed": 1.0})
    assert [axis.id for axis in found.axes] == [1, 2]
    assert found.axes[0] == Axis(name="shoulder", id=1, own={"kt": 0.5})


def test_options_are_of_the_bus_of_all_joints_or_of_one() -> None:
    found = parsed(
        bus="there", ids="4 7", kt="2", elbow__kt="3", elbow__ratio="6", elbow__direction="-1"
    )
    assert [axis.id for axis in found.axes] == [4, 7]
    assert [axis.own["kt"] for axis in found.axes] == [2.0, 3.0]
    assert found.axes[1].factor == -6.0


def test_an_option_without_a_joint_is_that_of_those_that_have_none() -> None:
    """In whatever order they are given."""
    for given in ({"ratio": "6", "elbow__ratio": "2"}, {"elbow__ratio": "2", "ratio": "6"}):
        assert [axis.ratio for axis in parsed(**given).axes] == [6.0, 2.0]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"ids": "1"}, "ids=1: 2 are required"),
        ({"ids": "3,3"}, "elbow.id=3: shoulder has it"),
        ({"elbow__ratio": "0"}, "elbow.ratio=0: a number above 0"),
        ({"elbow__direction": "2"}, "elbow.direction=2: 1 or -1"),
        ({"elbow__id": "1.5"}, "elbow.id=1.5: a whole number"),
        ({"elbow__offset": "nan"}, "elbow.offset=nan: a number"),
        ({"sped": "1"}, "sped=1: unknown; did you mean 'speed'"),
        ({"wrist__id": "1"}, "wrist.id=1: unknown"),
    ],
)
def test_an_invalid_option_is_reported_in_one_line(arguments: dict[str, str], text: str) -> None:
    with pytest.raises(PlantSettingsError) as caught:
        parsed(**arguments)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_power_at_drive_and_joint_is_the_same() -> None:
    """τ q̇ is what it is, whatever direction, ratio and offset; a spring has the same energy."""
    axes = Axes([Axis(name="a", id=1, direction=-1, ratio=5.0, offset=0.3), Axis(name="b", id=2)])
    values = np.random.default_rng(1).normal(size=(VALUES, 2))
    joint = SetPoints(np.ones(2, dtype=np.int8), values.copy(), np.ones(2))
    drive = axes.to_drive(joint)
    power = values[Value.TORQUE] * values[Value.VELOCITY]
    np.testing.assert_allclose(drive[Value.TORQUE] * drive[Value.VELOCITY], power)
    at_zero = np.array([0.3, 0.0])
    energy = values[Value.STIFFNESS] * (values[Value.POSITION] - at_zero) ** 2
    np.testing.assert_allclose(drive[Value.STIFFNESS] * drive[Value.POSITION] ** 2, energy)
    np.testing.assert_allclose(axes.position(drive[Value.POSITION]), values[Value.POSITION])


def test_limits_of_a_drive_that_turns_the_other_way_change_places() -> None:
    """S4."""
    axis = Axis(name="a", id=1, direction=-1, ratio=2.0, offset=0.5)
    found = axis.limits_at_joint(DriveLimits(lower=-1.0, upper=3.0, velocity=8.0, torque=1.5))
    assert (found.lower, found.upper) == (-1.0, 1.0)
    assert (found.velocity, found.torque, found.current) == (4.0, 3.0, None)
