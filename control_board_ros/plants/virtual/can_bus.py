# SPDX-License-Identifier: Apache-2.0
"""Virtual drives on a bus of python-can: a thread that reads frames and lets the drives answer."""

from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Protocol

from ..drives.can_frame import EXTENDED, REMOTE, SHORT
from ..drives.can_line import open_bus
from ..drives.can_socket import CanBus
from ..drives.remedies import bus_error
from .world import World

#: s of silence on the bus after which the world is stepped anyway.
QUIET = 5e-3
#: Frames that are answered together.
BATCH = 16
_numbers = itertools.count(1)

#: The id of a frame, and its data.
Frame = tuple[int, bytes]
#: Passes on the frames that arrive.
Carry = Callable[[Iterable[Frame]], Iterator[Frame]]


class CanDrive(Protocol):
    """A virtual drive as its bus sees it.

    One that sends frames which nobody asked for has ``unasked()``, too: the frames that are due.
    """

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[Frame]:
        """The frames that it answers with; see the flags REMOTE, EXTENDED."""
        ...


class VirtualCan:
    """Drives at the end of a wire, without thread and without time but the world's.

    Args:
        world: That they move.
        drives: Its drives, and others that move nothing.

    Attributes:
        to_drives, from_drives: The wire, by direction; all frames arrive, unless it is replaced.
    """

    def __init__(self, world: World, drives: Sequence[CanDrive]) -> None:
        self.world, self.drives = world, list(drives)
        self.to_drives: Carry = iter
        self.from_drives: Carry = iter

    def step(self, frames: Iterable[Frame]) -> list[Frame]:
        """Let the world pass up to the present; the frames that arrive for those sent."""
        with self.world.lock:
            before = self.world.time
            self.world.advance()
            answers = [
                frame
                for drive in self.drives
                if self.world.time != before
                for frame in getattr(drive, "unasked", tuple)()
            ]
            answers += [
                answer
                for frame in self.to_drives(frames)
                for drive in self.drives
                for answer in drive.on_frame(*frame)
            ]
        return [*self.from_drives(answers)]


class VirtualCanBus(VirtualCan):
    """Drives that answer on a bus of python-can until it is closed, in a thread of their own.

    Args:
        world: That they move.
        drives: Its drives, and others that move nothing.
        address: Interface and channel; empty: a new channel of this process.
        fd: With CAN FD frames.

    Attributes: address (for the option ``bus`` of a driver).
    """

    def __init__(
        self,
        world: World,
        drives: Sequence[CanDrive],
        address: str = "",
        *,
        fd: bool = False,
    ) -> None:
        super().__init__(world, drives)
        self.address = address or f"virtual:drives {next(_numbers)}"
        self.bus = self._open(fd=fd)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="virtual drives", daemon=True)
        self._thread.start()

    def _open(self, *, fd: bool) -> CanBus:
        import can

        try:
            return open_bus(self.address, fd=fd)
        except (can.CanError, OSError, ValueError) as error:
            raise bus_error(self.address, error) from None

    def close(self) -> None:
        """End the drives; safe to call twice."""
        self._ending.set()
        self._thread.join(2.0)
        with contextlib.suppress(Exception):
            self.bus.shutdown()

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                frames = self._receive()
            except Exception:  # noqa: BLE001 - the bus is gone
                return
            for frame in self.step(frames):
                with contextlib.suppress(Exception):  # there is no receiver
                    self.bus.put(*frame)

    def _receive(self) -> list[Frame]:
        """The frames that have arrived; none after QUIET."""
        received = self.bus.recv(QUIET)
        frames = frames_of(received)
        while received is not None and len(frames) < BATCH:
            received = self.bus.recv(0.0)
            frames += frames_of(received)
        return frames


def frames_of(received: Any) -> list[Frame]:
    """A message of python-can as a frame; none, where it would not get onto a real bus."""
    if received is None or received.is_error_frame:
        return []
    flags = REMOTE if received.is_remote_frame else 0
    if received.arbitration_id <= SHORT:
        flags |= EXTENDED if received.is_extended_id else 0
    elif not received.is_extended_id:
        return []  # its upper bits would be lost
    return [(received.arbitration_id | flags, bytes(received.data))]
