# SPDX-License-Identifier: Apache-2.0
"""The freeze frame of a fault, as received from a board (SPEC E3)."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from control_board_ros.core.terms.faults import FaultRecord
from control_board_ros.protocols import Floats
from control_board_ros.text import clean, clean_name

from .errors import InvalidAnswer
from .state import seconds

#: Maximum cycles of a frame: 2 s at 20 kHz.
MAX_CYCLES = 40_000


@dataclass(frozen=True, slots=True, eq=False)
class FreezeFrame:
    """Measurements and references around the last fault of a joint, arrays of shape (k,).

    Units are those of revolute joints; sliding joints have m, m/s and N in their place.

    Attributes:
        fault: the fault.
        stamps: time of each reading, s; one per control cycle.
        position: measured, rad.
        velocity: measured, rad/s.
        torque: measured, N·m; NaN without a torque sensor.
        position_reference: followed, rad.
        velocity_reference: followed, rad/s.
        torque_reference: followed, N·m.
        output: PWM asked for, percent.
        current: of the motor, A.
        temperature: of the winding, °C.
        applied: PWM that acted, percent.
        age: of the joint's reading, s.
        external_torque: from outside, N·m; NaN where it is not known.
        motion_done: whether no position move was active.
    """

    fault: FaultRecord
    stamps: Floats
    position: Floats
    velocity: Floats
    torque: Floats
    position_reference: Floats
    velocity_reference: Floats
    torque_reference: Floats
    output: Floats
    current: Floats
    temperature: Floats
    applied: Floats
    age: Floats
    external_torque: Floats
    motion_done: NDArray[np.bool_]

    def csv(self) -> str:
        """As a table: a row per control cycle, its time from the fault (s) first."""
        times = self.stamps - self.fault.stamp
        columns = np.column_stack([times, *(getattr(self, name) for name in NUMBERS)])
        rows = [",".join(f"{number:.9g}" for number in row) for row in columns.tolist()]
        return "\n".join([",".join(("time", *NUMBERS)), *rows, ""])

    @classmethod
    def of(cls, response: Any, board: str) -> Self:
        """The frame of a response; raises InvalidAnswer where its lengths differ."""
        count = len(response.stamps)
        for name in (*NUMBERS, "motion_done"):
            if len(getattr(response, name)) != count or count > MAX_CYCLES:
                entries = len(getattr(response, name))
                raise InvalidAnswer(
                    f"{board}/get_freeze_frame sent an invalid response: {entries} {name} for "
                    f"{count} stamps"
                )
        return cls(
            fault=fault_record(response.fault),
            stamps=np.array([seconds(stamp) for stamp in response.stamps]),
            motion_done=np.array(response.motion_done, dtype=np.bool_),
            **{name: np.array(getattr(response, name)) for name in NUMBERS},
        )


#: Fields with a value per reading.
NUMBERS = tuple(
    field.name
    for field in fields(FreezeFrame)
    if field.type == "Floats" and field.name != "stamps"
)


def fault_record(fault: Any) -> FaultRecord:
    """Record of a JointFault message, its texts sanitised."""
    return FaultRecord(
        name=clean_name(fault.name),
        active=fault.active,
        code=fault.code,
        text=clean(fault.text),
        stamp=seconds(fault.stamp),
    )
