# SPDX-License-Identifier: Apache-2.0
"""cbctl velocity, torque, output and feedforward: references that are repeated, or stay."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ..arguments import FOR, JOINTS, VALUES, argument, takes
from ..output import conclude, note
from ..session import Session
from ..streaming import Send, duration, stream
from ..words import UsageError, assignments, quantity

if TYPE_CHECKING:
    from control_board_ros.protocols import Floats


@takes(
    VALUES,
    FOR,
    argument(
        "--once", action="store_true", help="Send it once; it expires (0.2 s) unless repeated."
    ),
)
def velocity(session: Session, words: list[str], time: str | None, once: bool) -> int:
    """Stream velocities (mode vel or mix) for a time, or until Ctrl-C; then stop."""
    seconds = duration(time)
    if once and seconds is not None:
        raise UsageError("--once and --for exclude each other")
    values = session.values(assignments(words, "speed"))
    names = list(values)
    if once:
        reply = session.client.velocity_move(names, list(values.values()))
        return conclude(session, reply, f"sent: {', '.join(names)}")
    if seconds is None:
        note(session, "streaming until Ctrl-C")
    return stream(session, session.client.velocity_move, values, seconds)


@takes(VALUES, FOR)
def torque(session: Session, words: list[str], time: str | None) -> int:
    """Set torques (mode torq); with --for stream them, then set zero."""
    seconds, values = duration(time), session.values(assignments(words, "torque"))
    client = session.client
    if seconds is not None:
        return stream(session, client.set_ref_torque, values, seconds)
    return set_once(
        session, client.set_ref_torque, client.get_ref_torque, values, "torque references", "{:g}"
    )


@takes(VALUES, FOR)
def output(session: Session, words: list[str], time: str | None) -> int:
    """Set outputs in PWM percent (mode open); with --for stream them, then set zero."""
    seconds, values = duration(time), session.values(assignments(words, "output"))
    client = session.client
    if seconds is not None:
        return stream(session, client.set_output, values, seconds)
    return set_once(session, client.set_output, client.get_output, values, "outputs", "{:g} %")


def set_once(
    session: Session,
    send: Send,
    get: Callable[[list[str]], Floats],
    values: dict[str, float],
    label: str,
    shown: str,
) -> int:
    """Send references that stay, and tell those that the board has then: it bounds them.

    Args:
        session: with the board.
        send: sends them.
        get: reads those in force, shape (k,).
        values: by joint.
        label: what they are, for the line that tells of them.
        shown: how one value is written in it.
    """
    names = list(values)
    reply = send(names, list(values.values()))
    if not reply:
        return conclude(session, reply, "")
    told = []
    for (name, wanted), held in zip(values.items(), get(names).tolist(), strict=True):
        instead = f", bounded, instead of {shown.format(wanted)}"
        told.append(f"{name} {shown.format(held)}{'' if held == wanted else instead}")
    return conclude(session, reply, f"{label}: {', '.join(told)}; they stay until changed")


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
    reply = session.client.set_feedforward(names, outputs, torques)
    return conclude(session, reply, f"feed-forward set: {', '.join(names)}")
