# SPDX-License-Identifier: Apache-2.0
"""The lines to copy are what cbctl, ros2 and Python take."""

from __future__ import annotations

import ast
import json
import shlex

import pytest
from standins import REQUESTS

from control_board_ros import interface
from control_board_ros.cli.line.arguments import Parser, arguments_of
from control_board_ros.cli.line.options import hoist, read_options
from control_board_ros.cli.verbs import load
from control_board_ros.client import ControlBoardClient
from control_board_ros.panel.command_lines import WRITERS, command_lines
from control_board_ros.panel.protocol import KINDS, Request

#: What cbctl alone has a word for.
CBCTL_ONLY = {"step", "chirp"}


def test_every_request_of_a_board_has_lines() -> None:
    without = {"release", "cancel", "record", "note"}
    assert {do for do, kind in KINDS.items() if kind.commands} - without == set(WRITERS)
    assert set(REQUESTS) == set(WRITERS)


@pytest.mark.parametrize("do", REQUESTS)
@pytest.mark.parametrize("board", ["/control_board", "/icub/left_arm", "/it's"])
def test_lines(do: str, board: str) -> None:
    lines = command_lines(Request(1, do, board, REQUESTS[do]))
    for line in lines.cbctl.split(" && "):
        program, *words = shlex.split(line)
        front, (verb, *rest) = hoist(words)
        options, _ = read_options(front, [])
        assert program == "cbctl"
        assert options.board == board.removeprefix("/" if board == "/control_board" else "")
        Parser(verb, arguments_of(load(verb))).read(rest)
    if do in CBCTL_ONLY:
        assert (lines.ros2, lines.python) == ("", "")
        return
    call = ast.parse(lines.python, mode="eval").body
    assert isinstance(call, ast.Call)
    assert isinstance(call.func, ast.Attribute)
    assert hasattr(ControlBoardClient, call.func.attr)
    if do != "gains":
        word, name, kind, fields = ros2_words(lines.ros2)
        endpoint = next(e for e in interface.ENDPOINTS if e.of(board) == name)
        assert (word, kind) == (WORDS[endpoint.kind], endpoint.type)
        assert set(json.loads(fields)) <= set(request_fields(endpoint))


WORDS = {"service": "service", "command": "topic", "action": "action"}


def ros2_words(line: str) -> tuple[str, str, str, str]:
    """What a line of ros2 speaks to, its name, its type, and the fields."""
    program, word, _, *rest = shlex.split(line)
    assert program == "ros2"
    name, kind, fields = rest[-3:]
    return word, name, kind, fields


def request_fields(endpoint: interface.Endpoint) -> list[str]:
    """The fields that one sends to an endpoint."""
    kind = endpoint.load()
    asked = getattr(kind, "Request", getattr(kind, "Goal", kind))
    return list(asked.get_fields_and_field_types())
