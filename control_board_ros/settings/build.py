# SPDX-License-Identifier: Apache-2.0
"""Complete parameter values -> the configuration of the board and of its plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ..core.config.config import EXTERNAL, BoardConfig, ConfigError, JointConfig
from ..core.config.parameter import Parameter, parameters_of, parts_of
from ..core.model.arm_model import ArmModel
from ..core.model.coupling import Coupling
from ..description.arm_model import Motors, arm_model
from ..description.urdf import Urdf
from ..sim.config import IDEAL, PYBULLET, JointSimulation, SimulationConfig

T = TypeVar("T")
Values = Mapping[str, Any]


def configure(made: type[T], values: Values, prefix: str, **given: Any) -> T:
    """A configuration of the values whose names begin with a prefix.

    Args:
        made: Its class.
        values: By full parameter name.
        prefix: Empty, or with a dot at its end.
        given: Fields that are not parameters.

    Raises:
        ConfigError: a value is not allowed.
    """
    for row in parameters_of(made):
        if row.name not in given:
            given[row.name] = _typed(row, values[prefix + row.name])
    for part in parts_of(made):
        if part.name not in given:
            given[part.name] = configure(part.made, values, f"{prefix}{part.name}.")
    return made(**given)


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
    given = {**values, key: True} if external else values
    more: dict[str, Any] = {"external_torque": external, **none}
    return configure(JointConfig, given, f"{name}.", name=name, kind=kind, **more)


def board(values: Values, urdf: Urdf, names: tuple[str, ...]) -> BoardConfig:
    """The configuration of the board; raises ConfigError for a value that is not allowed."""
    kinds = {one.name: one.kind for one in urdf.joints}
    joints = tuple(joint(values, name, kinds[name]) for name in names)
    return board_of(values, joints, model(values, urdf, names), coupling(urdf, names))


def coupling(urdf: Urdf, names: tuple[str, ...]) -> Coupling | None:
    """The coupling of joints with those that follow them; None where none follows."""
    followers = [mimic for mimic in urdf.mimics.values() if mimic.leader in names]
    followers = [mimic for mimic in followers if mimic.follower not in names]
    if not followers:
        return None
    plain = Coupling.plain(names)
    return Coupling(
        names,
        (*names, *(mimic.follower for mimic in followers)),
        (
            *plain.rows,
            *(
                tuple(mimic.multiplier if name == mimic.leader else 0.0 for name in names)
                for mimic in followers
            ),
        ),
        (*plain.offset.tolist(), *(mimic.offset for mimic in followers)),
    )


def model(values: Values, urdf: Urdf, names: tuple[str, ...]) -> ArmModel | None:
    """The masses of some joints, with the rest of the robot at its home pose.

    None where the joints do not feel the URDF's masses: floating base, ideal body. A custom plant
    uses them for gravity compensation only (G1).
    """
    plant = bool(values["plant"])
    if not values["base_fixed"] or (values["physics"] == IDEAL and not plant):
        return None
    homes = {
        one.name: values[f"{one.name}.home"] for one in urdf.joints if f"{one.name}.home" in values
    }
    rotors = {
        name: values[f"{name}.motor.inertia"] * values[f"{name}.motor.gear_ratio"] ** 2
        for name in names
    }
    motors = Motors(
        rotors=rotors,
        coulomb={name: values[f"{name}.motor.coulomb"] for name in names},
        viscous={name: values[f"{name}.motor.viscous"] for name in names},
        in_links=values["physics"] == PYBULLET,
    )
    x, y, z = values["gravity"]
    return replace(arm_model(urdf, names, motors, homes, (x, y, z)), trusted=not plant)


def board_of(
    values: Values,
    joints: tuple[JointConfig, ...],
    masses: ArmModel | None,
    coupled: Coupling | None = None,
) -> BoardConfig:
    """The configuration of the board from its joints, their masses and their coupling.

    Raises:
        ConfigError: a value is not allowed.
    """
    for own in joints:
        if own.gravity_compensation and not values["base_fixed"]:
            key = f"{own.name}.gravity_compensation"
            raise ConfigError(
                key, True, "false where base_fixed is false: gravity's way is unknown"
            )
    return configure(
        BoardConfig,
        values,
        "",
        joints=joints,
        model=masses,
        coupling=coupled,
        calibration_groups=tuple(
            tuple(name.strip() for name in group.split(","))
            for group in values["calibration_groups"]
        ),
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
