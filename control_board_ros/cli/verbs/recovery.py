# SPDX-License-Identifier: Apache-2.0
"""cbctl clear, recover and estop."""

from __future__ import annotations

import time
from typing import Any

from control_board_ros.core.terms.modes import FAULTED, UNCONFIGURED
from control_board_ros.core.terms.reply import Answer, Reply

from ..board.only_board import HASTE
from ..board.reading import Rows, read_faults
from ..board.session import Session
from ..board.status import warn_without_power
from ..line.arguments import JOINTS, ahead, argument, several, with_arguments
from ..line.offers import one_of
from ..line.words import Refused
from ..text.advice import advice, in_groups
from ..text.output import DONE, REFUSED, conclude, note, show
from ..text.tables import grid

#: Modes under an emergency stop (E2, N1).
STOPPED = FAULTED | UNCONFIGURED
#: s until drives report no power, brakes closed before included; s between two looks.
POWER_OFF_TIME, POLL = 2.0, 0.05


@several
@with_arguments(
    JOINTS,
    argument(
        "--partial",
        action="store_true",
        help="Recover the joints that can, even where others must wait.",
    ),
)
def recover(session: Session, joints: list[str], partial: bool) -> int:
    """Leave HW_FAULT for the modes before it, at the measured positions; none: all in fault."""
    names = session.joints(joints)
    faults = faults_now(session, names)
    if not faults:
        return nothing_in_fault(session, "recover", names, modes={}, wait={})
    reply = session.client.recover(names if joints else None, partial)
    modes = {
        name: mode.code
        for name, mode in zip(reply.joints, reply.modes, strict=False)
        if name in faults
    }
    waits = dict(zip(reply.joints, reply.waits, strict=False))
    text = "recovered: " + ", ".join(f"{name} {code}" for name, code in modes.items())
    return conclude(session, reply, text, modes=modes, wait=waits)


def disable(session: Session, word: str | None) -> None:
    """Stop a board at once, where the line asks for that."""
    if word is None:
        session.client.emergency_stop()


@ahead(disable)
@with_arguments(
    argument(
        "word",
        nargs="?",
        metavar="release",
        help="release: end the stop.",
        offers=one_of(("release",)),
    ),
)
def estop(session: Session, word: str | None) -> int:
    """Disable all joints of the robot immediately; estop release ends the stop."""
    if word not in (None, "release"):
        raise Refused(f"{word[:40]!r} is not valid; cbctl estop, or cbctl estop release")
    session.gathering = HASTE  # of a robot that is discovered in parts, each one stops it whole
    reply = session.client.emergency_stop(word is None)
    if word is None:
        text = ""
        if reply and not reply.message:
            wait_for_power_off(session)
            fall = "all joints are unpowered and fall where no brake holds them"
            text = f"{fall}; release with: {session.line('estop', 'release')}"
    elif faults_now(session, list(session.names)):
        recover_with = f"recover with: {session.line('recover')}"
        text = f"released; the joints are still in HW_FAULT; {recover_with}"
    else:
        text = "released; no joint is in fault"
    if reply.message:  # not in effect: simulated time is stopped
        text = ""
    return conclude(session, reply, text)


def wait_for_power_off(session: Session) -> None:
    """Wait until the modes, and the drives that report their power, show an emergency stop.

    Raises:
        Refused: what does not show it after POWER_OFF_TIME.
    """
    from control_board_ros.client import BoardError

    end = time.monotonic() + POWER_OFF_TIME
    try:
        while shown := still_powered(session):
            if time.monotonic() >= end:
                raise Refused(
                    f"the stop is in force, but {POWER_OFF_TIME:g} s later {', '.join(shown)}; "
                    "cut the power of the robot"
                )
            time.sleep(POLL)
    except BoardError as error:
        raise Refused(
            f"the board has confirmed the stop; whether the power is off was not seen: {error}"
        ) from None


def still_powered(session: Session) -> list[str]:
    """The joints that are seen with power, or in another mode than a stop's, each in words."""
    names, client = session.names, session.client
    rows = zip(names, client.get_control_mode(names), client.get_drives(names), strict=True)
    return [
        f"the drive of {name} reports power" if drive.reported.power else f"{name} is in {mode}"
        for name, mode, drive in rows
        if drive.reported.power or mode not in STOPPED
    ]


@several
@with_arguments(JOINTS)
def clear(session: Session, joints: list[str]) -> int:
    """Send FORCE_IDLE to the joints in fault; report which causes persist."""
    names = session.joints(joints)
    faults = faults_now(session, names)
    if not faults:
        return nothing_in_fault(session, "clear", names, joints={})
    reply = session.client.set_control_mode(list(faults), "fidl")
    rows = cleared_rows(faults, reply)
    show(session, {"success": bool(reply), "joints": rows}, lambda: cleared_table(session, rows))
    warn_without_power(session, {name: "idl" for name, row in rows.items() if row["cleared"]})
    if reply.message:
        next_step = advice(reply, session.names, session.line, session.manager)
        note(session, "; ".join(filter(None, (in_groups(reply), next_step))))
    return DONE if reply else REFUSED


def faults_now(session: Session, names: list[str]) -> Rows:
    return {name: row for name, row in read_faults(session, names).items() if row["active"]}


def nothing_in_fault(session: Session, verb: str, names: list[str], **empty: Any) -> int:
    """Report that no joint is in fault; returns the exit code."""
    text = f"nothing to {verb}: none of {len(names)} is in fault"
    show(session, {"success": True} | empty, lambda: text)
    return DONE


def cleared_rows(faults: Rows, reply: Reply) -> Rows:
    """The fault of each joint, and whether it is cleared."""
    return {
        name: {
            "code": faults[name]["code"],
            "fault": faults[name]["text"],
            "cleared": answer.answer is Answer.ACCEPTED,
            "message": answer.text,
        }
        for name, answer in zip(reply.joints, reply.each(), strict=True)
    }


def cleared_table(session: Session, rows: Rows) -> Any:
    from rich.text import Text

    states = {True: Text("idle, cleared", "green"), False: Text("the cause persists", "bold red")}
    columns = {
        "joint": list(rows),
        "fault": [row["fault"] for row in rows.values()],
        "now": [states[row["cleared"]] for row in rows.values()],
    }
    return grid(columns, names=session.names, fold=("fault",))
