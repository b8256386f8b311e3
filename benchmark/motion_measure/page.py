# SPDX-License-Identifier: Apache-2.0
"""docs/motion.md and the tables behind it, from recorded figures and docstrings of rows."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from functools import partial
from operator import ne
from pathlib import Path
from typing import Any

from report import table

from control_board_ros.core.terms.drives import KINDS

from .robots import ROBOTS
from .rows import ROWS, Quantity, Row
from .scenes import SCENES

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "motion.md"
FIGURES = ROOT / "benchmark" / "motion.json"
BEFORE = ROOT / "benchmark" / "motion_before.json"
#: The arm on drives of each kind, and its figures by kind.
DRIVEN, DRIVES = "iiwa", ROOT / "benchmark" / "motion_drives.json"
#: A row that some robots miss: what it is, its goal, and the figures of these robots.
Missed = tuple[str, str, list[str]]
#: Marks a figure of a row of which some tests ended in a fault.
FAULT = " †"
FAILED = "†: some tests of the row ended in a fault."
#: The text between these is written by hand, and kept.
NOTES, END = "<!-- notes -->\n", "<!-- end of notes -->\n"

HEAD = """\
# The measure of motion

How well each joint moves. `make motion` measures every shipped robot and URDFs from elsewhere,
whose parameters are derived, each joint alone and all at once, and writes this page;
`make motion ARGS="--robot panda --rows step,sine --each"` prints a part of it, and
`make motion ARGS=--tables` every recorded figure with its definition, which the site shows as
*All figures of motion*. A test in `test/motion/` bounds the worst.

Board and plant run in one process on simulated time, so the same commit gives the same figures on
every machine. Each is the worst over all joints and over the poses home, stretched and random;
derived robots have two of them. Prismatic joints: mm in place of mrad.

![Each figure over its goal](images/motion_reach.png)

"""

TABLES_HEAD = """\
# All figures of motion

The tables behind *The measure of motion*, from `benchmark/motion.json`. Random poses lie in the
middle half of each range, from a fixed seed. "Before" is the board before its laws were rewritten
(`benchmark/motion_before.json`). `make motion ARGS="--page --robot panda"` measures one robot
anew, with `--rows` some of its rows.

