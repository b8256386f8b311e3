# SPDX-License-Identifier: Apache-2.0
"""Errors of the simulated plant, one line each."""

from __future__ import annotations


class PlantError(RuntimeError):
    """The plant cannot be created or used as requested; includes the next step."""


class PlantGone(PlantError):  # noqa: N818 - a state of the world, not a mistake
    """The physics server is gone: its window was closed or the connection lost."""
