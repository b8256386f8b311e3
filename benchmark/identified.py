# SPDX-License-Identifier: Apache-2.0
"""How near ``cbctl identify`` comes to hidden truths: the table of docs/howto/identify.md.

    python benchmark/identified.py [ROBOT [ENGINE [SEED]]] [--page]

Each cell (robot, engine, seed) takes minutes and replaces its rows in ``identified.json``;
``--page`` alone writes the table of what is in there. Cells: test/support/hidden.py.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "test" / "support"))

from hidden import ENGINES, GRID, ROBOTS, misses, of_grid  # noqa: E402
from report import replace_between  # noqa: E402

from control_board_ros.identification.files import TITLES  # noqa: E402

ROWS, PAGE = HERE / "identified.json", HERE.parent / "docs" / "howto" / "identify.md"
BEGIN, END = "<!-- begin: benchmark/identified.py -->", "<!-- end -->"
Rows = dict[str, list[dict[str, Any]]]


def main() -> None:
    """Run cells, or write the page."""
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("robot", nargs="?", choices=[*ROBOTS])
    parser.add_argument("engine", nargs="?", choices=ENGINES)
    parser.add_argument("seed", nargs="?", type=int, choices=[*GRID])
    parser.add_argument("--page", action="store_true")
    given = parser.parse_args()
    rows: Rows = json.loads(ROWS.read_text("utf-8")) if ROWS.exists() else {}
    if given.robot or not given.page:
        for robot in [given.robot] if given.robot else ROBOTS:
            for engine in [given.engine] if given.engine else ENGINES:
                for seed in [given.seed] if given.seed else GRID:
                    hidden = of_grid(robot, engine, seed)
                    found = misses(hidden, hidden.identified())
                    rows[f"{robot} {engine} {seed}"] = [asdict(one) for one in found]
                    lines = [
                        f"{json.dumps(cell)}: {json.dumps(rows[cell])}" for cell in sorted(rows)
                    ]
                    ROWS.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    print("\n".join(table(rows)))
    if given.page:
        replace_between(PAGE, BEGIN, END, "\n".join(["", *table(rows), ""]))


def table(rows: Rows) -> list[str]:
    """The median and the greatest error of each quantity, over cells and joints."""
    found = [
        "| quantity | joints | median error | greatest error | median interval (95 %) | refused |",
        "|---|---|---|---|---|---|",
    ]
    for quantity, title in TITLES.items():
        own = [one for cell in rows.values() for one in cell if one["quantity"] == quantity]
        if quantity in ("efficiency", "center") or not own:
            continue
        written = [one for one in own if not one["why"] and one["truth"]]
        errors = sorted(abs(one["found"] / one["truth"] - 1.0) for one in written)
        widths = sorted(one["sure"] / one["truth"] for one in written)
        refused = len([one for one in own if one["why"]])
        if errors:
            found.append(
                f"| {title} | {len(own)} | {percent(middle(errors))} | {percent(errors[-1])} | "
                f"±{percent(middle(widths))} | {refused} |"
            )
    sides = [sorted(set(side)) for side in zip(*(cell.split() for cell in rows), strict=True)]
    cells = " × ".join(", ".join(side) for side in sides)
    return [*found, "", f"{len(rows)} cells: {cells} (robot, engine, seed)."]


def middle(values: Sequence[float]) -> float:
    return values[len(values) // 2]


def percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


if __name__ == "__main__":
    main()
