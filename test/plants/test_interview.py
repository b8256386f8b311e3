# SPDX-License-Identifier: Apache-2.0
"""A set-up as a conversation: what is asked again, when, and what counts as an answer (S10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives.axes import Axis
from control_board_ros.plants.drives.driver import Order
from control_board_ros.plants.drives.interview import (
    PAUSE,
    Interview,
    Question,
    Questions,
    ask,
    converse,
    find,
)
from control_board_ros.plants.drives.reconcile import SET_UP

WHO = Question("who", lambda said: said)
EVERYONE = replace(WHO, several=True)
AXIS = Axis(name="elbow", id=3)
PATIENCES = [0.01, 0.02, 0.04, 0.08, 0.16, 0.32]


def led(questions: Questions[Any], answers: Sequence[list[Any]]) -> tuple[Any, list[Question]]:
    """The result of a conversation, or its error, and what was asked; at last nobody answers."""
    asked: list[Question] = []

    def answer(question: Question) -> list[Any]:
        asked.append(question)
        return answers[len(asked) - 1] if len(asked) <= len(answers) else []

    try:
        return converse(questions, answer), asked
    except ConnectionError as error:
        return str(error), asked


@pytest.mark.parametrize(
    ("answers", "result", "patiences"),
    [
        ([["a"]], "a", [0.01]),
        ([["a", "b"]], "a", [0.01]),
        ([[], ["a"]], "a", [0.01, 0.02, 0.02]),
        ([[], [], [], ["a"]], "a", [0.01, 0.02, 0.04, 0.08, 0.08]),
        ([], "nobody", PATIENCES),
    ],
)
def test_a_question_is_repeated_twice_as_long_each_time(
    answers: list[list[str]], result: str, patiences: list[float]
) -> None:
    """After a repetition there is a pause: what comes late is no answer to the next question."""
    found, asked = led(ask(WHO, "nobody"), answers)
    assert found == result
    assert [one.patience for one in asked] == pytest.approx(patiences)
    pauses = len(answers) > 1
    assert [one.request for one in asked] == ["who"] * (len(asked) - pauses) + [()] * pauses


@pytest.mark.parametrize(
    ("answers", "result", "count"),
    [
        ([["a"]], "a", 1),
        ([["a", "b"], ["a"]], "a", 2),
        ([[], ["a"]], "a", 2),
        ([["a", "b"], ["a", "b"]], "two drives answer", 2),
        ([["a", "b"], [], ["a", "b"], ["a", "b"]], "two drives answer", 4),
        ([], "no drive answers", 6),
    ],
)
def test_one_drive_has_an_id(answers: list[list[str]], result: str, count: int) -> None:
    """Two answers may be one that came twice; again, they are two drives."""
    found, asked = led(find(EVERYONE, AXIS, "can0", "moteus"), answers)
    assert [one.patience for one in asked] == pytest.approx(PATIENCES[:count])
    end = " as id 3 on can0; look with: cbctl drives scan moteus --bus can0"
    assert found == (result if result == "a" else f"elbow: {result}{end}")


def answers_of(question: Question) -> Questions[list[Any]]:
    found = yield question
    return found


def test_an_answer_ends_a_question_in_the_next_exchange() -> None:
    talk = Interview(answers_of(WHO), 5.0)
    assert (talk.over, talk.asks, talk.question, talk.answered) == (False, True, WHO, False)
    assert not talk.hear(None)  # not picked
    assert not talk.advance(5.01)
    assert talk.hear("a")
    assert talk.answered
    assert talk.advance(5.002)
    assert (talk.result, talk.over) == (["a"], True)
    assert not talk.hear("b")
    assert talk.advance(9.0)


def test_silence_ends_a_question_when_its_patience_is_over() -> None:
    talk = Interview(answers_of(WHO), 5.0)
    assert not talk.advance(5.0099)
    assert talk.advance(5.0101)
    assert talk.result == []


def test_what_several_may_answer_lasts_an_exchange_longer() -> None:
    talk = Interview(answers_of(EVERYONE), 5.0)
    assert talk.hear("a")
    assert not talk.answered
    assert not talk.advance(5.002)
    assert talk.hear("b")
    assert talk.advance(5.004)
    assert talk.result == ["a", "b"]


def test_each_question_is_asked_anew() -> None:
    def two() -> Questions[str]:
        first = yield EVERYONE
        second = yield EVERYONE
        return f"{first}{second}"

    talk = Interview(two(), 5.0)
    order = Order(SET_UP, SetPoint.OFF, (), talk)
    assert order.request == "who"
    talk.asks = False
    assert order.request == Order(SET_UP, SetPoint.OFF, ()).request == ()
    assert talk.hear("a")
    assert not talk.advance(5.002)
    assert not talk.asks
    assert not talk.advance(5.004)
    assert talk.asks
    assert talk.hear("b")  # of it, too, another one may come
    assert not talk.advance(5.012)
    assert talk.advance(5.013)
    assert talk.result == "['a']['b']"


def test_nothing_is_heard_in_a_pause() -> None:
    talk = Interview(answers_of(PAUSE), 0.0)
    assert not talk.hear("a", "b")
    assert not talk.advance(0.01)
    assert talk.advance(0.0101)
