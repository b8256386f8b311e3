# SPDX-License-Identifier: Apache-2.0
"""The command line of ``make motion``."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from .measure import Finding, Line, measure, worst
from .rig import Rig
from .robots import ROBOTS, find, poses
from .rows import ROWS


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print one table per robot, write what was asked for; 0, or 2 for bad usage."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    rows = asked.rows.split(",") if asked.rows else list(ROWS)
    if unknown := [row for row in rows if row not in ROWS]:
        parser.error(f"--rows {unknown[0]!r} unknown; choose from {','.join(ROWS)}")
    record = {}
    for name in asked.robot or list(ROBOTS):
        record[name] = _one(name, rows, asked)
    if asked.json:
        text = json.dumps(record, indent=1, ensure_ascii=False)
        Path(asked.json).write_text(text + "\n", encoding="utf-8")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="motion", description="How well each joint of a robot moves, on simulated time."
    )
    parser.add_argument(
        "--robot", action="append", help=f"{', '.join(ROBOTS)}, or a URDF's path; repeatable"
    )
    parser.add_argument("--rows", help=f"of {','.join(ROWS)}")
    parser.add_argument("--joint", action="append", help="name or index; repeatable")
    parser.add_argument("--poses", type=int, default=3, help="home, stretched, random (3)")
    parser.add_argument("--each", action="store_true", help="show every joint's worst figures")
    parser.add_argument("--json", metavar="FILE", help="write every figure")
    return parser


def _one(name: str, rows: Sequence[str], asked: argparse.Namespace) -> dict[str, object]:
    began = time.perf_counter()
    robot = find(name)
    rig = Rig.load(robot)
    joints = None
    if asked.joint:
        names = rig.board.names
        joints = [int(j) if j.isdigit() else names.index(j) for j in asked.joint]
    chosen = dict(list(poses(robot, rig.home, rig.windows).items())[: asked.poses])
    findings = list(measure(rig, chosen, rows, joints))
    rig.close()
    lines = worst(findings, robot.derived, rows)
    took = time.perf_counter() - began
    kind = "derived" if robot.derived else "shipped"
    print(f"\n{name} ({kind}), {len(chosen)} poses: {', '.join(chosen)}; took {took:.0f} s")
    for line in lines:
        print("  " + shown(line))
    if asked.each:
        _print_each(findings)
    for failure in rig.failures:
        print(f"  FAULT  {failure}")
    sys.stdout.flush()
    return {
        "derived": robot.derived,
        "failures": rig.failures,
        "findings": [[f.row, f.quantity, f.joint, f.pose, f.value] for f in findings],
    }


def shown(line: Line) -> str:
    """A line of a table as text."""
    text = f"{line.quantity.text:42}"
    if line.worst is None:
        return f"{text} {'–':>9}"
    verdict = {True: "reached", False: "NOT REACHED", None: ""}[line.reached]
    goal = f"≤ {line.reach:g}" if line.reach else ""
    value = f"{line.worst.value:9.3g} {line.quantity.unit:4}"
    return f"{text} {value} {goal:7} {verdict:12} {line.worst.joint}, {line.worst.pose}"


def _print_each(findings: Sequence[Finding]) -> None:
    for row, quantity in dict.fromkeys((f.row, f.quantity) for f in findings):
        mine = [f for f in findings if (f.row, f.quantity) == (row, quantity)]
        worst_of = {}
        for f in mine:
            if abs(f.value) >= abs(worst_of.get(f.joint, 0.0)):
                worst_of[f.joint] = f.value
        values = " ".join(f"{value:9.3g}" for value in worst_of.values())
        print(f"    {row + '.' + quantity:24} {values}")
