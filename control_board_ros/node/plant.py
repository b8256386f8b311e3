# SPDX-License-Identifier: Apache-2.0
"""What the board drives: the simulation, or the plant that the parameter ``plant`` names."""

from __future__ import annotations

from dataclasses import replace

from ..core.measurement import Plant
from ..sim.plant import SimulatedPlant
from .parameters import Start


def make_plant(start: Start) -> tuple[Start, Plant]:
    """The plant, and the start with settings that ask no more than it has (B2).

    Raises:
        PlantSettingsError: there is no such plant, or it does not fit the board.
        PlantError: the simulation cannot be made.
    """
    settings = start.settings
    if not (name := settings.values["plant"]):
        return start, SimulatedPlant(settings.board, settings.simulation)
    from ..plants.entry_points import make  # for those who have one
    from ..plants.guarded import GuardedPlant
    from ..plants.offers import within

    theirs = make(name, settings.board.names, settings.values["plant_arguments"])
    settings = within(settings, name, theirs.describe())
    timeout = settings.values["plant_timeout"]
    return replace(start, settings=settings), GuardedPlant(theirs, settings.board, timeout)
