# SPDX-License-Identifier: Apache-2.0
"""The line of servos: answers that come late, and name no question."""

from __future__ import annotations

from collections import deque
from types import SimpleNamespace
from typing import Any

import pytest

from control_board_ros.plants.drives import serial_line
from control_board_ros.plants.drives.interview import Interview, Questions
from control_board_ros.plants.drives.serial_line import Item, ServoBus, get
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.feetech import table as feetech

TABLE = bytes(range(100, 200))
ITEMS = [Item(10, 2), Item(20, 2), Item(30, 2), Item(40, 1), Item(50, 1)]


def value(item: Item) -> int:
    return int.from_bytes(TABLE[item.address : item.address + item.length], "little")


class Lagging:
    """A maker's packet handler of a servo some of whose answers come with the next question."""

    def __init__(self, late: set[int], library: serial_line.Library) -> None:
        self.late, self.asked = late, 0
        self.held, self.pending = deque[bytes](), deque[bytes]()
        self.head, self.tail, self.place = library.head, library.tail, library.place

    def readTx(self, _port: Any, _drive: int, address: int, length: int) -> int:
        self.asked += 1
        self.pending += self.held
        self.held.clear()
        (self.held if self.asked in self.late else self.pending).append(
            TABLE[address : address + length]
        )
        return 0

    def rxPacket(self, _port: Any, *_receive: bool) -> tuple[list[int], int]:
        if not self.pending:
            return [], -6
        head = [0] * self.head
        head[self.place] = 1
        return [*head, *self.pending.popleft(), *[0] * self.tail], 0


def bus_of(late: set[int], library: serial_line.Library) -> ServoBus:
    bus = ServoBus(library, "", 1_000_000)
    bus.protocol = Lagging(late, library)
    bus._port = SimpleNamespace(wait=0.0, setPacketTimeout=lambda _: None, clearPort=lambda: None)
    return bus


def all_of(items: list[Item]) -> Questions[list[int]]:
    found = []
    for item in items:
        found.append((yield from get(1, item)))
    return found


@pytest.mark.parametrize("library", [feetech.LIBRARY, dynamixel.LIBRARY])
@pytest.mark.parametrize("late", [{n} for n in range(1, 8)] + [{1, 2}, {1, 3}, {2, 4}])
def test_a_late_answer_is_not_that_to_the_next_question(
    late: set[int], library: serial_line.Library
) -> None:
    """S8: of an interview, of which each exchange asks once."""
    bus, interview, now = bus_of(late, library), Interview(all_of(ITEMS), 0.0), 0.0
    while not interview.advance(now):
        bus.hold(1, interview, 0.01)
        now += 0.002
        assert now < 1.0
    assert interview.result == [value(item) for item in ITEMS]


@pytest.mark.parametrize("late", [1, 2, 3])
def test_a_late_answer_is_not_that_to_the_next_read(
    late: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S8: of the commands that read one item after the other."""
    monkeypatch.setattr(serial_line.time, "sleep", lambda _: None)
    bus = bus_of({late}, feetech.LIBRARY)
    assert [bus.get(1, item) for item in ITEMS] == [value(item) for item in ITEMS]


@pytest.mark.parametrize("library", [feetech.LIBRARY, dynamixel.LIBRARY])
@pytest.mark.parametrize("before", [b"", bytes(38), bytes(1)], ids=["write", "longer", "shorter"])
def test_an_answer_of_another_length_is_not_cut_to_that_of_the_question(
    before: bytes, library: serial_line.Library
) -> None:
    """S8: the library cuts it; all readings of a servo began with its "model" of 5120."""
    bus = bus_of(set(), library)
    bus.protocol.pending.append(before)
    assert bus.get(1, ITEMS[0]) == value(ITEMS[0])
    bus.protocol.pending.append(before)
    assert bus.models(1) == [value(library.model)]
