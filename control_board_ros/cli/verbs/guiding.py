# SPDX-License-Identifier: Apache-2.0
"""cbctl guide and replay: an arm guided by hand, and the recorded motion replayed."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
import time as clock
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode

from ..board.progress import Bar
from ..board.recordings import note_missing, recorded
from ..board.session import Session
from ..board.status import cancelled, what_they_do
from ..board.trajectories import agreed, approach, check_asking, followed
from ..line.arguments import FOR, JOINTS, argument, with_arguments
from ..line.jogging import keys_at_once, pressed
from ..line.words import Refused, UsageError, short_names
from ..text.output import DONE, REFUSED, complain, conclude, fail, note, put, put_json

#: s between readings of the keyboard, and between readings of the modes.
LOOK, LOOK_AT_MODES = 0.05, 0.5
KEYS = "p saves a pose, q ends"
YES = argument("--yes", action="store_true", help="Move without confirmation.")
#: Distance from the start of a motion that requires no move to it, rad or m.
START_TOLERANCE = 5e-3


@with_arguments(
    JOINTS,
    argument(
        "--record", metavar="WAY.mcap", help="Record the motion, for cbctl replay and report."
    ),
    FOR,
)
def guide(session: Session, joints: list[str], record: str | None, time: float | None) -> int:
    """Guide joints by hand: zero stiffness, low damping, gravity compensation.

    The joints stay where they are left, within their limits. Key p saves a pose (guided_1, …); q
    or Ctrl-C ends: the joints hold, and their earlier settings are restored.
    """
    from control_board_ros.client.guidance import guide as guide_joints

    names = guided_joints(session, joints)
    if time is None and not sys.stdin.isatty():
        raise UsageError("guide needs a terminal for its keys, or a duration: give --for TIME")
    target = None if record is None else unused_path(record)
    poses: list[str] = []
    with guide_joints(session.client, names) as guidance, recorded_way(session, target):
        why = attend(session, names, time, poses)
    if guidance.left:
        note(session, guidance.left)
    if session.options.json:
        written = {"recording": str(target)} if target else {}
        put_json({"success": not why, "message": why, "joints": names, "poses": poses} | written)
        return REFUSED if why else DONE
    if why:
        complain(why)
    put(what_they_do(session, names))
    if target:
        put(f"recorded: {target}; follow it with: {session.line('replay', str(target))}")
    return REFUSED if why else DONE


def guided_joints(session: Session, words: Sequence[str]) -> list[str]:
    """The joints that words select; none: all that have COMPLIANT.

    Raises:
        Refused: one cannot be guided.
    """
    names = session.joints(words)
    available = session.client.get_available_modes(names)
    modes = (ControlMode.POSITION, InteractionMode.COMPLIANT)
    able = [
        name
        for name, (control, interaction) in zip(names, available, strict=True)
        if modes[0] in control and modes[1] in interaction
    ]
    if (words and len(able) < len(names)) or not able:
        others = ", ".join(name for name in names if name not in able)
        raise Refused(f"{others}: without COMPLIANT, which guiding needs; name other joints")
    return able


def attend(session: Session, names: list[str], seconds: float | None, poses: list[str]) -> str:
    """Serve the keys until the end; returns its reason, empty if requested."""
    begun = asked = clock.monotonic()
    keyboard = sys.stdin.isatty() and not session.options.json
    keys = f": {KEYS}" if keyboard else ""
    with contextlib.ExitStack() as stack:
        terminal = stack.enter_context(keys_at_once()) if keyboard else None
        bar = stack.enter_context(Bar(session, "guiding", endless=seconds is None))
        stack.enter_context(contextlib.suppress(KeyboardInterrupt))  # the end requested, as q
        while seconds is None or clock.monotonic() - begun < seconds:
            for key in pressed(terminal, LOOK) if terminal is not None else wait():
                if key == "quit":
                    return ""
                if key == "pose":
                    poses += saved_pose(session, names)
            now = clock.monotonic()
            share = 0.0 if seconds is None else (now - begun) / seconds
            saved = f", {len(poses)} poses saved" if poses else ""
            bar.update(
                share, f"{', '.join(short_names(names, session.names).values())}{keys}{saved}"
            )
            if now - asked >= LOOK_AT_MODES:
                asked = now
                modes = session.client.get_control_mode(names)
                for name, mode in zip(names, modes, strict=True):
                    if mode is not ControlMode.POSITION:
                        return f"{name} is in {mode.name} now: guiding ends for all"
    return ""


def wait() -> tuple[str, ...]:
    """No keys without a terminal."""
    clock.sleep(LOOK)
    return ()


def saved_pose(session: Session, names: list[str]) -> list[str]:
    """Save the measured positions as the next of guided_1, guided_2, …; its name, if saved."""
    known, number = set(session.client.list_poses()), 1
    while f"guided_{number}" in known:
        number += 1
    reply = session.client.save_pose(f"guided_{number}", names)
    note(session, f"saved as guided_{number}" if reply else reply.message)
    return [f"guided_{number}"] if reply else []


def unused_path(text: str) -> Path:
    """The path of a recording.

    Raises:
        Refused: it exists.
    """
    path = Path(text)
    if path.exists():
        raise Refused(f"{path} exists already; choose another name")
    return path


@contextlib.contextmanager
def recorded_way(session: Session, target: Path | None) -> Iterator[None]:
    """Record into one file where the name ends in .mcap, else into a folder; None: do not.

    Raises:
        Refused: it cannot be written.
    """
    if target is None:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="cbctl") as temporary:
        one_file = target.suffix == ".mcap"
        folder = Path(temporary) / "way" if one_file else target
        with recorded(session, folder):
            yield
        if one_file:
            (file,) = folder.glob("*.mcap")
            try:
                shutil.move(file, target)
            except OSError as error:
                raise Refused(f"cannot write {target}: {error.strerror}") from error


@with_arguments(
    argument("recording", metavar="WAY.mcap", help="A recording of cbctl guide, or any other."),
    argument("joints", nargs="*", metavar="JOINT", help="Joints; none: those that were guided."),
    argument("--speed", type=float, default=1.0, metavar="FACTOR", help="0.5: half as fast."),
    YES,
)
def replay(session: Session, recording: str, joints: list[str], speed: float, yes: bool) -> int:
    """Follow a recorded motion within the limits. Ctrl-C stops.

    After a confirmation, the joints first move slowly to its start.
    """
    from control_board_ros.recording.way import way_of

    if not 0.0 < speed <= 10.0:
        raise UsageError(f"--speed {speed:g} is not valid; give a factor above 0 and up to 10")
    check_asking(yes)
    board = recording_of(session, Path(recording))
    names = session.joints(joints) if joints else guided_in(session, board)
    limits = session.limits(names)
    known = [limit for limit in limits.values() if limit is not None]
    if len(known) < len(names):
        raise Refused("the board does not report the limits of its joints: nothing is moved")
    way = way_of(board, names, known, speed)
    starts = dict(zip(names, way.positions[0].tolist(), strict=True))
    if not agreed(session, motion_in_words(session, starts, way.duration), yes):
        return fail("nothing was moved", REFUSED, as_json=session.options.json)
    if way.stretched > 1.0:
        note(session, f"the limits extend the motion to {way.stretched:.2g} times its duration")
    try:
        with followed(session, names), Bar(session, "replay") as bar:
            reply = approach(session, names, starts, [limit.velocity for limit in known])
            if reply:
                reply = session.client.follow_trajectory(
                    names,
                    way.times,
                    way.positions,
                    way.velocities,
                    lambda past: bar.update(past / way.duration, f"{way.duration - past:.1f} s"),
                    attended=True,
                )
            if reply:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, "replay", names)
    return conclude(session, reply, f"followed {recording}: {', '.join(names)}")


def recording_of(session: Session, path: Path) -> Any:
    """The recording of this board.

    Raises:
        Refused: it is of another board.
    """
    from control_board_ros.recording.reading import read

    boards = read(path)
    note_missing(session, boards)
    name = session.client.board_name
    for board in boards:
        if board.board == name or (len(boards) == 1 and set(board.names) & set(session.names)):
            return board
    others = ", ".join(board.board for board in boards)
    raise Refused(f"{path} is of {others}, not of {name}")


def guided_in(session: Session, board: Any) -> list[str]:
    """The joints that were COMPLIANT in a recording; if none, all of the board."""
    mine = [name for name in session.names if name in board.names]
    soft = [
        name
        for name in mine
        if any(
            code == InteractionMode.COMPLIANT.code for *_, code in board.interaction_modes(name)
        )
    ]
    return soft or mine


def motion_in_words(session: Session, starts: dict[str, float], seconds: float) -> str:
    here = dict(zip(starts, session.client.get_encoder(list(starts)).tolist(), strict=True))
    ways = [
        f"{name} {session.position(name, here[name])} → {session.position(name, goal)}"
        for name, goal in starts.items()
        if abs(goal - here[name]) > START_TOLERANCE
    ]
    there = f"first the joints move to its start: {', '.join(ways)}; then " if ways else ""
    return f"{there}{', '.join(starts)} follow the motion for {seconds:.1f} s"
