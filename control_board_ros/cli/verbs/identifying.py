# SPDX-License-Identifier: Apache-2.0
"""cbctl identify: motions of joints, and the parameters found from them."""

from __future__ import annotations

import contextlib
import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from control_board_ros.core.terms.vocabs import InteractionMode
from control_board_ros.identification.shares import (
    ACCELERATION,
    LAG,
    MOTIONS,
    SPEED,
    TORQUE,
)
from control_board_ros.program_options import IDENTIFICATION

from ..board.experiments import await_states, faster_states
from ..board.programs import run_program, words_of
from ..board.progress import Bar
from ..board.recordings import recorded
from ..board.session import Session
from ..board.status import cancelled
from ..board.trajectories import agreed, approach, check_asking, followed
from ..line.arguments import JOINTS, argument, with_arguments
from ..line.words import Refused, UsageError, quantity
from ..text.output import REFUSED, fail, note

if TYPE_CHECKING:
    from control_board_ros.identification.motions import Bounds, Motion

#: Fits the motions and writes the file.
PROGRAM = "control_board_ros.identification"


@with_arguments(
    JOINTS,
    *(argument(*names, **settings) for names, settings in IDENTIFICATION),
    argument(
        "--range", dest="reach", metavar="SIZE", help="Range to either side, e.g. 20deg, 50mm."
    ),
    argument(
        "--speed", type=float, default=SPEED, metavar="SHARE", help="Share of the speed limits."
    ),
    argument(
        "--acceleration",
        type=float,
        default=ACCELERATION,
        metavar="SHARE",
        help="Share of the acceleration limits.",
    ),
    argument(
        "--torque",
        type=float,
        default=TORQUE,
        metavar="SHARE",
        help="Share of the torque limits; above it, a motion is stopped.",
    ),
    argument("--keep", metavar="FOLDER", help="Keep the recording of the motions."),
    argument(
        "--from",
        "--data",
        dest="data",
        action="append",
        metavar="FILE",
        help="Use recorded motions: a kept or any other recording, or anybody's tables or bags.",
    ),
    argument("--yes", action="store_true", help="Move without confirmation."),
)
def identify(
    session: Session,
    joints: list[str],
    reach: str | None,
    speed: float,
    acceleration: float,
    torque: float,
    keep: str | None,
    data: list[str] | None,
    yes: bool,
    **options: Any,
) -> int:
    """Identify friction, rotor inertia, motor constants, delay and payload from motions.

    Each joint moves in slow ramps, sines and steps about its present position, then all together.
    The identified values go into a parameter file and a report, with 95 % intervals; values that
    the data does not determine are listed. It moves only after a confirmation.
    """
    from control_board_ros.identification.motions import motions_of
    from control_board_ros.recording import RecordingError
    from control_board_ros.recording.page import check_output

    try:
        check_output(options["output"])
    except RecordingError as error:
        raise UsageError(str(error)) from None
    if (alarms := options["alarms"]) is not None and not alarms > 0.0:
        raise UsageError(f"--alarms {alarms:g} is not valid; give a rate above 0, per hour")
    if data is not None:
        return run_program(session, PROGRAM, [*data, *words_of(options | {"joint": joints})])
    shares = {"speed": speed, "acceleration": acceleration, "torque": torque}
    for name, share in shares.items():
        if not 0.0 < share <= 1.0:
            raise UsageError(f"--{name} {share:g} is not valid; give a share above 0 and up to 1")
    check_asking(yes)
    if keep is not None and Path(keep).exists():
        raise Refused(f"{keep} exists already; choose another name")
    bounds = bounds_now(session, session.joints(joints), reach, shares)
    motions = motions_of(bounds)
    seconds = sum(motion.duration for motion in motions)
    ways = ", ".join(way(session, entry) for entry in bounds)
    motion = f"for about {seconds / 60.0:.1f} min these joints move: {ways}"
    if not agreed(session, motion, yes):
        return fail("nothing was moved", REFUSED, as_json=session.options.json)
    with contextlib.ExitStack() as stack:
        temporary = stack.enter_context(tempfile.TemporaryDirectory(prefix="cbctl"))
        folder = Path(keep) if keep else Path(temporary) / "motions"
        try:
            play(session, folder, bounds, motions)
        except KeyboardInterrupt:
            return cancelled(session, "identify", [entry.joint for entry in bounds])
        words = words_of({name: options[name] for name in ("output", "no_payload", "alarms")})
        return run_program(session, PROGRAM, [str(folder), *words])


