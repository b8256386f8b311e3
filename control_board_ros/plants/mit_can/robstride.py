# SPDX-License-Identifier: Apache-2.0
"""RobStride motors in their MIT protocol: scales by model, faults, and a loss of power.

Answer    id · q 16 bit · q̇ 12 · τ 12 · temperature 16, 0.1 °C; from the master's id
Faults    on request: id · 32 bits, lowest byte first · zeros

An answer holds no state, and no frame of this protocol sets the watchdog: a motor that lost its
power by its watchdog or a restart is detected by its missing torque.
"""

from __future__ import annotations

from typing import Any

from ...text import nearest
from ..drives.axes import Axis
from ..drives.can_line import ATTEMPTS, CanLine
from ..drives.faults import flagged
from ..errors import PlantSettingsError
from ..interface import DriveFault
from . import frames as f

#: The id of the host that motors answer to, as their maker sets it.
MASTER = 0xFD
RUN_MIT, READ_FAULTS = (b"\xff" * 6 + bytes([0, last]) for last in (0xFC, 0xFB))
#: Published ranges by model.
MODELS = {
    "rs00": f.Ranges(12.57, 33.0, 14.0),
    "rs01": f.Ranges(12.57, 44.0, 17.0),
    "rs02": f.Ranges(12.57, 44.0, 17.0),
    "rs03": f.Ranges(12.57, 20.0, 60.0, 5000.0, 100.0),
    "rs04": f.Ranges(12.57, 15.0, 120.0, 5000.0, 100.0),
    "rs05": f.Ranges(12.57, 50.0, 5.5),
    "rs06": f.Ranges(12.57, 50.0, 36.0, 5000.0, 100.0),
}
FAULTS = {
    1 << 0: "over temperature",
    1 << 1: "driver chip",
    1 << 2: "under-voltage",
    1 << 3: "over-voltage",
    1 << 4: "over-current of phase B",
    1 << 5: "over-current of phase C",
    1 << 7: "encoder not calibrated",
    1 << 8: "hardware identification",
    1 << 9: "position initialization",
    1 << 14: "stall overload",
    1 << 16: "over-current of phase A",
}
#: Share of its range from which a commanded torque counts; share of it that is no torque;
#: answers until the loss is reported.
ASKED, GIVEN, PATIENT = 0.02, 0.1, 20
POWERLESS = DriveFault(0, "no torque, though it is on: its watchdog acted, or it restarted")


def ranges(axis: Axis) -> f.Ranges:
    """The ranges of a motor: of its model, or of its option ``scales``.

    Raises:
        PlantSettingsError: the model is unknown, or the scales are invalid.
    """
    model, scales = str(axis.own["model"]), str(axis.own["scales"])
    if model not in MODELS:
        known = [f.DAMIAO, *MODELS]
        hint = nearest(model, known)
        raise PlantSettingsError(
            f"{axis.name}.model={model}: unknown{hint}; known: {', '.join(known)}"
        )
    if not scales:
        return MODELS[model]
    try:
        found = f.Ranges(*map(float, scales.split("/")))
    except (TypeError, ValueError):
        found = f.Ranges(0.0, 0.0, 0.0)
    if not all(value > 0.0 for value in found):
        raise PlantSettingsError(
            f"{axis.name}.scales={scales}: rad/(rad/s)/(N·m)/(N·m/rad)/(N·m·s/rad) is required, "
            "as 12.57/44/17/500/5"
        )
    return found


def faults(line: CanLine, drive: int, attempts: int = ATTEMPTS) -> list[int]:
    """The words of faults of motors with this id: none, one, or several."""

    def pick(message: Any) -> bytes | None:
        data = bytes(message.data)
        mine = message.arbitration_id == MASTER and len(data) == 8 and data[0] == drive
        return data[1:5] if mine and fault_word(data) is not None else None

    found = line.answers(drive, READ_FAULTS, pick, attempts)
    return [int.from_bytes(data, "little") for data in found]


def fault_word(data: bytes) -> int | None:
    """The faults of an answer; None: it holds the motion."""
    return int.from_bytes(data[1:5], "little") if data[5:] == bytes(3) else None


class Faults:
    """Faults of a motor, and whether it applies the commanded torque.

    Attributes: word (its faults, as it answers), command (q, q̇, k, d, τ of the last frame).
    """

    def __init__(self, ranges: f.Ranges) -> None:
        self._most, self.word = ranges.torque, 0
        self.reset()

    def reset(self) -> None:
        """Retry a motor that applied no torque."""
        self._without, self.command = 0, (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def found(self) -> DriveFault | None:
        """Those that it reports, or a loss of power."""
        lost = POWERLESS if self._without >= PATIENT else None
        return flagged(self.word, FAULTS) or lost

    def compare(self, q: float, dq: float, torque: float) -> None:
        """Compare an answer (rad, rad/s, N·m) with the command before it."""
        if self._without >= PATIENT:
            return
        at, rate, k, d, forward = self.command
        wanted = min(abs(forward + k * (at - q) + d * (rate - dq)), self._most)
        none = wanted > ASKED * self._most and abs(torque) < GIVEN * wanted
        self._without = self._without + 1 if none else 0
