# SPDX-License-Identifier: Apache-2.0
"""What may be chosen of a run, for ``control_board_conformance`` and ``cbctl conformance``.

It stands outside of ``conformance``, which loads rclpy: the help of cbctl needs none.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def fraction(text: str) -> float:
    """A number above 0, up to 1."""
    value = float(text)
    if not 0.0 < value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not valid; give a number above 0, up to 1")
    return value


def seconds(text: str) -> float:
    """A time above 0, up to an hour."""
    value = float(text)
    if not 0.0 < value <= 3600.0:
        raise argparse.ArgumentTypeError(f"{text} is not valid; give seconds above 0, up to 3600")
    return value


#: Names and settings, as ``ArgumentParser.add_argument`` takes them.
OPTIONS: tuple[tuple[str, dict[str, Any]], ...] = (
    (
        "--joint",
        {
            "metavar": "JOINT",
            "help": "the joint to move; else the last of those that implement the most",
        },
    ),
    (
        "--range",
        {"type": fraction, "default": 0.1, "metavar": "R", "help": "part of the limits, e.g. 0.1"},
    ),
    ("--rules", {"metavar": "M4,P1,…", "help": "only these"}),
    (
        "--rule-time",
        {
            "type": seconds,
            "default": 60.0,
            "metavar": "S",
            "help": "how long a rule may take, in s; three that take longer end the run",
        },
    ),
    ("--yes", {"action": "store_true", "help": "move without asking"}),
    (
        "--calibrate",
        {"action": "store_true", "help": "also calibrate the joint, out of the range"},
    ),
    (
        "--power-cycle",
        {"action": "store_true", "help": "also take the power from all joints (N)"},
    ),
    ("--junit", {"type": Path, "metavar": "FILE", "help": "write a JUnit report"}),
    ("--list", {"action": "store_true", "help": "list the rules, and leave"}),
)
