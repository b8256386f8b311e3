# SPDX-License-Identifier: Apache-2.0
"""A CAN bus as drivers use it, over a scripted bus."""

from __future__ import annotations

import errno
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import can
import pytest
from manual_clock import ManualClock

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives import can_line
from control_board_ros.plants.drives.can_drives import CanDrives, CanOptions
from control_board_ros.plants.drives.can_line import BUS_OFF, FLOOD, PATIENCE, CanLine
from control_board_ros.plants.drives.can_socket import MessageBus
from control_board_ros.plants.drives.clock import Clock
from control_board_ros.plants.drives.driver import Answers, Order
from control_board_ros.plants.drives.interview import Question
from control_board_ros.plants.drives.reconcile import ASK
from control_board_ros.plants.interface import Setup


def frame(number: int, data: bytes = b"", *, error: bool = False) -> Any:
    return SimpleNamespace(arbitration_id=number, data=data, is_error_frame=error)


class Bus:
    """A bus that gives what is queued, each after its time, and passes time where nothing is.

    Attributes: queue (seconds from the last one, frame or error), sent, waits (timeouts, s), fails
        (raised by the next sends), shut.
    """

    def __init__(self, clock: ManualClock) -> None:
        self._clock = clock
        self.queue: list[tuple[float, Any]] = []
        self.sent: list[Any] = []
        self.waits: list[float] = []
        self.fails: list[Exception] = []
        self.shut = 0

    def put(self, frame_id: int, data: bytes) -> None:
        self.sent.append((frame_id, data))
        if self.fails:
            raise self.fails.pop(0)

    def recv(self, timeout: float) -> Any:
        self.waits.append(timeout)
        if not self.queue or self.queue[0][0] > timeout:
            self._clock.pass_by(timeout)
            if self.queue:
                self.queue[0] = (self.queue[0][0] - timeout, self.queue[0][1])
            return None
        seconds, found = self.queue.pop(0)
        self._clock.pass_by(seconds)
        if isinstance(found, Exception):
            raise found
        return found

    def shutdown(self) -> None:
        self.shut += 1


@pytest.fixture
def line() -> Any:
    """A line that is open; its ``bus`` is scripted."""
    made = CanLine("socketcan:can0")
    made.clock = ManualClock()
    bus = Bus(made.clock)
    made.connect = lambda *_, **__: bus
    made.open()
    return made


def by_id(message: Any) -> int | None:
    return int(message.arbitration_id) if message.arbitration_id < 9 else None


def test_how_it_is_opened() -> None:
    asked: list[Any] = []
    made = CanLine("virtual:x", fd=True, bitrate=500_000)
    made.connect = lambda text, **more: asked.append((text, more))
    made.open()
    assert asked == [("virtual:x", {"fd": True, "bitrate": 500_000})]
    plain = CanLine("virtual:x")
    plain.connect = lambda text, **more: asked.append((text, more))
    plain.open()
    assert asked[1] == ("virtual:x", {"fd": False, "bitrate": 0})
    with pytest.raises(ConnectionError, match="not open"):
        CanLine("virtual:x").drain(by_id)
    assert isinstance(plain.clock, Clock)


