# SPDX-License-Identifier: Apache-2.0
"""Poses (SPEC R5): those of the parameter files, and the user's.

A parameter file has ``poses.<name>.<joint>`` and ``poses.<name>.speed``. ``home`` (the joints'
``home``) and ``park`` (the same) exist for every robot unless a file defines them. A pose that
names joints absent from the board keeps the others.

The user's poses are in one file per robot,
``$XDG_CONFIG_HOME/control_board_ros/poses/<robot>.yaml``, ``~/.config`` where that is not set::

    ready: {speed: 0.3, positions: {shoulder: 0.5, elbow: 1.2}}

Boards of one robot share the file: it is read at each use and replaced as a whole.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..core.config.config import BoardConfig
from ..core.config.parameter import Kind, Parameter
from ..core.goals.pose import HOME, MAX_VALUE, NAME, PARK, Pose
from ..core.selection import RequestError
from ..whole_file import yaml_text
from .params_file import Entry, SettingsError, read_text
from .yaml_tree import Leaf, parse_yaml, shown
from .yaml_tree import Mapping as Tree

POSES = "poses"
SPEED = "speed"

#: Rows of a pose; names are completed with those of pose and joint.
SPEED_ROW = Parameter(
    name=f"{POSES}.<pose>.{SPEED}",
    kind=Kind.DOUBLE,
    default=0.0,
    text="Mean speed of the slowest joint in a move to the pose; 0: the reference speeds",
    unit="rad/s or m/s",
    low=0.0,
)
POSITION_ROW = Parameter(
    name=f"{POSES}.<pose>.<joint>",
    kind=Kind.DOUBLE,
    default=None,
    text="Position of the joint in the pose, within its limits; joints without one do not move",
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
    words = split(name)
    if words is None or not NAME.fullmatch(words[0]):
        return None
    if words[1] == SPEED:
        return SPEED_ROW
    return POSITION_ROW if words[1] in joints else None


def known_names(name: str, joints: Iterable[str]) -> list[str]:
    """Suggestions for a misspelt parameter of a pose."""
    pose = (split(name) or (HOME, ""))[0]
    return [f"{POSES}.{pose}.{what}" for what in (SPEED, *joints)]


def poses_of(
    entries: Mapping[str, Entry], board: BoardConfig, homes: Mapping[str, float]
) -> tuple[dict[str, Pose], tuple[str, ...]]:
    """The poses of a board by name, home and park first; and warnings, one line each.

    Raises:
        SettingsError: a pose without joints.
    """
    tables: dict[str, dict[str, Entry]] = {HOME: {}, PARK: {}}
    for name, entry in entries.items():
        if words := split(name):
            tables.setdefault(words[0], {})[words[1]] = entry
    poses: dict[str, Pose] = {}
    warnings: list[str] = []
    for name, parts in tables.items():
        speed = float(parts[SPEED].value) if SPEED in parts else 0.0
        places = {joint: float(e.value) for joint, e in parts.items() if joint != SPEED}
        if not places and name == HOME:
            places = {joint: clipped(board, joint, home) for joint, home in homes.items()}
        elif not places and name == PARK:
            home = poses.get(HOME) or Pose(HOME, (), ())
            places = dict(zip(home.joints, home.positions, strict=True))
        elif not places:
            where = next(iter(parts.values())).where
            raise SettingsError(
                f"{where}: {POSES}.{name}: names no joint; add {POSES}.{name}.<joint>: <position>"
            )
        positions = {joint: places[joint] for joint in board.names if joint in places}
        taken = {joint: clipped(board, joint, value) for joint, value in positions.items()}
        warnings += [
            f"{parts[joint].where}: {POSES}.{name}.{joint}: {positions[joint]:g} is outside the "
            f"limits of the joint; {value:g} is used"
            for joint, value in taken.items()
            if value != positions[joint]
        ]
        if taken:
            poses[name] = Pose(name, tuple(taken), tuple(taken.values()), speed)
    return poses, tuple(warnings)


def clipped(board: BoardConfig, joint: str, position: float) -> float:
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


#: Maximum number of poses in a file.
MAX_POSES = 100
#: Attempts to lock the file, and s between them: saving takes a few ms and blocks all other
#: services.
TRIES, PAUSE = 10, 0.005
HEAD = "# Poses of {robot}, saved by ~/save_pose and `cbctl pose save`; rad, rad/s; m, m/s.\n"
FORM = "write NAME: {speed: 0.0, positions: {joint: 0.5}}"


def pose_file(robot: str) -> Path:
    """The file of a robot: letters of any script as they are, other characters as %XX."""
    return _file(re.sub(r"^\.|[^\w.-]", lambda match: _percent(match[0]), robot))


def former_pose_file(robot: str) -> Path:
    """The file of a robot in 1.0.0, which robots of similar names shared."""
    return _file(re.sub(r"[^A-Za-z0-9_.-]", "_", robot).strip("."))


def _file(stem: str) -> Path:
    base = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return Path(base) / "control_board_ros" / "poses" / f"{stem or 'robot'}.yaml"


def _percent(text: str) -> str:
    return "".join(f"%{byte:02X}" for byte in text.encode())


class UserPoses:
    """The poses of a user for one robot.

    Attributes: path (of their file, which may not exist), kept (where that is, in words).
    """

    def __init__(self, robot: str) -> None:
        self.robot, self.path = robot, pose_file(robot)
        self.kept = f"in {self.path}"

    def read(self) -> dict[str, Pose]:
        """All poses by name, in file order; empty without a file.

        Raises:
            RequestError: the file is unreadable or invalid; one line.
        """
        try:
            files = [file for file in (self.path, former_pose_file(self.robot)) if file.exists()]
            return poses_in(read_text(files[0]), str(files[0])) if files else {}
        except (SettingsError, OSError) as error:
            raise RequestError(str(error)) from None

    def save(self, pose: Pose, names: Collection[str] = ()) -> dict[str, Pose]:
        """Add or replace a pose; returns all poses.

        Positions that it had, of joints not in ``names``, remain.

        Raises:
            RequestError: the file cannot be read or written, is full, or could not be read with
                this pose; it remains unchanged.
        """
        try:
            with self._locked():
                poses = self.read()
                old = poses.get(pose.name, Pose(pose.name, (), ()))
                poses[pose.name] = old.besides({*names, *pose.joints}).joined(pose)
                if len(poses) > MAX_POSES:
                    raise RequestError(
                        f"{self.path}: holds {MAX_POSES} poses already; delete some"
                    )
                self._write(poses)
        except OSError as error:
            raise RequestError(
                f"{self.path}: cannot be written ({error.strerror}); "
                "make the folder writable, or set XDG_CONFIG_HOME"
            ) from None
        return poses

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Lock the file against other processes; raises RequestError after TRIES attempts."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        path = self.path.parent / f".{self.path.name}.lock"
        with path.open("w") as lock:
            for left in reversed(range(TRIES)):
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    if not left:
                        raise RequestError(
                            f"{self.path}: another program is saving poses, or holds {path.name} "
                            "without end; try again, or end that program"
                        ) from None
                    time.sleep(PAUSE)
            yield

    def _write(self, poses: Mapping[str, Pose]) -> None:
        """Replace the file atomically, once the new one has been read back."""
        handle, name = tempfile.mkstemp(dir=self.path.parent, prefix=".", suffix=".yaml")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text_of(self.robot, poses))
                file.flush()
                os.fsync(handle)
            if poses_in(read_text(Path(name)), str(self.path)) != poses:
                raise RequestError(f"{self.path}: would not hold the poses as given; not saved")
            Path(name).replace(self.path)
        except SettingsError as error:
            raise RequestError(f"{error}; not saved") from None
        finally:
            Path(name).unlink(missing_ok=True)


def text_of(robot: str, poses: Mapping[str, Pose]) -> str:
    tree = {
        pose.name: {
            "speed": pose.speed,
            "positions": dict(zip(pose.joints, pose.positions, strict=True)),
        }
        for pose in poses.values()
    }
    return HEAD.format(robot=robot) + yaml_text(tree)


def poses_in(text: str, source: str) -> dict[str, Pose]:
    """Parse the poses of a file's text.

    Raises:
        SettingsError: invalid; one line with the line number.
    """
    tree = parse_yaml(text, source)
    if tree is None:
        return {}
    if not isinstance(tree, Tree):
        raise SettingsError(f"{source}:{tree.line}: is no mapping; {FORM}")
    poses = {}
    for name, node in tree.items.items():
        if not NAME.fullmatch(name):
            raise SettingsError(
                f"{source}:{node.line}: pose {shown(name)}: is no name; letters, digits and _ are"
            )
        if not isinstance(node, Tree) or set(node.items) - {"speed", "positions"}:
            raise SettingsError(f"{source}:{node.line}: {name}: is no pose; {FORM}")
        positions = node.items.get("positions")
        if not isinstance(positions, Tree) or not positions.items:
            raise SettingsError(f"{source}:{node.line}: {name}: has no positions; {FORM}")
        speed = number(node.items.get("speed", Leaf(0.0, node.line)), f"{name}.speed", source)
        if speed < 0.0:
            raise SettingsError(f"{source}:{node.line}: {name}.speed: {speed:g} is below 0")
        joints = {
            joint: number(leaf, f"{name}.positions.{joint}", source)
            for joint, leaf in positions.items.items()
        }
        poses[name] = Pose(name, tuple(joints), tuple(joints.values()), speed)
    return poses


def number(node: Any, name: str, source: str) -> float:
    """A number of the file; raises SettingsError for anything else."""
    value = getattr(node, "value", None)
    if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < MAX_VALUE:
        return float(value)
    raise SettingsError(
        f"{source}:{node.line}: {name}: {shown(value)} is no number below {MAX_VALUE:g}"
    )
