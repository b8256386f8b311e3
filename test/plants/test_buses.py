# SPDX-License-Identifier: Apache-2.0
"""Several buses as one plant: in parallel, without waiting for late ones."""

from __future__ import annotations

import select
import socket
import threading
import time

import numpy as np
import pytest

from control_board_ros.core.terms.drives import DriveReport
from control_board_ros.core.terms.measurement import VALUES, SetPoints, Value
from control_board_ros.plants import Description, DriveFault, JointDescription, Readings, SetPoint
from control_board_ros.plants.buses import Buses
from control_board_ros.plants.interface import Setup
from control_board_ros.testing.plant_contract import plant_contract


class Servos:
    """Joints that are at their set-points.

    Attributes: gate (an exchange waits for it), asked (positions of each exchange), fault.
    """

    def __init__(self, *names: str) -> None:
        joints = tuple(
            JointDescription(name=name, set_points=(SetPoint.POSITION,)) for name in names
        )
        self.description = Description(joints=joints, rate=500.0)
        self.position = np.zeros(len(names))
        self.gate = threading.Event()
        self.gate.set()
        self.asked: list[list[float]] = []
        self.fault: DriveFault | None = None
        self.trouble: Exception | None = None
        self.went = self.cleared = -1
        self.voltage: np.ndarray | None = None
        self.dropped: np.ndarray | None = None
        self.drives: list[DriveReport] | None = None

    def describe(self):
        return self.description

    def connect(self, setup):
        assert len(setup.joints) == len(self.position)

    def exchange(self, wanted):
        self.gate.wait()
        if self.trouble is not None:
            raise self.trouble
        self.asked.append(wanted.position.tolist())
        self.position = np.where(wanted.powered, wanted.position, self.position)
        return Readings(
            position=self.position.copy(),
            voltage=self.voltage,
            dropped=self.dropped,
            drives=self.drives,
            faults=[self.fault] * len(self.position),
        )

    def clear_fault(self, joint):
        self.cleared = joint

    def let_go(self):
        self.went += 1

    def close(self):
        self.gate.set()


def at(*positions: float) -> SetPoints:
    n = len(positions)
    values = np.zeros((VALUES, n))
    values[Value.POSITION] = positions
    return SetPoints(np.full(n, SetPoint.POSITION, dtype=np.int8), values, np.ones(n))


@pytest.fixture
def three():
    servos = [Servos("a", "b"), Servos("c"), Servos("d", "e", "f")]
    buses = Buses(servos)
    buses.connect(Setup(period=2e-3, timeout=0.1, joints=(None,) * 6))
    yield servos, buses
    for one in servos:
        one.gate.set()
    buses.close()


def test_all_buses_have_their_own_joints(three) -> None:
    """Each its columns, in one exchange."""
    servos, buses = three
    assert [joint.name for joint in buses.describe().joints] == list("abcdef")
    found = buses.exchange(at(1, 2, 3, 4, 5, 6))
    assert found.position.tolist() == [1, 2, 3, 4, 5, 6]
    assert servos[2].asked == [[4, 5, 6]]
    assert found.ages.tolist() == [0.0] * 6


def test_motor_readings_of_one_bus_are_kept(three) -> None:
    """Y5: the joints of the others have NaN there."""
    servos, buses = three
    assert buses.exchange(at(*[0.0] * 6)).voltage is None
    servos[1].voltage = np.array([24.0])
    found = until(buses, lambda found: found.voltage is not None).voltage  # its bus may be late
    assert np.isnan(found).tolist() == [True, True, False, True, True, True]
    assert found[2] == 24.0


def test_dropped_frames_of_one_bus_are_kept(three) -> None:
    """S11: none were dropped of the joints of the others."""
    servos, buses = three
    assert buses.exchange(at(*[0.0] * 6)).dropped is None
    servos[1].dropped = np.array([4.0])
    found = until(buses, lambda found: found.dropped is not None)  # its bus may be late
    assert found.dropped.tolist() == [0.0, 0.0, 4.0, 0.0, 0.0, 0.0]


