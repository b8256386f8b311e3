# SPDX-License-Identifier: Apache-2.0
"""What drives report of themselves: units, tables, and what a restart forgets (S4, S5, S8)."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from drive_bench import PERIOD, Bench
from sdo_objects import Objects, result

from control_board_ros.core.terms.drives import DriveReport, SetPoint
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.virtual.can_bus import Frame

OFF, POSITION = SetPoint.OFF, SetPoint.POSITION
REV = 2.0 * math.pi


#: What drives report with power, and frames that switch the second off; None: its torque item.
REPORTS: dict[str, tuple[str | None, str | None, Frame | None]] = {
    "moteus": ("one turn", "10 position", (0x8002, bytes([0x01, 0x00, 0x00]))),
    "mit_can": ("one turn", "1 MIT", (2, b"\xff" * 7 + b"\xfd")),
    "odrive_can": ("one turn", None, (2 << 5 | 0x07, struct.pack("<I", 1))),
    "cia402": (None, "8 CSP", (0x602, struct.pack("<BHBI", 0x2B, 0x6040, 0, 0))),
    "dynamixel": ("one turn", "4 extended position", None),
    "feetech": ("absolute", "0 position", None),
}


def bench_of(driver: str, **options: str) -> Bench:
    return Bench(driver, options=options)


@pytest.fixture(params=list(REPORTS))
def told(request: pytest.FixtureRequest) -> Iterator[tuple[str, Bench, list[DriveReport]]]:
    """A driver with power, and what its drives reported last."""
    driver = request.param
    with bench_of(driver, **({"unwatched": "1"} if driver == "odrive_can" else {})) as bench:
        reports: list[DriveReport] = []
        tick = bench.tick

        def noting(wanted: Any) -> Any:
            found = tick(wanted)
            reports[:] = found.drives or reports
            return found

        bench.tick = noting  # type: ignore[method-assign]
        bench.connect()
        bench.until(lambda _: [one.power for one in reports] == [True, True], bench.accepts[0])
        yield driver, bench, reports


def test_power_and_law_are_those_that_a_drive_reports(
    told: tuple[str, Bench, list[DriveReport]],
) -> None:
    """S8: one is switched off behind the board's back; it was never the board's wish."""
    driver, bench, reports = told
    zero, law, frame = REPORTS[driver]
    bench.follow(bench.accepts[0], 10)
    assert [(one.zero, one.power, one.law) for one in reports] == [(zero, True, law)] * 2
    if frame is None:
        module = import_module(f"control_board_ros.plants.{driver}.table")
        bench.drives[1].table.set(module.TORQUE, 0)
    else:
        bench.bus.step([frame])
    bench.until(lambda _: reports[1].power is not True, bench.accepts[0], 5)
    bench.until(lambda _: reports[1].power is False, bench.accepts[0], 100)
    assert reports[0].power is True


def test_lost_and_late_answers_are_counted(
    told: tuple[str, Bench, list[DriveReport]],
) -> None:
    """S11: a late one is lost until it comes; on a serial bus the maker's library drops it."""
    driver, bench, reports = told
    kind, held = bench.accepts[0], list[Frame]()
    bench.follow(kind, 10)
    counts = lambda: bench.plant.answers.lost + bench.plant.answers.late  # noqa: E731
    begin = counts()

    def nothing(frames: Iterable[Frame]) -> Iterator[Frame]:
        held.extend(frames)
        yield from ()

    bench.bus.from_drives = nothing
    bench.follow(kind)
    assert counts() == [begin[0] + 1, begin[1] + 1, *begin[2:]]
    bench.arrive(held)
    bench.follow(kind)  # the late ones; those of this exchange do not come
    bench.bus.from_drives = iter
    bench.follow(kind, 5)
    late = int(REPORTS[driver][2] is not None)
    assert counts() == [n + k for n, k in zip(begin, [2 - late] * 2 + [late] * 2, strict=True)]
    bench.plant._says_at = 0.0  # a second passes
    bench.follow(kind)
    assert [one.lost for one in reports] + [one.late for one in reports] == counts()


def units(objects: dict[tuple[int, int], int], **own: float) -> Any:
    from control_board_ros.plants.cia402.identity import Cia402Axis, scale_of

    axis = Cia402Axis(name="a", id=1, **{"rated_torque": 1.0} | own)
    return result(scale_of(axis, Objects(objects)))  # type: ignore[arg-type]


