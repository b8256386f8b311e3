# SPDX-License-Identifier: Apache-2.0
"""faults.py: what is kept of a fault (SPEC F3, F5); events wait for their reader, part by part."""

from __future__ import annotations

from control_board_ros.core.terms.faults import BoardEvent, Cause, Events, FaultCode, FaultRecord


def test_a_record_that_is_cleared_stays_readable() -> None:
    """F5."""
    none = FaultRecord("a")
    assert (none.active, none.code, none.text, none.stamp) == (False, -1, "no fault", 0.0)
    fault = FaultRecord("a", active=True, code=1, text="hot", stamp=2.0)
    assert fault.cleared() == FaultRecord("a", active=False, code=1, text="hot", stamp=2.0)


def test_faults_that_time_alone_does_not_clear() -> None:
    cause = Cause(FaultCode.PLANT, "gone")
    assert (cause.advice, cause.wait) == ("remove it", 0.0)


def test_events_are_taken_once_oldest_first() -> None:
    events = Events()
    events.add("info", "limit", "a", "a: first")
    events.add("error", "fault", "b", "b: second")
    assert events.take() == [
        BoardEvent("info", "limit", "a", "a: first"),
        BoardEvent("error", "fault", "b", "b: second"),
    ]
    assert events.take() == []


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
    assert [event.text for event in events.take("arm")] == ["a"]
    assert [event.text for event in events.take("hand")] == ["h"]
    assert [event.text for event in events.take()] == ["", "other"]
    assert events.take("arm") == []
