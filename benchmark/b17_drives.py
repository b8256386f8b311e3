# SPDX-License-Identifier: Apache-2.0
"""B17: six joints on one virtual moteus bus at 500 Hz, beside bare python-can's same frames.

Both talk to the same virtual drives in the same process, so that what is compared is the driver:
set-points to frames, answers to readings. The bare one makes python-can's messages of the frames
of one exchange, sends them, and reads as many answers without looking at them. Both wait for every
answer. The joints hold their position; once they have power, no time passes for them: physics is
part of neither; garbage is collected as in the node,
of what was made since the start.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

import can
import numpy as np
from common import Effort, Figure, at_most, number, time_until

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants.drives.plant import DrivesPlant
from control_board_ros.plants.interface import Setup
from control_board_ros.plants.moteus.driver import make
from control_board_ros.plants.moteus.virtual import POSITION, VirtualMoteus, virtual_bus
from control_board_ros.plants.virtual.world import free_world

JOINTS, PERIOD = 6, 2e-3
#: s to wait for answers, that of a busy machine; s of silence that are a fault.
PATIENCE, TIMEOUT = 0.5, 5.0
#: Of bare python-can's CPU, and overruns per cycle in percent, on an idle machine.
RATIO, OVERRUNS = 1.3, 0.1


def run(effort: Effort) -> list[Figure]:
    """CPU of the driver beside bare frames, and its overruns."""
    seconds = effort.of(10.0, 2.0, 0.1)
    names = tuple(f"joint_{k}" for k in range(JOINTS))
    axes = make(names, {}).axes
    drives = [VirtualMoteus(axis.id) for axis in axes]
    clock = time_until(lambda: all(drive.mode == POSITION for drive in drives))
    world = free_world(axes, drives, clock=clock)
    bus = virtual_bus(world, drives)
    plant = make(names, {"bus": bus.address})
    try:
        plant.connect(Setup(period=PATIENCE / 0.6, timeout=TIMEOUT, joints=(None,) * JOINTS))
        values = np.zeros((VALUES, JOINTS))
        values[Value.POSITION] = 0.3
        kinds = np.full(JOINTS, SetPoint.POSITION, dtype=np.int8)
        wanted = SetPoints(kinds, values, np.ones(JOINTS))
        while any(drive.mode != POSITION for drive in drives):
            plant.exchange(wanted)
        frames = _frames(plant, wanted)
        ours, overruns = _measured(lambda: plant.exchange(wanted), seconds)
        if any(faults := plant.exchange(wanted).faults):
            raise RuntimeError(f"drives have faults: {faults}")
    finally:
        plant.close()
    channel = bus.address.partition(":")[2]
    try:
        with can.Bus(
            interface="virtual", channel=channel, protocol=can.CanProtocol.CAN_FD
        ) as line:
            bare, bare_overruns = _measured(lambda: _bare(line, frames), seconds)
    finally:
        bus.close()
    return [
        Figure(
            "B17",
            f"CPU of the moteus driver, {JOINTS} joints at 500 Hz, beside bare python-can",
            ours / bare,
            "×",
            at_most(RATIO),
            f"{1e3 * ours:.2f} ms an exchange against {1e3 * bare:.2f} ms, virtual drives in both",
        ),
        Figure(
            "B17",
            "its cycles that took longer than the period",
            overruns,
            "%",
            at_most(OVERRUNS),
            f"{number(bare_overruns)} % of the bare ones",
        ),
    ]


def _frames(plant: DrivesPlant, wanted: SetPoints) -> list[tuple[int, bytes]]:
    """The frames of one exchange."""
    line = plant.driver.line
    sent: list[tuple[int, bytes]] = []
    send = line.send

    def note(frame_id: int, data: bytes, **more: bool) -> None:
        sent.append((frame_id, data))
        send(frame_id, data, **more)

    line.send = note
    plant.exchange(wanted)
    line.send = send
    return sent


def _bare(line: can.BusABC, frames: list[tuple[int, bytes]]) -> None:
    for frame_id, data in frames:
        line.send(can.Message(arbitration_id=frame_id, data=data, is_fd=True, bitrate_switch=True))
    for _ in frames:
        if line.recv(PATIENCE) is None:
            return


def _measured(cycle: Callable[[], object], seconds: float) -> tuple[float, float]:
    """CPU per exchange, s, and exchanges that took longer than the period, percent."""
    count = max(1, round(seconds / PERIOD))
    late = 0
    gc.collect()
    gc.freeze()
    begin, cpu = time.perf_counter(), time.process_time()
    for k in range(count):
        start = time.perf_counter()
        cycle()
        late += time.perf_counter() - start > PERIOD
        time.sleep(max(0.0, begin + (k + 1) * PERIOD - time.perf_counter()))
    return (time.process_time() - cpu) / count, 100.0 * late / count
