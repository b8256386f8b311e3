# SPDX-License-Identifier: Apache-2.0
"""A move on wires that delay, drop and stall, by each set-point of a drive (SPEC B6, B7, S1).

Two joints of the iiwa, each an inertia behind a simulated drive, move 0.8 rad either way at half
of their speed limit on average, 0.94 of it at most. The plant is that of test/plants/test_wire.py.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SUPPORT = Path(__file__).resolve().parents[2] / "test" / "support"
sys.path.insert(0, str(SUPPORT))
try:
    from bad_wire import ROWS, BadWire, worst
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


def moved(row: str, wire: dict[str, float], stall: int = 0) -> tuple[BadWire, NDArray[np.float64]]:
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
    bench.run(AFTER - stall)
    way = np.cumsum(bench.speeds * bench.limit * bench.period, axis=0)
    return bench, way[: BEFORE + AFTER]


def figures(rows: Sequence[str], wires: Sequence[str]) -> Iterator[WireFigures]:
    """The figures of all wires, row by row."""
    for row in rows:
        _, good = moved(row, {})
        for wire in wires:
            bench, way = moved(row, WIRES.get(wire, {}), STALLS.get(wire, 0))
            speed, reversal = worst(bench.speeds, WAYS)
            deviation = 1e3 * float(np.abs(way - good).max())
            yield WireFigures(
                row, wire, speed, max(reversal, 0.0), deviation, tuple(sorted(bench.faults))
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


__all__ = ["ROWS", "STALLS", "WIRES", "figures", "print_wires"]
