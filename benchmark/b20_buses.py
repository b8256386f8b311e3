# SPDX-License-Identifier: Apache-2.0
"""B20: twelve joints on three virtual moteus buses at 500 Hz, each bus in a thread of its own.

The drives are on three processes, as they would be on three adapters, and this one is only the
board's side: drivers and buses. Figures are of this process. The joints are at rest.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

import numpy as np
from common import Effort, Figure, at_most, number, percentile

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.buses import Buses
from control_board_ros.plants.interface import Setup
from control_board_ros.plants.moteus.driver import make

BUSES, JOINTS, PERIOD, TIMEOUT = 3, 4, 2e-3, 0.5
#: Of answers, percent.
MISSED = 1.0
#: Linux: whether a socket receives the groups that others joined; python-can leaves it on.
MULTICAST_ALL = 49
#: Drives of free joints on a bus, until stdin ends.
DRIVES = """
import socket, sys
from control_board_ros.plants.moteus.driver import make
from control_board_ros.plants.moteus.virtual import VirtualMoteus, virtual_bus
from control_board_ros.plants.virtual.world import free_world
axes = make(tuple(sys.argv[2].split(",")), {"ids": sys.argv[3]}).axes
drives = [VirtualMoteus(axis.id) for axis in axes]
bus = virtual_bus(free_world(axes, drives, clock=lambda: 0.0), drives, sys.argv[1])
bus.bus._multicast._socket.setsockopt(socket.IPPROTO_IP, int(sys.argv[4]), 0)
print("ready", flush=True)
sys.stdin.read()
bus.close()
"""


def run(effort: Effort) -> list[Figure]:
    """Jitter, missed answers and CPU of the board's side."""
    if find_spec("moteus") is None or find_spec("msgpack") is None:  # of python-can[multicast]
        return []
    seconds = effort.of(10.0, 2.0, 0.1)
    names = [tuple(f"joint_{bus}_{k}" for k in range(JOINTS)) for bus in range(BUSES)]
    own = os.getpid() & 0xFFFF
    addresses = [f"udp_multicast:239.{74 + k}.{own >> 8}.{own & 0xFF}" for k in range(BUSES)]
    ids = [" ".join(str(bus * JOINTS + k + 1) for k in range(JOINTS)) for bus in range(BUSES)]
    with drives(addresses, names, ids):
        plants = [
            make(joints, {"bus": address, "ids": numbers})
            for joints, address, numbers in zip(names, addresses, ids, strict=True)
        ]
        buses = Buses(plants)
        n = BUSES * JOINTS
        try:
            buses.connect(Setup(period=PERIOD, timeout=TIMEOUT, joints=(None,) * n))
            for plant in plants:
                opened = plant.driver.line.bus._multicast._socket
                opened.setsockopt(socket.IPPROTO_IP, MULTICAST_ALL, 0)
            late, took, cpu, missed = _measured(buses, n, seconds)
        finally:
            buses.close()
    case = f"{n} joints on {BUSES} buses at 500 Hz"
    return [
        Figure("B20", f"{case}: lateness of a cycle, p99", 1e3 * percentile(late, 99.0), "ms"),
        Figure(
            "B20",
            "answers that were late for their cycle",
            100.0 * missed,
            "%",
            at_most(MISSED),
            f"an exchange is {number(1e3 * percentile(took, 50.0))} ms, p99 "
            f"{number(1e3 * percentile(took, 99.0))} ms",
        ),
        Figure("B20", "CPU of the drivers", 100.0 * cpu, "%"),
    ]


@contextmanager
def drives(addresses: list[str], names: list[tuple[str, ...]], ids: list[str]) -> Iterator[None]:
    """Virtual drives on each bus, in a process each."""
    made = [
        subprocess.Popen(
            [sys.executable, "-c", DRIVES, address, ",".join(own), numbers, f"{MULTICAST_ALL}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for address, own, numbers in zip(addresses, names, ids, strict=True)
    ]
    try:
        for one in made:
            if one.stdout is None or one.stdout.readline() != b"ready\n":
                raise RuntimeError("virtual drives do not start")
        yield
    finally:
        for one in made:
            one.communicate()


def _measured(
    buses: Buses, n: int, seconds: float
) -> tuple[list[float], list[float], float, float]:
    """Lateness and duration of each cycle, s; CPU, of one processor; share of late answers."""
    values = np.zeros((VALUES, n))
    values[Value.POSITION] = 0.3
    wanted = SetPoints(np.full(n, SetPoint.POSITION, dtype=np.int8), values, np.ones(n))
    for _ in range(50):
        buses.exchange(wanted)
    count = max(1, round(seconds / PERIOD))
    late, took, missed = [], [], 0
    begin, cpu = time.perf_counter(), time.process_time()
    for k in range(count):
        due = begin + k * PERIOD
        time.sleep(max(0.0, due - time.perf_counter()))
        start = time.perf_counter()
        found = buses.exchange(wanted)
        took.append(time.perf_counter() - start)
        late.append(max(0.0, start - due))
        begin += max(0.0, start - due - PERIOD)  # a cycle that was missed is not made up for
        missed += int(np.count_nonzero(found.ages))
    spent = time.process_time() - cpu
    return late, took, spent / (count * PERIOD), missed / (count * n)
