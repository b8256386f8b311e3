# SPDX-License-Identifier: Apache-2.0
"""The answer to a request or a command."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from .vocabs import CommandKind


class Answer(StrEnum):
    """What became of one joint's part of a request."""

    ACCEPTED = "accepted"
    IGNORED = "ignored"  # a command that the mode does not take, or a bad value (M4, P13)
    REFUSED = "refused"  # nothing changed (F2, K2, M6, M7, N4)
    UNSUPPORTED = "unsupported"  # not implemented by the joint, now in HW_FAULT (M5, I7)


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a set method; true when every joint accepted.

    Attributes: joints (names in the order asked; empty when the request named none that
    exist), answers (one per joint), message (one line for a person, empty when all is well),
    reasons (one text per joint, empty where it accepted; or none at all).
    """

    joints: tuple[str, ...]
    answers: tuple[Answer, ...]
    message: str = ""
    reasons: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.answers) and all(a is Answer.ACCEPTED for a in self.answers)

    def __str__(self) -> str:
        """One line for a person: ``accepted``, with what will be done instead; else the reason."""
        told = ["accepted", self.message] if self else [self.message]
        return "; ".join(text for text in told if text)


def quantity(kind: CommandKind, value: float, sliding: bool) -> str:
    """A reference with its unit, for people: degrees where the joint turns."""
    if kind is CommandKind.OUTPUT:
        return f"{value:.6g} %"
    if kind is CommandKind.TORQUE:
        return f"{value:.6g} {'N' if sliding else 'N·m'}"
    rate = "/s" if kind is CommandKind.VELOCITY else ""
    if sliding:
        return f"{value:.6g} m{rate}"
    return f"{math.degrees(value):.4g}°{rate}"


def position_text(kind: str, position: float) -> str:
    """A position with its unit, for people, of a kind of joint."""
    return quantity(CommandKind.POSITION, position, kind == "prismatic")


def accepted(joints: tuple[str, ...]) -> Reply:
    """All of them accepted."""
    return Reply(joints, (Answer.ACCEPTED,) * len(joints))


def refused(message: str, joints: tuple[str, ...] = ()) -> Reply:
    """The whole request refused, for one reason."""
    return Reply(joints, (Answer.REFUSED,) * len(joints), message, (message,) * len(joints))


def decided(joints: tuple[str, ...], verdicts: list[tuple[Answer, str]]) -> Reply:
    """Each joint its own answer; the message tells the first reasons and counts the rest.

    What was accepted may have a text, too: what will be done instead of what was asked for.
    """
    reasons = tuple(reason for _, reason in verdicts)
    if not any(reasons):
        reasons = ()
    return Reply(joints, tuple(a for a, _ in verdicts), summary(reasons), reasons)


def summary(reasons: Iterable[str]) -> str:
    """The message of several reasons: the first three, and how many more there are."""
    told = list(dict.fromkeys(reason for reason in reasons if reason))
    rest = f" (and {len(told) - 3} more)" if len(told) > 3 else ""
    return "; ".join(told[:3]) + rest


def joints_of(reply: Reply, answer: Answer) -> list[str]:
    """The joints of a reply that gave this answer."""
    pairs = zip(reply.joints, reply.answers, strict=True)
    return [name for name, given in pairs if given is answer]
