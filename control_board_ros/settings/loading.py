# SPDX-License-Identifier: Apache-2.0
"""From parameter files to a board and its plant, with or without ROS.

    settings = load("iiwa")                          # a shipped configuration
    settings = load("my_robot.yaml", {"output": "current"})
    plant = SimulatedPlant(settings.board, settings.simulation)

Layers, the later one wins: what the URDF implies, the robot's shipped configuration, the
files, the overrides. Within a layer ``<joint>.x`` wins over ``joint_defaults.x``.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ..core.config import BoardConfig, ConfigError
from ..description.assumed import Assumed
from ..description.derive import complete
from ..description.robots import ROBOTS, load_robot
from ..description.urdf import Urdf, UrdfError
from ..sim.config import SimulationConfig
from . import build
from .params_file import Entry, Layer, SettingsError, read_file, shown
from .schema import BOARD, BOARD_BY_NAME, JOINT, JOINT_BY_NAME, JOINT_DEFAULTS, find_row
from .shipped import find_config
from .values import convert

__all__ = ["Settings", "SettingsError", "find_config", "load", "load_layers"]

LEAST_PHYSICS_RATE = 1000.0  # Hz, where nobody gives one
LEAST_CONTROL_RATE = 200.0  # Hz, for which gains are made
#: Parameters that every ROS node has; they are the node's, not the board's.
ROS_NAMES = ("use_sim_time", "start_type_description_service")
ROS_PREFIXES = ("qos_overrides.",)


@dataclass(frozen=True, slots=True)
class Settings:
    """All that a board and its plant are made of.

    Attributes: values (every parameter by its full name, ``joint_defaults.*`` only where
    given), urdf (the robot), ros (parameters of the ROS node itself), warnings and notes
    (what was assumed; one line each), where (the origin of each given value).
    """

    board: BoardConfig
    simulation: SimulationConfig
    urdf: Urdf
    values: dict[str, Any]
    ros: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    where: dict[str, str] = field(default_factory=dict)

    @property
    def description(self) -> str:
        """The text for ``robot_description``."""
        return self.urdf.description

    def changed(self, changes: Mapping[str, Any]) -> Settings:
        """The settings with some run-time parameters changed, checked as a whole.

        Raises:
            SettingsError: a parameter is unknown or fixed, or a value is not allowed.
        """
        values = dict(self.values)
        for name, value in changes.items():
            row = find_row(name, self.board.names)
            if row is None or name not in values:
                raise SettingsError(unknown(name, values))
            if not row.run_time or name.startswith(JOINT_DEFAULTS + "."):
                raise SettingsError(f"{name}: is fixed while the board runs; set it at start")
            values[name] = convert(row, name, Entry(value, ""))
        touched = {name for name in self.board.names if any(_owned(c, name) for c in changes)}
        for name in touched:
            self._restart(name, values)
        try:
            joints = tuple(
                build.joint(values, one.name, one.kind) if one.name in touched else one
                for one in self.board.joints
            )
            board = replace(self.board, joints=joints)
        except ConfigError as error:
            raise SettingsError(_blame(error, changes, values)) from None
        return replace(self, board=board, values=values)

    def _restart(self, name: str, values: dict[str, Any]) -> None:
        """Keep a calibration's start that nobody gives within the joint's limits."""
        if (key := f"{name}.calibration.start") not in self.where:
            low, high = values[f"{name}.limits.lower"], values[f"{name}.limits.upper"]
            values[key] = min(max(values[f"{name}.home"], low), high)


def load(
    source: str | os.PathLike[str] | None = None, overrides: Mapping[str, Any] | None = None
) -> Settings:
    """Settings of a file, of a shipped configuration by name, or (None) of the default robot.

    Args:
        source: ``iiwa``, ``minimal``, …, or the path of a ROS parameter file.
        overrides: Values by full parameter name, over those of the file.

    Raises:
        SettingsError: one line: where, name, value, what is allowed, the next step.
    """
    layers = []
    if source is not None:
        path = find_config(source) if isinstance(source, str) and _is_name(source) else source
        layers.append(read_file(Path(path)))
    layers.append(Layer({name: Entry(v, "overrides") for name, v in (overrides or {}).items()}))
    return load_layers(layers)


def _is_name(source: str) -> bool:
    return "/" not in source and not source.endswith((".yaml", ".yml"))


def load_layers(layers: Iterable[Layer]) -> Settings:
    """Settings of layers, the last one strongest; the robot's shipped layer comes first."""
    given = list(layers)
    robot, folder = _robot(given)
    if robot in ROBOTS:
        base = find_config(robot)
        if all(layer.path != base.absolute() for layer in given):
            given.insert(0, read_file(base))
    try:
        urdf = load_robot(robot, folder)
    except UrdfError as error:
        entry = _last(given, "robot")
        at = f"{entry.where}: " if entry is not None else ""
        raise SettingsError(f"{at}robot: {error}") from None
    ros = _take_ros(given)
    _check_names(given, urdf)
    board = _board_values(given)
    names = _joint_names(board, urdf, _last(given, "joints"))
    values, where = dict(board), _origins(given)
    try:
        found, assumed = _joint_values(given, names, urdf, board, where)
        for name, joint_values in found.items():
            values.update({f"{name}.{key}": value for key, value in joint_values.items()})
        made = build.board(values, urdf, names)
        simulation = build.simulation(values, urdf, names)
        simulation.check_board(made)
    except ConfigError as error:
        raise SettingsError(_explain(error, where)) from None
    values["robot"], values["joints"] = robot, list(names)
    for layer in given:
        for name, entry in layer.entries.items():
            if name.startswith(JOINT_DEFAULTS + "."):
                row = JOINT_BY_NAME[name.partition(".")[2]]
                values[name] = convert(row, name, entry)
    warnings = urdf.warnings + assumed.warnings + _slow(values["control_rate"])
    notes = () if robot in ROBOTS else assumed.notes
    return Settings(made, simulation, urdf, values, ros, warnings, notes, where)


