# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulated plant, each one line for people."""

from __future__ import annotations


class PlantError(RuntimeError):
    """The plant cannot be made or used as asked; says what to do."""


class PlantGone(PlantError):  # noqa: N818 - a state of the world, not a mistake
    """The physics server is gone: its window was closed or the connection was cut."""
