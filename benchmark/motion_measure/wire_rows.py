# SPDX-License-Identifier: Apache-2.0
"""A move on wires that delay, drop and stall, by each set-point of a drive (SPEC B6, B7, S1).

Two joints of the iiwa, each an inertia behind a simulated drive, move 0.8 rad either way at half
of their speed limit on average, 0.94 of it at most. The plant is that of test/plants/test_wire.py.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SUPPORT = Path(__file__).resolve().parents[2] / "test" / "support"
sys.path.insert(0, str(SUPPORT))
try:
    from bad_wire import GAPS, ROWS, BadWire, change_at_random, turn_round, worst
    from bad_wire import WIRES as LATE
finally:
    sys.path.remove(str(SUPPORT))

#: What a wire does, by its name: parameters of ``drive_model``.
WIRES: dict[str, dict[str, float]] = {
    "good": {},
    **{f"delay {ms} ms": {"latency": 1e-3 * ms} for ms in (5, 10, 20, 30)},
    **{f"random delay to {ms} ms": {"jitter": 1e-3 * ms} for ms in (5, 10, 20, 30)},
    **{f"loss {part} %": {"loss": 0.01 * part} for part in (1, 5, 10, 20)},
    **{
        f"bursts of {ms} ms": {"burst": 1e-3 * ms, "burst_interval": 0.3, "watchdog": 0.2}
        for ms in (30, 60, 90)
    },
}
#: Cycles for which the control loop stands still amid a move, by name.
STALLS = {f"loop stalls {ms} ms": ms for ms in (12, 40, 80)}
#: Periods from one cycle to the next from amid a move on, by name.
STARVED = {f"loop starved {name}": gaps for name, gaps in GAPS.items()}
WAYS = (1.0, -1.0)
DISTANCE, SETTLING, BEFORE, AFTER = 0.8, 100, 350, 1350


@dataclass(frozen=True, slots=True)
class WireFigures:
    """What a move on a wire was like.

    Attributes: row (set-point of the drives), wire, speed (greatest, over the limit), reversal
    (greatest speed against the way, over the limit), deviation (furthest from the same move on a
    good wire, mrad), faults (texts).
    """

    row: str
    wire: str
    speed: float
    reversal: float
    deviation: float
    faults: tuple[str, ...]


def moved(
    row: str, wire: dict[str, float], stall: int = 0, gaps: Sequence[int] = (1,)
) -> tuple[BadWire, NDArray[np.float64]]:
    """A bench after the move, and where its joints were in each cycle of it, rad."""
    bench = BadWire(row, wire)
    bench.run(SETTLING)
    bench.enter("pos")
    start = bench.position
    speeds = (0.5 * bench.limit).tolist()
    reply = bench.board.position_move(None, (start + DISTANCE * np.array(WAYS)).tolist(), speeds)
    if not reply:
        raise RuntimeError(reply.message)
    bench.run(BEFORE)
    if stall:
        bench.stall(stall)
    bench.starve(gaps, AFTER - stall)
    way = np.cumsum(bench.speeds * bench.limit * bench.period, axis=0)
    return bench, way[: BEFORE + AFTER]


def figures(rows: Sequence[str], wires: Sequence[str]) -> Iterator[WireFigures]:
    """The figures of all wires, row by row."""
    for row in rows:
        _, good = moved(row, {})
        for wire in wires:
            loop = STALLS.get(wire, 0), STARVED.get(wire, (1,))
            bench, way = moved(row, WIRES.get(wire, {}), *loop)
            speed, reversal = worst(bench.speeds, WAYS)
            deviation = 1e3 * float(np.abs(way - good).max())
            yield WireFigures(
                row, wire, speed, max(reversal, 0.0), deviation, tuple(sorted(bench.faults))
            )


def print_changes(rows: Sequence[str], count: int) -> None:
    """Some changes of mode at random, over all rows and the wires of the tests: one table."""
    print("| drive | wire | changes | top speed, × limit | reversal, % of it | faults |")
    print("|---|---|---|---|---|---|", flush=True)
    each = -(-count // (len(rows) * len(LATE)))
    for row in rows:
        for name, wire in LATE.items():
            bench, rng = BadWire(row, wire), random.Random(row)
            bench.run(SETTLING)
            turns = [turn_round(bench, rng) for _ in range(each // 4)]  # two changes each
            top, back = np.max(turns, axis=0)
            change_at_random(bench, rng, each - 2 * len(turns))
            top = max(top, np.abs(bench.speeds).max())
            print(
                f"| `{row}` | {name} | {each} | {top:.3f} | {100.0 * back:.1f} "
                f"| {'; '.join(bench.faults) or '0'} |",
                flush=True,
            )


def print_wires(rows: Sequence[str], wires: Sequence[str]) -> None:
    """One table for all set-points, of which docs/reliability.md has a part."""
    print("| drive | wire | top speed, × limit | reversal, % of it | deviation, mrad | faults |")
    print("|---|---|---|---|---|---|")
    for one in figures(rows, wires):
        print(
            f"| `{one.row}` | {one.wire} | {one.speed:.3f} | {100.0 * one.reversal:.1f} "
            f"| {one.deviation:.0f} | {'; '.join(one.faults) or '0'} |",
            flush=True,
        )


__all__ = ["ROWS", "STALLS", "STARVED", "WIRES", "figures", "print_changes", "print_wires"]
