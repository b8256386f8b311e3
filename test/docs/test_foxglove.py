# SPDX-License-Identifier: Apache-2.0
"""config/foxglove/ and the how-tos of plotting tools name topics and fields that there are."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from control_board_ros.interface import ENDPOINTS

ROOT = Path(__file__).resolve().parents[2]
LAYOUT = json.loads((ROOT / "config/foxglove/control_board.json").read_text(encoding="utf-8"))
PAGE = (ROOT / "docs/howto/view_and_plot.md").read_text(encoding="utf-8")
#: Message paths of Foxglove, with dots, and curves of PlotJuggler.
PATHS = re.findall(r"\| `(/[^`]+)` (?=\|)", PAGE)
TOPICS = {endpoint.of("/control_board"): endpoint for endpoint in ENDPOINTS}
#: What a message path may hold of a field.
PART = re.compile(r"(\w+)(?:\[(?:\d+|:)\])?")
#: A field of a list is followed into its messages.
NESTED = re.compile(r"^(?:sequence<)?(\w+/\w+)>?$")


def fields_of(kind: Any) -> dict[str, str]:
    return dict(kind.get_fields_and_field_types())


def check(path: str) -> None:
    """Follow a message path ``/topic.field[3].field`` through the definitions."""
    topic, _, rest = path.partition(".")
    assert topic in TOPICS, path
    kind: Any = TOPICS[topic].load()
    for part in rest.split("."):
        match = PART.fullmatch(part)
        assert match, path
        fields = fields_of(kind)
        assert match[1] in fields, path
        indexed, many = part != match[1], fields[match[1]].startswith("sequence<")
        assert not indexed or many, path
        kind = None
        if nested := NESTED.match(fields[match[1]]):
            package, _, name = nested[1].partition("/")
            kind = getattr(__import__(f"{package}.msg", fromlist=[name]), name)


def strings(value: Any) -> Iterator[str]:
    """Every text in the layout."""
    if isinstance(value, dict):
        for item in value.values():
            yield from strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from strings(item)
    elif isinstance(value, str):
        yield value


def test_the_layout_plots_what_there_is() -> None:
    paths = [text for text in strings(LAYOUT) if text.startswith("/")]
    assert len([path for path in paths if "." in path]) > 25
    for path in paths:
        if "." in path:
            check(path)
        else:
            assert path in TOPICS


def test_the_layout_shows_every_panel_that_it_has() -> None:
    """And no other."""

    def panels(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    assert sorted(panels(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


@pytest.mark.parametrize("path", [path for path in PATHS if "." in path])
def test_the_page_tells_paths_that_there_are(path: str) -> None:
    check(path)


def test_a_path_that_is_not_there_fails() -> None:
    for wrong in (
        "/control_board/state.pos[3]",
        "/control_board/stat.position[3]",
        "/control_board/controller_state.joint_names[3].x",
    ):
        with pytest.raises((AssertionError, AttributeError)):
            check(wrong)


CURVES = [path for path in PATHS if "." not in path]
assert len(CURVES) >= 5


@pytest.mark.parametrize("curve", CURVES)
def test_plotjuggler_s_curves_are_fields(curve: str) -> None:
    """``/topic/field[3]``; what stands between an ellipsis is not looked at."""
    (topic,) = [name for name in TOPICS if curve.startswith(name + "/")]
    field = curve.removeprefix(topic).split("/")[-1]
    known = str(fields_of(TOPICS[topic].load()))
    if "…" not in curve:
        assert f"'{field.partition('[')[0]}'" in known
