# SPDX-License-Identifier: Apache-2.0
"""The public surface of the client: names, signatures, awaitable forms, docstrings.

``client_surface.txt`` is a golden copy: what it lists is promised to users. A line that changes
here changes for them.
"""

from __future__ import annotations

import inspect
import pydoc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from control_board_ros import protocols
from control_board_ros.client import ControlBoardClient
from control_board_ros.client.board import Aio

GOLDEN = Path(__file__).with_name("client_surface.txt")

METHODS = {
    name: getattr(ControlBoardClient, name)
    for name in dir(ControlBoardClient)
    if not name.startswith("_") and inspect.isfunction(getattr(ControlBoardClient, name))
}
AWAITABLE = {name for name in dir(Aio) if inspect.iscoroutinefunction(getattr(Aio, name))}


def surface() -> Iterator[str]:
    """A line per public name; those with an awaitable form are marked."""
    yield f"ControlBoardClient{inspect.signature(ControlBoardClient)}"
    for name in dir(ControlBoardClient):
        if name.startswith("_"):
            continue
        method = METHODS.get(name)
        signature = f"{inspect.signature(method)}" if method else ": a property"
        yield f"{name}{signature}{' (awaitable)' if name in AWAITABLE else ''}"


def test_the_surface_is_as_promised() -> None:
    """A, D: nothing is lost, nothing comes by chance."""
    assert list(surface()) == GOLDEN.read_text().splitlines()


@pytest.mark.parametrize("name", sorted(METHODS))
def test_each_method_has_a_docstring_and_shows_in_help(name: str) -> None:
    """help(ControlBoardClient) is the manual."""
    assert (METHODS[name].__doc__ or "").strip()
    assert METHODS[name].__name__ == name
    lines = pydoc.render_doc(METHODS[name], renderer=pydoc.plaintext).splitlines()
    assert any(line.startswith(f"{name}(self") for line in lines)


INTERFACES = [
    kind
    for kind in vars(protocols).values()
    if getattr(kind, "_is_protocol", False) and kind.__module__ == protocols.__name__
]
assert len(INTERFACES) == 13
PROMISED = [
    pytest.param(name, method, id=f"{kind.__name__}.{name}")
    for kind in INTERFACES
    for name, method in vars(kind).items()
    if not name.startswith("_")
]
assert len(PROMISED) > 30


@pytest.mark.parametrize(("name", "method"), PROMISED)
def test_parameters_are_those_of_the_interfaces(name: str, method: Any) -> None:
    """A, D1: names, order, defaults of parameters, so that one script serves board and client."""
    promised = inspect.signature(method).parameters
    offered = inspect.signature(METHODS[name]).parameters
    assert list(offered)[: len(promised)] == list(promised)
    for parameter, mine in zip(promised.values(), offered.values(), strict=False):
        assert mine.kind == parameter.kind
        assert parameter.default in (mine.default, inspect.Parameter.empty)
    for extra in list(offered.values())[len(promised) :]:
        assert extra.default is not inspect.Parameter.empty
