# SPDX-License-Identifier: Apache-2.0
"""The externally visible rules of a control board, tested on any board over ROS.

A rule is a function that tests a :class:`Bench` and returns its evidence, or raises
NotHeld or NotTestable::

    @rule("M10", "IDLE is unpowered")
    def idle_is_unpowered(bench: Bench) -> str:
        bench.enter(M.IDLE)
        outputs = [state.output[bench.j] for state in bench.record(0.2)]
        expect(not any(outputs), f"{max(outputs, key=abs):.3g} % in IDLE")
        return f"0 % in {len(outputs)} states"

Independent of the board's implementation: rules use the client, and messages that no client would
send. Each group of the specification has a file; ``runner`` runs the rules and restores the
joints, ``report`` reports the results, ``app`` is the command line.
"""

from . import (
    faults,
    interaction,
    interfaces,
    modes,
    motion,
    recovery,
    references,
    start_up,
    wire,
    yarp4,
)
from .bench import Bench
from .report import as_json, as_junit, as_line, as_text
from .rules import RULES, NotHeld, NotTestable, Rule, rule
from .runner import Outcome, Result, run

__all__ = [
    "RULES",
    "Bench",
    "NotHeld",
    "NotTestable",
    "Outcome",
    "Result",
    "Rule",
    "as_json",
    "as_junit",
    "as_line",
    "as_text",
    "faults",
    "interaction",
    "interfaces",
    "modes",
    "motion",
    "recovery",
    "references",
    "rule",
    "run",
    "start_up",
    "wire",
    "yarp4",
]