"""


def load(path: Path) -> dict[str, Any]:
    """Recorded figures; none where there is no file."""
    return json.loads(path.read_text("utf-8")) if path.is_file() else {}


def page(now: Mapping[str, Any], notes: str) -> str:
    """The page of one screen; ``notes`` is its hand-written part."""
    robots = [name for name in ROBOTS if name in now]
    count, missed = _missed(now, robots)
    counts = f"{count - sum(len(cells) for _, _, cells in missed)} of {count} figures are reached"
    rows = [[text, goal, ", ".join(cells)] for text, goal, cells in merged(missed)]
    parts = [
        HEAD,
        f"## What is not reached\n\n{counts}, on {len(robots)} robots. The others:\n\n",
        table([["worst joint", "reach, shipped / derived", "robots"], *rows]),
        f"\n\n{FAILED}\n\n## Where physics forbids a figure\n\n",
        NOTES,
        notes,
        END,
    ]
    return "".join(parts)


def merged(missed: list[Missed]) -> list[Missed]:
    """Rows that differ in one word and in the figures of the same robots, in one row."""
    groups: list[list[Missed]] = []
    for row in missed:
        if groups and _differ_in_one_word(groups[-1][-1], row):
            groups[-1].append(row)
        else:
            groups.append([row])
    return [_joined(group) for group in groups]


def _differ_in_one_word(row: Missed, next_row: Missed) -> bool:
    words, next_words = row[0].split(), next_row[0].split()
    robots, next_robots = ([cell.rpartition(" ")[0] for cell in r[2]] for r in (row, next_row))
    alike = len(words) == len(next_words) and row[1] == next_row[1] and robots == next_robots
    return alike and sum(map(ne, words, next_words)) == 1


def _joined(group: list[Missed]) -> Missed:
    words = zip(*(text.split() for text, _, _ in group), strict=True)
    text = " ".join(", ".join(dict.fromkeys(each)) for each in words)
    cells = []
    for each in zip(*(cells for _, _, cells in group), strict=True):
        figures = list(dict.fromkeys(cell.rpartition(" ")[2] for cell in each))
        ends = [min(figures, key=float), max(figures, key=float)] if len(figures) > 1 else figures
        cells.append(f"{each[0].rpartition(' ')[0]} {' … '.join(ends)}")
    return text, group[0][1], cells


def tables(now: Mapping[str, Any], before: Mapping[str, Any], drives: Mapping[str, Any]) -> str:
    """Every recorded figure, with its definition; ``drives`` has a record by kind."""
    robots = [name for name in ROBOTS if name in now]
    parts = [TABLES_HEAD, "## All robots\n\n", _overview(now, robots)]
    for name in robots:
        kind = "derived" if now[name]["derived"] else "shipped"
        parts += [f"\n## {name} ({kind})\n\n", _table(now[name], before.get(name, {}))]
    parts += [
        "\n## Scenes\n\nFormer defects, each on one robot; `--scenes` plays them.\n\n",
        _scenes(now.get("scenes", {}), before.get("scenes", {})),
        *_drives({**drives, "pwm": now[DRIVEN]} if drives and DRIVEN in now else {}),
        "\n## Pictures\n\n"
        "![Direct step of 50 mrad](../images/motion_step.png)\n\n"
        "![Sine, move and velocity](../images/motion_follow.png)\n\n"
        "![Release and push](../images/motion_push.png)\n",
        "\n## Definitions\n\n",
        *(_definition(row) for row in ROWS.values()),
    ]
    return "".join(parts).rstrip() + "\n"


def notes_of(path: Path) -> str:
    """The hand-written part of a page that exists; empty where there is none."""
    text = path.read_text("utf-8") if path.is_file() else ""
    return text.partition(NOTES)[2].partition(END)[0]


BY_DRIVES = """
## Drives that close loops of their own

The iiwa with a drive of each kind at every joint (S1 and S7 of the specification), in the
same rows: `make motion ARGS="--drive impedance"` prints a table, `--page` writes its column anew.
Without `--delay` a set-point acts in the cycle after it was sent. A dash: that row of S1 does not
carry the law, so the joint does not implement the mode. Where a drive accepts only positions or
velocities, no torque reaches it, and there is neither TORQUE nor COMPLIANT. Bold: not reached.

