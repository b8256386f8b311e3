# SPDX-License-Identifier: Apache-2.0
"""A CAN bus as drivers use it: frames out, answers in, each by the id of its drive."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable
from typing import Any

from ..errors import PlantSettingsError

#: Frames that an exchange reads at most for each that it waits for: a flood does not hold it up.
FLOOD = 8
#: s to wait for what a drive says at the beginning, and how often it is asked.
PATIENCE, ATTEMPTS = 0.05, 5


class CanLine:
    """A bus of python-can.

    Args:
        text: Interface and channel, as ``socketcan:can0``, ``virtual:bench``.
        fd: With CAN FD frames.
        bitrate: Of interfaces that set it themselves, bit/s; 0: theirs.
    """

    def __init__(self, text: str, *, fd: bool = False, bitrate: int = 0) -> None:
        try:
            import can
        except ImportError:
            raise PlantSettingsError(
                "python-can is not installed; pip install 'control_board_ros[moteus]', or the "
                "extra of your drives' name"
            ) from None
        self._message = can.Message
        interface, _, channel = text.partition(":")
        more: dict[str, Any] = {"fd": True} if fd and interface != "virtual" else {}
        if interface == "virtual":
            more = {"protocol": can.CanProtocol.CAN_FD} if fd else {}
        if bitrate:
            more["bitrate"] = bitrate
        self._fd = fd
        try:
            self.bus = can.Bus(interface=interface, channel=channel or None, **more)
        except (can.CanError, OSError, ValueError) as error:
            raise OSError(
                f"bus {text}: {error}; use INTERFACE:CHANNEL, as socketcan:can0"
            ) from None

    def send(self, frame_id: int, data: bytes, *, extended: bool = False) -> None:
        """One frame."""
        self.bus.send(
            self._message(
                arbitration_id=frame_id,
                data=data,
                is_extended_id=extended,
                is_fd=self._fd,
                bitrate_switch=self._fd,
            )
        )

    def gather(
        self, take: Callable[[Any], int | None], missing: Iterable[int], seconds: float
    ) -> set[int]:
        """Read frames until every drive answered or the time is up.

        Args:
            take: Reads a frame; returns whose answer it is, or None.
            missing: Whose answers are awaited.
            seconds: For which to wait.

        Returns:
            Who has not answered.
        """
        left = set(missing)
        end, frames = time.monotonic() + seconds, FLOOD * (len(left) + 1)
        while left and frames:
            message = self.bus.recv(max(0.0, end - time.monotonic()))
            if message is None:
                break
            frames -= 1
            if not message.is_error_frame and (found := take(message)) is not None:
                left.discard(found)
        return left

    def drain(self, take: Callable[[Any], int | None]) -> None:
        """Read what came meanwhile: late answers."""
        for _ in range(64):
            if (message := self.bus.recv(0.0)) is None:
                return
            if not message.is_error_frame:
                take(message)

    def collect(self, seconds: float) -> list[Any]:
        """Every frame of a while: what a scan hears, and whether two answer as one."""
        found = []
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            if (message := self.bus.recv(left)) is not None and not message.is_error_frame:
                found.append(message)
        return found

    def close(self) -> None:
        """Leave the bus; safe to call twice."""
        with contextlib.suppress(Exception):  # an interface that is gone cannot be left
            self.bus.shutdown()


def budget(period: float) -> float:
    """S of a control period that an exchange may wait for answers."""
    return 0.6 * period