def test_what_drives_report_is_kept_by_bus(three) -> None:
    """A bus that has nothing new is as before; what was late by its thread counts with its own."""
    servos, buses = three
    servos[0].drives = [DriveReport(power=True), DriveReport()]
    found = until(buses, lambda found: found.drives is not None)
    assert [one.power for one in found.drives] == [True, None, None, None, None, None]
    servos[0].drives, servos[1].drives = None, [DriveReport(law="8 CSP", late=3)]
    found = until(buses, lambda found: found.drives and found.drives[2].law)
    assert found.drives[0].power is True
    assert found.drives[2].late == 3 + buses.late[1]


def test_a_late_bus_is_not_waited_for_and_its_answer_is_used_next(three) -> None:
    """Counted; the others continue; set-points that it missed are skipped."""
    servos, buses = three
    buses.exchange(at(*[0.0] * 6))
    servos[1].gate.clear()
    for k in range(1, 4):
        found = buses.exchange(at(*[float(k)] * 6))
        assert found.position[2] == 0.0
        assert found.ages[2] > 0.0
    assert buses.late[1] >= 3
    while found.position[3] != 3.0:  # a busy machine is late, too
        found = buses.exchange(at(*[3.0] * 6))
    servos[1].gate.set()
    while found.position[2] != 3.0:
        found = buses.exchange(at(*[3.0] * 6))
    assert servos[1].asked[:2] == [[0.0], [1.0]]
    assert 2.0 not in [asked[0] for asked in servos[1].asked]


def test_faults_belong_to_the_joints_of_their_bus(three) -> None:
    """S6: with number and name, of no other bus."""
    servos, buses = three
    servos[1].fault = DriveFault(33, "over-voltage")
    found = buses.exchange(at(*[0.0] * 6))
    while not any(found.faults):
        found = buses.exchange(at(*[0.0] * 6))
    assert [str(fault or "") for fault in found.faults] == ["", "", "33 over-voltage", "", "", ""]
    buses.clear_fault(4)
    until(buses, lambda _: servos[2].cleared == 1)
    assert (servos[0].cleared, servos[1].cleared, servos[2].cleared) == (-1, -1, 1)


def until(buses: Buses, reached) -> Readings:
    """Exchange until something is so."""
    for _ in range(10_000):
        if reached(found := buses.exchange(at(*[0.5] * 6))):
            return found
    raise AssertionError(found)


def test_a_bus_that_raises_takes_no_other_down(three) -> None:
    """S10, B3: its joints have the reason; it is connected again, without power, by itself."""
    servos, buses = three
    until(buses, lambda found: not any(found.faults))
    servos[0].trouble = OSError("bus off")
    found = until(buses, lambda found: any(found.faults))
    assert found.faults == ["bus off"] * 2 + [None] * 4
    before = len(servos[1].asked)
    for _ in range(50):
        assert buses.exchange(at(*[0.5] * 6)).faults[2:] == [None] * 4
    assert len(servos[1].asked) > before
    assert servos[0].went >= 0  # it let its motors go, and tries again
    asked = len(servos[0].asked)
    servos[0].trouble = None
    found = until(buses, lambda found: not any(found.faults))
    assert servos[0].asked[asked] == [0.0, 0.0]


def test_a_bus_that_cannot_be_opened_leaves_the_others(three) -> None:
    """S10: at the start, too; all of them: the reason."""
    servos, buses = three
    setup = Setup(period=2e-3, timeout=0.1, joints=(None,) * 6)
    connect = servos[1].connect
    servos[1].connect = lambda _: (_ for _ in ()).throw(OSError("no such bus"))
    buses.connect(setup)
    found = buses.exchange(at(*[0.5] * 6))
    assert found.faults == [None] * 2 + ["no such bus"] + [None] * 3
    assert np.isnan(found.position).tolist() == [False] * 2 + [True] + [False] * 3
    servos[1].connect = connect
    until(buses, lambda found: not any(found.faults))
    for one in servos:
        one.connect = lambda _: (_ for _ in ()).throw(OSError("no such bus"))
    with pytest.raises(OSError, match="no such bus"):
        buses.connect(setup)


