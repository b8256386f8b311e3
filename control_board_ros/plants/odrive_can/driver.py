# SPDX-License-Identifier: Apache-2.0
"""ODrive controllers by CAN Simple, firmware 0.6: one set-point down, remote frames for answers.

An exchange requests position and velocity of each drive, and in turn its state with errors, and
its torque. A kind of set-point is a control mode; with it come its first values.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, PATIENCE, REMOTE, CanLine, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import flagged
from ..drives.plant import maker
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import frames as f

REV = 2.0 * math.pi
IDS = range(63)
MODES = {
    SetPoint.POSITION: f.POSITION_CONTROL,
    SetPoint.VELOCITY: f.VELOCITY_CONTROL,
    SetPoint.TORQUE: f.TORQUE_CONTROL,
}
#: What is requested beside the position, one per exchange, and its format.
IN_TURN = (f.BEAT, f.TORQUES)
FORMATS = {f.BEAT: "<IBBBB", f.TORQUES: "<ff", f.ESTIMATES: "<ff"}


@dataclass(slots=True)
class Drive:
    """One drive since it was set up.

    Attributes: parameters (by name; empty without a watchdog), kind (as requested), closed
        (whether it reported its closed loop since then), awaited (answers of this exchange).
    """

    parameters: Mapping[str, f.Endpoint] = field(default_factory=dict)
    kind: SetPoint = SetPoint.OFF
    closed: bool = False
    awaited: set[int] = field(default_factory=set)


class OdriveDrives:
    """The controllers of one bus; see ``drives.driver.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self.traits = Traits(
            set_points=tuple(MODES),
            on_silence=(OnSilence.FREE,),
            rate=8e3,
            torque=True,
        )
        self._line = CanLine(options.bus, bitrate=int(options.own["bitrate"]))
        self._drives = [Drive() for _ in self._axes]
        self._turn = 0

    def open(self, setup: Setup, answers: Answers) -> None:
        self._line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Disable, set the watchdog; returns the identification of the drive."""
        line, axis = self._line, self._axes[k]
        answers = ask(line, axis.id, f.VERSION, attempts)
        version = f.Version.parse(only(answers, axis, self._options.bus, "odrive_can"))
        firmware = ".".join(map(str, f.FIRMWARE))
        if version.protocol != f.PROTOCOL or not version.firmware.startswith(f"{firmware}."):
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} has firmware {version.firmware}, CAN Simple "
                f"{version.protocol}; firmware {firmware}, CAN Simple {f.PROTOCOL} is supported"
            )
        line.send(frame(axis.id, f.STATE), struct.pack("<I", f.IDLE))
        line.send(frame(axis.id, f.CLEAR), b"\0")
        self._drives[k] = drive = Drive()
        if not self._options.own["unwatched"]:
            drive.parameters = f.endpoints(version, str(self._options.own["endpoints"]))
            self._put(k, f.WATCHDOG_TIMEOUT, self._setup.timeout)
            self._put(k, f.WATCHDOG_ENABLED, True)
        found = found_of(line, axis.id, version)
        if not drive.parameters:
            return found
        speed, current = self._get(k, f.SPEED_LIMIT), self._get(k, f.CURRENT_LIMIT)
        limits = DriveLimits(
            velocity=speed * REV if math.isfinite(speed) else None,
            torque=current * self._get(k, f.TORQUE_CONSTANT),
            current=current,
        )
        return replace(found, limits=limits)

    def exchange(self, wanted: Wanted) -> None:
        line = self._line
        line.drain(self._take)
        self._turn = (self._turn + 1) % len(IN_TURN)
        for k, (kind, value) in wanted.items():
            self._command(k, kind, value)
            questions = f.ESTIMATES, IN_TURN[self._turn]
            self._drives[k].awaited = set(questions)
            for command in questions:
                line.send(frame(self._axes[k].id, command) | REMOTE, b"")
        line.gather(self._take, wanted, self._wait)

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> None:
        """The set-point of a drive; power, mode and watchdog where its kind is a new one."""
        line, number, drive = self._line, self._axes[k].id, self._drives[k]
        if kind is SetPoint.OFF:
            drive.kind, drive.closed = kind, False
            line.send(frame(number, f.STATE), struct.pack("<I", f.IDLE))
            return
        if kind is SetPoint.POSITION:
            command, data = f.INPUT_POSITION, f.position(
                value[Value.POSITION] / REV, value[Value.VELOCITY] / REV, value[Value.TORQUE]
            )  # fmt: skip
        elif kind is SetPoint.VELOCITY:
            command = f.INPUT_VELOCITY
            data = struct.pack("<ff", value[Value.VELOCITY] / REV, value[Value.TORQUE])
        else:
            command, data = f.INPUT_TORQUE, struct.pack("<f", value[Value.TORQUE])
        line.send(frame(number, command), data)
        if kind is not drive.kind:
            line.send(frame(number, f.MODE), f.mode(MODES[kind]))
            drive.kind = kind
        if not drive.closed:  # until it reports its closed loop
            for name, setting in (
                (f.WATCHDOG_TIMEOUT, self._setup.timeout),
                (f.WATCHDOG_ENABLED, 1),
            ):
                if name in drive.parameters:
                    line.send(frame(number, f.RX_SDO), written(drive.parameters[name], setting))
            line.send(frame(number, f.STATE), struct.pack("<I", f.CLOSED_LOOP))

    def clear_fault(self, k: int) -> None:
        self._line.send(frame(self._axes[k].id, f.CLEAR), b"\0")

    def close(self) -> None:
        off = struct.pack("<I", f.IDLE)
        self._line.close((frame(axis.id, f.STATE), off) for axis in self._axes)

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        drive, command = message.arbitration_id >> 5, message.arbitration_id & 0x1F
        form = FORMATS.get(command)
        k = answers.places.get(drive)
        if message.is_remote_frame or form is None or k is None or len(data) != 8:
            return None
        found = struct.unpack(form, data)
        if not all(map(math.isfinite, found)):
            return None
        if command == f.ESTIMATES:
            answers.position[k], answers.velocity[k] = found[0] * REV, found[1] * REV
            answers.came(k, data)
        elif command == f.TORQUES:
            answers.torque[k] = found[1]
        else:
            answers.faults[k] = self._judge(k, *found[:2])
        awaited = self._drives[k].awaited
        awaited.discard(command)
        return None if awaited else k

    def _judge(self, k: int, errors: int, state: int) -> DriveFault | None:
        drive = self._drives[k]
        if state == f.CLOSED_LOOP:
            drive.closed = drive.kind is not SetPoint.OFF
        elif drive.closed and not errors & ~1:  # as after its start, and it was on
            self._answers.restarted[k] = True
        return flagged(errors, f.ERRORS)

    def _get(self, k: int, name: str) -> float:
        line, drive, endpoint = self._line, self._axes[k].id, self._drives[k].parameters[name]

        def pick(message: Any) -> bytes | None:
            data = bytes(message.data)
            if message.arbitration_id != frame(drive, f.TX_SDO) or len(data) < 5:
                return None
            return data[4:].ljust(4, b"\0") if data[1] | data[2] << 8 == endpoint.id else None

        question = struct.pack("<BHB", f.READ, endpoint.id, 0)
        if (data := line.ask(frame(drive, f.RX_SDO), question, pick)) is None:
            raise ConnectionError(f"id {drive} does not answer for {name}")
        return float(struct.unpack_from(endpoint.form, data)[0])

    def _put(self, k: int, name: str, value: float) -> None:
        """Write a parameter and read it back: a write has no answer."""
        line, drive = self._line, self._axes[k].id
        for _ in range(ATTEMPTS):
            line.send(frame(drive, f.RX_SDO), written(self._drives[k].parameters[name], value))
            if abs(self._get(k, name) - value) <= 1e-6:
                return
        raise PlantSettingsError(f"id {drive} does not accept {value:g} for {name}")


def frame(drive: int, command: int) -> int:
    return drive << 5 | command


def written(endpoint: f.Endpoint, value: float) -> bytes:
    """Data of a frame that writes a parameter."""
    number = value if endpoint.form == "<f" else int(value)
    return struct.pack("<BHB", f.WRITE, endpoint.id, 0) + struct.pack(endpoint.form, number)


def ask(line: CanLine, drive: int, command: int, attempts: int) -> list[bytes]:
    """What drives of that id answer to a remote frame: none, one, or several."""

    def pick(message: Any) -> bytes | None:
        other = message.arbitration_id != frame(drive, command) or message.is_remote_frame
        return None if other or len(message.data) != 8 else bytes(message.data)

    return line.answers(frame(drive, command) | REMOTE, b"", pick, attempts)


def found_of(line: CanLine, drive: int, version: f.Version) -> Found:
    supply, beat = (ask(line, drive, command, ATTEMPTS) for command in (f.SUPPLY, f.BEAT))
    errors = struct.unpack("<IBBBB", beat[0])[0] if beat else 0
    return Found(
        id=drive,
        type=f"ODrive {version.hardware}",
        firmware=version.firmware,
        voltage=struct.unpack("<ff", supply[0])[0] if supply else math.nan,
        fault=flagged(errors, f.ERRORS),
    )


def scan(bus: str) -> list[Found]:
    with CanLine(bus) as line:
        for drive in IDS:
            line.send(frame(drive, f.VERSION) | REMOTE, b"")
        versions = {m.arbitration_id >> 5: f.Version.parse(bytes(m.data))
                 for m in line.collect(2.0 * PATIENCE)
                 if m.arbitration_id & 0x1F == f.VERSION and len(m.data) == 8}  # fmt: skip
        return [found_of(line, drive, version) for drive, version in sorted(versions.items())]


make = maker(
    OdriveDrives,
    bus="socketcan:can0",
    ids=IDS,
    whole={"bitrate": 0.0, "endpoints": "", "unwatched": 0.0},
)
