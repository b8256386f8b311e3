# SPDX-License-Identifier: Apache-2.0
"""Writing a recording: MCAP files in a folder, with the metadata.yaml of rosbag2."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..whole_file import write_whole, yaml_text
from .definitions import definition
from .errors import RecordingError, library
from .topics import Topic

#: Metadata version of rosbag2 in ROS 2 Jazzy.
VERSION = 9
#: An infinite duration of rmw.
FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass(slots=True)
class Part:
    """One file: path, first and last (stamps, ns), counts (messages by topic), size, and that of
    the messages that it begins with (bytes).
    """

    path: Path
    first: int = 0
    last: int = 0
    size: int = 0
    head: int = 0
    counts: dict[Topic, int] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def metadata(parts: list[Part], custom: Mapping[str, str]) -> dict[str, Any]:
    """The metadata of a recording as rosbag2 of ROS 2 Jazzy writes it, in its order."""
    first = min((part.first for part in parts), default=time.time_ns())
    last = max((part.last for part in parts), default=first)
    counts: dict[Topic, int] = {}
    for part in parts:
        for topic, count in part.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": last - first},
        "starting_time": {"nanoseconds_since_epoch": first},
        "message_count": sum(counts.values()),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [qos_of(topic)],
                    "type_description_hash": definition(topic.type).hash,
                },
                "message_count": count,
            }
            for topic, count in counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [part.path.name for part in parts],
        "files": [
            {
                "path": part.path.name,
                "starting_time": {"nanoseconds_since_epoch": part.first},
                "duration": {"nanoseconds": part.last - part.first},
                "message_count": part.messages,
            }
            for part in parts
        ],
        "custom_data": dict(custom) or None,
        "ros_distro": "jazzy",
    }


def qos_of(topic: Topic) -> dict[str, Any]:
    """The QoS of a topic in the terms of rosbag2."""
    return {
        "history": "keep_last",
        "depth": 1 if topic.latched else 10,
        "reliability": "reliable" if topic.reliable else "best_effort",
        "durability": "transient_local" if topic.latched else "volatile",
        "deadline": dict(FOREVER),
        "lifespan": dict(FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(FOREVER),
        "avoid_ros_namespace_conventions": False,
    }


#: Bytes kept free on the disk, for the index of the open file and other programs.
RESERVE = 64_000_000
#: s between chunks: what a killed writer, or a loss of power, loses at most.
CHUNK_TIME = 1.0
#: Bytes written between checks of free space; overhead of a message, bytes.
CHECK_EVERY, OVERHEAD = 1_000_000, 31


class Bag:
    """Writes messages into a new folder; starts a new file at a limit.

    Every file begins with the last message of each latched topic: each is readable alone.

    Args:
        folder: To create.
        split_size: Bytes of a file beyond those first messages; None: without limit.
        split_time: Seconds of a file; None: without limit.
        custom: Texts for ``custom_data`` of the metadata.
        reserve: Bytes to leave free on the disk.

    Raises:
        RecordingError: The folder exists or cannot be created, or rosbags is missing.
    """

    def __init__(
        self,
        folder: Path,
        *,
        split_size: float | None = None,
        split_time: float | None = None,
        custom: Mapping[str, str] | None = None,
        reserve: int = RESERVE,
    ) -> None:
        self._rosbag2 = library("rosbags.rosbag2")
        self._parse_qos = library("rosbags.rosbag2.metadata").parse_qos
        self.folder = folder
        self._split_size, self._split_time = split_size, split_time
        self._custom = dict(custom or {})
        self._reserve, self._unchecked = reserve, 0
        self._synced = 0.0
        self._latched: dict[Topic, bytes] = {}
        self._writer: Any = None
        self._connections: dict[Topic, Any] = {}
        self.parts: list[Part] = []
        self._done: list[Part] = []
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            raise RecordingError(f"{folder} exists already; choose another folder") from None
        except OSError as error:
            raise RecordingError(f"cannot make {folder}: {error.strerror}") from None
        try:
            self._check_disk()
        except RecordingError:
            folder.rmdir()
            raise

    @property
    def messages(self) -> int:
        return sum(part.messages for part in self.parts)

    @property
    def size(self) -> int:
        return sum(part.size for part in self.parts)

    def begin(self, latched: Mapping[Topic, bytes]) -> None:
        """Set the latched messages at the start of the first file."""
        self._latched.update(latched)

    def write(self, topic: Topic, stamp: int, data: bytes) -> None:
        """Add a message.

        Args:
            topic: Of the message.
            stamp: Time of reception, ns.
            data: CDR.

        Raises:
            RecordingError: The disk is full.
        """
        if topic.latched:
            self._latched[topic] = data
        if self._writer is not None and self._split_due(stamp):
            self._end_part()
        if self._writer is None:
            self._begin_part(stamp)
            if topic.latched:
                return  # written with the latched ones
        self._add(topic, stamp, data)

    def sync(self) -> None:
        """Put what was written on the disk, as a chunk, once each CHUNK_TIME; to be called often.

        Raises:
            RecordingError: The disk is full.
        """
        now = time.monotonic()
        if self._writer is None or now - self._synced < CHUNK_TIME:
            return
        self._synced = now
        storage = self._writer.storage
        with self._disk_errors():
            if storage.chunk.bio.tell():
                storage.close_chunk()
                storage.bio.flush()
                os.fdatasync(storage.bio.fileno())

    def close(self) -> None:
        """Finish the last file and the metadata.

        Raises:
            RecordingError: The disk is full; written data remain.
        """
        if self._writer is not None:
            self._end_part()
        else:
            self._write_metadata()

    # --- one file -----------------------------------------------------------------------------

    def _split_due(self, stamp: int) -> bool:
        part = self.parts[-1]
        size = part.size - part.head
        too_large = self._split_size is not None and size >= self._split_size
        too_long = self._split_time is not None and stamp - part.first >= 1e9 * self._split_time
        return too_large or too_long

    def _begin_part(self, stamp: int) -> None:
        name = f"{self.folder.name}_{len(self.parts)}"
        part = Part(self.folder / f"{name}.mcap", stamp, stamp)
        with self._disk_errors():
            writer = self._rosbag2.Writer(
                self.folder / name,
                version=VERSION,
                storage_plugin=self._rosbag2.StoragePlugin.MCAP,
            )
            writer.open()
        self.parts.append(part)
        self._writer, self._connections = writer, {}
        for topic, data in self._latched.items():
            self._add(topic, stamp, data)
        part.head = part.size

    def _add(self, topic: Topic, stamp: int, data: bytes) -> None:
        part = self.parts[-1]
        with self._disk_errors():
            connection = self._connections.get(topic)
            if connection is None:
                connection = self._connections[topic] = self._connect(topic)
            self._writer.write(connection, stamp, data)
        part.last = max(part.last, stamp)
        part.counts[topic] = part.counts.get(topic, 0) + 1
        part.size += len(data) + OVERHEAD
        self._unchecked += len(data) + OVERHEAD
        if self._unchecked >= CHECK_EVERY:
            self._check_disk()

    def _connect(self, topic: Topic) -> Any:
        known = definition(topic.type)
        return self._writer.add_connection(
            topic.name,
            topic.type,
            msgdef=known.text,
            rihs01=known.hash,
            offered_qos_profiles=self._parse_qos([qos_of(topic)]),
        )

    def _end_part(self) -> None:
        writer, self._writer = self._writer, None
        part = self.parts[-1]
        try:
            with self._disk_errors():
                writer.close()
                made = self.folder / part.path.stem
                (made / part.path.name).rename(part.path)
                shutil.rmtree(made)
                self._done.append(part)
                self._write_metadata()
        except RecordingError:
            writer.abort()
            raise

    # --- the disk -----------------------------------------------------------------------------

    def _check_disk(self) -> None:
        self._unchecked = 0
        free = shutil.disk_usage(self.folder).free
        if free < self._reserve:
            raise RecordingError(
                f"the disk of {self.folder} is nearly full: {free / 1e6:.0f} MB are free, "
                f"{self._reserve / 1e6:.0f} MB stay so"
            )

    @contextlib.contextmanager
    def _disk_errors(self) -> Any:
        """Convert errors of the disk to RecordingError."""
        try:
            yield
        except OSError as error:
            name = self.parts[-1].path.stem if self.parts else "the first file"
            raise RecordingError(
                f"cannot write to {self.folder}: {error.strerror}; {name} is not finished "
                "(cbctl report reads what it holds)"
            ) from error

    # --- metadata.yaml ------------------------------------------------------------------------

    def _write_metadata(self) -> None:
        text = yaml_text({"rosbag2_bagfile_information": metadata(self._done, self._custom)})
        with self._disk_errors():
            write_whole(self.folder / "metadata.yaml", text)
