# SPDX-License-Identifier: Apache-2.0
"""Complete parameter values -> the configuration of the board and of its plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

from ..core.config import (
    BoardConfig,
    Calibration,
    Impedance,
    JointConfig,
    Limits,
    Motor,
    Pid,
    Timeouts,
)
from ..core.vocabs import parse_control_mode, parse_interaction_mode
from ..description.urdf import Urdf
from ..sim.config import Encoder, JointSimulation, MotorModel, SimulationConfig

T = TypeVar("T")
Values = Mapping[str, Any]

#: Parameters of a joint that are attributes of its configuration as they are.
PLAIN = (
    "back_emf_compensation",
    "reference_speed",
    "reference_acceleration",
    "torque_sensor",
    "max_travel_error",
    "inertia_min",
    "inertia_mean",
    "inertia_max",
)


def _part(made: type[T], values: Values, prefix: str) -> T:
    """One dataclass of the values under a prefix; modes from their codes."""
    given = {}
    for item in fields(made):  # type: ignore[arg-type]
        value = values[f"{prefix}.{item.name}"]
        if item.name.endswith("interaction_mode"):
            value = parse_interaction_mode(value)
        elif item.name.endswith("control_mode"):
            value = parse_control_mode(value)
        given[item.name] = value
    return made(**given)


def joint(values: Values, name: str, kind: str) -> JointConfig:
    """The configuration of one joint.

    Raises:
        ConfigError: a value is not allowed.
    """
    calibration = None
    if values[f"{name}.calibration.type"] != 0:
        calibration = _part(Calibration, values, f"{name}.calibration")
    return JointConfig(
        name=name,
        kind=kind,
        limits=_part(Limits, values, f"{name}.limits"),
        position_pid=_part(Pid, values, f"{name}.position_pid"),
        direct_pid=_part(Pid, values, f"{name}.direct_pid"),
        torque_pid=_part(Pid, values, f"{name}.torque_pid"),
        current_pid=_part(Pid, values, f"{name}.current_pid"),
        impedance=_part(Impedance, values, f"{name}.impedance"),
        motor=_part(Motor, values, f"{name}.motor"),
        timeouts=_part(Timeouts, values, f"{name}.timeouts"),
        control_modes=tuple(map(parse_control_mode, values[f"{name}.control_modes"])),
        interaction_modes=tuple(map(parse_interaction_mode, values[f"{name}.interaction_modes"])),
        startup_mode=parse_control_mode(values[f"{name}.startup_mode"]),
        startup_interaction=parse_interaction_mode(values[f"{name}.startup_interaction"]),
        calibration=calibration,
        **{key: values[f"{name}.{key}"] for key in PLAIN},
    )


def board(values: Values, urdf: Urdf, names: tuple[str, ...]) -> BoardConfig:
    """The configuration of the board.

    Raises:
        ConfigError: a value is not allowed.
    """
    kinds = {one.name: one.kind for one in urdf.joints}
    groups = [
        tuple(name.strip() for name in group.split(",")) for group in values["calibration_groups"]
    ]
    return BoardConfig(
        joints=tuple(joint(values, name, kinds[name]) for name in names),
        control_rate=values["control_rate"],
        output=values["output"],
        autoconfigure=values["autoconfigure"],
        calibration_groups=tuple(groups),
    )


def simulation(values: Values, urdf: Urdf, names: tuple[str, ...]) -> SimulationConfig:
    """The configuration of the plant.

    Raises:
        ConfigError: a value is not allowed.
    """
    x, y, z = values["gravity"]
    return SimulationConfig(
        joints=tuple(
            JointSimulation(
                name=name,
                home=values[f"{name}.home"],
                inertia=values[f"{name}.inertia"],
                motor=_part(MotorModel, values, f"{name}.motor"),
                encoder=_part(Encoder, values, f"{name}.encoder"),
            )
            for name in names
        ),
        urdf=urdf,
        base_fixed=values["base_fixed"],
        gravity=(x, y, z),
        physics_rate=values["physics_rate"],
        gui=values["gui"],
    )
