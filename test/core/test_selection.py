# SPDX-License-Identifier: Apache-2.0
"""core/selection.py: which joints are meant."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from control_board_ros.core.selection import REMEMBERED, RequestError, Selector, spread

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


def test_many_joints_are_not_all_listed() -> None:
    selector = Selector(tuple(f"joint_{i}" for i in range(53)))
    with pytest.raises(RequestError, match=r"joint_15, …$"):
        selector.select("nose")


def test_memory_is_bounded() -> None:
    selector = Selector(tuple(f"joint_{i}" for i in range(600)))
    for i in range(600):
        assert selector.select([i, (i + 1) % 600]).names[0] == f"joint_{i}"
    assert len(selector._known) == REMEMBERED


def test_spread() -> None:
    assert spread(0.5, 3, "speeds").tolist() == [0.5, 0.5, 0.5]
    assert spread([1, 2], 2, "speeds").tolist() == [1.0, 2.0]
    assert spread(np.float32(2.0), 1, "speeds").tolist() == [2.0]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0], "1 speeds for 3 joints; send one value per named joint"),
        ([1.0, 2.0], "2 speeds for 3 joints"),
        ([], "0 speeds for 3 joints"),
        ([[1.0, 2.0, 3.0]], "3 speeds for 3 joints"),
        ("fast", "speeds must be numbers"),
        (["a", "b", "c"], "speeds must be numbers"),
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
