# SPDX-License-Identifier: Apache-2.0
"""The rules of a control board that can be seen from outside, tried on any board over ROS.

A rule is a function that tries something on a :class:`Bench` and returns its evidence, or raises
NotHeld or NotTestable::

    @rule("M10", "IDLE is unpowered")
    def idle_is_unpowered(bench: Bench) -> str:
        bench.enter(M.IDLE)
        outputs = [state.output[bench.j] for state in bench.record(0.2)]
        expect(not any(outputs), f"{max(outputs, key=abs):.3g} % in IDLE")
        return f"0 % in {len(outputs)} states"

Nothing here knows how the board is made: it uses the client, and messages for what no client
would send. The rules stand in a file per group of the specification; ``runner`` runs them and
leaves the joints as found, ``report`` tells how they went, ``app`` is the command line.
"""

from . import (
    brakes,
    calibration,
    faults,
    interaction,
    interfaces,
    modes,
    motion,
    power,
    references,
    wire,
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
    "brakes",
    "calibration",
    "faults",
    "interaction",
    "interfaces",
    "modes",
    "motion",
    "power",
    "references",
    "rule",
    "run",
    "wire",
]
