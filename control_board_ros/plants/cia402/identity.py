# SPDX-License-Identifier: Apache-2.0
"""What a CiA 402 drive reports of itself: units, limits, type, firmware, voltage, fault."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..drives.axes import Axis
from ..drives.driver import Found
from ..errors import PlantSettingsError
from ..interface import DriveFault, DriveLimits
from . import objects as o
from .sdo import Sdo
from .states import State, state_of

REV = 2.0 * math.pi


class Scale(NamedTuple):
    """Units of one drive per unit at its output: counts/rad, (counts/s)/(rad/s), ‰/(N·m)."""

    position: float
    velocity: float
    torque: float


#: Before a drive is set up.
UNKNOWN = Scale(1.0, 1.0, 1.0)


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


def found_of(sdo: Sdo, drive: int, limits: DriveLimits | None = None) -> Found:
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
