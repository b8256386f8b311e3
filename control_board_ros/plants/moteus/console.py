# SPDX-License-Identifier: Apache-2.0
"""The diagnostic stream of a virtual moteus: ``conf``, ``tel`` and ``d``, line by line.

Commands and answers: the maker's docs/reference/diagnostic.md; the form of binary telemetry is
that which its library reads (moteus 1.1.1, reader.py).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

#: Types of a telemetry schema.
SIGNED, UNSIGNED, FLOAT, RECORD, ARRAY = 3, 4, 7, 16, 19


class Field(NamedTuple):
    """A number of a channel: its name, ``struct`` code, and how many of it; 0: one alone."""

    name: str
    form: str
    length: int = 0


#: Channels that its tools read, with their first fields.
CHANNELS: Mapping[str, tuple[Field, ...]] = {
    "firmware": (Field("version", "I"), Field("serial_number", "I", 3), Field("model", "I")),
    "git": (Field("hash", "B", 20), Field("dirty", "B"), Field("timestamp", "Q")),
    "servo_stats": (
        Field("mode", "B"), Field("fault", "i"), Field("position", "f"), Field("velocity", "f"),
        Field("torque_Nm", "f"), Field("q_A", "f"), Field("filt_bus_V", "f"),
        Field("fet_temp_C", "f"), Field("trajectory_done", "B"),
    ),
}  # fmt: skip


class Spoken(Protocol):
    """A drive as its console sees it."""

    conf: dict[str, float]
    stored: dict[str, float]

    def order(self, words: list[str]) -> bool:
        """Obey a command that begins with ``d``; false: it is unknown."""
        ...

    def telemetry(self, channel: str) -> Mapping[str, float | list[int]]:
        """The values of a channel."""
        ...


class Console:
    """Lines that come, and bytes that wait to be fetched."""

    def __init__(self, drive: Spoken) -> None:
        self._drive, self._line, self._said = drive, b"", b""

    def hear(self, data: bytes) -> None:
        """Take a part of a line, or of several."""
        *lines, self._line = (self._line + data).replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            if words := line.decode("latin1").split():
                self._said += self._answer(words)

    def say(self, most: int) -> bytes:
        """The next bytes."""
        said, self._said = self._said[:most], self._said[most:]
        return said

    def _answer(self, words: list[str]) -> bytes:
        verbs: dict[str, Callable[[list[str]], bytes]] = {"conf": self._conf, "tel": self._tel}
        if words[0] in verbs and len(words) > 1:
            return verbs[words[0]](words[1:])
        if words[0] == "d" and self._drive.order(words[1:]):
            return b"OK\r\n"
        return b"ERR unknown command\r\n"

    def _conf(self, words: list[str]) -> bytes:
        drive, verb, names = self._drive, words[0], words[1:]
        conf = drive.conf
        groups = dict.fromkeys(name.partition(".")[0] for name in conf)
        if verb == "list":
            return text([*groups, "OK"])
        if verb == "enumerate":
            if names and names[0] not in groups:
                return b"ERR unknown group\r\n"
            mine = (name for name in conf if not names or name.startswith(f"{names[0]}."))
            return text([*(f"{name} {number(conf[name])}" for name in mine), "OK"])
        if verb == "write":
            drive.stored = dict(conf)
        elif verb == "load":
            conf.update(drive.stored)
        elif verb == "get":
            known = bool(names) and names[0] in conf
            return text([number(conf[names[0]])]) if known else b"ERR error reading\r\n"
        elif not self._set(names):
            return b"ERR error setting\r\n"
        return b"OK\r\n"

    def _set(self, words: list[str]) -> bool:
        if len(words) != 2 or words[0] not in self._drive.conf:
            return False
        try:
            self._drive.conf[words[0]] = float(words[1])
        except ValueError:
            return False
        return True

    def _tel(self, words: list[str]) -> bytes:
        verb, channel = words[0], words[1] if len(words) > 1 else ""
        if verb == "list":
            return text([*CHANNELS, "OK"])
        if verb == "stop" or (verb in ("fmt", "rate", "text") and channel in CHANNELS):
            return b"OK\r\n"
        if channel not in CHANNELS or verb not in ("schema", "get"):
            return b"ERR unknown command\r\n"
        if verb == "schema":
            return blob(f"schema {channel}", schema(CHANNELS[channel]))
        return blob(f"emit {channel}", packed(CHANNELS[channel], self._drive.telemetry(channel)))


def number(value: float) -> str:
    return "nan" if math.isnan(value) else f"{value:g}"


def text(lines: list[str]) -> bytes:
    return "".join(f"{line}\r\n" for line in lines).encode()


def blob(head: str, data: bytes) -> bytes:
    """Binary data after the line that announces it."""
    return f"{head}\r\n".encode() + struct.pack("<I", len(data)) + data


def schema(fields: tuple[Field, ...]) -> bytes:
    """The schema of a record: each field with its flags, name, no other names, and no default."""
    data = bytes([RECORD, 0])
    for field in fields:
        size = struct.calcsize(field.form)
        kind = {"f": bytes([FLOAT]), "i": bytes([SIGNED, size])}.get(
            field.form, bytes([UNSIGNED, size])
        )
        many = bytes([ARRAY, field.length]) if field.length else b""
        data += bytes([0, len(field.name)]) + field.name.encode() + bytes([0]) + many + kind
        data += bytes(1)
    return data + bytes(5)  # a field without a name, which is the end


def packed(fields: tuple[Field, ...], values: Mapping[str, float | list[int]]) -> bytes:
    """Values in the order of their fields."""
    data = b""
    for name, form, length in fields:
        value = values[name]
        parts = value if isinstance(value, list) else [value]
        whole = parts if form == "f" else [int(part) for part in parts]
        data += struct.pack(f"<{length or 1}{form}", *whole)
    return data
