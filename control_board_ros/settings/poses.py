# SPDX-License-Identifier: Apache-2.0
"""The poses of a parameter file: ``poses.<name>.<joint>`` and ``poses.<name>.speed`` (SPEC R5).

``home`` (the joints' ``home``) and ``park`` (the same) exist for every robot unless a file defines
them. A pose that names joints absent from the board keeps the others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..core.config.config import BoardConfig
from ..core.config.parameter import Kind, Parameter
from ..core.goals.pose import HOME, NAME, PARK, Pose
from .params_file import Entry, SettingsError

POSES = "poses"
SPEED = "speed"

#: Rows of a pose; names are completed with those of pose and joint.
SPEED_ROW = Parameter(
    name=f"{POSES}.<pose>.{SPEED}",
    kind=Kind.DOUBLE,
    default=0.0,
    text="Mean speed of the slowest joint on the way to a pose; 0: the reference speeds",
    unit="rad/s or m/s",
    low=0.0,
)
POSITION_ROW = Parameter(
    name=f"{POSES}.<pose>.<joint>",
    kind=Kind.DOUBLE,
    default=None,
    text="Where a pose has a joint, within its limits; joints that it does not name stay",
    unit="rad or m",
    derived="<joint>.home in home and park; none in others",
)


def split(name: str) -> tuple[str, str] | None:
    """Pose and joint (or ``speed``) of ``poses.<pose>.<joint>``; None: another parameter."""
    owner, _, rest = name.partition(".")
    pose, dot, what = rest.partition(".")
    return (pose, what) if owner == POSES and dot else None


def pose_row(name: str, joints: Iterable[str]) -> Parameter | None:
    """The row of a pose's parameter; None for other names."""
    found = split(name)
    if found is None or not NAME.fullmatch(found[0]):
        return None
    if found[1] == SPEED:
        return SPEED_ROW
    return POSITION_ROW if found[1] in joints else None


def known_names(name: str, joints: Iterable[str]) -> list[str]:
    """Suggestions for a misspelt parameter of a pose."""
    pose = (split(name) or (HOME, ""))[0]
    return [f"{POSES}.{pose}.{what}" for what in (SPEED, *joints)]


def poses_of(
    entries: Mapping[str, Entry], board: BoardConfig, homes: Mapping[str, float]
) -> tuple[dict[str, Pose], tuple[str, ...]]:
    """The poses of a board by name, home and park first; and warnings, one line each.

    Args:
        entries: of the parameter files, checked.
        board: with the joints.
        homes: the configured home of each joint, rad or m.

    Raises:
        SettingsError: a pose without joints.
    """
    given: dict[str, dict[str, Entry]] = {HOME: {}, PARK: {}}
    for name, entry in entries.items():
        if found := split(name):
            given.setdefault(found[0], {})[found[1]] = entry
    poses: dict[str, Pose] = {}
    warnings: list[str] = []
    for name, parts in given.items():
        speed = float(parts[SPEED].value) if SPEED in parts else 0.0
        wanted = {joint: float(e.value) for joint, e in parts.items() if joint != SPEED}
        if not wanted and name == HOME:
            wanted = {joint: bounded(board, joint, home) for joint, home in homes.items()}
        elif not wanted and name == PARK:
            home = poses.get(HOME) or Pose(HOME, (), ())
            wanted = dict(zip(home.joints, home.positions, strict=True))
        elif not wanted:
            where = next(iter(parts.values())).where
            raise SettingsError(
                f"{where}: {POSES}.{name}: names no joint; add {POSES}.{name}.<joint>: <position>"
            )
        positions = {joint: wanted[joint] for joint in board.names if joint in wanted}
        taken = {joint: bounded(board, joint, value) for joint, value in positions.items()}
        warnings += [
            f"{parts[joint].where}: {POSES}.{name}.{joint}: {positions[joint]:g} is outside the "
            f"limits of the joint; {value:g} is used"
            for joint, value in taken.items()
            if value != positions[joint]
        ]
        if taken:
            poses[name] = Pose(name, tuple(taken), tuple(taken.values()), speed)
    return poses, tuple(warnings)


def bounded(board: BoardConfig, joint: str, position: float) -> float:
    """A position clipped to the software limits of a joint."""
    limits = board.joints[board.names.index(joint)].limits
    return min(max(position, limits.lower), limits.upper)


def values_of(poses: Mapping[str, Pose]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for pose in poses.values():
        values[f"{POSES}.{pose.name}.{SPEED}"] = pose.speed
        for joint, position in zip(pose.joints, pose.positions, strict=True):
            values[f"{POSES}.{pose.name}.{joint}"] = position
    return values
