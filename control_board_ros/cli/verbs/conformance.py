# SPDX-License-Identifier: Apache-2.0
"""cbctl conformance."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from control_board_ros.program_options import CONFORMANCE

from ..board.session import Session
from ..line.arguments import argument, with_arguments
from ..line.words import UsageError
from ..text.output import DONE, complain, show


def sentence(text: str) -> str:
    """A help text as cbctl writes them."""
    return f"{text[0].upper()}{text[1:]}."


@with_arguments(
    *(
        argument(*names, **settings | {"help": sentence(settings["help"])})
        for names, settings in CONFORMANCE
    )
)
def conformance(session: Session, **options: Any) -> int:
    """Test the rules of the specification on this board, and report each result.

    After a confirmation, one joint moves within a part of its limits and is unpowered at times;
    all settings are restored. Exit code 1: a rule failed, or too many rules that the board offers
    were not tested.
    """
    from control_board_ros.conformance.app import selected_rules, try_board

    asked = Namespace(**options, json=session.options.json, timeout=session.options.timeout)
    try:
        rules = selected_rules(asked)
    except ValueError as error:
        raise UsageError(str(error)) from None
    if asked.list:
        titles = {rule.name: rule.title for rule in rules}
        show(session, titles, lambda: "\n".join(f"{n:<5}{title}" for n, title in titles.items()))
        return DONE
    if asked.joint is not None:
        (asked.joint,) = session.joints([asked.joint])
    return try_board(session.node, session.client, asked, rules, complain)
