# SPDX-License-Identifier: Apache-2.0
"""cbctl poses, pose, home and park."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from ..board.progress import Bar, Standstill
from ..board.session import Session
from ..board.status import cancelled
from ..line.arguments import amount, argument, several, with_arguments
from ..line.offers import TypedLine, joints
from ..line.words import UsageError, short_names
from ..text.output import conclude, show
from ..text.tables import grid

if TYPE_CHECKING:
    from control_board_ros.client import PoseFeedback

SPEED = amount(
    "--speed",
    "speed",
    metavar="SPEED",
    help="Mean speed of the slowest joint, e.g. 20deg; default: that of the pose.",
)
#: Poses by name: speed, and positions by joint.
Rows = dict[str, dict[str, Any]]


@several
def poses(session: Session) -> None:
    """Show the poses of the configuration, then those of the user."""
    rows = read_poses(session)
    show(session, rows, lambda: poses_table(session, rows))


def read_poses(session: Session) -> Rows:
    client = session.client
    poses = [client.get_pose(name) for name in client.list_poses()]
    return {
        pose.name: {
            "speed": pose.speed,
            "positions": dict(zip(pose.joints, pose.positions, strict=True)),
        }
        for pose in poses
    }


def poses_table(session: Session, rows: Rows) -> Any:
    """A row for each joint, a column for each pose; the speeds below."""
    names = session.names
    columns: dict[str, list[str]] = {"joint": ["speed", *names]}
    for pose, row in rows.items():
        speed = session.kind(names[0]).velocity(row["speed"]) if row["speed"] else "as set"
        positions = row["positions"]
        columns[pose] = [speed] + [
            session.position(name, positions[name]) if name in positions else "-" for name in names
        ]
    return grid(columns, names=names, right=list(rows))


def poses_offered(typed: TypedLine) -> list[str]:
    """Poses and ``save``; no new names; then joints."""
    if not typed.before:
        return [*typed.poses(), "save"]
    return joints(typed) if typed.before[0] == "save" and len(typed.before) > 1 else []


@with_arguments(
    argument(
        "words",
        nargs="+",
        metavar="NAME|save NAME",
        help="A pose to go to; or save NAME, then joints or JOINT=VALUE for some of them.",
        offers=poses_offered,
    ),
    SPEED,
)
def pose(session: Session, words: list[str], speed: float | None) -> int:
    """Go to a pose, all joints arriving together (mode pos or mix); or save one. Ctrl-C stops.

    save NAME saves the measured positions of all joints, save NAME JOINT… those of some joints,
    save NAME JOINT=VALUE… the given positions, in the user's file.
    """
    name, *rest = words
    if name == "save" and rest:
        return save(session, rest[0], rest[1:], speed)
    if rest or name == "save":
        raise UsageError("write pose NAME, or pose save NAME [JOINT…]; poses: cbctl poses")
    return go(session, name, speed)


@with_arguments(SPEED)
def home(session: Session, speed: float | None) -> int:
    """Go to the pose home, all joints arriving together (mode pos or mix). Ctrl-C stops."""
    return go(session, "home", speed)


@with_arguments(SPEED)
def park(session: Session, speed: float | None) -> int:
    """Go to the pose park, all joints arriving together (mode pos or mix). Ctrl-C stops."""
    return go(session, "park", speed)


def save(session: Session, name: str, words: list[str], speed: float | None) -> int:
    """Save a pose; the exit code."""
    mean = 0.0 if speed is None else speed
    if any("=" in word for word in words):
        values = session.within_limits(words)
        reply = session.client.save_pose(name, list(values), list(values.values()), mean)
    else:
        reply = session.client.save_pose(name, session.joints(words), None, mean)
    return conclude(session, reply)


def go(session: Session, name: str, speed: float | None) -> int:
    """Go to a pose and wait for the end; the exit code."""
    names = session.names
    whole, standstill = 0.0, Standstill(session.options.timeout)
    try:
        with Bar(session, name) as bar:

            def feedback(sent: PoseFeedback) -> None:
                nonlocal whole, names
                names = sent.names
                ways = [abs(way) for way in sent.remaining.tolist()]
                left = max(ways)
                k = ways.index(left)
                whole = max(whole, left)
                short = short_names([names[k]], session.names)[names[k]]
                togo = session.position(names[k], left)
                hint = standstill.hint(left, time.monotonic())
                bar.update(1.0 - left / whole if whole else 1.0, f"{short} {togo} to go{hint}")

            reply = session.client.go_to_pose(name, speed, feedback)
            if reply:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, name, list(names))
    reached = {}
    if reply.joints:  # none: there is no such pose
        positions = session.client.get_encoder(reply.joints).tolist()
        reached = dict(zip(reply.joints, positions, strict=True))
    return conclude(session, reply, f"at {name}", positions=reached)
