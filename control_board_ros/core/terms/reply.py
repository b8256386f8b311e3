# SPDX-License-Identifier: Apache-2.0
"""The answer to a request or a command."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

from .joint_kind import JointKind
from .vocabs import CommandKind, Vocab


class Answer(StrEnum):
    """The result of a request for one joint."""

    ACCEPTED = "accepted"
    IGNORED = "ignored"  # a command that the mode does not accept, or a bad value (M4, P13)
    REFUSED = "refused"  # nothing changed (F2, K2, M6, M7, N4)
    UNSUPPORTED = "unsupported"  # not implemented by the joint, now in HW_FAULT (M5, I7)
    SENT = "sent"  # by topic, without an answer


class Reason(StrEnum):
    """Why a joint does not do what was requested: stable codes for programs."""

    NONE = ""
    IN_FAULT = "in_fault"
    CALIBRATING = "calibrating"  # K2, K6
    UNCALIBRATED = "uncalibrated"  # K7
    INACTIVE = "inactive"  # of a managed board
    NOT_CONFIGURED = "not_configured"  # N4
    UNSUPPORTED = "unsupported"  # M5, I7
    CAUSE_PERSISTS = "cause_persists"  # F2
    EMERGENCY_STOP = "emergency_stop"  # E2
    BRAKE_CLOSED = "brake_closed"  # Y4
    NO_CALIBRATOR = "no_calibrator"  # K1
    OTHER_MODE = "other_mode"  # M3
    NOT_FINITE = "not_finite"  # P13
    OUT_OF_RANGE = "out_of_range"  # P13
    NOTHING_TO_STOP = "nothing_to_stop"  # P3
    STALE = "stale"  # B6, F8
    CONTACT = "contact"  # X2
    INVALID = "invalid"  # the request is wrong in itself (M6, M7)
    TOGETHER = "together"  # another joint of the request could not


class MotionDone(list[bool]):
    """Whether the motion of each joint is done; true when all are (YARP's checkMotionDone)."""

    def __bool__(self) -> bool:
        return all(self)


class JointAnswer(NamedTuple):
    """The result of a request for one joint: text and code are empty where it was carried out."""

    answer: Answer = Answer.ACCEPTED
    text: str = ""
    code: Reason = Reason.NONE


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a set method; true when every joint accepted, or all was sent by topic.

    Attributes: joints (names in the order of the request, as requested where one does not exist;
    empty where the request is not about joints), answers (one per joint), message (one line for a
    person, empty when all is well), reasons (one text per joint, empty where it accepted; or none
    at all), codes (likewise, a Reason), values (the references in force, as bounded, NaN where
    there is none; empty where no reference was answered), modes (those after a request for modes),
    waits (s until the cause of a fault can be gone, 0 where none is known; empty where no recovery
    was requested).
    """

    joints: tuple[str, ...]
    answers: tuple[Answer, ...]
    message: str = ""
    reasons: tuple[str, ...] = ()
    codes: tuple[Reason, ...] = ()
    values: tuple[float, ...] = field(default=(), compare=False)
    modes: tuple[Vocab, ...] = field(default=(), compare=False)
    waits: tuple[float, ...] = field(default=(), compare=False)

    def __bool__(self) -> bool:
        return bool(self.answers) and all(answer in SUCCESSFUL_ANSWERS for answer in self.answers)

    def with_modes(self, modes: Sequence[Vocab]) -> Reply:
        """The same reply with the modes after the request."""
        return replace(self, modes=tuple(modes))

    def each(self) -> list[JointAnswer]:
        """The answer of each joint, in the order of the request."""
        count = len(self.answers)
        texts, codes = self.reasons or ("",) * count, self.codes or (Reason.NONE,) * count
        return list(map(JointAnswer, self.answers, texts, codes))

    def __str__(self) -> str:
        """One line for people: ``accepted``, with the effect of limits; else the reason."""
        texts = [str(self.answers[0]), self.message] if self else [self.message]
        return "; ".join(text for text in texts if text)


SUCCESSFUL_ANSWERS = frozenset({Answer.ACCEPTED, Answer.SENT})


def quantity(command: CommandKind, value: float, joint: JointKind) -> str:
    """A reference with its unit, for people."""
    if command is CommandKind.OUTPUT:
        return f"{value:.6g} %"
    if command is CommandKind.CURRENT:
        return f"{value:.6g} A"
    if command is CommandKind.TORQUE:
        return joint.force(value)
    if command in (CommandKind.VELOCITY, CommandKind.VELOCITY_DIRECT):
        return joint.velocity(value)
    return joint.position(value)


def accepted(joints: tuple[str, ...]) -> Reply:
    """The reply of joints that all accepted."""
    return Reply(joints, (Answer.ACCEPTED,) * len(joints))


def sent(joints: tuple[str, ...]) -> Reply:
    """The reply to references sent by topic."""
    return Reply(joints, (Answer.SENT,) * len(joints))


def refused(message: str, joints: tuple[str, ...] = (), code: Reason = Reason.INVALID) -> Reply:
    """The whole request refused, for one reason."""
    count = len(joints)
    answers = (Answer.REFUSED,) * count
    return Reply(joints, answers, message, (message,) * count, (code,) * count)


def decided(joints: tuple[str, ...], answers: Sequence[JointAnswer]) -> Reply:
    """One answer per joint; the message has the first reasons and counts the rest.

    An accepted request may have a text, too: the effect of a limit.
    """
    verdicts, texts, codes = zip(*answers, strict=True) if answers else ((), (), ())
    if not any(texts):
        return Reply(joints, verdicts)
    ordered = sorted(answers, key=lambda answer: answer.code is Reason.TOGETHER)  # least specific
    message = summary(answer.text for answer in ordered)
    return Reply(joints, verdicts, message, texts, codes if any(codes) else ())


def summary(reasons: Iterable[str]) -> str:
    """The message of several reasons: the first three, and the number of the others."""
    distinct = list(dict.fromkeys(reason for reason in reasons if reason))
    rest = f" (and {len(distinct) - 3} more)" if len(distinct) > 3 else ""
    return "; ".join(distinct[:3]) + rest


def joints_of(reply: Reply, answer: Answer) -> list[str]:
    """The joints of a reply with this answer."""
    pairs = zip(reply.joints, reply.answers, strict=True)
    return [name for name, verdict in pairs if verdict is answer]
