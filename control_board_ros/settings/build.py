# SPDX-License-Identifier: Apache-2.0
"""Complete parameter values -> the configuration of the board and of its plant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from ..core.config.config import EXTERNAL, BoardConfig, ConfigError, JointConfig
from ..core.config.parameter import Parameter, parameters_of, parts_of
from ..core.model.arm_model import ArmModel
from ..core.model.coupling import Coupling
from ..description.arm_model import Motors as MotorData
from ..description.arm_model import arm_model
from ..description.couplings import coupling_of
from ..description.urdf import Urdf
from ..sim.config import IDEAL, PYBULLET, JointSimulation, SimulationConfig
from .couplings import Motors, motor_coupling
from .parts import name_lists
from .schema import VIRTUAL

T = TypeVar("T")
Values = Mapping[str, Any]


def configure(made: type[T], values: Values, prefix: str, **fields: Any) -> T:
    """A configuration of the values whose names begin with a prefix.

    Args:
        made: Its class.
        values: By full parameter name.
        prefix: Empty, or with a dot at its end.
        fields: Fields that are not parameters.

    Raises:
        ConfigError: a value is not allowed.
    """
    for row in parameters_of(made):
        if row.name not in fields:
            fields[row.name] = _typed(row, values[prefix + row.name])
    for part in parts_of(made):
        if part.name not in fields:
            fields[part.name] = configure(part.made, values, f"{prefix}{part.name}.")
    return made(**fields)


def _typed(row: Parameter, value: Any) -> Any:
    """A value in the type of its field: modes for codes, tuples for lists."""
    if isinstance(value, list):
        return tuple(row.choices.get(item, item) for item in value)
    return row.choices.get(value, value) if row.choices else value


def joint(values: Values, name: str, kind: str) -> JointConfig:
    """The configuration of one joint; raises ConfigError for a value that is not allowed."""
    none = {"calibration": None} if values[f"{name}.calibration.type"] == 0 else {}
    key = f"{name}.torque_sensor"
    external = values[key] == EXTERNAL
    values = {**values, key: True} if external else values
    more: dict[str, Any] = {"external_torque": external, **none}
    return configure(JointConfig, values, f"{name}.", name=name, kind=kind, **more)


def board(
    values: Values, urdf: Urdf, names: tuple[str, ...], motors: Sequence[Motors] = ()
) -> BoardConfig:
    """The configuration of the board; raises ConfigError for a value that is not allowed."""
    kinds = {axis.name: axis.kind for axis in urdf.axes}
    joints = tuple(joint(values, name, kinds[name]) for name in names)
    return board_of(values, joints, model(values, urdf, names), couplings(urdf, names, motors))


class Couplings(NamedTuple):
    """Of a board's joints with physical ones, and with motors; None: they are these."""

    joints: Coupling | None
    motors: Coupling | None


def couplings(urdf: Urdf, names: tuple[str, ...], motors: Sequence[Motors]) -> Couplings:
    """The couplings of a board's joints.

    Raises:
        ConfigError: some axes of a coupling are missing.
    """
    try:
        return Couplings(coupling_of(urdf, names), motor_coupling(motors, names))
    except ValueError as error:
        raise ConfigError("joints", list(names), str(error)) from None


def model(values: Values, urdf: Urdf, names: tuple[str, ...]) -> ArmModel | None:
    """The masses of some joints, with the rest of the robot at its home pose.

    None where the joints do not feel the URDF's masses: floating base, ideal body. A custom plant
    uses them for gravity compensation only (G1).
    """
    plant = bool(values["plant"])
    if not values["base_fixed"] or (values["physics"] == IDEAL and not plant):
        return None
    return replace(urdf_model(values, urdf, names), trusted=not plant)


def urdf_model(values: Values, urdf: Urdf, names: tuple[str, ...]) -> ArmModel:
    """The links of some joints as the URDF has them, whether or not the joints feel them."""
    homes = {
        axis.name: values[f"{axis.name}.home"]
        for axis in urdf.axes
        if f"{axis.name}.home" in values
    }
    rotors = {
        name: values[f"{name}.motor.inertia"] * values[f"{name}.motor.gear_ratio"] ** 2
        for name in names
    }
    made = MotorData(
        rotors=rotors,
        coulomb={name: values[f"{name}.motor.coulomb"] for name in names},
        viscous={name: values[f"{name}.motor.viscous"] for name in names},
        moved={name: values[f"{name}.inertia"] for name in names},
        in_links=rotors_in_links(values),
    )
    x, y, z = values["gravity"]
    return arm_model(urdf, names, made, homes, (x, y, z))


def rotors_in_links(values: Values) -> bool:
    """Whether rotors turn with their whole links, as in pybullet."""
    return values["physics"] == PYBULLET and values["plant"][: len(VIRTUAL)] in ("", VIRTUAL)


def board_of(
    values: Values,
    joints: tuple[JointConfig, ...],
    masses: ArmModel | None,
    coupled: Couplings,
) -> BoardConfig:
    """The configuration of the board from its joints, their masses and their couplings.

    Raises:
        ConfigError: a value is not allowed.
    """
    coupling = coupled.joints or Coupling.plain([config.name for config in joints])
    for config in joints:
        if config.yields and config.name not in coupling.physical_joints:
            key = f"{config.name}.admittance.dead_band"
            allowed = "0 for an axis of a coupling: its weight is unknown"
            raise ConfigError(key, config.admittance.dead_band, allowed)
        if not config.gravity_compensation:
            continue
        key = f"{config.name}.gravity_compensation"
        if not values["base_fixed"]:
            raise ConfigError(
                key, True, "false where base_fixed is false: the direction of gravity is unknown"
            )
        if config.name not in coupling.physical_joints:
            raise ConfigError(key, True, "false for an axis of a coupling: its weight is unknown")
    return configure(
        BoardConfig,
        values,
        "",
        joints=joints,
        model=masses,
        coupling=coupled.joints,
        motor_coupling=coupled.motors,
        calibration_groups=name_lists(values["calibration_groups"]),
    )


def simulation(values: Values, urdf: Urdf, names: tuple[str, ...]) -> SimulationConfig:
    """The configuration of the plant; raises ConfigError for a value that is not allowed."""
    return configure(
        SimulationConfig,
        values,
        "",
        joints=tuple(configure(JointSimulation, values, f"{name}.", name=name) for name in names),
        urdf=urdf,
    )
