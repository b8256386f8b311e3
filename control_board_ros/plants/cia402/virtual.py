# SPDX-License-Identifier: Apache-2.0
"""A virtual CiA 402 drive: object dictionary, SDO, NMT, PDOs, state machine, watchdog, faults.

SDO, NMT and PDO mapping are those of a ``LocalNode`` of the canopen library; what a drive does
with its objects is written from the standard.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import canopen
from canopen.objectdictionary import ODVariable

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.can_bus import VirtualCanBus
from . import objects as o
from .dictionary import (
    COUNTS,
    EMERGENCY_ID,
    ERROR_REGISTER,
    PRODUCER_HEARTBEAT,
    dictionary,
)
from .states import FAULT_RESET, TRANSITIONS, Mode, State, command_of

REV = 2.0 * math.pi
#: CiA 301, 7.5.2.2: bit 0 of the error register is set by any error.
GENERIC_ERROR = 1
#: Error code of CiA 402: DC link under-voltage; the share of the rated voltage is ours.
LOW_DC_LINK, UNDER_VOLTAGE = 0x3220, 0.4
#: Transmission types of PDOs that a drive sends by itself, and acts on at once; of the
#: manufacturer, and of the profile (CiA 301, table 72).
BY_EVENT = (254, 255)
#: s until another mode acts, and is displayed (CiA 402-2, 0x6061: it may differ from 0x6060).
MODE_TIME = 4e-3
#: Bits of the status word beside those of its state: voltage enabled, remote, and follows the
#: commands of a cyclic mode (CiA 402-2, 8.2.2 and tables of CSP, CSV and CST).
VOLTAGE, REMOTE_CONTROL, FOLLOWS = 1 << 4, 1 << 9, 1 << 12
_serials = itertools.count(1)
#: Modes whose commands it follows in each cycle.
FOLLOWED = (Mode.CSP, Mode.CSV, Mode.CST)


class Wires(canopen.Network):  # type: ignore[misc, unused-ignore]
    """Frames of a node, until they are fetched."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[tuple[int, bytes]] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Keep a frame."""
        del remote
        self.sent.append((can_id, bytes(data)))

    def send_periodic(self, *_: object, **__: object) -> SimpleNamespace:
        """Send nothing: the drive counts the time of its heartbeat itself."""
        return SimpleNamespace(stop=lambda: None, update=lambda _: None)


