# SPDX-License-Identifier: Apache-2.0
"""What may be chosen of a search for gains, for ``cbctl tune`` and ``python -m …tuning``.

It stands outside of ``tuning``, which loads the simulation: the help of cbctl needs none.
"""

from __future__ import annotations

from typing import Any

#: Names and settings, as ``ArgumentParser.add_argument`` takes them.
OPTIONS: tuple[tuple[tuple[str, ...], dict[str, Any]], ...] = (
    (
        ("robot",),
        {"metavar": "ROBOT.yaml", "help": "A parameter file, or a shipped one: iiwa, panda, …"},
    ),
    (
        ("-o", "--output"),
        {"required": True, "metavar": "FILE.yaml", "help": "The parameter file to write."},
    ),
    (
        ("--from",),
        {
            "dest": "found",
            "metavar": "FOUND.yaml",
            "help": "What cbctl identify found of the robot: a parameter file on top of its own.",
        },
    ),
    (("--joints",), {"metavar": "A,B", "help": "Only these joints, separated by commas."}),
    (
        ("--trials",),
        {"type": int, "default": 40, "metavar": "N", "help": "For each joint and controller; 40."},
    ),
    (
        ("--payload",),
        {
            "metavar": "KG",
            "help": "The heaviest thing at the last link; else what takes a tenth of the torques.",
        },
    ),
    (("--jobs",), {"type": int, "metavar": "N", "help": "Processes; else one per core."}),
    (("--seed",), {"type": int, "default": 1, "metavar": "N", "help": "Of the search; 1."}),
    (
        ("--storage",),
        {
            "metavar": "URL",
            "help": "A database that several machines search with; else FILE.journal beside it.",
        },
    ),
)
