# SPDX-License-Identifier: Apache-2.0
"""From parameter files to a board and its plant, with or without ROS.

    settings = load("iiwa")                          # a shipped configuration
    settings = load("my_robot.yaml", {"output": "current"})
    plant = SimulatedPlant(settings.board, settings.simulation)

Layers, in ascending priority: values implied by the URDF, the robot's shipped configuration, the
files, the overrides. Within a layer ``<joint>.x`` overrides ``joint_defaults.x``.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..core.board import complete_levels
from ..core.config.config import BoardConfig, ConfigError
from ..core.config.parameter import Parameter
from ..core.goals.pose import Pose
from ..core.model.coupling import Coupling
from ..core.terms.drives import SetPoint
from ..core.terms.modes import SENSE_TORQUE
from ..description.derive import complete
from ..description.robots import EXTENDS, NAMES, load_robot, located, remark_of
from ..description.urdf import Urdf, UrdfError
from ..sim.config import DEFAULT_PHYSICS, SimulationConfig
from . import build, stability
from .couplings import (
    COUPLINGS,
    CouplingEntries,
    axes_of,
    coupled,
    prefixed_couplings,
    take_couplings,
)
from .couplings import values_of as couplings_of
from .layers import (
    find_config,
    joints_of,
    merged,
    prefix_of,
    prefixed,
    robot_of,
    typed,
    unknown,
    without_ros,
)
from .params_file import NODE_NAME, Entries, Entry, Layer, SettingsError, convert, read_file
from .parts import NAME, PARTS, Table, as_name, check_parts, groups_of, name_lists, take_parts
from .poses import POSES, poses_of, values_of
from .schema import (
    BOARD,
    JOINT,
    JOINT_DEFAULTS,
    PLANT_TIMEOUT,
    VIRTUAL,
    VIRTUAL_TIMEOUT,
    find_row,
)

__all__ = ["Settings", "SettingsError", "find_config", "load", "load_layers"]

LEAST_PHYSICS_RATE = 1000.0  # Hz, default
LEAST_CONTROL_RATE = 200.0  # Hz, lower bound of the gains' design range
#: Codes of modes that require a torque sensor (I7).
SENSING = tuple(mode.code for mode in SENSE_TORQUE)


@dataclass(frozen=True, slots=True)
class Settings:
    """The configuration of a board and its plant.

    Attributes:
        board: The configuration of the board.
        simulation: That of its plant.
        urdf: The robot.
        values: Every parameter by its full name, ``joint_defaults.*`` only where given.
        ros: Parameters of the ROS node itself.
        warnings: Possible problems; one line each.
        notes: Assumptions; one line each.
        where: The origin of each given value.
        poses: Those of the configuration, by name; always with home and park (R5).
        parts: The joints of each part; empty: a single board.
        coupled: The couplings of the configuration (Y3).
    """

    board: BoardConfig
    simulation: SimulationConfig
    urdf: Urdf
    values: dict[str, Any]
    ros: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    where: dict[str, str] = field(default_factory=dict)
    poses: dict[str, Pose] = field(default_factory=dict)
    parts: Table = field(default_factory=dict)
    coupled: CouplingEntries = field(default_factory=lambda: CouplingEntries({}, ()))

    @property
    def robot_name(self) -> str:
        """Prefix of the node names of a robot of several parts."""
        name = str(self.values["robot_name"] or self.values["robot"])
        return name if NAME.fullmatch(name) else as_name(self.urdf.name)

    @property
    def levels(self) -> tuple[tuple[str, ...], ...]:
        """The parts of each start-up level (R4)."""
        return name_lists(self.values["startup_levels"])

    def part(self, name: str) -> Settings:
        """The settings of one part, as a single board."""
        names = self.parts[name]
        foreign = (POSES, PARTS, COUPLINGS, *(j for j in self.board.names if j not in names))
        others = tuple(f"{owner}." for owner in foreign)
        groups = tuple(
            group
            for whole in self.board.calibration_groups
            if (group := tuple(joint for joint in whole if joint in names))
        )
        by_name = {joint.name: joint for joint in self.board.joints}
        joints = tuple(by_name[joint] for joint in names)
        model = build.model(self.values, self.urdf, names) if self.board.model else None
        couplings = build.couplings(self.urdf, names, self.coupled.motors)
        board = replace(
            self.board,
            joints=joints,
            calibration_groups=groups,
            model=model,
            coupling=couplings.joints,
            motor_coupling=couplings.motors,
        )
        poses = {n: part for n, pose in self.poses.items() if (part := pose.of(names)) is not None}
        values = {key: value for key, value in self.values.items() if not key.startswith(others)}
        values |= {
            "joints": list(names),
            "calibration_groups": [",".join(group) for group in groups],
        }
        values |= values_of(poses) | couplings_of(self.coupled.entries, names)
        return replace(
            self, board=board, values=values, warnings=(), notes=(), poses=poses, parts={}
        )

    @property
    def physical(self) -> Coupling | None:
        """The coupling of the joints with physical ones that a file declares; None: they are."""
        declared = {axis for group in self.urdf.coupled for axis in group.coupling.axes}
        return self.board.coupling if declared.intersection(self.board.names) else None

    @property
    def description(self) -> str:
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
        touched = {
            name for name in self.board.names if any(c.startswith(name + ".") for c in changes)
        }
        for name in touched:
            self._restart(name, values)
        try:
            joints = tuple(
                build.joint(values, joint.name, joint.kind) if joint.name in touched else joint
                for joint in self.board.joints
            )
            couplings = build.Couplings(self.board.coupling, self.board.motor_coupling)
            board = build.board_of(values, joints, self.board.model, couplings)
        except ConfigError as error:
            raise SettingsError(_blame(error, changes, values)) from None
        return replace(self, board=board, values=values)

    def _restart(self, name: str, values: dict[str, Any]) -> None:
        """Clip a default calibration start to the joint's limits."""
        if (key := f"{name}.calibration.start") not in self.where:
            low, high = values[f"{name}.limits.lower"], values[f"{name}.limits.upper"]
            values[key] = min(max(values[f"{name}.home"], low), high)


