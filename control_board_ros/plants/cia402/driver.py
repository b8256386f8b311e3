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

import math
import struct
from collections.abc import Sequence
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Axis, Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.faults import WATCHDOG
from ..drives.maker import maker, only
from ..drives.plant import Answers, Found, Traits, Wanted
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import objects as o
from .sdo import Sdo, uploads
from .states import FAULT_RESET, TOWARDS_POWER, Mode, State, state_of

REV = 2.0 * math.pi
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
LOST = DriveFault(0, "it took its power off by itself; is safe torque off released?")
LARGEST = (1 << 31) - 1, (1 << 15) - 1


class Scale:
    """Units of one drive per unit at its output: counts/rad, (counts/s)/(rad/s), ‰/(N·m)."""

    def __init__(self, position: float, velocity: float, torque: float) -> None:
        self.position, self.velocity, self.torque = position, velocity, torque


class Cia402Drives:
    """The drives of one bus; see ``drives.plant.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        names = str(options.own["modes"]).replace(",", " ").split()
        if not names or not set(names) <= {mode.name.lower() for mode in Mode}:
            raise PlantSettingsError(f"modes={options.own['modes']}: some of csp csv cst")
        self.traits = Traits(
            set_points=tuple(kind for kind, m in MODES.items() if m.name.lower() in names),
            on_silence=tuple(ON_SILENCE),
            torque=True,
            motor_encoders=frozenset(k for k, counts in enumerate(self._counts()) if counts > 0.0),
        )
        self._line = CanLine(options.bus, bitrate=int(options.own["bitrate"]))
        n = len(self._axes)
        self._scales, self._offsets = [Scale(1.0, 1.0, 1.0)] * n, [True] * n
        self._raw = [0] * n  # position, counts
        self._states, self._errors, self._words = [State.SWITCH_ON_DISABLED] * n, [0] * n, [0] * n
        self._parts, self._powered, self._enabled = [0] * n, [False] * n, [0] * n
        #: What an answer consists of: a bit for each PDO.
        self._whole = [7 if k in self.traits.motor_encoders else 3 for k in range(n)]
        self._reset = [False] * n
        self._left: list[DriveFault | None] = [None] * n
        self._idle = [True] * n  # since it was set up

    def _counts(self) -> list[float]:
        """Counts per turn of the encoders at the motors, 0 where there is none."""
        return [float(axis.own["motor_counts"]) for axis in self._axes]

    def open(self, setup: Setup, answers: Answers) -> None:
        """Open the bus; see ``drives.plant.Driver``."""
        self._line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """No power, watchdog, PDOs, and what it is; it is operational afterwards."""
        line, axis = self._line, self._axes[k]
        kinds = uploads(line, axis.id, o.DEVICE_TYPE, attempts)
        kind = only(kinds, axis, self._options.bus, "cia402")
        if kind & 0xFFFF != o.PROFILE:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} has profile {kind & 0xFFFF}; {o.PROFILE} "
                "(drives) is supported"
            )
        sdo = Sdo(line, axis.id)
        line.send(o.NMT, bytes([o.PRE_OPERATIONAL, axis.id]))
        for word in (0, FAULT_RESET, 0):  # a fault of before, as that of its watchdog, is over
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
        self._scales[k] = scale = scale_of(axis, sdo)
        self._offsets[k] = sdo.maybe(o.TORQUE_OFFSET, 0, "<h") is not None
        for function, mapped in o.MAPPED.items():
            kept = [item for item in mapped if item[0] != o.TORQUE_OFFSET or self._offsets[k]]
            map_pdo(sdo, function, axis.id, kept)
        if k in self.traits.motor_encoders:
            map_pdo(sdo, o.TPDO3, axis.id, o.MOTOR)
        self._powered[k] = self._reset[k] = False
        self._enabled[k], self._left[k], self._idle[k] = 0, None, True
        line.send(o.NMT, bytes([o.START, axis.id]))
        return found_of(sdo, axis.id, limits_of(sdo, scale))

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
        """Set-points and answers; see ``drives.plant.Driver``."""
        line = self._line
        line.drain(self._take)
        if wanted:
            line.send(o.HEARTBEAT | o.MASTER, bytes([o.OPERATIONAL]))
        for k, (kind, value) in wanted.items():
            self._parts[k] = 0
            if self._answers.restarted[k]:  # its PDOs are not ours; and in this two drives differ
                question = struct.pack("<BHBI", 0x40, o.IDENTITY, o.SERIAL, 0)
                line.send(o.SDO_REQUEST | self._axes[k].id, question)
            else:
                self._command(k, kind, value)
        line.send(o.SYNC, b"")
        line.gather(self._take, wanted, self._wait)

    def clear_fault(self, k: int) -> None:
        """A reset by the next control word; a drive that was away is to be set up again."""
        self._answers.restarted[k] = not self._parts[k]
        self._reset[k], self._left[k] = True, None

    def close(self) -> None:
        """Power off and no watchdog, by commands that need no SYNC, and leave the bus."""
        off = struct.pack("<BHBI", 0x2B, o.CONTROL, 0, 0)
        unwatched = struct.pack("<BHBI", 0x23, o.CONSUMER_HEARTBEAT, 1, 0)
        self._line.close(
            (o.SDO_REQUEST | axis.id, data) for data in (off, unwatched) for axis in self._axes
        )

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> None:
        """The two PDOs of a drive."""
        line, drive, scale = self._line, self._axes[k].id, self._scales[k]
        on = kind is not SetPoint.OFF and self._left[k] is None
        if on is not self._powered[k]:
            self._powered[k], self._enabled[k] = on, 0
        word = TOWARDS_POWER.get(self._states[k], 0) if on else 0
        if self._reset[k]:
            self._reset[k] = False
            word = 0 if self._words[k] & FAULT_RESET else FAULT_RESET
        self._words[k] = word
        torque = whole(value[Value.TORQUE] * scale.torque, 1)
        target, offset = (torque, 0) if kind is SetPoint.TORQUE else (0, torque if on else 0)
        mode = MODES[self.traits.set_points[0] if kind is SetPoint.OFF else kind]
        first = struct.pack(o.RPDO1_FORMAT, word, mode, target, offset)
        follows = kind is SetPoint.POSITION
        line.send(o.RPDO1 | drive, first if self._offsets[k] else first[:-2])
        line.send(
            o.RPDO2 | drive,
            struct.pack(
                o.RPDO2_FORMAT,
                whole(value[Value.POSITION] * scale.position, 0) if follows else self._raw[k],
                whole(value[Value.VELOCITY] * scale.velocity, 0)
                if kind is SetPoint.VELOCITY
                else 0,
            ),
        )

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        frame: int = message.arbitration_id
        function, k = frame & 0x780, answers.places.get(frame & 0x7F)
        if k is None:
            answers.foreign += function in o.ANSWERS
            return None
        if function == o.HEARTBEAT and data[:1] == bytes([o.BOOT_UP]):
            answers.restarted[k], answers.faults[k] = True, None
        elif answers.restarted[k]:
            if function == o.SDO_ANSWER:
                answers.came(k, data)
                return k
        elif function in o.ANSWERS:
            self._hear(k, function, data)
            return k if self._parts[k] == self._whole[k] else None
        return None

    def _hear(self, k: int, function: int, data: bytes) -> None:
        """Take over one of the two PDOs of a drive."""
        answers, scale = self._answers, self._scales[k]
        part, form = o.ANSWERS[function]
        if len(data) != struct.calcsize(form):
            answers.malformed += 1
            return
        found = struct.unpack(form, data)
        if function == o.TPDO1:
            self._states[k], self._raw[k] = state_of(found[0]), found[1]
            answers.position[k] = found[1] / scale.position
            answers.torque[k] = found[2] / scale.torque
            answers.came(k, data)
        elif function == o.TPDO2:
            answers.velocity[k] = found[0] / scale.velocity
            self._errors[k] = found[1]
        else:
            answers.motor_position[k] = found[0] * REV / float(self._axes[k].own["motor_counts"])
        answers.faults[k] = self._judge(k)
        self._parts[k] |= part

    def _judge(self, k: int) -> DriveFault | None:
        state, code = self._states[k], self._errors[k]
        if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
            if self._idle[k] and code == o.HEARTBEAT_LOST:  # from its set-up to the first cycle
                self._reset[k] = True
                return None
            return DriveFault(code, o.error_name(code))
        if state is State.OPERATION_ENABLED:
            self._idle[k] = False
            self._enabled[k] += self._powered[k]
        elif self._enabled[k] >= SETTLED and self._left[k] is None:
            self._left[k] = WATCHDOG if state is State.QUICK_STOP_ACTIVE else LOST
        return self._left[k]


def whole(value: float, size: int) -> int:
    """A value as an integer of 32 (size 0) or 16 bits (1), at its end where it is beyond."""
    most = LARGEST[size]
    return round(max(-most, min(most, value)))


def scale_of(axis: Axis, sdo: Sdo) -> Scale:
    """Units of a drive, by its options, or as the drive itself has them.

    Raises:
        PlantSettingsError: neither has them.
    """
    counts = float(axis.own["counts"])
    if counts <= 0.0:
        steps, turns = sdo.maybe(o.RESOLUTION, 1, "<I"), sdo.maybe(o.RESOLUTION, 2, "<I")
        counts = steps / turns if steps and turns else 0.0
    rated = float(axis.own["rated_torque"]) or 1e-3 * (sdo.maybe(o.RATED_TORQUE, 0, "<I") or 0)
    for what, value, index in (
        ("counts", counts, o.RESOLUTION),
        ("rated_torque", rated, o.RATED_TORQUE),
    ):
        if value <= 0.0:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} does not report its {what} (object 0x{index:04x}); "
                f"add {axis.name}.{what}=… to plant_arguments"
            )
    speed = float(axis.own["velocity_counts"]) or counts
    return Scale(counts / REV, speed / REV, 1e3 / rated)


def limits_of(sdo: Sdo, scale: Scale) -> DriveLimits:
    """The limits that a drive keeps, as far as it has such objects."""
    lower = sdo.maybe(o.POSITION_LIMITS, 1, "<i")
    upper = sdo.maybe(o.POSITION_LIMITS, 2, "<i")
    bounded = lower is not None and upper is not None and lower < upper
    speed, torque = sdo.maybe(o.MAX_SPEED, 0, "<I"), sdo.maybe(o.MAX_TORQUE, 0, "<H")
    return DriveLimits(
        lower=lower / scale.position if bounded and lower is not None else None,
        upper=upper / scale.position if bounded and upper is not None else None,
        velocity=speed * REV / 60.0 if speed else None,
        torque=torque / scale.torque if torque else None,
    )


def map_pdo(sdo: Sdo, function: int, drive: int, mapped: Sequence[tuple[int, int]]) -> None:
    """Map a PDO, synchronous: it is invalid meanwhile, as CiA 301 wants it."""
    index, cob_id = o.PARAMETERS[function], function + drive
    sdo.put(index, 1, "<I", cob_id | o.INVALID)
    sdo.put(index, 2, "<B", o.SYNCHRONOUS)
    sdo.put(index + 0x200, 0, "<B", 0)
    for place, (target, bits) in enumerate(mapped, start=1):
        sdo.put(index + 0x200, place, "<I", target << 16 | bits)
    sdo.put(index + 0x200, 0, "<B", len(mapped))
    sdo.put(index, 1, "<I", cob_id)


def found_of(sdo: Sdo, drive: int, limits: DriveLimits | None = None) -> Found:
    """What a drive is."""
    state = state_of(sdo.get(o.STATUS, 0, "<H"))
    code = sdo.maybe(o.ERROR_CODE, 0, "<H") or 0
    volts = sdo.maybe(o.SUPPLY, 0, "<I")
    return Found(
        id=drive,
        type=sdo.text(o.DEVICE_NAME) or "CiA 402",
        firmware=sdo.text(o.SOFTWARE),
        voltage=math.nan if volts is None else 1e-3 * volts,
        fault=DriveFault(code, o.error_name(code)) if state is State.FAULT else None,
        limits=limits or DriveLimits(),
    )


def scan(bus: str, ids: Sequence[int] = IDS) -> list[Found]:
    """What answers on a bus, of CiA 402."""
    with CanLine(bus) as line:
        for drive in ids:
            line.send(o.SDO_REQUEST | drive, struct.pack("<BHBI", 0x40, o.DEVICE_TYPE, 0, 0))
        heard = {m.arbitration_id & 0x7F: bytes(m.data) for m in line.collect(2.0 * PATIENCE)
                 if m.arbitration_id & 0x780 == o.SDO_ANSWER}  # fmt: skip
        return [
            found_of(Sdo(line, drive), drive)
            for drive, data in sorted(heard.items())
            if len(data) == 8 and data[4] | data[5] << 8 == o.PROFILE
        ]


make = maker(
    Cia402Drives,
    bus="socketcan:can0",
    ids=IDS,
    whole={"bitrate": 0.0, "modes": "csp csv cst", "unwatched": 0.0},
    each={"counts": 0.0, "velocity_counts": 0.0, "rated_torque": 0.0, "motor_counts": 0.0},
)
