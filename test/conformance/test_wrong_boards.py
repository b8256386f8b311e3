# SPDX-License-Identifier: Apache-2.0
"""The conformance suite finds each rule that is broken, and that one only.

``soak`` tries every wrong board alone. ``slow`` tries one of each rule, several faults in one
board where none hides behind another: ``soak`` sees that each of these rules holds on a board
that has the others' faults only.
"""

from __future__ import annotations

import pytest
from conformance_sessions import not_held, tried, wrong_board
from wrong_boards import WRONG

from control_board_ros.conformance import Outcome
from control_board_ros.conformance.rules import in_order

#: The wrong boards that break a rule.
BROKEN = [name for name, wrong in WRONG.items() if wrong.rule]
#: Faults that one board has together.
TOGETHER = [
    ["the_first_of_too_many", "no_limits_for_moves", "slower_velocities", "stop_does_nothing"],
    [
        "a_speed_of_zero",
        "moves_of_twice_the_time",
        "velocities_last",
        "no_feed_forward",
        "half_the_output",
    ],
    [
        "half_the_torque",
        "direct_positions_are_moves",
        "a_fault_is_forgotten",
        "idle_leaves_a_fault",
        "any_stiffness",
    ],
    [
        "half_the_spring",
        "a_move_survives_the_interaction_mode",
        "nothing_is_stored_in_a_fault",
        "compliant_for_all",
    ],
    [
        "refuses_what_it_does_not_implement",
        "velocity_in_position",
        "force_idle_only_in_a_fault",
    ],
    [
        "any_cause_is_cleared",
        "power_in_a_fault",
        "a_compliant_stop_pushes",
        "compliant_takes_direct_positions",
        "references_are_forgotten",
    ],
    ["power_in_idle", "the_present_mode_resets", "a_joint_may_be_named_twice"],
]
TOGETHER_RULES = {WRONG[name].rule for names in TOGETHER for name in names}
#: One of each rule that none of these breaks.
ALONE = list(
    {
        WRONG[name].rule: name
        for name in reversed(BROKEN)
        if WRONG[name].rule not in TOGETHER_RULES
    }.values()
)
#: Faults of which a whole session, with the leave that the last one needs, reports all.
THREE = ["diagnostics_elsewhere", "any_cause_is_cleared", "it_starts_in_velocity"]


def rules_of(names: list[str]) -> set[str]:
    return {WRONG[name].rule for name in names}


@pytest.mark.ros
def test_a_rule_that_is_broken_is_reported() -> None:
    with wrong_board("idle_leaves_a_fault") as board:
        results = tried(board, ["M5", "F1", "F2", "F5"])
    assert set(not_held(results)) == {"F2"}
    assert results["F2"].evidence == "IDLE was accepted in HW_FAULT"
    assert results["M5"].outcome is Outcome.HELD


@pytest.mark.ros
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in ALONE else pytest.mark.soak)
        for name in BROKEN
    ],
)
def test_the_broken_rule_is_found(name: str) -> None:
    wrong = WRONG[name]
    with wrong_board(name) as board:
        results = tried(board, [wrong.rule], **wrong.options)
    assert set(not_held(results)) == {wrong.rule}, results[wrong.rule].evidence


@pytest.mark.slow
@pytest.mark.ros
@pytest.mark.parametrize("names", TOGETHER, ids=lambda names: " ".join(sorted(rules_of(names))))
def test_the_broken_rules_are_found(names: list[str]) -> None:
    rules = rules_of(names)
    with wrong_board(*names) as board:
        results = tried(board, sorted(rules))
    assert set(not_held(results)) == rules, results


@pytest.mark.soak
@pytest.mark.ros
@pytest.mark.parametrize("names", TOGETHER, ids=lambda names: " ".join(sorted(rules_of(names))))
def test_no_rule_is_found_by_the_fault_of_another(names: list[str]) -> None:
    for name in names:
        with wrong_board(*(other for other in names if other != name)) as board:
            results = tried(board, [WRONG[name].rule])
        assert not_held(results) == {}


@pytest.mark.soak
@pytest.mark.ros
@pytest.mark.parametrize("name", BROKEN)
def test_exactly_the_broken_rule_is_reported(name: str) -> None:
    """Of all rules that a session without leave to calibrate tries, or with it."""
    wrong = WRONG[name]
    with wrong_board(name) as board:
        results = tried(board, **wrong.options)
    assert set(not_held(results)) == {wrong.rule}, not_held(results)


@pytest.mark.soak
@pytest.mark.ros
def test_exactly_the_broken_rules_are_reported() -> None:
    with wrong_board(*THREE) as board:
        results = tried(board, **WRONG[THREE[-1]].options)
    assert set(not_held(results)) == rules_of(THREE), not_held(results)


def test_the_rules_seen_from_outside_have_a_board_that_breaks_them() -> None:
    """Whatever is not an `inside` rule."""
    seen = {rule.name for rule in in_order() if rule.check.__name__ != "check"}
    assert {WRONG[name].rule for name in BROKEN} == seen
    assert TOGETHER_RULES | rules_of(ALONE) == seen