@pytest.mark.parametrize(
    ("text", "options", "made"),
    [
        ("virtual:x", {}, {"interface": "virtual", "channel": "x"}),
        ("virtual", {}, {"interface": "virtual", "channel": None}),
        ("pcan:USB1", {"fd": True, "bitrate": 5},
         {"interface": "pcan", "channel": "USB1", "fd": True, "bitrate": 5}),
        ("virtual:x", {"fd": True},
         {"interface": "virtual", "channel": "x", "protocol": can.CanProtocol.CAN_FD}),
        ("udp_multicast:239.0.0.1:4321", {},
         {"interface": "udp_multicast", "channel": "239.0.0.1", "port": 4321}),
        ("udp_multicast:239.0.0.1", {},
         {"interface": "udp_multicast", "channel": "239.0.0.1", "port": 43113}),
        ("udp_multicast:ff15::1", {},
         {"interface": "udp_multicast", "channel": "ff15::1", "port": 43113}),
        ("socketcan:can0", {"fd": True},
         {"interface": "socketcan", "channel": "can0", "fd": True}),
    ],
)  # fmt: skip
def test_what_python_can_is_asked_for(
    text: str, options: dict[str, Any], made: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(can, "Bus", lambda **given: asked.append(given) or Mock())
    for name in ("Multicast", "SocketCan"):
        monkeypatch.setattr(can_line, name, lambda *given, **_: given)
    found = can_line.open_bus(text, **options)
    assert asked == [made]
    assert isinstance(found, MessageBus) == (made["interface"] in ("virtual", "pcan"))
    if made["interface"] == "udp_multicast":
        assert found[1:] == (made["channel"], made["port"])  # type: ignore[index]


@pytest.mark.parametrize(
    "error", [can.CanError("gone"), OSError(errno.ENODEV, "gone"), ValueError("gone")]
)
def test_a_bus_that_does_not_open_is_an_error_of_one_line(error: Exception) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    made = CanLine("socketcan:can0")
    made.connect = fail
    with pytest.raises(OSError, match="bus socketcan:can0"):
        made.open()


def test_a_full_queue_is_counted_and_any_other_error_ends_it(line: Any) -> None:
    line.send(0x123, b"\1")
    assert line.bus.sent == [(0x123, b"\1")]
    line.bus.fails = [can.CanOperationError("full", errno.ENOBUFS), OSError(errno.ENOBUFS, "full"),
                      BlockingIOError(errno.EAGAIN, "full")]  # fmt: skip
    for _ in range(4):
        line.send(1, b"")
    assert line.dropped == 3
    line.bus.fails = [OSError(errno.ENETDOWN, "down")]
    with pytest.raises(OSError, match="it is down"):
        line.send(1, b"")


@pytest.mark.parametrize("error", [can.CanError("gone"), OSError("gone")])
def test_a_bus_that_is_gone_is_an_error(line: Any, error: Exception) -> None:
    line.bus.queue = [(0.0, error)]
    with pytest.raises(OSError, match="gone"):
        line.drain(by_id)


def test_a_bus_that_is_off_is_said_and_other_error_frames_are_left_aside(line: Any) -> None:
    line.bus.queue = [(0.0, frame(1, error=True)), (0.0, frame(2))]
    taken: list[Any] = []
    line.drain(lambda found: taken.append(found.arbitration_id))
    assert taken == [2]
    line.bus.queue = [(0.0, frame(BUS_OFF | 1, error=True))]
    with pytest.raises(OSError, match="is off"):
        line.drain(by_id)
    line.bus.queue = [(0.0, frame(BUS_OFF))]  # no error frame
    line.drain(by_id)


def test_it_reads_until_all_have_answered(line: Any) -> None:
    line.begin([], by_id, [1, 2])
    line.bus.queue = [(1e-3, frame(n)) for n in (1, 40, 1, 2, 3)]
    assert line.read(line.clock.now() + 0.01)
    assert [found.arbitration_id for _, found in line.bus.queue] == [3]
    assert line.bus.waits == pytest.approx([0.0, 0.010, 0.009, 0.008, 0.007])


def test_it_reads_until_the_time_is_up(line: Any) -> None:
    line.begin([], by_id, [1, 2])
    line.bus.queue = [(1e-3, frame(1)), (1.0, frame(2))]
    begin = line.clock.now()
    assert not line.read(begin + 0.01)
    assert line.clock.now() - begin == pytest.approx(0.01)
    line.begin([], by_id, [])
    waits = len(line.bus.waits)
    assert line.read(begin + 1.0)
    assert len(line.bus.waits) == waits


@pytest.mark.parametrize("error", [False, True])
def test_a_flood_does_not_block_it(line: Any, error: bool) -> None:
    line.begin([], by_id, [1, 2])
    line.bus.queue = [(0.0, frame(40, error=error))] * 100
    line.read(line.clock.now() + 0.01)
    assert 100 - len(line.bus.queue) == 3 * FLOOD == 24


def test_what_is_late_is_read_before_frames_are_sent(line: Any) -> None:
    line.bus.queue = [(0.0, frame(1)), (1e-3, frame(2))]
    seen: list[Any] = []

    def take(found: Any) -> int | None:
        seen.append((found.arbitration_id, len(line.bus.sent)))
        return by_id(found)

    line.begin([(7, b""), (8, b"")], take, [2])
    line.read(line.clock.now() + 0.01)
    assert seen == [(1, 0), (2, 2)]


def test_a_drain_ends(line: Any) -> None:
    line.bus.queue = [(0.0, frame(1))] * 100
    line.drain(by_id)
    assert len(line.bus.queue) == 36


def test_it_collects_for_a_time(line: Any) -> None:
    line.bus.queue = [(0.02, frame(1)), (0.01, frame(2, error=True)), (0.015, frame(3)), (1.0, 4)]
    begin = line.clock.now()
    assert [found.arbitration_id for found in line.collect(0.05)] == [1, 3]
    assert line.clock.now() - begin == pytest.approx(0.05)


@pytest.mark.parametrize(("several", "answers"), [(False, [b"a"]), (True, [b"a", b"b"])])
def test_it_asks_a_question(line: Any, several: bool, answers: list[bytes]) -> None:
    line.bus.queue = [(0.0, frame(1, b"late"))]

    def put(*sent: Any) -> None:
        line.bus.sent.append(sent)
        line.bus.queue += [
            (1e-3, frame(2, b"other")), (1e-3, frame(1, b"?")), (1e-3, frame(1, b"a")),
            (1e-3, frame(1, b"b")),
        ]  # fmt: skip

    line.bus.put = put
    question = Question([(5, b"")], lambda data: data if data != b"?" else None, several)

    def said(found: Any) -> Any:
        return (found.data,) if found.arbitration_id == 1 else None

    begin = line.clock.now()
    assert line.ask(question, said) == answers
    assert len(line.bus.sent) == 1
    assert line.clock.now() - begin == pytest.approx(0.01 if several else 0.003)


def test_a_survey_asks_eight_at_a_time(line: Any) -> None:
    """A queue of ten frames, which an interface has as it comes, drops none."""
    came = list[tuple[int, float]]()

    def collect(seconds: float) -> list[Any]:
        came.append((len(line.bus.sent), seconds))
        return {1: [frame(7, b"a"), frame(8, b"?")], 3: [frame(2, b"b"), frame(7, b"c")]}.get(
            len(came), []
        )

    def question(drive: int) -> Question:
        return Question([(drive, b"who")], lambda data: data if data != b"?" else None)

    def said(drive: int, found: Any) -> Any:
        return (found.data,) if found.arbitration_id == drive else None

    line.collect = collect
    drives = [k for k in range(1, 22) if k != 3]
    assert line.survey(question, drives, said) == [(2, b"b"), (7, b"a"), (7, b"c")]
    assert line.bus.sent == [(k, b"who") for k in drives]
    assert came == [(8, 0.1 * PATIENCE), (16, 0.1 * PATIENCE), (20, PATIENCE)]


def test_it_is_closed_with_last_frames_and_twice(line: Any) -> None:
    bus = line.bus
    bus.fails = [OSError("down")]
    assert line.fileno() is None
    bus.fileno = lambda: 7
    with line as opened:
        assert opened.fileno() == 7
        opened.close([(1, b""), (2, b"")])
    assert bus.sent == [(1, b""), (2, b"")]
    line.close([(3, b"")])
    assert (bus.shut, len(bus.sent)) == (1, 2)
    with pytest.raises(ConnectionError):
        line.send(1, b"")
    with line:
        assert bus.shut == 1
    assert bus.shut == 2


def test_an_exchange_waits_for_answers_for_three_fifths_of_a_period(line: Any) -> None:
    class Plain(CanDrives[CanOptions]):
        def _frames(self, orders: Any) -> Any:
            return ((8 + k, b"") for k in orders)

        def _take(self, message: Any) -> int | None:
            return by_id(message)

    driver, asked = Plain(CanOptions.parse(("a",), {})), list[Any]()
    driver.line.clock, bus = line.clock, line.bus
    driver.line.connect = lambda text, **more: asked.append((text, more)) or bus
    driver.open(Setup(period=0.005, timeout=0.1, joints=(None,)), Answers(driver._axes))
    assert asked == [("socketcan:can0", {"fd": False, "bitrate": 0})]
    driver.exchange({0: Order(ASK, SetPoint.OFF, ())})
    assert bus.sent == [(8, b"")]
    assert bus.waits == pytest.approx([0.0, 0.003])


def test_time_passes_forwards_only(monkeypatch: pytest.MonkeyPatch) -> None:
    slept, clock = list[float](), ManualClock()
    monkeypatch.setattr("time.sleep", slept.append)
    begin = clock.now()
    for seconds in (0.25, -1.0):
        Clock().pass_by(seconds)
        clock.pass_by(seconds)
    assert (slept, clock.now() - begin) == ([0.25, 0.0], 0.25)


def test_laws_of_drives_on_can_come_with_their_goals() -> None:
    assert CanDrives.live
    with pytest.raises(NotImplementedError):
        CanDrives.set_law(None, 0, 1)  # type: ignore[arg-type]
