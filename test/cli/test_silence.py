# SPDX-License-Identifier: Apache-2.0
"""A recorder without messages reports it."""

from __future__ import annotations

from control_board_ros.cli.board.recordings import Silence


def test_a_silence_is_reported_once() -> None:
    """After five seconds; and again when it comes back later."""
    silence = Silence(100.0)
    assert silence.update(10, 101.0) == ""
    assert silence.update(10, 105.9) == ""
    assert silence.update(10, 106.0).startswith(
        "nothing received for 5 s, although the board is there"
    )
    assert silence.update(10, 200.0) == ""
    assert silence.update(11, 201.0) == ""
    assert silence.update(11, 206.0) != ""


def test_a_silence_from_the_start_is_reported() -> None:
    assert Silence(0.0).update(0, 5.0) != ""
