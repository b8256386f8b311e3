# SPDX-License-Identifier: Apache-2.0
"""The conformance suite on boards that are right, its reports and its command line."""

from __future__ import annotations

import io
import json
import re
from collections import deque
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import board_in_process
import numpy as np
import pytest
from conformance_sessions import ARM, RATE, session_on

from control_board_ros.conformance import Outcome, Result, Rule, app, as_json, as_junit, as_text
from control_board_ros.conformance.bench import Bench, Permissions
from control_board_ros.conformance.rules import RULES, NotTestable, in_order
from control_board_ros.conformance.runner import lightest, run
from control_board_ros.testing import board_process

SOAK = pytest.mark.soak
#: The physics of all day.
QUICK = "mujoco"

# -- boards ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.parametrize(
    "physics", [QUICK, *(pytest.param(name, marks=SOAK) for name in ("pybullet", "ideal"))]
)
def test_our_board_keeps_all_and_is_left_as_found(physics: str, tmp_path: Path) -> None:
    """B1: whatever moves the joints; all day every fifth rule, the others below without ROS."""
    report = tmp_path / "report.xml"
    with (
        board_process(RATE | {"physics": physics, "control_rate": 250.0}, config=ARM) as board,
        session_on(board) as session,
    ):
        client = session.bench.client
        assert client.set_control_mode(["left", "right"], ["vel", "pos"])
        assert client.set_interaction_mode("right", "comp")
        assert client.set_impedance("right", 77.0, 7.0)
        assert client.set_reference_speed("right", 0.3, 0.4)

        def shown() -> list[Any]:
            stiffness, damping = client.get_impedance()
            return [
                client.get_control_mode(),
                client.get_interaction_mode(),
                client.get_ref_speed().tolist(),
                client.get_ref_acceleration().tolist(),
                stiffness.tolist(),
                damping.tolist(),
            ]

        before, position = shown(), client.get_encoder()
        line = ["--yes", "--domain", str(board.domain), "--junit", str(report), "--timeout", "30"]
        names = [rule.name for rule in in_order()][:: 5 if physics == QUICK else 1]
        assert app.main([*line, "--json", "--rules", ",".join(names)]) == app.HELD
        assert shown() == before
        assert client.get_encoder() == pytest.approx(position, abs=0.01)
    cases = ElementTree.parse(report).getroot().findall("testcase")
    assert len(cases) == len(names)


@pytest.mark.slow
@pytest.mark.parametrize(("joint", "count"), [("left", 48), ("bare", 38)])
def test_our_board_keeps_all_in_process(joint: str, count: int) -> None:
    """B1: the same rules without ROS and without a clock, with all permissions."""
    results = board_in_process.tried(joint=joint, allowed=Permissions(True, True))
    outcomes = [outcome for outcome, _ in results.values()]
    assert set(outcomes) == {Outcome.HELD, Outcome.NOT_TESTABLE}, results
    assert outcomes.count(Outcome.HELD) == count, results


@pytest.mark.parametrize(
    ("robot", "joint", "names"),
    [
        ("icub_hand", "l_index_distal", ("Y1", "Y2", "Y3")),
        ("panda", "panda_joint4", ("Y4",)),
    ],
)
def test_our_robots_keep_what_yarp_4_added_in_process(
    robot: str, joint: str, names: tuple[str, ...]
) -> None:
    """Direct velocities, currents, couplings and brakes, which the arm above has not."""
    results = board_in_process.tried(names, robot, joint)
    assert {outcome for outcome, _ in results.values()} == {Outcome.HELD}, results


def test_a_sliding_joint_is_reported_in_metres() -> None:
    names = ("P1", "P2", "P5", "P6")
    results = board_in_process.tried(names, "panda", "panda_finger_joint1")
    assert {outcome for outcome, _ in results.values()} == {Outcome.HELD}, results
    for _, evidence in results.values():
        assert re.search(r"[0-9] m(/s|\b)", evidence)
        assert "rad" not in evidence


def test_answers_that_are_late_let_no_velocity_expire_unseen(monkeypatch: Any) -> None:
    """P6: an answer after a move was accepted takes longer than velocities last (P12)."""
    session, last = board_in_process.session_of(joint="bare"), Bench.last
    values: list[float] = []

    def answered(bench: Bench, *arguments: Any) -> float:
        if values[-2:-1] != values[-1:]:
            bench.channel.sleep(0.3)
        values.append(last(bench, *arguments))
        return values[-1]

    monkeypatch.setattr(Bench, "last", answered)
    result = session.try_one(RULES["P6"])
    assert result.outcome is not Outcome.NOT_HELD, result.evidence


