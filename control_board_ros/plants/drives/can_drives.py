# SPDX-License-Identifier: Apache-2.0
"""What the makes on CAN share: a bus, and laws that come with their set-points."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

from ..interface import DriveFault, Setup
from .axes import Options
from .can_line import CanLine, Frame, budget
from .driver import Answers, Order
from .faults import RESTARTED
from .interview import Questions


class CanDrives(ABC):
    """The drives of one bus; see ``driver.Driver``.

    Args:
        options: Of the user; the driver may have an option ``bitrate``.
        fd: With CAN FD frames.
    """

    live = True
    power_lost: DriveFault = RESTARTED

    def __init__(self, options: Options, *, fd: bool = False) -> None:
        self._options, self._axes = options, options.axes
        self.line = CanLine(options.bus, fd=fd, bitrate=int(options.own.get("bitrate", 0)))
        self._orders: Mapping[int, Order] = {}

    def open(self, setup: Setup, answers: Answers) -> None:
        self.line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def set_law(self, k: int, law: Any) -> Questions[Any]:
        """Never asked: a law comes with its set-point."""
        raise NotImplementedError

    def exchange(self, orders: Mapping[int, Order]) -> None:
        self.begin(orders)
        self.line.read(self.line.clock.now() + self._wait)

    def begin(self, orders: Mapping[int, Order]) -> None:
        """Send orders, whose answers ``line.read`` then takes."""
        self._orders = orders
        self.line.begin(self._frames(orders), self._take, orders)

    @abstractmethod
    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        """The frames of an exchange."""

    @abstractmethod
    def _take(self, message: Any) -> int | None:
        """Read a frame; the place of the drive whose answer is complete, or None."""
