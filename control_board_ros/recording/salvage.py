# SPDX-License-Identifier: Apache-2.0
"""Reading MCAP files that are cut off: what a killed writer, or a loss of power, left.

A finished file ends with an index. Without it the records are read from the beginning up to the
last whole one; a chunk is one record, and our writer ends one each second. Format:
https://mcap.dev/spec
"""

from __future__ import annotations

import contextlib
import mmap
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from .errors import RecordingError, library

MAGIC = b"\x89MCAP0\r\n"
#: Kinds of records.
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = 2, 3, 4, 5, 6
#: Bytes of a record before its content; maximum bytes of a chunk's content.
HEAD, MAX_CHUNK = 9, 1 << 30


class Connection(NamedTuple):
    """Messages of a topic in a file: topic, msgtype (as rosbags names them)."""

    topic: str
    msgtype: str


class Cut(ValueError):  # noqa: N818
    """A record is not whole, or is none."""


#: What damaged content raises here and in decompressors.
DAMAGE = (ValueError, struct.error, EOFError, RuntimeError)


class Fields:
    """The fields of a record's content, one after the other; raises Cut beyond its end."""

    def __init__(self, content: memoryview) -> None:
        self._content, self._at = content, 0

    def take(self, size: int) -> memoryview:
        if size > len(self._content) - self._at:
            raise Cut(f"a field of {size} bytes ends beyond its record")
        self._at += size
        return self._content[self._at - size : self._at]

    def numbers(self, form: str) -> tuple[Any, ...]:
        return struct.unpack(form, self.take(struct.calcsize(form)))

    def sized(self) -> memoryview:
        return self.take(self.numbers("<I")[0])

    def text(self) -> str:
        return bytes(self.sized()).decode()

    def rest(self) -> memoryview:
        return self.take(len(self._content) - self._at)


def records(data: memoryview, at: int = 0) -> Iterator[tuple[int, int, memoryview]]:
    """Kind, end and content of each record; raises Cut at one that is not whole."""
    while at < len(data):
        head = data[at : at + HEAD]
        if len(head) < HEAD or not head[0]:
            raise Cut(f"no record at byte {at}")
        kind, size = struct.unpack("<BQ", head)
        at += HEAD + size
        if at > len(data):
            raise Cut(f"a record of {size} bytes ends {at - len(data)} bytes beyond the file")
        yield kind, at, data[at - size : at]


def unpacked(chunk: Fields) -> memoryview:
    """The records of a chunk, decompressed, of the size that it says."""
    _, _, size, _ = chunk.numbers("<QQQI")
    compression, packed = chunk.text(), chunk.take(chunk.numbers("<Q")[0])
    if size > MAX_CHUNK:
        raise Cut(f"a chunk of {size} bytes; {MAX_CHUNK} at most are read")
    if not compression:
        content = packed
    elif compression == "lz4":
        decompressor = library("lz4.frame").LZ4FrameDecompressor()
        content = memoryview(decompressor.decompress(packed, max_length=size + 1))
    elif compression == "zstd":
        decompressor = library("rosbags.rosbag2.storage_mcap").zstd.ZstdDecompressor()
        content = memoryview(decompressor.decompress(packed, max_length=size + 1))
    else:
        raise Cut(f"a chunk with the compression {compression[:20]!r}")
    if len(content) != size:
        raise Cut("a chunk of another size than it says")
    return content


@dataclass(slots=True)
class File:
    """What is whole of a file.

    Attributes: path, missing (what is not, one line; empty for a finished file), types
    (definitions, by name), messages (stamp in ns and CDR, by connection).
    """

    path: Path
    missing: str = ""
    types: dict[str, tuple[str, str]] = field(default_factory=dict)
    messages: dict[Connection, list[tuple[int, memoryview]]] = field(default_factory=dict)
    _schemas: dict[int, str] = field(default_factory=dict)
    _channels: dict[int, Connection] = field(default_factory=dict)

    def read(self, data: memoryview) -> None:
        """Read its records up to the first that is not whole; damaged chunks are left out."""
        end, finished, damaged = len(MAGIC), False, list[str]()
        try:
            if bytes(data[:end]) != MAGIC:
                raise Cut("it does not begin as an MCAP file")
            for kind, after, content in records(data, end):
                try:
                    self._take(kind, content)
                except DAMAGE as error:
                    damaged.append(f"{error}")
                end, finished = after, kind == FOOTER
                if finished:
                    break
        except Cut as error:
            left = len(data) - min(end, len(data))
            self.missing = f"{self.path.name}: its last {left} bytes are not whole ({error})"
        else:
            if not finished:
                self.missing = f"{self.path.name}: was not finished; what came after is missing"
        if damaged:
            lacks = f"{len(damaged)} damaged records are left out ({damaged[0]})"
            self.missing = f"{self.missing or self.path.name}; {lacks}"

    def _take(self, kind: int, content: memoryview) -> None:
        fields = Fields(content)
        if kind == CHUNK:
            inside = list(records(unpacked(fields)))  # all of it, or none where it is damaged
            for inner, _, part in inside:
                if inner != CHUNK:
                    self._take(inner, part)
        elif kind == SCHEMA:
            (number,) = fields.numbers("<H")
            name, encoding = fields.text(), fields.text()
            self._schemas[number] = name
            self.types[name] = (encoding, fields.text())
        elif kind == CHANNEL:
            number, schema = fields.numbers("<HH")
            connection = Connection(fields.text(), self._schemas.get(schema, ""))
            self._channels[number] = connection
            self.messages.setdefault(connection, [])
        elif kind == MESSAGE:
            number, _, stamp, _ = fields.numbers("<HIQQ")
            if number in self._channels:
                self.messages[self._channels[number]].append((stamp, fields.rest()))


