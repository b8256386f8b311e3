# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulated plant, each one line for people."""

from __future__ import annotations


class PlantError(RuntimeError):
    """The plant cannot be made or used as asked; says what to do."""


class PlantGone(PlantError):  # noqa: N818 - a state of the world, not a mistake
    """The physics server is gone: its window was closed or the connection was cut."""


class OneLineError(ValueError):
    """Says in one line what is wrong, whatever characters a path or a file brought in."""

    def __init__(self, text: str) -> None:
        shown = (c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
        super().__init__("".join(shown))
