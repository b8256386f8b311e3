# SPDX-License-Identifier: Apache-2.0
"""The command line of ``make motion``."""

from __future__ import annotations

import argparse
import json
import re
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from control_board_ros.core.terms.drives import KINDS, SetPoint

from .measure import Finding, Line, measure, worst
from .page import BEFORE, DRIVEN, DRIVES, FIGURES, PAGE, load, notes_of, page, tables
from .rig import Rig
from .robots import ROBOTS, find, poses
from .rows import ROWS
from .scenes import SCENES, play
from .wire_rows import ROWS as DRIVE_ROWS
from .wire_rows import STALLS, STARVED, WIRES, print_changes, print_wires


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print one table per robot, write what was requested; 0, or 2 for bad usage."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    if asked.tables:
        print(tables(load(FIGURES), load(BEFORE), load(DRIVES)), end="")
        return 0
    if asked.changes:
        print_changes([asked.drive] if asked.drive else DRIVE_ROWS, asked.changes)
        return 0
    if asked.wire:
        return _wires(parser, asked)
    rows = asked.rows.split(",") if asked.rows else list(ROWS)
    if unknown := [row for row in rows if row not in ROWS]:
        parser.error(f"--rows {unknown[0]!r} unknown; choose from {','.join(ROWS)}")
    if asked.page and (
        asked.joint or asked.delay or asked.parameter or (asked.rows and asked.drive)
    ):
        parser.error("--page requires whole robots; leave out --joint, --delay, --rows of drives")
    if asked.page and asked.drive and asked.drive != SetPoint.PWM.code:
        record_drive(asked, rows)
        document(plots=False)
        return 0
    only_draw = asked.plots and not asked.page
    record: dict[str, Any] = load(FIGURES) if asked.page else {}
    path = FIGURES if asked.page else asked.json and Path(asked.json)
    for name in asked.robot or ([] if asked.scenes or only_draw else list(ROBOTS)):
        found = _one(name, rows, asked)
        record[name] = (
            renewed(record[name], found, rows) if asked.rows and name in record else found
        )
        if path:
            save(path, record)
    scenes = asked.scenes or ("all" if asked.page and not asked.robot else "")
    if scenes:
        played = play(list(SCENES) if scenes == "all" else scenes.split(","))
        record["scenes"] = {**record.get("scenes", {}), **played}
        if path:
            save(path, record)
    if asked.page or asked.plots:
        document(plots=asked.plots)
    return 0


def record_drive(asked: argparse.Namespace, rows: Sequence[str]) -> None:
    """Measure the arm of the page with drives of one kind, and keep it beside the others."""
    record = load(DRIVES)
    record[asked.drive] = _one(DRIVEN, rows, asked)
    save(DRIVES, record)


def save(path: Path, record: Mapping[str, object]) -> None:
    """Keep what was measured: one line per list, so one per figure."""
    text = json.dumps(record, indent=1, ensure_ascii=False)
    text = re.sub(r"\[[^\[\]]*\]", lambda found: re.sub(r"\s+", " ", found[0]), text)
    path.write_text(text + "\n", encoding="utf-8")


def document(*, plots: bool) -> None:
    """Write docs/motion.md, and its pictures, from the recorded figures."""
    now, before = load(FIGURES), load(BEFORE)
    PAGE.write_text(page(now, notes_of(PAGE)), encoding="utf-8")
    if plots:
        from .plots import draw  # matplotlib, of the extra dev

        draw(now, before)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="motion", description="How well each joint of a robot moves, on simulated time."
    )
    parser.add_argument(
        "--robot", action="append", help=f"{', '.join(ROBOTS)}, or a URDF's path; repeatable"
    )
    parser.add_argument(
        "--parameter",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="of the robot, such as JOINT.limits.torque=500; repeatable",
    )
    parser.add_argument("--rows", help=f"of {','.join(ROWS)}")
    parser.add_argument("--joint", action="append", help="name or index; repeatable")
    parser.add_argument(
        "--poses", type=int, default=3, metavar="N", help="the first N of home, stretched, random"
    )
    parser.add_argument("--each", action="store_true", help="show every joint's worst figures")
    parser.add_argument(
        "--scenes", nargs="?", const="all", help=f"play scenes: all, or of {','.join(SCENES)}"
    )
    parser.add_argument("--json", metavar="FILE", help="write the figures; with --each, all")
    parser.add_argument(
        "--page", action="store_true", help="measure, record, write docs/motion.md"
    )
    parser.add_argument(
        "--drive",
        choices=[kind.code for kind in KINDS],
        help="of every joint; else pwm (S7); with --page a column of --tables",
    )
    parser.add_argument("--delay", type=float, default=0.0, help="of those drives, s")
    parser.add_argument(
        "--wire",
        nargs="?",
        const="all",
        help="move behind bad wires, by each kind of set-point or by --drive: all, or of "
        + ", ".join((*WIRES, *STALLS, *STARVED)).replace("%", "%%"),
    )
    parser.add_argument(
        "--changes",
        type=int,
        help="likewise, in place of a move: so many changes of mode at random",
    )
    parser.add_argument("--tables", action="store_true", help="print every recorded figure")
    parser.add_argument("--plots", action="store_true", help="draw its pictures from the record")
    return parser


