# SPDX-License-Identifier: Apache-2.0
"""The virtual Dynamixel, operated by its maker's SDK and by dynamixel-python."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from typing import Any

import pytest
from far_drives import far_drives, near, until

pytest.importorskip("dynamixel_easy_sdk", reason="dynamixel-sdk 4 is not installed")

from dxl2.v2 import BulkParams, MotorBus, SyncParams
from dynamixel_easy_sdk import Connector
from dynamixel_easy_sdk.data_types import OperatingMode
from dynamixel_easy_sdk.dynamixel_error import DxlRuntimeError
from dynamixel_sdk import COMM_SUCCESS, GroupBulkRead, GroupBulkWrite

from control_board_ros.plants.dynamixel.control_table import ROWS

BEYOND_RANGE, BAD_LENGTH, BEYOND_LIMIT, NO_ACCESS = 4, 5, 6, 7
POSITION, GOAL_POSITION = 132, 116


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("dynamixel", 2) as far:
        yield far


@pytest.fixture
def bus(far: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """With patience: its timeouts are of a real bus, not of a busy machine."""
    monkeypatch.setattr("dynamixel_sdk.port_handler.LATENCY_TIMER", 1000)
    connector = Connector(far.address, 1_000_000)
    yield connector
    connector.closePort()


@pytest.fixture
def other(far: Any) -> Iterator[Any]:
    servos = MotorBus(far.address, 1_000_000, 0.5)
    servos.connect()
    yield servos
    servos.disconnect()


def test_the_table_is_that_of_the_maker() -> None:
    """Every item of its file for this model, at its address and of its size."""
    file = files("dynamixel_easy_sdk") / "control_table" / "xm430_w350.model"
    lines = file.read_text("utf-8").partition("[control table]")[2].splitlines()[2:]
    found = {name: (int(address), int(size)) for address, size, name in
             (line.split("\t") for line in lines if line)}  # fmt: skip
    assert {name: tuple(row.item) for name, row in ROWS.items()}.items() <= found.items()
    assert {name for name in found if not name.startswith("Indirect")} == set(ROWS)


@pytest.mark.slow
def test_it_is_found_moves_and_reports(far: Any, bus: Any) -> None:
    one, two = bus.createAllMotors()
    assert (one.id, two.id, one.model_name) == (1, 2, "xm430_w350.model")
    one.setOperatingMode(OperatingMode.POSITION)
    one.enableTorque()
    one.setGoalPosition(2548)
    until(lambda: near(one.getPresentPosition(), 2548, 2))
    until(lambda: near(far.position(), 500 * 6.2832 / 4096, 0.005))  # it may swing on
    one.disableTorque()
    one.setOperatingMode(OperatingMode.VELOCITY)
    one.enableTorque()
    one.setGoalVelocity(-40)
    until(lambda: near(one.getPresentVelocity(), -40, 2))
    one.disableTorque()
    assert one.isTorqueOn() == 0


def test_current_pwm_and_bounded_position_move_it(bus: Any) -> None:
    motor = bus.createMotor(1)
    motor.setOperatingMode(OperatingMode.CURRENT)
    motor.enableTorque()
    motor.setGoalCurrent(100)
    until(lambda: motor.getPresentVelocity() > 20)
    motor.disableTorque()
    motor.setOperatingMode(OperatingMode.PWM)
    motor.enableTorque()
    motor.setGoalPWM(-300)
    until(lambda: motor.getPresentVelocity() < -20)
    motor.disableTorque()
    motor.setOperatingMode(OperatingMode.CURRENT_BASED_POSITION)
    motor.enableTorque()
    motor.setGoalCurrent(50)
    motor.setGoalPosition(2048)
    until(lambda: near(motor.getPresentPosition(), 2048, 10))


def test_a_change_of_mode_gives_all_that_the_limits_allow(bus: Any) -> None:
    """E-manual, Operating Mode: goals of PWM and of current become their limits."""
    motor = bus.createMotor(1)
    motor.setPWMLimit(400)
    motor.setCurrentLimit(300)
    motor.setOperatingMode(OperatingMode.CURRENT)
    assert bus.read2ByteData(1, 100) == 400
    assert bus.read2ByteData(1, 102) == 300


def test_limits_refuse_and_say_so(bus: Any, other: Any) -> None:
    motor = bus.createMotor(1)
    motor.setMaxPositionLimit(3000)
    motor.setVelocityLimit(100)
    motor.setPWMLimit(400)
    motor.setCurrentLimit(300)
    bus.closePort()
    before = other.read(1, GOAL_POSITION, 4).data
    for address, length, value in ((116, 4, 3001), (104, 4, 101), (100, 2, 401), (102, 2, -301)):
        answer = other.write(1, address, length, value, signed=value < 0)
        assert answer.error == BEYOND_LIMIT, address
    assert other.read(1, GOAL_POSITION, 4).data == before
    assert other.write(1, 11, 1, 7).error == BEYOND_RANGE  # no mode
    assert other.write(1, 36, 2, 886).error == BEYOND_RANGE
    assert other.write(1, POSITION, 4, 0).error == NO_ACCESS  # read only
    assert other.write(1, 116, 2, 2000).error == BAD_LENGTH
    other.write(1, 64, 1, 1)
    assert other.write(1, 11, 1, 1).error == NO_ACCESS  # stored, with torque


def test_a_read_beyond_its_table_is_refused_and_ends_nothing(other: Any) -> None:
    assert other.read(1, 1022, 4).error == NO_ACCESS
    assert other.ping(1).ok


def test_registered_writes_act_together(far: Any, other: Any) -> None:
    for drive in (1, 2):
        other.write(drive, 64, 1, 1)
        assert other.reg_write(drive, GOAL_POSITION, 4, 2300).ok
    assert other.read(1, 69, 1).data == 1
    assert other.read(1, GOAL_POSITION, 4).data == 2048
    assert other.action(1).ok
    until(lambda: near(other.read(1, POSITION, 4).data, 2300, 2))
    assert near(far.position(1), 0.0)
    assert other.action(2).ok
    until(lambda: near(other.read(2, POSITION, 4).data, 2300, 2))
    assert other.read(1, 69, 1).data == 0


def test_bulk_and_sync_packets(far: Any, bus: Any, other: Any) -> None:
    port, packets = bus._port_handler, bus._packet_handler
    for drive in (1, 2):
        bus.write1ByteData(drive, 64, 1)
    writes = GroupBulkWrite(port, packets)
    writes.addParam(2, GOAL_POSITION, 4, (2248).to_bytes(4, "little"))
    writes.addParam(1, 65, 1, b"\1")
    assert writes.txPacket() == COMM_SUCCESS
    until(lambda: near(bus.read4ByteData(2, POSITION), 2248, 2) and far.rests(1))
    reads = GroupBulkRead(port, packets)
    reads.addParam(2, POSITION, 4)  # not in the order of their ids
    reads.addParam(1, 65, 1)
    assert reads.txRxPacket() == COMM_SUCCESS
    assert near(reads.getData(2, POSITION, 4), 2248, 2)
    assert reads.getData(1, 65, 1) == 1
    bus.closePort()
    many = BulkParams()
    many.add_address(2, POSITION, 4)
    many.add_address(1, 65, 1)
    assert other.bulk_read(many).data[1] == 1
    together = SyncParams(POSITION, 4)
    for drive in (2, 1):
        together.add_motor(drive)
    assert near(other.sync_read(together).data[0], 2248, 2)


def test_an_offset_moves_what_is_read_and_what_is_asked(far: Any, bus: Any) -> None:
    motor = bus.createMotor(1)
    motor.setHomingOffset(1000)
    assert motor.getPresentPosition() == 3048
    motor.enableTorque()
    motor.setGoalPosition(3248)
    until(lambda: near(motor.getPresentPosition(), 3248, 2) and far.rests())
    assert near(far.position(), 200 * 6.2832 / 4096, 0.005)


@pytest.mark.slow
def test_it_is_cleared_reset_and_given_another_id_and_rate(far: Any, bus: Any, other: Any) -> None:
    motor = bus.createMotor(1)
    motor.changeID(7)
    assert motor.getPresentPosition() == 2048
    motor.setVelocityLimit(100)
    motor.reboot()
    until(lambda: near(answered(bus, 7), 1020))
    assert motor.getVelocityLimit() == 100
    motor.factoryResetExceptIDAndBaudRate()
    assert motor.getVelocityLimit() == 200
    far.world.state[0][0] = 10.0  # one turn and a half
    until(lambda: motor.getPresentPosition() > 8000)
    bus.closePort()
    assert other.clear_position(7).ok
    assert 0 <= other.read(7, POSITION, 4).data < 4096
    assert other.write(7, 8, 1, 2).ok  # 115,200 bit/s
    assert unanswered(other, 7)
    other.set_baudrate(115_200)
    assert other.ping(7).ok
    assert unanswered(other, 2)


def unanswered(other: Any, drive: int) -> bool:
    """Whether nothing comes; half a second of it is waited for otherwise."""
    other.conn.serial.timeout = 0.05
    found = other.ping(drive).timeout
    other.conn.serial.timeout = 0.5
    return bool(found)


def answered(bus: Any, drive: int) -> int:
    try:
        return int(bus.ping(drive))
    except DxlRuntimeError:
        return 0


@pytest.mark.slow
def test_a_fault_is_reported_and_its_watchdog_stops_it(far: Any, bus: Any) -> None:
    motor = bus.createMotor(1)
    far.drive.fail(32)
    with pytest.raises(ValueError, match="129"):  # 1 and the alert, which the SDK has no name for
        motor.enableTorque()
    with pytest.raises(ValueError, match="128"):
        motor.reboot()
    until(lambda: answered(bus, 1))
    motor.setOperatingMode(OperatingMode.VELOCITY)
    motor.enableTorque()
    bus.write1ByteData(1, 98, 5)  # 100 ms
    motor.setGoalVelocity(40)
    far.bus.drives[0].step(0.2, 0.0, 0.5)  # without a packet
    assert bus.read1ByteData(1, 98) == 255
    with pytest.raises(DxlRuntimeError):
        motor.setGoalVelocity(40)