ENCODER = {(0x608F, 1): 4096, (0x608F, 2): 1}
GEAR = {(0x6091, 1): 5, (0x6091, 2): 1}


@pytest.mark.parametrize(
    ("objects", "position", "velocity"),
    [
        (ENCODER, 4096, 4096),
        (ENCODER | GEAR, 20480, 20480),
        (ENCODER | GEAR | {(0x6092, 1): 36000, (0x6092, 2): 1}, 36000, 36000),
        (ENCODER | {(0x60A9, 0): 0x00B44700}, 4096, 60),
        (ENCODER | {(0x60A9, 0): 0xFDB44700}, 4096, 60e3),
    ],
    ids=["encoder", "gear", "feed constant", "1/min", "0.001/min"],
)
def test_a_cia402_drive_is_read_in_its_own_units(
    objects: dict[tuple[int, int], int], position: float, velocity: float
) -> None:
    """From 0x608F alone a drive in 1/min ran tens of times too fast."""
    scale = units(objects)
    assert scale.position * REV == pytest.approx(position)
    assert scale.velocity * REV == pytest.approx(velocity)


def test_units_that_are_not_known_are_refused_with_their_object() -> None:
    with pytest.raises(PlantSettingsError, match=r"0x00410000 .object 0x60a8.*a.counts="):
        units(ENCODER | {(0x60A8, 0): 0x00410000})
    with pytest.raises(PlantSettingsError, match=r"0x00014700 .object 0x60a9.*velocity_counts="):
        units(ENCODER | {(0x60A9, 0): 0x00014700})


def test_a_cia402_drive_gets_the_period_of_its_targets() -> None:
    """It moved in jerks, or late, by the interpolation time that it had."""
    with bench_of("cia402") as bench:
        bench.connect()
        objects = Objects({(0x60C2, 1): 1, (0x60C2, 2): 0, (0x1006, 0): 0})
        result(bench.plant.driver._set_period(objects))
        assert objects.written == {(0x60C2, 2): -3, (0x60C2, 1): round(1e3 * PERIOD),
                                   (0x1006, 0): round(1e6 * PERIOD)}  # fmt: skip


def test_a_cia402_drive_without_the_optional_reaction_is_accepted() -> None:
    """S5: 0x6007 is optional; 0x605E decides."""
    with bench_of("cia402") as bench:
        bench.connect()
        needed = {(0x1016, 1): 0, (0x605E, 0): 0}
        result(bench.plant.driver._set_watchdog(0, Objects(needed)))
        del needed[0x1016, 1]
        with pytest.raises(PlantSettingsError, match="0x1016"):
            next(bench.plant.driver._set_watchdog(0, Objects(needed)))


def test_the_tables_of_a_dynamixel_are_those_of_its_firmware() -> None:
    """28 indirect addresses above firmware 52 of the small ones, 20 before."""
    from control_board_ros.plants.dynamixel import table as t

    assert [t.MODELS[1200].data(firmware) for firmware in (45, 52, 53)] == [208, 208, 224]
    assert t.MODELS[1020].data(45) == 224
    with bench_of("dynamixel") as bench:
        bench.drives[1].table.set(t.MODEL, 999)
        with pytest.raises(PlantSettingsError, match=r"id 2 is of model 999; supported: .*XL330"):
            connect(bench)


@pytest.mark.parametrize(
    ("item", "value", "text"),
    [("PHASE", 0x1C, r"Phase \(address 18\) of id 2 is 28"),
     ("ANGULAR_RESOLUTION", 3, r"Angular_Resolution \(address 30\) of id 2 is 3")],
)  # fmt: skip
def test_a_feetech_whose_positions_are_others_is_refused(item: str, value: int, text: str) -> None:
    """Its readings would be off by turns, or by a factor."""
    from control_board_ros.plants.feetech import table as t

    with bench_of("feetech") as bench:
        bench.drives[1].table.set(getattr(t, item), value)
        with pytest.raises(PlantSettingsError, match=text):
            connect(bench)


def connect(bench: Bench) -> None:
    """As a board does; the error of a drive is a fault of its joint, or of the start."""
    bench.connect()
    for fault in bench.follow(OFF).faults:
        if fault:
            raise PlantSettingsError(str(fault))


