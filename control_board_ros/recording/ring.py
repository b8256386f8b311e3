# SPDX-License-Identifier: Apache-2.0
"""The last seconds of a board in memory, written when a fault happens: the black box."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

from .bag import Bag
from .topics import Topic

#: Bytes that a ring holds at most, however long it is.
MOST = 512_000_000

#: From a topic and a message, why to keep what led to it; empty where there is no reason.
Trigger = Callable[[Topic, bytes], str]


class Ring:
    """The messages of the last seconds.

    Args:
        seconds: How far back.
        most: Bytes at most.

    Attributes: before (of latched topics, the message in force as the ring begins), size (bytes
    held).
    """

    def __init__(self, seconds: float, most: int = MOST) -> None:
        self._span, self._most = round(1e9 * seconds), most
        self._held: deque[tuple[Topic, int, bytes]] = deque()
        self.before: dict[Topic, bytes] = {}
        self.size = 0

    def __len__(self) -> int:
        return len(self._held)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, and let go of those that are too old."""
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
        """Write what is held into a bag, and close it."""
        bag.begin(self.before)
        for message in self._held:
            bag.write(*message)
        bag.close()


class BlackBox:
    """Keeps the last seconds, and writes them into a new folder some seconds after a fault.

    Args:
        folder: In which the recordings are made.
        seconds: How far back.
        after: Seconds to go on after a fault.
        trigger: Says why to write.
        make: A bag in a new folder.

    Attributes: saved (recordings, with why), size (bytes held).
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
        self._due = 0  # ns; when the recording is to be written; 0: no fault
        self._why = ""
        self.saved: list[tuple[Path, str]] = []

    @property
    def messages(self) -> int:
        """Messages held."""
        return len(self._ring)

    @property
    def size(self) -> int:
        return self._ring.size

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        """Take the latched messages in force; a fault among them is no new one."""
        for topic, data in latched.items():
            self._trigger(topic, data)
        self._ring.before.update(latched)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message; where a fault is old enough by now, write the recording.

        Raises:
            RecordingError: it cannot be written.
        """
        self._ring.write(topic, stamp, data)
        why = self._trigger(topic, data)
        if why and not self._due:
            self._due, self._why = stamp + round(1e9 * self._after), why
        if self._due and stamp >= self._due:
            self.save(self._why)

    def save(self, why: str) -> None:
        """Write what is held now.

        Raises:
            RecordingError: it cannot be written.
        """
        self._due = 0
        path = free_name(self._folder, time.strftime("%Y%m%d-%H%M%S"))
        self._ring.save(self._make(path, why))
        self.saved.append((path, why))

    def close(self) -> None:
        """Write what a fault asked for and is not written yet."""
        if self._due:
            self.save(self._why)


def free_name(folder: Path, name: str) -> Path:
    """A path in a folder that is not there yet: the name, or with a number behind."""
    path, number = folder / name, 2
    while path.exists():
        path, number = folder / f"{name}_{number}", number + 1
    return path
