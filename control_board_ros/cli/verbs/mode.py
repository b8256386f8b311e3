# SPDX-License-Identifier: Apache-2.0
"""cbctl mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import typer

from control_board_ros.core.vocabs import Vocab, parse_control_mode

from ..offers import MODE_CODES
from ..output import conclude
from ..power import tell_of_falling
from ..session import Session
from ..words import Refused, UsageError
from .arguments import JointsThenMode


def mode(context: typer.Context, words: JointsThenMode) -> int:
    """Set the control mode of joints: pos, posd, vel, mix, torq, open, idl, fidl."""
    session: Session = context.obj
    joints, wanted = joints_and_mode(words, "cbctl mode all pos")
    names = session.joints(joints)
    check_mode(wanted, parse_control_mode, MODE_CODES)
    reply = session.client.set_control_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    changed = ("accepted", "unsupported")
    answers = zip(reply.joints, reply.answers, strict=True)
    tell_of_falling(session, [name for name, answer in answers if answer in changed])
    return code


def check_mode(text: str, parse: Callable[[str], Vocab], codes: Sequence[str]) -> None:
    """Refuse what is no mode, naming those that can be set.

    Raises:
        Refused: a word that means no mode; of a status the board itself says why it is none.
    """
    try:
        parse(text)
    except ValueError as error:
        told = ", ".join(f"{code} ({parse(code).name})" for code in codes)
        raise Refused(f"{str(error).partition('; known:')[0]}; one of {told}") from None


def joints_and_mode(words: list[str], example: str) -> tuple[list[str], str]:
    """Split ``JOINT… MODE``.

    Raises:
        UsageError: one word only: joints, or a mode?
    """
    if len(words) < 2:
        raise UsageError(f"name joints, then a mode, e.g. {example}")
    return words[:-1], words[-1]
