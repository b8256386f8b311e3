# SPDX-License-Identifier: Apache-2.0
"""/diagnostics, and what diagnostic_aggregator of Jazzy makes of it by config/diagnostics.yaml."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rig import Rig, board_config, joint
from waiting import until

from control_board_ros.cli.board.timing import phases_of
from control_board_ros.compiled import describe
from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.node.loop.loop import ControlLoop
from control_board_ros.node.loop.timing import PHASES
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


class Watched:
    """A board, whose cycles a test runs, and its diagnostics."""

    def __init__(self, *names: str, **limits: float) -> None:
        joints = (joint(name, limits=limits, startup_mode=ControlMode.POSITION) for name in names)
        self.rig = Rig(board_config(*joints))
        self.rig.tick(2)
        self.loop = ControlLoop(self.rig.board, self.rig.plant)
        self._told = Diagnostics(self.loop, "rig")

    def statuses(self) -> list[DiagnosticStatus]:
        self.loop.note_changes()
        self.loop.main.snapshots.note_state()
        return list(self._told.message(Time()).status)


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def test_a_status_of_the_loop_and_one_per_joint() -> None:
    """REP 107: a fault is an ERROR, and OK again later."""
    watched = Watched("a", "b")
    board, plant = watched.rig.board, watched.rig.plant
    loop, *joints = watched.statuses()
    assert [one.name for one in joints] == ["control_board: a", "control_board: b"]
    assert values_of(loop)["nominal rate (Hz)"] == "500.0"
    assert values_of(loop)["laws"] == describe()
    plant.inject("b", "overheating", persistent=True)
    watched.rig.run(0.1)
    _, good, bad = watched.statuses()
    assert (good.level, bad.level) == (DiagnosticStatus.OK, DiagnosticStatus.ERROR)
    assert "overheating" in bad.message
    plant.clear_injected("b")
    watched.rig.run(0.1)
    assert board.set_control_mode("b", "fidl")
    assert watched.statuses()[2].level == DiagnosticStatus.OK


def test_rejected_commands_are_reported_once() -> None:
    """M4, P13: by their joint; by the loop where they name no joint of the board."""
    watched = Watched("a", "b")
    board = watched.rig.board
    assert "joint 'nose' unknown" in board.velocity_move(["nose", "toe"], 1.0).message
    board.velocity_move(["nose", "a"], 1.0)  # counted by the joint that it names
    board.set_feedforward("nose", 1.0)
    loop, joint_a, joint_b = watched.statuses()
    assert values_of(loop)["rejected commands"] == "3"
    assert values_of(loop)["commands for unknown joints"] == "2"
    assert "2 commands for unknown joints rejected in the last second" in loop.message
    assert "1 commands rejected in the last second" in joint_a.message
    ok, warning = DiagnosticStatus.OK, DiagnosticStatus.WARN
    assert [loop.level, joint_a.level, joint_b.level] == [warning, warning, ok]
    assert {status.level for status in watched.statuses()} == {ok}


def test_where_the_time_of_cycles_goes_is_shown_on_request() -> None:
    """As ``cbctl watch --timing`` reads it; a part of a robot has that of the robot."""
    watched = Watched("a")
    assert not phases_of(iter(watched.statuses()), "/control_board")
    watched.loop.set_timing(True)
    watched.loop.start()
    until(lambda: watched.rig.board.cycle > 20)
    watched.loop.stop()
    statuses = watched.statuses()
    found = phases_of(iter(statuses), "/control_board/left_arm")
    assert found == phases_of(iter(statuses), "/control_board")
    assert list(found) == ["cycle", *PHASES]
    assert list(found["read"]) == ["mean", "worst", "longest cycle"]
    assert found["cycle"]["worst"] == found["cycle"]["longest cycle"] > 0.0
    assert not phases_of(iter(statuses), "/other")


@pytest.mark.parametrize(("left", "level"), [(11.0, b"\0"), (9.0, b"\1")])
def test_heat_is_reported_before_it_is_a_fault(left: float, level: bytes) -> None:
    """F6: within 10 K of the limit, in the joint's status; its key has the limit."""
    limit = 25.0 + left
    status = Watched("a", temperature=limit).statuses()[1]
    assert status.level == level
    assert ("near a fault by heat: reduce its load" in status.message) == (level > b"\0")
    assert values_of(status)["temperature limit (°C)"] == f"{limit:.1f}"
    assert values_of(status)["I2t (%)"] == "0"


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
    return Watched("elbow", "loop_joint", "a: b").statuses()


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


def test_statuses_of_other_nodes_are_ignored(analyzers: dict[str, dict[str, Any]]) -> None:
    for name in ("camera: loop", "my control_board: loop", "control_board"):
        assert holders(analyzers, name) == []


def test_it_is_no_configuration_of_a_board() -> None:
    with pytest.raises(SettingsError, match=r"'diagnostics' unknown; .*known: icub, icub_hand, "):
        find_config("diagnostics")
