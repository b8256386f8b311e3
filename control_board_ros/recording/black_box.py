# SPDX-License-Identifier: Apache-2.0
"""The black box: the last seconds of a board in memory, written on a fault."""

from __future__ import annotations

import shutil
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
MAX_MEMORY_BYTES = 512_000_000
#: Recordings that are kept, and their bytes; the oldest are removed.
KEEP, KEEP_SIZE = 50, 2_000_000_000


class BlackBox:
    """Keeps the last seconds, and writes them into a new folder after a fault.

    Between two recordings there are ``seconds``: faults that come and go are recorded one after
    the other, each second once, and none is missed.

    Args:
        folder: Of the recordings.
        seconds: Duration before a fault.
        after: Duration after a fault.
        make: Creates a bag in a new folder, with the faults.
        keep: Recordings to keep, the newest.
        keep_size: Their bytes, at most; the newest is kept whatever its size.

    Attributes: saved (recordings, with reason, also those removed since), size (bytes).
    """

    def __init__(
        self,
        folder: Path,
        seconds: float,
        after: float,
        make: Callable[[Path, str], Bag],
        *,
        keep: int = KEEP,
        keep_size: float = KEEP_SIZE,
    ) -> None:
        self._folder, self._make = folder, make
        self._pause, self._after = round(1e9 * seconds), round(1e9 * after)
        self._span = self._pause + self._after
        self._max_count, self._max_bytes = keep, keep_size
        self._kept: deque[tuple[Path, int]] = deque()
        self._free = 0  # time from which a recording is written, ns
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
            self._due, self._why = max(stamp + self._after, self._free), why
        if self._due and stamp >= self._due:
            self._free = stamp + self._pause
            self._save()

    def sync(self) -> None:
        """Nothing: what is not written is in memory on purpose."""

    def close(self) -> None:
        """Write a pending recording."""
        if self._due:
            self._save()

    def _keep(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Keep a message, and drop expired ones."""
        self._held.append((topic, stamp, data))
        self.size += len(data)
        while self._held and (
            stamp - self._held[0][1] > self._span or self.size > MAX_MEMORY_BYTES
        ):
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
        self._kept.append((path, bag.size))
        self._remove_old()

    def _remove_old(self) -> None:
        """Remove the oldest recordings beyond those to keep."""
        while len(self._kept) > 1 and (
            len(self._kept) > self._max_count
            or sum(size for _, size in self._kept) > self._max_bytes
        ):
            path, _ = self._kept.popleft()
            shutil.rmtree(path, ignore_errors=True)


def free_name(folder: Path, name: str) -> Path:
    """An unused path in a folder: the name, with a number if necessary."""
    path, number = folder / name, 2
    while path.exists():
        path, number = folder / f"{name}_{number}", number + 1
    return path
