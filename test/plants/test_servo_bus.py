# SPDX-License-Identifier: Apache-2.0
"""The line of servos over a scripted packet handler: what is sent, and which answers are taken."""

from __future__ import annotations

import errno
from collections import deque
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from manual_clock import ManualClock

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.drives import serial_line
from control_board_ros.plants.drives.axes import Axis
from control_board_ros.plants.drives.can_line import budget
from control_board_ros.plants.drives.driver import Answers, Order
from control_board_ros.plants.drives.interview import (
    ATTEMPTS,
    PATIENCE,
    Interview,
    Question,
    converse,
)
from control_board_ros.plants.drives.reconcile import Action
from control_board_ros.plants.drives.serial_line import Item, Reply, Request, ServoBus, put
from control_board_ros.plants.drives.servo_drives import ServoDrives, ServoOptions
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.interface import Setup

LIBRARIES = [feetech.LIBRARY, dynamixel.LIBRARY]
PLACE = Item(20, 2)


class Handler:
    """A maker's packet handler, and its port.

    Attributes: replies (to the next questions, several each), pending (what is received next; None
        is a broken one), sent, waits (timeouts of the port as they were set, s).
    """

    def __init__(self, library: serial_line.Library) -> None:
        self._library = library
        self.replies = deque[list[Any]]()
        self.pending = deque[Any]()
        self.sent: list[tuple[Any, ...]] = []
        self.waits: list[float] = []
        self.wait, self.is_using, self.open, self.polls = 0.0, True, True, 0

    def packet(self, drive: int, data: bytes, error: int = 0) -> list[int]:
        head = [0] * self._library.head
        head[self._library.place], head[-1] = drive, error
        return [*head, *data, *[0] * self._library.tail]

    def _ask(self, *words: Any) -> None:
        self.sent.append(words)
        if self.replies:
            self.pending.extend(self.replies.popleft())

    def readTx(self, _port: Any, *words: Any) -> None:
        self._ask("read", *words)

    def writeTxOnly(self, _port: Any, *words: Any) -> None:
        self._ask("write", *words)

    def writeTxRx(self, _port: Any, *words: Any) -> None:
        self._ask("write, answered", *words)

    def syncWriteTxOnly(self, _port: Any, *words: Any) -> None:
        self._ask("sync write", *words)

    def syncReadTx(self, _port: Any, *words: Any) -> None:
        self._ask("sync read", *words)

    def rxPacket(self, _port: Any, *_receive: bool) -> tuple[list[int], int]:
        if not self.pending:
            return [], -6
        found = self.pending.popleft()
        return ([], -7) if found is None else (found, 0)

    def setPacketTimeout(self, _length: int) -> None:
        self.waits.append(self.wait)

    def setPacketTimeoutMillis(self, milliseconds: float) -> None:
        self.waits.append(1e-3 * milliseconds)

    def isPacketTimeout(self) -> bool:
        self.polls += 1
        return not self.pending

    def getBytesAvailable(self) -> int:
        return len(self.pending[0] or range(20)) if self.pending else 0

    def clearPort(self) -> None:
        self.pending.clear()

    def closePort(self) -> None:
        self.open = False


