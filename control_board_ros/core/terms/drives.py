# SPDX-License-Identifier: Apache-2.0
"""Kinds of set-points of drives, and their use for the laws (SPEC S1, S5); no numpy."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import NamedTuple


class SetPoint(IntEnum):
    """The kinds of set-point; OFF disables the motor."""

    OFF = 0
    PWM = 1
    CURRENT = 2
    TORQUE = 3
    VELOCITY = 4
    POSITION = 5
    IMPEDANCE = 6

    @property
    def code(self) -> str:
        """As users write it: ``position``."""
        return self.name.lower()


#: The set-points that a drive can accept.
KINDS = tuple(kind for kind in SetPoint if kind is not SetPoint.OFF)


#: Kinds whose drive closes the loop of a position, or the damping in it, itself.
CLOSE_POSITION = (SetPoint.POSITION, SetPoint.IMPEDANCE, SetPoint.VELOCITY)


class OnSilence(StrEnum):
    """Reaction of a motor to missing commands (S5)."""

    FREE = "free"  # no power
    DAMPED = "damped"  # its terminals shorted, or a velocity of 0 against damping
    BRAKED = "braked"  # held, by a brake or by the drive


class DriveUse(NamedTuple):
    """The set-points of a joint's laws (S1), as codes; None where the drive has none for a law.

    Attributes:
        set_points: Those that its drive accepts.
        position, impedance, torque, current, output: The set-point of each law.
        on_silence: Reaction of the motor to missing commands (S5).
    """

    set_points: tuple[str, ...]
    position: str | None
    impedance: str | None
    torque: str | None
    current: str | None
    output: str | None
    on_silence: str

    @property
    def loops(self) -> str:
        """Each set-point with the laws that it carries, in one line: ``pwm: all``."""
        laws = dict(zip(DriveUse._fields[1:-1], self[1:-1], strict=True))
        carried: dict[str, list[str]] = {}
        for law, code in laws.items():
            if code is not None:
                carried.setdefault(str(code), []).append(law)
        return "; ".join(f"{code}: {' '.join(laws)}" for code, laws in carried.items())