def _wires(parser: argparse.ArgumentParser, asked: argparse.Namespace) -> int:
    """Print the table of wires; exit code."""
    known = [*WIRES, *STALLS, *STARVED]
    wires = known if asked.wire == "all" else asked.wire.split(",")
    if unknown := [wire for wire in wires if wire not in known]:
        parser.error(f"--wire {unknown[0]!r} unknown; choose from {','.join(known)}")
    print_wires([asked.drive] if asked.drive else DRIVE_ROWS, wires)
    return 0


def _one(name: str, rows: Sequence[str], asked: argparse.Namespace) -> dict[str, object]:
    began = time.process_time()
    robot = find(name)
    changes = dict(word.split("=", 1) for word in asked.parameter)
    given = {key: json.loads(value) for key, value in changes.items()}
    robot = replace(robot, parameters={**robot.parameters, **given})
    if asked.drive:
        drive = {"joint_defaults.drive": [asked.drive], "joint_defaults.drive_delay": asked.delay}
        robot = replace(robot, parameters={**robot.parameters, **drive})
        name = f"{name} by {asked.drive}" + (
            f", {1e3 * asked.delay:g} ms late" * bool(asked.delay)
        )
    rig = Rig.load(robot)
    joints = None
    if asked.joint:
        names = rig.board.names
        joints = [int(j) if j.isdigit() else names.index(j) for j in asked.joint]
    chosen = dict(list(poses(robot, rig.home, rig.windows).items())[: asked.poses])
    findings = list(measure(rig, chosen, rows, joints))
    rig.close()
    lines = worst(findings, rig.failures, robot.derived, rows)
    took = time.process_time() - began
    kind = "derived" if robot.derived else "shipped"
    print(f"\n{name} ({kind}); poses: {', '.join(chosen)}; {took:.0f} s of processor time")
    for line in lines:
        print("  " + shown(line))
    if asked.each:
        _print_each(findings, rig.board.names)
    for failure in rig.failures if asked.each else rig.failures[:6]:
        print(f"  failed: {failure.row} ({failure.where}): {failure.text}")
    if not asked.each and len(rig.failures) > 6:
        print(f"  and {len(rig.failures) - 6} more; --each shows them")
    sys.stdout.flush()
    return kept(lines, findings if asked.each else (), rig)


def kept(lines: Sequence[Line], findings: Sequence[Finding], rig: Rig) -> dict[str, object]:
    """What goes into a file: the worst of each quantity, the failures, and what is requested."""
    figures = {
        f"{line.row.key}.{line.quantity.key}": [
            line.worst.value,
            line.worst.joint,
            line.worst.pose,
        ]
        for line in lines
        if line.worst is not None
    }
    record: dict[str, object] = {
        "derived": rig.derived,
        "figures": figures,
        "failures": Counter(failure.row for failure in rig.failures),
        "causes": Counter(failure.cause for failure in rig.failures),
    }
    if findings:
        record["findings"] = [
            [f.row, f.quantity, f.joint, f.pose, rounded(f.value)] for f in findings
        ]
    return record


def renewed(
    before: Mapping[str, Any], found: Mapping[str, Any], rows: Sequence[str]
) -> dict[str, Any]:
    """A robot's record with some rows measured anew; causes of failures are those of all."""
    figures = {key: one for key, one in before["figures"].items() if key.split(".")[0] not in rows}
    failures = {row: count for row, count in before["failures"].items() if row not in rows}
    return {
        **before,
        "figures": figures | found["figures"],
        "failures": failures | found["failures"],
        "causes": dict(Counter(before["causes"]) + Counter(found["causes"])),
    }


def rounded(value: float) -> float:
    """Four significant digits: the others carry no information, and differ between processors."""
    return float(f"{value:.4g}")


def shown(line: Line) -> str:
    """A line of a table as text."""
    text = f"{line.quantity.text:42}"
    failed = f"{line.failures} failed " if line.failures else ""
    if line.worst is None:
        return f"{text} {'–':>9}      {failed}"
    verdict = {True: "reached", False: "NOT REACHED", None: ""}[line.reached]
    goal = f"≤ {line.reach:g}" if line.reach else ""
    value = f"{line.worst.value:9.3g} {line.quantity.unit:4}"
    return f"{text} {value} {goal:7} {verdict:12} {failed}{line.worst.joint}, {line.worst.pose}"


def _print_each(findings: Sequence[Finding], names: Sequence[str]) -> None:
    """The worst of each quantity of each joint, over the poses; a column per joint."""
    for row, quantity in dict.fromkeys((f.row, f.quantity) for f in findings):
        worst_of: dict[str, float] = {}
        for f in findings:
            if (f.row, f.quantity) != (row, quantity):
                continue
            if abs(f.value) >= abs(worst_of.get(f.joint, 0.0)):
                worst_of[f.joint] = f.value
        cells = (f"{worst_of[n]:9.3g}" if n in worst_of else f"{'–':>9}" for n in names)
        print(f"    {row + '.' + quantity:24} {' '.join(cells)}")
