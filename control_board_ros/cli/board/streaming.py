# SPDX-License-Identifier: Apache-2.0
"""Streams of references, and the stop at their end."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from functools import partial

from control_board_ros.core.terms.reply import Answer, Reply, joints_of
from control_board_ros.core.terms.vocabs import HAND_TIMEOUT

from ..line.words import short_names
from ..text.output import REFUSED, conclude, note
from .progress import Bar, Standstill
from .session import Session
from .status import warn_not_holding, what_they_do

#: Hz; velocity references expire after 0.2 s unless configured otherwise.
RATE = 50.0
#: s to wait for the end of a ramp.
RAMP_TIMEOUT = 5.0
#: Maximum number of joints whose positions are shown.
MAX_JOINTS_SHOWN = 2

#: Sends values of joints, and returns the board's reply; takes ``valid_for`` (P12).
Send = Callable[..., Reply]


def wait_for_ramps(session: Session, names: list[str]) -> None:
    """Wait until the velocity references have ramped down."""
    from control_board_ros.client import BoardTimeout

    columns = [session.names.index(name) for name in names]
    with contextlib.suppress(BoardTimeout):  # a very slow ramp: report the present
        session.client.wait_for_state(
            lambda state: not state.velocity_reference[columns].any(), RAMP_TIMEOUT
        )


def stream(
    session: Session, send: Send, values: dict[str, float], seconds: float | None, mode: str
) -> int:
    """Send references until the time is over or Ctrl-C, then zero; the exit code.

    It ends early when the board ignores them: a joint has left its mode. Zero is sent whatever
    ends it. Ctrl-C before the end of the time is exit code 1; without a time it is the regular
    end. Deviations of the board are reported once.

    Args:
        session: with the board.
        send: sends references and returns the board's reply.
        values: by joint.
        seconds: duration; None: until Ctrl-C.
        mode: control mode that accepts them.
    """
    from control_board_ros.client import BoardError

    names = list(values)
    start = time.monotonic()
    reply, shown, interrupted = None, "", False
    try:
        for reply in sent(session, send, values, seconds):
            if not reply:
                break
            if reply.message and not shown:
                shown = reply.message
                note(session, shown)
    except KeyboardInterrupt:
        interrupted = seconds is not None
    except BaseException:
        with contextlib.suppress(BoardError):
            send(names, [0.0] * len(names))
        raise
    if reply is not None and not reply:
        if accepting := joints_of(reply, Answer.ACCEPTED):
            end(session, send, accepting)
        return conclude(session, reply, mode=mode)
    if interrupted:
        note(session, f"interrupted after {time.monotonic() - start:.1f} s of {seconds:g} s")
    last = end(session, send, names)
    code = conclude(session, last, f"stopped: {what_they_do(session, names)}")
    warn_not_holding(session, names)
    return REFUSED if interrupted else code


def sent(
    session: Session, send: Send, values: dict[str, float], seconds: float | None
) -> Iterator[Reply]:
    """Send references at RATE, showing the state of the joints; the reply to each."""
    names, numbers = list(values), list(values.values())
    send = partial(send, valid_for=HAND_TIMEOUT)
    where(session, names)  # later calls do not wait
    standstill = Standstill()
    with Bar(session, "streaming", endless=seconds is None) as bar:
        start = due = time.monotonic()
        yield send(names, numbers)  # what is refused at once draws no bar
        while seconds is None or due - start < seconds:
            elapsed = due - start
            left = "Ctrl-C stops" if seconds is None else f"{seconds - elapsed:.1f} s"
            share = 0.0 if seconds is None else elapsed / seconds
            stamp = session.client.get_state(fresh=False).stamp
            hint = standstill.hint(stamp, time.monotonic())
            bar.update(share, f"{where(session, names)}, {left}{hint}")
            due += 1.0 / RATE
            time.sleep(max(due - time.monotonic(), 0.0))
            yield send(names, numbers)
        bar.update(1.0, "done")


def where(session: Session, names: list[str]) -> str:
    """The last received positions of some joints, limited to one line."""
    state = session.client.get_state(fresh=False)
    shorts = short_names(state.names)
    positions = [
        f"{shorts[name]} {session.position(name, float(state.position[j]))}"
        for j, name in enumerate(state.names)
        if name in names
    ]
    return ", ".join(positions[:MAX_JOINTS_SHOWN]) + (
        ", …" if len(positions) > MAX_JOINTS_SHOWN else ""
    )


def end(session: Session, send: Send, names: list[str]) -> Reply:
    """Send zero, and wait for the end of the ramps."""
    reply = send(names, [0.0] * len(names))
    wait_for_ramps(session, names)
    return reply
