# SPDX-License-Identifier: Apache-2.0
"""The virtual ODrive, operated by odrive-can."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import can
import pytest
from far_drives import far_drives, near

pytest.importorskip("odrive_can", reason="odrive-can is not installed: pip install '.[test]'")

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


def test_a_request_without_data_is_one(far: Any) -> None:
    """As the maker's can_param_access.py asks for the version."""
    with can.Bus(interface="virtual", channel=far.address.partition(":")[2]) as bus:
        bus.send(can.Message(arbitration_id=1 << 5, is_extended_id=False, data=b""))
        for _ in range(500):
            found = bus.recv(10.0)
            if found is not None and found.arbitration_id == 1 << 5:
                break
        assert bytes(found.data)[0] == 2
