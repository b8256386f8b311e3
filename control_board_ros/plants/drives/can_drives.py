# SPDX-License-Identifier: Apache-2.0
"""What the makes on CAN share: a bus, and laws that come with their set-points."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from ...core.terms.drives import SetPoint
from ..interface import DriveFault, Setup
from .axes import Options
from .can_line import CanLine, Frame, budget
from .driver import Answers, Order
from .faults import RESTARTED
from .interview import Interview, Questions


@dataclass(frozen=True, kw_only=True)
class CanOptions(Options):
    """Options of a driver on CAN.

    Attributes: bitrate (of interfaces that set it, bit/s; 0: theirs), unwatched (drives without a
        watchdog are accepted).
    """

    bitrate: int = 0
    unwatched: bool = False


Own = TypeVar("Own", bound=Options)


class CanDrives(ABC, Generic[Own]):
    """The drives of one bus; see ``driver.Driver``.

    Args:
        options: Of the user.
        fd: With CAN FD frames.
        bitrate: Of interfaces that set it, bit/s; 0: theirs.

    Attributes: laws (by the kind of set-point).
    """

    live = True
    power_lost: DriveFault = RESTARTED
    laws: Mapping[SetPoint, Any]

    def __init__(self, options: Own, *, fd: bool = False, bitrate: int = 0) -> None:
        self._options, self._axes = options, options.axes
        self.line = CanLine(options.bus, fd=fd, bitrate=bitrate)
        self._orders: Mapping[int, Order] = {}

    def open(self, setup: Setup, answers: Answers) -> None:
        self.line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def law(self, k: int, kind: SetPoint) -> Any:
        del k
        return self.laws[kind]

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

    def _interview(self, k: int) -> Interview[Any] | None:
        """That with a drive in this exchange."""
        return self._orders[k].interview if k in self._orders else None

    @abstractmethod
    def _frames(self, orders: Mapping[int, Order]) -> Iterator[Frame]:
        """The frames of an exchange."""

    @abstractmethod
    def _take(self, message: Any) -> int | None:
        """Read a frame; the place of the drive whose answer is complete, or None."""
