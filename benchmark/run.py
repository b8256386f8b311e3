# SPDX-License-Identifier: Apache-2.0
"""Measure the figures of docs/performance.md: ``python benchmark/run.py [B1 B2 …] [--quick]``.

Without names it measures all of them, which takes about ten minutes and needs a machine that
does nothing else. It prints a table, writes benchmark/results.json and the tables of
docs/performance.md and README.md. ``--quick`` takes a minute and writes nothing.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

# Without a sourced ROS 2 this starts Python anew, so it comes before any work.
import rclpy  # noqa: F401
from common import Effort, Figure
from report import as_record, machine, printed, remember, short_table, write_pages

GROUPS = {
    "B1": "b1_cycle",
    "B2": "b2_scaling",
    "B3": "b3_faster",
    "B4": "b4_lateness",
    "B5": "b5_services",
    "B6": "b6_b9_semantics",
    "B7": "b7_streaming",
    "B8": "b8_latency",
    "B9": "b6_b9_semantics",
    "B10": "b10_footprint",
    "B11": "b11_many",
    "B12": "b12_collector",
    "B13": "b13_by_hand",
    "B14": "b14_whole_robot",
    "B15": "b15_command_line",
    "B16": "b16_emergency_stop",
    "B17": "b17_drives",
    "B18": "b18_gym",
    "B19": "b19_hands",
    "B20": "b20_buses",
    "B21": "b21_first_run",
}


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description="Measure the figures of docs/performance.md, each beside a bare reference."
    )
    parser.add_argument("figures", nargs="*", type=str.upper, help=f"of {', '.join(GROUPS)}")
    effort = parser.add_mutually_exclusive_group()
    effort.add_argument("--quick", action="store_true", help="a look; nothing is recorded")
    effort.add_argument("--tiny", action="store_true", help="to see that the scripts work")
    parser.add_argument("--no-record", action="store_true", help="print the figures only")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    chosen = parser.parse_args(arguments)
    for name in chosen.figures:
        if name not in GROUPS:
            parser.error(f"figure {name!r} unknown; there are {', '.join(GROUPS)}")
    return chosen


def measure(names: Sequence[str], effort: Effort) -> tuple[list[Figure], list[str]]:
    """The figures of these groups, and the modules that failed; progress on stderr."""
    figures: list[Figure] = []
    failed: list[str] = []
    for module in dict.fromkeys(GROUPS[name] for name in names):
        run: Callable[[Effort], list[Figure]] = import_module(module).run
        text = (run.__doc__ or "").strip()
        begin = time.monotonic()
        print(f"{module}: {text}", file=sys.stderr, end=" ", flush=True)
        try:
            figures += run(effort)
        except Exception as error:  # noqa: BLE001 - the others are still worth their time
            failed.append(module)
            lines = [f"failed: {type(error).__name__}: {error}", *getattr(error, "__notes__", ())]
            print("\n".join(lines), file=sys.stderr, end=" ")
        print(f"({time.monotonic() - begin:.0f} s)", file=sys.stderr, flush=True)
    return sorted(figures, key=lambda figure: int(figure.number[1:])), failed


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, record."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that no board is left behind
    chosen = parse(arguments)
    level = "quick" if chosen.quick else "tiny" if chosen.tiny else "full"
    figures, failed = measure(chosen.figures or list(GROUPS), Effort(level))
    print(printed(figures))
    if chosen.json is not None:
        record = {"machine": machine(), "figures": [as_record(one, "") for one in figures]}
        chosen.json.write_text(json.dumps(record, indent=1), encoding="utf-8")
    if level == "full" and not chosen.no_record:
        record = remember(figures)
        write_pages(record)
        print(f"\n{short_table(record)}")
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