def bounds_now(
    session: Session, names: Sequence[str], reach: str | None, shares: dict[str, float]
) -> list[Bounds]:
    """Bounds of the motion of each joint about its present position.

    Raises:
        Refused: limits are unknown.
        NoRoomError: they leave no room.
    """
    from control_board_ros.identification.motions import bounds_of

    limits, state = session.limits(names), session.client.get_state()
    size = None if reach is None else quantity(reach, "position")
    bounds = []
    for name in names:
        joint_limits, kind = limits[name], session.kind(name)
        if joint_limits is None:
            raise Refused(f"the board does not report the limits of {name}: nothing is moved")
        column = session.names.index(name)
        place = float(state.position[column])
        asked = None if size is None else session.value(name, size)
        if asked is not None and not asked > 0.0:
            raise UsageError(f"--range {reach} is not valid; give a size above 0")
        bounds.append(bounds_of(name, kind, joint_limits, place, reach=asked, **shares))
    return bounds


def way(session: Session, bounds: Bounds) -> str:
    """The range and speed of a joint as text."""
    low, high = bounds.centre - bounds.reach, bounds.centre + bounds.reach
    kind = session.kind(bounds.joint)
    return f"{bounds.joint} {kind.travel(low, high)} at up to {kind.velocity(bounds.speed)}"


def play(
    session: Session, folder: Path, bounds: Sequence[Bounds], motions: Sequence[Motion]
) -> None:
    """Move and record; a stopped joint is left out of later motions.

    Raises:
        Refused: joints do not reach their centres, or the recording cannot be written.
    """
    names, left = [entry.joint for entry in bounds], {entry.joint: entry for entry in bounds}
    rows: list[dict[str, Any]] = []
    whole = sum(motion.duration for motion in motions)
    with (
        faster_states(session),
        stiff(session, names),
        followed(session, names),
        recorded(session, folder) as recorder,
    ):
        await_states(session, recorder)
        speeds = [limit.velocity for limit in session.limits(names).values() if limit]
        centres = {entry.joint: entry.centre for entry in bounds}
        reply = approach(session, names, centres, speeds)
        if not reply:
            raise Refused(reply.message)
        with Bar(session, "identify") as bar:
            past = 0.0
            for motion in motions:
                bar.update(past / whole, f"{', '.join(motion.joints)}: {motion.what}")
                if all(joint in left for joint in motion.joints):
                    rows.append(follow(session, motion, left))
                    if why := rows[-1]["ended"]:
                        note(session, why)
                        for joint in motion.joints:
                            left.pop(joint)
                past += motion.duration
            bar.update(1.0, "done")
    plan = {"board": session.client.board_name, "motions": rows}
    try:
        (folder / MOTIONS).write_text(json.dumps(plan, indent=1), "utf-8")
    except OSError as error:
        raise Refused(f"cannot write {folder / MOTIONS}: {error.strerror}") from None


@contextlib.contextmanager
def stiff(session: Session, names: list[str]) -> Iterator[None]:
    """Joints in STIFF; their interaction modes are restored at the end."""
    client = session.client
    before = client.get_interaction_mode(names)
    try:
        reply = client.set_interaction_mode(names, InteractionMode.STIFF)
        if not reply:
            raise Refused(reply.message)
        yield
    finally:
        client.set_interaction_mode(names, before)


class StoppedMotion(Exception):  # noqa: N818
    """A motion that is stopped, with the reason."""


def follow(session: Session, motion: Motion, bounds: dict[str, Bounds]) -> dict[str, Any]:
    """One motion, as ``motions.json`` has it."""
    client = session.client
    names, ended = list(motion.joints), ""
    columns = [session.names.index(name) for name in names]

    def look(_past: float) -> None:
        state = client.get_state()
        for name, column in zip(names, columns, strict=True):
            if abs(state.torque[column]) > bounds[name].torque:
                raise StoppedMotion(f"{name} needs more torque than allowed")
            behind = abs(state.position_reference[column] - state.position[column])
            if behind > LAG * bounds[name].reach:
                raise StoppedMotion(f"{name} does not follow its reference")

    begin = client.get_state().stamp
    try:
        reply = client.follow_trajectory(
            names, motion.times, motion.positions, motion.velocities, look, attended=True
        )
        ended = "" if reply else reply.message
    except StoppedMotion as error:
        ended = str(error)
    end = client.get_state().stamp
    faults = [fault for fault in client.get_faults(names) if fault.active]
    if faults:
        ended = f"{faults[0].name} went into HW_FAULT: {faults[0].text}"
    speeds = abs(motion.velocities).max(axis=0).tolist()
    return {
        "what": motion.what,
        "speeds": dict(zip(names, speeds, strict=True)),
        "begin": begin,
        "end": end,
        "ended": ended,
    }