class Salvage:
    """The whole records of files, in the form of rosbags' AnyReader.

    Args:
        paths: Of the files, in their order.

    Attributes:
        connections: Topics with their types.
        missing: What is missing, a line per file that is not finished.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        files = [file_at(path) for path in paths]
        self.missing = [file.missing for file in files if file.missing]
        self._messages: dict[Connection, list[tuple[int, memoryview]]] = {}
        types: dict[str, tuple[str, str]] = {}
        for file in files:
            types |= file.types
            for connection, messages in file.messages.items():
                self._messages.setdefault(connection, []).extend(messages)
        self.connections = list(self._messages)
        self._store = store_of(tuple((name, *row) for name, row in sorted(types.items())))

    def messages(
        self, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Connection, stamp (ns) and CDR of messages, in the order of their stamps."""
        for connection in connections:
            for stamp, data in sorted(self._messages[connection], key=lambda message: message[0]):
                yield connection, stamp, bytes(data)

    def deserialize(self, data: bytes, msgtype: str) -> Any:
        return self._store.deserialize_cdr(data, msgtype)


def file_at(path: Path) -> File:
    """Read what is whole of a file; raises OSError."""
    file = File(path)
    with path.open("rb") as opened:
        if not path.stat().st_size:
            file.missing = f"{path.name}: was not finished, and is empty"
            return file
        file.read(memoryview(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)))
    return file


@lru_cache(maxsize=4)
def store_of(types: tuple[tuple[str, str, str], ...]) -> Any:
    """The message types of definitions (name, encoding, text), of those in the form of .msg."""
    typesys = library("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    definitions: dict[str, Any] = {}
    for name, encoding, text in types:
        parse: Callable[..., dict[str, Any]] = typesys.get_types_from_msg
        if encoding == "ros2msg":
            with contextlib.suppress(typesys.TypesysError):  # its topics are not read
                definitions |= parse(text, name)
    store.register(definitions)
    return store


def parts_of(path: Path) -> list[Path]:
    """The MCAP files of a recording: finished ones, and that which its writer left open.

    The writer makes ``FOLDER/NAME_2/NAME_2.mcap``, and moves it to ``FOLDER`` when it is finished.
    """
    if path.is_file():
        return [path]
    return sorted([*path.glob("*.mcap"), *open_parts(path)], key=lambda part: order(part.stem))


def open_parts(folder: Path) -> list[Path]:
    """The files that a writer did not finish."""
    inside = (part / f"{part.name}.mcap" for part in sorted(folder.iterdir()) if part.is_dir())
    return [part for part in inside if part.is_file()]


def order(name: str) -> tuple[str, int]:
    """Sorts ``rec_10`` after ``rec_9``."""
    front, _, number = name.rpartition("_")
    return (front, int(number)) if number.isdecimal() else (name, 0)


def salvage(path: Path, why: str) -> Salvage:
    """What can be read of a recording that is not finished, or damaged.

    Args:
        path: Its folder, or one file.
        why: Why it cannot be read as a whole.

    Raises:
        RecordingError: it has no whole chunk.
    """
    files = parts_of(path)
    salvaged = Salvage(files)
    if not salvaged.connections:
        raise RecordingError(f"{path} cannot be read: {why or '; '.join(salvaged.missing)}")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        salvaged.missing.insert(0, "no metadata.yaml: the recording was not finished")
    elif not salvaged.missing:  # all that is there is whole
        salvaged.missing.append(why)
    return salvaged