def _slow(rate: float) -> tuple[str, ...]:
    """A warning where the control rate is too low for the gains."""
    if rate >= LEAST_CONTROL_RATE:
        return ()
    return (
        f"control_rate: {rate:g} Hz is too slow for the gains, which are made for "
        f"{LEAST_CONTROL_RATE:g} to 4000 Hz: stiff joints may shake, and fault by overcurrent; "
        f"use {LEAST_CONTROL_RATE:g} or more",
    )


def _robot(layers: list[Layer]) -> tuple[str, Path | None]:
    """The robot asked for, and the folder that its path is relative to."""
    row, robot, folder = BOARD_BY_NAME["robot"], str(BOARD_BY_NAME["robot"].default), None
    for layer in layers:
        if "robot" in layer.entries:
            robot = convert(row, "robot", layer.entries["robot"])
            folder = layer.folder
    return robot, folder


def _last(layers: list[Layer], name: str) -> Entry | None:
    return next((one.entries[name] for one in reversed(layers) if name in one.entries), None)


def _origins(layers: list[Layer]) -> dict[str, str]:
    return {name: entry.where for layer in layers for name, entry in layer.entries.items()}


def _take_ros(layers: list[Layer]) -> dict[str, Any]:
    """Take the ROS node's own parameters out of the layers."""
    found = {}
    for layer in layers:
        for name in list(layer.entries):
            if name in ROS_NAMES or name.startswith(ROS_PREFIXES):
                entry = layer.entries.pop(name)
                if name in ROS_NAMES and not isinstance(entry.value, bool):
                    raise SettingsError(
                        f"{entry.where}: {name}: {shown(entry.value)} is not allowed; "
                        "use true or false"
                    )
                found[name] = entry.value
    return found


def _owned(name: str, joint: str) -> bool:
    return name.startswith(joint + ".")


def unknown(name: str, known: Iterable[str]) -> str:
    """The message for a parameter name that does not exist."""
    near = get_close_matches(name[:200], list(known), n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}?" if near else "see docs/parameters.md"
    return f"{shown(name)}: no such parameter; {hint}"


