# SPDX-License-Identifier: Apache-2.0
"""A long run under load: make soak (an hour), make soak ARGS="--seconds 60".

A board at 1 kHz gets references at 100 Hz, a mode switch every second and a fault every minute,
then a flood of 10 kHz; every call must be answered. Before that, a million mode switches on the
core alone. Exit code 1 when a promise of docs/reliability.md is broken.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SENDER = ROOT / "test" / "support" / "sender.py"
MEGABYTE = 1024 * 1024
MODES = ("pos", "posd", "vel", "mix", "torq", "open", "idl")
FAULTS = ("overcurrent", "encoder", "torque_sensor", "overheating", "external")
JOINT = "lbr_iiwa_joint_7"


@dataclass(frozen=True, slots=True)
class Promise:
    """What was promised and what was measured; ``timed`` figures depend on the machine."""

    text: str
    value: float
    unit: str
    bound: float
    timed: bool = False

    @property
    def kept(self) -> bool:
        return self.value <= self.bound

    def line(self) -> str:
        verdict = "kept" if self.kept else "BROKEN"
        return f"{self.text:58} {self.value:10.4g} {self.unit:8} (≤ {self.bound:g})  {verdict}"


@dataclass(slots=True)
class Record:
    """What one run collects, second after second."""

    asked: int = 0
    answered: int = 0
    latency: list[float] = field(default_factory=list)  # s
    memory: list[tuple[float, float]] = field(default_factory=list)  # s, MB
    offset: list[tuple[float, float]] = field(default_factory=list)  # s, simulated minus wall
    loop: list[tuple[int, int]] = field(default_factory=list)  # cycles, overruns
    references: int = 0
    switches: int = 0
    faults: int = 0


def resident(pid: int | str) -> float:
    """Resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def slope(points: list[tuple[float, float]]) -> float:
    """Least-squares slope of the second half of the points, per second."""
    x, y = np.array(points[len(points) // 2 :]).T
    return float(np.polyfit(x - x[0], y, 1)[0])


# --- the core ---------------------------------------------------------------------------------


def switch_the_core(count: int) -> list[Promise]:
    """Mode switches of an arm in process; a control cycle for every hundred."""
    from control_board_ros.settings.loading import load
    from control_board_ros.simulation import Simulation

    settings = load("iiwa")
    choose = random.Random(1).choices(MODES, k=1000)
    with Simulation(settings.board, settings.simulation) as simulation:
        board = simulation.board
        simulation.run(0.1)
        refused, memory = 0, 0.0
        for k in range(count):
            refused += not board.set_control_mode(k % 7, choose[k % 1000])
            if k % 100 == 0:
                simulation.step()
                board.take_events()
            if k == count // 10:
                memory = resident("self")
        grown = resident("self") - memory
        modes = {mode.code for mode in board.get_control_mode()}
        wrong = len(modes - set(MODES)) + (not np.isfinite(board.snapshot().block).all())
    return [
        Promise(f"{count:,} mode switches on the core: refused", refused, "", 0),
        Promise("  joints in a wrong state afterwards", wrong, "", 0),
        Promise("  memory grown", grown, "MB", 1.0),
    ]


# --- the node ---------------------------------------------------------------------------------


class Load:
    """References, switches and faults on a running board."""

    def __init__(self, client: Any, record: Record) -> None:
        self.client, self.record = client, record
        self.mode = "posd"
        self.random = random.Random(2)

    def call(self, method: Callable[..., Any], *arguments: Any) -> Any:
        """One call that must be answered."""
        from control_board_ros.client import BoardTimeout

        self.record.asked += 1
        begun = time.monotonic()
        try:
            reply = method(*arguments)
        except BoardTimeout as error:
            print(f"lost: {error}", file=sys.stderr)
            return None
        self.record.answered += 1
        self.record.latency.append(time.monotonic() - begun)
        return reply

    def reference(self, now: float) -> None:
        """The reference that the mode accepts; a slow wave."""
        wave = math.sin(now)
        send, value = {
            "pos": (self.client.position_move, 0.3 * wave),
            "posd": (self.client.set_position, 0.3 * wave),
            "vel": (self.client.velocity_move, 0.3 * wave),
            "mix": (self.client.velocity_move, 0.2 * wave),
            "torq": (self.client.set_ref_torque, 0.5 * wave),
            "open": (self.client.set_output, 2.0 * wave),
            "idl": (self.client.set_output, 0.0),  # ignored
        }[self.mode]
        send(JOINT, value)
        self.record.references += 1

    def switch(self) -> None:
        """Another mode; from the fault that may be there as well."""
        self.mode = self.random.choice(MODES)
        if self.call(self.client.set_control_mode, JOINT, "fidl") is not None:
            self.call(self.client.set_control_mode, JOINT, self.mode)
            self.record.switches += 1

    def fault(self) -> None:
        """A passing fault, detected and reported."""
        kind = self.random.choice(FAULTS)
        self.call(self.client.inject_fault, JOINT, kind)
        until = time.monotonic() + 2.0
        while time.monotonic() < until:
            if self.call(self.client.get_faults, JOINT)[0].active:
                self.record.faults += 1
                return


def listen(node: Any, record: Record, begun: float) -> None:
    """Note the loop's diagnostics and how simulated time runs against the wall's."""
    from diagnostic_msgs.msg import DiagnosticArray
    from sensor_msgs.msg import JointState

    def on_diagnostics(message: Any) -> None:
        status = next(s for s in message.status if s.name.endswith("loop"))
        values = {pair.key: pair.value for pair in status.values}
        record.loop.append((int(values["cycles"]), int(values["overruns"])))

    def on_state(message: Any) -> None:
        now = time.monotonic() - begun
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        record.offset.append((now, stamp - now))
        if len(record.offset) > 200:  # of every 2 s, what arrived with the least delay
            record.offset[:-200] = thinned(record.offset[:-200])

    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    node.create_subscription(JointState, "joint_states", on_state, 100)


def thinned(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """One point for each two seconds: the one that was delayed least."""
    best: dict[int, tuple[float, float]] = {}
    for point in points:
        key = int(point[0] // 2.0)
        if key not in best or point[1] > best[key][1]:
            best[key] = point
    return list(best.values())


def prefer(pid: int, priority: int) -> None:
    """Give all threads of a process real-time priority: its neighbours then do not count."""
    for thread in os.listdir(f"/proc/{pid}/task"):
        os.sched_setscheduler(int(thread), os.SCHED_RR, os.sched_param(priority))


def run_node(seconds: float, minute: float, flood: float, priority: int) -> tuple[Record, Record]:
    """The board under load; its record, and that of the flood afterwards."""
    from control_board_ros.client import ControlBoardClient
    from control_board_ros.testing import board_process, ros_node

    record, flooded = Record(), Record()
    params = {"allow_fault_injection": True, "publish_clock": True}
    with (
        board_process(params) as board,
        ros_node(board.domain, "soak") as node,
        ControlBoardClient(node, board.name, answer_timeout=10.0) as client,
    ):
        if priority:
            prefer(board.process.pid, priority)
        begun = time.monotonic()
        load = Load(client, record)
        load.switch()
        listen(node, record, begun)
        due = dict.fromkeys(("reference", "switch", "fault", "memory"), 0.0)
        every = {"reference": 0.01, "switch": 1.0, "fault": minute, "memory": 1.0}
        due["fault"] = minute / 2
        while (now := time.monotonic() - begun) < seconds:
            for what in [what for what, at in due.items() if now >= at]:
                due[what] = max(due[what] + every[what], now - every[what])
                if what == "memory":
                    record.memory.append((now, resident(board.process.pid)))
                elif what == "reference":
                    load.reference(now)
                else:
                    getattr(load, what)()
            time.sleep(max(0.0, min(due.values()) - (time.monotonic() - begun)))
        if flood:
            load.record = flooded
            listen(node, flooded, begun)
            record = replace(record, loop=list(record.loop), offset=list(record.offset))
            under_flood(client, load, board, flood)
    return record, flooded


def under_flood(client: Any, load: Load, board: Any, seconds: float) -> None:
    """10 kHz of references from another process, and calls meanwhile."""
    words = ["position_direct", "0.0", "10000", "0", JOINT, board.name]
    sender = subprocess.Popen(
        [sys.executable, str(SENDER), *words], env=board.environment, stdout=subprocess.PIPE
    )
    try:
        assert sender.stdout is not None
        sender.stdout.readline()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            load.call(client.get_control_mode, JOINT)
    finally:
        sender.kill()
        sender.communicate()


def judge(record: Record, flooded: Record, minute: float) -> list[Promise]:
    """The promises of the node."""
    seconds = record.memory[-1][0]
    offsets = thinned(record.offset)
    drift = 1e3 * abs(offsets[-2][1] - offsets[0][1])
    growth = 3600.0 * slope(record.memory)
    missing = max(0.0, math.floor(seconds / minute - 0.5) - record.faults)
    promises = [
        Promise("replies lost", lost(record) + lost(flooded), "", 0),
        Promise("faults not found", missing, "", 0),
        Promise("p99 of a call, quiet", 1e3 * quantile(record.latency, 0.99), "ms", 50, True),
        Promise("memory slope", growth, "MB/h", 5.0, timed=seconds < 600.0),
        Promise("overruns", overruns(record), "%", 0.1, True),
        Promise("drift of simulated against wall time", drift, "ms", 10.0, True),
    ]
    if flooded.latency:
        worst = 1e3 * quantile(flooded.latency, 0.99)
        promises.append(Promise("p99 of a call under 10 kHz", worst, "ms", 250.0, True))
    return promises


def lost(record: Record) -> int:
    return record.asked - record.answered


def overruns(record: Record) -> float:
    """Cycles that took too long, percent."""
    (first_cycles, first), (last_cycles, last) = record.loop[0], record.loop[-1]
    return 100.0 * (last - first) / max(1, last_cycles - first_cycles)


def quantile(values: list[float], q: float) -> float:
    return float(np.quantile(values, q))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=3600.0, help="of load on the node")
    parser.add_argument("--switches", type=int, help="on the core (default: a million)")
    parser.add_argument("--flood", type=float, help="s of 10 kHz (default: 60, or a tenth)")
    parser.add_argument("--priority", type=int, default=0, help="real-time, of the board (root)")
    parser.add_argument("--patient", action="store_true", help="timed figures only inform")
    parser.add_argument("--json", type=Path, help="write the figures to this file as well")
    options = parser.parse_args()
    seconds = max(10.0, options.seconds)
    minute = min(60.0, seconds / 4)
    switches = options.switches if options.switches is not None else 1_000_000
    flood = options.flood if options.flood is not None else min(60.0, seconds / 10)
    promises = switch_the_core(switches)
    record, flooded = run_node(seconds, minute, flood, options.priority)
    promises += judge(record, flooded, minute)
    print(
        f"{seconds:g} s at 1 kHz: {record.references:,} references, {record.switches:,} switches, "
        f"{record.faults} faults, {record.asked + flooded.asked:,} calls; resident MB: "
        + " ".join(f"{mb:.2f}" for _, mb in record.memory[:: max(1, len(record.memory) // 10)])
    )
    for promise in promises:
        print(promise.line())
    if options.json:
        found = [asdict(promise) | {"kept": promise.kept} for promise in promises]
        options.json.write_text(json.dumps({"seconds": seconds, "promises": found}, indent=1))
    broken = [p for p in promises if not p.kept and not (p.timed and options.patient)]
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
