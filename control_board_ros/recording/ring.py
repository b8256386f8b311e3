# SPDX-License-Identifier: Apache-2.0
"""The black box: the last seconds of a board in memory, written on a fault."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

from .bag import Bag
from .topics import Topic

#: Maximum bytes of a ring, of any duration.
MOST = 512_000_000

#: Reason to write the recording, from a topic and a message; empty without reason.
Trigger = Callable[[Topic, bytes], str]


class Ring:
    """The messages of the last seconds.

    Args:
        seconds: Duration.
        most: Maximum bytes.

    Attributes: before (last message of each latched topic before the ring), size (bytes).
    """

    def __init__(self, seconds: float, most: int = MOST) -> None:
        self._span, self._most = round(1e9 * seconds), most
        self._held: deque[tuple[Topic, int, bytes]] = deque()
        self.before: dict[Topic, bytes] = {}
        self.size = 0

    def __len__(self) -> int:
        return len(self._held)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, and drop expired ones."""
        self._held.append((topic, stamp, data))
        self.size += len(data)
        while stamp - self._held[0][1] > self._span or self.size > self._most:
            old, _, gone = self._held.popleft()
            self.size -= len(gone)
            if old.latched:
                self.before[old] = gone
            if not self._held:
                return

    def save(self, bag: Bag) -> None:
        """Write the messages into a bag, and close it."""
        bag.begin(self.before)
        for message in self._held:
            bag.write(*message)
        bag.close()


class BlackBox:
    """Keeps the last seconds, and writes them into a new folder after a fault.

    Args:
        folder: Of the recordings.
        seconds: Duration before a fault.
        after: Duration after a fault.
        trigger: Detects the reason to write.
        make: Creates a bag in a new folder.

    Attributes: saved (recordings, with reason), size (bytes).
    """

    def __init__(
        self,
        folder: Path,
        seconds: float,
        after: float,
        trigger: Trigger,
        make: Callable[[Path, str], Bag],
    ) -> None:
        self._folder, self._after, self._trigger, self._make = folder, after, trigger, make
        self._ring = Ring(seconds + after)
        self._due = 0  # time to write the recording, ns; 0: no fault
        self._why = ""
        self.saved: list[tuple[Path, str]] = []

    @property
    def messages(self) -> int:
        return len(self._ring)

    @property
    def size(self) -> int:
        return self._ring.size

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        """Set the latched messages; faults among them are not new."""
        for topic, data in latched.items():
            self._trigger(topic, data)
        self._ring.before.update(latched)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, or write the recording ``after`` s past a fault; raises
        RecordingError.
        """
        self._ring.write(topic, stamp, data)
        why = self._trigger(topic, data)
        if why and not self._due:
            self._due, self._why = stamp + round(1e9 * self._after), why
        if self._due and stamp >= self._due:
            self.save(self._why)

    def save(self, why: str) -> None:
        """Write the messages in memory; raises RecordingError where this fails."""
        self._due = 0
        path = free_name(self._folder, time.strftime("%Y%m%d-%H%M%S"))
        self._ring.save(self._make(path, why))
        self.saved.append((path, why))

    def close(self) -> None:
        """Write a pending recording."""
        if self._due:
            self.save(self._why)


def free_name(folder: Path, name: str) -> Path:
    """An unused path in a folder: the name, with a number if necessary."""
    path, number = folder / name, 2
    while path.exists():
        path, number = folder / f"{name}_{number}", number + 1
    return path
