# SPDX-License-Identifier: Apache-2.0
"""progress.py: how much of a move is done, as measured."""

from __future__ import annotations

import pytest

from control_board_ros.cli.board.progress import Way

NEAR = {"a": 0.01, "b": 0.01}


def test_the_way_is_that_of_the_joint_furthest_behind() -> None:
    way = Way({"a": 1.0, "b": -1.0}, NEAR)
    assert way.share({"a": 0.0, "b": 1.0}) == 0.0
    assert way.share({"a": 0.8, "b": 0.0}) == pytest.approx(0.5)
    assert way.share({"a": 0.8, "b": 0.0}) == pytest.approx(0.5)  # paused: as it was
    assert way.share({"a": 1.0, "b": -1.0}) == pytest.approx(1.0)


def test_a_joint_with_no_way_to_go_does_not_count() -> None:
    way = Way({"a": 1.0, "b": 0.5}, NEAR)
    assert way.share({"a": 0.0, "b": 0.5}) == 0.0
    assert way.share({"a": 0.5, "b": 0.506}) == pytest.approx(0.5)
    assert Way({"a": 0.0}, NEAR).share({"a": 0.005}) == 1.0


def test_motion_in_the_wrong_direction_is_no_progress() -> None:
    way = Way({"a": 1.0}, NEAR)
    way.share({"a": 0.0})
    assert way.share({"a": -0.2}) == 0.0
