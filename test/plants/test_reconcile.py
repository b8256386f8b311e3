# SPDX-License-Identifier: Apache-2.0
"""Desired against reported (S8): the table of actions, whole."""

from __future__ import annotations

from itertools import product

import pytest

from control_board_ros.plants.drives.interview import ATTEMPTS, Interview, Question, ask
from control_board_ros.plants.drives.reconcile import (
    UNHEARD,
    Action,
    Desired,
    Reported,
    done,
    step,
    unconfirmed,
)
from control_board_ros.plants.interface import DriveFault

FAULT = DriveFault(1, "fault")
DESIRED = [Desired(law, live, reset) for law, live, reset in
           product((None, "a", "b"), (True, False), (True, False))]  # fmt: skip
REPORTED = [
    Reported(power, law, fault, lost, confirmed, unheard, stale)
    for power, law, fault, lost, confirmed, unheard, stale in product(
        (True, False), (None, "a", "b"), (None, FAULT), (True, False), (True, False),
        (0, 1, UNHEARD, 1000), (True, False),
    )
]  # fmt: skip
EVERY = list(product(DESIRED, REPORTED))
GIVING = (Action.POWER_ON, Action.GOAL)


def test_the_table_is_total() -> None:
    assert {step(desired, reported) for desired, reported in EVERY} == set(Action)


def test_what_is_usual() -> None:
    """S11: two exchanges without an answer; a new drive is believed nothing."""
    assert UNHEARD == 2
    assert Desired("a") == Desired("a", True, False)
    assert Reported() == Reported(False, None, None, True, False, 0, False)


def test_a_drive_without_set_up_is_set_up_first() -> None:
    for desired, reported in EVERY:
        assert (step(desired, reported) is Action.SET_UP) is reported.lost


def test_power_comes_only_to_a_healthy_confirmed_drive_that_answers() -> None:
    """S8, S11."""
    for desired, reported in EVERY:
        action = step(desired, reported)
        if action in GIVING:
            assert desired.law is not None
            assert reported.fault is None
            assert reported.unheard < UNHEARD
            assert reported.power or reported.confirmed
            assert not (reported.power and reported.stale)
            assert desired.live or reported.law == desired.law
        if action is Action.POWER_ON:
            assert not reported.power
        if action is Action.SET_LAW:
            assert not desired.live
            assert not reported.power


def test_off_is_repeated_whatever_is_reported() -> None:
    """Until power is reported off, and after it."""
    for desired, reported in EVERY:
        if desired.law is None and not reported.lost:
            expected = Action.RESET if desired.reset else Action.OFF
            assert step(desired, reported) is expected
            assert done(desired, reported) is not reported.power


def test_each_action_leads_on_to_the_goal() -> None:
    """A drive that does what it is told ends where it should, in few steps."""
    for desired, reported in product(DESIRED, REPORTED):
        if desired.law is None:
            continue
        state = Reported(reported.power, reported.law, None, reported.lost, reported.confirmed)
        state.stale = reported.power and reported.stale
        for _ in range(8):
            action = step(desired, state)
            if action is Action.SET_UP:
                state = Reported(lost=False, confirmed=True)
            elif action is Action.CONFIRM:
                state.confirmed = True
            elif action is Action.OFF:
                state.power = state.stale = False
            elif action is Action.SET_LAW:
                state.law = desired.law
            elif action in GIVING:
                state.power, state.confirmed = True, False
                state.law = desired.law if desired.live else state.law
        assert action is Action.GOAL
        assert done(desired, state)


def test_what_is_not_confirmed_is_said() -> None:
    assert "power" in unconfirmed(Desired(None), Reported(power=True))
    assert "power" in unconfirmed(Desired("a"), Reported())
    assert "keeps" in unconfirmed(Desired("a"), Reported(power=True, law="a", stale=True))
    assert "take" in unconfirmed(Desired("a"), Reported(power=False, law="a", stale=True))
    assert unconfirmed(Desired("a"), Reported(power=True, law="b")) == "acts in mode b, not in a"
    assert unconfirmed(Desired("a"), Reported(power=True)) == "does not report its mode"


def test_an_interview_asks_again_and_gives_up() -> None:
    """One question per exchange; nobody waits."""
    question = Question(["frame"], lambda said: said or None)
    held = Interview(ask(question, "silent"), 0.0)
    assert not held.advance(0.001)
    assert held.hear("yes")
    assert held.advance(0.002)
    assert held.result == "yes"
    held, asked = Interview(ask(question, "silent"), 0.0), []

    def wait() -> None:
        for cycle in range(1000):
            asked.append(held.asks)
            held.asks = False
            held.advance(0.002 * cycle)

    with pytest.raises(ConnectionError, match="silent"):
        wait()
    assert sum(asked) == ATTEMPTS


def test_a_late_answer_is_none_to_the_next_question() -> None:
    """After a question that was repeated, what comes for a while is dropped."""

    def two() -> object:
        first = yield from ask(Question([1], lambda said: said), "silent")
        second = yield from ask(Question([2], lambda said: said), "silent")
        return first, second

    held, now = Interview(two(), 0.0), 0.0
    while not held.asks or now == 0.0:
        now, held.asks = now + 0.002, False
        held.advance(now)
    held.hear("late, of the first")
    held.advance(now + 0.001)
    assert not held.hear("late, of the repeated one")
    while not held.question.request:
        now += 0.002
        held.advance(now)
    held.hear("of the second")
    assert held.advance(now + 0.001)
    assert held.result == ("late, of the first", "of the second")
