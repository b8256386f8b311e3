# SPDX-License-Identifier: Apache-2.0
"""Set-up of a drive as a conversation: one question per exchange, and nobody waits for it (S10).

A set-up is a generator that yields questions and receives answers::

    def set_up(self, k):
        version, = yield Question(request)      # no answer: an empty list, after PATIENCE
        ...
        return Identity(...)
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

from .axes import Axis

#: s after which a question without an answer counts as unanswered, twice as long each time, and
#: how many times it is asked.
PATIENCE, ATTEMPTS = 0.01, 6
Result = TypeVar("Result")
Answers = list[Any]


@dataclass(frozen=True, slots=True)
class Question:
    """A question to a drive.

    Attributes:
        request: Its frames, or its packet, as the make has them.
        pick: The answer in what the drive sends, None where it is none.
        several: All drives that answer are heard: it lasts an exchange longer.
        patience: s until it counts as unanswered.
    """

    request: Any
    pick: Callable[..., Any]
    several: bool = False
    patience: float = PATIENCE


def told(*frames: Any) -> Question:
    """Frames that no answer follows: they are sent, and PATIENCE passes."""
    return Question(frames, lambda *_: None)


#: Nothing is asked, and nothing heard, for PATIENCE.
PAUSE = told()
Questions = Generator[Question, Answers, Result]


class Interview(Generic[Result]):
    """One conversation.

    Args:
        questions: Its generator.
        now: s.

    Attributes: question (the present one), asks (whether its frames are to be sent now), result
        (once it is over).
    """

    question: Question
    result: Result | None

    def __init__(self, questions: Questions[Result], now: float) -> None:
        self._questions, self._since, self._late = questions, now, False
        self._answers: Answers = []
        self.question, self.result = PAUSE, None
        self.over, self.asks = False, True
        self._pass(lambda: next(questions), now)

    def advance(self, now: float) -> bool:
        """Take the answers of the last exchange; true when it is over.

        Raises:
            OSError: the drive does not answer.
            ValueError: it is none that is supported.
        """
        if self.over:
            return True
        last = self.question.several and not self._late and bool(self._answers)
        self._late = bool(self._answers)
        if (self._answers and not last) or now - self._since > self.question.patience:
            answers, self._answers = self._answers, []
            self._pass(lambda: self._questions.send(answers), now)
        return self.over

    def hear(self, *said: Any) -> bool:
        """What a drive sent; true where it is an answer."""
        if self.over or (answer := self.question.pick(*said)) is None:
            return False
        self._answers.append(answer)
        return True

    @property
    def answered(self) -> bool:
        """Whether no more is awaited in this exchange."""
        return bool(self._answers) and not self.question.several

    def _pass(self, move: Callable[[], Question], now: float) -> None:
        self._since, self._late, self.asks = now, False, True
        try:
            self.question = move()
        except StopIteration as end:
            self.over, self.result = True, end.value


def converse(questions: Questions[Result], answers_to: Callable[[Question], Answers]) -> Result:
    """Lead an interview on a line that nobody else uses; its result.

    Args:
        questions: Its generator.
        answers_to: Asks a question; all answers.
    """
    try:
        question = next(questions)
        while True:
            question = questions.send(answers_to(question))
    except StopIteration as end:
        result: Result = end.value
        return result


def find(question: Question, axis: Axis, bus: str, driver: str) -> Questions[Any]:
    """The one answer of the drive with an id.

    Raises:
        ConnectionError: no drive answers, or two with one id.
    """
    several = False
    for attempt in range(ATTEMPTS):
        answers = yield longer(question, attempt)
        if len(answers) == 1:
            return answers[0]
        if answers and several:
            break
        several = bool(answers)  # or one of them came twice
    raise ConnectionError(
        f"{axis.name}: {'two drives answer' if several else 'no drive answers'} as id {axis.id} "
        f"on {bus}; look with: cbctl drives scan {driver} --bus {bus}"
    )


def ask(question: Question, unanswered: str) -> Questions[Any]:
    """The answer to a question, which is repeated.

    Args:
        question: For one answer.
        unanswered: What is said when it never comes.

    Raises:
        ConnectionError: it does not come.
    """
    for attempt in range(ATTEMPTS):
        if answers := (yield longer(question, attempt)):
            if attempt:  # what comes late is no answer to the next question
                yield longer(PAUSE, attempt)
            return answers[0]
    raise ConnectionError(unanswered)


def longer(question: Question, attempt: int) -> Question:
    """The question, with the patience of an attempt."""
    return replace(question, patience=question.patience * 2**attempt) if attempt else question
