# SPDX-License-Identifier: Apache-2.0
"""cbctl move, direct, jog, stop and speed."""

from __future__ import annotations

import sys
import time
from argparse import BooleanOptionalAction
from functools import partial
from typing import Any

from control_board_ros.core.terms.modes import ACCEPTS
from control_board_ros.core.terms.vocabs import HAND_TIMEOUT, CommandKind

from ..board.progress import Bar, Standstill, Way
from ..board.session import Session
from ..board.status import cancelled, warn_without_power, what_they_do
from ..board.streaming import RATE, end
from ..line.arguments import JOINTS, VALUES, ahead, amount, argument, with_arguments
from ..line.jogging import Jog, keys_at_once, pressed
from ..line.words import Refused, UsageError, short_names
from ..text.output import complain, conclude, console


@with_arguments(
    VALUES,
    amount("--speed", "speed", metavar="SPEED", help="Mean speed, e.g. 20deg; default: as set."),
    argument(
        "--wait",
        action=BooleanOptionalAction,
        default=True,
        help="Wait for the end of the move (default), or return immediately.",
    ),
)
def move(session: Session, words: list[str], speed: float | None, wait: bool) -> int:
    """Move joints along a minimum-jerk profile (mode pos or mix). Ctrl-C stops them."""
    values = session.within_limits(words)
    names, positions = list(values), list(values.values())
    client = session.client
    if not wait:
        reply = client.position_move(names, positions, speed)
        return conclude(session, reply, f"under way: {', '.join(names)}")
    way = Way(values, {name: near(session, name) for name in names})
    standstill = Standstill(session.options.timeout)
    try:
        with Bar(session, "moving") as bar:

            def feedback(sent: Any) -> None:
                left = sent.remaining_time
                share = way.share(dict(zip(sent.names, sent.positions, strict=True)))
                bar.update(share, f"{left:.1f} s{standstill.hint(left, time.monotonic())}")

            reply = client.move(names, positions, speed, feedback)
            reached = dict(zip(names, client.get_encoder(names).tolist(), strict=True))
            short = {name for name in names if not arrived(session, name, reached, values)}
            if reply and not short:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, "move", names)
    text = ", ".join(
        f"{name} at {session.position(name, q)}"
        + (f", not at {session.position(name, values[name])}" if name in short else "")
        for name, q in reached.items()
    )
    return conclude(session, reply, text, positions=reached)


def arrived(
    session: Session, name: str, reached: dict[str, float], targets: dict[str, float]
) -> bool:
    return abs(reached[name] - targets[name]) <= near(session, name)


def near(session: Session, name: str) -> float:
    """The board's tolerance of an arrival, rad or m."""
    from control_board_ros.core.goals.tasks import tolerance  # with numpy

    return tolerance(session.kind(name))


@with_arguments(VALUES)
def direct(session: Session, words: list[str]) -> int:
    """Step the position references (mode posd)."""
    values = session.within_limits(words)
    reply = session.client.set_position(list(values), list(values.values()), answered=True)
    text = ", ".join(f"{name} to {session.position(name, v)}" for name, v in values.items())
    return conclude(session, reply, text, mode="posd")


KEYS = "←→ move, ↑↓ joint, + - speed, q ends"
#: Modes that accept velocities.
VELOCITY_MODES = frozenset(m for m, kinds in ACCEPTS.items() if CommandKind.VELOCITY in kinds)