class VirtualCia402:
    """One drive; see ``virtual.world.VirtualDrive``.

    Args:
        drive: Its number.
        rated: Its rated torque, N·m.

    Attributes:
        state: Of its state machine.
        node: Of the library: its objects are ``node.sdo``.
        stiffness, damping, integral: Of its position loop, N·m/rad, N·m·s/rad, N·m/(rad·s); its
            velocity loop has the damping.
        supply, rated_supply: V, of its DC link; it trips below UNDER_VOLTAGE of what is rated.
        keeps_fault: It keeps the fault of its watchdog until its communication is reset, as an
            EPOS4.
        gear, yielding: Turns of its motor per turn of its output, and by how much the gear twists,
            rad/(N·m) at the output; its motor's encoder has COUNTS per turn.
    """

    def __init__(self, drive: int, rated: float = 2.0) -> None:
        self.id, self.rated, self.silent, self.persists = drive, rated, False, 0
        self.stiffness, self.damping, self.integral = 60.0, 3.0, 0.0
        self.gear, self.yielding, self.keeps_fault = 1.0, 0.0, False
        self.supply = self.rated_supply = 48.0
        self.stored: dict[int, int] = {}
        self._serial = next(_serials)
        self._position = self._velocity = self._hold = 0.0
        self.reboot()

    def reboot(self) -> None:
        self._wires = Wires()
        objects = dictionary(self.id)
        objects[o.IDENTITY][o.SERIAL].default = self._serial
        for index, value in {o.RATED_TORQUE: round(1e3 * self.rated), **self.stored}.items():
            objects[index].default = value
        self.node: Any = self._wires.add_node(canopen.LocalNode(self.id, objects))
        self.node.nmt.state = "PRE-OPERATIONAL"
        self.node.add_read_callback(self._reading)
        self._wires.sent = [(o.HEARTBEAT | self.id, bytes([o.BOOT_UP]))]
        self._fresh: list[Any] = []
        self._told: dict[int, bytes] = {}
        self._ages: dict[int, float] = {}
        self.mode, self._changing, self._own_beat = 0, 0.0, 0.0
        self._beat = self._since = math.nan
        self._rate = self._sum = self.torque = 0.0
        self._control, self.state = 0, State.SWITCH_ON_DISABLED
        self._error, self._fault_kept = 0, False
        if self.persists:
            self.fail(self.persists, persists=True)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self._error, self.persists = State.FAULT, code, code if persists else 0
        self._emergency(code)

    def _emergency(self, code: int) -> None:
        """An EMCY: error code, error register, five bytes of the maker; 0: no error any more."""
        where = self._value(EMERGENCY_ID) & 0x7FF
        if self.node.nmt.state in ("PRE-OPERATIONAL", "OPERATIONAL"):
            content = struct.pack("<HB5x", code, GENERIC_ERROR if code else 0)
            self._wires.sent.append((where, content))

    def unasked(self) -> Iterator[tuple[int, bytes]]:
        """Boot-up, EMCY, its heartbeat, and PDOs by event."""
        if self.silent:
            return
        if self.node.nmt.state == "OPERATIONAL":
            self._send_events()
        period = 1e-3 * self._value(PRODUCER_HEARTBEAT)
        if 0.0 < period <= self._own_beat:
            self._own_beat = 0.0
            self._wires.sent.append((o.HEARTBEAT | self.id, bytes([self.node.nmt._state])))
        sent, self._wires.sent = self._wires.sent, []
        yield from sent

    def _send_events(self) -> None:
        for number, pdo in self.node.tpdo.map.items():
            if not (pdo.enabled and pdo.trans_type in BY_EVENT):
                continue
            for item in pdo.map:
                item.set_data(self.node.get_data(item.index, item.subindex))
            data, age = bytes(pdo.data), self._ages.get(number, math.inf)
            timer = 1e-3 * (pdo.event_timer or 0)
            changed = data != self._told.get(number) and age >= 1e-4 * (pdo.inhibit_time or 0)
            if changed or 0.0 < timer <= age:
                self._told[number], self._ages[number] = data, 0.0
                pdo.transmit()

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent:
            return
        before = self.node.nmt.state
        self._wires.notify(frame_id, bytearray(data), 0.0)
        if self.node.nmt.state == "INITIALISING":  # reset, of communication or all
            kept = (self.state, self._error) if data[0] == o.RESET_COMMUNICATION else None
            self.reboot()
            self.state, self._error = kept or (self.state, self._error)
            self._fault_kept = False
        elif self.node.nmt.state == "OPERATIONAL" != before:
            self._start()
        if frame_id == o.SYNC and self.node.nmt.state == "OPERATIONAL":
            self._on_sync()
        elif (
            frame_id & 0x780 == o.HEARTBEAT
            and frame_id & 0x7F == self._value(o.CONSUMER_HEARTBEAT, 1) >> 16 & 0x7F
        ):
            self._beat = 0.0
        elif frame_id == o.SDO_REQUEST | self.id and data[1:3] == struct.pack("<H", o.CONTROL):
            self._obey(self._value(o.CONTROL))
        sent, self._wires.sent = self._wires.sent, []
        yield from sent

    def _start(self) -> None:
        """PDOs as they are mapped now."""
        for pdos in (self.node.rpdo, self.node.tpdo):
            pdos.read()
        for pdo in self.node.rpdo.map.values():
            at_once = pdo.trans_type in BY_EVENT
            pdo.callbacks[:] = [self._act if at_once else self._fresh.append]
        self._told.clear()

    def _act(self, pdo: Any) -> None:
        """Take the values of a received PDO."""
        for item in pdo.map:
            self.node.data_store.setdefault(item.index, {})[item.subindex] = item.get_data()
        if pdo.trans_type in BY_EVENT:
            self._obey(self._value(o.CONTROL))

    def _on_sync(self) -> None:
        """Received PDOs act; those sent hold the values from before."""
        live = [p for p in self.node.tpdo.map.values() if p.enabled and p.trans_type == 1]
        for pdo in live:
            for item in pdo.map:
                item.set_data(self.node.get_data(item.index, item.subindex))
        before = self._value(o.TARGET_POSITION)
        for pdo in self._fresh:
            self._act(pdo)
        if self._fresh:
            self._obey(self._value(o.CONTROL))
        self._fresh.clear()
        moved = (self._value(o.TARGET_POSITION) - before) * REV / COUNTS
        self._rate = moved / self._since if self._since > 0.0 else 0.0
        self._since = 0.0
        for pdo in live:
            pdo.transmit()

    def _obey(self, control: int) -> None:
        rising = control & FAULT_RESET and not self._control & FAULT_RESET
        self._control = control
        if self.state is State.FAULT:
            if rising and not self.persists and not self._fault_kept:
                self.state, self._error = State.SWITCH_ON_DISABLED, 0
                self._emergency(0)
            return
        state = TRANSITIONS.get((self.state, command_of(control)), self.state)
        if state is State.OPERATION_ENABLED and state is not self.state:
            self._sum = self._rate = 0.0
        self.state = state

    def _reading(self, index: int, **_: object) -> int | None:
        """What its objects read, where it is no stored value."""
        if index == o.STATUS:
            on = self.state is State.OPERATION_ENABLED and self.mode in FOLLOWED
            return self.state.word | VOLTAGE | REMOTE_CONTROL | (FOLLOWS if on else 0)
        read = MEASURED.get(index)
        return None if read is None else round(read(self))

    def _value(self, index: int, subindex: int = 0) -> int:
        """What is stored of an object, or its default."""
        entry = self.node.object_dictionary[index]
        item = entry if isinstance(entry, ODVariable) else entry[subindex]
        stored = self.node.data_store.get(index, {}).get(subindex)
        return int(item.default if stored is None else item.decode_raw(stored))

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position, velocity
        self._since += seconds
        self._beat += seconds
        self._own_beat += seconds
        for number in self._ages:
            self._ages[number] += seconds
        self._change_mode(seconds)
        if self.supply < UNDER_VOLTAGE * self.rated_supply and self.state is not State.FAULT:
            self.fail(LOW_DC_LINK)
        if self._beat > 1e-3 * (self._value(o.CONSUMER_HEARTBEAT, 1) & 0xFFFF):
            self._beat = math.nan
            self._miss()
        most = 1e-3 * self._value(o.MAX_TORQUE) * self.rated
        self.torque = max(-most, min(most, self._torque(seconds)))
        return self.torque

    def _change_mode(self, seconds: float) -> None:
        wanted = self._value(o.MODE)
        self._changing = self._changing + seconds if wanted != self.mode else 0.0
        if self._changing > MODE_TIME:
            self.mode, self._changing = wanted, 0.0
            self._sum = self._rate = 0.0

    def _miss(self) -> None:
        """No heartbeat came for too long."""
        if self._value(o.ERROR_BEHAVIOUR, 1) != 1:
            self.node.nmt._state = 127
        option = self._value(o.ABORT_OPTION)
        if option == o.FAULT_SIGNAL:
            self.fail(o.HEARTBEAT_LOST)
            self._fault_kept = self.keeps_fault
        elif option == o.QUICK_STOP and self.state is State.OPERATION_ENABLED:
            self.state, self._hold = State.QUICK_STOP_ACTIVE, self._position

    def _torque(self, seconds: float) -> float:
        if self.state is State.QUICK_STOP_ACTIVE:
            return self.stiffness * (self._hold - self._position) - self.damping * self._velocity
        if self.state is not State.OPERATION_ENABLED:
            return 0.0
        mode = self.mode
        forward = 1e-3 * self._value(o.TORQUE_OFFSET) * self.rated
        if mode == Mode.CST:
            return forward + 1e-3 * self._value(o.TARGET_TORQUE) * self.rated
        if mode == Mode.CSV:
            goal = self._value(o.TARGET_VELOCITY) * REV / COUNTS
            return forward + self.damping * (goal - self._velocity)
        if mode != Mode.CSP:
            return 0.0
        error = self._value(o.TARGET_POSITION) * REV / COUNTS - self._position
        self._sum += self.integral * error * seconds
        bound = 1e-3 * self._value(o.MAX_TORQUE) * self.rated
        self._sum = max(-bound, min(bound, self._sum))
        damped = self.damping * (self._rate - self._velocity)
        return forward + self.stiffness * error + damped + self._sum


