# SPDX-License-Identifier: Apache-2.0
"""The rules of the specification, and how a test says which of them it proves."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import control_board_ros.conformance  # noqa: F401  (each of its modules registers its rules)
from control_board_ros.conformance.rules import in_order

#: Rules of this project, beyond the source: ``control_board_conformance`` does not have them.
BEYOND = {
    "R1": "a part of a robot is a board",
    "R2": "all parts in one process, on one clock and one physics",
    "R3": "a request to the robot is whole over its parts",
    "R4": "start-up levels",
    "R5": "poses",
    "R6": "parking at the end",
    "T1": "trajectories as ros2_controllers has them",
    "T2": "trajectories are followed in POSITION_DIRECT",
    "T3": "nothing of a trajectory is kept after its end",
    "T4": "continuous joints go to the nearest turn",
    "T5": "goals of the future preempt each other on the path",
    "B1": "the same rules whatever moves the joints",
    "B2": "no more is offered than the plant has",
    "B3": "a silent plant is a hardware fault",
    "B4": "only a simulation has its time and faults changed",
    "B5": "a silent control loop leaves the motors without power",
    "B6": "time is measured",
    "B7": "readings have an age",
    "B8": "threads are watched",
    "S1": "set-points of the drives, and which loop runs where",
    "S2": "the board makes and bounds the references",
    "S3": "a mode change is one exchange with the drive",
    "S4": "of the limits of board and drive the smaller act",
    "S5": "the drives' own watchdogs",
    "S6": "faults of drives",
    "S7": "the simulated arm as a drive",
    "S8": "a drive is what it reports",
    "S9": "a drive that lost its turns is corrected, or not believed",
    "S10": "one drive costs the others nothing",
    "S11": "what a bus kept never acts later",
    "E1": "recovery",
    "E2": "emergency stop",
    "E3": "freeze frames",
    "G1": "gravity compensation",
    "G2": "guided poses and trajectories are recorded and replayed",
    "G3": "identification",
    "X1": "torque from outside is shown",
    "X2": "reactions to contacts",
}
#: Every rule of the specification and what it is about.
RULES = {rule.name: rule.title for rule in in_order()} | BEYOND

#: All tests; those through a board; those of codes, which need none.
ALL = Path(__file__).resolve().parent.parent
TESTS = (ALL / "spec", ALL / "core" / "test_vocabs.py")

_NAME = r"(?:[A-Z]\d+|A)"
_PROVES = re.compile(rf"^({_NAME}(?:, {_NAME})*): ")


def proved_by(docstring: str | None) -> list[str]:
    """The rules that a test names: its docstring begins with them, as in ``M4, P13: …``.

    Raises:
        ValueError: there is no such rule.
    """
    found = _PROVES.match((docstring or "").strip())
    rules = found[1].split(", ") if found else []
    for rule in rules:
        if rule not in RULES:
            raise ValueError(f"rule {rule} unknown; rules: {', '.join(RULES)}")
    return rules


def counts(path: Path, rules: list[str]) -> bool:
    """A test of the conformance table: one of ``TESTS``, or of a rule beyond the source."""
    of_the_suite = any(path.is_relative_to(place) for place in TESTS)
    return of_the_suite or not BEYOND.keys().isdisjoint(rules)


@cache
def proofs() -> dict[str, list[str]]:
    """The tests of the conformance table, as pytest names them, and the rules that each proves."""
    found = {}
    for path in sorted(ALL.rglob("test_*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            within = f"{node.name}::" if isinstance(node, ast.ClassDef) else ""
            for one in node.body if isinstance(node, ast.ClassDef) else [node]:
                if isinstance(one, ast.FunctionDef) and one.name.startswith("test_"):
                    rules = proved_by(ast.get_docstring(one))
                    if rules and counts(path, rules):
                        found[f"{path.relative_to(ALL.parent)}::{within}{one.name}"] = rules
    return found
