# SPDX-License-Identifier: Apache-2.0
"""The adapter of moteus' maker, as a bus of python-can: ``bus=fdcanusb:/dev/fdcanusb``.

It speaks lines: ``can send ID DATA FLAGS`` is answered by OK or ERR, and what comes is
``rcv ID DATA FLAGS``; ids and data are hexadecimal; of the flags F is CAN FD, B its fast data.
"""

from __future__ import annotations

import contextlib
import select
import time
from typing import Any

from ..errors import PlantSettingsError
from .can_frame import message

#: Bytes of an unfinished line after which it is dropped.
LONGEST = 512
#: s after which an adapter that takes no bytes is an error of its bus.
STUCK = 0.05


class Fdcanusb:
    """An open adapter.

    Args:
        device: As ``/dev/fdcanusb``.

    Raises:
        PlantSettingsError: there is no pyserial.
        OSError: it cannot be opened.
    """

    def __init__(self, device: str) -> None:
        try:
            import serial
        except ImportError:
            raise PlantSettingsError(
                "fdcanusb: pyserial is not installed; pip install pyserial"
            ) from None
        self._port = serial.Serial(device, timeout=0, write_timeout=STUCK, exclusive=True)
        self._port.reset_input_buffer()
        self._bytes = b""

    def send(self, sent: Any) -> None:
        """Send a message of python-can."""
        flags = "BF" if sent.is_fd else "bf"
        line = f"can send {sent.arbitration_id:04x} {bytes(sent.data).hex()} {flags}\n"
        self._port.write(line.encode())

    def recv(self, timeout: float) -> Any:
        """The next message, or None after a timeout, s.

        Raises:
            OSError: the adapter says that it could not send, or it is gone.
        """
        end = time.monotonic() + timeout
        while True:
            while b"\n" in self._bytes:
                line, _, self._bytes = self._bytes.partition(b"\n")
                if line.startswith(b"ERR"):
                    raise OSError(f"the adapter says: {line.decode('latin1').strip()}")
                if (received := parse(line)) is not None:
                    return received
            left = end - time.monotonic()
            if not select.select([self._port.fileno()], [], [], max(0.0, left))[0]:
                return None
            self._bytes = self._bytes[-LONGEST:] + self._port.read(8192)

    def shutdown(self) -> None:
        """Close the device."""
        self._port.close()


def parse(line: bytes) -> Any:
    """The message of a line, or None: it is none, or damaged."""
    words = line.split()
    if len(words) < 3 or words[0] != b"rcv":
        return None
    with contextlib.suppress(ValueError):
        return message(int(words[1], 16), bytes.fromhex(words[2].decode()), fd=b"F" in words[3:])
    return None
