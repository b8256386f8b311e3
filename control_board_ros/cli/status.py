# SPDX-License-Identifier: Apache-2.0
"""What joints do now, in words, and the next step where nothing holds them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from control_board_ros.core.modes import NOT_HOLDING

from .output import REFUSED, fail, note

if TYPE_CHECKING:
    from .session import Session

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
#: Modes without power, and the next step.
NEXT_STEP = {"idl": "hold with: cbctl mode {} pos", "hwfa": "clear with: cbctl clear {}"}


def what_they_do(session: Session, names: list[str]) -> str:
    """What each joint does, where, in which mode."""
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


def cancelled(session: Session, what: str, names: list[str]) -> int:
    """Say what joints do after Ctrl-C; the exit code."""
    text = f"{what} cancelled: {what_they_do(session, names)}"
    if session.options.json:
        return fail(text, REFUSED, as_json=True)
    note(session, text)
    return REFUSED


def warn_without_power(session: Session, names: Sequence[str]) -> None:
    """Say which of the joints have no power, where they are, and how to hold them."""
    if session.options.json or not names:
        return
    modes = session.client.get_control_mode(names)
    positions = session.client.get_encoder(names).tolist()
    for code, step in NEXT_STEP.items():
        loose = {
            name: session.show_angle(name, q)
            for name, mode, q in zip(names, modes, positions, strict=True)
            if mode.code == code
        }
        if loose:
            where = ", ".join(f"{name} at {angle}" for name, angle in loose.items())
            words = "all" if len(loose) == len(session.names) else " ".join(loose)
            note(session, f"free to fall, without power: {where}; {step.format(words)}")


def warn_not_holding(session: Session, names: list[str]) -> None:
    """Say which joints nothing holds, now that their torque or output is zero."""
    modes = session.client.get_control_mode(names)
    loose = [name for name, mode in zip(names, modes, strict=True) if mode in NOT_HOLDING]
    if loose:
        words = " ".join(loose)
        note(session, f"nothing holds {words} now; hold with: cbctl mode {words} pos")
