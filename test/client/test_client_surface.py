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

from control_board_ros.client import ControlBoardClient
from control_board_ros.client.board import Aio
from control_board_ros.core.board import Board

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


#: Methods that the board in process has, too; ``set_motors`` of the client names its terms.
SHARED = [
    name
    for name in sorted(METHODS.keys() - {"set_motors"})
    if inspect.isfunction(getattr(Board, name, None))
]
assert len(SHARED) >= 68


@pytest.mark.parametrize("name", SHARED)
def test_parameters_are_those_of_the_board(name: str) -> None:
    """A, D1: names, order, defaults of parameters, so that one script serves board and client."""
    board, client = (positional(method) for method in (getattr(Board, name), METHODS[name]))
    for promised, offered in zip(board, client, strict=False):
        assert (promised.name, promised.kind) == (offered.name, offered.kind)
        assert promised.default in (offered.default, inspect.Parameter.empty)
    for extra in client[len(board) :]:
        assert extra.default is not inspect.Parameter.empty


def positional(method: Any) -> list[inspect.Parameter]:
    """The parameters of a method that need no name."""
    parameters = inspect.signature(method).parameters.values()
    return [p for p in parameters if p.kind is not inspect.Parameter.KEYWORD_ONLY]