#: What objects read that are no stored values.
MEASURED: dict[int, Callable[[VirtualCia402], float]] = {
    o.ERROR_CODE: lambda drive: drive._error,
    ERROR_REGISTER: lambda drive: GENERIC_ERROR if drive._error else 0,
    o.MODE_DISPLAY: lambda drive: drive.mode,
    o.SUPPLY: lambda drive: 1e3 * drive.supply,
    o.POSITION: lambda drive: drive._position * COUNTS / REV,
    o.VELOCITY: lambda drive: drive._velocity * COUNTS / REV,
    o.MOTOR_POSITION: lambda drive: (
        drive.gear * (drive._position + drive.yielding * drive.torque) * COUNTS / REV
    ),
    o.TORQUE: lambda drive: 1e3 * drive.torque / drive.rated,
}


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualCia402:
    if joint is None:
        return VirtualCia402(axis.id)
    limits, ratio, gains = joint.limits, axis.ratio, joint.position_pid
    made = VirtualCia402(axis.id, limits.torque / ratio)
    made.stored = {
        o.MAX_TORQUE: 1200,
        o.MAX_SPEED: math.ceil(1.5 * limits.velocity * ratio / REV * 60.0),
    }
    made.supply = made.rated_supply = joint.motor.supply_voltage
    made.stiffness, made.damping = gains.kp / ratio**2, gains.kd / ratio**2
    made.integral = gains.ki / ratio**2
    made.reboot()
    return made


virtual_bus = VirtualCanBus
