# SPDX-License-Identifier: Apache-2.0
"""What the makes of serial servos share: a bus, laws changed without torque, and the exchange."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

from ...core.terms.drives import SetPoint
from ..errors import PlantSettingsError
from ..interface import DriveFault, Setup
from .axes import Options
from .can_line import budget
from .driver import Answers, Order
from .faults import RESTARTED
from .interview import Question, Questions, find
from .reconcile import ACTING, ASK, OFF, POWER_ON, RESET, SET_UP
from .serial_line import Item, Library, Request, ServoBus, put

#: That a servo can have.
IDS = range(253)
#: Actions of drives that are to have no power.
RESTING = (OFF, RESET, SET_UP)


@dataclass(frozen=True, kw_only=True)
class ServoOptions(Options):
    """Options of a driver on a serial bus: the device, and bit/s."""

    bus: str = "/dev/ttyUSB0"
    baudrate: int = 1_000_000


Own = TypeVar("Own", bound=ServoOptions)


class ServoDrives(ABC, Generic[Own]):
    """The servos of one bus; see ``driver.Driver``.

    Args:
        options: Of the user.

    Attributes: library, driver (its name), models (names of those supported, by number), laws (by
        the kind of set-point), length (of what is read), again (goals are sent behind the power,
        too).
    """

    live = False
    power_lost: DriveFault = RESTARTED
    library: Library
    driver: str
    models: Mapping[int, str]
    laws: Mapping[SetPoint, int]
    length: int
    again = False

    def __init__(self, options: Own) -> None:
        self._options, self._axes = options, options.axes
        self._ids = [axis.id for axis in options.axes]
        self.line = ServoBus(self.library, options.bus, options.baudrate)

    def open(self, setup: Setup, answers: Answers) -> None:
        self.line.open()
        self._setup, self._answers, self._wait = setup, answers, budget(setup.period)

    def law(self, k: int, kind: SetPoint) -> int:
        del k
        return self.laws[kind]

    def _model(self, k: int) -> Questions[int]:
        """The model of a servo.

        Raises:
            PlantSettingsError: it is not supported.
        """
        axis = self._axes[k]
        question = Question(Request(self.library.model), lambda reply: reply, several=True)
        number: int = (yield from find(question, axis, self._options.bus, self.driver)).value
        if number not in self.models:
            raise PlantSettingsError(
                f"{axis.name}: id {axis.id} is of model {number}; supported: "
                + ", ".join(self.models.values())
            )
        return number

    def _stall(self, k: int) -> float:
        """Torque of a motor at rest on its supply, at its servo's output, N·m; 0: not known."""
        if (joint := self._setup.joints[k]) is None:
            return 0.0
        motor = joint.motor
        amps = motor.supply_voltage / motor.resistance
        return motor.torque_per_ampere * amps / self._axes[k].ratio

    def confirm(self, k: int) -> Questions[bool]:
        """A restart is seen in what is read: what is set up is 0."""
        del k
        yield from ()
        return True

    def _put(self, k: int, item: Item, value: int) -> Questions[None]:
        return put(self._ids[k], item, value, self.library.refusal)

    def exchange(self, orders: Mapping[int, Order]) -> None:
        reported, acting = self._answers.reported, ACTING
        driven = {k: order for k, order in orders.items() if order.action in acting}
        rest = [k for k in orders if k not in driven and orders[k].action is not ASK]
        resets = [k for k in rest if orders[k].action is RESET]
        # One that is not heard may hear it.
        off = [k for k in rest if reported[k].power or reported[k].lost or k in resets]
        self._torque(off, 0)
        for k in resets:
            self._reset(k)
        self._goals(driven)
        on = [k for k, order in driven.items() if order.action is POWER_ON]
        self._torque(on, 1)
        if self.again:
            self._goals({k: driven[k] for k in on})
        self.line.drain(self._take)
        for k in orders:
            self._answers.asked[k] += 1
        self._read(orders)
        # Where none is to have power, a question may take its time.
        seconds = 0.0 if all(order.action in RESTING for order in orders.values()) else self._wait
        for k, order in orders.items():
            self.line.hold(self._ids[k], order.interview, seconds)

    def _torque(self, drives: Iterable[int], value: int) -> None:
        self.line.sync(self.library.torque, {self._ids[k]: bytes([value]) for k in drives})

    def _take(self, drive: int, data: bytes) -> None:
        k = self._answers.places.get(drive)
        if k is not None and len(data) == self.length:
            self._answers.came(k, data)
            self._parse(k, data)

    @abstractmethod
    def _reset(self, k: int) -> None:
        """Clear the fault of a servo."""

    @abstractmethod
    def _goals(self, orders: Mapping[int, Order]) -> None:
        """Send goals."""

    @abstractmethod
    def _read(self, orders: Mapping[int, Order]) -> None:
        """Read the servos together, by ``_take``."""

    @abstractmethod
    def _parse(self, k: int, data: bytes) -> None:
        """What a servo answered to that."""

    def close(self) -> None:
        self.line.close(self._axes)
