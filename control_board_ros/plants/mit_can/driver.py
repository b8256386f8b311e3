# SPDX-License-Identifier: Apache-2.0
"""Damiao and RobStride motors in MIT mode: a frame down and one up for each, k, d, τ in the motor.

They accept ``impedance`` as it is, and ``torque`` as an impedance with k = d = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ...core.terms.measurement import Value
from ..drives.axes import Axis, Options
from ..drives.can_line import ATTEMPTS, PATIENCE, CanLine, budget
from ..drives.driver import Answers, Found, Traits, Wanted, only
from ..drives.faults import coded, flagged
from ..drives.plant import maker
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits, Setup
from . import damiao as d
from . import frames as f
from . import robstride as r

IDS = range(1, 128)
#: Ids of Damiao motors, whose answers hold four bits.
SHORT_IDS = range(1, 16)


@dataclass(slots=True)
class Motor:
    """One motor.

    Attributes: ranges (of its frames), faults (of a RobStride; None: a Damiao), powered (whether
        power is commanded), enabled (whether it reported power since then).
    """

    ranges: f.Ranges
    faults: r.Faults | None = None
    powered: bool = False
    enabled: bool = False


class MitDrives:
    """The motors of one bus; see ``drives.driver.Driver``."""

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
        self._motors = [self._motor(axis) for axis in self._axes]
        self._turn = 0  # of RobStride's: whose faults are requested
        #: By the id of an answer's frame, and that in its first byte.
        self._places: dict[tuple[int, int], int] = {}

    def _motor(self, axis: Axis) -> Motor:
        """A motor, as far as it is known before it answers.

        Raises:
            PlantSettingsError: no such model or id, or a watchdog that cannot be set.
        """
        if axis.own["model"] == f.DAMIAO:
            if axis.id not in SHORT_IDS:
                raise PlantSettingsError(
                    f"{axis.name}.id={axis.id}: 1 to 15 is required: answers hold four bits of it"
                )
            return Motor(f.Ranges(12.5, 30.0, 10.0))
        ranges = r.ranges(axis)
        if not self._options.own["unwatched"]:
            raise PlantSettingsError(
                f"{axis.name}: no MIT frame sets the watchdog of a RobStride motor; store its "
                "canTimeout with the maker's tool, then add unwatched=1 to plant_arguments"
            )
        return Motor(ranges, r.Faults(ranges))

    def open(self, setup: Setup, answers: Answers) -> None:
        self._line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)
        self._places.clear()
        self._check_gains()

    def set_up(self, k: int, attempts: int = ATTEMPTS) -> Found:
        """Disable, set MIT mode and watchdog; returns the identification of the drive."""
        line, axis, motor = self._line, self._axes[k], self._motors[k]
        find = d.masters if motor.faults is None else r.faults
        answer = only(find(line, axis.id, attempts), axis, self._options.bus, "mit_can")
        master = answer if motor.faults is None else r.MASTER
        self._places[master, axis.id] = k
        for data in (f.DISABLE, f.CLEAR):
            line.send(axis.id, data)
        motor.powered = motor.enabled = False
        if motor.faults is None:
            d.put(line, axis.id, d.CONTROL_MODE, d.MIT_MODE)
            d.put(line, axis.id, d.TIMEOUT, int(self._setup.timeout / d.TIMEOUT_STEP))
            motor.ranges = f.Ranges(*(d.get(line, axis.id, number) for number in d.RANGES))
            kind, firmware = "Damiao", f"{int(d.get(line, axis.id, d.SOFTWARE))}"
        else:
            line.send(axis.id, r.RUN_MIT)
            motor.faults = r.Faults(motor.ranges)
            kind, firmware = f"RobStride {str(axis.own['model']).upper()}", ""
        ranges = motor.ranges
        limits = DriveLimits(
            lower=-ranges.position,
            upper=ranges.position,
            velocity=ranges.velocity,
            torque=ranges.torque,
        )
        return Found(id=axis.id, type=kind, firmware=firmware, limits=limits)

    def _check_gains(self) -> None:
        """Positions are followed by k and d of the board's own gains: they must fit the frame.

        Raises:
            PlantSettingsError: they do not fit; with a ratio with which they do.
        """
        needed = {}
        for n, (joint, motor) in enumerate(zip(self._setup.joints, self._motors, strict=True)):
            if joint is not None:
                gains, ranges = joint.position_pid, motor.ranges
                most = max(gains.kp / ranges.stiffest, gains.kd / ranges.most_damped)
                if (ratio := math.sqrt(most)) > self._axes[n].ratio:
                    needed[ratio] = n, gains
        if needed:
            ratio = max(needed)
            n, gains = needed[ratio]
            axis, ranges = self._axes[n], self._motors[n].ranges
            option = "ratio" if len(needed) > 1 else f"{axis.name}.ratio"
            raise PlantSettingsError(
                f"{axis.name}: position_pid.kp={gains.kp:.4g}, kd={gains.kd:.4g} is not allowed; "
                f"its motor holds {ranges.stiffest:g} and {ranges.most_damped:g}, with ratio "
                f"{axis.ratio:g}; lower them, or give gears: plant_arguments "
                f"[{option}={math.ceil(10.0 * ratio) / 10.0}]"
            )

    def exchange(self, wanted: Wanted) -> None:
        line = self._line
        line.drain(self._take)
        for k, (kind, value) in wanted.items():
            drive, motor = self._axes[k].id, self._motors[k]
            on = kind is not SetPoint.OFF and not (motor.faults and motor.faults.found)
            if on and not motor.powered:
                line.send(drive, f.ENABLE)
            motor.powered, motor.enabled = on, motor.enabled and on
            line.send(drive, command(motor, kind, value) if on else f.DISABLE)
        if silent := [k for k in wanted if self._motors[k].faults is not None]:
            self._turn += 1
            line.send(self._axes[silent[self._turn % len(silent)]].id, r.READ_FAULTS)
        line.gather(self._take, wanted, self._wait)

    def clear_fault(self, k: int) -> None:
        line, drive, motor = self._line, self._axes[k].id, self._motors[k]
        line.send(drive, f.CLEAR)
        if motor.faults is not None:
            line.send(drive, f.DISABLE)
            line.send(drive, r.RUN_MIT)
            motor.faults.reset()
            motor.powered = False

    def close(self) -> None:
        self._line.close((axis.id, f.DISABLE) for axis in self._axes)

    def _take(self, message: Any) -> int | None:
        answers, data, source = self._answers, bytes(message.data), message.arbitration_id
        if len(data) != 8:
            return None
        k = self._places.get((source, data[0] if source == r.MASTER else data[0] & 0xF))
        if k is None:
            return None
        motor = self._motors[k]
        faults = motor.faults
        if faults is not None and (word := r.fault_word(data)) is not None:
            faults.word = word
            answers.faults[k] = faults.found
            return None
        if faults is None and d.is_register(data, self._axes[k].id):
            return None  # late, of its set-up
        motion = f.readings(motor.ranges, data)
        answers.position[k], answers.velocity[k], answers.torque[k] = motion
        answers.came(k, data)
        if faults is None:
            answers.temperature[k] = data[7]
            answers.faults[k] = self._judge(k, data[0] >> 4) or beyond(motor.ranges, data)
        else:
            answers.temperature[k] = 0.1 * int.from_bytes(data[6:], "big")
            if motor.powered:
                faults.compare(*motion)
            answers.faults[k] = faults.found
        return k

    def _judge(self, k: int, state: int) -> DriveFault | None:
        motor = self._motors[k]
        if state == d.ENABLED:
            motor.enabled = motor.powered
        elif state == d.DISABLED and motor.powered and motor.enabled:
            self._answers.restarted[k] = True
        return None if state in (d.DISABLED, d.ENABLED) else coded(state, d.FAULTS)


def beyond(ranges: f.Ranges, data: bytes) -> DriveFault | None:
    """The fault of a position at an end of its range: the motor may be beyond it."""
    if data[1:3] not in (b"\0\0", b"\xff\xff"):
        return None
    return DriveFault(0, f"position at the end of its range, {ranges.position:g} rad")


def command(motor: Motor, kind: SetPoint, value: Sequence[float]) -> bytes:
    springs = kind is SetPoint.IMPEDANCE
    values = (
        value[Value.POSITION],
        value[Value.VELOCITY],
        value[Value.STIFFNESS] if springs else 0.0,
        value[Value.DAMPING] if springs else 0.0,
        value[Value.TORQUE],
    )
    if motor.faults is not None:
        motor.faults.command = values
    return f.packed(motor.ranges, *values)


def scan(bus: str) -> list[Found]:
    """What answers on a bus; it only reads, a motor that runs keeps its power."""
    found = []
    with CanLine(bus) as line:
        for drive in SHORT_IDS:
            for _ in d.masters(line, drive):
                line.send(d.REGISTERS, d.refresh(drive))
                states = [m.data[0] >> 4 for m in line.collect(PATIENCE / 10) if len(m.data) == 8]
                faults = [coded(state, d.FAULTS) for state in states if state in d.FAULTS]
                firmware = f"{int(d.get(line, drive, d.SOFTWARE))}"
                fault = faults[0] if faults else None
                found.append(Found(id=drive, type="Damiao", firmware=firmware, fault=fault))
        for drive in set(IDS).difference(one.id for one in found):  # it would be their command
            line.send(drive, r.READ_FAULTS)
        mine = [m for m in line.collect(2.0 * PATIENCE) if m.arbitration_id == r.MASTER]
        for drive in sorted({m.data[0] for m in mine if len(m.data) == 8}):
            word = next(iter(r.faults(line, drive)), 0)
            found.append(Found(id=drive, type="RobStride", fault=flagged(word, r.FAULTS)))
    return found


make = maker(
    MitDrives,
    bus="socketcan:can0",
    ids=IDS,
    whole={"bitrate": 0.0, "unwatched": 0.0},
    each={"model": f.DAMIAO, "scales": ""},
)