def test_a_recovery_that_is_late_ends_no_stream_unseen() -> None:
    """F8: after a pause of 0.5 s it is another stream, which acts."""
    session = board_in_process.session_of(joint="left")
    client: Any = session.bench.client

    def recover(joint: str) -> Any:
        session.channel.sleep(0.6)
        return client.__getattr__("recover")(joint)

    client.recover = recover
    result = session.try_one(RULES["F8"])
    assert (result.outcome, "paused" in result.evidence) == (Outcome.NOT_TESTED, True), result


def test_the_interval_of_states_is_that_of_their_parameter() -> None:
    """100 Hz of 250 are 8 and 12 ms in turns, and 8 may be the median."""
    session = board_in_process.session_of()
    stamps = [0.0, 0.008, 0.02, 0.028]
    session.channel.states = deque(SimpleNamespace(stamp=stamp) for stamp in stamps)
    session.bench._interval = 0.01
    assert session.bench.state_interval == 0.01


def test_only_a_joint_that_can_be_tried_is() -> None:
    with pytest.raises(NotTestable, match="nose cannot be tried; these can: left, right, bare"):
        board_in_process.session_of(joint="nose")
    session = board_in_process.session_of(joint="bare", fraction=0.05)
    assert session.bench.joint == "bare"
    assert session.bench.range.high - session.bench.range.low == pytest.approx(0.2)
    results, problems = run(session, [r for r in in_order() if r.name in ("I7", "I1")])
    assert [result.outcome for result in results] == [Outcome.NOT_TESTABLE, Outcome.HELD]
    assert not problems


# -- without a board ---------------------------------------------------------------------------


def result(name: str, outcome: Outcome, evidence: str) -> Result:
    return Result(Rule(name, "about it", lambda _: ""), outcome, evidence, 0.25)


RESULTS = [
    result("M4", Outcome.HELD, "seen"),
    result("P1", Outcome.NOT_HELD, "3 % of the way & more"),
    result("P10", Outcome.NOT_TESTABLE, "not shown"),
]


def test_text_names_the_failed_rules() -> None:
    assert as_text(RESULTS) == "1 held, 1 not held, 1 not testable: P1"
    assert as_text(RESULTS[:1]) == "1 held, 0 not held, 0 not testable"


def test_json_holds_every_result() -> None:
    value = json.loads(as_json("/board", "elbow", RESULTS))
    assert value["success"] is False
    assert (value["board"], value["joint"]) == ("/board", "elbow")
    assert [row["result"] for row in value["results"]] == ["held", "not held", "not testable"]
    assert json.loads(as_json("/board", "elbow", RESULTS[:1]))["success"] is True


def test_junit_has_a_case_for_every_rule() -> None:
    suite = ElementTree.fromstring(as_junit("/board", RESULTS))
    assert suite.attrib["tests"] == "3"
    assert suite.attrib["failures"] == suite.attrib["skipped"] == "1"
    failed = suite.findall("testcase/failure")
    assert [failure.attrib["message"] for failure in failed] == ["3 % of the way & more"]
    names = [case.attrib["name"] for case in suite.findall("testcase")]
    assert names == ["M4 about it", "P1 about it", "P10 about it"]


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (["--range", "2"], "above 0, up to 1"),
        (["--range", "x"], "invalid"),
        (["--rules", "M4,M99", "--yes"], "rule M99 unknown"),
        (["--what"], "unrecognized"),
        (["--domain", "999", "--yes"], "ROS domains are 0 to 232"),
        (["--timeout", "0", "--yes"], "seconds above 0"),
        (["--junit", "/no/such/folder/x.xml", "--yes"], "there is no folder"),
        ([], "give --yes"),
    ],
    ids=str,
)
def test_wrong_usage(
    line: list[str], text: str, capsys: pytest.CaptureFixture[str], monkeypatch: Any
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())
    with pytest.raises(SystemExit) as end:
        app.main(line)
    assert end.value.code == app.USAGE
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ("loads", "chosen"),
    [([0.0, 0.0, 0.0], 2), ([0.0, 30.0, 0.1], 2), ([0.0, 30.0, 5.0], 0), ([9.0, 8.0, 10.0], 1)],
    ids=str,
)
def test_the_joint_that_falls_least_is_chosen(loads: list[float], chosen: int) -> None:
    assert lightest(np.array(loads)) == chosen


@pytest.mark.parametrize(
    ("answer", "goes"),
    [("y\n", True), ("YES\n", True), ("n\n", False), ("\n", False), ("", False)],
)
def test_only_a_yes_continues(answer: str, goes: bool, monkeypatch: Any) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    assert app.goes_on() is goes


def test_list_needs_no_board(capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["--list"]) == app.HELD
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("V1 ")
    assert len(lines) == len(in_order())
