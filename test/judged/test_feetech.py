# SPDX-License-Identifier: Apache-2.0
"""The virtual Feetech STS3215, operated by feetech-cli, st3215-bus and its maker's SDK."""

from __future__ import annotations

from collections.abc import Iterator
from statistics import median
from typing import Any

import pytest
from apart import run_apart
from far_drives import far_drives, near, until
from feetech_cli.controller import FeetechServoController
from feetech_cli.registers import CONTROL_TABLE
from st3215_bus import Buses
from waiting import GUARD

COUNT = 6.283185 / 4096


@pytest.fixture
def far() -> Iterator[Any]:
    with far_drives("feetech", 2) as far:
        for drive in far.drives:
            drive.goal_takes_power = True  # as this client's author measured it
        yield far


@pytest.fixture
def servos(far: Any) -> Iterator[Any]:
    """With patience: after a late answer each is taken for that to the next question."""
    with FeetechServoController(far.address, 1_000_000, GUARD, max_id=2) as servos:
        wait = servos.wait_until_stopped
        servos.wait_until_stopped = lambda servo, timeout=GUARD: wait(servo, timeout=GUARD)
        yield servos


def test_all_that_it_lists_is_read_as_delivered(servos: Any) -> None:
    found = servos.dump(1, list(CONTROL_TABLE))
    assert found["model_number"] == 777
    assert (found["min_position_limit"], found["max_position_limit"]) == (0, 4095)
    assert (found["max_torque_limit"], found["torque_limit"]) == (1000, 1000)
    assert (found["p_coefficient"], found["d_coefficient"], found["phase"]) == (32, 32, 12)
    assert found["max_temperature_limit"] == 70


@pytest.mark.slow
def test_its_preflight_and_its_own_test_pass(servos: Any) -> None:
    servos.wait_until_stopped(1)
    found = servos.selftest(1, moves=2)
    assert all(right for _, right, _ in found["checks"]), found["checks"]
    assert found["passed"], found["moves"]


@pytest.mark.slow
def test_a_goal_takes_power_and_its_speed_holds(far: Any, servos: Any) -> None:
    assert servos.read_register(1, "torque_enable") == 0
    servos.set_goal_position(1, 2148)
    assert servos.read_register(1, "torque_enable") == 1
    until(lambda: near(servos.read_register(1, "present_position"), 2148, 4) and far.rests())
    speeds = []
    servos.sync_write_positions([1], [1748], velocity=300)
    until(
        lambda: near(servos.read_register(1, "present_position"), 1748, 4),
        lambda: speeds.append(abs(servos.read_register(1, "present_velocity"))),
    )
    assert 255 < median(speeds) < 345
    assert servos.set_torque(1, False) == 0


def test_a_goal_beyond_its_limits_ends_at_them(servos: Any) -> None:
    servos.write_register(1, "max_position_limit", 2200)
    servos.set_goal_position(1, 3000)
    until(lambda: near(servos.read_register(1, "present_position"), 2200, 4))


def test_its_zero_is_set_and_nothing_moves(far: Any, servos: Any) -> None:
    servos.set_goal_position(1, 2400)
    until(lambda: near(servos.read_register(1, "present_position"), 2400, 4))
    until(lambda: abs(far.world.state[1][0]) < 1e-3)
    before = far.position()
    assert near(servos.set_zero(1), 2048, 4)
    assert near(far.position(), before, 4 * COUNT)
    servos.set_goal_position(1, 2148)
    until(lambda: near(far.position(), before + 100 * COUNT, 6 * COUNT))


def test_128_makes_the_present_position_the_middle(far: Any, servos: Any) -> None:
    far.world.state[0][0] = 1.0
    until(lambda: near(servos.read_register(1, "present_position"), 2700, 2))
    servos._write_raw(1, CONTROL_TABLE["torque_enable"], 128)
    assert near(servos.read_register(1, "present_position"), 2048, 1)
    assert servos.read_register(1, "torque_enable") == 0
    far.drive.reboot()
    assert near(servos.read_register(1, "present_position"), 2048, 1)


@pytest.mark.slow
def test_it_takes_another_id_and_another_rate(far: Any, servos: Any) -> None:
    servos.serial.timeout = servos.timeout = 2.0  # it asks twice for what is not there
    assert servos.set_id(1, 9) == 9
    assert servos.scan(1, 2) == [2]
    servos.set_baudrate(9, 500_000)
    assert servos.read_register(9, "baud_rate") == 1
    far.drive.reboot()
    assert servos.read_register(9, "id") == 9
    servos.factory_reset(9)
    servos.reopen(1_000_000)
    assert servos.scan(1, 2) == [1, 2]


def test_what_is_written_behind_the_lock_is_lost_with_the_supply(far: Any, servos: Any) -> None:
    """Memory table, 55: with the lock closed a value of the stored area is not kept."""
    servos.lock_eeprom(1)
    servos._write_raw(1, CONTROL_TABLE["p_coefficient"], 20)
    assert servos.read_register(1, "p_coefficient") == 20
    far.drive.reboot()
    assert servos.read_register(1, "p_coefficient") == 32
    servos.write_register(1, "p_coefficient", 20)
    far.drive.reboot()
    assert servos.read_register(1, "p_coefficient") == 20


def test_st3215_bus_finds_stores_by_registered_writes_and_moves(far: Any) -> None:
    with Buses({"arm": far.address}, timeout_ms=500) as buses:
        assert buses.ping(2) == {"arm": [1, 2]}
        assert buses.read_eeprom("ID", [1, 2]) == {"arm": {1: 1, 2: 2}}
        assert buses.write_eeprom("MaxAngleLimit", {"arm": {1: 3000}}) == {"arm": []}
        buses.set_torque(True, [1, 2])
        buses.write_goals({"arm": {1: 2248, 2: 1848}})
        until(lambda: near(buses.read_positions([1])["arm"][1], 2248, 4))
        until(lambda: near(buses.read_positions([2])["arm"][2], 1848, 4))
        buses.set_torque(False, [1, 2])
        assert buses.read_register("TorqueEnable", [1, 2]) == {"arm": {1: 0, 2: 0}}
    far.drive.reboot()
    assert int.from_bytes(far.drive.table.bytes[11:13], "little") == 3000


def test_the_sdk_of_its_maker_operates_it(far: Any) -> None:
    """Its examples: ping, write, read, wheel, registered and synchronous writes."""
    found = run_apart("ftservo-python-sdk", "feetech_sdk.py", far.address)
    assert found == ["777", "2300 0", "moving stops", "turns", "1800 1800", "2200 2200", "locked"]