"""


def _drives(records: Mapping[str, Any]) -> list[str]:
    """The table of one arm on drives of each kind."""
    kinds = [kind.code for kind in reversed(KINDS) if kind.code in records]
    rows = []
    for row, quantity in _quantities():
        cells = []
        for kind in kinds:
            record = records[kind]
            found = record["figures"].get(_key(row, quantity))
            text = "–" if found is None else number(found[0])
            missed = found is not None and not _reached(record, row, quantity)
            cells.append(f"**{text}**" if missed and quantity.shipped else text)
        goal = f"≤ {quantity.shipped:g} {quantity.unit}" if quantity.shipped else ""
        rows.append([quantity.text, goal, *cells])
    return [BY_DRIVES, table([["worst joint", "reach", *kinds], *rows]), "\n"] if kinds else []


def _quantities() -> list[tuple[Row, Quantity]]:
    return [(row, quantity) for row in ROWS.values() for quantity in row.quantities]


def _overview(now: Mapping[str, Any], robots: list[str]) -> str:
    rows = []
    for row, quantity in _quantities():
        reach = f"{quantity.shipped:g} / {quantity.derived:g} {quantity.unit}"
        cells = []
        for name in robots:
            record = now[name]
            value = record["figures"].get(_key(row, quantity))
            missed = value is None or not _reached(record, row, quantity)
            text = "–" if value is None else number(value[0])
            text += FAULT * bool(_faults(record, row))
            cells.append(f"**{text}**" if missed and value and quantity.shipped else text)
        goal = f"≤ {reach}" if quantity.shipped else ""
        rows.append([quantity.text, goal, *cells])
    text = table([["worst joint", "reach, shipped / derived", *robots], *rows])
    return f"{text}\n\nBold: not reached. {FAILED}\n"


def _missed(now: Mapping[str, Any], robots: list[str]) -> tuple[int, list[Missed]]:
    """How many figures have a goal; and of each quantity that misses it: the robots that do."""
    count = 0
    missed = []
    for row, quantity in _quantities():
        if not quantity.shipped:
            continue
        cells = []
        for name in robots:
            record = now[name]
            value = record["figures"].get(_key(row, quantity))
            count += value is not None
            if value is not None and not _reached(record, row, quantity):
                cells.append(f"{name} {number(value[0])}{FAULT * bool(_faults(record, row))}")
        if cells:
            goal = f"≤ {quantity.shipped:g} / {quantity.derived:g} {quantity.unit}"
            missed.append((quantity.text, goal, cells))
    return count, missed


def _faults(record: Mapping[str, Any], row: Row) -> int:
    """How many tests of a row ended in a fault."""
    return int(record["failures"].get(row.key, 0))


def _table(now: Mapping[str, Any], before: Mapping[str, Any]) -> str:
    rows = []
    for row, quantity in _quantities():
        key, goal = _key(row, quantity), quantity.reach(now["derived"])
        found, was = now["figures"].get(key), before.get("figures", {}).get(key)
        rows.append(
            [
                quantity.text,
                _failed(_shown(was, quantity), before, row),
                _failed(_shown(found, quantity), now, row),
                f"≤ {goal:g} {quantity.unit}" if goal else "",
                ("yes" if _reached(now, row, quantity) else "no") if found and goal else "",
                f"{found[1]}, {found[2]}" if found else "",
            ]
        )
    text = table([["", "before", "now", "reach", "reached", "worst joint, pose"], *rows]) + "\n"
    if causes := now["causes"]:
        counts = ", ".join(f"{cause} ({count})" for cause, count in causes.items())
        text += f"\nTests that ended in a fault or a refusal: {counts}.\n"
    return text


def _scenes(now: Mapping[str, Any], before: Mapping[str, Any]) -> str:
    rows = []
    for key, scene in SCENES.items():
        cells = [
            "failed" if value is None else f"{number(value)} {scene.unit}".strip()
            for value in (before.get(key), now.get(key))
        ]
        value = now.get(key)
        reached = "yes" if value is not None and value <= scene.reach else "no"
        rows.append([scene.text, *cells, f"≤ {scene.reach:g} {scene.unit}".strip(), reached])
    return table([["point, scene", "before", "now", "reach", "reached"], *rows]) + "\n"


def _definition(row: Row) -> str:
    test = row.measure or row.together
    if isinstance(test, partial):
        given = ", ".join(f"{name} = {value}" for name, value in test.keywords.items())
        text = f"As {test.func.__name__}, with {given}."
    else:
        text = inspect.getdoc(test) or ""
    return f"**{row.key}.** {text}\n\n"


def _key(row: Row, quantity: Quantity) -> str:
    return f"{row.key}.{quantity.key}"


def _reached(record: Mapping[str, Any], row: Row, quantity: Quantity) -> bool:
    found = record["figures"].get(_key(row, quantity))
    goal = quantity.reach(record["derived"])
    if found is None or _faults(record, row):
        return False
    return not goal or abs(found[0]) <= goal


def _shown(found: Any, quantity: Quantity) -> str:
    return "–" if found is None else f"{number(found[0])} {quantity.unit}"


def _failed(text: str, record: Mapping[str, Any], row: Row) -> str:
    count = record.get("failures", {}).get(row.key, 0)
    return f"{text} ({count} failed)" if count else text


def number(value: float) -> str:
    """A value with three significant digits, never in exponents."""
    if value == 0.0 or abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{float(f'{value:.3g}'):.10g}"
