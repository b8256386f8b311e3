# SPDX-License-Identifier: Apache-2.0
"""The conformance suite finds each rule that is broken, and that one only.

In process, each in a fork of one; over ROS where the network is what is broken, or a table that
the rules read, too.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from conformance_sessions import LAUNCHER, not_held, tried, wrong_board
from wrong_boards import WRONG

from control_board_ros.conformance import Outcome
from control_board_ros.conformance.rules import in_order

#: The wrong boards that break a rule.
BROKEN = [name for name, wrong in WRONG.items() if wrong.rule]
OVER_ROS = (
    "diagnostics_elsewhere",
    "a_state_with_fields_of_length_one",
    "no_torque_in_torque",
    "velocity_in_position",
    "a_mode_of_its_own",
    "a_mode_ends_a_calibration",
)
#: Faults of which a whole session, with the leave that the last one needs, reports all.
THREE = ["diagnostics_elsewhere", "any_cause_is_cleared", "it_starts_in_velocity"]


@pytest.fixture(scope="module")
def trying() -> Iterator[subprocess.Popen[str]]:
    """The process that tries boards in process."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, str(LAUNCHER), "--try"], stdin=pipe, stdout=pipe, text=True
    ) as process:
        yield process


def found(trying: subprocess.Popen[str], name: str, *rules: str) -> dict[str, str]:
    """What is not held of some rules, or of all, by a wrong board: evidence by rule."""
    if name in OVER_ROS:
        with wrong_board(name) as board:
            return not_held(tried(board, rules or None, **WRONG[name].options))
    assert trying.stdin is not None
    assert trying.stdout is not None
    print(name, *rules, file=trying.stdin, flush=True)
    results: dict[str, Any] = json.loads(trying.stdout.readline())
    return {rule: why for rule, (outcome, why) in results.items() if outcome == Outcome.NOT_HELD}


@pytest.mark.ros
@pytest.mark.slow
def test_a_rule_that_is_broken_is_reported() -> None:
    with wrong_board("idle_leaves_a_fault") as board:
        results = tried(board, ["M5", "F1", "F2", "F5"])
    assert set(not_held(results)) == {"F2"}
    assert results["F2"].evidence == "IDLE was accepted in HW_FAULT"
    assert results["M5"].outcome is Outcome.HELD


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.parametrize("name", BROKEN)
def test_the_broken_rule_is_found(trying: subprocess.Popen[str], name: str) -> None:
    assert set(found(trying, name, WRONG[name].rule)) == {WRONG[name].rule}


@pytest.mark.soak
@pytest.mark.ros
@pytest.mark.parametrize("name", BROKEN)
def test_exactly_the_broken_rule_is_reported(trying: subprocess.Popen[str], name: str) -> None:
    """Of all rules that a session without leave to calibrate tries, or with it."""
    reported = found(trying, name)
    assert set(reported) == {WRONG[name].rule}, reported


@pytest.mark.soak
@pytest.mark.ros
def test_exactly_the_broken_rules_are_reported() -> None:
    with wrong_board(*THREE) as board:
        results = tried(board, **WRONG[THREE[-1]].options)
    assert set(not_held(results)) == {WRONG[name].rule for name in THREE}, not_held(results)


def test_the_rules_seen_from_outside_have_a_board_that_breaks_them() -> None:
    """Whatever is not an `inside` rule."""
    seen = {rule.name for rule in in_order() if rule.check.__name__ != "check"}
    assert {WRONG[name].rule for name in BROKEN} == seen
