# SPDX-License-Identifier: Apache-2.0
"""The black box: the last seconds of a board in memory, written on a fault."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message

from control_board_ros.interface import FAULTS
from control_board_ros.text import clean

from .bag import Bag
from .topics import Topic

#: Maximum bytes in memory, of any duration.
MOST = 512_000_000


class BlackBox:
    """Keeps the last seconds, and writes them into a new folder after a fault.

    Args:
        folder: Of the recordings.
        seconds: Duration before a fault.
        after: Duration after a fault.
        make: Creates a bag in a new folder, with the faults.

    Attributes: saved (recordings, with reason), size (bytes).
    """

    def __init__(
        self, folder: Path, seconds: float, after: float, make: Callable[[Path, str], Bag]
    ) -> None:
        self._folder, self._after, self._make = folder, after, make
        self._span = round(1e9 * (seconds + after))
        self._held: deque[tuple[Topic, int, bytes]] = deque()
        self._before: dict[Topic, bytes] = {}  # last latched messages before those
        self._faults: dict[Topic, set[Any]] = {}  # of the last message
        self._due = 0  # time to write the recording, ns; 0: no fault
        self._why = ""
        self.saved: list[tuple[Path, str]] = []
        self.size = 0

    @property
    def messages(self) -> int:
        return len(self._held)

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        """Set the latched messages; faults among them are not new."""
        for topic, data in latched.items():
            self._new_faults(topic, data)
        self._before.update(latched)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, or write the recording ``after`` s past a fault; raises
        RecordingError.
        """
        self._keep(topic, stamp, data)
        why = self._new_faults(topic, data)
        if why and not self._due:
            self._due, self._why = stamp + round(1e9 * self._after), why
        if self._due and stamp >= self._due:
            self._save()

    def close(self) -> None:
        """Write a pending recording."""
        if self._due:
            self._save()

    def _keep(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, and drop expired ones."""
        self._held.append((topic, stamp, data))
        self.size += len(data)
        while self._held and (stamp - self._held[0][1] > self._span or self.size > MOST):
            old, _, gone = self._held.popleft()
            self.size -= len(gone)
            if old.latched:
                self._before[old] = gone

    def _new_faults(self, topic: Topic, data: bytes) -> str:
        """``joint: text`` of faults that were not in the previous message; empty without any."""
        if topic.type != FAULTS.type or not topic.name.endswith(FAULTS.of("")):
            return ""
        message = deserialize_message(data, FAULTS.load())
        now = {(f.name, f.code, f.stamp.sec, f.stamp.nanosec): f for f in message.faults}
        known = self._faults.get(topic, set())
        self._faults[topic] = set(now)
        new = [f"{f.name}: {f.text}" for key, f in now.items() if key not in known]
        return clean("; ".join(new))

    def _save(self) -> None:
        """Write the messages in memory; raises RecordingError where this fails."""
        self._due = 0
        path = free_name(self._folder, time.strftime("%Y%m%d-%H%M%S"))
        bag = self._make(path, self._why)
        bag.begin(self._before)
        for message in self._held:
            bag.write(*message)
        bag.close()
        self.saved.append((path, self._why))


def free_name(folder: Path, name: str) -> Path:
    """An unused path in a folder: the name, with a number if necessary."""
    path, number = folder / name, 2
    while path.exists():
        path, number = folder / f"{name}_{number}", number + 1
    return path
