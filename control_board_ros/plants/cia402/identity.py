# SPDX-License-Identifier: Apache-2.0
"""What a CiA 402 drive reports of itself: units, limits, type, firmware, voltage, fault."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from ..drives.axes import Axis
from ..drives.driver import Identity
from ..drives.interview import Questions
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits
from . import objects as o
from .sdo import Sdo
from .states import State, state_of

REV = 2.0 * math.pi


@dataclass(frozen=True, kw_only=True)
class Cia402Axis(Axis):
    """A joint; 0: as its drive has it.

    Attributes: counts (per turn of the drive's output), velocity_counts (units of velocity for one
        turn per second), rated_torque (N·m at its output), motor_counts (per turn of an encoder at
        the motor; 0: there is none).
    """

    counts: float = 0.0
    velocity_counts: float = 0.0
    rated_torque: float = 0.0
    motor_counts: float = 0.0


class Scale(NamedTuple):
    """Units of one drive per unit at its output: counts/rad, (counts/s)/(rad/s), ‰/(N·m)."""

    position: float
    velocity: float
    torque: float


#: Before a drive is set up.
UNKNOWN = Scale(1.0, 1.0, 1.0)


def scale_of(axis: Cia402Axis, sdo: Sdo) -> Questions[Scale]:
    """Units of a drive, by its options, or as the drive itself has them.

    Counts per turn of the output: feed constant (0x6092), or else encoder resolution (0x608F)
    times gear ratio (0x6091). Units of velocity: counts/s, or 1/min where 0x60A9 says so.

    Raises:
        PlantSettingsError: the drive does not have them, or has units that are not known.
    """
    counts, speed = axis.counts, axis.velocity_counts
    if counts <= 0.0:
        unit = yield from sdo.maybe(o.POSITION_UNIT, 0, "<I")
        if unit not in (None, o.NO_UNIT):
            raise _unknown(axis, "counts", o.POSITION_UNIT, unit or 0)
        counts = (yield from _ratio(sdo, o.FEED_CONSTANT)) or (
            (yield from _ratio(sdo, o.RESOLUTION))
            * ((yield from _ratio(sdo, o.GEAR_RATIO)) or 1.0)
        )
    if speed <= 0.0:
        unit = (yield from sdo.maybe(o.VELOCITY_UNIT, 0, "<I")) or o.NO_UNIT
        if unit & 0x00FFFFFF == o.PER_MINUTE:
            prefix = (unit >> 24) - (unit >> 31 << 8)
            speed = 60.0 / 10.0**prefix
        elif unit != o.NO_UNIT:
            raise _unknown(axis, "velocity_counts", o.VELOCITY_UNIT, unit)
    rated = axis.rated_torque or 1e-3 * ((yield from sdo.maybe(o.RATED_TORQUE, 0, "<I")) or 0)
    for what, value, index in (
        ("counts", counts, o.RESOLUTION),
        ("rated_torque", rated, o.RATED_TORQUE),
    ):
        if value <= 0.0:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} does not report its {what} (object 0x{index:04x}); "
                f"add {axis.name}.{what}=… to plant_arguments"
            )
    return Scale(counts / REV, (speed or counts) / REV, 1e3 / rated)


def _ratio(sdo: Sdo, index: int) -> Questions[float]:
    """The quotient of the two entries of an object; 0: the drive does not have it."""
    above, below = (yield from sdo.maybe(index, 1, "<I")), (yield from sdo.maybe(index, 2, "<I"))
    return above / below if above and below else 0.0


def _unknown(axis: Axis, what: str, index: int, unit: int) -> PlantSettingsError:
    return PlantSettingsError(
        f"{axis.name}: id {axis.id} has the unit 0x{unit:08x} (object 0x{index:04x}), which is "
        f"not known; add {axis.name}.{what}=… to plant_arguments"
    )


def limits_of(sdo: Sdo, scale: Scale) -> Questions[DriveLimits]:
    """The limits that a drive keeps, as far as it has such objects."""
    lower = yield from sdo.maybe(o.POSITION_LIMITS, 1, "<i")
    upper = yield from sdo.maybe(o.POSITION_LIMITS, 2, "<i")
    speed = yield from sdo.maybe(o.MAX_SPEED, 0, "<I")
    torque = yield from sdo.maybe(o.MAX_TORQUE, 0, "<H")
    limits = DriveLimits(
        velocity=speed * REV / 60.0 if speed else None,
        torque=torque / scale.torque if torque else None,
    )
    if lower is None or upper is None or lower >= upper:
        return limits
    return replace(limits, lower=lower / scale.position, upper=upper / scale.position)


def named(sdo: Sdo, drive: int) -> Questions[Identity]:
    """The identification of a drive."""
    name, software = (yield from sdo.text(o.DEVICE_NAME)), (yield from sdo.text(o.SOFTWARE))
    return Identity(id=drive, type=name or "CiA 402", firmware=software, turn=math.nan)


def identity_of(sdo: Sdo, drive: int) -> Questions[Identity]:
    """The same, with its voltage and fault, as a scan shows them."""
    state = state_of((yield from sdo.get(o.STATUS, 0, "<H")))
    code = (yield from sdo.maybe(o.ERROR_CODE, 0, "<H")) or 0
    volts = yield from sdo.maybe(o.SUPPLY, 0, "<I")
    identity = yield from named(sdo, drive)
    return replace(
        identity,
        voltage=math.nan if volts is None else 1e-3 * volts,
        fault=DriveFault(code, o.error_name(code)) if state is State.FAULT else None,
    )
