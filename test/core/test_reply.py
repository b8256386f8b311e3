# SPDX-License-Identifier: Apache-2.0
"""reply.py: what a reply says and whether it is true."""

from __future__ import annotations

import pytest

from control_board_ros.core.terms.reply import (
    Answer,
    JointAnswer,
    MotionDone,
    Reason,
    Reply,
    accepted,
    decided,
    refused,
    sent,
)

FINE = JointAnswer()


def test_motion_is_done_when_that_of_all_joints_is() -> None:
    """``while not board.check_motion_done():``, as written for YARP, waits."""
    assert not MotionDone([True, False])
    assert MotionDone([True, True])
    assert MotionDone([False, True]) == [False, True]


def test_true_only_when_all_accepted() -> None:
    assert accepted(("a", "b"))
    assert not refused("no")
    assert not refused("no", ("a",))
    assert not Reply((), ())
    assert not decided(("a", "b"), [FINE, JointAnswer(Answer.REFUSED, "a fault")])
    assert decided(("a", "b"), [FINE, FINE])


def test_commands_by_topic_have_no_answer() -> None:
    reply = sent(("a", "b"))
    assert reply
    assert reply.answers == (Answer.SENT, Answer.SENT)
    assert reply.reasons == ()


def test_each_joint_has_its_answer_and_reason() -> None:
    reply = decided(("a", "b"), [FINE, JointAnswer(Answer.IGNORED, "b is IDLE")])
    assert reply.joints == ("a", "b")
    assert reply.answers == (Answer.ACCEPTED, Answer.IGNORED)
    assert reply.reasons == ("", "b is IDLE")
    assert reply.message == "b is IDLE"


@pytest.mark.parametrize(
    ("names", "rest"), [("abc", ""), ("abcd", " (and 1 more)"), ("abcdef", " (and 3 more)")]
)
def test_message_lists_three_reasons_and_counts_the_rest(names: str, rest: str) -> None:
    reply = decided(tuple(names), [JointAnswer(Answer.REFUSED, f"no {n}") for n in names])
    assert reply.message == f"no a; no b; no c{rest}"
    assert reply.reasons[-1] == f"no {names[-1]}"


def test_equal_reasons_are_listed_once() -> None:
    reply = decided(("a", "b"), [JointAnswer(Answer.REFUSED, "same")] * 2)
    assert reply.message == "same"
    assert accepted(("a",)).message == ""
    assert refused("why", ("a", "b")).reasons == ("why", "why")


def test_accepted_requests_may_have_a_text() -> None:
    """P1: what will be done instead reaches the user, and the reply is true."""
    reply = decided(("a", "b"), [FINE, JointAnswer(Answer.ACCEPTED, "b: bounded to 2")])
    assert reply
    assert (reply.message, reply.reasons) == ("b: bounded to 2", ("", "b: bounded to 2"))
    assert decided(("a", "b"), [FINE, FINE]) == accepted(("a", "b"))


def test_it_prints_as_one_line() -> None:
    """A: what a user wants to read of a reply, without a look at its fields."""
    assert str(accepted(("a", "b"))) == "accepted"
    assert f"{decided(('a',), [JointAnswer(Answer.ACCEPTED, 'a: bounded to 1°')])}" == (
        "accepted; a: bounded to 1°"
    )
    assert str(refused("joint 'x' unknown")) == "joint 'x' unknown"
    some = decided(("a", "b"), [FINE, JointAnswer(Answer.REFUSED, "b is CALIBRATING")])
    assert str(some) == "b is CALIBRATING"


def test_each_joint_by_itself() -> None:
    """Without texts and codes where a reply has none."""
    plain = accepted(("a", "b")).each()
    assert plain == [JointAnswer(Answer.ACCEPTED, "", Reason.NONE)] * 2
    answers = [FINE, JointAnswer(Answer.REFUSED, "no b", Reason.IN_FAULT)]
    assert decided(("a", "b"), answers).each() == answers
    textual = decided(("a", "b"), [FINE, JointAnswer(Answer.REFUSED, "no b")])
    assert textual.codes == ()
    assert [one.code for one in textual.each()] == [Reason.NONE] * 2


def test_failures_due_to_others_are_listed_last() -> None:
    """M7: the joint that is the cause is named first."""
    together = JointAnswer(Answer.REFUSED, "a: as b is refused", Reason.TOGETHER)
    cause = JointAnswer(Answer.REFUSED, "b is in HW_FAULT", Reason.IN_FAULT)
    reply = decided(("a", "b"), [together, cause])
    assert reply.message == "b is in HW_FAULT; a: as b is refused"
    assert reply.reasons == ("a: as b is refused", "b is in HW_FAULT")
    assert reply.codes == (Reason.TOGETHER, Reason.IN_FAULT)
