# SPDX-License-Identifier: Apache-2.0
"""A third-party plant in a process of its own: without the board the motors lose their power.

A thread cannot monitor a process that is stopped, killed, or whose interpreter hangs (B5).
"""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

from ..core.terms.measurement import SetPoints
from .errors import ApartError, PlantSettingsError
from .interface import Description, Readings, Setup

#: Time for its process to let go of the hardware, s.
LEAVING = 1.0


class PlantApart:
    """A DrivePlant whose methods run in a process of its own, which ``connect`` restarts.

    Args:
        name, joints, arguments: See ``entry_points.make``.
        silence: Time without a request after which it disables its motors, s.

    Attributes:
        process: The one that holds the plant.

    Raises:
        PlantSettingsError: the plant is unknown, or refuses these joints or arguments.
    """

    process: subprocess.Popen[bytes]

    def __init__(
        self, name: str, joints: Sequence[str], arguments: Sequence[str], silence: float
    ) -> None:
        self._making = name, tuple(joints), tuple(arguments), silence
        self._faulty = False
        try:
            self._start()
            self._description: Description = self._ask("describe")
        except Exception as error:  # noqa: BLE001 - third-party code
            self.close()
            raise PlantSettingsError(str(error)) from None

    def describe(self) -> Description:
        return self._description

    def connect(self, setup: Setup) -> None:
        if self._connection.closed or self.process.poll() is not None:
            self._start()
        self._ask("connect", setup)
        self._description = self._ask("describe")

    def exchange(self, wanted: SetPoints) -> Readings:
        readings: Readings = self._ask("exchange", wanted)
        faulty = any(getattr(readings, "faults", ()))
        if self._faulty and not faulty:  # a drive that came back may have other limits, and turns
            self._description = self._ask("describe")
        self._faulty = faulty
        return readings

    def let_go(self) -> None:
        self._ask("let_go")

    def clear_fault(self, joint: int) -> None:
        self._ask("clear_fault", joint)

    def close(self) -> None:
        """Disconnect: the process disables the motors and ends, later if it hangs now."""
        if self._connection.closed:
            return
        self._connection.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(LEAVING)

    def _start(self) -> None:
        """Start the process and make the plant in it."""
        ours, theirs = socket.socketpair()
        with theirs:
            number = theirs.fileno()
            code = (
                f"import sys; sys.path[:] = {sys.path!r}; "
                f"from control_board_ros.plants.host import main; main({number})"
            )
            self.process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                pass_fds=[number],
                start_new_session=True,  # a terminal's Ctrl-C and Ctrl-Z are the board's
            )
        self._connection: Connection[Any, Any] = Connection(ours.detach())
        self._connection.send(self._making)
        self._answer()

    def _ask(self, name: str, *arguments: Any) -> Any:
        try:
            self._connection.send((name, arguments))
        except OSError:
            raise self._gone() from None
        return self._answer()

    def _answer(self) -> Any:
        """The return value of the plant.

        Raises:
            ApartError: the plant raised.
        """
        try:
            error, answer = self._connection.recv()
        except (EOFError, OSError):
            raise self._gone() from None
        if error:
            raise ApartError(error)
        return answer

    def _gone(self) -> ConnectionError:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(LEAVING)
        return ConnectionError(f"the plant's process ended with code {self.process.returncode}")
