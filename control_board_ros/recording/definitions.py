# SPDX-License-Identifier: Apache-2.0
"""Message definitions and type hashes, as stored by rosbag2."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from .errors import RecordingError

#: Field types without a definition.
INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
BASE = {"bool", "byte", "char", "float32", "float64", "string", "wstring"} | INTEGERS
#: Suffixes of a field's type: ``[]``, ``[3]``, ``[<=3]``, ``<=3``.
BOUNDS = re.compile(r"(<=\d+)?(\[(<=)?\d*\])?$")
SEPARATOR = "=" * 80


@dataclass(frozen=True, slots=True)
class Definition:
    """A message type: text (its definition and those it refers to) and hash (RIHS01)."""

    text: str
    hash: str


@cache
def definition(type_name: str) -> Definition:
    """The definition of ``package/msg/Name``, from its package's files.

    Raises:
        RecordingError: the package has no such file.
    """
    try:
        text = share_file(type_name, ".msg").read_text("utf-8")
        return Definition(whole_text(type_name, text), type_hash(type_name))
    except (LookupError, OSError, ValueError) as error:
        raise RecordingError(f"no definition of {type_name} is installed: {error}") from error


def share_file(type_name: str, suffix: str) -> Path:
    package, kind, name = type_name.split("/")
    return Path(get_package_share_directory(package), kind, name).with_suffix(suffix)


def type_hash(type_name: str) -> str:
    """The hash of a type in its package: ``RIHS01_…``."""
    described = json.loads(share_file(type_name, ".json").read_text("utf-8"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    digest: str = hashes[type_name]
    return digest


def whole_text(type_name: str, text: str) -> str:
    """A definition followed by those it refers to, each below a line of ``=``."""
    parts, known = [text], {type_name}
    pending = [*referred(type_name, text)]
    while pending:
        name = pending.pop(0)
        if name not in known:
            known.add(name)
            part = share_file(name, ".msg").read_text("utf-8")
            package, _, message = name.split("/")
            parts.append(f"{SEPARATOR}\nMSG: {package}/{message}\n{part}")
            pending += referred(name, part)
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


def referred(type_name: str, text: str) -> Iterator[str]:
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if not words:
            continue
        field = BOUNDS.sub("", words[0])
        if field in BASE:
            continue
        package, _, name = field.rpartition("/")
        yield f"{package.partition('/')[0] or type_name.partition('/')[0]}/msg/{name}"
