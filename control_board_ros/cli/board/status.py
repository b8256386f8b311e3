# SPDX-License-Identifier: Apache-2.0
"""The state of joints in words, and the next step where nothing holds them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from control_board_ros.core.terms.modes import NOT_HOLDING
from control_board_ros.core.terms.vocabs import BrakeMode

from ..text.advice import HOLD, STEPS
from ..text.output import REFUSED, fail, note

if TYPE_CHECKING:
    from .session import Session

#: What a joint does in each mode.
DOING = {
    "pos": "holds",
    "posd": "holds",
    "vel": "holds",
    "veld": "holds",
    "mix": "holds",
    "torq": "applies {torque:.3g} {unit}",
    "open": "applies {output:.3g} %",
    "icur": "applies {current:.3g} A",
    "idl": "is free, without power,",
    "hwfa": "is in fault, without power,",
    "cal": "is calibrating",
    "cfgn": "is not configured",
}
#: Modes without power, and the next step.
WITHOUT_POWER = {"idl": HOLD, "hwfa": STEPS["in_fault"]}


def what_they_do(session: Session, names: list[str]) -> str:
    """What each joint does, where, in which mode."""
    client = session.client
    modes = client.get_control_mode(names)
    positions = client.get_encoder(names).tolist()
    last = client.get_references(names)
    references = zip(last.torques, last.outputs, last.currents, strict=True)
    doing = [
        DOING.get(mode.code, "is").format(
            torque=torque, output=output, current=current, unit=session.kind(name).force_unit
        )
        for name, mode, (torque, output, current) in zip(names, modes, references, strict=True)
    ]
    return ", ".join(
        f"{name} {does} at {session.position(name, q)} ({mode.name})"
        for name, does, q, mode in zip(names, doing, positions, modes, strict=True)
    )


def cancelled(session: Session, what: str, names: list[str]) -> int:
    """Report the state of joints after Ctrl-C; returns the exit code."""
    text = f"{what} cancelled: {what_they_do(session, names)}"
    if session.options.json:
        return fail(text, REFUSED, as_json=True)
    note(session, text)
    return REFUSED


def warn_without_power(session: Session, modes: Mapping[str, str]) -> None:
    """Report the unpowered joints, their positions, and how to hold them.

    Args:
        session: with the board.
        modes: codes of the present modes, by joint.
    """
    if session.options.json:
        return
    for code, (what, verb) in WITHOUT_POWER.items():
        loose = [name for name, mode in modes.items() if mode == code]
        if loose := without_brake(session, loose):
            positions = session.client.get_encoder(loose).tolist()
            angles = zip(loose, map(session.position, loose, positions), strict=True)
            where = ", ".join(f"{name} at {angle}" for name, angle in angles)
            words = "all" if len(loose) == len(session.names) else " ".join(loose)
            step = f"{what}: {session.line(verb.format(joints=words))}"
            note(session, f"free to fall, without power: {where}; {step}")


def without_brake(session: Session, names: list[str]) -> list[str]:
    """Those of unpowered joints that no brake holds or is about to hold."""
    if not names:
        return []
    from control_board_ros.client import BoardError

    try:
        worked = session.client.get_brake(names)
    except BoardError:  # a board without brakes
        return names
    held = (BrakeMode.AUTOMATIC, BrakeMode.CLOSED)
    return [name for name, brake in zip(names, worked, strict=True) if brake not in held]


def warn_not_holding(session: Session, names: list[str]) -> None:
    """Report the joints that nothing holds, now that their torque or output is zero."""
    modes = session.client.get_control_mode(names)
    loose = [name for name, mode in zip(names, modes, strict=True) if mode in NOT_HOLDING]
    if loose:
        words = " ".join(loose)
        what, verb = HOLD
        step = session.line(verb.format(joints=words))
        note(session, f"nothing holds {words} now; {what}: {step}")
