# SPDX-License-Identifier: Apache-2.0
"""Checks of the form of messages and answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from control_board_ros.client import State
from control_board_ros.core.terms.reply import Answer, Reply
from control_board_ros.core.terms.vocabs import ControlMode, InteractionMode, encode
from control_board_ros.interface import Endpoint

from .rules import NotHeld

#: The fields of a BoardState message with one entry per joint.
PER_JOINT = tuple(field.name for field in fields(State) if field.name not in ("stamp", "names"))
#: The fields of a JointModes message with one entry per joint: codes and vocabs.
CODES_AND_VOCABS = (
    ("control_modes", "control_mode_vocabs", ControlMode),
    ("interaction_modes", "interaction_mode_vocabs", InteractionMode),
)


class Malformed(NotHeld):
    """An invalid message or answer.

    Args:
        rule: violated (``V1``).
        text: the observation.
    """

    def __init__(self, rule: str, text: str) -> None:
        super().__init__(text)
        self.rule = rule


def check_state(message: Any) -> None:
    """Check the lengths of a BoardState message; raises Malformed."""
    check_lengths("~/state", message, PER_JOINT)


def check_modes(message: Any) -> None:
    """Check the lengths and modes of a JointModes message; raises Malformed."""
    for codes, vocabs, kind in CODES_AND_VOCABS:
        check_lengths("~/modes", message, (codes, vocabs))
        known = {mode.code: int(mode) for mode in kind}
        for name, code, vocab in zip(
            message.names, getattr(message, codes), getattr(message, vocabs), strict=True
        ):
            if known.get(code) != vocab:
                text = f"~/modes has {code!r} with the vocab {vocab} for {name}"
                raise Malformed("V1", f"{text}, not {expected(code, vocab, known)}")


def expected(code: str, vocab: int, known: dict[str, int]) -> str:
    """The expected code of a vocab."""
    if code in known:
        return f"{encode(code)}"
    near = [name for name, number in known.items() if number == vocab]
    return repr(near[0]) if near else f"one of {', '.join(known)}"


def check_lengths(where: str, message: Any, names: Sequence[str]) -> None:
    """Check that these fields have one entry per joint; raises Malformed."""
    count = len(message.names)
    if not count or len(set(message.names)) != count:
        raise Malformed("A", f"{where} names the joints {list(message.names)}")
    for name in names:
        length = len(getattr(message, name))
        if length != count:
            raise Malformed("A", f"{where} has {length} in {name} for {count} joints")


def reply_of(service: Endpoint, names: Sequence[str], response: Any) -> Reply:
    """The answer of a service per joint, checked for consistency.

    Args:
        service: called.
        names: of the request.
        response: with success, message, answers and reasons.

    Raises:
        Malformed: success and answers disagree, or not one answer per joint.
    """
    texts = list(response.answers)
    unknown = [text for text in texts if text not in [*Answer]]
    if unknown:
        raise Malformed("A", f"{service.short} answers {unknown[0]!r}, not one of {[*Answer]}")
    all_accepted = bool(texts) and all(text == Answer.ACCEPTED for text in texts)
    if bool(response.success) is not all_accepted:
        text = f"{service.short} reports success={response.success} with answers {texts}"
        raise Malformed("A", f"{text}: {response.message!r}")
    if texts and (len(texts) != len(names) or len(response.reasons) != len(texts)):
        counts = f"{len(texts)} answers and {len(response.reasons)} reasons"
        raise Malformed("A", f"{service.short} has {counts} for {len(names)} joints")
    joints = tuple(names) if texts else ()
    return Reply(joints, tuple(map(Answer, texts)), response.message, tuple(response.reasons))