@with_arguments(
    JOINTS,
    amount("--speed", "speed", default="10deg", metavar="SPEED", help="Initial speed."),
)
def jog(session: Session, joints: list[str], speed: float) -> int:
    """Move joints with the arrow keys (mode vel or mix); a joint moves while a key is held.

    Left and right move the joint, up and down choose another one, + and - change the speed, q
    ends. When the key is released, or the connection is lost, the joint stops.
    """
    if session.options.json or not sys.stdin.isatty():
        raise UsageError("jog needs a keyboard: run it in a terminal, without --json")
    names = session.joints(joints)
    modes = session.client.get_control_mode(names)
    ready = [name for name, mode in zip(names, modes, strict=True) if mode in VELOCITY_MODES]
    if not ready:
        words = " ".join(names) if len(names) < len(session.names) else "all"
        step = session.line("mode", words, "vel")
        raise Refused(f"no joint accepts velocities; switch with: {step}")
    used = jog_with_keys(session, ready, Jog(len(ready), speed))
    reply = end(session, partial(session.client.velocity_move, answered=True), used or ready[:1])
    return conclude(session, reply, f"stopped: {what_they_do(session, used or ready[:1])}")


def jog_with_keys(session: Session, names: list[str], keys: Jog) -> list[str]:
    """Send velocities by the keys until the end; returns the joints that were moved."""
    from rich.live import Live

    standstill = Standstill()
    line(session, names[0], keys, standstill)  # later calls do not wait
    moving, used = "", dict[str, None]()
    screen = console(stderr=True)
    with keys_at_once() as terminal, Live(console=screen, auto_refresh=False) as live:
        try:
            while not keys.ended:
                for key in pressed(terminal, 1.0 / RATE):
                    keys.press(key, time.monotonic())
                velocity, name = keys.velocity(time.monotonic()), names[keys.joint_index]
                if moving and (moving != name or not velocity):
                    session.client.velocity_move(moving, 0.0)
                moving = name if velocity else ""
                if velocity:
                    used[name] = None
                    reply = session.client.velocity_move(
                        name, velocity, answered=True, valid_for=HAND_TIMEOUT
                    )
                    if not reply:
                        complain(reply.message)
                        break
                live.update(line(session, name, keys, standstill), refresh=True)
        except KeyboardInterrupt:
            return list(used)  # the end requested, as q
    return list(used)


def line(session: Session, name: str, keys: Jog, standstill: Standstill) -> str:
    """The joint, its position and speed, and the keys."""
    state = session.client.get_state(fresh=False)
    angle = session.position(name, float(state.position[state.names.index(name)]))
    speed = session.position(name, keys.speed)
    arrow = {-1: "←", 0: " ", 1: "→"}[keys.direction]
    hint = standstill.hint(state.stamp, time.monotonic())
    return f"{short_names([name], state.names)[name]} {angle} {arrow} {speed}/s   {KEYS}{hint}"


def halt(session: Session, joints: list[str]) -> None:
    """Stop the joints of a board at once."""
    session.client.stop(session.joints(joints) if joints else None)


@ahead(halt)
@with_arguments(JOINTS)
def stop(session: Session, joints: list[str]) -> int:
    """Stop joints where they are; their modes stay."""
    names = session.joints(joints)
    reply = session.client.stop(names)
    code = conclude(session, reply, f"stopped: {', '.join(reply.joints)}")
    modes = [mode.code for mode in session.client.get_control_mode(names)]
    warn_without_power(session, dict(zip(names, modes, strict=True)))
    return code


@with_arguments(
    VALUES,
    argument("--acceleration", action="store_true", help="Set accelerations instead of speeds."),
)
def speed(session: Session, words: list[str], acceleration: bool) -> int:
    """Set the reference speeds of later moves."""
    kind = "acceleration" if acceleration else "speed"
    values = session.within_limits(words, kind)
    names, numbers = list(values), list(values.values())
    if acceleration:
        reply = session.client.set_ref_acceleration(names, numbers)
    else:
        reply = session.client.set_ref_speed(names, numbers)
    rate = "/s²" if acceleration else "/s"
    shown = [f"{session.position(name, values[name])}{rate}" for name in names]
    text = f"{shown[0]} for {', '.join(names)}"
    if len(set(shown)) > 1:
        text = ", ".join(f"{name} {value}" for name, value in zip(names, shown, strict=True))
    return conclude(session, reply, f"reference {kind} set: {text}")
