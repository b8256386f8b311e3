# SPDX-License-Identifier: Apache-2.0
"""``cbctl drives set-id``: written, stored and read back, on virtual drives."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from drive_bench import Bench
from explorer import law_of

from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.__main__ import SERIAL, main
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.mit_can import damiao

MAKES: dict[str, tuple[str, dict[str, str]]] = {
    "moteus": ("moteus", {}),
    "damiao": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs02"}),
    "robstride_mit": ("mit_can", {"model": "rs02", "protocol": "mit", "unwatched": "1"}),
    "dynamixel": ("dynamixel", {}),
    "feetech": ("feetech", {}),
}


def bench_of(make: str) -> Bench:
    driver, options = MAKES[make]
    return Bench(driver, options=options)


def set_id(bench: Bench, make: str, *words: str) -> int:
    """At one baud rate, unless any may be."""
    rate = ["--baudrate", "1000000"] if make in SERIAL and not bench.baudrate else []
    with bench.direct():
        return main(["set-id", MAKES[make][0], *words, "--bus", "direct", *rate])


@pytest.mark.parametrize("make", MAKES)
def test_an_id_is_stored_and_read_back(make: str, capsys: pytest.CaptureFixture[str]) -> None:
    with bench_of(make) as bench:
        assert set_id(bench, make, "2", "9") == 0
        assert "id 2 is id 9 now" in capsys.readouterr().out
        bench.drives[1].reboot()
        assert [drive.id for drive in bench.drives] == [1, 9]


def test_a_servo_is_locked_again() -> None:
    """It is deaf while it stores."""
    with bench_of("feetech") as bench:
        assert set_id(bench, "feetech", "2", "9") == 0
        assert bench.drives[1].table.get(feetech.LOCK) == 1


@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("3", "9"), "no drive answers as id 3"),
        (("1", "2"), "a drive answers as id 2 already"),
        (("1", "999"), "id 999: .* is required"),
        (("1", "1"), "id 1 is its id already"),
    ],
)
def test_what_cannot_be_is_one_line(
    make: str, words: tuple[str, str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with bench_of(make) as bench:
        assert set_id(bench, make, *words) == 1
        refused(text, capsys)
        assert [drive.id for drive in bench.drives] == [1, 2]


@pytest.mark.parametrize("make", MAKES)
def test_two_drives_with_one_id_keep_it(make: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The one would be as good as the other."""
    with bench_of(make) as bench:
        bench.bus.drives.append(bench.world_drive(bench.plant.axes[0]))
        assert set_id(bench, make, "1", "9") == 1
        refused("2 drives answer as id 1", capsys)


POWER: dict[str, Callable[[Any], object]] = {
    "moteus": lambda drive: setattr(drive, "mode", 10),
    "damiao": lambda drive: setattr(drive, "state", damiao.ENABLED),
    "robstride": lambda drive: setattr(drive, "state", 1),
    "dynamixel": lambda drive: drive.table.set(dynamixel.TORQUE, 1),
    "feetech": lambda drive: drive.table.set(feetech.TORQUE, 1),
}


@pytest.mark.parametrize("make", POWER)
def test_a_drive_with_power_keeps_its_id(make: str, capsys: pytest.CaptureFixture[str]) -> None:
    with bench_of(make) as bench:
        POWER[make](bench.drives[0])
        assert set_id(bench, make, "1", "9") == 1
        refused("id 1 has (power|torque); it changes its id without", capsys)
        assert law_of(bench.drives[0]) is not SetPoint.OFF  # an arm would fall


@pytest.mark.parametrize("make", MAKES)
def test_an_id_that_is_not_taken_is_said(make: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing that was only sent counts as done."""
    with bench_of(make) as bench:
        keep(bench.drives[0])
        assert set_id(bench, make, "1", "9") == 1
        refused("id 9", capsys)


def keep(drive: Any) -> None:
    """Make a drive obey nothing that would change its id."""
    kind = type(drive)
    drive.__class__ = type(kind.__name__, (kind,), {"id": property(lambda _: 1, lambda *_: None)})


def test_other_makes_and_rates_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["set-id", "odrive_can", "1", "2", "--bus", "virtual:x"]) == 1
    refused("set the id of odrive_can with its maker's tool", capsys)
    with Bench("dynamixel") as bench:
        bench.baudrate = 57_600
        assert set_id(bench, "dynamixel", "1", "9", "--baudrate", "1000000") == 1
        refused("no drive answers as id 1", capsys)
        assert set_id(bench, "dynamixel", "1", "9") == 0


def refused(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert re.search(text, said), said
