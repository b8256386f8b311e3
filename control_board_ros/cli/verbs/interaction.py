# SPDX-License-Identifier: Apache-2.0
"""cbctl interaction."""

from __future__ import annotations

import typer

from control_board_ros.core.vocabs import parse_interaction_mode

from ..offers import LAST_WORDS
from ..output import conclude
from ..power import tell_of_falling
from ..session import Session
from .arguments import JointsThenMode
from .mode import check_mode, joints_and_mode


def interaction(context: typer.Context, words: JointsThenMode) -> int:
    """Set the interaction mode of joints: stif or comp."""
    session: Session = context.obj
    joints, wanted = joints_and_mode(words, "cbctl interaction all comp")
    names = session.joints(joints)
    check_mode(wanted, parse_interaction_mode, LAST_WORDS["interaction"])
    reply = session.client.set_interaction_mode(names, wanted)
    code = conclude(session, reply, f"{', '.join(reply.joints)}: {wanted}")
    answers = zip(reply.joints, reply.answers, strict=True)
    tell_of_falling(session, [name for name, answer in answers if answer == "unsupported"])
    return code