def _check_names(layers: list[Layer], urdf: Urdf) -> None:
    joints = urdf.independent
    for layer in layers:
        for name, entry in layer.entries.items():
            if find_row(name, joints) is None:
                known = [*BOARD_BY_NAME, JOINT_DEFAULTS]
                owners = (JOINT_DEFAULTS, *joints)
                known += [f"{owner}.{row.name}" for owner in owners for row in JOINT]
                raise SettingsError(f"{entry.where}: {unknown(name, known)}")


def _board_values(layers: list[Layer]) -> dict[str, Any]:
    values = {row.name: row.default for row in BOARD}
    for layer in layers:
        for name, entry in layer.entries.items():
            if name in BOARD_BY_NAME:
                values[name] = convert(BOARD_BY_NAME[name], name, entry)
    if values["physics_rate"] is None:
        rate = values["control_rate"]
        values["physics_rate"] = rate * math.ceil(LEAST_PHYSICS_RATE / rate)
    return values


def _joint_names(board: Mapping[str, Any], urdf: Urdf, entry: Entry | None) -> tuple[str, ...]:
    chosen = tuple(board["joints"]) or urdf.independent
    at = f"{entry.where}: " if entry is not None else ""
    for name in chosen:
        if name in urdf.independent and chosen.count(name) == 1:
            continue
        if name in urdf.mimics:
            reason = f"it follows {urdf.mimics[name].leader!r}; leave it out"
        elif name in urdf.independent:
            reason = "it is there twice; leave one out"
        else:
            near = get_close_matches(name, urdf.independent, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            reason = f"{hint}joints: {', '.join(urdf.independent)}"
        raise SettingsError(f"{at}joints: {shown(name)} is not allowed; {reason}")
    for reserved in (JOINT_DEFAULTS, "qos_overrides"):
        if reserved in chosen:
            raise SettingsError(f"{at}joints: {reserved!r} is not allowed as a joint's name")
    return chosen


def _joint_values(
    layers: list[Layer],
    names: tuple[str, ...],
    urdf: Urdf,
    board: Mapping[str, Any],
    where: dict[str, str],
) -> tuple[dict[str, dict[str, Any]], Assumed]:
    """The complete parameters of every joint of the board; notes where each came from."""
    found: dict[str, dict[str, Any]] = {name: {} for name in names}
    for layer in layers:
        for name, entry in layer.entries.items():
            owner, _, key = name.partition(".")
            if owner == JOINT_DEFAULTS:
                value = convert(JOINT_BY_NAME[key], name, entry)
                for joint in names:
                    found[joint][key] = value
                    where[f"{joint}.{key}"] = entry.where
        for name, entry in layer.entries.items():
            for joint in names:
                if _owned(name, joint) and (row := JOINT_BY_NAME.get(name[len(joint) + 1 :])):
                    found[joint][row.name] = convert(row, name, entry)
                    where[name] = entry.where
    plain = {row.name: row.default for row in JOINT if row.default is not None}
    for values in found.values():
        for key, default in plain.items():
            values.setdefault(key, default)
    x, y, z = board["gravity"]
    assumed = complete(found, urdf, (x, y, z), board["control_rate"])
    for values in found.values():
        if not values["torque_sensor"]:  # I7
            values["control_modes"] = [m for m in values["control_modes"] if m != "torq"]
            values["interaction_modes"] = [m for m in values["interaction_modes"] if m != "comp"]
    return found, assumed


def _blame(error: ConfigError, changes: Mapping[str, Any], values: Mapping[str, Any]) -> str:
    """A configuration error by the change that caused it, not by what it does not fit."""
    if error.key in changes:
        return str(error)
    joint = error.key.partition(".")[0]
    guilty = [name for name in changes if _owned(name, joint)] or list(changes)
    told = ", ".join(f"{name}: {values[name]!r} is not allowed" for name in guilty)
    return f"{told}; {error.key} is {error.value!r} and would have to be {error.allowed}"


def _explain(error: ConfigError, where: Mapping[str, str]) -> str:
    """A configuration error with the place of the value that caused it."""
    key = error.key.removeprefix("simulation.")
    # Where nobody gave this end of a range, the other end is what does not fit.
    other = key.replace("upper", "lower") if "upper" in key else key.replace("lower", "upper")
    at = where.get(key) or where.get(other)
    return f"{at}: {key}: {error.value!r} is not allowed; {error.allowed}" if at else str(error)
