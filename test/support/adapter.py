# SPDX-License-Identifier: Apache-2.0
"""An fdcanusb on a pseudo terminal, with virtual drives on its CAN bus."""

from __future__ import annotations

import contextlib
import os
import pty
import select
import threading
import tty
from collections.abc import Iterator, Sequence
from typing import Any

from control_board_ros.plants.virtual.can_bus import VirtualCan


@contextlib.contextmanager
def adapter(world: Any, drives: Sequence[Any]) -> Iterator[str]:
    """Yields: its device."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    bus, ending = VirtualCan(world, drives), threading.Event()

    def run() -> None:
        heard = b""
        while not ending.is_set():
            ready, _, _ = select.select([master], [], [], 5e-3)
            heard += os.read(master, 4096) if ready else b""
            *lines, heard = heard.split(b"\n")
            os.write(master, b"".join(map(obey, lines)) or told(bus.step([])))

    def obey(line: bytes) -> bytes:
        words = line.split()
        if words[:2] != [b"can", b"send"] or len(words) < 4:
            return b"ERR unknown command\r\n"
        frame = int(words[2], 16), bytes.fromhex(words[3].decode())
        return b"OK\r\n" + told(bus.step([frame]))

    def told(frames: list[Any]) -> bytes:
        return b"".join(f"rcv {name:x} {data.hex()} BF\r\n".encode() for name, data in frames)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ending.set()
        thread.join(2.0)
        os.close(master)
        os.close(slave)
