# SPDX-License-Identifier: Apache-2.0
"""cbctl mode, interaction, impedance and clear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from control_board_ros.core.vocabs import Vocab, parse_control_mode, parse_interaction_mode

from ..arguments import JOINTS, JOINTS_THEN_MODE, argument, number, several, takes
from ..completion import LAST_WORDS, MODE_CODES
from ..output import DONE, REFUSED, conclude, show
from ..reading import Rows, read_faults, read_impedance
from ..session import Session
from ..status import warn_without_power
from ..tables import grid
from ..words import Refused, UsageError, nearest


@takes(JOINTS_THEN_MODE)
def mode(session: Session, words: list[str]) -> int:
    """Set the control mode of joints: pos, posd, vel, mix, torq, open, idl, fidl.

    Of a board that --board names, a mode alone is for all joints.
    """
    joints, wanted = joints_and_mode(of_board(session, words), "cbctl mode all pos")
    names = session.joints(joints)
    check_mode("control", wanted, parse_control_mode, MODE_CODES)
    reply = session.client.set_control_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    changed = ("accepted", "unsupported")
    answers = zip(reply.joints, reply.answers, strict=True)
    warn_without_power(session, [name for name, answer in answers if answer in changed])
    return code


def check_mode(kind: str, text: str, parse: Callable[[str], Vocab], codes: Sequence[str]) -> None:
    """Refuse what is no mode, naming those that can be set.

    Raises:
        Refused: a word that means no mode; of a status the board itself says why it is none.
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


@takes(JOINTS_THEN_MODE)
def interaction(session: Session, words: list[str]) -> int:
    """Set the interaction mode of joints: stif or comp.

    Of a board that --board names, a mode alone is for all joints.
    """
    joints, wanted = joints_and_mode(of_board(session, words), "cbctl interaction all comp")
    names = session.joints(joints)
    check_mode("interaction", wanted, parse_interaction_mode, LAST_WORDS["interaction"])
    reply = session.client.set_interaction_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    answers = zip(reply.joints, reply.answers, strict=True)
    warn_without_power(session, [name for name, answer in answers if answer == "unsupported"])
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


@several
@takes(JOINTS)
def clear(session: Session, joints: list[str]) -> int:
    """Send FORCE_IDLE to the joints in fault; tell which causes persist."""
    names = session.joints(joints)
    rows = clear_faults(session, names)
    nothing = f"nothing to clear: none of {len(names)} is in fault"
    stuck = any(not row["cleared"] for row in rows.values())
    show(
        session,
        {"success": not stuck, "joints": rows},
        lambda: cleared_table(session, rows) if rows else nothing,
    )
    warn_without_power(session, [name for name, row in rows.items() if row["cleared"]])
    return REFUSED if stuck else DONE


def clear_faults(session: Session, names: list[str]) -> Rows:
    """What the fault of each joint in fault was, and whether it is cleared now."""
    before = {n: r for n, r in read_faults(session, names).items() if r["active"]}
    rows = {}
    for name, record in before.items():
        reply = session.client.set_control_mode(name, "fidl")
        rows[name] = {
            "code": record["code"],
            "fault": record["text"],
            "cleared": bool(reply),
            "message": reply.message,
        }
    return rows


def cleared_table(session: Session, rows: Rows) -> Any:
    from rich.text import Text

    states = {True: Text("idle, cleared", "green"), False: Text("the cause persists", "bold red")}
    columns = {
        "joint": list(rows),
        "fault": [row["fault"] for row in rows.values()],
        "now": [states[row["cleared"]] for row in rows.values()],
    }
    return grid(columns, names=session.names, fold=("fault",))
