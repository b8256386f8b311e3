# SPDX-License-Identifier: Apache-2.0
"""CiA 402 drives on CANopen: two PDOs down and two or three up, by one SYNC for the bus.

A kind of set-point is a mode of operation, which comes in the PDO with its own targets::

    position    CSP (8)     target position, torque offset
    velocity    CSV (9)     target velocity, torque offset
    torque      CST (10)    target torque

The targets of the inactive modes are those at which the drive rests. Its watchdog is
the heartbeat of this driver (0x1016), a frame per exchange.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import WATCHDOG
from ..drives.plant import maker
from ..errors import PlantSettingsError
from ..interface import DriveFault, Setup
from . import objects as o
from .identity import REV, UNKNOWN, Scale, found_of, limits_of, scale_of
from .sdo import Sdo, uploads
from .states import FAULT_RESET, TOWARDS_POWER, Mode, State, state_of

IDS = range(1, 127)
MODES = {
    SetPoint.POSITION: Mode.CSP,
    SetPoint.VELOCITY: Mode.CSV,
    SetPoint.TORQUE: Mode.CST,
}
#: What a drive does without heartbeat: objects and their values, a fault first.
ON_SILENCE = {
    OnSilence.FREE: {o.ABORT_OPTION: o.FAULT_SIGNAL, o.FAULT_OPTION: o.COAST},
    OnSilence.BRAKED: {o.ABORT_OPTION: o.QUICK_STOP, o.QUICK_STOP_OPTION: o.STAY_STOPPED},
}
#: Exchanges with power from which on its loss is the drive's own doing.
SETTLED = 3
LOST = DriveFault(0, "drive disabled itself; check that safe torque off is released")


@dataclass(slots=True)
class Drive:
    """One drive since it was set up.

    Attributes:
        scale: Its units.
        offset: Whether it has a torque offset.
        whole: What an answer consists of, a bit for each PDO.
        parts: Those that came in this exchange.
        state, error: As its PDOs report them.
        counts: Its position.
        word: The last control word.
        powered: Whether power is commanded.
        enabled: Exchanges in which it had power since then.
        idle: Whether it had none since it was set up.
        reset: Whether the next control word resets its fault.
        left: Why the drive disabled itself.
    """

    scale: Scale = UNKNOWN
    offset: bool = True
    whole: int = 3
    parts: int = 0
    state: State = State.SWITCH_ON_DISABLED
    error: int = 0
    counts: int = 0
    word: int = 0
    powered: bool = False
    enabled: int = 0
    idle: bool = True
    reset: bool = False
    left: DriveFault | None = None


class Cia402Drives:
    """The drives of one bus; see ``drives.driver.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        names = str(options.own["modes"]).replace(",", " ").split()
        if not names or not set(names) <= {mode.name.lower() for mode in Mode}:
            raise PlantSettingsError(f"modes={options.own['modes']}: some of csp csv cst")
        self.traits = Traits(
            set_points=tuple(kind for kind, m in MODES.items() if m.name.lower() in names),
            on_silence=tuple(ON_SILENCE),
            torque=True,
            motor_encoders=frozenset(
                k for k, axis in enumerate(self._axes) if float(axis.own["motor_counts"]) > 0.0
            ),
        )
        self._line = CanLine(options.bus, bitrate=int(options.own["bitrate"]))
        self._drives = [Drive() for _ in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        self._line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Disable, set watchdog and PDOs, start; returns the identification of the drive."""
        line, axis = self._line, self._axes[k]
        types = uploads(line, axis.id, o.DEVICE_TYPE, attempts)
        profile = only(types, axis, self._options.bus, "cia402") & 0xFFFF
        if profile != o.PROFILE:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} has profile {profile}; {o.PROFILE} (drives) is "
                "supported"
            )
        sdo = Sdo(line, axis.id)
        line.send(o.NMT, bytes([o.PRE_OPERATIONAL, axis.id]))
        for word in (0, FAULT_RESET, 0):  # an earlier fault, as that of its watchdog, is cleared
            sdo.put(o.CONTROL, 0, "<H", word)
        modes = sdo.get(o.SUPPORTED_MODES, 0, "<I")
        for kind in self.traits.set_points:
            if not modes >> MODES[kind] - 1 & 1:
                offered = [m.name.lower() for m in Mode if modes >> m - 1 & 1]
                raise PlantSettingsError(
                    f"{axis.name}: id {axis.id} has no {MODES[kind].name}; add 'modes="
                    f"{' '.join(offered)}' to plant_arguments"
                )
        self._set_watchdog(k, sdo)
        self._drives[k] = drive = Drive(
            scale=scale_of(axis, sdo),
            offset=sdo.maybe(o.TORQUE_OFFSET, 0, "<h") is not None,
        )
        for function, mapped in o.MAPPED.items():
            kept = [item for item in mapped if item[0] != o.TORQUE_OFFSET or drive.offset]
            sdo.map_pdo(function, kept)
        if k in self.traits.motor_encoders:
            drive.whole = 7
            sdo.map_pdo(o.TPDO3, o.MOTOR)
        line.send(o.NMT, bytes([o.START, axis.id]))
        return found_of(sdo, axis.id, limits_of(sdo, drive.scale))

    def _set_watchdog(self, k: int, sdo: Sdo) -> None:
        """The consumer's heartbeat, and what follows when it is missing."""
        joint, axis = self._setup.joints[k], self._axes[k]
        silence = OnSilence.FREE if joint is None else joint.on_silence
        watch = o.MASTER << 16 | max(1, int(1e3 * self._setup.timeout))
        items = [(o.CONSUMER_HEARTBEAT, 1, "<I", watch)]
        items += [(index, 0, "<h", value) for index, value in ON_SILENCE[silence].items()]
        for index, subindex, form, value in items:
            if (
                not sdo.accepts(index, subindex, form, value)
                and not self._options.own["unwatched"]
            ):
                raise PlantSettingsError(
                    f"{axis.name}: id {axis.id} does not accept {value} in object "
                    f"0x{index:04x}:{subindex}, by which it would stop without frames; "
                    "unwatched=1 goes without"
                )
        # Where it exists: stay operational without heartbeat, and so report it.
        sdo.accepts(o.ERROR_BEHAVIOUR, 1, "<B", 1)

    def exchange(self, wanted: Wanted) -> None:
        line = self._line
        line.drain(self._take)
        if wanted:
            line.send(o.HEARTBEAT | o.MASTER, bytes([o.OPERATIONAL]))
        for k, (kind, value) in wanted.items():
            self._drives[k].parts = 0
            if self._answers.restarted[k]:  # it has no PDOs, but a serial number of its own
                question = struct.pack("<BHBI", 0x40, o.IDENTITY, o.SERIAL, 0)
                line.send(o.SDO_REQUEST | self._axes[k].id, question)
            else:
                self._command(k, kind, value)
        line.send(o.SYNC, b"")
        line.gather(self._take, wanted, self._wait)

    def clear_fault(self, k: int) -> None:
        """A reset by the next control word; a drive that was away is to be set up again."""
        drive = self._drives[k]
        self._answers.restarted[k] = not drive.parts
        drive.reset, drive.left = True, None

    def close(self) -> None:
        """Power off and no watchdog, by commands that need no SYNC, and leave the bus."""
        off = struct.pack("<BHBI", 0x2B, o.CONTROL, 0, 0)
        unwatched = struct.pack("<BHBI", 0x23, o.CONSUMER_HEARTBEAT, 1, 0)
        self._line.close(
            (o.SDO_REQUEST | axis.id, data) for data in (off, unwatched) for axis in self._axes
        )

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> None:
        line, number, drive = self._line, self._axes[k].id, self._drives[k]
        scale, on = drive.scale, kind is not SetPoint.OFF and drive.left is None
        if on is not drive.powered:
            drive.powered, drive.enabled = on, 0
        word = TOWARDS_POWER.get(drive.state, 0) if on else 0
        if drive.reset:
            drive.reset = False
            word = 0 if drive.word & FAULT_RESET else FAULT_RESET
        drive.word = word
        mode = MODES[self.traits.set_points[0] if kind is SetPoint.OFF else kind]
        position, speed, target, offset = drive.counts, 0, 0, 0
        torque = whole(value[Value.TORQUE] * scale.torque, 16)
        if kind is SetPoint.TORQUE:
            target = torque
        elif on:
            offset = torque
        if kind is SetPoint.POSITION:
            position = whole(value[Value.POSITION] * scale.position, 32)
        elif kind is SetPoint.VELOCITY:
            speed = whole(value[Value.VELOCITY] * scale.velocity, 32)
        first = struct.pack(o.RPDO1_FORMAT, word, mode, target, offset)
        line.send(o.RPDO1 | number, first if drive.offset else first[:-2])
        line.send(o.RPDO2 | number, struct.pack(o.RPDO2_FORMAT, position, speed))

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        frame: int = message.arbitration_id
        function, k = frame & 0x780, answers.places.get(frame & 0x7F)
        if k is None:
            return None
        if function == o.HEARTBEAT and data[:1] == bytes([o.BOOT_UP]):
            answers.restarted[k], answers.faults[k] = True, None
        elif answers.restarted[k]:
            if function == o.SDO_ANSWER:
                answers.came(k, data)
                return k
        elif function in o.ANSWERS:
            self._read_pdo(k, function, data)
            return k if self._drives[k].parts == self._drives[k].whole else None
        return None

    def _read_pdo(self, k: int, function: int, data: bytes) -> None:
        answers, drive = self._answers, self._drives[k]
        part, form = o.ANSWERS[function]
        if len(data) != struct.calcsize(form):
            return
        found = struct.unpack(form, data)
        if function == o.TPDO1:
            drive.state, drive.counts = state_of(found[0]), found[1]
            answers.position[k] = found[1] / drive.scale.position
            answers.torque[k] = found[2] / drive.scale.torque
            answers.came(k, data)
        elif function == o.TPDO2:
            answers.velocity[k] = found[0] / drive.scale.velocity
            drive.error = found[1]
        else:
            answers.motor_position[k] = found[0] * REV / float(self._axes[k].own["motor_counts"])
        answers.faults[k] = judge(drive)
        drive.parts |= part


def judge(drive: Drive) -> DriveFault | None:
    if drive.state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        if drive.idle and drive.error == o.HEARTBEAT_LOST:  # from its set-up to the first cycle
            drive.reset = True
            return None
        return DriveFault(drive.error, o.error_name(drive.error))
    if drive.state is State.OPERATION_ENABLED:
        drive.idle = False
        drive.enabled += drive.powered
    elif drive.enabled >= SETTLED and drive.left is None:
        drive.left = WATCHDOG if drive.state is State.QUICK_STOP_ACTIVE else LOST
    return drive.left


def whole(value: float, bits: int) -> int:
    """A value as a signed integer, at its end where it is beyond."""
    most = (1 << bits - 1) - 1
    return round(max(-most, min(most, value)))


def scan(bus: str) -> list[Found]:
    with CanLine(bus) as line:
        for drive in IDS:
            line.send(o.SDO_REQUEST | drive, struct.pack("<BHBI", 0x40, o.DEVICE_TYPE, 0, 0))
        answers = {m.arbitration_id & 0x7F: bytes(m.data) for m in line.collect(2.0 * PATIENCE)
                 if m.arbitration_id & 0x780 == o.SDO_ANSWER}  # fmt: skip
        return [
            found_of(Sdo(line, drive), drive)
            for drive, data in sorted(answers.items())
            if len(data) == 8 and data[4] | data[5] << 8 == o.PROFILE
        ]


make = maker(
    Cia402Drives,
    bus="socketcan:can0",
    ids=IDS,
    whole={"bitrate": 0.0, "modes": "csp csv cst", "unwatched": 0.0},
    each={"counts": 0.0, "velocity_counts": 0.0, "rated_torque": 0.0, "motor_counts": 0.0},
)
