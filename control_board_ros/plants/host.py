# SPDX-License-Identifier: Apache-2.0
"""The process that holds a plant; ``apart`` starts it, and sends requests.

It answers each request on a socket. After ``silence`` seconds without one while the plant has
power, or when the other end is gone, it releases the plant (B5).
"""

from __future__ import annotations

import contextlib
import signal
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ..core.terms.measurement import SetPoints
from ..startup import resume_collection
from .entry_points import make
from .errors import in_words
from .interface import Description, DrivePlant, Readings, Setup
from .outputs import as_drives


class Watchdog:
    """A DrivePlant around another one.

    After :meth:`strike` no set-point acts until all are OFF, which shows that the sender knows.
    Until then each joint that was driven reports a fault.
    """

    def __init__(self, plant: DrivePlant) -> None:
        self._plant = plant
        self._off = SetPoints.off(len(plant.describe().joints))
        self._last = self._off
        self._struck: dict[int, str] = {}

    @property
    def drives(self) -> bool:
        """Whether a joint has power."""
        return bool(self._last.powered.any())

    def strike(self, reason: str) -> None:
        """Each motor does its ``on_silence``: without power, where it has none."""
        self._struck = {int(joint): reason for joint in np.flatnonzero(self._last.powered)}
        self._last = self._off
        with contextlib.suppress(Exception):
            self._plant.let_go()

    def describe(self) -> Description:
        return self._plant.describe()

    def connect(self, setup: Setup) -> None:
        self._last, self._struck = self._off, {}
        self._plant.connect(setup)

    def exchange(self, wanted: SetPoints) -> Readings:
        if self._struck:
            if not wanted.powered.any():
                self._struck = {}
            wanted = self._off
        self._last = wanted
        readings = self._plant.exchange(wanted)
        if self._struck and isinstance(readings, Readings):
            faults = readings.faults or [None] * len(self._off.kinds)
            readings.faults = [self._struck.get(joint, text) for joint, text in enumerate(faults)]
        return readings

    def clear_fault(self, joint: int) -> None:
        self._plant.clear_fault(joint)

    def let_go(self) -> None:
        self._last = self._off
        self._plant.let_go()

    def close(self) -> None:
        self._plant.close()


#: An error in words, or none, and the return value of the method.
Answer = tuple[str, Any]


def main(descriptor: int) -> None:
    """Hold a plant until the other end is gone; signals that end the board do not end it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    connection: Connection[Any, Any] = Connection(descriptor)
    name, joints, arguments, silence = connection.recv()
    try:
        plant = Watchdog(as_drives(make(name, joints, arguments)))
    except Exception as error:  # noqa: BLE001 - third-party code; reported to the board
        connection.send((in_words(error), None))
        return
    resume_collection()
    connection.send(("", None))
    serve(connection, plant, silence)


def serve(connection: Connection[Any, Any], plant: Watchdog, silence: float) -> None:
    """Answer until the other end is gone; then the joints are without power.

    Args:
        connection: To the board.
        plant: Its plant.
        silence: Time without a request after which the motors lose their power, s.
    """
    try:
        while True:
            if connection.poll(silence if plant.drives else None):
                connection.send(answer(plant, *connection.recv()))
            else:
                plant.strike(f"its board was silent for {1e3 * silence:.0f} ms")
    except (EOFError, OSError):  # the other end is gone
        plant.strike("its board is gone")
    finally:
        plant.close()


def answer(plant: Watchdog, name: str, arguments: tuple[Any, ...]) -> Answer:
    """The return value of a method of the plant, or its error."""
    try:
        return "", getattr(plant, name)(*arguments)
    except Exception as error:  # noqa: BLE001 - third-party code; reported to the board
        return in_words(error), None
