# SPDX-License-Identifier: Apache-2.0
"""Our Feetech driver on the servos that feetech-cli simulates.

They go to a goal at once, and drop what is written into the stored area behind the lock, which the
memory table (55) does not say: it acts, and is lost with the supply.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import pytest
from drive_bench import Bench
from feetech_cli.simulator import SimulatedBus, SimulatedServo

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.feetech import virtual
from control_board_ros.plants.virtual.pty_bus import VirtualSerial
from control_board_ros.plants.virtual.servo import Framer

OFF, POSITION, VELOCITY = SetPoint.OFF, SetPoint.POSITION, SetPoint.VELOCITY
STATUS = 65


class SimulatedEnd(VirtualSerial):
    """A wire with the servos of feetech-cli at its end."""

    def __init__(self, bench: Bench) -> None:
        framer = Framer(virtual.HEADER, 4, virtual.length_of, virtual.unpacked)
        super().__init__(bench.world, bench.drives, framer)
        self.servos = [SimulatedServo(drive.id) for drive in bench.drives]
        self.simulated = SimulatedBus(self.servos)

    def step(self, frames: Iterable[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
        for _, data in self.to_drives(frames):
            self.simulated.write(data)
        return [(0, self.simulated.read(1 << 12))]


class SimulatedBench(Bench):
    def _far_end(self) -> Any:
        return SimulatedEnd(self)


@pytest.fixture
def bench() -> Iterator[Any]:
    with SimulatedBench("feetech", options={"unwatched": "1"}) as bench:
        bench.connect()
        yield bench


def on(bench: Any) -> list[int]:
    return [servo.get("torque_enable") for servo in bench.bus.servos]


def test_it_is_connected_and_moves_where_it_is_told(bench: Any) -> None:
    limits = bench.plant.describe().joints[0].limits
    assert (limits.lower, limits.upper) == (
        pytest.approx(-np.pi, abs=2e-3), pytest.approx(np.pi, abs=2e-3),
    )  # fmt: skip
    bench.until(lambda found: np.abs(found.position - 0.5).max() < 2e-3, POSITION, position=0.5)
    assert [servo.get("goal_position") for servo in bench.bus.servos] == [2374, 2374]
    bench.follow(OFF, 5)
    assert on(bench) == [0, 0]


def test_a_servo_that_keeps_its_mode_is_a_fault(bench: Any) -> None:
    """S8: VELOCITY is not shown where positions act."""
    bench.follow(POSITION, 50, position=0.1)
    found = bench.until(lambda found: all(found.faults), VELOCITY, velocity=0.2)
    assert "does not take power" in str(found.faults[0])
    bench.follow(OFF, 5)
    assert on(bench) == [0, 0]


def test_a_fault_is_reported_alone_and_cleared(bench: Any) -> None:
    bench.follow(POSITION, 50, position=0.1)
    bench.bus.servos[1].memory[STATUS] = 32
    found = bench.until(lambda found: bool(found.faults[1]), POSITION, position=0.1)
    assert str(found.faults[1]) == "32 overload"
    assert not found.faults[0]
    bench.bus.servos[1].memory[STATUS] = 0
    bench.recover()


def test_a_silent_servo_is_named_and_comes_back(bench: Any) -> None:
    bench.follow(POSITION, 50, position=0.1)
    silent = bench.bus.simulated.servos.pop()
    found = bench.until(lambda found: bool(found.faults[1]), POSITION, position=0.1)
    assert "no answer from id 2" in str(found.faults[1])
    assert not found.faults[0]
    bench.bus.simulated.servos.append(silent)
    bench.recover()
    bench.until(lambda found: np.abs(found.position - 0.3).max() < 2e-3, POSITION, position=0.3)
