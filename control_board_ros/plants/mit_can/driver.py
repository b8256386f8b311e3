# SPDX-License-Identifier: Apache-2.0
"""Damiao motors in MIT mode: one frame down and one up for each, k, d and τ in the motor.

They take ``impedance`` as it is, and ``torque`` as an impedance with k = d = 0.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

from ...core.config.config import JointConfig
from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Array
from ...core.terms.set_points import Value
from ..drives.axes import Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.maker import maker, only
from ..drives.plant import RESTARTED, Answers, Found, Traits
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import frames as f

#: Answers tell four bits of an id.
IDS = range(1, 16)


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
        self._line: CanLine | None = None
        self._places = {axis.id: k for k, axis in enumerate(self._axes)}
        n = len(self._axes)
        self._ranges = [f.Ranges(12.5, 30.0, 10.0)] * n
        self._masters = [0] * n
        self._powered, self._enabled, self._restarted = [False] * n, [False] * n, [False] * n

    def open(self, setup: Setup, joints: Sequence[JointConfig | None]) -> list[Found]:
        """Open the bus; see ``drives.plant.Driver``."""
        self._line = CanLine(self._options.bus, bitrate=int(self._options.own["bitrate"]))
        self._setup, self._joints = setup, joints
        self._wait = budget(setup.period)
        return [self._set_up(k) for k in range(len(self._axes))]

    def _set_up(self, k: int) -> Found:
        """No power, MIT mode, watchdog; returns what it is."""
        line, drive = self._opened, self._axes[k].id
        self._check_gains(k)
        told = registers(line, drive, f.MASTER_ID, first=True)
        self._masters[k] = only(told, self._axes[k], self._options.bus, "mit_can")
        line.send(drive, f.DISABLE)
        put(line, drive, f.CONTROL_MODE, f.MIT_MODE)
        put(line, drive, f.TIMEOUT, int(self._setup.timeout / f.TIMEOUT_STEP))
        ranges = f.Ranges(*(get(line, drive, f.POSITION_RANGE + n) for n in range(3)))
        self._ranges[k] = ranges
        self._powered[k] = self._enabled[k] = self._restarted[k] = False
        return Found(
            id=drive,
            type="Damiao",
            firmware=f"{int(get(line, drive, f.SOFTWARE))}",
            limits=DriveLimits(
                lower=-ranges.position,
                upper=ranges.position,
                velocity=ranges.velocity,
                torque=ranges.torque,
            ),
        )

    def _check_gains(self, k: int) -> None:
        """Positions are followed by k and d of the board's own gains: they must fit the frame."""
        axis, joint = self._axes[k], self._joints[k]
        if joint is None:
            return
        gains = joint.position_pid
        for what, value, bound in (("kp", gains.kp, f.STIFFEST), ("kd", gains.kd, f.MOST_DAMPED)):
            if value > (most := bound * axis.ratio**2):
                raise PlantSettingsError(
                    f"{axis.name}: position_pid.{what}={value:.3g} is not allowed; its motor "
                    f"takes {most:.3g} at most, with ratio {axis.ratio:g}"
                )

    def exchange(self, kinds: Sequence[int | None], values: Array, answers: Answers) -> None:
        """Set-points and answers; see ``drives.plant.Driver``."""
        line, self._answers = self._opened, answers
        line.drain(self._take)
        asked = []
        columns = values.T.tolist()
        for k, kind in enumerate(kinds):
            if kind is None:
                continue
            drive = self._axes[k].id
            on = kind != SetPoint.OFF and not self._restarted[k]
            if on and not self._powered[k]:
                line.send(drive, f.ENABLE)
            self._powered[k] = on
            if not on:
                self._enabled[k] = False
            line.send(drive, self._command(k, SetPoint(kind), columns[k]) if on else f.DISABLE)
            asked.append(drive)
        line.gather(self._take, asked, self._wait)

    def clear_fault(self, drive: int) -> None:
        """Clear, and set up anew what started anew."""
        if self._restarted[drive]:
            if registers(self._opened, self._axes[drive].id, f.MASTER_ID):
                self._set_up(drive)
        else:
            self._opened.send(self._axes[drive].id, f.CLEAR)

    def close(self) -> None:
        """Power off, and leave the bus."""
        line, self._line = self._line, None
        if line is not None:
            line.close((axis.id, f.DISABLE) for axis in self._axes)

    @property
    def _opened(self) -> CanLine:
        if self._line is None:
            raise ConnectionError("the bus is not open")
        return self._line

    def _command(self, k: int, kind: SetPoint, value: Sequence[float]) -> bytes:
        springs = kind is SetPoint.IMPEDANCE
        return f.packed(
            self._ranges[k],
            value[Value.POSITION],
            value[Value.VELOCITY],
            value[Value.STIFFNESS] if springs else 0.0,
            value[Value.DAMPING] if springs else 0.0,
            value[Value.TORQUE],
        )

    def _take(self, message: Any) -> int | None:
        answers, data = self._answers, bytes(message.data)
        if len(data) != 8 or message.arbitration_id not in self._masters or data[2] == f.GET:
            answers.malformed += len(data) != 8
            return None
        k = self._places.get(data[0] & 0xF)
        if k is None or message.arbitration_id != self._masters[k]:
            answers.foreign += 1
            return None
        state = data[0] >> 4
        answers.position[k], answers.velocity[k], answers.torque[k] = f.readings(
            self._ranges[k], data
        )
        answers.temperature[k] = data[7]
        answers.faults[k] = self._judge(k, state)
        answers.came(k, data)
        return data[0] & 0xF

    def _judge(self, k: int, state: int) -> DriveFault | None:
        if state == f.ENABLED:
            self._enabled[k] = self._powered[k]
        elif state == f.DISABLED and self._powered[k] and self._enabled[k]:
            self._restarted[k] = True
        if state not in (f.DISABLED, f.ENABLED):
            return DriveFault(state, f.FAULTS.get(state, "see its manual"))
        return RESTARTED if self._restarted[k] else None


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
    found: list[bytes] = []

    def take(message: Any) -> int | None:
        told = _register(message, drive, number)
        if told is None:
            return None
        found.append(told)
        return drive

    for _ in range(ATTEMPTS):
        line.drain(lambda _: None)
        line.send(f.REGISTERS, data)
        line.gather(take, [drive], PATIENCE)
        if found:
            return found[0]
    raise ConnectionError(f"id {drive} does not answer for register {number}")


def _register(message: Any, drive: int, number: int) -> bytes | None:
    data = bytes(message.data)
    if len(data) == 8 and data[:2] == bytes([drive, 0]) and data[2] in (f.GET, f.SET):
        return data[4:] if data[3] == number and message.arbitration_id < f.REGISTERS else None
    return None


def scan(bus: str, ids: Sequence[int] = IDS) -> list[Found]:
    """What answers on a bus."""
    line = CanLine(bus)
    try:
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
        return found
    finally:
        line.close()


make = maker(MitDrives, bus="socketcan:can0", ids=IDS, whole={"bitrate": 0.0})
