# SPDX-License-Identifier: Apache-2.0
"""Dynamixel X servos over protocol 2: one sync write and one sync read for a whole bus.

A kind of set-point is an operating mode, which such a servo changes without torque only: in one
exchange torque off, mode, goal, torque on. Positions go without velocity and feed-forward.
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
from ..drives.plant import RESTARTED, WATCHDOG, Answers, Found, Traits
from ..drives.serial_line import open_port, settle
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import table as t

GOALS = {
    SetPoint.PWM: (t.GOAL_PWM, t.PWM_MODE),
    SetPoint.CURRENT: (t.GOAL_CURRENT, t.CURRENT_MODE),
    SetPoint.VELOCITY: (t.GOAL_VELOCITY, t.VELOCITY_MODE),
    SetPoint.POSITION: (t.GOAL_POSITION, t.EXTENDED),
}
#: Answers without torque, until that counts as a fault of a servo that should have it.
UNPOWERED = 5


class DynamixelDrives:
    """The servos of one bus; see ``drives.plant.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self._senses = bool(options.own["current"])
        self._position_mode = int(options.own["position_mode"])
        if self._position_mode not in (3, 4, 5):
            raise PlantSettingsError(
                f"position_mode={self._position_mode}: 3 (one turn), 4 (several turns) "
                "or 5 (several turns, bounded current) is wanted"
            )
        takes = (SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.CURRENT, SetPoint.PWM)
        self.traits = Traits(
            set_points=tuple(k for k in takes if self._senses or k is not SetPoint.CURRENT),
            on_silence=(OnSilence.BRAKED, OnSilence.FREE),
            resolution=t.COUNT,
            current=self._senses,
            temperature=True,
            voltage=True,
        )
        self._port: Any = None
        self._places = {axis.id: k for k, axis in enumerate(self._axes)}
        n = len(self._axes)
        self._models: list[t.Model] = [t.MODELS[1020]] * n
        self._kinds = [SetPoint.OFF] * n
        self._restarted, self._without = [False] * n, [0] * n

    def open(self, setup: Setup, joints: Sequence[JointConfig | None]) -> list[Found]:
        """Open the port; see ``drives.plant.Driver``."""
        self._setup, self._joints = setup, joints
        self._port, self._protocol = connect(self._options.bus, int(self._options.own["baudrate"]))
        self._port.wait = PATIENCE
        found = []
        for k, axis in enumerate(self._axes):
            told = identify(self._port, self._protocol, axis.id)
            only(told, axis, self._options.bus, "dynamixel")
            found.append(self._set_up(k))
        self._port.wait = budget(setup.period)
        return found

    def _set_up(self, k: int) -> Found:
        """Torque off, what is read, watchdog; returns what it is."""
        drive, name = self._axes[k].id, self._axes[k].name
        number = self._get(drive, t.MODEL)
        if (model := t.MODELS.get(number)) is None:
            raise PlantSettingsError(
                f"{name}: id {drive} is of model {number}; supported: "
                + ", ".join(known.name for known in t.MODELS.values())
            )
        if self._senses and not model.ampere:
            raise PlantSettingsError(
                f"{name}: {model.name} has no current control; add current=0 to plant_arguments"
            )
        self._models[k], self._kinds[k], self._without[k] = model, SetPoint.OFF, 0
        self._put(drive, t.TORQUE, 0)
        self._put(drive, t.WATCHDOG, 0)
        place = t.INDIRECT
        for item in t.READ:
            for byte in range(item.length):
                self._put(drive, t.Item(place, 2), item.address + byte)
                place += 2
        self._put(drive, t.WATCHDOG, watchdog_steps(self._setup.timeout))
        self._restarted[k] = False
        error = self._get(drive, t.ERROR)
        bounded = self._position_mode == t.POSITION_MODE
        return Found(
            id=drive,
            type=model.name,
            firmware=str(self._get(drive, t.FIRMWARE)),
            voltage=self._get(drive, t.VOLTAGE) * t.VOLT,
            fault=DriveFault(error, t.error_name(error)) if error else None,
            limits=DriveLimits(
                lower=angle(self._get(drive, t.MIN_POSITION)) if bounded else None,
                upper=angle(self._get(drive, t.MAX_POSITION)) if bounded else None,
                velocity=self._get(drive, t.VELOCITY_LIMIT) * t.SPEED,
                current=self._get(drive, t.CURRENT_LIMIT) * model.ampere if model.ampere else None,
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
        changed = {k: kind for k, kind in wanted.items() if kind is not self._kinds[k]}
        if changed:
            self._sync(t.TORQUE, dict.fromkeys(changed, 0))
            on = {k: kind for k, kind in changed.items() if kind is not SetPoint.OFF}
            self._sync(t.MODE, {k: self._mode(kind) for k, kind in on.items()})
            self._goals(on, columns)
            self._sync(t.TORQUE, dict.fromkeys(on, 1))
            for k, kind in changed.items():
                self._kinds[k], self._without[k] = kind, 0
        self._goals({k: kind for k, kind in wanted.items() if kind}, columns)
        self._read([k for k, kind in enumerate(kinds) if kind is not None], answers)

    def clear_fault(self, drive: int) -> Found | None:
        """What a servo shut down for is cleared by a restart; then it is set up anew."""
        anew = None
        axis = self._axes[drive].id
        if self._restarted[drive]:
            if self._protocol.ping(self._port, axis)[1] == 0:
                anew = self._set_up(drive)
        elif self._get(axis, t.ERROR):
            self._protocol.reboot(self._port, axis)
            self._restarted[drive] = True
        else:
            self._put(axis, t.WATCHDOG, 0)
            self._put(axis, t.WATCHDOG, watchdog_steps(self._setup.timeout))
        return anew

    def close(self) -> None:
        """Torque off, and leave the port."""
        port, self._port = self._port, None
        if port is not None:
            try:
                everybody = b"".join(bytes([axis.id, 0]) for axis in self._axes)
                self._protocol.syncWriteTxOnly(port, *t.TORQUE, everybody, len(everybody))
            finally:
                port.closePort()

    def _mode(self, kind: SetPoint) -> int:
        return self._position_mode if kind is SetPoint.POSITION else GOALS[kind][1]

    def _goals(self, kinds: Mapping[int, SetPoint], columns: Sequence[Sequence[float]]) -> None:
        for kind, (item, _) in GOALS.items():
            self._sync(
                item, {k: self._raw(k, kind, columns[k]) for k in kinds if kinds[k] is kind}
            )

    def _raw(self, k: int, kind: SetPoint, value: Sequence[float]) -> int:
        if kind is SetPoint.PWM:
            return round(value[Value.PWM] / 100.0 * t.FULL_PWM)
        if kind is SetPoint.CURRENT:
            return round(value[Value.CURRENT] / self._models[k].ampere)
        if kind is SetPoint.VELOCITY:
            return round(value[Value.VELOCITY] / t.SPEED)
        return round(value[Value.POSITION] / t.COUNT) + t.CENTRE

    def _sync(self, item: t.Item, values: Mapping[int, int]) -> None:
        """The same item of several servos at once; nobody answers."""
        if values:
            half = 1 << 8 * item.length
            data = b"".join(
                bytes([self._axes[k].id]) + (value % half).to_bytes(item.length, "little")
                for k, value in values.items()
            )
            self._protocol.syncWriteTxOnly(self._port, *item, data, len(data))

    def _read(self, drives: Sequence[int], answers: Answers) -> None:
        """What is read of each, by the place of its indirect data."""
        self._hear_others(answers)
        for data in {self._models[k].data for k in drives}:
            left = {self._axes[k].id for k in drives if self._models[k].data == data}
            self._protocol.syncReadTx(
                self._port, data, t.READ_LENGTH, sorted(left), len(left), False
            )
            self._port.setPacketTimeout(0)
            while left:
                packet, result = self._protocol.rxPacket(self._port, False)
                if result != 0:
                    if packet:
                        answers.malformed += 1
                    if self._port.isPacketTimeout():
                        break
                    continue
                left.discard(self._take(packet, answers))
            self._port.is_using = False

    def _hear_others(self, answers: Answers) -> None:
        """What else came: too late, or of a second servo with the id of one that answered."""
        self._port.setPacketTimeoutMillis(0.0)
        if self._port.getBytesAvailable():
            packet, result = self._protocol.rxPacket(self._port, False)
            if result == 0:
                self._take(packet, answers)

    def _take(self, packet: Sequence[int], answers: Answers) -> int:
        drive, data = packet[4], bytes(packet[9:-2])
        if (k := self._places.get(drive)) is None:
            answers.foreign += 1
        elif len(data) != t.READ_LENGTH:
            answers.malformed += 1
        else:
            found = struct.unpack(t.READ_FORMAT, data)
            answers.faults[k] = self._judge(k, *found[:3])
            if not self._restarted[k]:
                current, velocity, position, volts, degrees = found[3:]
                answers.position[k] = angle(position)
                answers.velocity[k] = velocity * t.SPEED
                answers.current[k] = current * self._models[k].ampere
                answers.voltage[k], answers.temperature[k] = volts * t.VOLT, degrees
            answers.came(k, data)
        return drive

    def _judge(self, k: int, torque: int, error: int, watchdog: int) -> DriveFault | None:
        if error:
            return DriveFault(error, t.error_name(error))
        if watchdog == 0:  # what it reads is not set up any more
            self._restarted[k] = True
        if self._restarted[k]:
            return RESTARTED
        if watchdog == t.TRIPPED:
            return WATCHDOG
        self._without[k] = 0 if torque or not self._kinds[k] else self._without[k] + 1
        if self._without[k] >= UNPOWERED:
            return DriveFault(0, "it has no torque, though it was told to")
        return None

    def _get(self, drive: int, item: t.Item) -> int:
        for attempt in range(4 * ATTEMPTS):
            settle(self._port, attempt)
            data, result, _ = self._protocol.readTxRx(self._port, drive, *item)
            if result == 0 and len(data) == item.length:
                return int.from_bytes(bytes(data), "little", signed=item.length == 4)
        raise ConnectionError(f"id {drive} does not answer; is it powered?")

    def _put(self, drive: int, item: t.Item, value: int) -> None:
        data = list((value % (1 << 8 * item.length)).to_bytes(item.length, "little"))
        for attempt in range(4 * ATTEMPTS):
            settle(self._port, attempt)
            result, error = self._protocol.writeTxRx(self._port, drive, *item, data)
            if result == 0 and not error & 0x7F:
                return
        raise ConnectionError(
            f"id {drive}: {value} is not taken at address {item.address} (error {error & 0x7F})"
        )


def angle(count: int) -> float:
    """Rad at the output for counts; 0 in the middle of the first turn."""
    return (count - t.CENTRE) * t.COUNT


def watchdog_steps(timeout: float) -> int:
    """The watchdog for a silence, s: never longer."""
    return max(1, min(127, int(timeout / t.WATCHDOG_STEP)))


def connect(bus: str, baudrate: int) -> tuple[Any, Any]:
    """Port and packet handler of the library.

    Raises:
        PlantSettingsError: it is not installed.
    """
    try:
        import dynamixel_sdk
    except ImportError:
        raise PlantSettingsError(
            "dynamixel-sdk is not installed; pip install 'control_board_ros[dynamixel]'"
        ) from None
    return open_port(dynamixel_sdk.PortHandler, bus, baudrate), dynamixel_sdk.PacketHandler(2.0)


def identify(port: Any, protocol: Any, drive: int) -> list[int]:
    """The models that answer as a drive: none, one, or two, if two answer each time."""
    found: list[int] = []
    for attempt in range(ATTEMPTS):
        time.sleep(attempt * PATIENCE)  # a late answer to the last attempt is no second drive
        port.clearPort()
        model, result, _ = protocol.ping(port, drive)
        if result != 0:
            continue
        port.setPacketTimeoutMillis(0.5e3 * PATIENCE)
        second, result = protocol.rxPacket(port, False)
        if result != 0 or second[4] != drive:
            return [model]
        found = [model, second[9] | second[10] << 8]
    return found


def scan(bus: str, baudrate: int = 1_000_000) -> list[Found]:
    """What answers on a port."""
    port, protocol = connect(bus, baudrate)
    try:
        told, _ = protocol.broadcastPing(port)
        found = []
        for drive, (model, firmware) in sorted(told.items()):
            known = t.MODELS.get(model)
            volts, _, _ = protocol.read2ByteTxRx(port, drive, t.VOLTAGE.address)
            error, _, _ = protocol.read1ByteTxRx(port, drive, t.ERROR.address)
            found.append(
                Found(
                    id=drive,
                    type=known.name if known else f"model {model}",
                    firmware=str(firmware),
                    voltage=volts * t.VOLT,
                    fault=DriveFault(error, t.error_name(error)) if error else None,
                )
            )
        return found
    finally:
        port.closePort()


make = maker(
    DynamixelDrives,
    bus="/dev/ttyUSB0",
    ids=range(253),
    whole={"baudrate": 1e6, "current": 1.0, "position_mode": float(t.EXTENDED)},
)
