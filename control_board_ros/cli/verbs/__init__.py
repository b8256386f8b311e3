# SPDX-License-Identifier: Apache-2.0
"""The verbs of cbctl: a module per section of the help, loaded when one of its verbs is run.

A verb is a function of a session and of the arguments declared by ``with_arguments``. It prints,
and returns the exit code (None: 0). The values that it prints come from functions of ``cli``.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from ..line.words import Refused

#: Section -> verb -> its module.
SECTIONS = {
    "Look": {
        "modes": "look",
        "watch": "watch",
        "plot": "plot",
        "panel": "servers",
        "foxglove": "servers",
        "info": "look",
        "references": "look",
        "faults": "look",
        "poses": "poses",
    },
    "Modes": dict.fromkeys(("mode", "interaction", "impedance", "brake"), "modes")
    | dict.fromkeys(("clear", "recover", "estop"), "recovery"),
    "Motion": {
        "move": "motion",
        "pose": "poses",
        "home": "poses",
        "park": "poses",
        "jog": "motion",
        "direct": "motion",
        "velocity": "streams",
        "veldirect": "streams",
        "torque": "streams",
        "current": "streams",
        "output": "streams",
        "stop": "motion",
        "speed": "motion",
        "feedforward": "streams",
        "guide": "guiding",
        "replay": "guiding",
    },
    "Measure": {
        "record": "recording",
        "report": "recording",
        "step": "responses",
        "chirp": "responses",
        "identify": "identifying",
        "tune": "tuning",
    },
    "Board": {
        "calibrate": "board",
        "configure": "board",
        "power-cycle": "board",
        "param": "param",
        "conformance": "conformance",
        "drives": "drives",
    },
    "Simulation": dict.fromkeys(("pause", "resume", "advance", "reset", "inject"), "simulation"),
    "Terminal": dict.fromkeys(("shell", "completion"), "terminal"),
}
VERBS = {name: module for verbs in SECTIONS.values() for name, module in verbs.items()}
#: Words that are none, and what is meant: nearer by its letters would be another verb.
MEANT = {"release": "estop release", "emergency_stop": "estop", "force_idle": "clear"}

#: Entry points by which packages add verbs: ``NAME = module:function``.
GROUP = "control_board_ros.verbs"


def find(name: str) -> Callable[..., Any] | None:
    """A verb of cbctl, else of an installed package; None: there is none.

    Raises:
        Refused: that of a package cannot be imported.
    """
    if name in VERBS:
        return load(name)
    from ...extensions import offered

    verb: Callable[..., Any] | None = offered(GROUP, name, "verb", Refused)
    return verb


def load(name: str) -> Callable[..., Any]:
    module = import_module(f"{__name__}.{VERBS[name]}")
    verb: Callable[..., Any] = getattr(module, name.replace("-", "_"))
    return verb
