# SPDX-License-Identifier: Apache-2.0
"""ROS parameter files, read without ROS, safely and with line numbers.

rcl reports a broken file by a traceback and ignores a misspelt name, so the board reads the files
itself. Only plain YAML is accepted: no tags, anchors or aliases; size, depth and number of values
are bounded.
"""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..core.config.parameter import Kind, Parameter, size_text
from ..whole_file import yaml_text
from .yaml_tree import Leaf, Mapping, SettingsError, parse_yaml, shown

__all__ = ["Entry", "Layer", "SettingsError", "parse_value", "read_file", "shown"]

SIZE_CAP = 1024 * 1024
PATTERN_CAP = 200


@dataclass(frozen=True, slots=True)
class Entry:
    """A value and its origin (``file:line``, or ``-p`` for the command line)."""

    value: Any
    where: str


Entries = dict[str, Entry]


@dataclass(slots=True)
class Layer:
    """Parameters of one source: entries by flat name, and the base folder of relative paths."""

    entries: Entries = field(default_factory=dict)
    folder: Path | None = None
    path: Path | None = None


#: Full name of the node, unless it is remapped.
NODE_NAME = "/control_board"


def read_file(path: Path, node: str = NODE_NAME) -> Layer:
    """The parameters of a node in a file.

    Args:
        path: A ROS parameter file: ``<node>: {ros__parameters: {…}}``.
        node: The node's full name; ``/**`` and ``*`` in the file match as in ROS. A section
            whose name has no slash matches the node's bare name, in any namespace.

    Raises:
        SettingsError: the file is unreadable or invalid.
    """
    text = read_text(path)
    if text.lstrip().startswith("<"):
        raise SettingsError(f"{path}: is XML, no parameter file; for a URDF: -p robot:={path}")
    top = _parse(text, str(path))
    layer = Layer(folder=path.absolute().parent, path=path.absolute())
    sections = list(_sections(top, str(path)))
    if not sections:
        raise SettingsError(
            f"{path}: has no ros__parameters; write control_board: {{ros__parameters: {{…}}}}"
        )
    used = [body for name, body in sections if _matches(name, node)]
    if not used:
        names = ", ".join(name for name, _ in sections[:5])
        raise SettingsError(
            f"{path}:{sections[0][1].line}: no section for node {node}, only {names}; "
            "rename one to control_board or /**"
        )
    for body in used:
        layer.entries.update(_flat(body, str(path)))
    return layer


