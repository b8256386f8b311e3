# SPDX-License-Identifier: Apache-2.0
"""Plain YAML with line numbers: no tags, no anchors, no aliases, bounded in every way."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import yaml

from ..description.errors import OneLineError

DEPTH_CAP = 16
VALUE_CAP = 20_000

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)$")
_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$")
_SPECIAL = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan}
_BOOLEANS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}


class SettingsError(OneLineError):
    """A setting that cannot be used; one line: where, name, value, what is allowed."""


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
    """A value as an error message shows it: short and on one line."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…" + text[-1]


def parse_yaml(text: str, source: str) -> Mapping | Leaf | None:
    """The one document of a YAML text; None where it is empty.

    Raises:
        SettingsError: not YAML, or more than plain YAML; one line with the line number.
    """
    try:
        return _Builder(source).build(yaml.parse(text, Loader=_LOADER))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else 1
        lines = text.splitlines()
        tab = "\t" in lines[line - 1] if line <= len(lines) else False
        hint = "; indent with spaces, not tabs" if tab else "; mend the YAML there"
        reason = " ".join(str(error.problem or error.context).split())
        raise SettingsError(f"{source}:{line}: not YAML ({reason}){hint}") from None
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())[:120]
        raise SettingsError(f"{source}: not YAML ({reason}); mend the file") from None


class _Builder:
    """Builds mappings and values from parser events, without recursion."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.stack: list[Any] = []  # open mappings and lists
        self.keys: list[tuple[str, int] | None] = []  # the key that awaits a value, per mapping
        self.count = 0
        self.root: Mapping | Leaf | None = None

    def fail(self, event: Any, text: str) -> SettingsError:
        return SettingsError(f"{self.source}:{event.start_mark.line + 1}: {text}")

    def build(self, events: Any) -> Mapping | Leaf | None:
        documents = 0
        for event in events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self.fail(event, "a second document (---); a file has one")
            elif isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
                raise self.fail(event, "anchors (&) and aliases (*) are not allowed; write it out")
            elif isinstance(event, yaml.NodeEvent):
                self._node(event)
            elif isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
                done = self.stack.pop()
                if isinstance(done, Mapping):
                    self.keys.pop()
                else:
                    done.value = _uniform(done.value)
        return self.root

    def _node(self, event: Any) -> None:
        self.count += 1
        if self.count > VALUE_CAP or len(self.stack) >= DEPTH_CAP:
            raise self.fail(
                event, f"nested deeper than {DEPTH_CAP} or more than {VALUE_CAP} values"
            )
        if event.tag is not None:
            raise self.fail(event, f"tag {shown(event.tag)} is not allowed; write plain values")
        line = event.start_mark.line + 1
        parent = self.stack[-1] if self.stack else None
        if isinstance(parent, Mapping) and self.keys[-1] is None:
            if not isinstance(event, yaml.ScalarEvent):
                raise self.fail(event, "a key is a list or a mapping; keys are names")
            if event.value in parent.items:
                first = parent.items[event.value].line
                raise self.fail(event, f"{shown(event.value)} again, first in line {first}")
            self.keys[-1] = (event.value, line)
            return
        node: Mapping | Leaf
        if isinstance(event, yaml.ScalarEvent):
            node = Leaf(self._scalar(event), line)
        elif isinstance(event, yaml.MappingStartEvent):
            node = Mapping({}, line)
        else:
            node = Leaf([], line)
        self._attach(event, parent, node)
        if not isinstance(event, yaml.ScalarEvent):
            self.stack.append(node)
            if isinstance(node, Mapping):
                self.keys.append(None)

    def _attach(self, event: Any, parent: Any, node: Mapping | Leaf) -> None:
        if parent is None:
            self.root = node
        elif isinstance(parent, Mapping):
            key = self.keys[-1]
            assert key is not None  # _node has set it before a value comes
            node.line = key[1]
            parent.items[key[0]] = node
            self.keys[-1] = None
        elif isinstance(node, Leaf) and not isinstance(event, yaml.SequenceStartEvent):
            parent.value.append(node.value)
        else:
            raise self.fail(event, "a list in a list; lists hold plain values")

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
    """Whole numbers among others with a point count as floats, as a list has one type."""
    if any(isinstance(value, float) for value in values):
        return [float(value) if type(value) is int else value for value in values]
    return values
