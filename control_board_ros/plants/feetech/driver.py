# SPDX-License-Identifier: Apache-2.0
"""Feetech STS servos by their maker's library: one sync write and one sync read for a whole bus.

They have no watchdog: a servo that hears nothing goes on with what it heard last. Of a position
that is to be held; velocities and PWM are offered with ``unwatched=1`` only. A kind of set-point
is an operating mode, changed without torque, and not stored. Positions go without velocity and
feed-forward.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence
from typing import Any

from ...core.config.config import JointConfig
from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Array
from ...core.terms.set_points import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, PATIENCE, budget
from ..drives.maker import maker, only
from ..drives.plant import RESTARTED, Answers, Found, Traits
from ..drives.serial_line import open_port, settle
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

MODES = {
    SetPoint.POSITION: t.POSITION_MODE,
    SetPoint.VELOCITY: t.VELOCITY_MODE,
    SetPoint.PWM: t.PWM_MODE,
}
IDS = range(253)
#: Answers without torque, until a servo that should have it is taken to have started anew.
UNPOWERED = 5


class FeetechDrives:
    """The servos of one bus; see ``drives.plant.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self.traits = Traits(
            set_points=tuple(MODES) if options.own["unwatched"] else (SetPoint.POSITION,),
            on_silence=(OnSilence.BRAKED,),
            resolution=t.COUNT,
            current=True,
            temperature=True,
            voltage=True,
            watchdog=False,
        )
        self._port: Any = None
        self._places = {axis.id: k for k, axis in enumerate(self._axes)}
        n = len(self._axes)
        self._kinds, self._modes = [SetPoint.OFF] * n, [t.POSITION_MODE] * n
        self._torque, self._without = [0] * n, [0] * n
        self._had, self._restarted = [False] * n, [False] * n

    def open(self, setup: Setup, _joints: Sequence[JointConfig | None]) -> list[Found]:
        """Open the port; see ``drives.plant.Driver``."""
        self._port, self._protocol = connect(self._options.bus, int(self._options.own["baudrate"]))
        self._port.wait = PATIENCE
        found = []
        for k, axis in enumerate(self._axes):
            told = identify(self._port, self._protocol, axis.id)
            only(told, axis, self._options.bus, "feetech")
            found.append(self._set_up(k))
        self._port.wait = budget(setup.period)
        return found

    def _set_up(self, k: int) -> Found:
        """No torque, no ramps; returns what it is."""
        drive, name = self._axes[k].id, self._axes[k].name
        number = self._get(drive, t.MODEL)
        if number not in t.MODELS:
            raise PlantSettingsError(
                f"{name}: id {drive} is of model {number}; supported: "
                + ", ".join(t.MODELS.values())
            )
        # Behind the lock a mode acts, and is not stored.
        for item, value in ((t.TORQUE, 0), (t.LOCK, 1), (t.ACCELERATION, 0)):
            self._put(drive, item, value)
        self._put(drive, t.MODE, t.POSITION_MODE)
        self._kinds[k], self._modes[k], self._restarted[k] = SetPoint.OFF, t.POSITION_MODE, False
        self._torque[k], self._without[k], self._had[k] = 0, 0, False
        status, firmware = self._get(drive, t.STATUS), self._get(drive, t.FIRMWARE)
        lower, upper = self._get(drive, t.MIN_POSITION), self._get(drive, t.MAX_POSITION)
        return Found(
            id=drive,
            type=t.MODELS[number],
            firmware=f"{firmware & 0xFF}.{firmware >> 8}",
            voltage=self._get(drive, t.VOLTAGE) * t.VOLT,
            fault=DriveFault(status, t.error_name(status)) if status else None,
            limits=DriveLimits(
                lower=angle(lower) if lower < upper else None,
                upper=angle(upper) if lower < upper else None,
                velocity=self._get(drive, t.SPEED_LIMIT) * t.SPEED_LIMIT_STEP * t.COUNT or None,
                current=self._get(drive, t.CURRENT_LIMIT) * t.AMPERE or None,
            ),
        )

    def exchange(self, kinds: Sequence[int | None], values: Array, answers: Answers) -> None:
        """Set-points and answers; see ``drives.plant.Driver``."""
        if self._port is None:
            raise ConnectionError("the port is not open")
        columns = values.T.tolist()
        wanted = {
            k: SetPoint.OFF if self._restarted[k] else SetPoint(kind)
            for k, kind in enumerate(kinds)
            if kind is not None
        }
        powered = {k: kind for k, kind in wanted.items() if kind is not SetPoint.OFF}
        modes = {k: MODES[kind] for k, kind in powered.items() if MODES[kind] != self._modes[k]}
        self._sync(t.TORQUE, {k: bytes(1) for k in modes})
        self._sync(t.MODE, {k: bytes([mode]) for k, mode in modes.items()})
        self._sync(t.GOALS, {k: goals(kind, columns[k]) for k, kind in powered.items()})
        # Anew, while the answers tell otherwise; but no torque to one that had it, and lost it.
        switches = {
            k: bytes([k in powered])
            for k, kind in wanted.items()
            if k in modes
            or kind is not self._kinds[k]
            or (self._torque[k] != (k in powered) and not self._had[k])
        }
        self._sync(t.TORQUE, switches)
        for k, kind in wanted.items():
            if kind is not self._kinds[k]:
                self._kinds[k], self._without[k], self._had[k] = kind, 0, False
            self._modes[k] = modes.get(k, self._modes[k])
        self._read([k for k, kind in enumerate(kinds) if kind is not None], answers)

    def clear_fault(self, drive: int) -> Found | None:
        """Torque off resets what a servo shut down for; one that started anew is set up again."""
        anew = None
        axis = self._axes[drive].id
        if self._restarted[drive]:
            if identify(self._port, self._protocol, axis, attempts=1):
                anew = self._set_up(drive)
        else:
            self._put(axis, t.TORQUE, 0)
        return anew

    def close(self) -> None:
        """Torque off, and leave the port."""
        port, self._port = self._port, None
        if port is not None:
            try:
                everybody = [byte for axis in self._axes for byte in (axis.id, 0)]
                self._protocol.syncWriteTxOnly(port, *t.TORQUE, everybody, len(everybody))
            finally:
                port.closePort()

    def _sync(self, item: t.Item, values: Mapping[int, bytes]) -> None:
        """The same item of several servos at once; nobody answers."""
        if values:
            data = [byte for k, value in values.items() for byte in (self._axes[k].id, *value)]
            self._protocol.syncWriteTxOnly(self._port, *item, data, len(data))

    def _read(self, drives: Sequence[int], answers: Answers) -> None:
        """What is read of each."""
        if not drives:
            return
        self._port.setPacketTimeoutMillis(0.0)
        while self._port.getBytesAvailable() >= SHORTEST:  # too late, or of a second servo
            packet, result = self._protocol.rxPacket(self._port)
            if result != 0:
                break
            self._take(packet, answers)
        left = [self._axes[k].id for k in drives]
        self._protocol.syncReadTx(self._port, *t.READ, left, len(left))
        self._port.setPacketTimeout(0)
        while left:
            packet, result = self._protocol.rxPacket(self._port)
            if result == 0:
                if (drive := self._take(packet, answers)) in left:
                    left.remove(drive)
                continue
            answers.malformed += bool(packet)
            if self._port.isPacketTimeout():
                break
        self._port.is_using = False

    def _take(self, packet: Sequence[int], answers: Answers) -> int:
        drive, data = packet[2], bytes(packet[5:-1])
        if (k := self._places.get(drive)) is None:
            answers.foreign += 1
        elif len(data) != t.READ.length:
            answers.malformed += 1
        else:
            self._torque[k] = part(data, t.TORQUE)
            answers.faults[k] = self._judge(k, part(data, t.STATUS))
            answers.position[k] = angle(part(data, t.POSITION))
            answers.velocity[k] = t.signed(part(data, t.VELOCITY)) * t.COUNT
            answers.current[k] = t.signed(part(data, t.CURRENT)) * t.AMPERE
            answers.voltage[k] = part(data, t.VOLTAGE) * t.VOLT
            answers.temperature[k] = part(data, t.TEMPERATURE)
            answers.came(k, data)
        return drive

    def _judge(self, k: int, status: int) -> DriveFault | None:
        if status:
            return DriveFault(status, t.error_name(status))
        powered = self._kinds[k] is not SetPoint.OFF
        self._had[k] = powered and (self._had[k] or bool(self._torque[k]))
        self._without[k] = self._without[k] + 1 if powered and not self._torque[k] else 0
        if self._without[k] >= UNPOWERED:
            self._restarted[k] = True
        return RESTARTED if self._restarted[k] else None

    def _get(self, drive: int, item: t.Item) -> int:
        for attempt in range(4 * ATTEMPTS):
            settle(self._port, attempt)
            data, result, _ = self._protocol.readTxRx(self._port, drive, *item)
            if result == 0 and len(data) == item.length:
                return int.from_bytes(bytes(data), "little")
        raise ConnectionError(f"id {drive} does not answer; is it powered?")

    def _put(self, drive: int, item: t.Item, value: int) -> None:
        data = list(value.to_bytes(item.length, "little"))
        for attempt in range(4 * ATTEMPTS):
            settle(self._port, attempt)
            result, _ = self._protocol.writeTxRx(self._port, drive, *item, data)
            if result == 0:
                return
        raise ConnectionError(f"id {drive} does not answer; is it powered?")


