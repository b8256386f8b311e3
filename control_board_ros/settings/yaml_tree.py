# SPDX-License-Identifier: Apache-2.0
"""Plain YAML with line numbers: no tags, no anchors, no aliases, bounded in size."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from ..text import OneLineError

DEPTH_CAP = 16
VALUE_CAP = 20_000

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)$")
_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$")
_SPECIAL = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan}
_BOOLEANS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


class SettingsError(OneLineError):
    """An invalid setting; one line: location, name, value, what is allowed."""


@dataclass(slots=True)
class Mapping:
    """A mapping: its nodes by key, and the line of its key."""

    items: dict[str, Any]
    line: int


@dataclass(slots=True)
class Leaf:
    """A plain value or a list of plain values, and the line of its key."""

    value: Any
    line: int


def shown(value: Any) -> str:
    """A value for error messages: short, on one line."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…" + text[-1]


def parse_yaml(text: str, source: str) -> Mapping | Leaf | None:
    """The single document of a YAML text; None if empty.

    Raises:
        SettingsError: not YAML, or more than plain YAML; one line with the line number.
    """
    try:
        return _Builder(source, yaml.parse(text, Loader=_LOADER)).build()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else 1
        lines = text.splitlines()
        tab = "\t" in lines[line - 1] if line <= len(lines) else False
        hint = "; indent with spaces, not tabs" if tab else "; correct the YAML there"
        reason = " ".join(str(error.problem or error.context).split())
        raise SettingsError(f"{source}:{line}: not YAML ({reason}){hint}") from None
    except UnicodeEncodeError:
        raise SettingsError(f"{source}: is no UTF-8 text; write it as UTF-8") from None
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())[:120]
        raise SettingsError(f"{source}: not YAML ({reason}); correct the file") from None


class _Builder:
    """Builds mappings and values from parser events; recursion ends at DEPTH_CAP.

    PyYAML's compose() resolves aliases silently, has no depth limit, and its nodes do not
    distinguish explicit tags from resolved ones (decision 29).
    """

    def __init__(self, source: str, events: Iterator[Any]) -> None:
        self.source, self.events = source, events
        self.count = 0

    def fail(self, event: Any, text: str) -> SettingsError:
        return SettingsError(f"{self.source}:{event.start_mark.line + 1}: {text}")

    def build(self) -> Mapping | Leaf | None:
        root: Mapping | Leaf | None = None
        documents = 0
        while (event := next(self.events, None)) is not None:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self.fail(event, "a second document (---); a file has one")
                root = self._node(next(self.events), 0)
        return root

    def _node(self, event: Any, depth: int) -> Mapping | Leaf:
        """The node that begins with an event, nested ``depth`` deep."""
        self._check(event, depth)
        line = event.start_mark.line + 1
        if isinstance(event, yaml.ScalarEvent):
            return Leaf(self._scalar(event), line)
        if isinstance(event, yaml.MappingStartEvent):
            return Mapping(self._items(depth + 1), line)
        values = []
        while not isinstance(inside := next(self.events), yaml.SequenceEndEvent):
            self._check(inside, depth + 1)
            if not isinstance(inside, yaml.ScalarEvent):
                raise self.fail(inside, "a list in a list; lists hold plain values")
            values.append(self._scalar(inside))
        return Leaf(_uniform(values), line)

    def _items(self, depth: int) -> dict[str, Mapping | Leaf]:
        """The nodes of a mapping by key, with the lines of their keys."""
        items: dict[str, Mapping | Leaf] = {}
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            self._check(key, depth)
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarEvent):
                raise self.fail(key, "a key is a list or a mapping; keys are names")
            if key.value in items:
                first = items[key.value].line
                raise self.fail(key, f"{shown(key.value)} again, first in line {first}")
            items[key.value] = node = self._node(next(self.events), depth)
            node.line = line
        return items

    def _check(self, event: Any, depth: int) -> None:
        """Reject anything beyond plain YAML of bounded size."""
        if isinstance(event, yaml.AliasEvent) or event.anchor:
            raise self.fail(event, "anchors (&) and aliases (*) are not allowed; write it out")
        self.count += 1
        if self.count > VALUE_CAP or depth >= DEPTH_CAP:
            raise self.fail(
                event, f"nested deeper than {DEPTH_CAP} or more than {VALUE_CAP} values"
            )
        if event.tag is not None:
            raise self.fail(event, f"tag {shown(event.tag)} is not allowed; write plain values")

    def _scalar(self, event: Any) -> Any:
        text = event.value
        if not event.implicit[0]:
            return text  # quoted: text whatever it looks like
        if text.lower() in _BOOLEANS:
            return _BOOLEANS[text.lower()]
        if text in ("", "~") or text.lower() == "null":
            return None
        if _INTEGER.match(text):
            if len(text) > 20 or not -(2**63) <= int(text) < 2**63:
                raise self.fail(event, f"{shown(text)} is too large a number")
            return int(text)
        if _FLOAT.match(text):
            return float(text)
        return _SPECIAL.get(text.lower(), text)


def _uniform(values: list[Any]) -> list[Any]:
    """Convert integers to floats in lists that have floats: a list has one type."""
    if any(isinstance(value, float) for value in values):
        return [float(value) if type(value) is int else value for value in values]
    return values
