# SPDX-License-Identifier: Apache-2.0
"""Assumptions where URDF and parameters give no value, reported at start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

#: Parameters whose absence implies that a whole part of the joint is derived.
PARTS = {"motor.torque_constant": "motors", "position_pid.kp": "gains"}
SHOWN = 6


class Assumed:
    """Collects assumptions, grouped by kind."""

    def __init__(self) -> None:
        self._count = 0
        self._parts: dict[str, list[str]] = {}
        self._warnings: dict[tuple[str, str], list[str]] = {}

    def count(self, joint: str, given: Mapping[str, Any]) -> None:
        """Record the parts of a joint without parameters."""
        self._count += 1
        for key, part in PARTS.items():
            if key not in given:
                self._parts.setdefault(part, []).append(joint)

    def warn(self, joint: str, value: str, what: str, advice: str) -> None:
        """Record a value to report: ``<joint> <value>, ...: <what>; <advice>``."""
        self._warnings.setdefault((what, advice), []).append(f"{joint} {value}")

    @property
    def notes(self) -> tuple[str, ...]:
        """One line about parts derived as a whole; empty where parameters give all."""
        if not self._parts:
            return ()
        parts = ", ".join(
            f"{part} of {'all joints' if len(names) == self._count else _shown(names)}"
            for part, names in self._parts.items()
        )
        return (
            f"derived from the URDF, as no parameters give them: {parts}; friction is the "
            "URDF's <dynamics>, or 1 % of the torque limit; see docs/howto/own_urdf.md",
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """One line per kind of value assumed against, or without, the URDF."""
        return tuple(
            f"{what}: {_shown(joints)}; {advice}"
            for (what, advice), joints in self._warnings.items()
        )


def _shown(names: list[str]) -> str:
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")
