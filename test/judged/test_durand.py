# SPDX-License-Identifier: Apache-2.0
"""Our CiA 402 driver on drives whose CANopen is durand's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from drive_bench import Bench
from durand_drive import ENABLED, FAULT, DurandDrive

from control_board_ros.core.terms.drives import SetPoint

OFF, POSITION, VELOCITY, TORQUE = (
    SetPoint.OFF, SetPoint.POSITION, SetPoint.VELOCITY, SetPoint.TORQUE,
)  # fmt: skip


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    def made(axis: Any, _: object) -> DurandDrive:
        return DurandDrive(axis.id)

    monkeypatch.setattr("control_board_ros.plants.cia402.virtual.virtual_drive", made)
    with Bench("cia402") as bench:
        bench.connect()
        yield bench


def test_a_position_is_reached_and_read(bench: Any) -> None:
    bench.until(lambda found: np.abs(found.position - 0.5).max() < 2e-3, POSITION, position=0.5)
    assert np.abs(bench.world.state[0] - 0.5).max() < 2e-3


def test_a_velocity_is_held(bench: Any) -> None:
    bench.until(lambda found: np.abs(found.velocity - 0.4).max() < 0.02, VELOCITY, velocity=0.4)


def test_a_torque_acts_and_ends(bench: Any) -> None:
    bench.follow(TORQUE, 60, torque=0.3)
    assert all(drive.torque == pytest.approx(0.3, abs=1e-3) for drive in bench.drives)
    bench.until(lambda _: all(drive.status != ENABLED for drive in bench.drives), OFF)
    bench.follow(OFF, 3)
    assert all(drive.torque == 0.0 for drive in bench.drives)


def test_a_fault_is_reported_alone_and_cleared(bench: Any) -> None:
    bench.follow(POSITION, 50)
    bench.fail(1)
    found = bench.until(lambda found: bool(found.faults[1]), POSITION)
    assert found.faults[1].number == 0x3210
    assert not found.faults[0]
    bench.recover()
    bench.until(lambda _: bench.drives[1].status == ENABLED, POSITION)


def test_its_watchdog_acts_when_the_board_falls_silent(bench: Any) -> None:
    bench.follow(POSITION, 50)
    bench.pass_time(0.5)
    assert [drive.status for drive in bench.drives] == [FAULT, FAULT]
    bench.until(lambda found: all(found.faults), POSITION)
    bench.recover()


def test_a_silent_drive_is_named_and_comes_back(bench: Any) -> None:
    bench.follow(POSITION, 50)
    bench.drives[1].silent = True
    found = bench.until(lambda found: bool(found.faults[1]), POSITION)
    assert f"no answer from id {bench.drives[1].id}" in str(found.faults[1])
    assert not found.faults[0]
    bench.drives[1].silent = False
    bench.drives[1].reboot()
    bench.recover()
    bench.until(lambda _: bench.drives[1].status == ENABLED, POSITION)


def test_a_drive_that_keeps_its_mode_is_a_fault(bench: Any) -> None:
    """S8: it must not go on in CSP while TORQUE is shown."""
    bench.follow(POSITION, 50)
    bench.drives[0].keeps = 8
    found = bench.until(lambda found: bool(found.faults[0]), TORQUE, torque=0.2)
    assert not found.faults[1]
