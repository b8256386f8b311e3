# SPDX-License-Identifier: Apache-2.0
"""What a board reports of its joints: faults with their record (SPEC F), and events for its log.

Codes 0 to 18 follow the joint fault list of the iCub's motor boards; those that a simulated or
generic joint cannot have (CAN bus, Hall sensors) keep their numbers free. 19 to 28 are ours.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from types import MappingProxyType
from typing import NamedTuple

#: Maximum number of unread events; the oldest are dropped.
EVENTS_KEPT = 1000


class FaultCode(IntEnum):
    """Why a joint is in HW_FAULT; ``title``: in words, for messages."""

    title: str

    def __new__(cls, number: int, title: str = "") -> FaultCode:
        """A code by its number and its words."""
        code = int.__new__(cls, number)
        code._value_, code.title = number, title
        return code

    EXTERNAL = 0, "external fault"
    OVERCURRENT = 1, "overcurrent"
    I2T = 2, "I2t overload"
    TORQUE_SENSOR = 8, "torque sensor"
    ENCODER_INVALID = 9, "encoder invalid"
    ENCODER_SILENT = 10, "encoder silent"
    ENCODER_SPIKE = 11, "encoder spike"
    ENCODER_MISMATCH = 14, "encoder mismatch"
    DIVERGED = 15, "simulation diverged"
    UNSUPPORTED = 16, "unsupported mode"
    HARD_LIMIT = 17, "hard limit overrun"
    OVERHEATING = 19, "overheating"
    CALIBRATION = 20, "calibration failed"
    REFERENCE_TIMEOUT = 21, "reference timeout"
    PLANT = 22, "plant"
    CONTROLLER = 23, "controller diverged"
    EMERGENCY_STOP = 24, "emergency stop"
    DRIVE = 25, "drive"
    BRAKE = 26, "brake"
    OVERSPEED = 27, "overspeed"
    CONTACT = 28, "contact"


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


@dataclass(frozen=True, slots=True)
class BoardEvent:
    """An event of a control cycle, for the log.

    Attributes: level (``info``, ``warning`` or ``error``), key (shared by its repetitions),
    joint (name), text (one line).
    """

    level: str
    key: str
    joint: str
    text: str


class Events:
    """The unread events of a board.

    Args:
        owners: names of parts by joint; events of others are the whole board's, whose name is
            empty.
    """

    def __init__(self, owners: Mapping[str, str] = MappingProxyType({})) -> None:
        self._owners = owners
        parts = {"", *owners.values()}
        self._waiting = {part: deque[BoardEvent](maxlen=EVENTS_KEPT) for part in parts}

    def add(self, level: str, key: str, joint: str, text: str) -> None:
        """Add an event."""
        waiting = self._waiting[self._owners.get(joint, "")]
        waiting.append(BoardEvent(level, key, joint, text))

    def take(self, part: str = "") -> list[BoardEvent]:
        """The events of a part, or of the board, since the last call, oldest first."""
        waiting = self._waiting[part]
        events = list(waiting)
        waiting.clear()
        return events
