# SPDX-License-Identifier: Apache-2.0
"""core/offered.py: a board's methods are its parts', and follow them over a power cycle."""

from __future__ import annotations

import inspect

import pytest
from rig import board_config, joint

from control_board_ros.core.board import Board
from control_board_ros.core.get_methods import GetMethods
from control_board_ros.core.mode_methods import ModeMethods
from control_board_ros.core.robot import Robot
from control_board_ros.core.setting_methods import SettingMethods


@pytest.mark.parametrize(
    "method", [ModeMethods.set_control_mode, SettingMethods.set_impedance, GetMethods.get_encoder]
)
@pytest.mark.parametrize("owner", [Board, Robot])
def test_it_shows_the_signature_and_the_docstring_of_the_part(owner: type, method: object) -> None:
    shown = getattr(owner, method.__name__)  # type: ignore[attr-defined]
    assert inspect.signature(shown) == inspect.signature(method)  # type: ignore[arg-type]
    assert shown.__doc__ == method.__doc__


def test_it_is_the_part_of_now_that_answers() -> None:
    """N1: a power cycle makes the parts anew, and with them what they keep."""
    board = Board(board_config(joint("a", reference_speed=0.3)))
    ask, read = board.set_ref_speed, board.get_ref_speed
    assert ask("a", 0.7)
    assert read("a") == [0.7]
    board.power_cycle()
    assert read("a") == [0.3]
    assert ask("a", 0.5)
    assert board.get_ref_speed() == [0.5]
