# SPDX-License-Identifier: Apache-2.0
"""The verbs of cbctl, a file each."""

from __future__ import annotations

import typer

from ..helping import Verb, reflowed
from .calibrate import calibrate
from .clear import clear
from .completion import completion
from .configure import configure, power_cycle
from .direct import direct
from .faults import faults
from .feedforward import feedforward
from .impedance import impedance
from .info import info
from .inject import inject
from .interaction import interaction
from .jog import jog
from .mode import mode
from .modes import modes
from .move import move
from .output import output
from .param import param
from .references import references
from .shell import shell
from .simulation import pause, reset, resume, step
from .speed import speed
from .stop import stop
from .torque import torque
from .velocity import velocity
from .watch import watch

SECTIONS = {
    "Look": (modes, watch, info, references, faults),
    "Modes": (mode, interaction, impedance, clear),
    "Motion": (move, jog, direct, velocity, torque, output, stop, speed, feedforward),
    "Board": (calibrate, configure, power_cycle, param),
    "Simulation": (pause, resume, step, reset, inject),
    "Terminal": (shell, completion),
}


def register(app: typer.Typer) -> None:
    """Add every verb to the application."""
    for section, verbs in SECTIONS.items():
        for verb in verbs:
            name = verb.__name__.replace("_", "-")
            text = reflowed(verb.__doc__)
            app.command(name, cls=Verb, help=text, rich_help_panel=section)(verb)
