# SPDX-License-Identifier: Apache-2.0
"""core/selection.py: which joints are meant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from control_board_ros.core.selection import (
    RequestError,
    Selector,
    all_within,
    automatic,
    by_hand,
    control_modes,
    finite,
    interaction_modes,
    loop_of,
    spread,
)
from control_board_ros.core.terms.motors import Loop
from control_board_ros.core.terms.reply import Answer, Reason
from control_board_ros.core.terms.vocabs import BrakeMode, ControlMode, InteractionMode

NAMES = ("shoulder", "elbow", "wrist")


@pytest.mark.parametrize(
    ("joints", "chosen"),
    [
        (None, [0, 1, 2]),
        ((), [0, 1, 2]),
        ([], [0, 1, 2]),
        (1, [1]),
        ("wrist", [2]),
        (["wrist", 0], [2, 0]),
        (("elbow",), [1]),
        (np.array([2, 1]), [2, 1]),
        (range(2), [0, 1]),
    ],
)
def test_ways_to_name_joints(joints: Any, chosen: list[int]) -> None:
    selector = Selector(NAMES)
    for _ in range(2):  # once found, once remembered
        selection = selector.select(joints)
        assert selection.joints.tolist() == chosen
        assert selection.names == tuple(NAMES[j] for j in chosen)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (
            "ellbow",
            "joint 'ellbow' unknown; did you mean 'elbow'?; joints: shoulder",
        ),
        (["elbow", "nose"], "joint 'nose' unknown"),
        (3, "joint index 3 out of range; joints are 0 to 2"),
        (-1, "joint index -1 out of range"),
        ([0, 0], "joint 'shoulder' named twice"),
        ([0, "shoulder"], "joint 'shoulder' named twice"),
        (True, "joint 'True' unknown"),
        ([1.0], "joint '1.0' unknown"),
        ([[0]], "joint '[[0]]' unknown"),
        (2.5, "joint '2.5' unknown"),
        ("x" * 100000, "…"),
    ],
)
def test_wrong_names(joints: Any, message: str) -> None:
    with pytest.raises(RequestError) as error:
        Selector(NAMES).select(joints)
    assert message in str(error.value)
    assert len(str(error.value)) < 300
    assert "\n" not in str(error.value)


def test_spread() -> None:
    assert spread(0.5, 3, "speeds").tolist() == [0.5, 0.5, 0.5]
    assert spread([1, 2], 2, "speeds").tolist() == [1.0, 2.0]
    assert spread(np.float32(2.0), 1, "speeds").tolist() == [2.0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0], "1 speed for 3 joints; send one value per named joint"),
        ([1.0, 2.0], "2 speeds for 3 joints"),
        ([], "0 speeds for 3 joints"),
        ([[1.0, 2.0, 3.0]], "speeds must be in one list"),
        ("fast", "speeds must be numbers"),
        (["a", "b", "c"], "speeds must be numbers"),
        ([None, {}, 1.0], "speeds must be numbers"),
        ([[1.0, 2.0], [3.0]], "speeds must be numbers"),
        (object(), "speeds must be numbers"),
        ({}, "speeds must be numbers"),
        (10**400, "speeds must be numbers"),
    ],
)
def test_spread_refuses(values: Any, message: str) -> None:
    with pytest.raises(RequestError) as error:
        spread(values, 3, "speeds")
    assert message in str(error.value)


def test_a_long_unknown_name_is_cut() -> None:
    """64 characters are shown, of a longer one the first 64."""
    for length, shown in ((64, "x" * 64), (65, "x" * 64 + "…")):
        with pytest.raises(RequestError, match=f"joint '{shown}' unknown"):
            Selector(NAMES).select("x" * length)


@pytest.mark.parametrize(("count", "text"), [(16, "joint_15"), (17, "joint_15, …")])
def test_sixteen_joints_are_listed(count: int, text: str) -> None:
    names = tuple(f"joint_{i}" for i in range(count))
    with pytest.raises(RequestError) as error:
        Selector(names).select("nose")
    assert str(error.value).endswith(text)


def test_one_value_that_is_not_finite_is_enough() -> None:
    assert finite(np.array([1.0, 2.0]), "angles").tolist() == [1.0, 2.0]
    for values in ([1.0, np.nan], [-np.inf, 1.0], [np.nan, np.nan]):
        with pytest.raises(RequestError, match="angles must be finite numbers") as error:
            finite(np.array(values), "angles")
        assert error.value.code is Reason.NOT_FINITE


MOST = np.array([1.0, 2.0, 3.0])


def within(joints: Any, values: Any, *, zero: bool = False) -> list[float]:
    """Values of a request for joints whose most are 1, 2 and 3; ``zero``: 0 is the least."""
    lowest = np.zeros(3) if zero else None
    found = all_within(Selector(NAMES).select(joints), "speed", values, MOST, lowest=lowest)
    return found.tolist()


def test_values_up_to_the_most_of_each_joint() -> None:
    """One goes to all of them, also as a list."""
    assert within(["wrist", "shoulder"], [3.0, 1.0]) == [3.0, 1.0]
    assert within(None, 1.0) == within(None, [1.0]) == [1.0] * 3
    assert within(None, 0.0, zero=True) == [0.0] * 3


@pytest.mark.parametrize(
    ("values", "zero", "text", "code"),
    [
        ([1.0, 2.1], False, "speed 2.1 of elbow is not allowed; send a number above 0, up to 2",
         Reason.OUT_OF_RANGE),
        ([0.0, 2.0], False, "speed 0 of shoulder is not allowed; send a number above 0, up to 1",
         Reason.OUT_OF_RANGE),
        ([0.0, -0.1], True, "speed -0.1 of elbow is not allowed; send a number from 0 to 2",
         Reason.OUT_OF_RANGE),
        ([1.0, np.nan], True, "speed nan of elbow is not allowed; send a number from 0 to 2",
         Reason.NOT_FINITE),
        ([np.inf, 1.0], False, "speed inf of shoulder is not allowed; send a number above 0, up "
         "to 1", Reason.NOT_FINITE),
    ],
)  # fmt: skip
def test_a_value_beyond_the_most(values: list[float], zero: bool, text: str, code: Reason) -> None:
    with pytest.raises(RequestError) as error:
        within(["shoulder", "elbow"], values, zero=zero)
    assert str(error.value) == text
    assert error.value.code is code


@pytest.mark.parametrize(
    ("joints", "names"),
    [
        (["nose", "wrist"], ("nose", "wrist")),
        (["wrist", "wrist"], ("wrist", "wrist")),
        ([2, 7, "x" * 65], (NAMES[2], "7", "x" * 64 + "…")),
        ("nose", ("nose",)),
        (None, NAMES),
        (["nose"] * 4, ()),  # more than there are: maybe megabytes
    ],
)
def test_a_refusal_answers_each_joint(joints: Any, names: tuple[str, ...]) -> None:
    """M7: one answer per joint of the request, of one that does not exist, too."""
    reply = Selector(NAMES).refuse(joints, RequestError("not so"))
    assert reply.joints == names
    assert list(reply.answers) == [Answer.REFUSED] * len(names)
    assert list(reply.reasons) == ["not so"] * len(names)


def test_what_can_be_requested_is_listed() -> None:
    """M6: the error of an unknown control mode names no status."""
    with pytest.raises(ValueError, match="control mode 'hwfb' unknown; known: pos") as error:
        control_modes("hwfb", 1)
    assert "fidl (FORCE_IDLE)" in str(error.value)
    assert not any(code in str(error.value) for code in ("hwfa", "cald", "cfgn", "cfgy"))


def test_modes_of_a_request() -> None:
    """One for all of them, as a list, too; a status cannot be set."""
    assert control_modes("pos", 2) == control_modes(["pos"], 2) == [ControlMode.POSITION] * 2
    assert control_modes(ControlMode.IDLE, 1) == [ControlMode.IDLE]
    assert control_modes(["vel", "pos"], 2) == [ControlMode.VELOCITY, ControlMode.POSITION]
    assert interaction_modes("comp", 3) == [InteractionMode.COMPLIANT] * 3
    with pytest.raises(RequestError, match="3 modes for 2 joints; send one mode per named joint"):
        control_modes(["pos"] * 3, 2)
    with pytest.raises(RequestError, match="2 modes for 1 joint;"):
        control_modes(["pos"] * 2, 1)
    with pytest.raises(RequestError, match=r"hwfa \(HW_FAULT\) is a status .* one of pos, "):
        control_modes("hwfa", 1)


def test_ways_to_work_brakes() -> None:
    automatically, closed, opened = BrakeMode.AUTOMATIC, BrakeMode.CLOSED, BrakeMode.OPEN
    assert by_hand(True) == by_hand(np.bool_(True)) == [closed]  # type: ignore[arg-type]
    assert by_hand([False, True]) == [opened, closed]
    assert automatic(True, [True, False]) == [automatically] * 2
    assert automatic(False, [True, False]) == [closed, opened]
    assert automatic([True, False], [False, False]) == [automatically, opened]
    with pytest.raises(RequestError, match="1 flags for 2 joints; send one, or one each"):
        automatic([True], [True, False])


def test_loops_by_their_names() -> None:
    assert [loop_of(str(loop)) for loop in Loop] == list(Loop)
    with pytest.raises(RequestError, match=r"loop 'x{32}' unknown; one of position, "):
        loop_of("x" * 40)


def test_memory_keeps_the_latest_and_knows_types() -> None:
    """M7: True and 1.0 equal 1, and name no joint; odd requests do not fill the memory."""
    selector = Selector(tuple("abc"))
    assert selector.select(1) is selector.select(1)
    for wrong in (True, 1.0, [True], [1.0], [1.0, 2]):
        with pytest.raises(RequestError, match="unknown"):
            selector.select(wrong)  # type: ignore[arg-type]
    for j in range(600):
        selector.select(np.array([j % 3]))
    many = Selector(tuple(f"joint_{i}" for i in range(600)))
    for i in range(600):
        assert many.select([i, (i + 1) % 600]).names[0] == f"joint_{i}"
    assert len(many._known) == 256
    assert many.select([599, 0]) is many.select([599, 0])
