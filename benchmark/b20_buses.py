# SPDX-License-Identifier: Apache-2.0
"""B20: twelve joints on three virtual moteus buses at 500 Hz, the buses in one loop.

The drives are on three processes, as they would be on three adapters, and this one is only the
board's side: drivers and buses. Figures are of this process. The joints hold their position; once
they have power, no time passes for them: physics is no part of it.

Virtual drives and the driver share the processors. What the driver costs apart from them is
measured in the same run: then the drives answer from memory, each frame as they answered it first;
and without any socket, by frames of this process.

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
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from common import Effort, Figure, at_most, number, percentile

from control_board_ros.core.terms.drives import DriveReport, SetPoint
from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.buses import PATIENCE, Buses
from control_board_ros.plants.drives.can_socket import Received, received
from control_board_ros.plants.drives.plant import DrivesPlant
from control_board_ros.plants.interface import Setup
from control_board_ros.plants.moteus.driver import make
from control_board_ros.plants.moteus.virtual import VirtualMoteus
from control_board_ros.plants.virtual.can_bus import VirtualCan
from control_board_ros.plants.virtual.world import free_world

BUSES, JOINTS, PERIOD, TIMEOUT = 3, 4, 2e-3, 5.0
#: UDP port: below those that the system hands out.
PORT = 23113
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
#: Drives of free joints on a bus, until stdin ends; from its first line on by memory.
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
thought, answers = bus.step, {}
def remembered(frames):
    if (asked := tuple(frames)) not in answers:
        answers[asked] = thought(asked)
    return answers[asked]
if sys.stdin.readline():
    bus.step = remembered
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
    group = f"{own >> 8}.{own & 0xFF}:{PORT}"
    addresses = [f"udp_multicast:239.{74 + k}.{group}" for k in range(BUSES)]
    ids = [" ".join(str(bus * JOINTS + k + 1) for k in range(JOINTS)) for bus in range(BUSES)]
    n = BUSES * JOINTS
    with drives(addresses, names, ids) as remember:
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

            def exchange() -> int:
                return int(np.count_nonzero(buses.exchange(wanted).ages))

            late, took, cpu, missed = _measured(exchange, n, seconds)
            remember()
            _, _, alone, missed_alone = _measured(exchange, n, seconds)
            if any(faults := buses.exchange(wanted).faults):
                raise RuntimeError(f"drives have faults: {faults}")
        finally:
            buses.close()
    with bare_lines() as lines:
        _, _, _, least = _measured(lambda: bare_exchange(lines), n, seconds)
    memory = "with drives that answer from memory"
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
        Figure("B20", f"late answers {memory}", 100.0 * missed_alone, "%", at_most(MISSED)),
        Figure("B20", "CPU of the drivers", 100.0 * cpu, "%"),
        Figure("B20", f"CPU of the drivers {memory}", 100.0 * alone, "%"),
        Figure("B20", "CPU of the drivers without sockets", 100.0 * _without_sockets(), "%"),
    ]


class Wire:
    """A bus in this process, whose drives answer from memory once they have power."""

    def __init__(self, drives: VirtualCan) -> None:
        self.drives, self.remembers = drives, False
        self._waiting: deque[Received] = deque()
        self._answers: dict[tuple[int, bytes], list[Received]] = {}

    def put(self, frame_id: int, data: bytes) -> None:
        """Answer a frame."""
        found = self._answers.get((frame_id, data)) if self.remembers else None
        if found is None:
            found = [received(*answer) for answer in self.drives.step([(frame_id, data)])]
            self._answers[frame_id, data] = found
        self._waiting.extend(found)

    def recv(self, _timeout: float) -> Received | None:
        """The next answer."""
        return self._waiting.popleft() if self._waiting else None

    def shutdown(self) -> None:
        """Nothing is open."""


def _without_sockets(count: int = 200, times: int = 10) -> float:
    """CPU of the exchanges of all drivers, of one processor; the least of some measurements."""
    plants, wires = [], []
    for _ in range(BUSES):
        plant = make(tuple(f"joint_{k}" for k in range(JOINTS)), {"bus": "none"})
        own = [VirtualMoteus(axis.id) for axis in plant.axes]
        wires.append(Wire(VirtualCan(free_world(plant.axes, own), own)))
        plant.driver.line.connect = lambda *_, wire=wires[-1], **__: wire
        plants.append(plant)
    values = np.zeros((VALUES, JOINTS))
    kinds = np.full(JOINTS, SetPoint.POSITION, dtype=np.int8)
    wanted = SetPoints(kinds, values, np.ones(JOINTS))
    for plant, wire in zip(plants, wires, strict=True):
        plant.connect(Setup(period=PERIOD, timeout=TIMEOUT, joints=(None,) * JOINTS))
        with_power(plant, wanted)
        wire.remembers = True
    spent = []
    for _ in range(times):
        begin = time.process_time()
        for _ in range(count):
            for plant in plants:
                plant.exchange(wanted)
        spent.append((time.process_time() - begin) / count)
    return min(spent) / PERIOD


@contextmanager
def drives(
    addresses: list[str], names: list[tuple[str, ...]], ids: list[str]
) -> Iterator[Callable[[], None]]:
    """Virtual drives on each bus, in a process each; what makes them answer from memory."""
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

        def remember() -> None:
            for one in made:
                if one.stdin is not None:
                    one.stdin.write(b"\n")
                    one.stdin.flush()

        yield remember
    finally:
        for one in made:
            one.communicate()


def with_power(buses: Buses | DrivesPlant, wanted: SetPoints) -> None:
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
