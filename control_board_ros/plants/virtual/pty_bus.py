# SPDX-License-Identifier: Apache-2.0
"""Virtual drives on a serial bus: a pseudo terminal, and a thread that reads and answers."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import select
import sys
import threading
import tty
from collections.abc import Iterable, Sequence
from typing import Any

from .can_bus import QUIET, Carry, Frame
from .servo import Framer
from .world import World

#: Linux's question for the settings of a terminal, and their length; the last number is the rate
#: of what is sent, bit/s, whichever way it was set.
TCGETS2, SETTINGS = 0x802C542A, 44


class VirtualSerial:
    """Drives at the end of a serial wire, without thread and without time but the world's.

    Args:
        world: That they move.
        drives: Its drives, and others that move nothing; ``on_packet`` gives their answers.
        framer: Of their protocol.

    Attributes:
        to_drives, from_drives: The wire, by direction; all bytes arrive, unless it is replaced.
            Bytes are the data of frames with id 0.
    """

    def __init__(self, world: World, drives: Sequence[Any], framer: Framer) -> None:
        self.world, self.drives, self.framer = world, list(drives), framer
        self.to_drives: Carry = iter
        self.from_drives: Carry = iter

    def listening(self) -> list[Any]:
        """Drives that understand what is sent."""
        return self.drives

    def step(self, frames: Iterable[Frame]) -> list[Frame]:
        """Let the world pass up to the present; the bytes that arrive for those sent."""
        with self.world.lock:
            self.world.advance()
            answers = [
                (0, answer)
                for _, data in self.to_drives(frames)
                for packet in self.framer.feed(data)
                for drive in sorted(self.listening(), key=lambda drive: drive.turn(packet))
                for answer in drive.on_packet(packet)
            ]
        return [*self.from_drives(answers)]


class VirtualSerialBus(VirtualSerial):
    """Drives that answer on a pseudo terminal until it is closed, in a thread of their own.

    Attributes: address (the device that a driver opens).
    """

    def __init__(self, world: World, drives: Sequence[Any], framer: Framer) -> None:
        super().__init__(world, drives, framer)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.address = os.ttyname(self._slave)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual drives", daemon=True)
        self._thread.start()

    def listening(self) -> list[Any]:
        """Drives at the rate of the program that opened the device."""
        settings = fcntl.ioctl(self._slave, TCGETS2, bytes(SETTINGS))
        rate = int.from_bytes(settings[-4:], sys.byteorder)
        return [drive for drive in self.drives if drive.baudrate == rate]

    def close(self) -> None:
        """End the drives; safe to call twice."""
        if self._ending.is_set():
            return
        self._ending.set()
        self._thread.join(2.0)
        os.close(self._master)
        os.close(self._slave)

    def _run(self) -> None:
        while not self._ending.is_set():
            ready, _, _ = select.select([self._master], [], [], QUIET)
            if not ready:
                self.framer.drop()
            for _, data in self.step([(0, os.read(self._master, 4096))] if ready else []):
                with contextlib.suppress(OSError):  # there is no receiver
                    os.write(self._master, data)
