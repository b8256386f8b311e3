# SPDX-License-Identifier: Apache-2.0
"""Damiao and RobStride motors in MIT mode: a frame down and one up for each, k, d, τ in the motor.

They accept ``impedance`` as it is, and ``torque`` as an impedance with k = d = 0.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from ...core.config.config import JointConfig
from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Axis, Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.maker import maker, only
from ..drives.plant import RESTARTED, Answers, Found, Traits, Wanted
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import frames as f
from . import robstride as r

IDS = range(1, 128)
#: Of Damiao's, whose answers hold four bits of an id.
SHORT_IDS = range(1, 16)


class MitDrives:
    """The motors of one bus; see ``drives.plant.Driver``."""

    def __init__(self, options: Options) -> None:
        self._options, self._axes = options, options.axes
        self.traits = Traits(
            set_points=(SetPoint.IMPEDANCE, SetPoint.TORQUE),
            on_silence=(OnSilence.FREE,),
            resolution=2.0 * 12.5 / 2**16,
            torque=True,
            temperature=True,
        )
        self._line = CanLine(options.bus, bitrate=int(options.own["bitrate"]))
        n = len(self._axes)
        self._ranges = [self._check(axis) for axis in self._axes]
        #: Of RobStride's motors; the next one whose faults are requested.
        self._power = {k: r.Power(self._ranges[k]) for k, axis in enumerate(self._axes)
                       if axis.own["model"] != f.DAMIAO}  # fmt: skip
        self._turn = 0
        #: By the id of an answer's frame, and that in its first byte.
        self._places: dict[tuple[int, int], int] = {}
        self._masters: set[int] = set()
        self._words = [0] * n
        self._powered, self._enabled, self._restarted = [False] * n, [False] * n, [False] * n

    def _check(self, axis: Axis) -> f.Ranges:
        """Its ranges, as far as they are known before it answers.

        Raises:
            PlantSettingsError: no such model or id, or a watchdog that cannot be set.
        """
        if axis.own["model"] == f.DAMIAO:
            if axis.id not in SHORT_IDS:
                raise PlantSettingsError(
                    f"{axis.name}.id={axis.id}: 1 to 15 is wanted: answers hold four bits of it"
                )
            return f.Ranges(12.5, 30.0, 10.0)
        found = r.ranges(axis)
        if not self._options.own["unwatched"]:
            raise PlantSettingsError(
                f"{axis.name}: no MIT frame sets the watchdog of a RobStride motor; store its "
                "canTimeout with the maker's tool, then add unwatched=1 to plant_arguments"
            )
        return found

    def open(self, setup: Setup, joints: Sequence[JointConfig | None]) -> list[Found]:
        """Open the bus; see ``drives.plant.Driver``."""
        self._line.open()
        self._setup, self._joints = setup, joints
        self._wait = budget(setup.period)
        self._places.clear()
        self._check_gains()
        return [self._set_up(k) for k in range(len(self._axes))]

    def _set_up(self, k: int) -> Found:
        """No power, MIT mode, watchdog; returns what it is."""
        self._powered[k] = self._enabled[k] = self._restarted[k] = False
        firmware = self._set_up_robstride(k) if k in self._power else self._set_up_damiao(k)
        ranges, model = self._ranges[k], str(self._axes[k].own["model"])
        return Found(
            id=self._axes[k].id,
            type="Damiao" if model == f.DAMIAO else f"RobStride {model.upper()}",
            firmware=firmware,
            limits=DriveLimits(
                lower=-ranges.position,
                upper=ranges.position,
                velocity=ranges.velocity,
                torque=ranges.torque,
            ),
        )

    def _set_up_damiao(self, k: int) -> str:
        line, axis = self._line, self._axes[k]
        told = registers(line, axis.id, f.MASTER_ID, first=True)
        master = only(told, axis, self._options.bus, "mit_can")
        self._places[master, axis.id] = k
        self._masters.add(master)
        line.send(axis.id, f.DISABLE)
        line.send(axis.id, f.CLEAR)
        put(line, axis.id, f.CONTROL_MODE, f.MIT_MODE)
        put(line, axis.id, f.TIMEOUT, int(self._setup.timeout / f.TIMEOUT_STEP))
        self._ranges[k] = f.Ranges(*(get(line, axis.id, f.POSITION_RANGE + n) for n in range(3)))
        return f"{int(get(line, axis.id, f.SOFTWARE))}"

    def _set_up_robstride(self, k: int) -> str:
        line, axis = self._line, self._axes[k]
        only(faults(line, axis.id), axis, self._options.bus, "mit_can")
        self._places[r.MASTER, axis.id] = k
        line.send(axis.id, f.DISABLE)
        self._masters.add(r.MASTER)
        line.send(axis.id, f.CLEAR)
        line.send(axis.id, r.RUN_MIT)
        self._power[k], self._words[k] = r.Power(self._ranges[k]), 0
        return ""

    def _check_gains(self) -> None:
        """Positions are followed by k and d of the board's own gains: they must fit the frame.

        Raises:
            PlantSettingsError: they do not; with the ratios that hold them.
        """
        needed = {}
        for n, (joint, ranges) in enumerate(zip(self._joints, self._ranges, strict=True)):
            if joint is not None:
                gains = joint.position_pid
                most = max(gains.kp / ranges.stiffest, gains.kd / ranges.most_damped)
                if (ratio := math.sqrt(most)) > self._axes[n].ratio:
                    needed[ratio] = n, gains
        if needed:
            ratio = max(needed)
            n, gains = needed[ratio]
            axis, ranges = self._axes[n], self._ranges[n]
            option = "ratio" if len(needed) > 1 else f"{axis.name}.ratio"
            raise PlantSettingsError(
                f"{axis.name}: position_pid.kp={gains.kp:.4g}, kd={gains.kd:.4g} is not allowed; "
                f"its motor holds {ranges.stiffest:g} and {ranges.most_damped:g}, with ratio "
                f"{axis.ratio:g}; lower them, or give gears: plant_arguments "
                f"[{option}={math.ceil(10.0 * ratio) / 10.0}]"
            )

    def exchange(self, wanted: Wanted, answers: Answers) -> None:
        """Set-points and answers; see ``drives.plant.Driver``."""
        line, self._answers = self._line, answers
        line.drain(self._take)
        for k, (kind, value) in wanted.items():
            drive = self._axes[k].id
            lost = k in self._power and (self._power[k].lost or self._words[k])
            on = kind is not SetPoint.OFF and not (self._restarted[k] or lost)
            if on and not self._powered[k]:
                line.send(drive, f.ENABLE)
            self._powered[k] = on
            if not on:
                self._enabled[k] = False
            line.send(drive, self._command(k, kind, value) if on else f.DISABLE)
        if blind := [k for k in self._power if k in wanted]:
            self._turn += 1
            line.send(self._axes[blind[self._turn % len(blind)]].id, r.READ_FAULTS)
        line.gather(self._take, wanted, self._wait)

    def clear_fault(self, drive: int) -> Found | None:
        """Clear faults; set up again a motor that restarted."""
        anew = None
        line, axis = self._line, self._axes[drive].id
        if drive in self._power:
            for data in (f.CLEAR, f.DISABLE, r.RUN_MIT):
                line.send(axis, data)
            self._power[drive], self._powered[drive] = r.Power(self._ranges[drive]), False
        elif not self._restarted[drive]:
            line.send(axis, f.CLEAR)
        elif registers(line, axis, f.MASTER_ID):
            anew = self._set_up(drive)
        return anew

    def close(self) -> None:
        """Power off, and leave the bus."""
        self._line.close((axis.id, f.DISABLE) for axis in self._axes)

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> bytes:
        springs = kind is SetPoint.IMPEDANCE
        asked = (
            value[Value.POSITION],
            value[Value.VELOCITY],
            value[Value.STIFFNESS] if springs else 0.0,
            value[Value.DAMPING] if springs else 0.0,
            value[Value.TORQUE],
        )
        if k in self._power:
            self._power[k].asked = asked
        return f.packed(self._ranges[k], *asked)

    def _take(self, message: Any) -> int | None:
        answers, data, source = self._answers, bytes(message.data), message.arbitration_id
        if source not in self._masters:
            return None
        if len(data) != 8:
            answers.malformed += 1
            return None
        k = self._places.get((source, data[0] if source == r.MASTER else data[0] & 0xF))
        if k is None:
            answers.foreign += 1
        elif k in self._power:
            return self._hear_robstride(k, data)
        elif data[2] != f.GET:
            self._move(k, data)
            answers.temperature[k] = data[7]
            answers.faults[k] = self._judge(k, data[0] >> 4)
            return k
        return None

    def _move(self, k: int, data: bytes) -> tuple[float, float, float]:
        """Store the motion of an answer; rad, rad/s, N·m."""
        answers = self._answers
        found = f.readings(self._ranges[k], data)
        answers.position[k], answers.velocity[k], answers.torque[k] = found
        answers.came(k, data)
        return found

    def _hear_robstride(self, k: int, data: bytes) -> int | None:
        power, word = self._power[k], r.fault_word(data)
        if word is None:
            found = self._move(k, data)
            self._answers.temperature[k] = 0.1 * int.from_bytes(data[6:], "big")
            if self._powered[k]:
                power.hear(*found)
        else:
            self._words[k] = word
        lost = r.POWERLESS if power.lost else None
        self._answers.faults[k] = r.fault(self._words[k]) or lost
        return k if word is None else None

    def _judge(self, k: int, state: int) -> DriveFault | None:
        if state == f.ENABLED:
            self._enabled[k] = self._powered[k]
        elif state == f.DISABLED and self._powered[k] and self._enabled[k]:
            self._restarted[k] = True
        if state not in (f.DISABLED, f.ENABLED):
            return DriveFault(state, f.FAULTS.get(state, "see its manual"))
        return RESTARTED if self._restarted[k] else None


def faults(line: CanLine, drive: int, attempts: int = ATTEMPTS) -> list[bytes]:
    """What RobStride motors of that id answer for their faults."""

    def pick(message: Any) -> bytes | None:
        data = bytes(message.data)
        mine = message.arbitration_id == r.MASTER and len(data) == 8 and data[0] == drive
        return data if mine and r.fault_word(data) is not None else None

    return line.answers(drive, r.READ_FAULTS, pick, attempts)


def registers(line: CanLine, drive: int, number: int, *, first: bool = False) -> list[int]:
    """What drives of that id have in a register of whole numbers; of several, if ``first``."""
    question = bytes([drive, 0, f.GET, number, 0, 0, 0, 0])
    attempts = ATTEMPTS if first else 1
    told = line.answers(f.REGISTERS, question, lambda m: _register(m, drive, number), attempts)
    return [int.from_bytes(data, "little") for data in told]


def get(line: CanLine, drive: int, number: int) -> float:
    """A register of a drive."""
    data = _ask(line, drive, bytes([drive, 0, f.GET, number, 0, 0, 0, 0]), number)
    if number in f.WHOLE:
        return float(int.from_bytes(data, "little"))
    value: float = struct.unpack("<f", data)[0]
    return value


def put(line: CanLine, drive: int, number: int, value: int) -> None:
    """Write a register of whole numbers, until it is lost with the power."""
    _ask(line, drive, struct.pack("<BBBBI", drive, 0, f.SET, number, value), number)


def _ask(line: CanLine, drive: int, data: bytes, number: int) -> bytes:
    found = line.ask(f.REGISTERS, data, lambda m: _register(m, drive, number))
    if found is None:
        raise ConnectionError(f"id {drive} does not answer for register {number}")
    return found


def _register(message: Any, drive: int, number: int) -> bytes | None:
    data = bytes(message.data)
    if len(data) == 8 and data[:2] == bytes([drive, 0]) and data[2] in (f.GET, f.SET):
        return data[4:] if data[3] == number and message.arbitration_id < f.REGISTERS else None
    return None


def scan(bus: str, ids: Sequence[int] = SHORT_IDS) -> list[Found]:
    """What answers on a bus."""
    with CanLine(bus) as line:
        found = []
        for drive in ids:
            for _ in registers(line, drive, f.MASTER_ID):
                line.send(drive, f.DISABLE)
                states = [m.data[0] >> 4 for m in line.collect(PATIENCE / 10) if len(m.data) == 8]
                fault = next((state for state in states if state in f.FAULTS), 0)
                found.append(
                    Found(
                        id=drive,
                        type="Damiao",
                        firmware=f"{int(get(line, drive, f.SOFTWARE))}",
                        fault=DriveFault(fault, f.FAULTS[fault]) if fault else None,
                    )
                )
        for drive in IDS:
            line.send(drive, f.DISABLE)
        mine = [m for m in line.collect(2.0 * PATIENCE) if m.arbitration_id == r.MASTER]
        for drive in sorted({m.data[0] for m in mine if len(m.data) == 8}):
            word = next((r.fault_word(data) or 0 for data in faults(line, drive)), 0)
            found.append(Found(id=drive, type="RobStride", fault=r.fault(word)))
        return found


make = maker(
    MitDrives,
    bus="socketcan:can0",
    ids=IDS,
    whole={"bitrate": 0.0, "unwatched": 0.0},
    each={"model": f.DAMIAO, "scales": ""},
)
