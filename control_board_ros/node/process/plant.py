# SPDX-License-Identifier: Apache-2.0
"""What the board drives: the simulation, or the plant that the parameter ``plant`` names."""

from __future__ import annotations

from dataclasses import replace

from ...core.terms.measurement import Plant
from ...plants.errors import PlantSettingsError
from ...sim.plant import SimulatedPlant
from ..wiring.parameters import Start


def make_plant(start: Start) -> tuple[Start, Plant]:
    """The plant, and the start with settings that ask no more than it has (B2).

    Raises:
        PlantSettingsError: there is no such plant, or it does not fit the board.
        PlantError: the simulation cannot be made.
    """
    settings = start.settings
    if not (name := settings.values["plant"]):
        return start, SimulatedPlant(settings.board, settings.simulation)
    from ...plants.apart import PlantApart  # for those who have one
    from ...plants.entry_points import make
    from ...plants.guarded import GuardedPlant, patience
    from ...plants.interface import DrivePlant, RobotPlant
    from ...plants.offers import within

    joints, arguments = settings.board.names, settings.values["plant_arguments"]
    timeout = settings.values["plant_timeout"]
    theirs: RobotPlant | DrivePlant
    if name.startswith("virtual/"):
        from ...plants.virtual.plant import make_virtual  # with the libraries of its driver

        theirs = make_virtual(name, settings, arguments)
    elif settings.values["plant_process"]:
        theirs = PlantApart(name, joints, arguments, patience(timeout, settings.board.period))
    else:
        theirs = make(name, joints, arguments)
    try:
        settings = within(settings, name, theirs.describe())
    except PlantSettingsError:
        theirs.close()
        raise
    return replace(start, settings=settings), GuardedPlant(theirs, settings.board, timeout)
