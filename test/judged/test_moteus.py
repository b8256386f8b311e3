# SPDX-License-Identifier: Apache-2.0
"""The virtual moteus, operated by the maker's library and by ``moteus_tool``."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import math
import sys
from collections.abc import Callable, Coroutine, Iterator
from typing import Any
from unittest import mock

import can
import moteus
import pytest
from far_drives import BRIEF, far_drives, near
from moteus import moteus_tool
from moteus.protocol import Register

REV = 2.0 * math.pi
Talk = Callable[[Any, Any], Coroutine[Any, Any, Any]]


@pytest.fixture
def far(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """With receivers of python-can that end as soon as they are closed, not after a second."""
    monkeypatch.setattr(can.Notifier.__init__, "__defaults__", (BRIEF, None))
    with far_drives("moteus", 2) as far:
        yield far


def talk(far: Any, said: Talk, drive: int = 1) -> Any:
    """Run a conversation with a drive, by a transport of the library over python-can."""

    async def run() -> Any:
        with contextlib.closing(transport(far)) as line:
            resolution = moteus.QueryResolution()
            resolution.q_current = resolution.trajectory_complete = moteus.F32
            controller = moteus.Controller(id=drive, transport=line, query_resolution=resolution)
            return await said(line, controller)

    return asyncio.run(run())


def transport(far: Any) -> Any:
    channel = far.address.partition(":")[2]
    return moteus.Transport(
        [moteus.PythonCanDevice(interface="virtual", channel=channel, fd=True)]
    )


def tool(far: Any, *arguments: str) -> str:
    """What ``moteus_tool`` prints."""
    printed = io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["moteus_tool", *arguments]),
        mock.patch.object(
            moteus_tool.moteus, "get_singleton_transport", return_value=transport(far)
        ),
        contextlib.redirect_stdout(printed),
    ):
        moteus_tool.main()
    return printed.getvalue()


async def until(controller: Any, reached: Callable[[Any], bool], act: Callable[[], Any]) -> Any:
    """Command until something is so, 5000 times at most; the last values."""
    for _ in range(5000):
        found = (await act()).values
        if reached(found):
            return found
        await asyncio.sleep(0.01)
    raise AssertionError(f"it never came: {found}")


def test_all_are_discovered(far: Any) -> None:
    async def said(line: Any, _: Any) -> Any:
        return await line.discover(timeout=0.5)

    found = talk(far, said)
    assert [each.can_id for each in found] == [1, 2]
    assert [each.uuid for each in found] == [drive.uuid for drive in far.drives]
    assert all(each.address is not None for each in found)


@pytest.mark.slow
def test_one_is_addressed_by_its_unique_id(far: Any) -> None:
    async def run() -> Any:
        with contextlib.closing(transport(far)) as line:
            address = moteus.DeviceAddress(uuid=far.drives[1].uuid)
            found = await moteus.Controller(id=address, transport=line).set_stop(query=True)
            return found.id  # its query() leaves the unique id out

    assert asyncio.run(run()) == 2


@pytest.mark.slow
def test_it_moves_within_its_own_limits(far: Any) -> None:
    """0.5 rev at 1 rev/s and 4 rev/s²: complete after 0.75 s, never faster."""
    speeds = []

    async def said(_: Any, drive: Any) -> Any:
        await drive.set_stop()

        async def act() -> Any:
            found = await drive.set_position(
                position=0.5, velocity=0.0, velocity_limit=1.0, accel_limit=4.0,
                watchdog_timeout=math.nan, query=True,
            )  # fmt: skip
            speeds.append(found.values[Register.VELOCITY])
            return found

        return await until(drive, lambda v: bool(v[Register.TRAJECTORY_COMPLETE]), act)

    found = talk(far, said)
    assert near(found[Register.POSITION], 0.5, 0.02)
    assert max(speeds) < 1.15


@pytest.mark.slow
def test_its_wait_for_a_trajectory_ends(far: Any) -> None:
    async def said(_: Any, drive: Any) -> Any:
        await drive.set_stop()
        return await drive.set_position_wait_complete(
            position=0.25, accel_limit=8.0, watchdog_timeout=math.nan
        )

    # The way is complete; the motor is ahead by the torque that brakes it, 2.5 N·m at
    # 100 N·m/rev.
    assert near(talk(far, said).values[Register.POSITION], 0.25, 0.05)


@pytest.mark.slow
def test_the_acceleration_of_delivery_acts_until_it_is_waived(far: Any) -> None:
    async def said(_: Any, drive: Any) -> Any:
        await drive.set_stop()
        await until(
            drive,
            lambda v: v[Register.MODE] == 10,
            lambda: drive.set_position(position=math.nan, watchdog_timeout=math.nan, query=True),
        )
        await drive.set_position(
            position=0.5, accel_limit=-1, watchdog_timeout=math.nan, query=True
        )

    talk(far, said)
    assert (
        far.drive._plan.position == pytest.approx(0.5, abs=1e-3) or far.drive._plan.target == 0.5
    )
    assert far.drive.conf["servo.default_accel_limit"] == 50.0


@pytest.mark.slow
def test_it_stays_within_bounds(far: Any) -> None:
    async def said(_: Any, drive: Any) -> Any:
        await drive.set_stop()
        return await until(
            drive,
            lambda v: near(v[Register.POSITION], 0.15, 0.06),  # within, nothing brakes it
            lambda: drive.set_stay_within(
                lower_bound=0.1, upper_bound=0.2, watchdog_timeout=math.nan, query=True
            ),
        )

    assert talk(far, said)[Register.MODE] == 13


@pytest.mark.slow
def test_its_output_is_set(far: Any) -> None:
    async def said(_: Any, drive: Any) -> Any:
        await drive.set_output_exact(position=0.375)
        exact = (await drive.query()).values[Register.POSITION]
        await drive.set_output_nearest(position=5.0)
        return exact, (await drive.query()).values[Register.POSITION]

    assert talk(far, said) == (pytest.approx(0.375, abs=1e-3), pytest.approx(5.375, abs=1e-3))
    assert near(far.position(), 0.0)


@pytest.mark.slow
def test_its_watchdog_and_a_fault_are_left_by_a_stop(far: Any) -> None:
    async def said(_: Any, drive: Any) -> Any:
        await drive.set_stop()
        await drive.set_position(position=math.nan, watchdog_timeout=0.05, query=True)
        await asyncio.sleep(0.3)
        silent = (await drive.query()).values[Register.MODE]
        await drive.set_stop()
        stopped = (await drive.query()).values[Register.MODE]
        far.drive.fail(33)
        fault = (await drive.query()).values
        await drive.set_stop()
        return silent, stopped, fault, (await drive.query()).values[Register.FAULT]

    silent, stopped, fault, cleared = talk(far, said)
    assert (silent, stopped, cleared) == (11, 0, 0)
    assert (fault[Register.MODE], fault[Register.FAULT]) == (1, 33)


@pytest.mark.slow
def test_the_tool_lists_reads_dumps_and_stops(far: Any) -> None:
    assert json.loads(tool(far, "-t", "1", "--info"))["uuid"].startswith("6d6a")
    assert json.loads(tool(far, "-t", "1", "--read", "servo_stats"))["filt_bus_V"] == 24.0
    dump = tool(far, "-t", "2", "--dump-config")
    assert "id.id 2\n" in dump
    assert "servo.default_accel_limit 50\n" in dump
    far.drive._order(10, {})
    tool(far, "-t", "1", "--stop")
    assert far.drive.mode == 0


@pytest.mark.slow
def test_the_tool_sets_an_offset_and_writes_a_configuration(far: Any, tmp_path: Any) -> None:
    tool(far, "-t", "1", "--set-offset", "0.25")
    assert near(far.drive._position, 0.25)
    far.drive.reboot()
    assert near(far.drive._position, 0.25)
    file = tmp_path / "moteus.cfg"
    file.write_text("servo.default_velocity_limit 2\nservo.default_accel_limit 9\n")
    tool(far, "-t", "1", "--restore-config", str(file))
    far.drive.reboot()
    limits = (far.drive.conf[f"servo.default_{what}_limit"] for what in ("velocity", "accel"))
    assert [*limits] == [2.0, 9.0]
