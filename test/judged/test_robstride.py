# SPDX-License-Identifier: Apache-2.0
"""The virtual RobStride as it is delivered, operated by robstride-dynamics."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import can
import pytest
from far_drives import far_drives, near, until
from robstride_dynamics import CommunicationType, Motor, ParameterType, RobstrideBus

PARAMETERS = [
    parameter for name, parameter in vars(ParameterType).items() if not name.startswith("_")
]


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("mit_can", model="rs02") as far:
        until(lambda: not far.drive._boots)  # its client takes the first frame for an answer
        yield far


@pytest.fixture
def bus(far: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    opened, channel = can.Bus, far.address.partition(":")[2]
    monkeypatch.setattr(
        can.interface, "Bus", lambda **_: opened(interface="virtual", channel=channel)
    )
    bus = RobstrideBus("can0", {"joint": Motor(1, "rs-02")})
    bus.connect()
    yield bus
    bus.disconnect(disable_torque=False)


def held(bus: Any, position: float) -> Any:
    """Position, velocity, torque and temperature, after a command."""
    bus.write_operation_frame("joint", position, 20.0, 1.0)
    return bus.read_operation_frame("joint")


def test_it_is_found_by_its_id(bus: Any) -> None:
    drive, number = bus.ping_by_id(1, timeout=1.0)
    assert (drive, len(number)) == (1, 8)


def test_all_its_parameters_are_read(bus: Any) -> None:
    found = {name: bus.read("joint", (index, kind, name)) for index, kind, name in PARAMETERS}
    assert all(math.isfinite(value) for value in found.values())
    assert found["VBUS"] == 48.0
    assert found["canTimeout"] == 0
    assert found["loc_kp"] == 40.0


def test_it_is_enabled_and_moves(far: Any, bus: Any) -> None:
    bus.enable("joint")
    until(lambda: near(held(bus, 0.5)[0], 0.5) and near(far.position(), 0.5))
    assert held(bus, 0.5)[3] == pytest.approx(30.0)
    bus.disable("joint")
    assert far.drive.state == 0


def test_its_watchdog_is_written_and_acts(far: Any, bus: Any) -> None:
    bus.enable("joint")
    assert far.drive.state == 1
    bus.write("joint", ParameterType.CAN_TIMEOUT, 2000)
    assert bus.read("joint", ParameterType.CAN_TIMEOUT) == 2000
    until(lambda: far.drive.state == 0)


def test_its_faults_are_understood(far: Any, bus: Any) -> None:
    with far.world.lock:
        far.drive.fail(1 << 14)
    with pytest.raises(RuntimeError, match="fault frame from joint"):
        until(lambda: False, lambda: held(bus, 0.0))


def test_a_fault_is_cleared_its_zero_set_and_it_takes_another_id(far: Any, bus: Any) -> None:
    """By its frames: it has no call for the first two, and ``write_id`` names a kind of frame that
    it does not have.
    """
    frames, one = CommunicationType, b"\x01" + bytes(7)
    with far.world.lock:
        far.drive.fail(1 << 14)
    bus.transmit(frames.DISABLE, bus.host_id, 1, one)
    until(lambda: far.drive.faults == 0)
    bus.receive()  # of the fault
    bus.enable("joint")
    until(lambda: near(held(bus, 0.3)[0], 0.3))
    bus.disable("joint")
    bus.transmit(frames.SET_ZERO_POSITION, bus.host_id, 1, one)
    until(lambda: far.drive._zero > 0.25)
    with pytest.raises(AttributeError, match="SET_CAN_ID"):
        bus.write_id("joint", 5)
    bus.transmit(frames.SET_DEVICE_ID, 5 << 8 | bus.host_id, 1)
    until(lambda: far.drive.id == 5)
