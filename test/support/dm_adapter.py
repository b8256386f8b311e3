# SPDX-License-Identifier: Apache-2.0
"""Damiao's adapter from USB to CAN: a serial device, and behind it a bus of python-can.

Its frames have a fixed size: 30 bytes towards the bus, with the id at 13 and the data at 21;
16 bytes from there, with the id at 3 and the data at 7.
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import tty
from collections.abc import Iterator

import can

TO_BUS, TO_BUS_SIZE = b"\x55\xaa", 30
#: A frame that came, of standard format, with eight bytes; and its last byte.
CAME, END = b"\xaa\x11\x08", b"\x55"


@contextlib.contextmanager
def dm_adapter(address: str) -> Iterator[str]:
    """The serial device of an adapter on a bus, ``INTERFACE:CHANNEL``."""
    interface, _, channel = address.partition(":")
    master, slave = pty.openpty()
    tty.setraw(slave)
    ending = threading.Event()
    with can.Bus(interface=interface, channel=channel) as bus:
        thread = threading.Thread(target=carry, args=(master, bus, ending), daemon=True)
        thread.start()
        try:
            yield os.ttyname(slave)
        finally:
            ending.set()
            thread.join(5.0)
            os.close(master)
            os.close(slave)


def carry(master: int, bus: can.BusABC, ending: threading.Event) -> None:
    came = b""
    while not ending.is_set():
        if select.select([master], [], [], 1e-3)[0]:
            came += os.read(master, 4096)
        while (start := came.find(TO_BUS)) >= 0 and len(came) >= start + TO_BUS_SIZE:
            frame, came = came[start : start + TO_BUS_SIZE], came[start + TO_BUS_SIZE :]
            name = int.from_bytes(frame[13:17], "little")
            data = frame[21 : 21 + frame[18]]
            bus.send(can.Message(arbitration_id=name, data=data, is_extended_id=frame[12] == 1))
        while (message := bus.recv(0.0)) is not None:
            head = CAME + message.arbitration_id.to_bytes(4, "little")
            os.write(master, head + bytes(message.data).ljust(8, b"\0") + END)
