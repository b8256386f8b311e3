# SPDX-License-Identifier: Apache-2.0
"""A serial bus as drivers use it, for makers' libraries that poll a port until a time is up.

Those of ROBOTIS and of Feetech share the methods of their ``PortHandler``; this one of ours waits
for bytes instead of asking in a circle, and has a time limit in the size of a control period.
"""

from __future__ import annotations

import select
import time
from typing import Any

from ..errors import PlantSettingsError
from .can_line import PATIENCE


def open_port(base: type[Any], device: str, baudrate: int) -> Any:
    """An open port of a library.

    Args:
        base: Its PortHandler.
        device: As ``/dev/ttyUSB0``.
        baudrate: bit/s.

    Raises:
        OSError: it cannot be opened.
        PlantSettingsError: the baud rate is none that it has.
    """

    class Port(base):  # type: ignore[misc]
        """Waits for bytes; ``wait`` s for a whole answer."""

        wait = 0.02

        def setPacketTimeout(self, _length: int) -> None:  # noqa: N802 - the library's name
            self.end = time.monotonic() + self.wait

        def setPacketTimeoutMillis(self, milliseconds: float) -> None:  # noqa: N802
            self.end = time.monotonic() + 1e-3 * milliseconds

        def isPacketTimeout(self) -> bool:  # noqa: N802
            return time.monotonic() > self.end

        def clearPort(self) -> None:  # noqa: N802 - theirs waits for what is sent
            self.ser.reset_input_buffer()

        def readPort(self, length: int) -> Any:  # noqa: N802
            select.select([self.ser.fileno()], [], [], max(0.0, self.end - time.monotonic()))
            return self.ser.read(length)

    port = Port(device)
    port.ser, port.end = None, 0.0
    try:
        if not port.setBaudRate(baudrate):
            raise PlantSettingsError(f"baudrate={baudrate}: none of the library's; e.g. 1000000")
    except OSError as error:
        raise OSError(f"bus {device}: {error}; use the serial device, as /dev/ttyUSB0") from None
    return port


def settle(port: Any, attempt: int) -> None:
    """Before a question is asked again: what comes late to the last time is no answer to this.

    No packet says which question it answers, so that a late one would be taken for that of the
    next, and a limit for a model.
    """
    if attempt:
        time.sleep(PATIENCE)
        port.clearPort()
