# SPDX-License-Identifier: Apache-2.0
"""Fault codes and their record (SPEC F).

Codes 0 to 18 follow the joint fault list of the iCub's motor boards; those that a simulated or
generic joint cannot have (CAN bus, Hall sensors) keep their numbers free. 19 to 28 are ours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import NamedTuple


class FaultCode(IntEnum):
    """Why a joint is in HW_FAULT."""

    EXTERNAL = 0
    OVERCURRENT = 1
    I2T = 2
    TORQUE_SENSOR = 8
    ENCODER_INVALID = 9
    ENCODER_SILENT = 10
    ENCODER_SPIKE = 11
    ENCODER_MISMATCH = 14
    DIVERGED = 15
    UNSUPPORTED = 16
    HARD_LIMIT = 17
    OVERHEATING = 19
    CALIBRATION = 20
    REFERENCE_TIMEOUT = 21
    PLANT = 22
    CONTROLLER = 23
    EMERGENCY_STOP = 24
    DRIVE = 25
    BRAKE = 26
    OVERSPEED = 27
    CONTACT = 28

    @property
    def title(self) -> str:
        """The name in words, for messages."""
        return TITLES[self]


TITLES = {
    FaultCode.EXTERNAL: "external fault",
    FaultCode.OVERCURRENT: "overcurrent",
    FaultCode.I2T: "I2t overload",
    FaultCode.TORQUE_SENSOR: "torque sensor",
    FaultCode.ENCODER_INVALID: "encoder invalid",
    FaultCode.ENCODER_SILENT: "encoder silent",
    FaultCode.ENCODER_SPIKE: "encoder spike",
    FaultCode.ENCODER_MISMATCH: "encoder mismatch",
    FaultCode.DIVERGED: "simulation diverged",
    FaultCode.UNSUPPORTED: "unsupported mode",
    FaultCode.HARD_LIMIT: "hard limit overrun",
    FaultCode.OVERHEATING: "overheating",
    FaultCode.CALIBRATION: "calibration failed",
    FaultCode.REFERENCE_TIMEOUT: "reference timeout",
    FaultCode.PLANT: "plant",
    FaultCode.CONTROLLER: "controller diverged",
    FaultCode.EMERGENCY_STOP: "emergency stop",
    FaultCode.DRIVE: "drive",
    FaultCode.BRAKE: "brake",
    FaultCode.OVERSPEED: "overspeed",
    FaultCode.CONTACT: "contact",
}


@dataclass(frozen=True, slots=True)
class FaultRecord:
    """The last fault of a joint, kept also after it is cleared (F5).

    Attributes: name (of the joint), active, code (-1: there was none), text, stamp (s, the
    time of the reading that showed it).
    """

    name: str
    active: bool = False
    code: int = -1
    text: str = "no fault"
    stamp: float = 0.0

    def cleared(self) -> FaultRecord:
        """The same record, no longer active."""
        return replace(self, active=False)


class Cause(NamedTuple):
    """The cause of a fault: code, measured value against its limit, remedy.

    ``wait``: until it can be gone, s; 0 where time alone does not help.
    """

    code: FaultCode
    text: str
    advice: str = "remove it"
    wait: float = 0.0
