# SPDX-License-Identifier: Apache-2.0
"""Buses without threads and without real time: what a driver sends, its virtual drives answer.

A wait for an answer that does not come passes time in the one clock of driver, wire and world.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from manual_clock import ManualClock

from control_board_ros.plants.drives.can_socket import received
from control_board_ros.plants.virtual.can_bus import VirtualCan
from control_board_ros.plants.virtual.pty_bus import VirtualSerial


class DirectCan:
    """A ``can_socket.CanBus``.

    Attributes: received (frames for the driver, oldest first).
    """

    def __init__(self, drives: VirtualCan, clock: ManualClock) -> None:
        self._drives, self._clock = drives, clock
        self.received: deque[Any] = deque()

    def put(self, frame_id: int, data: bytes) -> None:
        """The drives answer at once."""
        self._exchange([(frame_id, data)])

    def recv(self, timeout: float) -> Any:
        """The next frame, or None after a timeout, s."""
        if not self.received:
            self._clock.pass_by(timeout)
            self._exchange([])
        return self.received.popleft() if self.received else None

    def shutdown(self) -> None:
        """Nothing is open."""

    def _exchange(self, frames: Sequence[tuple[int, bytes]]) -> None:
        self.arrive(self._drives.step(frames))

    def arrive(self, frames: Sequence[tuple[int, bytes]]) -> None:
        """Frames for the driver."""
        self.received.extend(received(*frame) for frame in frames)


class DirectPort:
    """A port as the makers' libraries have it; see ``serial_line.open_port``."""

    def __init__(self, drives: VirtualSerial, clock: ManualClock) -> None:
        self._drives, self._clock = drives, clock
        self._received = bytearray()
        self.is_using, self.wait, self._end = False, 0.02, 0.0

    def writePort(self, packet: Sequence[int]) -> int:
        """The drives answer at once."""
        self._exchange([(0, bytes(packet))])
        return len(packet)

    def readPort(self, length: int) -> bytes:
        if not self._received:
            self._clock.pass_by(self._end - self._clock.now())
            self._drives.framer.drop()
            self._exchange([])
        found = bytes(self._received[:length])
        del self._received[:length]
        return found

    def getBytesAvailable(self) -> int:
        return len(self._received)

    def getBaudRate(self) -> int:
        return 1_000_000

    def clearPort(self) -> None:
        self._received.clear()

    def closePort(self) -> None:
        self._received.clear()

    def setPacketTimeout(self, _length: int) -> None:
        self._end = self._clock.now() + self.wait

    def setPacketTimeoutMillis(self, milliseconds: float) -> None:
        self._end = self._clock.now() + 1e-3 * milliseconds

    def isPacketTimeout(self) -> bool:
        return self._clock.now() >= self._end

    def _exchange(self, frames: Sequence[tuple[int, bytes]]) -> None:
        self.arrive(self._drives.step(frames))

    def arrive(self, frames: Sequence[tuple[int, bytes]]) -> None:
        """Bytes for the driver."""
        for _, data in frames:
            self._received += data
