# SPDX-License-Identifier: Apache-2.0
"""events.py: what happened waits for its reader, part by part."""

from __future__ import annotations

from control_board_ros.core.terms.events import BoardEvent, Events


def test_events_are_taken_once_oldest_first() -> None:
    events = Events()
    events.add("info", "limit", "a", "a: first")
    events.add("error", "fault", "b", "b: second")
    assert len(events) == 2
    assert events.take() == [
        BoardEvent("info", "limit", "a", "a: first"),
        BoardEvent("error", "fault", "b", "b: second"),
    ]
    assert events.take() == []
    assert len(events) == 0


def test_a_thousand_wait_at_most() -> None:
    events = Events()
    for k in range(1002):
        events.add("info", "limit", "a", str(k))
    assert [event.text for event in events.take()] == [str(k) for k in range(2, 1002)]


def test_each_part_has_its_own() -> None:
    """What belongs to no joint of a part is the board's."""
    events = Events({"a": "arm", "h": "hand"})
    for joint in ("a", "h", "", "other"):
        events.add("info", "limit", joint, joint)
    assert len(events) == 4
    assert [event.text for event in events.take("arm")] == ["a"]
    assert [event.text for event in events.take("hand")] == ["h"]
    assert [event.text for event in events.take()] == ["", "other"]
    assert events.take("arm") == []
