# SPDX-License-Identifier: Apache-2.0
"""Faults of drives by number and name (S6): codes, words of flags, and those without a number."""

from __future__ import annotations

from collections.abc import Mapping

from ..interface import DriveFault

#: Watchdog and restart of a drive that has no fault number of its own for them.
WATCHDOG = DriveFault(0, "watchdog: no command within its timeout")
RESTARTED = DriveFault(0, "drive restarted")
#: Number of what a drive does not report, although it was told to (S8).
UNCONFIRMED = 0
UNNAMED = "see its manual"


def coded(number: int, names: Mapping[int, str]) -> DriveFault:
    return DriveFault(number, names.get(number, UNNAMED))


def flagged(word: int, names: Mapping[int, str]) -> DriveFault | None:
    """The faults of a word, by their bits; None: no bit is set."""
    texts = ", ".join(name for bit, name in names.items() if word & bit)
    return DriveFault(word, texts or UNNAMED) if word else None
