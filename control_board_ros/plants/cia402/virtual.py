# SPDX-License-Identifier: Apache-2.0
"""A virtual CiA 402 drive: object dictionary, SDO, NMT, PDOs, state machine, watchdog, faults.

SDO, NMT and PDO mapping are those of a ``LocalNode`` of the canopen library; what a drive does
with its objects is written from the standard.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Iterator
from typing import Any

import canopen
from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable, datatypes

from ...core.config.config import JointConfig
from ..drives.axes import Axis
from ..virtual.can_bus import VirtualCanBus
from . import objects as o
from .states import FAULT_RESET, TRANSITIONS, Mode, State, command_of

REV = 2.0 * math.pi
COUNTS = 1 << 17
PRODUCER_HEARTBEAT = 0x1017
_serials = itertools.count(1)
U8, U16, U32 = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32
I8, I16, I32 = datatypes.INTEGER8, datatypes.INTEGER16, datatypes.INTEGER32
TEXT = datatypes.VISIBLE_STRING
#: Index, type, value at start, and whether it may be written.
VARIABLES: tuple[tuple[int, int, int | str, bool], ...] = (
    (o.DEVICE_TYPE, U32, o.SERVO, False),
    (o.DEVICE_NAME, TEXT, "virtual CiA 402", False),
    (o.SOFTWARE, TEXT, "1.0", False),
    (PRODUCER_HEARTBEAT, U16, 0, False),
    (o.ABORT_OPTION, I16, 0, True),
    (o.ERROR_CODE, U16, 0, False),
    (o.CONTROL, U16, 0, True),
    (o.STATUS, U16, 0x40, False),
    (o.QUICK_STOP_OPTION, I16, 2, True),
    (o.FAULT_OPTION, I16, 2, True),
    (o.MODE, I8, 0, True),
    (o.MODE_DISPLAY, I8, 0, False),
    (o.POSITION, I32, 0, False),
    (o.VELOCITY, I32, 0, False),
    (o.TARGET_TORQUE, I16, 0, True),
    (o.MAX_TORQUE, U16, 2000, True),
    (o.RATED_TORQUE, U32, 2000, False),
    (o.TORQUE, I16, 0, False),
    (o.SUPPLY, U32, 48000, False),
    (o.TARGET_POSITION, I32, 0, True),
    (o.MAX_SPEED, U32, 3000, True),
    (o.TORQUE_OFFSET, I16, 0, True),
    (o.TARGET_VELOCITY, I32, 0, True),
    (o.SUPPORTED_MODES, U32, 0x380, False),
    (o.MOTOR_POSITION, I32, 0, False),
)
ARRAYS: tuple[tuple[int, int, tuple[int, ...], bool], ...] = (
    (o.CONSUMER_HEARTBEAT, U32, (0,), True),
    (o.IDENTITY, U32, (0, 0, 0, 0), False),
    (o.ERROR_BEHAVIOUR, U8, (0,), True),
    (o.POSITION_LIMITS, I32, (0, 0), True),
    (o.RESOLUTION, U32, (COUNTS, 1), False),
)


def dictionary(drive: int) -> ObjectDictionary:
    """The objects of a drive with this number, PDOs mapped as its maker left them."""
    made = ObjectDictionary()
    made.node_id = drive
    for index, kind, value, writable in VARIABLES:
        made.add_object(_variable(index, 0, kind, value, writable))
    for index, kind, values, writable in ARRAYS:
        array = ODArray(f"0x{index:04x}", index)
        array.add_member(_variable(index, 0, U8, len(values), writable=False))
        for place, number in enumerate(values, start=1):
            array.add_member(_variable(index, place, kind, number, writable))
        made.add_object(array)
    for function, index in o.PARAMETERS.items():
        only = o.CONTROL if function in (o.RPDO1, o.RPDO2) else o.STATUS
        parameters = ODRecord(f"0x{index:04x}", index)
        mapping = ODArray(f"0x{index + 0x200:04x}", index + 0x200)
        for place, (kind, value) in enumerate(((U8, 2), (U32, function + drive), (U8, 255))):
            parameters.add_member(_variable(index, place, kind, value))
        for place, (kind, value) in enumerate(((U8, 1), (U32, only << 16 | 16), *[(U32, 0)] * 7)):
            mapping.add_member(_variable(index + 0x200, place, kind, value))
        made.add_object(parameters)
        made.add_object(mapping)
    return made


def _variable(
    index: int, subindex: int, kind: int, value: int | str, writable: bool = True
) -> ODVariable:
    made = ODVariable(f"0x{index:04x}:{subindex}", index, subindex)
    made.data_type, made.default = kind, value
    made.access_type = "rw" if writable else "ro"
    return made


class Wires(canopen.Network):  # type: ignore[misc, unused-ignore]
    """Frames of a node, until they are fetched."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[tuple[int, bytes]] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Keep a frame."""
        del remote
        self.sent.append((can_id, bytes(data)))


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
        gear, yielding: Turns of its motor per turn of its output, and by how much the gear twists,
            rad/(N·m) at the output; its motor's encoder has COUNTS per turn.
    """

    def __init__(self, drive: int, rated: float = 2.0) -> None:
        self.id, self.rated, self.silent, self.persists = drive, rated, False, 0
        self.stiffness, self.damping, self.integral = 60.0, 3.0, 0.0
        self.gear, self.yielding = 1.0, 0.0
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
        self._beat = self._since = math.nan
        self._rate = self._sum = self.torque = 0.0
        self._control, self.state = 0, State.SWITCH_ON_DISABLED
        self._error = 0
        if self.persists:
            self.fail(self.persists, persists=True)

    def fail(self, code: int, *, persists: bool = False) -> None:
        self.state, self._error, self.persists = State.FAULT, code, code if persists else 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        if self.silent:
            return
        before = self.node.nmt.state
        self._wires.notify(frame_id, bytearray(data), 0.0)
        if self.node.nmt.state == "INITIALISING":  # reset, of communication or all
            self.reboot()
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
            pdo.callbacks[:] = [self._fresh.append]

    def _on_sync(self) -> None:
        """Received PDOs act; those sent hold the values from before."""
        live = [p for p in self.node.tpdo.map.values() if p.enabled and p.trans_type == 1]
        for pdo in live:
            for item in pdo.map:
                item.set_data(self.node.get_data(item.index, item.subindex))
        before = self._value(o.TARGET_POSITION)
        for pdo in self._fresh:
            for item in pdo.map:
                self.node.data_store.setdefault(item.index, {})[item.subindex] = item.get_data()
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
            if rising and not self.persists:
                self.state, self._error = State.SWITCH_ON_DISABLED, 0
            return
        state = TRANSITIONS.get((self.state, command_of(control)), self.state)
        if state is State.OPERATION_ENABLED and state is not self.state:
            self._sum = self._rate = 0.0
        self.state = state

    def _reading(self, index: int, **_: object) -> int | None:
        """What its objects read, where it is no stored value."""
        if index == o.STATUS:
            return self.state.word
        if index == o.ERROR_CODE:
            return self._error
        if index == o.MODE_DISPLAY:
            return self._value(o.MODE)
        turns = {
            o.POSITION: self._position,
            o.VELOCITY: self._velocity,
            o.MOTOR_POSITION: self.gear * (self._position + self.yielding * self.torque),
        }
        if index in turns:
            return round(turns[index] * COUNTS / REV)
        return round(1e3 * self.torque / self.rated) if index == o.TORQUE else None

    def _value(self, index: int, subindex: int = 0) -> int:
        found = self.node.object_dictionary[index]
        item = found if isinstance(found, ODVariable) else found[subindex]
        return int(item.decode_raw(self.node.get_data(index, subindex)))

    def step(self, seconds: float, position: float, velocity: float) -> float:
        self._position, self._velocity = position, velocity
        self._since += seconds
        self._beat += seconds
        if self._beat > 1e-3 * (self._value(o.CONSUMER_HEARTBEAT, 1) & 0xFFFF):
            self._beat = math.nan
            self._miss()
        most = 1e-3 * self._value(o.MAX_TORQUE) * self.rated
        self.torque = max(-most, min(most, self._torque(seconds)))
        return self.torque

    def _miss(self) -> None:
        """No heartbeat came for too long."""
        if self._value(o.ERROR_BEHAVIOUR, 1) != 1:
            self.node.nmt._state = 127
        option = self._value(o.ABORT_OPTION)
        if option == o.FAULT_SIGNAL:
            self.fail(o.HEARTBEAT_LOST)
        elif option == o.QUICK_STOP and self.state is State.OPERATION_ENABLED:
            self.state, self._hold = State.QUICK_STOP_ACTIVE, self._position

    def _torque(self, seconds: float) -> float:
        if self.state is State.QUICK_STOP_ACTIVE:
            return self.stiffness * (self._hold - self._position) - self.damping * self._velocity
        if self.state is not State.OPERATION_ENABLED:
            return 0.0
        mode = self._value(o.MODE)
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


def virtual_drive(axis: Axis, joint: JointConfig | None) -> VirtualCia402:
    if joint is None:
        return VirtualCia402(axis.id)
    limits, ratio, gains = joint.limits, axis.ratio, joint.position_pid
    made = VirtualCia402(axis.id, limits.torque / ratio)
    made.stored = {
        o.MAX_TORQUE: 1200,
        o.MAX_SPEED: math.ceil(1.5 * limits.velocity * ratio / REV * 60.0),
        o.SUPPLY: round(1e3 * joint.motor.supply_voltage),
    }
    made.stiffness, made.damping = gains.kp / ratio**2, gains.kd / ratio**2
    made.integral = gains.ki / ratio**2
    made.reboot()
    return made


virtual_bus = VirtualCanBus
