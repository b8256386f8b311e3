# SPDX-License-Identifier: Apache-2.0
"""The process that holds a plant; ``apart`` starts it, and asks.

It answers each request on a socket. When none comes for the silence that it was
given while the plant has power, or the other end is gone, it lets the plant go (B5).
"""

from __future__ import annotations

import signal
from multiprocessing.connection import Connection
from typing import Any

from .entry_points import make
from .outputs import as_drives
from .watchdog import Watchdog

#: A request: the method of the plant, and its arguments.
Request = tuple[str, tuple[Any, ...]]
#: An answer: the class of the error, and its text; or no class, and what the method returned.
Answer = tuple[str, Any]


def main(descriptor: int) -> None:
    """Hold a plant until the other end is gone; what ends the board's process does not end it."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    connection: Connection[Any, Any] = Connection(descriptor)
    name, joints, arguments, silence = connection.recv()
    try:
        plant = Watchdog(as_drives(make(name, joints, arguments)))
    except Exception as error:  # noqa: BLE001 - third-party code; told to who asked
        connection.send((type(error).__name__, str(error)))
        return
    connection.send(("", None))
    serve(connection, plant, silence)


def serve(connection: Connection[Any, Any], plant: Watchdog, silence: float) -> None:
    """Answer until the other end is gone; then the joints are without power.

    Args:
        connection: to who asks.
        plant: that is asked.
        silence: after which it loses its power, s.
    """
    try:
        while True:
            if connection.poll(silence if plant.drives else None):
                connection.send(answer(plant, *connection.recv()))
            else:
                plant.strike(f"its board was silent for {1e3 * silence:.0f} ms")
    except (EOFError, OSError):  # the other end is gone
        plant.strike("its board is gone")
    finally:
        plant.close()


def answer(plant: Watchdog, name: str, arguments: tuple[Any, ...]) -> Answer:
    """What a method of the plant returns, or what it raises."""
    try:
        return "", getattr(plant, name)(*arguments)
    except Exception as error:  # noqa: BLE001 - third-party code; told to who asked
        return type(error).__name__, str(error)
