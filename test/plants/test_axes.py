# SPDX-License-Identifier: Apache-2.0
"""Options of drives: ids, directions, ratios, zeros, and those of a driver."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

import numpy as np
import pytest

from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.drives.axes import Axes, Axis, Options
from control_board_ros.plants.drives.can_drives import CanOptions
from control_board_ros.plants.drives.servo_drives import ServoOptions
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.interface import DriveLimits

JOINTS = ("shoulder", "elbow")


@dataclass(frozen=True, kw_only=True)
class OwnAxis(Axis):
    kt: float = 0.5


@dataclass(frozen=True, kw_only=True)
class OwnOptions(Options):
    axis = OwnAxis
    axes: tuple[OwnAxis, ...] = ()
    bus: str = "here"
    speed: float = 1.0
    steps: int = 8
    loud: bool = False


def parsed(**arguments: str) -> OwnOptions:
    given = {key.replace("__", "."): value for key, value in arguments.items()}
    return OwnOptions.parse(JOINTS, given)


def test_omitted_values_have_a_default() -> None:
    found = parsed()
    assert (found.bus, found.speed, found.steps, found.loud) == ("here", 1.0, 8, False)
    assert [axis.id for axis in found.axes] == [1, 2]
    assert found.axes[0] == OwnAxis(name="shoulder", id=1, kt=0.5)


def test_a_bus_that_is_not_told_otherwise() -> None:
    """No watchdog is done without, unless the user says so."""
    can = CanOptions.parse(JOINTS, {})
    assert (can.bus, can.bitrate, can.unwatched) == ("socketcan:can0", 0, False)
    servos = ServoOptions.parse(JOINTS, {})
    assert (servos.bus, servos.baudrate) == ("/dev/ttyUSB0", 1_000_000)


@pytest.mark.parametrize("make", ["dynamixel", "feetech"])
def test_an_id_that_no_servo_can_have_is_refused(make: str) -> None:
    with pytest.raises(PlantSettingsError, match=r"a\.id=253: 0 to 252 is required"):
        import_module(f"control_board_ros.plants.{make}.driver").make(("a",), {"ids": "253"})
    import_module(f"control_board_ros.plants.{make}.driver").make(("a",), {"ids": "252"})


def test_options_are_of_the_bus_of_all_joints_or_of_one() -> None:
    found = parsed(
        bus="there", ids="4 7", kt="2", elbow__kt="3", elbow__ratio="6", elbow__direction="-1"
    )
    assert [axis.id for axis in found.axes] == [4, 7]
    assert [axis.kt for axis in found.axes] == [2.0, 3.0]
    assert found.axes[1].factor == -6.0


def test_values_have_the_type_of_their_default() -> None:
    found = parsed(steps="1e3", loud="1", speed="2")
    assert (found.steps, found.loud, found.speed) == (1000, True, 2.0)
    assert [type(value) for value in (found.steps, found.loud, found.speed)] == [int, bool, float]


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
        ({"steps": "1.5"}, "steps=1.5: a whole number is required"),
        ({"elbow__kt": "far"}, "elbow.kt=far: a number is required"),
        ({"elbow__id": "-1"}, "elbow.id=-1: a whole number"),
        ({"elbow__offset": "nan"}, "elbow.offset=nan: a number"),
        ({"elbow__offset": "far"}, "elbow.offset=far: a number"),
        ({"elbow__motor_turns": "-1"}, "elbow.motor_turns=-1: a number from 0"),
        ({"elbow__turns": "two"}, "elbow.turns=two: absolute, one turn, lost is required"),
        ({"id": "3"}, "id=3: unknown; did you mean 'ids'"),
        ({"sped": "1"}, "sped=1: unknown; did you mean 'speed'"),
        ({"wrist__id": "1"}, "wrist.id=1: unknown"),
        (
            {"far": "1"},
            "known: bus, ids, speed, steps, loud, direction, ratio, offset, motor_turns, turns, "
            "kt, JOINT.id, JOINT.direction",
        ),
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
    for value in (Value.CURRENT, Value.PWM):  # of the motor: the direction alone
        np.testing.assert_array_equal(drive[value], values[value] * [-1.0, 1.0])


@pytest.mark.parametrize(
    ("direction", "ends", "turned", "at_joint"),
    [
        (1, (-1.0, 3.0), 0.0, (0.0, 2.0)),
        (-1, (-1.0, 3.0), 0.0, (-1.0, 1.0)),
        (1, (-1.0, None), 0.0, (0.0, None)),
        (-1, (-1.0, None), 0.0, (None, 1.0)),
        (-1, (None, 3.0), 0.0, (-1.0, None)),
        (1, (-1.0, 3.0), 4.0, (2.0, 4.0)),
        (-1, (-1.0, 3.0), 4.0, (-3.0, -1.0)),
    ],
)
def test_limits_are_those_at_the_joint(
    direction: int,
    ends: tuple[float | None, float | None],
    turned: float,
    at_joint: tuple[float | None, float | None],
) -> None:
    """S4, S9: those of a drive that turns the other way change places."""
    axis = Axis(name="a", id=1, direction=direction, ratio=2.0, offset=0.5)
    drive = DriveLimits(lower=ends[0], upper=ends[1], velocity=8.0, torque=1.5, current=3.0)
    found = axis.limits_at_joint(drive, turned)
    assert (found.lower, found.upper) == at_joint
    assert (found.velocity, found.torque, found.current) == (4.0, 3.0, 3.0)
    assert axis.limits_at_joint(DriveLimits(), turned) == DriveLimits()


def test_a_shaft_turns_with_the_joint_where_it_is_measured() -> None:
    axes = Axes([Axis(name="a", id=1, direction=-1, motor_turns=7.0), Axis(name="b", id=2)])
    np.testing.assert_array_equal(axes.shaft, [-7.0, np.nan])
    np.testing.assert_array_equal(axes.sign, [-1.0, 1.0])


@pytest.mark.parametrize(
    ("words", "turn"),
    [("", None), ("absolute", 0.0), ("one_turn", 2.0 * np.pi), ("one turn", 2.0 * np.pi),
     ("lost", np.inf)],
)  # fmt: skip
def test_how_a_zero_survives_may_be_told(words: str, turn: float | None) -> None:
    """S9: of one joint, in place of what its drive has."""
    axes = parsed(elbow__turns=words).axes
    assert [axis.turn for axis in axes] == [None, turn]


def test_ids_and_shafts_are_read() -> None:
    axes = parsed(ids="0 ,7", motor_turns="9", elbow__motor_turns="0").axes
    assert [axis.id for axis in axes] == [0, 7]
    assert [axis.motor_turns for axis in axes] == [9.0, 0.0]
