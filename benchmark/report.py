# SPDX-License-Identifier: Apache-2.0
"""From figures to the terminal, the record and the documents.

The record, benchmark/results.json, holds each figure with its date and the one before it.
docs/performance.md and README.md show a part of it between markers; the text around them is
written by hand and kept. ``python benchmark/report.py`` prints all of it, a page of the site.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from common import Figure

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "benchmark" / "results.json"
PAGE = ROOT / "docs" / "performance.md"
README = ROOT / "README.md"
BEGIN, END = "<!-- performance -->", "<!-- /performance -->"
PACKAGES = ("control_board_ros", "numpy", "pybullet", "ros-jazzy-rclpy", "ros-fastrtps")
#: The figures that README shows.
SHORT = (
    "B1 control cycle, 7 joints, all in POSITION",
    "B3 simulation without ROS",
    "B4 lateness of the cycle start, p99, 1 kHz commands in, 1 kHz state out, ordinary user",
    "B5 set_control_mode round trip, one joint",
    "B8 reference published to seen in state (1 kHz), median",
)
MARKS = {True: "yes", False: "no", None: ""}

INTRODUCTION = f"""\
# Performance

Every figure comes from `make bench` (`python benchmark/run.py B1 B2 --quick` for a part, or for
a look), as a ratio against, or beside, a bare reference that ran in the same minutes. What the
scripts measure, and how, is at the head of each in `benchmark/`.

{BEGIN}
{END}
"""
FULL = """\
# All figures of performance

The record behind [performance](../performance.md), benchmark/results.json: the last figures and
those before them.
"""


def machine() -> dict[str, str]:
    """What the figures were measured on, and with what."""
    found = {
        "cpu": _cpu_model(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.release()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue  # a sourced ROS 2 has no such distributions
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if commit.returncode == 0:
        found["commit"] = commit.stdout.strip()
    return found


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def table(rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, padded so that it reads well as text too; the first row is the head."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ([cell.ljust(width) for cell, width in zip(row, widths, strict=True)] for row in rows)
    padded = [f"| {' | '.join(line)} |" for line in lines]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([padded[0], rule, *padded[1:]])


def printed(figures: Iterable[Figure]) -> str:
    """The figures for the terminal."""
    head = ("#", "what", "measured", "to reach", "met", "reference, same run")
    return table(
        [
            head,
            *((f.number, f.case, f.text, f.goal_text, MARKS[f.met], f.reference) for f in figures),
        ]
    )


def as_record(figure: Figure, date: str) -> dict[str, Any]:
    """A figure as the record holds it."""
    return asdict(figure) | {
        "goal": figure.goal_text,
        "text": figure.text,
        "met": figure.met,
        "date": date,
        "cpu": _cpu_model(),
    }


def remember(figures: Iterable[Figure], path: Path = RECORD) -> dict[str, Any]:
    """Put the figures into the record, each with the one that was there before."""
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    record: dict[str, Any] = {"figures": {}}
    if path.is_file():
        record = json.loads(path.read_text(encoding="utf-8"))
    measured: dict[str, Any] = record["figures"]
    numbers = set()
    for figure in figures:
        numbers.add(figure.number)
        key = f"{figure.number} {figure.case}"
        entry = as_record(figure, now)
        before = measured.get(key)
        if before is not None:
            entry["previous"] = {name: before[name] for name in ("value", "text", "date")}
        measured[key] = entry
    for key, entry in list(measured.items()):
        if entry["number"] in numbers and entry["date"] != now:
            del measured[key]  # a case that is no longer measured
    record = {"date": now, "machine": machine(), "figures": _in_order(measured)}
    path.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return record


def _in_order(figures: dict[str, Any]) -> dict[str, Any]:
    """By number; the cases of one number stay as they were measured."""
    return dict(sorted(figures.items(), key=lambda item: int(item[1]["number"][1:])))


def write_pages(record: dict[str, Any]) -> None:
    """Write the tables between the markers of docs/performance.md and README.md."""
    if not PAGE.is_file():
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(INTRODUCTION, encoding="utf-8")
    replace_between(PAGE, BEGIN, END, page_table(record))
    if README.is_file():
        replace_between(README, BEGIN, END, short_table(record))


def page_table(record: dict[str, Any]) -> str:
    """The figures that are not reached; the site has all."""
    rows = [("#", "what", "measured", "to reach")]
    rows += [
        (entry["number"], entry["case"], entry["text"], entry["goal"])
        for entry in record["figures"].values()
        if entry["met"] is False
    ]
    verdicts = [entry["met"] for entry in record["figures"].values()]
    count, reached = len(verdicts) - verdicts.count(None), verdicts.count(True)
    return f"{reached} of {count} goals are reached. Those that are not:\n\n{table(rows)}"


def full_table(record: dict[str, Any]) -> str:
    """All figures beside the ones before, with machine and versions."""
    versions = "; ".join(
        f"{name} {value}" for name, value in record["machine"].items() if name != "cpu"
    )
    rows = [("#", "what", "measured", "to reach", "met", "before", "reference, same run", "when")]
    for entry in record["figures"].values():
        before = entry.get("previous")
        rows.append(
            (
                entry["number"],
                entry["case"],
                entry["text"],
                entry["goal"],
                MARKS[entry["met"]],
                f"{before['text']} ({before['date'][:10]})" if before else "",
                entry["reference"],
                f"{entry['date']}, {entry['cpu']}",
            )
        )
    return f"The last of them on {record['machine']['cpu']}: {versions}.\n\n{table(rows)}"


def short_table(record: dict[str, Any]) -> str:
    """The figures of SHORT, for README."""
    rows = [("what", "measured", "to reach", "reference, same run")]
    rows += [
        (entry["case"], entry["text"], entry["goal"], entry["reference"])
        for key, entry in record["figures"].items()
        if key in SHORT
    ]
    found = record["machine"]
    shown = [entry for key, entry in record["figures"].items() if key in SHORT]
    processors = " and ".join(sorted({entry["cpu"] for entry in shown}))
    return (
        f"{processors}, {found['cores']} cores, {found['python']}, to {record['date'][:10]}; "
        f"`make bench` repeats them, [all figures](docs/performance.md).\n\n{table(rows)}"
    )


def replace_between(path: Path, begin: str, end: str, text: str) -> None:
    """Put a text between the markers of a file; a file without markers stays as it is."""
    before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, ended, after = rest.partition(end)
    if found and ended:
        path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


if __name__ == "__main__":
    print(f"{FULL}\n{full_table(json.loads(RECORD.read_text('utf-8')))}")