def load(
    source: str | os.PathLike[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    on_top: Iterable[str | os.PathLike[str]] = (),
    node: str = NODE_NAME,
) -> Settings:
    """Settings of a file, of a shipped configuration by name, or of the default robot (None).

    Args:
        source: ``iiwa``, ``minimal``, …, or the path of a ROS parameter file or a URDF.
        overrides: Values by full parameter name, over those of the files.
        on_top: Further files, over the first one, in ascending priority.
        node: Full name of the node whose sections of the files count.

    Raises:
        SettingsError: one line: where, name, value, what is allowed, the next step.
    """
    layers = []
    if source is not None and is_urdf(source):
        layers.append(Layer({"robot": Entry(os.fspath(source), "")}))
    elif source is not None:
        path = find_config(source) if isinstance(source, str) and _is_name(source) else source
        layers.append(read_file(Path(path), node))
    layers += [read_file(Path(path), node) for path in on_top]
    layers.append(Layer({name: Entry(v, "overrides") for name, v in (overrides or {}).items()}))
    return load_layers(layers)


def is_urdf(source: str | os.PathLike[str]) -> bool:
    """Whether it is the path of a URDF, or of a xacro file, which arguments may follow."""
    return re.search(r"\.(urdf|xacro)( |$)", os.fspath(source)) is not None


def _is_name(source: str) -> bool:
    return "/" not in source and not source.endswith((".yaml", ".yml"))


def load_layers(layers: Iterable[Layer]) -> Settings:
    """Settings of layers in ascending priority, above the robot's shipped layer."""
    all_layers = list(layers)
    robot, folder, where = robot_of(all_layers)
    if robot in NAMES:
        for name in (robot, EXTENDS.get(robot)):
            base = find_config(name) if name else None
            if base is not None and all(layer.path != base.absolute() for layer in all_layers):
                all_layers.insert(0, read_file(base))
    try:
        urdf = load_robot(robot, folder)
    except UrdfError as error:
        raise SettingsError(f"{where}: robot: {error}" if where else f"robot: {error}") from None
    ours, ros = without_ros(all_layers)
    prefix = prefix_of(ours)
    ours, couplings = take_couplings(ours)
    names = {*urdf.independent, *axes_of(couplings)}
    ours = [prefixed(layer, names, prefix) for layer in ours]
    couplings = prefixed_couplings(couplings, prefix)
    urdf, motors = coupled(urdf.with_prefix(prefix), couplings)
    ours, table = take_parts(ours)
    entries = merged([typed(layer, urdf.independent) for layer in ours], urdf)
    if "robot" in entries:
        entries["robot"] = Entry(located(robot, folder), where)
    return _settings(entries, urdf, ros, table, CouplingEntries(couplings, motors))


def _settings(
    entries: Mapping[str, Entry],
    urdf: Urdf,
    ros: dict[str, Any],
    table: Entries,
    coupled: CouplingEntries,
) -> Settings:
    """Settings of the given entries, completed by defaults and derived values."""
    parts = check_parts(table, entries)
    where = {name: entry.where for name, entry in entries.items()}
    values = _board_values(entries)
    rate = values["control_rate"]
    for part, joints_there in parts.items():
        joints_of(joints_there, urdf, table[part].where, f"parts.{part}")
    part_joints = [name for of_part in parts.values() for name in of_part]
    names = joints_of(part_joints or values["joints"], urdf, where.get("joints", ""))
    joints = {name: _values(JOINT, entries, f"{name}.") for name in names}
    try:
        x, y, z = values["gravity"]
        motors = build.couplings(urdf, names, coupled.motors).motors
        assumed = complete(joints, urdf, (x, y, z), rate, motors)
        for name, joint_values in joints.items():
            if not joint_values["torque_sensor"]:
                _leave_out_sensing(joint_values)
            values |= {f"{name}.{key}": value for key, value in joint_values.items()}
        if parts:
            values["calibration_groups"] = groups_of(
                values["calibration_groups"], set(urdf.independent) - set(names)
            )
        board = build.board(values, urdf, names, coupled.motors)
        if parts:
            complete_levels(name_lists(values["startup_levels"]), tuple(parts))
        simulation = build.simulation(values, urdf, names)
        simulation.check_board(board)
    except ConfigError as error:
        raise SettingsError(_explain(error, where)) from None
    poses, beyond = poses_of(entries, board, {name: values[f"{name}.home"] for name in names})
    values |= {
        "joints": list(names),
        **{n: entry.value for n, entry in entries.items() if n.startswith(JOINT_DEFAULTS + ".")},
        **values_of(poses),
        **{f"{PARTS}.{part}": list(entry.value) for part, entry in table.items()},
        **couplings_of(coupled.entries, names),
    }
    warnings = urdf.warnings + assumed.warnings + _slow(rate) + beyond
    warnings += tuple(stability.warnings(board).values()) + _remarks(values)
    notes = () if values["robot"] in NAMES else assumed.notes
    return Settings(
        board, simulation, urdf, values, ros, warnings, notes, where, poses, parts, coupled
    )


def _values(
    rows: Iterable[Parameter], entries: Mapping[str, Entry], prefix: str = ""
) -> dict[str, Any]:
    """Given values and defaults of some parameters, without those to derive."""
    values = {}
    for row in rows:
        if (entry := entries.get(prefix + row.name)) is not None:
            values[row.name] = entry.value
        elif row.default is not None:
            values[row.name] = row.default
    return values


def _board_values(entries: Mapping[str, Entry]) -> dict[str, Any]:
    """Values of the whole board; defaults that depend on others, too."""
    values = _values(BOARD, entries)
    rate, virtual = values["control_rate"], values["plant"].startswith(VIRTUAL)
    values.setdefault("physics_rate", rate * math.ceil(LEAST_PHYSICS_RATE / rate))
    values.setdefault("physics", DEFAULT_PHYSICS)
    values.setdefault("plant_timeout", VIRTUAL_TIMEOUT if virtual else PLANT_TIMEOUT)
    return values


def _leave_out_sensing(values: dict[str, Any]) -> None:
    """Leave out the modes of a joint that sense torques (I7).

    With a dead band COMPLIANT remains, by a drive of positions.
    """
    kinds = ["control_modes"]
    if values["admittance.dead_band"]:
        values["drive"] = values["drive"] or [SetPoint.POSITION.code]
    else:
        kinds.append("interaction_modes")
    for kind in kinds:
        values[kind] = [mode for mode in values[kind] if mode not in SENSING]


def _remarks(values: Mapping[str, Any]) -> tuple[str, ...]:
    """What to know of a shipped robot before a real one is driven."""
    plant, robot = values["plant"], values["robot"]
    real = plant and not plant.startswith(VIRTUAL)
    return (f"{robot}: {remark}",) if real and (remark := remark_of(robot)) else ()


def _slow(rate: float) -> tuple[str, ...]:
    """A warning where the control rate is too low for the gains."""
    if rate >= LEAST_CONTROL_RATE:
        return ()
    return (
        f"control_rate: {rate:g} Hz is too slow for the gains, which are made for "
        f"{LEAST_CONTROL_RATE:g} to 4000 Hz: stiff joints may shake, and fault by overcurrent; "
        f"use {LEAST_CONTROL_RATE:g} or more",
    )


def _blame(error: ConfigError, changes: Mapping[str, Any], values: Mapping[str, Any]) -> str:
    """Attribute a configuration error to the change that caused it."""
    if error.key in changes:
        return str(error)
    joint = error.key.partition(".")[0]
    guilty = [name for name in changes if name.startswith(joint + ".")] or list(changes)
    causes = ", ".join(f"{name}: {values[name]!r} is not allowed" for name in guilty)
    return f"{causes}; {error.key} is {error.value!r} and would have to be {error.allowed}"


def _explain(error: ConfigError, where: Mapping[str, str]) -> str:
    """A configuration error with the location of the value that caused it."""
    key = error.key.removeprefix("simulation.")
    # Where this end of a range is a default, report the other end.
    owner, dot, end = key.rpartition(".")
    ends = ("upper", "lower") if "upper" in end else ("lower", "upper")
    at = where.get(key) or where.get(owner + dot + end.replace(*ends))
    return f"{at}: {key}: {error.value!r} is not allowed; {error.allowed}" if at else str(error)
