# SPDX-License-Identifier: Apache-2.0
"""Layers of parameters, in ascending priority, checked and merged; the shipped ones."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from ..core.config.parameter import Parameter
from ..description.urdf import Urdf
from ..text import nearest
from ..urdf_xml import share_folders
from .params_file import Entries, Entry, Layer, SettingsError, convert, shown
from .poses import POSES, known_names
from .schema import BOARD_BY_NAME, JOINT, JOINT_DEFAULTS, find_row

#: Parameters of every ROS node, not of the board.
ROS_NAMES = ("use_sim_time", "start_type_description_service")
ROS_PREFIXES = ("qos_overrides.",)

#: Names not allowed for joints, and why.
RESERVED = {
    name: f"the parameters {name}.* are those of {whose}"
    for name, whose in {
        JOINT_DEFAULTS: "all joints",
        "parts": "the parts",
        "couplings": "the couplings",
        "poses": "the poses",
        "qos_overrides": "ROS",
    }.items()
} | {"all": "it stands for every joint, as in cbctl stop all"}

#: Parameters with names of joints.
LISTS, GROUPS = ("joints", "parts"), "calibration_groups"


def robot_of(layers: Sequence[Layer]) -> tuple[str, Path | None, str]:
    """The selected robot, the folder of its relative path, and the origin of the value."""
    row = BOARD_BY_NAME["robot"]
    robot, folder, where = str(row.default), None, ""
    for layer in layers:
        if (entry := layer.entries.get("robot")) is not None:
            robot, folder, where = convert(row, "robot", entry), layer.folder, entry.where
    return robot, folder, where


def without_ros(layers: Sequence[Layer]) -> tuple[list[Entries], dict[str, Any]]:
    """Entries of each layer without ROS node parameters, and the values of the latter.

    Raises:
        SettingsError: a value that is not allowed.
    """
    ours: list[Entries] = []
    ros: dict[str, Any] = {}
    for layer in layers:
        ours.append({})
        for name, entry in layer.entries.items():
            if name in ROS_NAMES and not isinstance(entry.value, bool):
                raise SettingsError(
                    f"{entry.where}: {name}: {shown(entry.value)} is not allowed; "
                    "use true or false"
                )
            if name in ROS_NAMES or name.startswith(ROS_PREFIXES):
                ros[name] = entry.value
            else:
                ours[-1][name] = entry
    return ours, ros


def prefix_of(layers: Sequence[Entries]) -> str:
    """The joint prefix of the strongest layer; raises SettingsError for characters not allowed."""
    name, having = "joint_prefix", [layer for layer in layers if "joint_prefix" in layer]
    return str(convert(BOARD_BY_NAME[name], name, having[-1][name])) if having else ""


def prefixed(entries: Entries, joints: Collection[str], prefix: str) -> Entries:
    """Add a prefix to joint names in parameters; files name joints as in the URDF."""

    def full(name: Any) -> Any:
        return prefix + name if isinstance(name, str) and name in joints else name

    def group_of(names: Any) -> Any:
        return (
            ",".join(map(full, map(str.strip, names.split(",")))) if type(names) is str else names
        )

    prefixed_entries: Entries = {}
    for name, entry in entries.items():
        owner, dot, key = name.partition(".")
        value = entry.value
        if isinstance(value, list) and owner in LISTS:
            value = [full(item) for item in value]
        elif isinstance(value, list) and owner == GROUPS:
            value = [group_of(names) for names in value]
        if owner == POSES:
            pose, mark, joint = key.partition(".")
            key = pose + mark + full(joint)
        prefixed_entries[(full(owner) if dot else owner) + dot + key] = Entry(value, entry.where)
    return prefixed_entries


def typed(entries: Entries, joints: Sequence[str]) -> Entries:
    """Entries with their values converted to the parameters' types.

    Raises:
        SettingsError: a name that does not exist, or a value that is not allowed.
    """
    return {
        name: Entry(convert(_row(name, entry, joints), name, entry), entry.where)
        for name, entry in entries.items()
    }


def _row(name: str, entry: Entry, joints: Sequence[str]) -> Parameter:
    row = find_row(name, joints)
    if row is None:
        owners = (JOINT_DEFAULTS, *joints)
        known = [*BOARD_BY_NAME, JOINT_DEFAULTS]
        known += [f"{owner}.{row.name}" for owner in owners for row in JOINT]
        known += known_names(name, joints)
        raise SettingsError(f"{entry.where}: {unknown(name, known)}")
    return row


def merged(layers: Iterable[Entries], urdf: Urdf) -> Entries:
    """The strongest entry per name; in a layer, a joint's own overrides ``joint_defaults``."""
    entries: Entries = {}
    for layer in layers:
        for name, entry in layer.items():
            owner, _, key = name.partition(".")
            if owner == JOINT_DEFAULTS:
                entries |= {f"{joint}.{key}": entry for joint in urdf.independent}
        entries |= layer
    return entries


def joints_of(
    requested: Sequence[str], urdf: Urdf, where: str, key: str = "joints"
) -> tuple[str, ...]:
    """The joints of the board: those chosen by the parameter ``key``, or all movable ones.

    Raises:
        SettingsError: a joint that cannot be chosen; the message says why.
    """
    names = tuple(requested) or urdf.independent
    at = f"{where}: " if where else ""
    for name in names:
        if name in urdf.independent and names.count(name) == 1:
            continue
        if name in urdf.mimics:
            reason = f"; it follows {urdf.mimics[name].leader!r}; leave it out"
        elif name in urdf.independent:
            reason = "; it is there twice; leave one out"
        else:
            hint = nearest(name, urdf.independent)
            reason = f"{hint}; joints: {', '.join(urdf.independent)}"
        raise SettingsError(f"{at}{key}: {shown(name)} is not allowed{reason}")
    for reserved, reason in RESERVED.items():
        if reserved in names:
            raise SettingsError(
                f"{at}joints: {reserved!r} is not allowed as a joint's name: {reason}; rename the "
                "joint in the URDF, or leave it out"
            )
    return names


def unknown(name: str, known: Iterable[str]) -> str:
    hint = nearest(name, known, 0.5) or "; see docs/parameters.md"
    return f"{shown(name)}: no such parameter{hint}"


PACKAGE = "control_board_ros"
#: Files for other programs in the same folder.
OTHERS = {"diagnostics"}


def config_folders() -> list[Path]:
    """Folders of configurations: beside the sources, else as installed by ROS or pip."""
    checkout = Path(__file__).resolve().parents[2]
    folders = [checkout / "config"] if (checkout / "package.xml").is_file() else []
    folders += [share / PACKAGE / "config" for share in share_folders()]
    return [folder for folder in folders if folder.is_dir()]


def find_config(name: str) -> Path:
    """The path of a shipped configuration, for example ``iiwa``.

    Raises:
        SettingsError: unknown name; the message lists the known ones.
    """
    folders = config_folders()
    known: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob("*.yaml")):
            if path.stem not in OTHERS:
                known.setdefault(path.stem, path)
    if name in known:
        return known[name]
    hint = nearest(name, known)
    raise SettingsError(
        f"configuration {shown(name)} unknown{hint}; known: {', '.join(known) or 'none'}, "
        "or the path of a YAML file"
    )
