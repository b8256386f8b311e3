# SPDX-License-Identifier: Apache-2.0
"""cbctl velocity, torque, current, output: references, streamed or sent once."""

from __future__ import annotations

from functools import partial

from ..board.session import Session
from ..board.streaming import Send, stream
from ..line.arguments import FOR, JOINTS, VALUES, argument, with_arguments
from ..line.words import UsageError, quantity
from ..text.output import conclude, note

ONCE = argument(
    "--once", action="store_true", help="Send it once; it expires (0.2 s) unless repeated."
)


@with_arguments(VALUES, FOR, ONCE)
def velocity(session: Session, words: list[str], time: float | None, once: bool) -> int:
    """Stream velocities (mode vel or mix) for a time, or until Ctrl-C; then stop."""
    return velocities(session, words, time, once, "velocity_move", "vel")


@with_arguments(VALUES, FOR, ONCE)
def veldirect(session: Session, words: list[str], time: float | None, once: bool) -> int:
    """Stream velocities without a ramp (mode veld) for a time, or until Ctrl-C; then stop."""
    return velocities(session, words, time, once, "set_ref_velocity", "veld")


def velocities(
    session: Session,
    words: list[str],
    time: float | None,
    once: bool,
    method: str,
    mode: str,
) -> int:
    """Stream velocities, or send them once; ``method`` of the client sends them."""
    if once and time is not None:
        raise UsageError("--once and --for exclude each other")
    values = session.within_limits(words, "speed")
    send: Send = partial(getattr(session.client, method), answered=True)
    names = list(values)
    if once:
        reply = send(names, list(values.values()))
        return conclude(session, reply, f"sent: {', '.join(names)}", mode=mode)
    if time is None:
        note(session, "streaming until Ctrl-C")
    return stream(session, send, values, time, mode)


@with_arguments(VALUES, FOR)
def torque(session: Session, words: list[str], time: float | None) -> int:
    """Set torques (mode torq); with --for stream them, then set zero."""
    values = session.within_limits(words, "torque")
    send = partial(session.client.set_ref_torque, answered=True)
    return lasting(session, send, values, time, "torque references", "{:g}", "torq")


@with_arguments(VALUES, FOR)
def current(session: Session, words: list[str], time: float | None) -> int:
    """Set motor currents (mode icur); with --for stream them, then set zero."""
    values = session.within_limits(words, "current")
    send = partial(session.client.set_ref_current, answered=True)
    return lasting(session, send, values, time, "current references", "{:g} A", "icur")


@with_arguments(VALUES, FOR)
def output(session: Session, words: list[str], time: float | None) -> int:
    """Set outputs in PWM percent (mode open); with --for stream them, then set zero."""
    values = session.within_limits(words, "output")
    send = partial(session.client.set_output, answered=True)
    return lasting(session, send, values, time, "outputs", "{:g} %", "open")


def lasting(
    session: Session,
    send: Send,
    values: dict[str, float],
    time: float | None,
    label: str,
    shown: str,
    mode: str,
) -> int:
    """Stream references for a time, or send them once and report them as bounded by the board.

    Args:
        session: with the board.
        send: sends references and returns the board's reply.
        values: by joint.
        time: s; None: once.
        label: for the printed line.
        shown: format of one value.
        mode: control mode that accepts them.
    """
    if time is not None:
        return stream(session, send, values, time, mode)
    reply = send(list(values), list(values.values()))
    held = zip(reply.joints, reply.values, strict=False)
    text = ", ".join(f"{name} {shown.format(value)}" for name, value in held)
    return conclude(session, reply, f"{label}: {text}; they stay until changed", mode=mode)


@with_arguments(
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
