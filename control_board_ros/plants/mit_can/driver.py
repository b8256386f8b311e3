# SPDX-License-Identifier: Apache-2.0
"""Damiao and RobStride motors on one bus: a frame of q, q̇, k, d, τ down and one up for each.

They accept ``impedance`` as it is, and ``torque`` as an impedance with k = d = 0. What they differ
in is in ``damiao``, ``robstride`` and ``robstride_private``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ...core.terms.drives import OnSilence, SetPoint
from ..drives.can_drives import CanDrives, CanOptions
from ..drives.can_line import PATIENCE, CanLine, Frame
from ..drives.driver import ONE_TURN, Answers, Identity, Order, Traits
from ..drives.faults import coded, flagged
from ..drives.interview import Questions, converse
from ..drives.plant import maker
from ..drives.set_id import check, verify
from ..errors import PlantSettingsError
from ..interface import DriveFault, Setup
from . import damiao as d
from . import frames as f
from . import robstride as r
from . import robstride_private as p

IDS = range(1, 128)
Motor = d.Damiao | r.RobStride | p.RobStridePrivate


@dataclass(frozen=True, kw_only=True)
class MitOptions(CanOptions):
    """With the models and protocols of its motors."""

    axis = f.MitAxis
    axes: tuple[f.MitAxis, ...] = ()


class MitDrives(CanDrives[MitOptions]):
    """The motors of one bus; see ``drives.driver.Driver``."""

    def __init__(self, options: MitOptions) -> None:
        super().__init__(options, bitrate=options.bitrate)
        self.traits = Traits(
            set_points=(SetPoint.IMPEDANCE, SetPoint.TORQUE),
            on_silence=(OnSilence.FREE,),
            resolution=2.0 * 12.5 / 2**16,
            torque=True,
            temperature=True,
            laws={d.MIT_MODE: "MIT", p.OPERATION: "operation control"},
        )
        self._motors = [self._motor(axis) for axis in options.axes]
        self._turn = 0  # of RobStride's: whose faults are requested

    def _motor(self, axis: f.MitAxis) -> Motor:
        """A motor, as far as it is known before it answers.

        Raises:
            PlantSettingsError: no such model or id, or a watchdog that cannot be set.
        """
        if axis.model == f.DAMIAO:
            return d.Damiao(axis, self._options.bus)
        if axis.protocol == f.PRIVATE:
            return p.RobStridePrivate(axis, self._options.bus)
        motor = r.RobStride(axis, self._options.bus)
        if axis.protocol != f.MIT:
            raise axis.refused("protocol", f"{f.PRIVATE} or {f.MIT} is required")
        if not self._options.unwatched:
            raise PlantSettingsError(
                f"{axis.name}: no MIT frame sets the watchdog of a RobStride motor; store its "
                "canTimeout with the maker's tool, then add unwatched=1 to plant_arguments; or "
                "set its private protocol, and remove protocol=mit"
            )
        return motor

    def open(self, setup: Setup, answers: Answers) -> None:
        super().open(setup, answers)
        self._check_gains()

    def law(self, k: int, kind: SetPoint) -> int | str:
        del kind
        return self._motors[k].law

    def set_up(self, k: int) -> Questions[Identity]:
        return self._motors[k].set_up(self._setup.timeout)

    def confirm(self, k: int) -> Questions[bool]:
        return self._motors[k].confirm(self._setup.timeout)

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

    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        for k, order in orders.items():
            yield from self._motors[k].frames(order, self._answers, k)
            yield from order.request
        silent = [
            k
            for k, order in orders.items()
            if isinstance(self._motors[k], r.RobStride) and order.interview is None
        ]
        if silent:
            k = silent[self._turn % len(silent)]
            self._turn, self._answers.asked[k] = self._turn + 1, self._answers.asked[k] + 1
            yield self._axes[k].id, r.READ_FAULTS

    def close(self) -> None:
        self.line.close(motor.off for motor in self._motors)

    def _take(self, message: Any) -> int | None:
        for order in self._orders.values():
            if order.interview is not None and order.interview.hear(message):
                break
        for k, motor in enumerate(self._motors):
            if motor.sent(message):
                return k if motor.take(message, self._answers, k) else None
        return None


def scan(bus: str) -> list[Identity]:
    """What answers on a bus; it only reads, a motor that runs keeps its power."""
    identities, ids = list[Identity](), set[int]()

    def add(drive: int, make: str, fault: DriveFault | None, **more: Any) -> None:
        ids.add(drive)
        identities.append(Identity(id=drive, type=make, fault=fault, turn=ONE_TURN, **more))

    with CanLine(bus) as line:
        for drive in d.IDS:
            for _ in line.ask(d.reading(drive, d.MST_ID, several=True)):
                line.send(d.REGISTERS, d.refresh(drive))
                states = [m.data[0] >> 4 for m in line.collect(PATIENCE / 10) if len(m.data) == 8]
                faults = [coded(state, d.FAULTS) for state in states if state in d.FAULTS]
                version = "".join(f"{int(n)}" for n in line.ask(d.reading(drive, d.SW_VER)))
                add(drive, "Damiao", faults[0] if faults else None, firmware=version)
        for drive, _ in line.survey(p.identity, (drive for drive in IDS if drive not in ids)):
            volts, word = (
                [*line.ask(p.reading(drive, index)), math.nan][0]
                for index in (p.VOLTAGE, p.FAULTS)
            )
            fault = flagged(0 if math.isnan(word) else int(word), r.FAULTS)
            add(drive, "RobStride", fault, voltage=volts)
        for drive, word in line.survey(r.faults, (drive for drive in IDS if drive not in ids)):
            add(drive, f"RobStride, protocol={f.MIT}", flagged(word, r.FAULTS))
    return identities


def set_id(bus: str, old: int, new: int) -> None:
    """Give a motor another id, which it stores.

    Raises:
        OSError, ValueError: it cannot be; see ``drives.set_id``.
    """
    with CanLine(bus) as line:

        def heard(drive: int) -> int:
            return len(kinds(line, drive))

        (kind,) = kinds(line, old)[:1] or [""]
        check(old, new, d.IDS if kind == f.DAMIAO else IDS, heard)
        if kind == f.DAMIAO:
            converse(d.change_id(old, new), line.ask)
        elif kind == f.PRIVATE:
            converse(p.change_id(old, new), line.ask)
        else:
            line.ask(r.motion(old, [(old, b"\xff" * 6 + bytes([new, r.SET_ID]))]))
        verify(old, new, heard)


def kinds(line: CanLine, drive: int) -> list[str]:
    """The drives that answer as an id, each by its kind: "damiao", "private" or "mit"."""
    for kind, question in (
        (f.DAMIAO, d.reading(drive, d.MST_ID, several=True)),
        (f.PRIVATE, p.identity(drive)),
        (f.MIT, r.faults(drive)),  # it would be a command of a Damiao
    ):
        if answers := line.ask(question):
            return [kind] * len(answers)
    return []


make = maker(MitDrives, MitOptions, IDS)
