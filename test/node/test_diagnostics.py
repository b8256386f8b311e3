# SPDX-License-Identifier: Apache-2.0
"""config/diagnostics.yaml: what diagnostic_aggregator of Jazzy makes of the node's statuses."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Time
from rig import Rig, board_config, joint

from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.wiring.diagnostics import Diagnostics
from control_board_ros.settings.layers import SettingsError, find_config

FILE = Path(__file__).resolve().parents[2] / "config" / "diagnostics.yaml"
#: What GenericAnalyzer reads, and as which type: another one ends the aggregator.
TYPES = {
    "type": str,
    "path": str,
    "regex": list,
    "remove_prefix": list,
    "timeout": float,
}


@pytest.fixture(scope="module")
def analyzers() -> dict[str, dict[str, Any]]:
    """The analyzers of the file, by name; the aggregator's node is called `analyzers`."""
    parameters = yaml.safe_load(FILE.read_text("utf-8"))["analyzers"]["ros__parameters"]
    assert isinstance(parameters.pop("path"), str)
    assert isinstance(parameters.pop("pub_rate"), float)
    return dict(parameters)


@pytest.fixture(scope="module")
def statuses() -> list[Any]:
    """What the node publishes of a board; one joint has a name like that of the loop."""
    rig = Rig(board_config(joint("elbow"), joint("loop_joint"), joint("a: b")))
    told = Diagnostics(ControlLoop(rig.board, rig.plant), rig.board.names, "rig", 500.0)
    return list(told.message(Time()).status)


def holders(analyzers: dict[str, dict[str, Any]], name: str) -> list[str]:
    """The analyzers that take a status: the whole name matches one of their expressions."""
    return [
        one["path"]
        for one in analyzers.values()
        if any(re.fullmatch(expression, name) for expression in one["regex"])
    ]


def test_the_file_is_what_the_aggregator_reads(analyzers: dict[str, dict[str, Any]]) -> None:
    assert analyzers
    for one in analyzers.values():
        assert {key: type(value) for key, value in one.items()} == TYPES
        assert one["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert all(isinstance(text, str) for text in one["regex"] + one["remove_prefix"])
        assert one["timeout"] > 2.0  # two messages, one each second


def test_every_status_has_one_place_and_a_short_name(
    analyzers: dict[str, dict[str, Any]], statuses: list[Any]
) -> None:
    """The loop in one, the joints in the other; shown without the node's name."""
    names = [status.name for status in statuses]
    assert len(names) == 4
    places = [holders(analyzers, name) for name in names]
    assert places == [["Control loop"], ["Joints"], ["Joints"], ["Joints"]]
    for name in names:
        for one in analyzers.values():
            (prefix,) = one["remove_prefix"]
            assert name.startswith(prefix)
            assert len(name) > len(prefix)


def test_statuses_of_others_are_left_to_them(analyzers: dict[str, dict[str, Any]]) -> None:
    for name in ("camera: loop", "my control_board: loop", "control_board"):
        assert holders(analyzers, name) == []


def test_it_is_no_configuration_of_a_board() -> None:
    with pytest.raises(SettingsError, match=r"'diagnostics' unknown; .*known: icub, icub_hand, "):
        find_config("diagnostics")
