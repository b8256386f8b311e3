# SPDX-License-Identifier: Apache-2.0
"""Explores a driver: a script of modes with one fault of wire or drive, anywhere in it (S8, S11).

The board is reduced to what matters here: a fault latches OFF until it is cleared. While every
set-point is "stay where you are", three things must hold whatever the fault:

* the law that acts in a drive is that asked for, or a fault is reported, within the timeout;
* nothing moves by more than STILL;
* a drive has no power when the board says OFF, within the timeout.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from drive_bench import PERIOD, Bench

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.cia402 import objects
from control_board_ros.plants.cia402.states import Mode, State
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.odrive_can import frames as odrive
from control_board_ros.plants.virtual.can_bus import Frame
from control_board_ros.testing.plant_contract import set_points

OFF = SetPoint.OFF
#: plant_timeout here, s, and its exchanges; more that a law may take after it.
TIMEOUT, GRACE = 0.04, 8
CYCLES = round(TIMEOUT / PERIOD)
#: Where the joints are at rest, rad, and how far they may move.
PLACE, STILL = 0.3, 2e-3


class Event(NamedTuple):
    """A fault: what, to or from the drives, at which frame or exchange, for how many of these."""

    what: str
    way: str = ""
    at: int = 0
    length: int = 1


@dataclass
class Wire:
    """One way of a bus, with at most one fault; it counts its frames."""

    event: Event | None = None
    count: int = 0
    shut: bool = False
    keeps: bool = False
    held: list[Frame] = field(default_factory=list)

    def __call__(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        event = self.event
        for frame in frames:
            self.count += 1
            if self.keeps:
                self.held.append(frame)
            elif not self.shut:
                mine = event is not None and event.at == self.count
                if mine and event is not None and event.what in ("delay", "reorder"):
                    self.held.append(frame)
                elif not mine or (event is not None and event.what == "double"):
                    yield frame
                    if mine:
                        yield frame
                    elif self.held and event is not None and event.what == "reorder":
                        yield self.held.pop()


class Run:
    """One run of the script.

    Args:
        driver: Its folder's name.
        options: Of the driver.
        event: The fault, or None.

    Attributes: violations (in words), frames (sent, by way and exchange), cycle.
    """

    def __init__(self, driver: str, options: dict[str, str], event: Event | None = None) -> None:
        self.event, self.violations = event, dict[str, None]()
        self.cycle, self._wrong = 0, [0, 0]
        self.frames: list[tuple[int, int]] = []
        self._bench = Bench(driver, options=options)
        self._bench.timeout = TIMEOUT
        self._latched = [False, False]
        self._wires = {"to": Wire(), "from": Wire()}

    def go(self) -> Run:
        """Run the script, and collect what is violated."""
        bench, event = self._bench, self.event
        with bench:
            bench.world.state[0] = PLACE
            bench.bus.step([])
            bench.connect()
            bench.bus.to_drives, bench.bus.from_drives = self._wires["to"], self._wires["from"]
            if event is not None and event.way:
                self._wires[event.way].event = event
            kinds = bench.accepts
            for kind in (OFF, *kinds[:3], kinds[0], OFF):
                self._phase(kind, CYCLES + 14)
            self._recover()
            self._phase(kinds[0], CYCLES + 14)
            self._phase(OFF, CYCLES + GRACE)
        return self

    def _recover(self) -> None:
        for _ in range(4 * CYCLES):
            faults = self._exchange(OFF)
            self._latched = [bool(fault) for fault in faults]
            if not any(faults):
                return
            for joint, fault in enumerate(faults):
                if fault:
                    self._bench.plant.clear_fault(joint)

    def _phase(self, kind: SetPoint, cycles: int) -> None:
        for _ in range(cycles):
            for joint, fault in enumerate(self._exchange(kind)):
                self._latched[joint] = self._latched[joint] or bool(fault)

    def _exchange(self, kind: SetPoint) -> list[Any]:
        bench = self._bench
        self.cycle += 1
        self._strike()
        kinds = [OFF if latched else kind for latched in self._latched]
        place, stiffness, damping = np.full((3, 2), [[PLACE], [4.0], [1.0]])
        wanted = set_points(kinds, position=place, stiffness=stiffness, damping=damping)
        faults = list(bench.tick(wanted).faults)
        self.frames.append((self._wires["to"].count, self._wires["from"].count))
        for joint, drive in enumerate(bench.drives):
            asked, acts = kinds[joint], law_of(drive)
            off = asked is OFF or bool(faults[joint])
            right = acts in (OFF, None) if off else acts is asked or acts is None
            self._wrong[joint] = 0 if right else self._wrong[joint] + 1
            reached = self._unreached(drive)
            if self._wrong[joint] > CYCLES + GRACE and not reached:
                self._violate(f"asked {asked.name}, acts {acts.name if acts else acts}, "
                              f"fault {faults[joint]}")  # fmt: skip
        moved = float(np.abs(bench.world.state[0] - PLACE).max())
        if moved > STILL:
            self._violate(f"moved while it was {kind.name}")
        return faults

    def _unreached(self, drive: Any) -> bool:
        """Whether nothing gets to a drive now: what has no watchdog goes on."""
        return self._wires["to"].shut and law_of(drive) is not None

    def _violate(self, text: str) -> None:
        self.violations.setdefault(text)

    def _strike(self) -> None:
        """Faults by exchange: begin or end."""
        event, wires = self.event, self._wires
        for wire in wires.values():
            if wire.held and not wire.keeps and wire.event and wire.event.what == "delay":
                late, wire.held = wire.held, []
                self._deliver(wire, late)
        if event is None:
            return
        begins, ends = self.cycle == event.at, self.cycle == event.at + event.length
        if event.what in ("deaf", "mute"):
            wire = wires["to" if event.what == "deaf" else "from"]
            wire.shut = (wire.shut or begins) and not ends
        elif event.what in ("hold", "hold and restart"):
            wires["to"].keeps = (wires["to"].keeps or begins) and not ends
            if ends:
                if event.what == "hold and restart":
                    self._bench.drives[0].reboot()
                late, wires["to"].held = wires["to"].held, []
                self._bench.bus.step(late)
        elif event.what == "restart" and begins:
            self._bench.drives[0].reboot()
        elif event.what == "fault" and begins:
            self._bench.fail(0)

    def _deliver(self, wire: Wire, late: list[Frame]) -> None:
        wire.event = None
        if wire is self._wires["to"]:
            self._bench.bus.step(late)
        else:
            self._bench.arrive(late)


def law_of(drive: Any) -> SetPoint | None:  # noqa: PLR0911 - one for each make
    """What acts in a virtual drive; None: nothing that drives, as after its watchdog."""
    name = type(drive).__name__
    if name == "VirtualMoteus":
        return {10: _moteus(drive), 9: SetPoint.CURRENT, 8: SetPoint.PWM, 11: None}.get(
            drive.mode, OFF
        )
    if name in ("VirtualMit", "VirtualRobStride"):
        if drive.state != 1:
            return OFF
        return SetPoint.IMPEDANCE if any(drive._command[2:4]) else SetPoint.TORQUE
    if name == "VirtualOdrive":
        modes = {odrive.POSITION_CONTROL: SetPoint.POSITION,
                 odrive.VELOCITY_CONTROL: SetPoint.VELOCITY,
                 odrive.TORQUE_CONTROL: SetPoint.TORQUE}  # fmt: skip
        return modes[drive._control] if drive.state == odrive.CLOSED_LOOP else OFF
    if name == "VirtualCia402":
        laws = {Mode.CSP: SetPoint.POSITION, Mode.CSV: SetPoint.VELOCITY,
                Mode.CST: SetPoint.TORQUE}  # fmt: skip
        on = drive.state is State.OPERATION_ENABLED
        return laws.get(drive._value(objects.MODE), OFF) if on else OFF
    table: Any = dynamixel if name == "VirtualDynamixel" else feetech
    if not drive.table.get(table.TORQUE):
        return OFF
    if table is dynamixel and drive.table.get(dynamixel.WATCHDOG) == dynamixel.TRIPPED:
        return None
    positions = {dynamixel.EXTENDED: SetPoint.POSITION, dynamixel.POSITION_MODE: SetPoint.POSITION}
    servo = {dynamixel.VELOCITY_MODE: SetPoint.VELOCITY, dynamixel.CURRENT_MODE: SetPoint.CURRENT,
             dynamixel.PWM_MODE: SetPoint.PWM}  # fmt: skip
    if table is feetech:
        positions = {feetech.POSITION_MODE: SetPoint.POSITION}
        servo = {feetech.VELOCITY_MODE: SetPoint.VELOCITY, feetech.PWM_MODE: SetPoint.PWM}
    return (positions | servo)[drive.table.get(table.MODE)]


def _moteus(drive: Any) -> SetPoint:
    command = drive._command
    if command[0x23] == 0.0 and command[0x24] == 0.0:
        return SetPoint.TORQUE
    if command[0x20] != command[0x20]:
        return SetPoint.VELOCITY
    return SetPoint.POSITION if command[0x2B] else SetPoint.IMPEDANCE


def single_faults(plain: Run, stride: int = 1) -> Iterator[Event]:
    """Every single fault of a script, by a run without one; of each kind one of ``stride``."""
    counts = plain.frames[-1]
    events = [
        Event(what, way, number)
        for what in ("lose", "double", "delay", "reorder")
        for way, most in zip(("to", "from"), counts, strict=True)
        for number in range(1, most + 1)
    ]
    events += [
        Event(what, at=cycle, length=length)
        for what in ("deaf", "mute", "hold", "hold and restart")
        for length in (CYCLES // 2, 2 * CYCLES)
        for cycle in range(1, plain.cycle, 3)
    ]
    events += [Event(what, at=cycle) for what in ("restart", "fault")
               for cycle in range(1, plain.cycle)]  # fmt: skip
    return iter(events[stride // 2 :: stride])
