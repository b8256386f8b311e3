# SPDX-License-Identifier: Apache-2.0
"""The adapter of moteus' maker, as a ``can_socket.CanBus``: ``bus=fdcanusb:/dev/fdcanusb``.

It speaks lines: ``can send ID DATA FLAGS`` is answered by OK or ERR, and what comes is
``rcv ID DATA FLAGS``; ids and data are hexadecimal; of the flags F is CAN FD, B its fast data.
"""

from __future__ import annotations

import contextlib
import select
import time

from ..errors import PlantSettingsError
from .can_socket import Received, received

#: Bytes of an unfinished line after which it is dropped.
LONGEST = 512
#: s after which an adapter that takes no bytes is an error of its bus.
STUCK = 0.05


class Fdcanusb:
    """An open adapter.

    Args:
        device: As ``/dev/fdcanusb``.
        fd: Frames that are sent are CAN FD.

    Raises:
        PlantSettingsError: there is no pyserial.
        OSError: it cannot be opened.
    """

    def __init__(self, device: str, *, fd: bool) -> None:
        try:
            import serial
        except ImportError:
            raise PlantSettingsError(
                "fdcanusb: pyserial is not installed; pip install pyserial"
            ) from None
        self._port = serial.Serial(device, timeout=0, write_timeout=STUCK, exclusive=True)
        self._port.reset_input_buffer()
        self._bytes, self._flags = b"", "BF" if fd else "bf"

    def put(self, frame_id: int, data: bytes) -> None:
        self._port.write(f"can send {frame_id:04x} {data.hex()} {self._flags}\n".encode())

    def recv(self, timeout: float) -> Received | None:
        """The next frame, or None after a timeout, s.

        Raises:
            OSError: the adapter says that it could not send, or it is gone.
        """
        end = time.monotonic() + timeout
        while True:
            while b"\n" in self._bytes:
                line, _, self._bytes = self._bytes.partition(b"\n")
                if line.startswith(b"ERR"):
                    raise OSError(f"the adapter says: {line.decode('latin1').strip()}")
                if (message := parse(line)) is not None:
                    return message
            left = end - time.monotonic()
            if not select.select([self._port.fileno()], [], [], max(0.0, left))[0]:
                return None
            self._bytes = self._bytes[-LONGEST:] + self._port.read(8192)

    def shutdown(self) -> None:
        """Close the device."""
        self._port.close()


def parse(line: bytes) -> Received | None:
    """The frame of a line, or None: it is none, or damaged."""
    words = line.rstrip().split(b" ")  # without data two spaces follow each other
    if len(words) < 3 or words[0] != b"rcv":
        return None
    with contextlib.suppress(ValueError):
        return received(int(words[1], 16), bytes.fromhex(words[2].decode()))
    return None
