# SPDX-License-Identifier: Apache-2.0
"""cbctl velocity, torque, current and their like: references that are repeated, or stay."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from ..board.session import Session
from ..board.streaming import Send, duration, stream
from ..line.arguments import FOR, JOINTS, VALUES, argument, takes
from ..line.words import UsageError, assignments, quantity
from ..text.output import conclude, note

if TYPE_CHECKING:
    from control_board_ros.core.terms.reply import Reply


ONCE = argument(
    "--once", action="store_true", help="Send it once; it expires (0.2 s) unless repeated."
)


@takes(VALUES, FOR, ONCE)
def velocity(session: Session, words: list[str], time: str | None, once: bool) -> int:
    """Stream velocities (mode vel or mix) for a time, or until Ctrl-C; then stop."""
    return velocities(session, words, time, once, session.client.velocity_move, "vel")


@takes(VALUES, FOR, ONCE)
def veldirect(session: Session, words: list[str], time: str | None, once: bool) -> int:
    """Stream velocities that act at once (mode veld) for a time, or until Ctrl-C; then stop."""
    return velocities(session, words, time, once, session.client.set_ref_velocity, "veld")


def velocities(
    session: Session,
    words: list[str],
    time: str | None,
    once: bool,
    method: Callable[..., Reply],
    mode: str,
) -> int:
    """Stream velocities, or send them once; ``method`` of the client sends them."""
    seconds = duration(time)
    if once and seconds is not None:
        raise UsageError("--once and --for exclude each other")
    values = session.within_limits(assignments(words, "speed"), "speed")
    names, send = list(values), partial(method, answered=True)
    if once:
        reply = send(names, list(values.values()))
        return conclude(session, reply, f"sent: {', '.join(names)}", mode=mode)
    if seconds is None:
        note(session, "streaming until Ctrl-C")
    return stream(session, send, values, seconds, mode)


@takes(VALUES, FOR)
def torque(session: Session, words: list[str], time: str | None) -> int:
    """Set torques (mode torq); with --for stream them, then set zero."""
    seconds, values = duration(time), session.within_limits(assignments(words, "torque"), "torque")
    send = partial(session.client.set_ref_torque, answered=True)
    if seconds is not None:
        return stream(session, send, values, seconds, "torq")
    return set_once(session, send, values, "torque references", "{:g}", "torq")


@takes(VALUES, FOR)
def current(session: Session, words: list[str], time: str | None) -> int:
    """Set motor currents (mode icur); with --for stream them, then set zero."""
    seconds = duration(time)
    values = session.within_limits(assignments(words, "current"), "current")
    send = partial(session.client.set_ref_current, answered=True)
    if seconds is not None:
        return stream(session, send, values, seconds, "icur")
    return set_once(session, send, values, "current references", "{:g} A", "icur")


@takes(VALUES, FOR)
def output(session: Session, words: list[str], time: str | None) -> int:
    """Set outputs in PWM percent (mode open); with --for stream them, then set zero."""
    seconds, values = duration(time), session.within_limits(assignments(words, "output"), "output")
    send = partial(session.client.set_output, answered=True)
    if seconds is not None:
        return stream(session, send, values, seconds, "open")
    return set_once(session, send, values, "outputs", "{:g} %", "open")


def set_once(
    session: Session, send: Send, values: dict[str, float], label: str, shown: str, mode: str
) -> int:
    """Send references that stay, and report those of the board: it bounds them.

    Args:
        session: with the board.
        send: sends them, and gives the board's answer.
        values: by joint.
        label: for the printed line.
        shown: format of one value.
        mode: that accepts them.
    """
    reply = send(list(values), list(values.values()))
    held = zip(reply.joints, reply.values, strict=False)
    text = ", ".join(f"{name} {shown.format(value)}" for name, value in held)
    return conclude(session, reply, f"{label}: {text}; they stay until changed", mode=mode)


@takes(
    JOINTS,
    argument("--output", metavar="PERCENT", help="On the output, e.g. 5%."),
    argument("--torque", metavar="TORQUE", help="On the impedance torque, e.g. 2Nm."),
)
def feedforward(
    session: Session, joints: list[str], output: str | None, torque: str | None
) -> int:
    """Set the feed-forward terms of joints."""
    if output is None and torque is None:
        raise UsageError("give --output, --torque or both")
    outputs = None if output is None else quantity(output, "output").value
    torques = None if torque is None else quantity(torque, "torque").value
    names = session.joints(joints)
    reply = session.client.set_feedforward(names, outputs, torques, answered=True)
    return conclude(session, reply, f"feed-forward set: {', '.join(names)}")
