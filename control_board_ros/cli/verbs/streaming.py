# SPDX-License-Identifier: Apache-2.0
"""Sending references again and again, and stopping in the end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..output import DONE, REFUSED, conclude
from ..session import Session
from ..words import UsageError, quantity
from .move import what_they_do

if TYPE_CHECKING:
    from control_board_ros.core.reply import Reply

#: Hz; velocity references expire after 0.2 s unless configured otherwise.
RATE = 50.0
#: s to wait for the end of a ramp.
RAMP_TIMEOUT = 5.0

Send = Callable[[list[str], list[float]], "Reply"]


def duration(text: str | None) -> float | None:
    """The seconds of ``--for``.

    Raises:
        UsageError: no time, or none above 0.
    """
    if text is None:
        return None
    seconds = quantity(text, "time").value
    if seconds <= 0.0:
        raise UsageError(f"--for {text} is not valid; give a time above 0, e.g. 2s")
    return seconds


def settle(session: Session, names: list[str]) -> None:
    """Let velocity references ramp down, so that what is told holds."""
    from control_board_ros.client import BoardTimeout

    chosen = [session.names.index(name) for name in names]
    with contextlib.suppress(BoardTimeout):  # a very slow ramp: tell what is so far
        session.client.wait_for_state(
            lambda state: not state.velocity_reference[chosen].any(), RAMP_TIMEOUT
        )


def stream(session: Session, send: Send, values: dict[str, float], seconds: float | None) -> int:
    """Send references until the time is over or Ctrl-C, then zero; the exit code.

    It ends early when the board ignores them: a joint has left its mode.
    """
    names, numbers = list(values), list(values.values())
    interrupted = False
    reply = None
    try:
        start = due = time.monotonic()
        while seconds is None or due - start < seconds:
            reply = send(names, numbers)
            if not reply:
                break
            due += 1.0 / RATE
            time.sleep(max(due - time.monotonic(), 0.0))
    except KeyboardInterrupt:
        interrupted = True
    if reply is not None and not reply:
        if taken := accepted_joints(reply):
            end(session, send, taken)
        return conclude(session, reply)
    last = end(session, send, names)
    told = f"stopped: {what_they_do(session, names)}"
    code = conclude(session, last, told)
    return REFUSED if code != DONE or (interrupted and seconds is not None) else DONE


def accepted_joints(reply: Reply) -> list[str]:
    """The joints of a reply that took the references."""
    answers = zip(reply.joints, reply.answers, strict=True)
    return [name for name, answer in answers if answer == "accepted"]


def end(session: Session, send: Send, names: list[str]) -> Reply:
    """Send zero to joints, and let what they did run out."""
    reply = send(names, [0.0] * len(names))
    settle(session, names)
    return reply
