# SPDX-License-Identifier: Apache-2.0
"""How the conformance suite ends: in time, with a result for each rule, and with its exit code."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from control_board_msgs.msg import BoardState, JointModes
from rules import proofs
from std_msgs.msg import Header

from control_board_ros.conformance import Outcome, Result, Rule, app, as_junit, as_text
from control_board_ros.conformance.limits import Range
from control_board_ros.conformance.motion import fitted
from control_board_ros.conformance.report import too_few
from control_board_ros.conformance.rules import NotHeld, NotTestable, NotTested, OutOfTime
from control_board_ros.conformance.runner import (
    MAX_LATE_RULES,
    MAX_UNTESTED,
    Session,
    passed,
    reading,
    run,
    unread,
)
from control_board_ros.conformance.shapes import (
    PER_JOINT,
    Malformed,
    check_modes,
    check_state,
    reply_of,
)
from control_board_ros.core.goals.path import minimum_jerk
from control_board_ros.core.terms.reply import Answer
from control_board_ros.interface import SET_CONTROL_MODE
from control_board_ros.joint_limits import JointLimits
from control_board_ros.testing import board_process

HELD, NOT_HELD, NOT_TESTED = Outcome.HELD, Outcome.NOT_HELD, Outcome.NOT_TESTED
SUPPORT = Path(__file__).parents[1] / "support"
LAUNCHER = SUPPORT / "wrong_boards.py"
ARM = SUPPORT / "arm.yaml"


def rule(name: str, check: Callable[[Any], str] = lambda _: "seen") -> Rule:
    return Rule(name, "about it", check)


def results(*outcomes: Outcome) -> list[Result]:
    return [Result(rule(f"M{k}"), outcome, "why", 0.1) for k, outcome in enumerate(outcomes)]


# -- exit codes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outcomes", "passes"),
    [
        ([HELD, Outcome.NOT_TESTABLE] * 20, True),
        ([HELD] + [NOT_TESTED] * MAX_UNTESTED, True),
        ([HELD] * 50 + [NOT_TESTED] * (MAX_UNTESTED + 1), False),
        ([HELD, NOT_HELD], False),
    ],
)
def test_outcomes_that_pass(outcomes: list[Outcome], passes: bool, capsys: Any) -> None:
    found, complaints = results(*outcomes), []
    asked = argparse.Namespace(json=True, junit=None)
    code = app.summed_up("/board", "elbow", asked, found, [], complaints.append)
    assert code == (app.HELD if passes else app.NOT_HELD)
    assert json.loads(capsys.readouterr().out)["success"] is passes
    assert passed(found) is passes
    assert bool(complaints) == (outcomes.count(NOT_TESTED) > MAX_UNTESTED)


def test_too_few_are_named() -> None:
    found = results(HELD, *[NOT_TESTED] * (MAX_UNTESTED + 1))
    assert too_few(found) == (
        "4 rules were not tested though the board offers their features (up to 3 may be): "
        "M1, M2, M3, M4"
    )
    assert as_text(found) == "1 held, 0 not held, 4 not tested, 0 not testable"
    suite = ElementTree.fromstring(as_junit("/board", found))
    assert (suite.attrib["failures"], suite.attrib["skipped"]) == ("4", "0")
    few = ElementTree.fromstring(as_junit("/board", found[:-1]))
    assert (few.attrib["failures"], few.attrib["skipped"]) == ("0", "3")


# -- a board that cannot be read ---------------------------------------------------------------


class Response:
    """Of a service that answers for each joint."""

    def __init__(
        self, success: bool, answers: list[str], reasons: list[str] | None = None
    ) -> None:
        self.success, self.message, self.answers = success, "why", answers
        self.reasons = [""] * len(answers) if reasons is None else reasons


@pytest.mark.parametrize(
    ("response", "text"),
    [
        (Response(True, ["refused"]), r"success=True with answers \['refused'\]"),
        (Response(False, ["accepted"]), r"success=False with answers \['accepted'\]"),
        (Response(True, []), r"success=True with answers \[\]"),
        (Response(True, ["accepted", "ignored"]), "success=True"),
        (Response(False, ["no"]), "answers 'no', not one of"),
        (Response(True, ["accepted"] * 3), "3 answers and 3 reasons for 2 joints"),
        (Response(False, ["refused"] * 2, [""]), "2 answers and 1 reasons for 2 joints"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_success_and_answers_agree(response: Response, text: str) -> None:
    with pytest.raises(Malformed, match=text):
        reply_of(SET_CONTROL_MODE, ["left", "right"], response)


def test_a_refusal_as_a_whole_may_have_no_answers() -> None:
    reply = reply_of(SET_CONTROL_MODE, ["left", "nose"], Response(False, []))
    assert not reply
    two = reply_of(SET_CONTROL_MODE, ["left", "right"], Response(False, ["accepted", "refused"]))
    assert two.answers == (Answer.ACCEPTED, Answer.REFUSED)


def state(count: int, **others: int) -> Any:
    message = BoardState(header=Header(stamp=Time(sec=1)), names=["left", "right"])
    for name in PER_JOINT:
        kind = bool if name in ("motion_done", "calibrated") else int
        kind = (
            kind
            if name in ("motion_done", "calibrated", "rejected_commands", "contacts")
            else float
        )
        setattr(message, name, [kind(0)] * others.get(name, count))
    return message


def test_a_state_has_an_entry_per_joint() -> None:
    check_state(state(2))
    for name in PER_JOINT:
        with pytest.raises(Malformed, match=f"has 1 in {name} for 2 joints"):
            check_state(state(2, **{name: 1}))
    with pytest.raises(Malformed, match="names the joints"):
        check_state(BoardState())


@pytest.mark.parametrize(
    ("codes", "vocabs", "rule", "text"),
    [
        (["pos"], [7565168], "", ""),
        (["POSITION"], [7565168], "V1", "not 'pos'"),
        (["pos"], [7103593], "V1", "not 7565168"),
        (["swim"], [1], "V1", "not one of pos"),
        (["pos", "pos"], [7565168], "A", "2 in control_modes for 1 joints"),
        (["pos"], [], "A", "0 in control_mode_vocabs for 1 joints"),
    ],
)
def test_modes_are_of_the_vocabs(codes: Any, vocabs: Any, rule: str, text: str) -> None:
    message = JointModes(
        names=["left"],
        control_modes=codes,
        control_mode_vocabs=vocabs,
        interaction_modes=["stif"],
        interaction_mode_vocabs=[1718187123],
    )
    if not rule:
        check_modes(message)
        return
    with pytest.raises(Malformed, match=text) as error:
        check_modes(message)
    assert error.value.rule == rule


@pytest.mark.parametrize(
    ("error", "rule"),
    [
        (IndexError("7"), "A"),
        (KeyError("x"), "A"),
        (TypeError("no"), "A"),
        (ValueError("5"), "V1"),
    ],
    ids=repr,
)
def test_no_answer_ends_it_with_a_traceback(error: Exception, rule: str) -> None:
    with pytest.raises(Malformed, match="an answer cannot be") as raised, reading():
        raise error
    assert raised.value.rule == rule


def test_an_unread_board_breaks_one_rule() -> None:
    found = unread([rule("V1"), rule("M1")], Malformed("V1", "it has 'swim'"))
    assert [result.outcome for result in found] == [NOT_HELD, NOT_TESTED]
    assert found[0].evidence == "it has 'swim'"
    assert found[1].evidence == "the board cannot be read, see V1"


# -- a rule that takes too long ----------------------------------------------------------------


class Channel:
    def __init__(self) -> None:
        self.patience = 1.0

    def allow(self, seconds: float) -> None:
        pass

    def call(self, *_: Any) -> None:
        pass


class Fake:
    """Of a session, what run and try_one use."""

    def __init__(self) -> None:
        self.channel, self.bench, self.initial, self.rule_time = Channel(), self, self, -1.0
        self.client = None
        self.there = True

    hold = give_back = lambda self, _: None
    answer_time, try_one = Session.answer_time, Session.try_one

    def home(self) -> None:
        pass

    def is_there(self) -> bool:
        return self.there

    def restore(self) -> list[str]:
        return []


def raises(error: Exception) -> Callable[[Any], str]:
    def check(_: Any) -> str:
        raise error

    return check


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (NotHeld("no"), NOT_HELD),
        (NotTestable("no"), Outcome.NOT_TESTABLE),
        (NotTested("no"), NOT_TESTED),
        (IndexError("no"), NOT_HELD),
        (OutOfTime("it took longer than 60 s"), NOT_TESTED),
    ],
    ids=repr,
)
def test_every_end_of_a_rule_is_a_result(error: Exception, outcome: Outcome) -> None:
    session: Any = Fake()
    result = session.try_one(rule("M1", raises(error)))
    assert result.outcome is outcome
    assert str(error) in result.evidence
    assert ("is answered after" in result.evidence) == isinstance(error, OutOfTime)


def test_rules_that_last_too_long_end_the_run() -> None:
    session: Any = Fake()
    late = [rule(f"M{k}", raises(OutOfTime("it took longer"))) for k in range(MAX_LATE_RULES)]
    found, _ = run(session, [*late, rule("P1")])
    assert [result.outcome for result in found] == [NOT_TESTED] * (MAX_LATE_RULES + 1)
    assert found[-1].evidence == f"{MAX_LATE_RULES} rules took longer than -1 s each"


def test_a_board_that_is_gone_ends_the_run() -> None:
    session: Any = Fake()
    session.there = False
    found, _ = run(session, [rule("M1", raises(NotHeld("no"))), rule("P1")])
    assert [result.evidence for result in found] == ["no", "the board is gone"]


@pytest.mark.slow
@pytest.mark.ros
def test_a_board_that_answers_late_ends(capsys: pytest.CaptureFixture[str]) -> None:
    """Each answer comes after 0.2 s, and a rule may take 1 s."""
    command = [sys.executable, str(LAUNCHER), "answers_late"]
    with board_process({"state_rate": 100.0}, config=ARM, command=command) as board:
        line = ["--yes", "--domain", str(board.domain), "--timeout", "10", "--json"]
        assert app.main([*line, "--rule-time", "1"]) == app.NOT_HELD
    out, err = capsys.readouterr()
    found = json.loads(out)["results"]
    late = [row["evidence"] for row in found if "longer than 1 s;" in row["evidence"]]
    assert len(late) == MAX_LATE_RULES
    assert "set_control_mode" not in late[0]
    assert re.search(r"get_control_mode is answered after 0\.[2-9]", late[0])
    assert "were not tested though the board offers" in err


# -- where and how long a joint is tried -------------------------------------------------------


def test_a_joint_at_its_limit_has_room_for_a_step() -> None:
    limits = JointLimits(-2.0, 2.0, velocity=3.0, acceleration=20.0, torque=60.0)
    for position in (-2.0, -1.9, 0.3, 2.0):
        tried = Range.of(limits, position, 0.1)
        assert tried.initial == position
        assert tried.low <= tried.start - tried.step < tried.start + tried.step <= tried.high
        assert limits.lower <= tried.low < tried.high <= limits.upper


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
@pytest.mark.parametrize("duration", [0.75, 0.825])
def test_a_duration_is_measured(rate: float, duration: float) -> None:
    """P1: within 1 %, from stamps that jitter by a millisecond."""
    times = np.arange(0.0, 1.5, 1.0 / rate)
    jitter = np.random.default_rng(1).uniform(-1e-3, 1e-3, times.size)
    begin, took = fitted(times + jitter, minimum_jerk((times - 0.2) / duration))
    assert took == pytest.approx(duration, rel=0.01)
    assert begin == pytest.approx(0.2, abs=0.01)


def test_the_page_of_conformance_is_made_of_its_record(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the last `make conformance`; the site's page has each test of a rule."""
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[1] / "spec")
    import conformance

    record = json.loads(conformance.RECORD.read_text("utf-8"))
    assert conformance.PAGE.read_text("utf-8") == conformance.page(record)
    tables = conformance.tables()
    assert all(f"`{test.removeprefix('test/spec/')}`" in tables for test in proofs())
