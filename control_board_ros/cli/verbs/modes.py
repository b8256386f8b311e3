# SPDX-License-Identifier: Apache-2.0
"""cbctl mode, interaction, impedance and brake."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from control_board_ros.core.terms.modes import REQUESTABLE, UNPOWERED
from control_board_ros.core.terms.vocabs import (
    BrakeMode,
    InteractionMode,
    Vocab,
    parse_control_mode,
    parse_interaction_mode,
)
from control_board_ros.text import nearest

from ..board.reading import Rows, read_brakes, read_impedance
from ..board.session import Session
from ..board.status import warn_without_power
from ..line.arguments import JOINTS, argument, joints_then_mode, number, takes
from ..line.offers import joints_then
from ..line.words import Refused, UsageError
from ..text.output import DONE, conclude, show
from ..text.tables import grid

MODE_CODES = tuple(mode.code for mode in REQUESTABLE)
INTERACTION_CODES = tuple(mode.code for mode in InteractionMode)


@takes(joints_then_mode(MODE_CODES))
def mode(session: Session, words: list[str]) -> int:
    """Set the control mode of joints: pos, posd, vel, mix, torq, open, idl, veld, icur, fidl.

    Of a board that --board names, a mode alone is for all joints.
    """
    joints, wanted = joints_and_mode(of_board(session, words), "cbctl mode all pos")
    names = session.joints(joints)
    check_mode("control", wanted, parse_control_mode, MODE_CODES)
    reply = session.client.set_control_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    changed = [answer in ("accepted", "unsupported") for answer in reply.answers]
    now = dict(zip(reply.joints, (mode.code for mode in reply.modes), strict=False))
    names_changed = [name for name, is_new in zip(reply.joints, changed, strict=True) if is_new]
    warn_without_power(session, {name: now[name] for name in names_changed})
    return code


def check_mode(kind: str, text: str, parse: Callable[[str], Vocab], codes: Sequence[str]) -> None:
    """Refuse what is no mode, naming those that can be set.

    Raises:
        Refused: a word that means no mode; of a status the board itself reports why it is none.
    """
    try:
        parse(text)
    except ValueError:
        names = [parse(code).name for code in codes]
        known = ", ".join(f"{code} ({name})" for code, name in zip(codes, names, strict=True))
        hint = nearest(text, [*codes, *names])
        raise Refused(f"{kind} mode {text[:40]!r} unknown{hint}; one of {known}") from None


def of_board(session: Session, words: list[str]) -> list[str]:
    """The words, with all joints for a mode alone where the line names a board."""
    return ["all", *words] if session.options.board_named and len(words) == 1 else words


def joints_and_mode(words: list[str], example: str) -> tuple[list[str], str]:
    """Split ``JOINT… MODE``.

    Raises:
        UsageError: one word only: joints, or a mode?
    """
    if len(words) < 2:
        raise UsageError(f"name joints, then a mode, e.g. {example}")
    return words[:-1], words[-1]


@takes(joints_then_mode(INTERACTION_CODES))
def interaction(session: Session, words: list[str]) -> int:
    """Set the interaction mode of joints: stif or comp.

    Of a board that --board names, a mode alone is for all joints.
    """
    joints, wanted = joints_and_mode(of_board(session, words), "cbctl interaction all comp")
    names = session.joints(joints)
    check_mode("interaction", wanted, parse_interaction_mode, INTERACTION_CODES)
    reply = session.client.set_interaction_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    answers = zip(reply.joints, reply.answers, strict=True)
    warn_without_power(session, {n: "hwfa" for n, answer in answers if answer == "unsupported"})
    return code


@takes(
    JOINTS,
    argument("--stiffness", "-k", type=number, metavar="NUMBER", help="N·m/rad (N/m)."),
    argument("--damping", "-d", type=number, metavar="NUMBER", help="N·m·s/rad (N·s/m)."),
)
def impedance(
    session: Session, joints: list[str], stiffness: float | None, damping: float | None
) -> int:
    """Show the stiffness and damping of joints, or set them; without -d it fits -k."""
    names = session.joints(joints)
    if stiffness is None and damping is None:
        rows = read_impedance(session, names)
        show(session, rows, lambda: impedance_table(session, rows))
        return DONE
    reply = session.client.set_impedance(names, stiffness, damping)
    return conclude(session, reply, f"impedance set: {', '.join(names)}")


@takes(
    argument(
        "words",
        nargs="*",
        metavar="JOINT… [automatic|open|closed]",
        help="Joints, none: all that have a brake; then who works it.",
        offers=joints_then(tuple(BrakeMode)),
    )
)
def brake(session: Session, words: list[str]) -> int:
    """Show the brakes of joints, or choose who works them: automatic, open, closed.

    automatic: the board opens a brake before power acts and closes it before power goes. open and
    closed are by hand: an open brake holds nothing where there is no power, a joint whose brake is
    closed refuses modes with power.
    """
    wanted = words[-1].lower() if words and words[-1].lower() in set(BrakeMode) else ""
    named = words[:-1] if wanted else words
    try:
        names = session.joints(named) if named else None
    except Refused as error:
        raise Refused(f"{error}; brakes are {', '.join(BrakeMode)}") from None
    if not wanted:
        rows = read_brakes(session, names or list(session.names))
        show(session, rows, lambda: brake_table(session, rows))
        return DONE
    reply = session.client.set_brake(names, wanted)
    text = f"{', '.join(reply.joints)}: brake {wanted}"
    return conclude(session, reply, text, mode=UNPOWERED.code)


def brake_table(session: Session, rows: Rows) -> Any:
    columns = {
        "control": [row["mode"] or "no brake" for row in rows.values()],
        "state": [
            "closed" if row["closed"] else "open" * bool(row["mode"]) for row in rows.values()
        ],
    }
    return grid({"joint": list(rows), **columns}, names=session.names)


def impedance_table(session: Session, rows: Rows) -> Any:
    fields = {
        "stiffness": "stiffness",
        "max": "max_stiffness",
        "damping": "damping",
        "max ": "max_damping",
        "torque offset": "torque_offset",
    }
    columns = {
        title: [f"{row[field]:.4g}" for row in rows.values()] for title, field in fields.items()
    }
    return grid(
        {"joint": list(rows), **columns},
        names=session.names,
        right=list(fields),
        caption="N·m/rad, N·m·s/rad, N·m; sliding joints: N/m, N·s/m, N",
    )
