# SPDX-License-Identifier: Apache-2.0
"""The rules of the specification, and how a test says which of them it proves."""

from __future__ import annotations

import re
from pathlib import Path

import control_board_ros.conformance  # noqa: F401  (each of its modules registers its rules)
from control_board_ros.conformance.rules import in_order

#: Every rule of the specification and what it is about, in its order.
RULES = {rule.name: rule.title for rule in in_order()}

_HERE = Path(__file__).resolve().parent.parent
#: Where tests of rules are: through a board; of codes, which need none.
TESTS = (_HERE / "spec", _HERE / "core" / "test_vocabs.py")

#: Sections of the specification whose rules are no rules of the suite.
_BEYOND = "RTBSEG"
_NAME = r"(?:[A-Z]\d+|A|R)"
_PROVES = re.compile(rf"^({_NAME}(?:, {_NAME})*): ")


def proved_by(docstring: str | None) -> list[str]:
    """The rules of the suite that a test names: its docstring begins with them.

    As in ``M4, P13: …``, or ``E1, F3: …``, where E1 is left out.

    Raises:
        ValueError: there is no such rule.
    """
    found = _PROVES.match((docstring or "").strip())
    rules = [rule for rule in (found[1].split(", ") if found else []) if rule[0] not in _BEYOND]
    for rule in rules:
        if rule not in RULES:
            raise ValueError(f"rule {rule} unknown; rules: {', '.join(RULES)}")
    return rules