#: Bytes of the shortest packet.
SHORTEST = 6


def part(data: bytes, item: t.Item) -> int:
    """A number of what is read in each exchange."""
    place = item.address - t.READ.address
    return int.from_bytes(data[place : place + item.length], "little")


def angle(count: int) -> float:
    """Rad at the output for counts; 0 in the middle of the turn."""
    return (t.signed(count) - t.CENTRE) * t.COUNT


def goals(kind: SetPoint, value: Sequence[float]) -> bytes:
    """Goal position, time or PWM, and velocity of a kind of set-point."""
    position = pwm = velocity = 0
    if kind is SetPoint.POSITION:
        position = t.magnitude(value[Value.POSITION] / t.COUNT + t.CENTRE)
    elif kind is SetPoint.VELOCITY:
        velocity = t.magnitude(value[Value.VELOCITY] / t.COUNT)
    else:
        output = max(-100.0, min(100.0, value[Value.PWM]))
        pwm = t.magnitude(output / 100.0 * t.FULL_PWM, t.PWM_SIGN)
    return struct.pack("<HHH", position, pwm, velocity)


def connect(bus: str, baudrate: int) -> tuple[Any, Any]:
    """Port and packet handler of the library.

    Raises:
        PlantSettingsError: it is not installed.
    """
    try:
        import scservo_sdk
    except ImportError:
        raise PlantSettingsError(
            "feetech-servo-sdk is not installed; pip install 'control_board_ros[feetech]'"
        ) from None
    return open_port(scservo_sdk.PortHandler, bus, baudrate), scservo_sdk.PacketHandler(0)


