# SPDX-License-Identifier: Apache-2.0
"""Type hashes RIHS01, computed from interface files alone (REP 2011).

A hash is the SHA-256 of a type's description as JSON: its fields in order, then the types that it
refers to, sorted by name. Comments, constants and defaults are no part of it.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory

import control_board_ros  # noqa: F401 - registers the wheels with ament

#: type_description_interfaces/msg/FieldType; a sequence without bound adds UNBOUNDED.
TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
NESTED, UNBOUNDED = 1, 144
#: A default may follow.
FIELD = re.compile(r"^([\w/]+)(\[\])?\s+(\w+)(?:\s+[^=\s].*)?$")
CONSTANT = re.compile(r"^(\w+)\s+(\w+)\s*=\s*(.*)$")

Description = dict[str, Any]


def lines(path: Path) -> list[list[str]]:
    """The parts of an interface file without comments."""
    parts: list[list[str]] = [[]]
    for line in path.read_text(encoding="utf-8").splitlines():
        text = line.partition("#")[0].strip()
        if text == "---":
            parts.append([])
        elif text:
            parts[-1].append(text)
    return parts


def constants(path: Path) -> dict[str, str]:
    """The constants of an interface file: type and value by name."""
    found = [CONSTANT.match(line) for part in lines(path) for line in part]
    return {match[2]: f"{match[1]} {match[3]}" for match in found if match}


def described(name: str, part: list[str]) -> Description:
    """A type as it is hashed; ``name`` is its full name."""
    package, fields = name.split("/", maxsplit=1)[0], []
    for match in filter(None, map(FIELD.match, part)):
        kind, sequence, field = match.groups()
        nested = ""
        if kind not in TYPE_IDS:
            home, _, short = kind.rpartition("/")
            nested = f"{home or package}/msg/{short}"
        type_id = TYPE_IDS.get(kind, NESTED) + (UNBOUNDED if sequence else 0)
        fields.append(
            {
                "name": field,
                "type": {
                    "type_id": type_id,
                    "capacity": 0,
                    "string_capacity": 0,
                    "nested_type_name": nested,
                },
            }
        )
    return {"type_name": name, "fields": fields}


def nested_names(description: Description) -> Iterator[str]:
    for field in description["fields"]:
        if name := field["type"]["nested_type_name"]:
            yield name


def installed(name: str) -> Description:
    """A type of another package as its generator described it."""
    package, kind, short = name.split("/")
    path = Path(get_package_share_directory(package)) / kind / f"{short}.json"
    made = json.loads(path.read_text(encoding="utf-8"))["type_description_msg"]
    return without_defaults(made["type_description"])


def without_defaults(description: Description) -> Description:
    fields = [{k: f[k] for k in ("name", "type")} for f in description["fields"]]
    return {"type_name": description["type_name"], "fields": fields}


def hash_of(description: Description, folder: Path) -> str:
    """The hash of a type; types of its own package come from the interface files of a folder."""
    package = description["type_name"].split("/")[0]
    known: dict[str, Description] = {}
    wanted = list(nested_names(description))
    while wanted:
        name = wanted.pop()
        if name not in known:
            own = folder / "msg" / f"{name.split('/')[-1]}.msg"
            mine = name.startswith(f"{package}/")
            known[name] = described(name, lines(own)[0]) if mine else installed(name)
            wanted += nested_names(known[name])
    return hash_of_whole(description, [known[name] for name in sorted(known)])


def hash_of_whole(description: Description, referenced: list[Description]) -> str:
    whole = {"type_description": description, "referenced_type_descriptions": referenced}
    text = json.dumps(whole, separators=(", ", ": "))
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()
