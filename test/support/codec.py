# SPDX-License-Identifier: Apache-2.0
"""A driver without a bus: what it sends for an order, what it reads of a frame, what it asks.

Frames are written as candump writes them: ``7FF#0100330700000000``, an id of more than three
digits is one of 29 bits, and ``#R`` a remote frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from types import SimpleNamespace
from typing import Any

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.core.terms.measurement import VALUES, Value
from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, SHORT
from control_board_ros.plants.drives.can_socket import Received, received
from control_board_ros.plants.drives.driver import Answers, Order
from control_board_ros.plants.drives.interview import Interview, Questions
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.interface import Setup

TIMEOUT = 0.1


def written(frame: tuple[int, bytes]) -> str:
    """A frame in words."""
    frame_id, data = frame
    number = frame_id & ~(REMOTE | EXTENDED)
    digits = 8 if frame_id & ~REMOTE > SHORT else 3
    return f"{number:0{digits}X}#{'R' if frame_id & REMOTE else data.hex()}"


def message(text: str) -> Received:
    """A frame as a driver receives it."""
    name, _, data = text.partition("#")
    flags = EXTENDED if len(name) > 3 else 0
    return received(int(name, 16) | flags, b"" if data == "R" else bytes.fromhex(data))


class Sent:
    """A wire to virtual drives that keeps what is sent, in words."""

    def __init__(self) -> None:
        self.frames: list[str] = []

    def __call__(self, frames: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
        for frame in frames:
            self.frames.append(written(frame))
            yield frame


class Codec:
    """The driver of one drive.

    Args:
        make: Its folder's name.
        options: Of the driver.

    Attributes: driver, answers, reported (of its drive).
    """

    def __init__(self, make: str, **options: str) -> None:
        room = import_module(f"control_board_ros.plants.{make}.driver")
        plant = room.make(("one",), options | {"bus": "none"})
        self.driver: Any = plant.driver
        self.answers = Answers(plant.axes)
        self.reported = self.answers.reported[0]
        self.reported.lost = False
        self.driver._answers, self.driver._orders = self.answers, {}
        self.driver.line = SimpleNamespace(begin=self._begun)
        self.driver._setup = Setup(period=2e-3, timeout=TIMEOUT, joints=(None,))

    def sent(self, action: Action, kind: SetPoint = SetPoint.OFF, **values: float) -> list[str]:
        """What it sends for an order."""
        return self._sent(Order(action, kind, _row(values)))

    def asked(self, action: Action, questions: Questions[Any]) -> list[str]:
        """What it sends for an order with a question."""
        return self._sent(Order(action, SetPoint.OFF, _row({}), Interview(questions, 0.0)))

    def _sent(self, order: Order) -> list[str]:
        self.answers.begin()
        self.driver.begin({0: order})
        return self._frames

    def _begun(self, frames: Iterable[tuple[int, bytes]], *_: object) -> None:
        self._frames = [written(frame) for frame in frames]

    def heard(self, *frames: str) -> list[int | None]:
        """Read frames: to each the place of a drive whose answer is complete."""
        return [self.driver._take(message(frame)) for frame in frames]

    @property
    def readings(self) -> tuple[float, ...]:
        """Position, velocity, torque, current, temperature and voltage."""
        found = self.answers
        rows = (found.position, found.velocity, found.torque, found.current, found.temperature,
                found.voltage)  # fmt: skip
        return tuple(float(row[0]) for row in rows)


def _row(values: dict[str, float]) -> Sequence[float]:
    row = [0.0] * VALUES
    for name, value in values.items():
        row[Value[name.upper()]] = value
    return row


def dialogue(
    questions: Questions[Any],
    far: Callable[[int, bytes], Iterable[tuple[int, bytes]]],
    said: Callable[[Any], tuple[Any, ...]] = lambda frame: (frame,),
) -> tuple[list[str], Any]:
    """An interview with somebody who answers each frame: what was asked, and its result.

    Args:
        questions: Of a driver.
        far: The frames that answer one.
        said: What a driver makes of a frame.
    """
    asked: list[str] = []
    try:
        question = next(questions)
        while True:
            found = []
            for frame in question.request:
                asked.append(written(frame))
                came = [received(*answer) for answer in far(*frame)]
                picked = [question.pick(*said(one)) for one in came]
                found += [one for one in picked if one is not None]
            question = questions.send(found if question.several else found[:1])
    except StopIteration as end:
        return asked, end.value
