# SPDX-License-Identifier: Apache-2.0
"""A virtual RobStride motor in its MIT protocol: run mode, watchdog, faults."""

from __future__ import annotations

from collections.abc import Iterator

from . import frames as f
from . import robstride as r

#: s of silence after which it stops, as it is stored by the maker's tool.
CAN_TIMEOUT = 1.0


class VirtualRobStride:
    """One motor.

    Args:
        drive: Its id.
        ranges: What its numbers mean.

    Attributes:
        state: 1 with power, else 0.
        faults: Its word of faults.
        silent: It answers to nothing.
        torque: At its output now, N·m.
    """

    SOME_FAULT = 1 << 14

    def __init__(self, drive: int, ranges: f.Ranges) -> None:
        self.id, self.ranges, self.silent, self.persists = drive, ranges, False, 0
        self._position = self._velocity = 0.0
        self.reboot()

    def reboot(self) -> None:
        """Its supply was gone for a moment."""
        self.state, self.faults, self._mode = f.DISABLED, self.persists, 0
        self._command = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._quiet = self.torque = 0.0

    def fail(self, code: int, *, persists: bool = False) -> None:
        """A fault; one that persists is there again after each reset."""
        self.state, self.faults, self.persists = f.DISABLED, code, code if persists else 0

    def heal(self) -> None:
        """The cause is gone; the fault stays until it is cleared."""
        self.persists = 0

    def on_frame(self, frame_id: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        """The frames that it answers with."""
        if self.silent or frame_id != self.id or len(data) != 8:
            return
        self._quiet = 0.0
        if data[:6] == b"\xff" * 6 and data[7] == f.CLEAR[7] and data[6] != 0xFF:
            yield r.MASTER, bytes([self.id]) + self.faults.to_bytes(4, "little") + bytes(3)
            return
        self._obey(data)
        moves = self._position, self._velocity, self.torque
        yield r.MASTER, f.answer(self.ranges, self.id, *moves, (300).to_bytes(2, "big"))

    def _obey(self, data: bytes) -> None:
        if data == f.ENABLE:
            if not self.faults:
                self.state, self._command = f.ENABLED, (0.0, 0.0, 0.0, 0.0, 0.0)
        elif data == f.DISABLE:
            self.state = f.DISABLED
        elif data == f.CLEAR:
            self.faults = self.persists
        elif data[:6] == b"\xff" * 6 and data[7] == f.ENABLE[7] and data[6] < 3:
            self._mode = data[6]
        elif self._mode == 0:
            self._command = f.command(self.ranges, data)

    def step(self, seconds: float, position: float, velocity: float) -> float:
        """The torque at its output, N·m; see ``virtual.world.VirtualDrive``."""
        self._position, self._velocity = position, velocity
        self._quiet += seconds
        if self._quiet > CAN_TIMEOUT:
            self.state = f.DISABLED
        if self.state != f.ENABLED:
            self.torque = 0.0
            return 0.0
        q, dq, k, d, torque = self._command
        wanted = torque + k * (q - position) + d * (dq - velocity)
        self.torque = max(-self.ranges.torque, min(self.ranges.torque, wanted))
        return self.torque
