# SPDX-License-Identifier: Apache-2.0
"""Saying that joints have no power, at the moment it happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .output import note

if TYPE_CHECKING:
    from .session import Session

#: Modes without power, and the next step.
NEXT_STEP = {"idl": "hold with: cbctl mode {} pos", "hwfa": "clear with: cbctl clear {}"}


def tell_of_falling(session: Session, names: Sequence[str]) -> None:
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
            told = ", ".join(f"{name} at {angle}" for name, angle in loose.items())
            words = "all" if len(loose) == len(session.names) else " ".join(loose)
            note(session, f"free to fall, without power: {told}; {step.format(words)}")
