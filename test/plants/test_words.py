# SPDX-License-Identifier: Apache-2.0
"""What all makes say and hear in the same form: faults by number and name, ids of frames."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from control_board_ros.plants.drives import faults
from control_board_ros.plants.drives.can_frame import EXTENDED, REMOTE, message
from control_board_ros.plants.drives.driver import ONE_TURN, Identity
from control_board_ros.plants.interface import DriveFault

NAMES = {1: "hot", 2: "stuck", 4: "lost"}


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda: faults.coded(2, NAMES), "2 stuck"),
        (lambda: faults.coded(9, NAMES), "9 see its manual"),
        (lambda: faults.flagged(5, NAMES), "5 hot, lost"),
        (lambda: faults.flagged(8, NAMES), "8 see its manual"),
        (lambda: faults.flagged(0, NAMES), "None"),
        (lambda: faults.WATCHDOG, "watchdog: no command within its timeout"),
        (lambda: faults.RESTARTED, "drive restarted"),
        (lambda: DriveFault(faults.UNCONFIRMED, "keeps its power"), "keeps its power"),
    ],
)
def test_a_fault_has_number_and_name(made: Callable[[], DriveFault | None], text: str) -> None:
    """S6: its maker's number; 0 where it has none."""
    assert str(made()) == text


@pytest.mark.parametrize(
    ("given", "on_the_bus", "long", "remote"),
    [
        (0x7FF, 0x7FF, False, False),
        (0x800, 0x800, True, False),
        (0x12 | EXTENDED, 0x12, True, False),
        (0x12 | REMOTE, 0x12, False, True),
        (0x800 | REMOTE, 0x800, True, True),
    ],
)
def test_an_id_has_the_bits_that_it_needs(
    given: int, on_the_bus: int, long: bool, remote: bool
) -> None:
    """An id of 11 bits goes with 29 where it is marked so, as RobStride's private ones are."""
    for fd in (False, True):
        made = message(given, b"\1", fd=fd)
        flags = made.is_extended_id, made.is_remote_frame, made.is_fd, made.bitrate_switch
        assert (made.arbitration_id, *flags) == (on_the_bus, long, remote, fd, fd)


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (0.0, "absolute"),
        (ONE_TURN, "one turn"),
        (0.1 * ONE_TURN, "0.1 turns"),
        (3.0 * ONE_TURN, "3 turns"),
        (math.inf, "lost"),
        (math.nan, "not reported"),
    ],
)
def test_how_a_zero_survives_is_said_in_turns(turn: float, words: str) -> None:
    """S9: by the output of the drive."""
    assert Identity(id=1, type="x", turn=turn).zero == words
