# SPDX-License-Identifier: Apache-2.0
"""cbctl pause, resume, advance, reset and inject, for simulated boards only."""

from __future__ import annotations

from ..board.session import Session
from ..line.arguments import argument, with_arguments
from ..line.offers import joints_then
from ..line.words import UsageError
from ..text.output import conclude

FAULTS = ("overcurrent", "encoder", "torque_sensor", "overheating", "external")


def pause(session: Session) -> int:
    """Pause the simulation."""
    text = f"paused; resume with: {session.line('resume')}"
    return conclude(session, session.client.pause(True), text)


def resume(session: Session) -> int:
    """Resume a paused simulation."""
    return conclude(session, session.client.pause(False), "running")


@with_arguments(argument("cycles", nargs="?", default="1", metavar="CYCLES", help="How many."))
def advance(session: Session, cycles: str) -> int:
    """Advance a paused simulation by control cycles."""
    steps = int(cycles) if cycles.isdecimal() else 0
    if not 0 < steps < 2**32:
        raise UsageError(f"cycles {cycles} is not valid; give 1 to {2**32 - 1}")
    return conclude(session, session.client.step(steps), f"advanced by {steps}")


def reset(session: Session) -> int:
    """Return to the initial pose and power-on."""
    return conclude(session, session.client.reset(), "reset")


@with_arguments(
    argument(
        "words",
        nargs="*",
        metavar="JOINT… FAULT",
        help=f"Joints, then one of {', '.join(FAULTS)}.",
        offers=joints_then(FAULTS),
    ),
    argument("--persistent", action="store_true", help="The cause stays until --clear."),
    argument("--clear", action="store_true", help="Remove all injected causes."),
)
def inject(session: Session, words: list[str], persistent: bool, clear: bool) -> int:
    """Inject a fault into simulated joints."""
    if clear and not words:
        reply = session.client.clear_injected_faults()
        text = f"injected causes removed; clear the faults: {session.line('clear')}"
        return conclude(session, reply, text)
    if clear or len(words) < 2:
        raise UsageError("name joints, then a fault, e.g. cbctl inject 0 encoder; or --clear")
    *joints, fault = words
    names = session.joints(joints)
    reply = session.client.inject_fault(names, fault, persistent)
    return conclude(session, reply, f"{fault} injected: {', '.join(names)}")