@pytest.fixture(params=LIBRARIES, ids=["feetech", "dynamixel"])
def bus(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ServoBus:
    slept: list[float] = []
    monkeypatch.setattr(serial_line.time, "sleep", slept.append)
    made = ServoBus(request.param, "/dev/ttyX", 1_000_000)
    made._port = made.protocol = Handler(request.param)
    made.slept = slept  # type: ignore[attr-defined]
    return made


def test_a_port_waits_for_bytes_until_its_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """The maker's own polls."""
    clock, waits, flushed = ManualClock(), list[float](), list[bool]()

    class Maker:
        def __init__(self, device: str) -> None:
            self.device = device

        def setBaudRate(self, baudrate: int) -> bool:
            if self.device == "/dev/none":
                raise OSError(errno.ENOENT, "none")
            self.ser = SimpleNamespace(fileno=lambda: 7, read=lambda most: b"12345"[:most])
            self.ser.reset_input_buffer = lambda: flushed.append(True)
            return baudrate != 7

    monkeypatch.setattr(serial_line, "time", SimpleNamespace(monotonic=clock.now))
    monkeypatch.setattr(
        serial_line, "select", SimpleNamespace(select=lambda *w: waits.append(w[3]))
    )
    port = serial_line.open_port(Maker, "/dev/ttyX", 1_000_000)
    assert (port.device, port.isPacketTimeout()) == ("/dev/ttyX", True)
    for begin, end in ((port.setPacketTimeout, 0.02), (port.setPacketTimeoutMillis, 0.003)):
        begin(3.0)
        assert not port.isPacketTimeout()
        assert port.readPort(2) == b"12"
        assert waits[-1] == pytest.approx(end)
        clock.pass_by(end + 1e-3)
        assert port.isPacketTimeout()
        assert port.readPort(9) == b"12345"
        assert waits[-1] == 0.0
    port.clearPort()
    assert flushed == [True]
    with pytest.raises(PlantSettingsError, match="baudrate=7: unknown to the library"):
        serial_line.open_port(Maker, "/dev/ttyX", 7)
    with pytest.raises(OSError, match="bus /dev/none: there is no such device"):
        serial_line.open_port(Maker, "/dev/none", 7)


def test_numbers_have_their_lowest_byte_first_and_never_wrap() -> None:
    two = Item(0, 2)
    packed = [two.pack(value) for value in (0x1234, -1, 1 << 16)]
    assert packed == [b"\x34\x12", b"\0\0", b"\xff\xff"]
    signed = [two.pack(value, signed=True) for value in (-2, 40000, -40000)]
    assert signed == [b"\xfe\xff", b"\xff\x7f", b"\x00\x80"]
    assert Request(Item(0, 1)).parse([0xFF], 3) == Reply(255, 3)
    assert Request(Item(0, 1), None, signed=True).parse([0xFF], 0) == Reply(-1, 0)


def test_a_closed_port_is_said() -> None:
    with pytest.raises(ConnectionError, match="not open"):
        _ = ServoBus(feetech.LIBRARY, "", 1_000_000).port


def test_a_value_is_read_of_the_right_servo(bus: Any) -> None:
    far = bus.protocol
    far.replies.append([far.packet(2, b"\1\1"), far.packet(1, b"\1"), far.packet(1, b"\xfe\xff")])
    assert bus.get(1, PLACE) == 0xFFFE
    assert far.sent == [("read", 1, 20, 2)]
    assert not far.is_using
    far.replies.append([far.packet(1, b"\xfe\xff")])
    assert bus.get(1, PLACE, signed=True) == -2
    assert bus.slept == []


def test_a_servo_that_does_not_answer_is_asked_again(bus: Any) -> None:
    far = bus.protocol
    with pytest.raises(ConnectionError, match="id 1 does not answer"):
        bus.get(1, PLACE)
    assert far.waits == [PATIENCE * 2**attempt for attempt in range(ATTEMPTS)]
    assert len(far.sent) == ATTEMPTS  # the first, and markers
    assert [words[2:] for words in far.sent[1:4]] == [tuple(m) for m in bus._library.markers[:3]]


def test_what_is_written(bus: Any) -> None:
    bus.put(1, PLACE, 0x1234)
    bus.sync(PLACE, {1: b"\1\2", 2: b"\3\4"})
    bus.sync(PLACE, {})
    assert bus.protocol.sent == [
        ("write, answered", 1, 20, 2, [0x34, 0x12]),
        ("sync write", 20, 2, [1, 1, 2, 2, 3, 4], 6),
    ]


@pytest.mark.parametrize(("error", "refused"), [(0, False), (0x80, False), (0x84, True)])
def test_a_write_that_is_refused_is_said(error: int, refused: bool) -> None:
    def written() -> Any:
        return converse(put(3, PLACE, 5, 0x7F), lambda _: [Reply(5, error)])

    if not refused:
        written()
        return
    with pytest.raises(ConnectionError, match=r"id 3: 5 is refused at address 20 \(error 4\)"):
        written()


def asked(request: Request | tuple[()], **changes: Any) -> Interview[Any]:
    def questions() -> Any:
        question = Question(request, lambda reply: reply, patience=0.03)
        return (yield replace(question, **changes))

    return Interview(questions(), 0.0)


def heard(held: Interview[Any]) -> list[Any]:
    return [(reply.value, reply.error) for reply in held._answers]


def test_the_question_of_an_interview_is_asked_once(bus: Any) -> None:
    far = bus.protocol
    bus.hold(1, None, 0.01)
    bus.hold(1, asked(()), 0.01)
    done = asked(Request(PLACE))
    done.asks = False
    bus.hold(1, done, 0.01)
    assert far.sent == []
    far.replies.append([far.packet(1, b"\1"), far.packet(1, b"\5\0", 2), far.packet(1, b"\6\0")])
    held = asked(Request(PLACE))
    bus.hold(1, held, 0.01)
    assert heard(held) == [(5, 2)]
    assert far.waits[-1] == 0.01
    far.pending.clear()
    bus.hold(1, asked(Request(PLACE)), 0.0)
    assert far.waits[-1] == 0.03


def test_a_write_of_an_interview_is_heard_by_its_empty_answer(bus: Any) -> None:
    far = bus.protocol
    far.replies.append([far.packet(1, b"\5\0"), far.packet(1, b"", 4)])
    held = asked(Request(PLACE, 7))
    bus.hold(1, held, 0.01)
    assert heard(held) == [(7, 4)]
    held = asked(Request(PLACE, -2))
    bus.hold(1, held, 0.01)
    assert [words[-1] for words in far.sent] == [[7, 0], [0xFE, 0xFF]]
    assert heard(held) == []


def test_a_second_servo_is_heard_where_several_may_answer(bus: Any) -> None:
    far = bus.protocol
    answers = [far.packet(1, b"\1\0"), far.packet(1, b"\2"), far.packet(1, b"\3\0")]
    for several, found in ((True, [1, 3]), (False, [1])):
        far.pending.clear()
        far.replies.append([*answers, far.packet(1, b"\4\0")])
        held = asked(Request(PLACE), several=several)
        bus.hold(1, held, 0.01)
        assert [value for value, _ in heard(held)] == found


def test_after_an_answer_that_did_not_come_a_marker_is_read(bus: Any) -> None:
    far = bus.protocol
    bus.hold(1, asked(Request(PLACE)), 0.01)
    held = asked(Request(PLACE))
    bus.hold(1, held, 0.01)
    first, second = (tuple(marker) for marker in bus._library.markers[:2])
    assert [words[2:] for words in far.sent] == [(20, 2), first]
    far.replies.extend([[far.packet(1, bytes(second[1]))], [far.packet(1, b"\1\0")]])
    bus.hold(1, held, 0.01)
    assert [words[2:] for words in far.sent[2:]] == [second, (20, 2)]
    assert heard(held) == [(1, 0)]
    far.replies.append([far.packet(1, b"\1\0")])
    bus.hold(1, asked(Request(PLACE)), 0.01)
    assert len(far.sent) == 5  # it is in step


def test_it_reads_several_together(bus: Any) -> None:
    far, found = bus.protocol, dict[int, bytes]()
    far.replies.append([far.packet(2, b"\2"), None, far.packet(1, b"\1"), far.packet(3, b"\3")])
    bus.read(PLACE, [1, 2], found.__setitem__, 0.01)
    assert found == {2: b"\2", 1: b"\1"}
    assert far.sent == [("sync read", 20, 2, [1, 2], 2, *bus._library.receive)]
    assert (far.waits, len(far.pending), far.polls, far.is_using) == ([0.01], 1, 1, False)
    bus.read(PLACE, [3, 4], found.__setitem__, 0.01)
    assert found[3] == b"\3"
    assert far.polls == 2


def test_what_is_pending_is_drained(bus: Any) -> None:
    far, found = bus.protocol, list[Any]()
    far.pending += [far.packet(1, b"\1\2"), far.packet(2, b""), None, far.packet(3, b"")]
    bus.drain(lambda drive, data: found.append((drive, data)))
    assert found == [(1, b"\1\2"), (2, b"")]
    assert far.waits == [0.0]
    far.pending = deque([[0] * (bus._library.head + bus._library.tail - 1)])
    bus.drain(lambda *_: found.append("short"))
    assert len(found) == 2


def test_models_are_counted(bus: Any) -> None:
    far = bus.protocol
    one = far.packet(1, b"\x09\x03")
    assert bus.models(1, attempts=2) == []
    assert bus.slept == [0.0, serial_line.PATIENCE]
    far.pending.append(one)  # a late one is dropped
    far.replies.append([far.packet(1, b"\1"), one])
    assert bus.models(1) == [777]
    far.replies.extend([[one, one, one]] * 2)
    assert bus.models(1, attempts=2) == [777, 777]
    far.replies.extend([[one, one], [one]])
    assert bus.models(1, attempts=3) == [777]
    far.replies.extend([[one, one], []])
    assert bus.models(1, attempts=2) == [777, 777]


def test_a_servo_that_is_to_get_an_id_is_looked_for_three_times(bus: Any) -> None:
    with pytest.raises(OSError, match="id 1"):
        bus.set_id(1, 5, range(10), Item(5, 1))
    assert [words[1] for words in bus.protocol.sent] == [1] * 3


def test_a_servo_is_unlocked_while_it_stores_its_id(bus: Any) -> None:
    far = bus.protocol
    one, two = far.packet(1, b"\x09\x03"), far.packet(5, b"\x09\x03")
    far.replies.extend([[one], [], [], [], [far.packet(1, b"\0")], [], [], [two]])
    bus.set_id(1, 5, range(10), Item(5, 1), Item(55, 1))
    written = [words[1:] for words in far.sent if words[0] == "write, answered"]
    assert written == [(1, 55, 1, [0]), (1, 5, 1, [5]), (5, 55, 1, [1])]


def test_it_is_open_within_with() -> None:
    far, asked = Handler(feetech.LIBRARY), list[Any]()
    made = ServoBus(feetech.LIBRARY, "/dev/ttyX", 57_600)
    made.connect = lambda *words: asked.append(words[1:]) or far
    with made as opened:
        assert opened.port is far
        assert far.wait == serial_line.PATIENCE
        assert far.open
    assert asked == [("/dev/ttyX", 57_600)]
    assert not far.open


def test_it_ends_without_torque_and_twice(bus: Any) -> None:
    far = bus.protocol
    far.axes = [type("Axis", (), {"id": number}) for number in (4, 5)]
    bus.close(far.axes)
    torque = bus._library.torque
    assert far.sent == [("sync write", *torque, [4, 0, 5, 0], 4)]
    assert not far.open
    bus.close(far.axes)
    assert len(far.sent) == 1
    broken = ServoBus(feetech.LIBRARY, "", 1_000_000)
    broken._port, broken.protocol = far, None
    far.open = True
    with pytest.raises(AttributeError):
        broken.close(far.axes)
    assert not far.open


AXES = (Axis(name="a", id=1), Axis(name="b", id=2))
PERIOD = 0.01


class Servos(ServoDrives[ServoOptions]):
    """A make whose bus only notes what it is told."""

    library, driver, models, laws, length = feetech.LIBRARY, "made", {777: "made"}, {}, 2

    def __init__(self) -> None:
        super().__init__(ServoOptions(axes=AXES))
        self.line: Any = Noted()
        self.open(Setup(period=PERIOD, timeout=0.1, joints=(None, None)), Answers(AXES))

    def _reset(self, k: int) -> None: ...

    def _goals(self, orders: Any) -> None: ...

    def _read(self, orders: Any) -> None:
        self.line.told.append(("read", [*orders]))

    def _parse(self, k: int, data: bytes) -> None: ...


class Noted:
    """A ServoBus that notes what it is told."""

    def __init__(self) -> None:
        self.told: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *words: self.told.append((name, *words))


def told(*actions: Action) -> list[Any]:
    servos = Servos()
    servos.exchange({k: Order(one, SetPoint.OFF, ()) for k, one in enumerate(actions)})
    return [words for words in servos.line.told if words[0] not in ("open", "sync")]


def test_late_answers_are_taken_before_servos_are_read() -> None:
    drained, *others = told(Action.OFF, Action.OFF)
    assert drained[0] == "drain"
    assert [words[0] for words in others] == ["read", "hold", "hold"]


@pytest.mark.parametrize(
    ("actions", "seconds"),
    [
        ((Action.OFF, Action.SET_UP), 0.0),
        ((Action.GOAL, Action.SET_UP), budget(PERIOD)),
        ((Action.CONFIRM, Action.GOAL), budget(PERIOD)),
    ],
)
def test_a_question_has_its_own_patience_where_no_servo_is_to_have_power(
    actions: tuple[Action, Action], seconds: float
) -> None:
    holds = [words for words in told(*actions) if words[0] == "hold"]
    assert holds == [("hold", 1, None, seconds), ("hold", 2, None, seconds)]


def test_two_servos_with_one_id_are_no_model() -> None:
    def answers(question: Question) -> list[Reply]:
        return [Reply(777, 0)] * (2 if question.several else 1)

    with pytest.raises(ConnectionError, match="a: two drives answer as id 1"):
        converse(Servos()._model(0), answers)
    one = converse(Servos()._model(0), lambda _: [Reply(777, 0)])
    assert one == 777


def test_servos_are_left_without_torque() -> None:
    servos = Servos()
    servos.close()
    assert servos.line.told[-1] == ("close", AXES)
