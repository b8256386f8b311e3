# SPDX-License-Identifier: Apache-2.0
"""RobStride motors: scales by model and faults; their MIT protocol, with its loss of power.

Answer    id · q 16 bit · q̇ 12 · τ 12 · temperature 16, 0.1 °C; from the master's id
Faults    on request: id · 32 bits, lowest byte first · zeros

An answer holds no state, and no frame of this protocol sets the watchdog: a motor that lost its
power by its watchdog or a restart is detected by its missing torque. The protocol that they are
delivered with is in ``robstride_private``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from ...text import nearest
from ..drives.can_line import Frame
from ..drives.driver import ONE_TURN, Answers, Identity, Order
from ..drives.faults import flagged
from ..drives.interview import Question, Questions, ask, find
from ..drives.reconcile import ACTING, ASK, GOAL, OFF, POWER_ON, RESET
from ..interface import DriveFault
from . import frames as f
from .damiao import limits

#: The id of the host that motors answer to, as their maker sets it.
MASTER = 0xFD
RUN_MIT, READ_FAULTS = (b"\xff" * 6 + bytes([0, last]) for last in (0xFC, 0xFB))
#: Last byte of the order that changes an id.
SET_ID = 0xFA
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


def ranges(axis: f.MitAxis) -> f.Ranges:
    """The ranges of a motor: of its model, or of its option ``scales``.

    Raises:
        PlantSettingsError: the model is unknown, or the scales are invalid.
    """
    model, scales = axis.model, axis.scales
    if model not in MODELS:
        models = [f.DAMIAO, *MODELS]
        hint = nearest(model, models)
        raise axis.refused("model", f"unknown{hint}; known: {', '.join(models)}")
    if not scales:
        return MODELS[model]
    given: f.Ranges | None = None
    with contextlib.suppress(TypeError, ValueError):
        given = f.Ranges(*map(float, scales.split("/")))
    if given is None or not all(value > 0.0 for value in given):
        what = "rad/(rad/s)/(N·m)/(N·m/rad)/(N·m·s/rad) is required, as 12.57/44/17/500/5"
        raise axis.refused("scales", what)
    return given


def faults(drive: int) -> Question:
    """The question for the word of faults of a motor."""

    def pick(message: Any) -> int | None:
        return fault_word(bytes(message.data)) if sent_by(drive, message) else None

    return Question([(drive, READ_FAULTS)], pick, several=True)


def motion(drive: int, request: list[Frame]) -> Question:
    """A question whose answer is a motion."""

    def pick(message: Any) -> bool | None:
        mine = sent_by(drive, message)
        return True if mine and fault_word(bytes(message.data)) is None else None

    return Question(request, pick)


def sent_by(drive: int, message: Any) -> bool:
    """Whether a frame is from a motor."""
    from_master = message.arbitration_id == MASTER and not message.is_extended_id
    return from_master and len(message.data) == 8 and message.data[0] == drive


def fault_word(data: bytes) -> int | None:
    """The faults of an answer; None: it holds the motion."""
    return int.from_bytes(data[1:5], "little") if data[5:] == bytes(3) else None


class Faults:
    """Faults of a motor, and whether it applies the commanded torque.

    Attributes: word (its faults, as it answers), command (q, q̇, k, d, τ of the last frame; set
        before ``compare``).
    """

    command: tuple[float, float, float, float, float]

    def __init__(self, ranges: f.Ranges) -> None:
        self._most, self.word, self._without = ranges.torque, 0, 0

    def reset(self) -> None:
        """Retry a motor that applied no torque."""
        self._without = 0

    @property
    def fault(self) -> DriveFault | None:
        """Those that it reports, or a loss of power."""
        lost = POWERLESS if self._without >= PATIENT else None
        return flagged(self.word, FAULTS) or lost

    def compare(self, q: float, dq: float, torque: float) -> None:
        """Compare an answer (rad, rad/s, N·m) with the command before it."""
        if self._without >= PATIENT:
            return
        at, rate, k, d, forward = self.command
        effort = min(abs(forward + k * (at - q) + d * (rate - dq)), self._most)
        none = effort > ASKED * self._most and abs(torque) < GIVEN * effort
        self._without = self._without + 1 if none else 0


class RobStride:
    """One motor in its MIT protocol.

    Its answers hold no state: it has power when both frames of its power-on were answered, until
    its torque is missing.

    Args:
        axis: Its joint.
        bus: For texts.

    Attributes: ranges (of its frames).
    """

    law = "MIT"

    def __init__(self, axis: f.MitAxis, bus: str) -> None:
        self._axis, self._bus = axis, bus
        self.ranges = ranges(axis)
        self._faults = Faults(self.ranges)
        self._action, self._answered = OFF, 0

    def sent(self, message: Any) -> bool:
        """Whether a frame is from this motor."""
        return sent_by(self._axis.id, message)

    @property
    def off(self) -> Frame:
        """The frame that takes its power."""
        return self._axis.id, f.DISABLE

    def set_up(self, _timeout: float) -> Questions[Identity]:
        number = self._axis.id
        yield from find(faults(number), self._axis, self._bus, "mit_can")
        yield from self._stop()
        self._faults = Faults(self.ranges)
        kind = f"RobStride {self._axis.model.upper()}"
        return Identity(
            id=number,
            type=kind,
            limits=limits(self.ranges),
            turn=ONE_TURN,
            says_power=False,
            says_law=False,
        )

    def confirm(self, _timeout: float) -> Questions[bool]:
        """A restart is not reported; its protocol is set again before power."""
        yield from self._stop()
        return True

    def _stop(self) -> Questions[None]:
        number = self._axis.id
        for data in (f.DISABLE, f.CLEAR, RUN_MIT):
            question = motion(number, [(number, data)])
            yield from ask(question, f"id {number} does not answer; is it powered?")

    def frames(self, order: Order, answers: Answers, k: int) -> Iterator[Frame]:
        number, self._action, self._answered = self._axis.id, order.action, 0
        answers.asked[k] += 1
        if order.action in ACTING:
            if order.action is POWER_ON:
                answers.asked[k] += 1
                self._faults.reset()
                yield number, f.ENABLE
            values = f.values(order.kind, order.values)
            self._faults.command = values
            yield number, f.packed(self.ranges, *values)
        elif order.action is ASK:
            yield number, READ_FAULTS
        elif order.action is RESET:
            self._faults.reset()
            yield number, f.CLEAR
            yield number, f.DISABLE
        elif order.interview is None or answers.reported[k].unheard:  # it may hear, unheard
            yield number, f.DISABLE

    def take(self, message: Any, answers: Answers, k: int) -> bool:
        """Read an answer; true where it is a motion."""
        data, reported = bytes(message.data), answers.reported[k]
        if (word := fault_word(data)) is not None:
            self._faults.word, answers.raw[k][data] = word, None
            reported.fault = self._faults.fault
            if self._action is ASK:
                answers.heard(k)
            return self._action is ASK
        moved = f.readings(self.ranges, data)
        answers.position[k], answers.velocity[k], answers.torque[k] = moved
        answers.temperature[k] = 0.1 * int.from_bytes(data[6:], "big")
        answers.came(k, data)
        self._answered += 1
        if self._action is POWER_ON:
            reported.power = self._answered > 1
        elif self._action is not GOAL:
            reported.power = False
        elif reported.power:
            self._faults.compare(*moved)
        reported.law, reported.fault = self.law, self._faults.fault
        return self._action is not POWER_ON or self._answered > 1
