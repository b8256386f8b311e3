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
from ..line.arguments import JOINTS, argument, joints_then_mode, number, with_arguments
from ..line.offers import joints_then
from ..line.words import Refused, UsageError
from ..text.output import DONE, conclude, note, show
from ..text.tables import grid

STIFF = InteractionMode.STIFF
MODE_CODES = tuple(mode.code for mode in REQUESTABLE)
INTERACTION_CODES = tuple(mode.code for mode in InteractionMode)


@with_arguments(joints_then_mode(MODE_CODES))
def mode(session: Session, words: list[str]) -> int:
    """Set the control mode of joints: pos, posd, vel, mix, torq, open, idl, veld, icur, fidl.

    With --board, a mode without joints is set on all joints of that board.
    """
    names, requested = joints_and_mode(session, words, "control", parse_control_mode, MODE_CODES)
    reply = session.client.set_control_mode(names, requested)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {requested}")
    now = zip(reply.joints, reply.answers, reply.modes, strict=False)
    changed = {n: m.code for n, answer, m in now if answer in ("accepted", "unsupported")}
    warn_without_power(session, changed)
    return code


@with_arguments(joints_then_mode(INTERACTION_CODES))
def interaction(session: Session, words: list[str]) -> int:
    """Set the interaction mode of joints: stif or comp.

    With --board, a mode without joints is set on all joints of that board.
    """
    names, requested = joints_and_mode(
        session, words, "interaction", parse_interaction_mode, INTERACTION_CODES
    )
    reply = session.client.set_interaction_mode(names, requested)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {requested}")
    answers = zip(reply.joints, reply.answers, strict=True)
    warn_without_power(session, {n: "hwfa" for n, answer in answers if answer == "unsupported"})
    return code


def joints_and_mode(
    session: Session,
    words: list[str],
    kind: str,
    parse: Callable[[str], Vocab],
    codes: Sequence[str],
) -> tuple[list[str], str]:
    """Split ``JOINT… MODE`` into names and mode; with --board, a mode alone means all joints.

    Raises:
        UsageError: one word only: joints, or a mode?
        Refused: an unknown joint, or an unknown mode; the board explains those that cannot be set.
    """
    if len(words) < 2 and not session.options.board_named:
        verb = "mode" if kind == "control" else kind
        raise UsageError(f"name joints, then a mode, e.g. cbctl {verb} all {codes[0]}")
    names, requested = session.joints(words[:-1]), words[-1]
    try:
        parse(requested)
    except ValueError:
        known = {code: parse(code).name for code in codes}
        hint = nearest(requested, [*known, *known.values()])
        shown = ", ".join(f"{code} ({name})" for code, name in known.items())
        raise Refused(f"{kind} mode {requested[:40]!r} unknown{hint}; one of {shown}") from None
    return names, requested


@with_arguments(
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
    if not reply:
        return conclude(session, reply)
    code = conclude(session, reply, impedance_text(session, read_impedance(session, names)))
    modes = session.client.get_interaction_mode(names)
    if stiff := [n for n, mode in zip(names, modes, strict=True) if mode is STIFF]:
        words = "all" if len(stiff) == len(session.names) else " ".join(stiff)
        step = session.line("interaction", words, "comp")
        note(session, f"a STIFF joint does not feel it: {', '.join(stiff)}; {step}")
    return code


def impedance_text(session: Session, rows: Rows) -> str:
    """Stiffness and damping in force, of each joint."""
    texts = []
    for name, row in rows.items():
        kind = session.kind(name)
        unit = f"{kind.force_unit}/{kind.unit}"
        rate = f"{kind.force_unit}·s/{kind.unit}"
        texts.append(f"{name}: {row['stiffness']:.4g} {unit}, {row['damping']:.4g} {rate}")
    return "; ".join(texts)


@with_arguments(
    argument(
        "words",
        nargs="*",
        metavar="JOINT… [automatic|open|closed]",
        help="Joints, none: all that have a brake; then the mode of the brake.",
        offers=joints_then(tuple(BrakeMode)),
    )
)
def brake(session: Session, words: list[str]) -> int:
    """Show the brakes of joints, or set their modes: automatic, open, closed.

    automatic: the board opens a brake before the motor is powered, and closes it before power is
    removed. open and closed are manual: with an open brake an unpowered joint is free to fall;
    with a closed brake a joint refuses modes with power.
    """
    requested = words[-1].lower() if words and words[-1].lower() in set(BrakeMode) else ""
    named = words[:-1] if requested else words
    try:
        names = session.joints(named) if named else None
    except Refused as error:
        raise Refused(f"{error}; brakes are {', '.join(BrakeMode)}") from None
    if not requested:
        rows = read_brakes(session, names or list(session.names))
        show(session, rows, lambda: brake_table(session, rows))
        return DONE
    reply = session.client.set_brake(names, requested)
    text = f"{', '.join(reply.joints)}: brake {requested}"
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