def file_text(values: typing.Mapping[str, Any], comments: Sequence[str]) -> str:
    """A parameter file for every node, below comments; values by full name."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split(".")
        place = tree
        for group in groups:
            place = place.setdefault(group, {})
        place[last] = value
    return "\n".join([*comments, yaml_text({"/**": {"ros__parameters": tree}})])


def parse_value(text: str, where: str) -> Any:
    """The value of a ``-p name:=value`` argument, typed as in a file."""
    parsed = parse_yaml(text, where)
    if isinstance(parsed, Leaf):
        return parsed.value
    raise SettingsError(f"{where}: {shown(text)} is not one value or a list of values")


def read_text(path: Path) -> str:
    """The text of a file of settings; raises SettingsError where it cannot be read."""
    try:
        if path.is_dir():
            raise SettingsError(f"{path}: is a folder; name a YAML file")
        if not path.exists():
            raise SettingsError(f"{path}: there is no such file; check the path")
        if not path.is_file():
            raise SettingsError(f"{path}: is not a regular file; name a YAML file")
        with path.open("rb") as file:
            data = file.read(SIZE_CAP + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, SettingsError):
            raise
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise SettingsError(f"{shown(str(path))}: cannot be read ({reason})") from None
    if len(data) > SIZE_CAP:
        raise SettingsError(f"{path}: larger than {SIZE_CAP >> 20} MiB; settings are smaller")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise SettingsError(
            f"{path}:{line}: byte {data[error.start]:#04x} is not UTF-8 text; save as UTF-8"
        ) from None


def _parse(text: str, source: str) -> Mapping:
    parsed = parse_yaml(text, source)
    if not isinstance(parsed, Mapping):
        raise SettingsError(
            f"{source}: is empty or no mapping; write control_board: {{ros__parameters: {{…}}}}"
        )
    return parsed


def _sections(top: Mapping, source: str) -> Iterator[tuple[str, Mapping]]:
    """Pairs of node name and the mapping under its ros__parameters."""
    stack: list[tuple[str, Any]] = list(reversed(top.items.items()))
    while stack:
        name, node = stack.pop()
        if not isinstance(node, Mapping):
            raise SettingsError(
                f"{source}:{node.line}: {shown(name)} is a value where a node's section is "
                "due; write control_board: {ros__parameters: {…}}"
            )
        for key, inner in reversed(node.items.items()):
            if key != "ros__parameters":
                stack.append((f"{name.rstrip('/')}/{key.lstrip('/')}", inner))
            elif isinstance(inner, Mapping):
                yield name, inner
            elif inner.value is not None:
                raise SettingsError(f"{source}:{inner.line}: ros__parameters is not a mapping")


def _matches(pattern: str, node: str) -> bool:
    """Whether a section matches this node; as rcl, but a bare name matches any namespace."""
    if "/" not in pattern.strip():
        return pattern in (node.rsplit("/", 1)[-1], "*", "**")
    if len(pattern) > PATTERN_CAP:
        return False
    tokens = re.sub(r"(/\*\*)+", "/**", "/" + pattern.strip("/")).split("/")[1:]
    translated = "".join(
        r"(/[^/]+)*" if token == "**" else "/" + re.sub(r"(\\\*)+", "[^/]*", re.escape(token))
        for token in tokens
    )
    return re.fullmatch(translated, node) is not None


def _flat(body: Mapping, source: str) -> dict[str, Entry]:
    """Flatten nested names, joined by dots."""
    flat: dict[str, Entry] = {}
    stack: list[tuple[str, Any]] = list(reversed(body.items.items()))
    while stack:
        name, node = stack.pop()
        if isinstance(node, Mapping):
            stack += [(f"{name}.{key}", inner) for key, inner in reversed(node.items.items())]
            continue
        if name in flat:
            first = flat[name].where
            raise SettingsError(f"{source}:{node.line}: {shown(name)} again, first in {first}")
        if node.value is None:
            raise SettingsError(f"{source}:{node.line}: {shown(name)}: has no value")
        flat[name] = Entry(node.value, f"{source}:{node.line}")
    return flat


def convert(row: Parameter, name: str, entry: Entry) -> Any:
    """The value in its parameter's type; integers become floats where required.

    Raises:
        SettingsError: wrong type, out of range, or not among the choices.
    """
    value = _typed(row, entry.value)
    if value is None:
        at = f"{entry.where}: " if entry.where else ""
        value_text = shown(entry.value)
        items = entry.value if isinstance(entry.value, list) else [entry.value]
        text = row.kind in (Kind.STRING, Kind.STRINGS) and not row.choices
        quotes = text and any(isinstance(item, (int, float)) for item in items)
        hint = ", numbers in quotes" if quotes else size_text(entry.value)
        raise SettingsError(f"{at}{name}: {value_text} is not allowed; use {row.range_text}{hint}")
    return value


def _typed(row: Parameter, value: Any) -> Any:
    """The typed value, None where it is not allowed."""
    low, high = row.bounds
    if row.kind is Kind.BOOL:
        is_choice = isinstance(value, str) and value in row.choices
        return value if isinstance(value, bool) or is_choice else None
    if row.kind is Kind.INTEGER:
        return value if type(value) is int and low <= value <= high else None
    if row.kind is Kind.DOUBLE:
        return _number(row, value)
    if row.kind is Kind.STRING:
        return _choice(row, value)
    if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
        return None
    items = [(_number if row.kind is Kind.DOUBLES else _choice)(row, item) for item in value]
    right = row.length is None or len(items) == row.length
    return items if right and None not in items else None


def _number(row: Parameter, value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if row.allows(number) else None


def _choice(row: Parameter, value: Any) -> str | None:
    """A choice; modes by code or long name, case-insensitive, as the code."""
    if not isinstance(value, str) or "\0" in value:
        return None
    if not row.choices:
        return value if re.fullmatch(row.pattern or ".*", value, re.DOTALL) else None
    for code, choice in row.choices.items():
        if value.lower() in (code, str(choice).lower()):
            return code
    return None