def identify(port: Any, protocol: Any, drive: int, attempts: int = ATTEMPTS) -> list[int]:
    """The models that answer as a drive: none, one, or two, if two answer each time."""
    found: list[int] = []
    for attempt in range(attempts):
        time.sleep(attempt * PATIENCE)  # a late answer to the last attempt is no second drive
        port.clearPort()
        data, result, _ = protocol.readTxRx(port, drive, *t.MODEL)
        if result != 0 or len(data) != t.MODEL.length:
            continue
        port.setPacketTimeoutMillis(0.5e3 * PATIENCE)
        second, result = protocol.rxPacket(port)
        model = int.from_bytes(bytes(data), "little")
        if result != 0 or second[2] != drive:
            return [model]
        found = [model, second[5] | second[6] << 8]
    return found


def scan(bus: str, baudrate: int = 1_000_000) -> list[Found]:
    """What answers on a port."""
    port, protocol = connect(bus, baudrate)
    try:
        port.wait = 5e-3
        found = []
        for drive in IDS:
            data, result, _ = protocol.readTxRx(port, drive, *t.MODEL)
            if result != 0 or len(data) != t.MODEL.length:
                continue
            model = int.from_bytes(bytes(data), "little")
            (major, minor), _, _ = protocol.readTxRx(port, drive, *t.FIRMWARE)
            volts, _, _ = protocol.read1ByteTxRx(port, drive, t.VOLTAGE.address)
            status, _, _ = protocol.read1ByteTxRx(port, drive, t.STATUS.address)
            found.append(
                Found(
                    id=drive,
                    type=t.MODELS.get(model, f"model {model}"),
                    firmware=f"{major}.{minor}",
                    voltage=volts * t.VOLT,
                    fault=DriveFault(status, t.error_name(status)) if status else None,
                )
            )
        return found
    finally:
        port.closePort()


make = maker(
    FeetechDrives,
    bus="/dev/ttyUSB0",
    ids=IDS,
    whole={"baudrate": 1e6, "unwatched": 0.0},
)
