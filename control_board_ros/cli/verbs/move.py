# SPDX-License-Identifier: Apache-2.0
"""cbctl move."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer

from ..output import REFUSED, conclude, fail, note
from ..session import Session
from ..words import UsageError, assignments, quantity
from .arguments import Speed, Values
from .progress import Bar

#: How near to its target a joint has arrived, rad and m.
NEAR, NEAR_SLIDING = 0.01, 1e-3


def move(
    context: typer.Context,
    words: Values,
    speed: Speed = None,
    wait: Annotated[bool, typer.Option(help="Wait for the end of the move.")] = True,
) -> int:
    """Move joints along a minimum-jerk profile (mode pos or mix). Ctrl-C stops them."""
    session: Session = context.obj
    values = session.targets(assignments(words, "position"))
    speeds = None if speed is None else speed_above_zero(speed)
    names, positions = list(values), list(values.values())
    client = session.client
    if not wait:
        reply = client.position_move(names, positions, speeds)
        return conclude(session, reply, f"under way: {', '.join(names)}")
    start = time.monotonic()
    try:
        with Bar(session, "moving") as bar:

            def feedback(sent: Any) -> None:
                elapsed = time.monotonic() - start
                whole = elapsed + sent.remaining_time
                bar.update(elapsed / whole if whole > 0 else 1.0, f"{sent.remaining_time:.1f} s")

            reply = client.move(names, positions, speeds, feedback)
            reached = dict(zip(names, client.get_encoder(names).tolist(), strict=True))
            short = {name for name in names if not arrived(session, name, reached, values)}
            if reply and not short:
                bar.update(1.0, "done")
    except KeyboardInterrupt:
        return cancelled(session, "move", names)
    told = ", ".join(
        f"{name} at {session.show_angle(name, q)}"
        + (f", not at {session.show_angle(name, values[name])}" if name in short else "")
        for name, q in reached.items()
    )
    return conclude(session, reply, told, positions=reached)


def speed_above_zero(text: str) -> float:
    """The speed of ``--speed``.

    Raises:
        UsageError: no speed, or none above 0.
    """
    value = quantity(text, "speed").value
    if value <= 0.0:
        raise UsageError(f"--speed {text} is not valid; give a speed above 0, e.g. 20deg")
    return value


def arrived(
    session: Session, name: str, reached: dict[str, float], targets: dict[str, float]
) -> bool:
    """Whether a joint is measured to be at its target."""
    near = NEAR_SLIDING if session.slides(name) else NEAR
    return abs(reached[name] - targets[name]) <= near


def cancelled(session: Session, what: str, names: list[str]) -> int:
    """Say what the joints do after Ctrl-C; the exit code."""
    told = what_they_do(session, names)
    if not session.options.json:
        note(session, f"{what} cancelled: {told}")
        return REFUSED
    return fail(f"{what} cancelled: {told}", REFUSED, as_json=True)


def what_they_do(session: Session, names: list[str]) -> str:
    """What joints do now, in words."""
    client = session.client
    modes = client.get_control_mode(names)
    positions = client.get_encoder(names).tolist()
    torques, outputs = client.get_ref_torque(names), client.get_output(names)
    doing = [
        DOING.get(mode.code, "is").format(torque=torque, output=output, unit=unit)
        for mode, torque, output, unit in zip(
            modes, torques, outputs, map(session.torque_unit, names), strict=True
        )
    ]
    return ", ".join(
        f"{name} {does} at {session.show_angle(name, q)} ({mode.name})"
        for name, does, q, mode in zip(names, doing, positions, modes, strict=True)
    )


#: What a joint does in a mode when nothing more is asked of it.
DOING = {
    "pos": "holds",
    "posd": "holds",
    "vel": "holds",
    "mix": "holds",
    "torq": "gives {torque:.3g} {unit}",
    "open": "gets {output:.3g} %",
    "idl": "is free, without power,",
    "hwfa": "is in fault, without power,",
    "cal": "is calibrating",
    "cfgn": "is not configured",
}
