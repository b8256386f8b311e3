# SPDX-License-Identifier: Apache-2.0
"""What a board answers that can be no answer is refused in a line."""

from __future__ import annotations

from typing import Any

import pytest

from control_board_ros import interface
from control_board_ros.client.checking import check_asked, check_response
from control_board_ros.client.errors import BoardError
from control_board_ros.client.services import reply_of, whole
from control_board_ros.client.state import joint_names
from control_board_ros.core.selection import RequestError
from control_board_ros.core.terms.reply import Answer, Reason, accepted, refused

pytestmark = pytest.mark.ros
MANY = interface.MOST_JOINTS + 1


def response_of(service: Any, **fields: Any) -> Any:
    return service.load().Response(**fields)


@pytest.mark.parametrize(
    ("service", "fields", "says"),
    [
        (interface.GET_CONTROL_MODE, {"names": ["a", "b"], "modes": ["pos"]}, "1 modes for 2"),
        (interface.GET_CONTROL_MODE, {"names": ["a"], "modes": ["x\x1b"]}, "is no control mode"),
        (interface.GET_CONTROL_MODE, {"names": ["a"] * MANY}, "500 at most"),
        (
            interface.GET_INTERACTION_MODE,
            {"names": ["a"], "modes": ["pos"]},
            "no interaction mode",
        ),
    ],
)
def test_invalid_answers_are_refused(service: Any, fields: dict[str, Any], says: str) -> None:
    with pytest.raises(BoardError, match=says) as error:
        check_response(service, response_of(service, **fields), "/board")
    assert str(error.value).isprintable()


def test_valid_answers_pass_with_printable_names() -> None:
    response = response_of(
        interface.GET_CONTROL_MODE, names=["a\x1b]0;", "b"], modes=["pos", "idl"]
    )
    check_response(interface.GET_CONTROL_MODE, response, "/board")
    assert list(response.names) == ["a\N{REPLACEMENT CHARACTER}]0;", "b"]


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"answers": ["accepted"]}, "1 answer came for 2 joints"),
        ({"answers": ["accepted", "gl\x1bad"]}, "is no answer"),
        ({"answers": ["refused"] * 2, "codes": ["no_such", ""]}, "is no reason"),
        ({"answers": ["refused"] * 2, "codes": ["in_fault"]}, "1 code came for 2 joints"),
        ({"answers": ["refused"] * 2, "reasons": ["a", "b", "c"]}, "3 reasons came for 2"),
    ],
)
def test_answers_that_are_none(fields: dict[str, Any], says: str) -> None:
    response = response_of(interface.SET_CONTROL_MODE, **fields)
    with pytest.raises(BoardError, match=says) as error:
        reply_of(response, ("a", "b"))
    assert str(error.value).isprintable()


def test_answers_keep_their_codes_and_show_their_texts() -> None:
    response = response_of(
        interface.SET_CONTROL_MODE,
        answers=["accepted", "refused"],
        codes=["", "in_fault"],
        reasons=["", "too\x1bhot"],
        message="b\u202e" + "x" * 1_000_000,
    )
    reply = reply_of(response, ("a", "b"))
    assert (reply.joints, reply.answers) == (("a", "b"), (Answer.ACCEPTED, Answer.REFUSED))
    assert list(reply.codes) == [Reason.NONE, Reason.IN_FAULT]
    assert reply.reasons[1] == "too\N{REPLACEMENT CHARACTER}hot"
    assert reply.message.isprintable()
    assert len(reply.message) < 10_000


def test_an_answer_without_reasons_and_one_of_the_whole_request() -> None:
    """M7: where the request was wrong as a whole, no joint has an answer."""
    both = ("a", "b")
    empty = {"reasons": ["", ""], "codes": ["", ""]}
    fine = response_of(interface.SET_CONTROL_MODE, answers=["accepted"] * 2, **empty)
    assert reply_of(fine, both) == accepted(both)
    wrong = response_of(interface.SET_CONTROL_MODE, message="named twice")
    assert reply_of(wrong, both) == refused("named twice")


def test_an_unknown_code_of_a_whole_request() -> None:
    with pytest.raises(BoardError, match="'sic' is no reason"):
        whole(False, "no", ("a",), ["sic"])


@pytest.mark.parametrize("names", [["a", "a"], [""], ["a"] * MANY, ["\x1b", "\x1c"]])
def test_names_that_no_board_has(names: list[str]) -> None:
    with pytest.raises(RequestError, match="left out"):
        joint_names(names)


@pytest.mark.parametrize("stiffness", [[], [1.0]])
def test_answers_for_fewer_joints_than_asked(stiffness: list[float]) -> None:
    names = ["a"] * len(stiffness) or ["a", "b"]
    response = response_of(interface.GET_IMPEDANCE, names=names, stiffness=stiffness)
    with pytest.raises(BoardError, match="for 2 requested joints"):
        check_asked(interface.GET_IMPEDANCE, response, 2, "/board")
