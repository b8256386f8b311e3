# SPDX-License-Identifier: Apache-2.0
"""What the keys of cbctl jog do, and when the dead man's time is over."""

from __future__ import annotations

import pytest

from control_board_ros.cli.line.jogging import FASTEST, FIRST_PRESS, REPEATED, SLOWEST, Jog, split


def test_a_press_lasts_until_the_keyboard_would_repeat_it() -> None:
    jog = Jog(3, 0.2)
    assert jog.velocity(10.0) == 0.0
    jog.press("right", 10.0)
    assert jog.velocity(10.0 + 0.9 * FIRST_PRESS) == 0.2
    assert jog.velocity(10.0 + FIRST_PRESS) == 0.0


def test_a_held_key_moves_and_its_release_stops_soon() -> None:
    """P12: the time without a key is shorter than the timeout of the reference."""
    jog = Jog(3, 0.2)
    jog.press("left", 0.0)
    for k in range(1, 20):
        jog.press("left", 0.03 * k)
        assert jog.velocity(0.03 * k) == -0.2
    assert jog.velocity(0.03 * 19 + 0.9 * REPEATED) == -0.2
    assert jog.velocity(0.03 * 19 + REPEATED) == 0.0
    assert REPEATED < 0.2


def test_another_key_stops_at_once() -> None:
    for key in ("up", "stop", "other", "faster", "quit"):
        jog = Jog(3, 0.2)
        jog.press("right", 0.0)
        jog.press(key, 0.01)
        assert jog.velocity(0.01) == 0.0
        assert jog.ended == (key == "quit")
    jog = Jog(3, 0.2)
    jog.press("right", 0.0)
    jog.press("left", 0.01)
    assert jog.velocity(0.02) == -0.2


def test_joints_and_speeds() -> None:
    """Up and down go round; the speed stays within its bounds."""
    jog = Jog(3, 0.2)
    jog.press("up", 0.0)
    assert jog.joint_index == 2
    jog.press("down", 0.0)
    assert jog.joint_index == 0
    jog.press("slower", 0.0)
    assert jog.speed == pytest.approx(0.2 / 1.5)
    for _ in range(30):
        jog.press("faster", 0.0)
    assert jog.speed == FASTEST
    for _ in range(60):
        jog.press("slower", 0.0)
    assert jog.speed == SLOWEST


def test_key_codes_of_terminals() -> None:
    """Cursor keys in both modes, many at once; anything else is another key."""
    assert list(split("\x1b[C\x1bOD")) == ["right", "left"]
    assert list(split("\x1b[A\x1b[B+- x")) == ["up", "down", "faster", "slower", "stop", "other"]
    assert list(split("\x1b")) == ["quit"]
    assert list(split("q")) == ["quit"]
