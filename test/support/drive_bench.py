# SPDX-License-Identifier: Apache-2.0
"""Drivers against their virtual drives, in a time of their own that only exchanges move on."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any, Self
from unittest import mock

import numpy as np
from direct_bus import DirectCan, DirectPort
from manual_clock import ManualClock

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import SetPoints
from control_board_ros.plants.drives import can_line, serial_line
from control_board_ros.plants.drives.axes import Axis
from control_board_ros.plants.drives.driver import Identity
from control_board_ros.plants.drives.plant import DrivesPlant
from control_board_ros.plants.interface import Readings, Setup
from control_board_ros.plants.virtual.can_bus import Frame, VirtualCan
from control_board_ros.plants.virtual.pty_bus import VirtualSerial
from control_board_ros.plants.virtual.servo import Framer
from control_board_ros.plants.virtual.world import World, free_world
from control_board_ros.testing.plant_contract import set_points

#: What each driver in the box needs to be imported.
LIBRARIES = {
    "moteus": "moteus",
    "mit_can": "can",
    "dynamixel": "dynamixel_sdk",
    "cia402": "canopen",
    "odrive_can": "can",
    "feetech": "scservo_sdk",
}
#: A fault that each virtual drive can have.
FAULTS = {
    "VirtualMoteus": 35,
    "VirtualMit": 0xE,
    "VirtualRobStride": 1 << 14,
    "VirtualDynamixel": 32,
    "VirtualCia402": 0x3210,
    "DurandDrive": 0x3210,
    "VirtualOdrive": 0x0400_0000,
    "VirtualFeetech": 32,
}
PERIOD = 2e-3
TIMEOUT = 0.1


class Bench:
    """A driver, and at the other end of its bus virtual drives with free joints.

    Args:
        driver: Its folder's name.
        names: Of the joints.
        options: Of the driver, as ``plant_arguments`` has them.
        mounted: Options by which the drives are mounted in truth, where the user is wrong.
    """

    def __init__(
        self,
        driver: str,
        names: tuple[str, ...] = ("left", "right"),
        options: dict[str, str] | None = None,
        mounted: dict[str, str] | None = None,
    ) -> None:
        room = f"control_board_ros.plants.{driver}"
        self.driver, self._virtual = (
            import_module(f"{room}.driver"),
            import_module(f"{room}.virtual"),
        )
        self.clock = ManualClock()
        options = options or {}
        axes = self.driver.make(names, options if mounted is None else mounted).axes
        self.drives: list[Any] = [self._virtual.virtual_drive(axis, None) for axis in axes]
        self.world: World = free_world(axes, self.drives, clock=self.clock.now)
        self.world.longest = math.inf
        self.bus = self._far_end()
        self.plant: DrivesPlant = self.driver.make(names, options | {"bus": "direct"})
        self.line = self.plant.driver.line
        self.line.connect, self.plant.clock = self._connect, self.clock
        self._next, self.timeout = self.clock.now(), TIMEOUT
        self.baudrate = 0  # of the drives; 0: any
        self.opened: dict[str, object] = {}  # how the bus was opened last
        self.joints: tuple[Any, ...] = (None,) * len(names)

    @property
    def time(self) -> float:
        """Of driver, wire and drives, s."""
        return self.clock.now()

    @time.setter
    def time(self, now: float) -> None:
        self.clock.time = self._next = now

    def _far_end(self) -> VirtualCan | VirtualSerial:
        if not hasattr(self.drives[0], "on_packet"):
            return VirtualCan(self.world, self.drives)
        module = self._virtual
        head = {"dynamixel": 7, "feetech": 4}[module.__name__.split(".")[-2]]
        framer = Framer(module.HEADER, head, module.length_of, module.unpacked)
        return VirtualSerial(self.world, self.drives, framer)

    def _connect(self, *where: object, **options: object) -> Any:
        """The end of the bus that a driver opens; at another baud rate nothing gets through."""
        self.opened = options
        if isinstance(self.bus, VirtualSerial):
            lost = self.baudrate not in (0, where[-1])
            self.bus.to_drives = (lambda _: iter(())) if lost else self.bus.to_drives
            if self.baudrate and not lost:
                self.bus.to_drives = iter
            self.wire_end: Any = DirectPort(self.bus, self.clock)
            return self.wire_end
        self.wire_end = DirectCan(self.bus, self.clock)
        return self.wire_end

    def arrive(self, frames: Sequence[Frame]) -> None:
        """Frames that the driver receives."""
        self.wire_end.arrive(frames)

    @contextlib.contextmanager
    def direct(self) -> Iterator[None]:
        """Whatever opens a bus opens this one."""
        with contextlib.ExitStack() as stack:
            for module, name in ((can_line, "open_bus"), (serial_line, "open_port")):
                stack.enter_context(mock.patch.object(module, name, self._connect))
            stack.enter_context(mock.patch.object(can_line, "Clock", return_value=self.clock))
            yield

    def scan(self) -> list[Identity]:
        """What a scan of the bus finds."""
        with self.direct():
            found: list[Identity] = self.driver.scan("direct")
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.plant.close()

    @property
    def accepts(self) -> tuple[SetPoint, ...]:
        return self.plant.driver.traits.set_points

    def world_drive(self, axis: Axis) -> Any:
        """Another drive of that id, which moves nothing."""
        made = self._virtual.virtual_drive(axis, None)
        made.step(1e-3, 1.0, 0.0)
        return made

    def fail(self, joint: int, *, persists: bool = False) -> None:
        """Put the drive of a joint into a fault."""
        drive = self.drives[joint]
        drive.fail(FAULTS[type(drive).__name__], persists=persists)

    def connect(self) -> None:
        self.plant.connect(Setup(period=PERIOD, timeout=self.timeout, joints=self.joints))

    def tick(self, wanted: SetPoints) -> Readings:
        """One exchange, one period later."""
        self._next = max(self._next + PERIOD, self.clock.now())
        self.clock.time = self._next
        return self.plant.exchange(wanted)

    def follow(self, kind: SetPoint, cycles: int = 1, **values: float) -> Readings:
        """The same set-point for all joints, for some cycles."""
        n = len(self.drives)
        if kind is SetPoint.IMPEDANCE:
            values = {"stiffness": 4.0, "damping": 1.0} | values
        rows = {name: np.full(n, value) for name, value in values.items()}
        wanted = SetPoints.off(n) if kind is SetPoint.OFF else set_points([kind] * n, **rows)
        for _ in range(cycles):
            found = self.tick(wanted)
        return found

    def until(
        self,
        reached: Callable[[Readings], bool],
        kind: SetPoint,
        cycles: int = 5000,
        **values: float,
    ) -> Readings:
        """Follow until something is so."""
        for _ in range(cycles):
            if reached(found := self.follow(kind, **values)):
                return found
        raise AssertionError(f"it never came; {found}")

    def recover(self) -> None:
        """Clear the faults, as often as the drives need it."""
        for _ in range(500):
            found = self.follow(SetPoint.OFF)
            if not any(found.faults):
                return
            for joint, fault in enumerate(found.faults):
                if fault:
                    self.plant.clear_fault(joint)
        raise AssertionError(f"it is never well: {found.faults}")

    def pass_time(self, seconds: float) -> None:
        """Time passes for the drives without frames from the board."""
        end = self.time + seconds
        while self.time < end:
            self.time = min(end, self.time + 0.015)
            self.bus.step([])