def test_a_moteus_without_gains_is_refused() -> None:
    """The bus would divide by 0."""
    with bench_of("moteus") as bench:
        bench.drives[0].stored["servo.pid_position.kd"] = 0.0
        bench.drives[0].reboot()
        with pytest.raises(PlantSettingsError, match=r"id 1 has kp .* and kd 0; above 0 are"):
            connect(bench)


def test_a_line_of_the_last_program_answers_no_question() -> None:
    """A host that was killed in its set-up leaves one in the drive's stream."""
    with bench_of("moteus") as bench:
        bench.drives[0]._stream = b"7.5\r\n0"
        bench.connect()
        assert bench.plant.driver._drives[0].kp == bench.plant.driver._drives[1].kp


@pytest.mark.parametrize("driver", ["moteus", "mit_can", "odrive_can", "cia402", "dynamixel"])
def test_a_restart_while_off_is_noticed_before_power(driver: str) -> None:
    """S5, S8: its watchdog is gone with its memory, and it would drive on without."""
    with bench_of(driver) as bench:
        bench.connect()
        bench.follow(OFF, 10)
        bench.drives[1].reboot()
        bench.bus.step([])
        found = bench.until(lambda found: bool(found.faults[1]), bench.accepts[0], cycles=100)
        assert "restarted" in str(found.faults[1])
        assert not found.faults[0]
        for _ in range(200):
            found = bench.follow(OFF)
            if not any(found.faults):
                break
            bench.plant.clear_fault(1)
        assert not any(found.faults)
        bench.follow(bench.accepts[0], 20)
        bench.pass_time(1.0)  # the computer is gone
        assert bench.drives[1].torque == pytest.approx(0.0, abs=1e-6)


def with_endpoints(folder: Path, monkeypatch: pytest.MonkeyPatch, **more: float) -> dict[str, str]:
    """Options with a file of parameters that has some more, and a drive that has them."""
    from control_board_ros.plants.odrive_can import frames as f
    from control_board_ros.plants.odrive_can import virtual

    known = dict(f.KNOWN["0.6.11", "4.4"])
    known |= {getattr(f, name): f.Endpoint(900 + k, "<f") for k, name in enumerate(more)}
    monkeypatch.setattr(virtual, "PARAMETERS", known)
    forms = {form: name for name, form in f.FORMS.items()}
    entries = {name: {"id": one.id, "type": forms[one.form]} for name, one in known.items()}
    file = folder / "flat_endpoints.json"
    content = {"fw_version": "0.6.11-1", "hw_version": "4.4.58", "endpoints": entries}
    file.write_text(json.dumps(content), encoding="utf-8")
    return {"endpoints": str(file)}


def test_the_scales_of_an_odrive_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """1 N·m was asked, 10 acted."""
    from control_board_ros.plants.odrive_can import frames as f

    given = with_endpoints(tmp_path, monkeypatch, SPEED_SCALE=50.0, TORQUE_SCALE=100.0)
    with bench_of("odrive_can", **given) as bench:
        for drive in bench.drives:
            drive.stored |= {f.SPEED_SCALE: 50.0, f.TORQUE_SCALE: 100.0}
            drive.reboot()
        bench.connect()
        sent: list[Frame] = []

        def watch(frames: Iterable[Frame]) -> Iterator[Frame]:
            for frame in frames:
                sent.append(frame)
                yield frame

        bench.bus.to_drives = watch
        bench.follow(POSITION, 10, velocity=REV, torque=1.0)
        data = [data for name, data in sent if name == 1 << 5 | f.INPUT_POSITION][-1]
        assert struct.unpack("<fhh", data)[1:] == (50, 100)


@pytest.mark.parametrize("value", [b"", bytes(4)], ids=["bare", "zeros"])
def test_confirmations_of_writes_are_no_readings(value: bytes) -> None:
    """Firmware 0.6.11 sends some."""
    with bench_of("odrive_can") as bench:
        from control_board_ros.plants.odrive_can import frames as f

        for drive in bench.drives:
            answer = drive._parameter

            def confirming(data: bytes, drive: Any = drive, answer: Any = answer) -> Any:
                yield from answer(data)
                if data[0] == f.WRITE:
                    yield drive.id << 5 | f.TX_SDO, bytes([0, *data[1:3], 0]) + value

            drive._parameter = confirming
        bench.connect()
        assert not any(bench.follow(POSITION, 10).faults)
