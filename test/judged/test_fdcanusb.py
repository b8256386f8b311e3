# SPDX-License-Identifier: Apache-2.0
"""The maker's adapter of moteus: its own library and the driver over the same one."""

from __future__ import annotations

import asyncio
import errno
import os
import pty
import sys
from collections.abc import Iterator
from typing import Any

import moteus
import pytest
from adapter import adapter
from far_drives import until
from moteus import fdcanusb_device
from moteus.protocol import Register

from control_board_ros.plants.drives.can_line import CanLine
from control_board_ros.plants.drives.fdcanusb import parse
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.moteus.driver import identity, identity_of, make
from control_board_ros.plants.moteus.virtual import virtual_drive
from control_board_ros.plants.virtual.world import World, free_world

NAMES = ("joint",)


@pytest.fixture
def world() -> World:
    axes = make(NAMES, {"bus": "none"}).axes
    return free_world(axes, [virtual_drive(axis, None) for axis in axes])


@pytest.fixture
def device(world: World) -> Iterator[str]:
    with adapter(world, world.drives) as device:
        yield device


def test_the_makers_library_uses_this_adapter(
    device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the driver is tried on is what the library takes for one."""
    monkeypatch.setattr(
        fdcanusb_device, "_get_fdcanusb_properties", lambda _: {"is_fdcanusb": True}
    )

    async def ask() -> Any:
        transport = moteus.Transport([fdcanusb_device.FdcanusbDevice(device)])
        try:
            return await moteus.Controller(id=1, transport=transport).query()
        finally:
            transport.close()

    assert asyncio.run(ask()).values[Register.MODE] == 0


def test_the_driver_finds_a_drive_through_it(device: str) -> None:
    question = identity(1)
    with CanLine(f"fdcanusb:{device}", fd=True) as line:
        line.send(*question.request[0])
        came = until(lambda: line.collect(0.1))
    assert identity_of(1, bytes(came[0].data)).firmware == "1.1.0"


def test_what_is_no_frame_is_none() -> None:
    found = parse(b"rcv 8100 0102ff BF\r")
    assert (found.arbitration_id, bytes(found.data)) == (0x8100, b"\1\2\xff")
    assert [parse(line) for line in (b"OK", b"rcv", b"rcv 1 0g BF", b"rcv x 00 BF", b"")] == [
        None
    ] * 5


def test_a_refusal_and_a_missing_device_are_one_line() -> None:
    with pytest.raises(OSError, match="there is no such device; list them with") as caught:
        CanLine("fdcanusb:/dev/no_such", fd=True).open()
    assert caught.value.errno in (None, errno.ENOENT)
    master, slave = pty.openpty()
    with CanLine(f"fdcanusb:{os.ttyname(slave)}", fd=True) as line:
        line.send(1, b"")
        os.write(master, b"ERR bus off\r\n")
        with pytest.raises(OSError, match="the adapter says: ERR bus off"):
            line.collect(1.0)
    os.close(master)
    os.close(slave)


def test_without_pyserial_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(PlantSettingsError, match="pip install pyserial"):
        CanLine("fdcanusb:/dev/fdcanusb", fd=True).open()


def test_an_adapter_that_takes_nothing_ends_no_cycle() -> None:
    """S10: it is an error of its bus, not a wait."""
    master, slave = pty.openpty()

    def flood(line: CanLine) -> None:
        for _ in range(10_000):
            line.send(1, bytes(48))

    line = CanLine(f"fdcanusb:{os.ttyname(slave)}", fd=True)
    with line, pytest.raises(OSError, match=r"[Tt]imeout"):
        flood(line)
    os.close(master)
    os.close(slave)