def test_clearing_a_fault_waits_for_no_bus(three) -> None:
    """S10: one that hangs."""
    servos, buses = three
    until(buses, lambda found: not any(found.faults))
    servos[1].gate.clear()
    buses.exchange(at(*[0.5] * 6))
    buses.clear_fault(2)
    before = len(servos[2].asked)
    until(buses, lambda _: len(servos[2].asked) > before + 5)
    assert servos[1].cleared == -1
    servos[1].gate.set()
    until(buses, lambda _: servos[1].cleared == 0)


def test_all_buses_are_let_go(three) -> None:
    """B5."""
    servos, buses = three
    buses.let_go()
    assert [one.went for one in servos] == [0, 0, 0]


class Polled(Servos):
    """Servos whose answers come by a socket; see ``buses.Polled``.

    Attributes: far (sends an answer for each joint), missing (answers that are awaited), fails
        (the part of an exchange that raises).
    """

    def __init__(self, *names: str) -> None:
        super().__init__(*names)
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.near.setblocking(False)
        self.missing, self.fails, self.silent = 0, "", False
        self.threads: set[int] = set()

    def fileno(self):
        return self.near.fileno()

    def _do(self, part):
        self.threads.add(threading.get_ident())
        if self.fails == part:
            raise OSError(part)

    def begin(self, wanted):
        self._do("begin")
        self.wanted, self.missing = wanted, len(self.position)
        for _ in range(0 if self.silent else self.missing):
            self.far.send(b"answer")

    def read(self, end):
        self._do("read")
        while self.missing:
            try:
                self.near.recv(9)
            except BlockingIOError:
                if not select.select([self.near], [], [], max(0.0, end - time.monotonic()))[0]:
                    return False
                continue
            self.missing -= 1
        return True

    def finish(self):
        self._do("finish")
        return self.exchange(self.wanted)

    def close(self):
        super().close()
        self.near.close()
        self.far.close()


@pytest.fixture
def polled():
    servos = [Polled("a", "b"), Polled("c"), Servos("d", "e", "f")]
    buses = Buses(servos)
    buses.connect(Setup(period=0.2, timeout=1.0, joints=(None,) * 6))
    yield servos, buses
    buses.close()


def test_buses_with_sockets_share_the_loop_of_the_caller(polled) -> None:
    """Set-points to all, then what arrives on any; a bus without one has a thread beside it."""
    servos, buses = polled
    found = until(buses, lambda found: not any(found.faults))
    assert found.position.tolist() == [0.5] * 6
    assert servos[0].threads == servos[1].threads == {threading.get_ident()}
    assert servos[0].missing == servos[1].missing == 0
    buses.clear_fault(2)
    buses.exchange(at(*[0.5] * 6))
    assert servos[1].cleared == 0


def test_a_bus_whose_drives_are_silent_is_waited_for_once(polled) -> None:
    """S10: the others have their answers, and its readings are as it judges them."""
    servos, buses = polled
    servos[0].silent = True
    found = buses.exchange(at(1, 2, 3, 4, 5, 6))
    assert found.position[:3].tolist() == [1.0, 2.0, 3.0]
    assert (servos[0].missing, servos[1].missing) == (2, 0)


def test_a_bus_that_was_waited_for_in_vain_is_read_last(polled) -> None:
    """S10: the others are judged before; once it has answered it has its place again."""
    servos, buses = polled
    order: list[int] = []
    for k, one in enumerate(servos[:2]):
        one.read = lambda end, k=k, read=one.read: order.append(k) or read(end)
    for silent in (True, False, False):
        servos[0].silent = silent
        buses.exchange(at(*[0.5] * 6))
    assert order == [0, 1, 1, 0, 0, 1]


@pytest.mark.parametrize("part", ["begin", "read", "finish"])
def test_a_socket_that_raises_takes_no_other_down(polled, part: str) -> None:
    """S10, B3: it is connected again by its own thread."""
    servos, buses = polled
    servos[0].fails = part
    found = buses.exchange(at(*[0.5] * 6))
    assert found.faults[:3] == [part] * 2 + [None]
    servos[0].fails = ""
    until(buses, lambda found: not any(found.faults))
    assert servos[0].went >= 0


test_buses_keep_the_contract = plant_contract(lambda: Buses([Servos("a", "b"), Servos("c")]))
