# SPDX-License-Identifier: Apache-2.0
"""B20: twelve joints on three virtual moteus buses at 500 Hz, each bus in a thread of its own.

The drives are on three processes, as they would be on three adapters, and this one is only the
board's side: drivers and buses. Figures are of this process. The joints hold their position; once
they have power, no time passes for them: physics is no part of it.

Beside it, what the computer allows at best: one loop on bare sockets sends as many datagrams of
the same lengths to as many processes, which answer each unread, and waits for the answers as long.
"""

from __future__ import annotations

import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from common import Effort, Figure, at_most, number, percentile

from control_board_ros.core.terms.drives import DriveReport, SetPoint
from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.buses import PATIENCE, Buses
from control_board_ros.plants.interface import Setup
from control_board_ros.plants.moteus.driver import make

BUSES, JOINTS, PERIOD, TIMEOUT = 3, 4, 2e-3, 5.0
#: Of answers, percent.
MISSED = 1.0
#: Bytes of a datagram with a set-point, and of one with an answer.
SENT, ANSWERED = 218, 186
#: Answers to datagrams, until an empty one.
ECHO = f"""
import socket
line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
line.bind(("127.0.0.1", 0))
print(line.getsockname()[1], flush=True)
while (datagram := line.recvfrom(4096))[0]:
    line.sendto(bytes({ANSWERED}), datagram[1])
"""
#: Drives of free joints on a bus, until stdin ends.
DRIVES = """
import sys
from common import time_until
from control_board_ros.plants.moteus.driver import make
from control_board_ros.plants.moteus.virtual import POSITION, VirtualMoteus, virtual_bus
from control_board_ros.plants.virtual.world import free_world
axes = make(tuple(sys.argv[2].split(",")), {"ids": sys.argv[3]}).axes
drives = [VirtualMoteus(axis.id) for axis in axes]
clock = time_until(lambda: all(drive.mode == POSITION for drive in drives))
bus = virtual_bus(free_world(axes, drives, clock=clock), drives, sys.argv[1])
print("ready", flush=True)
sys.stdin.read()
bus.close()
"""


def run(effort: Effort) -> list[Figure]:
    """Jitter, missed answers and CPU of the board's side; missed answers of bare sockets."""
    if find_spec("moteus") is None or find_spec("msgpack") is None:  # of python-can[multicast]
        return []
    seconds = effort.of(10.0, 2.0, 0.1)
    names = [tuple(f"joint_{bus}_{k}" for k in range(JOINTS)) for bus in range(BUSES)]
    own = os.getpid() & 0xFFFF
    addresses = [f"udp_multicast:239.{74 + k}.{own >> 8}.{own & 0xFF}" for k in range(BUSES)]
    ids = [" ".join(str(bus * JOINTS + k + 1) for k in range(JOINTS)) for bus in range(BUSES)]
    n = BUSES * JOINTS
    with drives(addresses, names, ids):
        buses = Buses(
            [
                make(joints, {"bus": address, "ids": numbers})
                for joints, address, numbers in zip(names, addresses, ids, strict=True)
            ]
        )
        values = np.zeros((VALUES, n))
        values[Value.POSITION] = 0.3
        wanted = SetPoints(np.full(n, SetPoint.POSITION, dtype=np.int8), values, np.ones(n))
        try:
            buses.connect(Setup(period=PERIOD, timeout=TIMEOUT, joints=(None,) * n))
            with_power(buses, wanted)
            late, took, cpu, missed = _measured(
                lambda: int(np.count_nonzero(buses.exchange(wanted).ages)), n, seconds
            )
            if any(faults := buses.exchange(wanted).faults):
                raise RuntimeError(f"drives have faults: {faults}")
        finally:
            buses.close()
    with bare_lines() as lines:
        _, _, _, least = _measured(lambda: bare_exchange(lines), n, seconds)
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
            f"{number(1e3 * percentile(took, 99.0))} ms; of bare sockets "
            f"{number(100.0 * least)} %",
        ),
        Figure("B20", "the same of bare sockets, whose answers nobody reads", 100.0 * least, "%"),
        Figure("B20", "CPU of the drivers", 100.0 * cpu, "%"),
    ]


@contextmanager
def drives(addresses: list[str], names: list[tuple[str, ...]], ids: list[str]) -> Iterator[None]:
    """Virtual drives on each bus, in a process each."""
    made = [
        subprocess.Popen(
            [sys.executable, "-c", DRIVES, address, ",".join(own), numbers],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=Path(__file__).parent,
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


def with_power(buses: Buses, wanted: SetPoints) -> None:
    """Exchange until all drives report their power."""
    while True:
        found = buses.exchange(wanted)
        if all(one.power for one in found.drives or [DriveReport()]):
            return
        for k, fault in enumerate(found.faults):
            if fault:  # of a busy computer
                buses.clear_fault(k)
        time.sleep(PERIOD)


@contextmanager
def bare_lines() -> Iterator[list[socket.socket]]:
    """A socket to each of BUSES processes that answer."""
    made = [
        subprocess.Popen([sys.executable, "-c", ECHO], stdout=subprocess.PIPE)
        for _ in range(BUSES)
    ]
    lines = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in made]
    try:
        for one, line in zip(made, lines, strict=True):
            if one.stdout is None:
                raise RuntimeError("it has no output")
            line.connect(("127.0.0.1", int(one.stdout.readline())))
            line.setblocking(False)
        yield lines
    finally:
        for one, line in zip(made, lines, strict=True):
            line.send(b"")
            one.communicate()
            line.close()


def bare_exchange(lines: list[socket.socket]) -> int:
    """A datagram for each joint, and the answers that come in time; how many do not."""
    for line in lines:
        _received(line)  # what is late
    end = time.perf_counter() + PATIENCE * PERIOD
    for line in lines:
        for _ in range(JOINTS):
            line.send(bytes(SENT))
    missing = dict.fromkeys(lines, JOINTS)
    while missing and (left := end - time.perf_counter()) > 0.0:
        for line in select.select(list(missing), [], [], left)[0]:
            missing[line] -= _received(line)
            if missing[line] <= 0:
                del missing[line]
    return sum(missing.values())


def _received(line: socket.socket) -> int:
    """How many datagrams have arrived; they are dropped."""
    count = 0
    try:
        while line.recv(ANSWERED):
            count += 1
    except BlockingIOError:
        return count
    return count


def _measured(
    exchange: Callable[[], int], n: int, seconds: float
) -> tuple[list[float], list[float], float, float]:
    """Lateness and duration of each cycle, s; CPU, of one processor; share of late answers.

    Args:
        exchange: One cycle; how many answers are late.
        n: Answers of a cycle.
        seconds: To measure.
    """
    for _ in range(50):
        exchange()
    count = max(1, round(seconds / PERIOD))
    late, took, missed = [], [], 0
    begin, cpu = time.perf_counter(), time.process_time()
    for k in range(count):
        due = begin + k * PERIOD
        time.sleep(max(0.0, due - time.perf_counter()))
        start = time.perf_counter()
        missed += exchange()
        took.append(time.perf_counter() - start)
        late.append(max(0.0, start - due))
        begin += max(0.0, start - due - PERIOD)  # a cycle that was missed is not made up for
    spent = time.process_time() - cpu
    return late, took, spent / (count * PERIOD), missed / (count * n)
