# SPDX-License-Identifier: Apache-2.0
"""The virtual ODrive, operated by odrive-can."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import can
import pytest
from far_drives import far_drives, near
from far_drives import until as waiting
from odrive_can.odrive import ODriveCAN


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("odrive_can") as far:
        yield far


def talk(far: Any, said: Callable[[Any], Coroutine[Any, Any, Any]]) -> Any:
    """A conversation that begins with the first heartbeat, which nobody asks for."""

    async def run() -> Any:
        with can.Bus(interface="virtual", channel=far.address.partition(":")[2]) as bus:
            drive = ODriveCAN(1, bus)
            await asyncio.wait_for(drive.start(), 30.0)
            try:
                return await said(drive)
            finally:
                drive.stop()

    return asyncio.run(run())


async def until(reached: Callable[[], Coroutine[Any, Any, bool]]) -> None:
    for _ in range(500):
        if await reached():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("it never came")


async def at(drive: Any, revolutions: float) -> bool:
    estimates = await drive._request("Get_Encoder_Estimates", 10.0)
    return near(estimates["Pos_Estimate"], revolutions, 0.01)


def test_it_is_enabled_moves_and_is_read(far: Any) -> None:
    async def said(drive: Any) -> Any:
        drive.set_controller_mode("POSITION_CONTROL", "PASSTHROUGH")
        drive.set_axis_state_no_wait("CLOSED_LOOP_CONTROL")
        drive.set_input_pos(0.25)
        await until(lambda: at(drive, 0.25))

        async def has_voltage() -> bool:  # it may take a late estimate for the answer
            return 24.0 in (await drive._request("Get_Bus_Voltage_Current", 10.0)).values()

        await until(has_voltage)

    talk(far, said)
    assert near(far.position(), 0.25 * 6.2832, 0.06)
    assert far.drive.state == 1  # its stop


def test_its_estimates_come_unasked(far: Any) -> None:
    """As delivered, every 10 ms."""
    came = []

    async def said(drive: Any) -> None:
        drive.feedback_callback = lambda message, _: came.append(message.data["Pos_Estimate"])

        async def enough() -> bool:
            return len(came) > 5

        await until(enough)

    talk(far, said)
    assert came[0] == pytest.approx(0.0, abs=1e-3)


def test_limits_and_gains_are_set(far: Any) -> None:
    async def said(drive: Any) -> None:
        drive.set_limits(3.0, 5.0)
        drive.set_pos_gain(7.0)
        drive.set_vel_gains(2.0, 0.5)

        async def taken() -> bool:
            return far.drive.velocity_gain == 2.0

        await until(taken)

    talk(far, said)
    assert far.drive.position_gain == 7.0
    assert far.drive.integrator_gain == 0.5
    assert sorted(far.drive.conf.values())[-2:] == [3.0, 5.0]


def test_it_is_found_addressed_and_stored(far: Any) -> None:
    """As the maker's can_enumerate.py does it: ask all, address by serial number, save."""
    drive = far.drive
    with can.Bus(interface="virtual", channel=far.address.partition(":")[2]) as bus:

        def send(node: int, command: int, data: bytes = b"", *, remote: bool = False) -> None:
            name = node << 5 | command
            bus.send(can.Message(arbitration_id=name, is_extended_id=False, data=data,
                                 is_remote_frame=remote))  # fmt: skip

        send(0x3F, 0x06, remote=True)
        found = next(m for m in iter(lambda: bus.recv(10.0), None) if m.arbitration_id & 31 == 6)
        assert (found.data[0], bytes(found.data[1:7])) == (1, drive.serial.to_bytes(6, "little"))
        send(0x3F, 0x06, bytes([9]) + found.data[1:7])
        waiting(lambda: drive.id == 9)
        send(9, 0x16, b"\0")
        waiting(lambda: drive.id == 1)  # it was not stored
        send(0x3F, 0x06, bytes([9]) + found.data[1:7])
        send(9, 0x16, b"\1")
        send(9, 0x16, b"\0")
        send(0x3F, 0x06, bytes([9]) + bytes(6))
        waiting(lambda: drive.id == 0x3F)  # another wants it
        drive.reboot()
        assert drive.id == 9


def test_a_write_is_confirmed_and_saved(far: Any) -> None:
    """As can_restore_config.py: written, confirmed without a value, read back, saved."""
    drive, name = far.drive, "axis0.controller.config.vel_limit"
    with can.Bus(interface="virtual", channel=far.address.partition(":")[2]) as bus:

        def answer(data: bytes) -> bytes:
            bus.send(can.Message(arbitration_id=1 << 5 | 4, is_extended_id=False, data=data))
            came = iter(lambda: bus.recv(10.0), None)
            return bytes(next(m for m in came if m.arbitration_id == 1 << 5 | 5).data)

        assert answer(struct.pack("<BHBf", 1, 384, 0, 3.5)) == struct.pack("<BHB", 0, 384, 0)
        assert answer(struct.pack("<BHB", 0, 384, 0)) == struct.pack("<BHBf", 0, 384, 0, 3.5)
        bus.send(can.Message(arbitration_id=1 << 5 | 0x16, is_extended_id=False, data=b"\1"))
        waiting(lambda: drive.stored[name] == 3.5)


def test_a_request_without_data_is_one(far: Any) -> None:
    """As the maker's can_param_access.py asks for the version."""
    with can.Bus(interface="virtual", channel=far.address.partition(":")[2]) as bus:
        bus.send(can.Message(arbitration_id=1 << 5, is_extended_id=False, data=b""))
        for _ in range(500):
            found = bus.recv(10.0)
            if found is not None and found.arbitration_id == 1 << 5:
                break
        assert bytes(found.data)[0] == 2
