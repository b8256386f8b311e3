# SPDX-License-Identifier: Apache-2.0
"""The wire between a board and simulated drives: late, lost and interrupted frames (SPEC S7).

In each control cycle every drive is sent a frame with its set-points, and sends one with its
readings. A frame arrives after its delay; one that is overtaken by a newer one is ignored. The
random numbers have a fixed seed: each run is the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from ..core.config.config import BoardConfig
from ..core.terms.measurement import UNREAD, Array, Row, SetPoints
from .config import DriveModel, SimulationConfig

T = TypeVar("T")


def has_wire(simulation: SimulationConfig) -> bool:
    """Whether frames of a drive can be late or lost."""
    return any(
        model.latency or model.jitter or model.loss or model.burst
        for model in (joint.drive_model for joint in simulation.joints)
    )


@dataclass(slots=True)
class Frame(Generic[T]):
    """A frame on its way: the cycles in which it is sent and arrives, and its content."""

    sent: int
    due: int
    content: T


class Line(Generic[T]):
    """One direction of the wire of one drive.

    Args:
        model: Of the drive.
        latency: Of each frame, s.
        rate: Of control, Hz.
        seed: Of the random numbers.

    Attributes: last (the newest frame that has arrived; None: there is none).
    """

    def __init__(self, model: DriveModel, latency: float, rate: float, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._latency, self._jitter = latency * rate, model.jitter * rate
        self._loss, self._burst = model.loss, round(model.burst * rate)
        self._burst_rate = 1.0 / (model.burst_interval * rate)
        self._until = 0  # cycle in which an interruption ends
        self._frames: list[Frame[T]] = []
        self.last: Frame[T] | None = None

    def send(self, cycle: int, content: T) -> bool:
        """Send a frame; whether one arrives in this cycle."""
        chance = self._random.random(3)
        if self._burst and cycle >= self._until and chance[0] < self._burst_rate:
            self._until = cycle + self._burst
        if cycle >= self._until and chance[1] >= self._loss:
            delay = round(self._latency + self._jitter * chance[2])
            self._frames.append(Frame(cycle, cycle + delay, content))
        before = self.last
        for frame in [frame for frame in self._frames if frame.due <= cycle]:
            self._frames.remove(frame)
            if self.last is None or frame.sent > self.last.sent:
                self.last = frame
        return self.last is not before


class Wire:
    """The wires of all drives.

    Args:
        board: With the rate of control.
        simulation: With the model of each drive.
    """

    def __init__(self, board: BoardConfig, simulation: SimulationConfig) -> None:
        rate, models = board.control_rate, [joint.drive_model for joint in simulation.joints]
        self._period = board.period
        self._to_drives: list[Line[tuple[int, Array, float]]] = [
            Line(model, 0.0, rate, 2 * j) for j, model in enumerate(models)
        ]
        self._from_drives: list[Line[tuple[Array, float]]] = [
            Line(model, model.latency, rate, 2 * j + 1) for j, model in enumerate(models)
        ]
        self._cycle = -1
        self._read: tuple[Array, Array] = np.zeros(0), np.zeros(0)

    def to_drives(self, cycle: int, sent: SetPoints) -> tuple[SetPoints, set[int]]:
        """The set-points that have arrived, and the joints whose drive gets none now."""
        n = len(sent.kinds)
        made = SetPoints.off(n)
        kinds, values, released = made.kinds.copy(), made.values.copy(), made.released.copy()
        deaf = set()
        for j, line in enumerate(self._to_drives):
            content = int(sent.kinds[j]), sent.values[:, j].copy(), float(sent.released[j])
            if not line.send(cycle, content):
                deaf.add(j)
            if line.last is not None:
                kinds[j], values[:, j], released[j] = line.last.content
        return SetPoints(kinds, values, released), deaf

    def from_drives(self, cycle: int, values: Array, applied: Array) -> tuple[Array, Array]:
        """The readings that have arrived, with their ages, once per cycle.

        Args:
            cycle: The present one.
            values: The readings now, shape (ROWS, n).
            applied: The outputs that act now, percent, shape (n,).

        Returns:
            Both as they have arrived.
        """
        if cycle == self._cycle:
            return self._read
        self._cycle, read, acted = cycle, values.copy(), np.zeros_like(applied)
        for j, line in enumerate(self._from_drives):
            line.send(cycle, (values[:, j].copy(), float(applied[j])))
            if line.last is None:
                read[UNREAD, j] = np.nan
                age = (cycle + 1) * self._period
            else:
                read[:, j], acted[j] = line.last.content
                age = (cycle - line.last.sent) * self._period
            read[Row.ENCODER_AGE, j] += age
            read[Row.TORQUE_AGE, j] += age
            read[Row.ALARM, j] = values[Row.ALARM, j]
        self._read = read, acted
        return self._read
