# SPDX-License-Identifier: Apache-2.0
"""The schema: parameter files and configurations follow the fields."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import pytest

from control_board_ros.core.config.config import ConfigError, JointConfig
from control_board_ros.core.config.parameter import HUGE, TINY, Kind, Parameter
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.vocabs import Vocab
from control_board_ros.settings import build
from control_board_ros.settings.loading import Settings, load
from control_board_ros.settings.params_file import Entry, SettingsError, convert
from control_board_ros.settings.schema import BOARD, JOINT, JOINT_BY_NAME, rows_of
from control_board_ros.sim.config import JointSimulation

J2 = "lbr_iiwa_joint_2"
OF_THE_BOARD = {row.name for row in rows_of(JointConfig)}
NUMBERS = [row for row in JOINT if row.kind in (Kind.INTEGER, Kind.DOUBLE)]


@pytest.fixture(scope="module")
def iiwa() -> Settings:
    return load()


def made(iiwa: Settings, row: Parameter, value: Any) -> JointConfig | JointSimulation:
    """What holds a parameter of the iiwa's second joint, made with another value of it."""
    values = iiwa.values | {f"{J2}.{row.name}": value}
    if row.name == "torque_sensor":  # without one, less is implemented (I7)
        values |= {f"{J2}.control_modes": ["pos", "idl"], f"{J2}.interaction_modes": ["stif"]}
    if row.name in OF_THE_BOARD:
        return build.joint(values, J2, "revolute")
    return build.configure(JointSimulation, values, f"{J2}.", name=J2)


def another(row: Parameter, value: Any) -> Any:
    """An allowed value that is not the present one."""
    if row.name == "calibration.type":
        return 12
    if row.kind is Kind.BOOL:
        return not value
    if row.kind is Kind.STRING:
        return next(code for code in row.choices if code != value)
    if row.kind is Kind.STRINGS:
        return value[::-1] or [*row.choices][:2]
    if row.kind is Kind.DOUBLES:
        return [number + 0.001 for number in value]
    return 0.999 * value if value else 0.001


def plain(value: Any) -> Any:
    """A field's value as a parameter file has it."""
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return value.code if isinstance(value, Vocab | SetPoint) else value


@pytest.mark.parametrize("row", JOINT, ids=lambda row: row.name)
def test_a_parameter_reaches_the_field_of_its_name(row: Parameter, iiwa: Settings) -> None:
    value = another(row, iiwa.values[f"{J2}.{row.name}"])
    assert plain(attrgetter(row.name)(made(iiwa, row, value))) == value
    assert value != iiwa.values[f"{J2}.{row.name}"]


def beyond() -> Iterator[tuple[Parameter, float]]:
    """Each end of each range that is a number, and the next number outside."""
    for row in NUMBERS:
        low, high = row.bounds
        if not isinstance(row.low, str) and not isinstance(row.above, str) and low > -math.inf:
            yield row, low - 1 if row.kind is Kind.INTEGER else math.nextafter(low, -math.inf)
        if not isinstance(row.high, str) and high < math.inf:
            yield row, high + 1 if row.kind is Kind.INTEGER else math.nextafter(high, math.inf)


OUTSIDE = list(beyond())


@pytest.mark.parametrize(("row", "value"), OUTSIDE, ids=lambda one: getattr(one, "name", None))
def test_files_and_configurations_refuse_the_same(
    row: Parameter, value: float, iiwa: Settings
) -> None:
    with pytest.raises(SettingsError, match="is not allowed; use a"):
        convert(row, row.name, Entry(value, ""))
    with pytest.raises(ConfigError) as caught:
        made(iiwa, row, value)
    assert caught.value.key == f"{J2}.{row.name}"


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("limits.upper", -2.06, "a number above -2.05949"),
        ("limits.peak_current", 13.0, "a number above 13"),
        ("impedance.stiffness", 5001.0, "a number from 0 to 5000"),
        ("reference_speed", 1.5, "a number above 0 and up to 1.4835"),
        ("calibration.speed", 1.5, "a number above 0 and up to 1.4835"),
        ("inertia_mean", 2.0, "a number of at least 2.70567"),
    ],
)
def test_a_parameter_that_bounds_another(
    name: str, value: float, allowed: str, iiwa: Settings
) -> None:
    """Refused with the value of the bound; the reference has its name."""
    row = JOINT_BY_NAME[name]
    assert convert(row, name, Entry(value, "")) == value
    with pytest.raises(ConfigError) as caught:
        made(iiwa, row, value)
    assert (caught.value.key, caught.value.allowed) == (f"{J2}.{name}", allowed)


def test_bounds_in_the_reference() -> None:
    found = {row.name: row.range_text for row in (*BOARD, *JOINT)}
    assert found["control_rate"] == "a number from 10 to 20000"
    assert found["gravity"] == "a list of numbers from -1000 to 1000"
    assert found["limits.upper"] == "a number above limits.lower"
    assert found["limits.lower"] == found["home"] == "a number"
    assert found["reference_speed"] == "a number above 0 and up to limits.velocity"
    assert found["impedance.damping"] == "a number from 0 to impedance.max_damping"
    assert found["inertia_max"] == "a number of at least inertia_mean"
    assert found["limits.torque"] == "a number above 0"
    assert found["startup_mode"] == "idl, pos"


def test_numbers_stay_apart_from_zero_and_infinity() -> None:
    """But where infinity means "none"."""
    infinite = {row.name for row in NUMBERS if math.inf in map(abs, row.bounds)}
    limits = {f"limits.{name}" for name in ("lower", "upper", "hard_lower", "hard_upper")}
    pids = ("position_pid", "direct_pid", "torque_pid", "current_pid")
    assert infinite == limits | {f"{pid}.integral_limit" for pid in pids} | {"max_travel_error"}
    assert JOINT_BY_NAME["limits.torque"].bounds == (TINY, HUGE)


def test_text_and_unit_describe_a_parameter() -> None:
    assert JOINT_BY_NAME["current_pid.ki"].description == "Current PI: integral gain [V/(A·s)]."
    assert JOINT_BY_NAME["torque_sensor"].description.startswith(
        "Torque sensor present, as TORQUE"
    )
    for row in (*BOARD, *JOINT):
        assert not row.text.endswith("."), row.name


@pytest.mark.parametrize("row", [*BOARD, *JOINT], ids=lambda row: str(row.name))
def test_descriptions_need_no_knowledge_of_the_rules(row: Parameter) -> None:
    """``ros2 param describe`` shows them: words, and no rule's code."""
    assert not re.search(r"\b[A-Z]\d{1,2}\b", row.description)
