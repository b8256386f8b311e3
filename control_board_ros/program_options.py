# SPDX-License-Identifier: Apache-2.0
"""Options of ``cbctl tune``, ``identify`` and ``conformance``, shared with these programs.

The programs load the simulation or rclpy; this module, for the help of cbctl, does not.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

Option = tuple[tuple[str, ...], dict[str, Any]]


def option(*names: str, **settings: Any) -> Option:
    return names, settings


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


TUNING: tuple[Option, ...] = (
    option(
        "robot", metavar="ROBOT.yaml", help="A parameter file, or a shipped one: iiwa, panda, …"
    ),
    option(
        "-o", "--output", required=True, metavar="FILE.yaml", help="The parameter file to write."
    ),
    option(
        "--from",
        dest="identification",
        metavar="FOUND.yaml",
        help="Result of cbctl identify: a parameter file on top of the robot's own.",
    ),
    option("--joints", metavar="A,B", help="Only these joints, separated by commas."),
    option(
        "--trials", type=int, default=40, metavar="N", help="For each joint and controller; 40."
    ),
    option(
        "--payload",
        metavar="KG",
        help="Largest payload at the last link; default: a tenth of the torque limits.",
    ),
    option("--jobs", type=int, metavar="N", help="Processes; default: one per core."),
    option("--seed", type=int, default=1, metavar="N", help="Of the search; 1."),
    option(
        "--storage",
        metavar="URL",
        help="A database shared by several machines; default: FILE.journal beside it.",
    ),
)
IDENTIFICATION: tuple[Option, ...] = (
    option(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE.yaml",
        help="The file to write.",
    ),
    option("--no-payload", action="store_true", help="No payload beyond the URDF."),
    option("--robot", help="The robot of a table or bag: a name, parameter file or URDF."),
    option("--columns", type=Path, metavar="FILE.yaml", help="The columns of a table or bag."),
    option(
        "--column",
        action="append",
        default=[],
        metavar="SIGNAL=COLUMNS:UNIT",
        help="Those of a signal, e.g. position=q{0}:rad.",
    ),
    option(
        "--alarms",
        type=float,
        metavar="RATE",
        help="Find thresholds of contacts, too, with this many false alarms an hour.",
    ),
)
CONFORMANCE: tuple[Option, ...] = (
    option(
        "--joint",
        metavar="JOINT",
        help="the joint to move; default: the last of those with the most modes",
    ),
    option(
        "--range", type=fraction, default=0.1, metavar="R", help="part of the limits, e.g. 0.1"
    ),
    option("--rules", metavar="M4,P1,…", help="only these rules"),
    option(
        "--rule-time",
        type=seconds,
        default=60.0,
        metavar="S",
        help="time limit of a rule, s; three rules beyond it end the run",
    ),
    option("--yes", action="store_true", help="move without confirmation"),
    option("--calibrate", action="store_true", help="also calibrate the joint, out of the range"),
    option("--power-cycle", action="store_true", help="also disable all joints (N)"),
    option("--junit", type=Path, metavar="FILE", help="write a JUnit report"),
    option("--list", action="store_true", help="list the rules, and end"),
)
