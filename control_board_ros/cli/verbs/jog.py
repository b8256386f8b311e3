# SPDX-License-Identifier: Apache-2.0
"""cbctl jog."""

from __future__ import annotations

import sys
import time
from typing import Annotated

import typer

from ..jogging import Jog, keys_at_once, pressed
from ..output import complain, conclude, console
from ..session import Session
from ..tables import short_names
from ..words import Refused, UsageError, quantity
from .arguments import Joints
from .move import what_they_do
from .streaming import RATE, end

HELP = "←→ move, ↑↓ joint, + - speed, q ends"
#: Modes that take velocities.
MODES = ("vel", "mix")


def jog(
    context: typer.Context,
    joints: Joints = None,
    speed: Annotated[str, typer.Option(metavar="SPEED", help="To begin with.")] = "10deg",
) -> int:
    """Move joints with the arrow keys (mode vel or mix); a joint moves while a key is held.

    Left and right move the joint, up and down choose another one, + and - change the speed, q
    ends. When the key is let go, or the line is lost, the joint stops.
    """
    session: Session = context.obj
    if session.options.json or not sys.stdin.isatty():
        raise UsageError("jog needs a keyboard: run it in a terminal, without --json")
    value = quantity(speed, "speed").value
    if value <= 0.0:
        raise UsageError(f"--speed {speed} is not valid; give a speed above 0, e.g. 10deg")
    names = session.joints(joints)
    modes = session.client.get_control_mode(names)
    ready = [name for name, mode in zip(names, modes, strict=True) if mode.code in MODES]
    if not ready:
        words = " ".join(names) if len(names) < len(session.names) else "all"
        raise Refused(f"no joint takes velocities; switch with: cbctl mode {words} vel")
    used = jog_with_keys(session, ready, Jog(len(ready), value))
    reply = end(session, session.client.velocity_move, used or ready[:1])
    return conclude(session, reply, f"stopped: {what_they_do(session, used or ready[:1])}")


def jog_with_keys(session: Session, names: list[str], state: Jog) -> list[str]:
    """Send velocities as the keys say until the end; the joints that were moved."""
    from rich.live import Live

    line(session, names[0], state)  # from now on it is known without waiting
    moving, used = "", dict[str, None]()
    screen = console(stderr=True)
    with keys_at_once() as terminal, Live(console=screen, auto_refresh=False) as live:
        try:
            while not state.ended:
                for key in pressed(terminal, 1.0 / RATE):
                    state.press(key, time.monotonic())
                velocity, name = state.velocity(time.monotonic()), names[state.chosen]
                if moving and (moving != name or not velocity):
                    session.client.velocity_move(moving, 0.0)
                moving = name if velocity else ""
                if velocity:
                    used[name] = None
                    reply = session.client.velocity_move(name, velocity)
                    if not reply:
                        complain(reply.message)
                        break
                live.update(line(session, name, state), refresh=True)
        except KeyboardInterrupt:
            return list(used)  # the end asked for, as q
    return list(used)


def line(session: Session, name: str, state: Jog) -> str:
    """The joint, where it is, how fast it goes, and the keys."""
    heard = session.client.get_state(fresh=False)
    angle = session.show_angle(name, float(heard.position[heard.names.index(name)]))
    speed = session.show_angle(name, state.speed)
    arrow = {-1: "←", 0: " ", 1: "→"}[state.direction]
    return f"{short_names([name], heard.names)[name]} {angle} {arrow} {speed}/s   {HELP}"
