# SPDX-License-Identifier: Apache-2.0
"""Hazards of drives that were met on a bench, each by its name (S3, S4, S8, S11)."""

from __future__ import annotations

import errno
import json
import re
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import moteus
import numpy as np
import pytest
from drive_bench import LIBRARIES, PERIOD, Bench
from explorer import law_of

from control_board_ros.core.laws.control import PEAK_SHARE
from control_board_ros.core.terms.drives import SetPoint
from control_board_ros.plants.cia402.states import State
from control_board_ros.plants.drives.serial_line import Item
from control_board_ros.plants.dynamixel import table as dynamixel
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.feetech import table as feetech
from control_board_ros.plants.interface import Description, DriveLimits, JointDescription
from control_board_ros.plants.mit_can import damiao, frames, robstride_private, virtual_robstride
from control_board_ros.plants.offers import bounded_limits
from control_board_ros.plants.virtual.can_bus import Frame
from control_board_ros.testing.plant_contract import board_for

OFF, POSITION, VELOCITY = SetPoint.OFF, SetPoint.POSITION, SetPoint.VELOCITY
TORQUE, CURRENT, PWM, IMPEDANCE = (
    SetPoint.TORQUE, SetPoint.CURRENT, SetPoint.PWM, SetPoint.IMPEDANCE,
)  # fmt: skip


def bench_of(driver: str, **options: str) -> Bench:
    return Bench(driver, options=options)


class LoseFirst:
    """A wire that loses the first frame of a sort."""

    def __init__(self, chosen: Callable[[bytes], bool], *, serial: bool = False) -> None:
        self._chosen, self._serial, self.lost = chosen, serial, 0

    def __call__(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        for name, data in frames:
            for packet in re.split(rb"(?=\xff\xff)", data) if self._serial else [data]:
                if not self.lost and self._chosen(packet):
                    self.lost += 1
                elif packet:
                    yield name, packet


def test_a_lost_mode_packet_does_not_slam_a_feetech() -> None:
    """S8: goals of other kinds are those of rest, and the mode is read back."""
    with bench_of("feetech", unwatched="1") as bench:
        bench.connect()
        bench.follow(POSITION, 400, position=0.5)
        bench.bus.to_drives = wire = LoseFirst(
            lambda data: data[4:6] in (b"\x03\x21", b"\x83\x21"), serial=True
        )
        before, fastest = bench.world.state[0].copy(), 0.0
        for _ in range(100):
            bench.follow(VELOCITY, velocity=0.05)
            fastest = max(fastest, float(np.abs(bench.world.state[1]).max()))
        assert wire.lost == 1
        assert fastest < 0.2
        moved = bench.world.state[0] - before
        assert (moved > 0.0).all()
        assert (moved < 0.05).all()


@pytest.mark.parametrize("late", [8, 60])
def test_a_mode_that_a_dynamixel_did_not_acknowledge_is_written_again(late: int) -> None:
    """S8: PWM is given up, by the user or a fault: POSITION then is no full PWM."""
    pytest.importorskip("dynamixel_sdk")
    with Bench("dynamixel", names=("one",)) as bench:
        servo = bench.drives[0]
        bench.connect()
        bench.follow(SetPoint.POSITION, 40)
        answers = servo.on_packet
        to_mode = dynamixel.MODE.address.to_bytes(2, "little")
        servo.on_packet = lambda packet: (
            answer for answer in answers(packet) if packet.parameters[:2] != to_mode
        )
        bench.follow(SetPoint.PWM, late)
        servo.on_packet = answers
        bench.follow(SetPoint.OFF, 40)
        bench.recover()
        bench.follow(SetPoint.POSITION, 60)
        assert servo.table.get(dynamixel.MODE) == dynamixel.EXTENDED
        assert abs(bench.world.state[0]).max() < 2e-3


def test_a_feetech_whose_torque_is_switched_off_is_a_fault() -> None:
    """S8: by whatever switched it off (PickNik #930); it stays off until it is cleared."""
    with bench_of("feetech") as bench:
        bench.connect()
        bench.follow(POSITION, 50)
        with bench.world.lock:
            bench.drives[1].table.bytes[40] = 0
        found = bench.until(lambda found: bool(found.faults[1]), POSITION, cycles=250)
        assert not found.faults[0]
        assert "restarted" in str(found.faults[1])
        bench.follow(POSITION, 50)
        assert bench.drives[1].table.bytes[40] == 0


@pytest.mark.parametrize("count", [0x8833, 0x7755])
def test_every_position_of_a_damiao_is_heard(count: int) -> None:
    """What a frame is, is decided by what was asked, not by a byte of its position."""
    with bench_of("mit_can") as bench:
        bench.connect()
        at = -12.5 + count * 25.0 / 65535.0
        with bench.world.lock:
            bench.world.state[0] = at
        found = bench.follow(OFF, 3)
        assert found.ages is not None
        assert found.ages.max() == 0.0
        np.testing.assert_allclose(found.position, at, atol=1e-3)


def test_all_positions_and_states_of_a_damiao_are_motions() -> None:
    """By value, not by example: 65,536 positions in each state, at rest."""
    ranges = frames.Ranges(12.5, 30.0, 10.0)
    for state in (damiao.DISABLED, damiao.ENABLED, *damiao.FAULTS):
        for count in range(1 << 16):
            data = bytes([1 | state << 4]) + struct.pack(">H", count) + bytes.fromhex("7ff7ff1e23")
            assert not damiao.is_register(data, 1), data.hex()
    q, _, _ = frames.readings(ranges, data)
    assert q == 12.5


def test_a_late_acknowledge_of_a_register_is_no_motion() -> None:
    """It would read −12.47 rad and −27.7 rad/s for a cycle."""
    with bench_of("mit_can") as bench:
        bench.connect()
        late = (0x11, bytes.fromhex("01005509d0070000"))
        bench.bus.from_drives = lambda answers: iter([late, *answers])
        for _ in range(5):
            found = bench.follow(IMPEDANCE)
            assert abs(found.position[0]) < 0.1
            assert not any(found.faults)


def test_a_damiao_at_the_end_of_its_range_is_a_fault() -> None:
    """A motor at 13.2 of 12.5 rad would be pulled back by 0.7 rad."""
    with bench_of("mit_can") as bench:
        bench.connect()
        with bench.world.lock:
            bench.world.state[0, 0] = 13.2
        found = bench.follow(OFF, 3)
        assert "end of its range" in str(found.faults[0])
        assert not found.faults[1]


def test_a_velocity_of_zero_has_no_bias_in_an_mit_frame() -> None:
    """12 bits have no zero: what the velocity is off by, the torque makes up."""
    ranges = frames.Ranges(12.5, 45.0, 10.0)
    half = ranges.torque / 4095.0
    for q, dq, k, d, torque in ((0.1, 0.0, 0.0, 5.0, 0.0), (0.1, 0.3, 90.0, 2.0, 1.5)):
        sent = frames.commanded(ranges, frames.packed(ranges, q, dq, k, d, torque))
        acts = sent[4] + sent[3] * sent[1] + sent[2] * (sent[0] - q)
        assert acts == pytest.approx(torque + sent[3] * dq, abs=1.01 * half)


def test_moteus_plans_no_trajectory_of_its_own() -> None:
    """A velocity and an acceleration limit of −1: none; else those of its configuration act."""
    from control_board_ros.plants.moteus import frames as m

    command = m.template(moteus.Controller(id=1))
    data = m.POSITIONS.pack(command[0], *[0.0] * 6, command[1], 0.1, -1.0, -1.0, command[2], 0.0)
    values = {}
    for part in moteus.multiplex.parse_frame(data):
        values[part.register] = part.value
    assert (values[0x28], values[0x29]) == (-1.0, -1.0)


@pytest.mark.parametrize("driver", ["moteus", "odrive_can", "cia402", "mit_can"])
def test_a_full_queue_drops_a_frame_and_faults_nothing(
    driver: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """S11: dropped frames are counted; below plant_timeout they are no fault."""
    with bench_of(driver) as bench:
        bench.connect()
        kind = bench.accepts[0]
        bench.follow(kind, 20)
        line = bench.line
        put, full = line.bus.put, [3]

        def refuse(frame_id: int, data: bytes) -> None:
            if full[0]:
                full[0] -= 1
                import can

                raise can.CanOperationError("Failed to transmit", error_code=errno.ENOBUFS)
            put(frame_id, data)

        monkeypatch.setattr(line.bus, "put", refuse)
        for _ in range(30):
            assert not any(bench.follow(kind).faults)
        assert line.dropped == 3
        dropped = bench.follow(kind).dropped
        assert dropped is not None
        assert set(dropped) == {3.0}
        full[0] = 1
        bench.plant.let_go()
        bench.pass_time(0.01)
        assert bench.drives[1].torque == 0.0


def test_goals_beyond_a_servo_s_limit_are_cut_to_it() -> None:
    """S4: it refuses one beyond Current Limit or PWM Limit, and the old one would act."""
    with bench_of("dynamixel") as bench:
        for drive in bench.drives:
            drive.table.bytes[36:40] = struct.pack("<HH", 400, 300)
        bench.connect()
        bench.follow(CURRENT, 20, current=-40.0)
        assert struct.unpack_from("<h", bench.drives[1].table.bytes, 102)[0] == -300
        bench.follow(PWM, 20, pwm=60.0)
        assert struct.unpack_from("<h", bench.drives[1].table.bytes, 100)[0] == 400


def test_the_smaller_current_acts() -> None:
    """S4."""
    limits = board_for(Description(joints=(JointDescription(name="a"),))).joints[0].limits
    limits = replace(limits, nominal_current=10.0, peak_current=45.0)
    for most, nominal in ((20.0, 10.0), (1.0, 1.0)):
        bounded = bounded_limits(limits, DriveLimits(current=most))
        assert bounded.peak_current * PEAK_SHARE == pytest.approx(most)
        assert bounded.nominal_current == nominal


@pytest.mark.parametrize(
    ("model", "protocol"), [("damiao", "private"), ("rs02", "private"), ("rs02", "mit")]
)
def test_a_scan_takes_no_power(model: str, protocol: str) -> None:
    """A scan only reads: a running arm keeps its torque."""
    with bench_of("mit_can", model=model, protocol=protocol, unwatched="1") as bench:
        bench.connect()
        bench.follow(IMPEDANCE, 20)
        for drive in bench.drives:  # a scan takes longer, where no board commands meanwhile
            getattr(drive, "registers", {})[damiao.TIMEOUT] = 0
            getattr(drive, "parameters", {})[robstride_private.CAN_TIMEOUT] = 0
        found = bench.scan()
        assert [drive.id for drive in found] == [1, 2]
        assert [drive.state for drive in bench.drives] == [1, 1]


@pytest.mark.parametrize("driver", ["dynamixel", "feetech"])
def test_another_package_of_the_same_name_is_said_in_one_line(
    driver: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """An older or another maker's package brings a module of the same name."""
    bench = bench_of(driver)
    with bench:
        name = LIBRARIES[driver]
        wrong = ModuleType(name)
        wrong.__file__ = f"{tmp_path}/{name}/__init__.py"
        monkeypatch.setitem(sys.modules, name, wrong)
        with pytest.raises(PlantSettingsError, match=f"{name} of {tmp_path}.*is not .* pip"):
            bench.connect()


def test_the_bits_of_a_number_never_wrap() -> None:
    """S4: 40 A would become −25.5 A."""
    item = Item(0, 2)
    assert item.pack(40_000, signed=True) == struct.pack("<h", 32767)
    assert item.pack(-40_000, signed=True) == struct.pack("<h", -32768)


def test_a_lost_torque_off_is_sent_again() -> None:
    """S8: power is off when it is reported off; one lost packet kept it on in every fault."""
    with bench_of("dynamixel") as bench:
        bench.connect()
        bench.follow(POSITION, 30)
        off = b"\x83\x40\x00\x01\x00\x01\x00"
        bench.bus.to_drives = wire = LoseFirst(lambda data: off in data)
        bench.follow(OFF, 4)
        assert wire.lost == 1
        assert [drive.table.bytes[64] for drive in bench.drives] == [0, 0]


ROBSTRIDE = {
    "robstride": {"model": "rs02"},
    "robstride_mit": {"model": "rs02", "protocol": "mit", "unwatched": "1"},
}


@pytest.mark.parametrize("driver", [*LIBRARIES, *ROBSTRIDE])
def test_a_drive_that_is_not_heard_loses_its_power(driver: str) -> None:
    """S8: it may hear; power was left on where the wire from the drives was cut."""
    options = ROBSTRIDE.get(driver, {})
    with bench_of("mit_can" if options else driver, **options) as bench:
        bench.connect()
        bench.follow(bench.accepts[0], 50, position=0.05)
        assert all(powered(drive) for drive in bench.drives)
        bench.bus.from_drives = lambda _: iter(())
        bench.until(lambda found: all(found.faults), bench.accepts[0], cycles=100)
        bench.follow(OFF, 10)
        assert not any(powered(drive) for drive in bench.drives)


@pytest.mark.parametrize("waits", [1, 3])
@pytest.mark.parametrize("driver", [*LIBRARIES, *ROBSTRIDE])
def test_a_late_answer_to_a_switch_off_is_no_restart(driver: str, waits: int) -> None:
    """S8: the board wants power again before it comes, as beside busy loops."""
    options = ROBSTRIDE.get(driver, {})
    with bench_of("mit_can" if options else driver, **options) as bench:
        bench.connect()
        kind, late = bench.accepts[0], list[Frame]()
        bench.until(lambda _: powered(bench.drives[0]), kind, cycles=50)
        bench.follow(kind, 5)

        def hold(frames: Iterable[Frame]) -> Iterator[Frame]:
            late.extend(frames)
            yield from ()

        bench.bus.from_drives = hold
        bench.follow(OFF)
        bench.follow(kind, waits)
        bench.bus.from_drives = iter
        bench.arrive(late)
        for _ in range(50):
            assert not any(bench.follow(kind).faults)
        assert law_of(bench.drives[0]) is kind


def powered(drive: Any) -> bool:
    return drive.state == 1 if hasattr(drive, "faults") else law_of(drive) is not OFF


def test_a_drive_that_takes_no_power_is_a_fault_that_names_it() -> None:
    """S8: an ENABLE that is lost each time, within plant_timeout; the other works."""
    with bench_of("mit_can") as bench:
        bench.connect()
        bench.bus.to_drives = lambda sent: (frame for frame in sent if frame != (2, frames.ENABLE))
        found = bench.until(lambda found: bool(found.faults[1]), IMPEDANCE, cycles=60)
        assert "does not take power" in str(found.faults[1])
        assert not found.faults[0]


def test_a_drive_that_stays_in_its_mode_is_a_fault() -> None:
    """S8: 0x6061 is read; a drive that stayed in CSP was shown as TORQUE."""
    with bench_of("cia402") as bench:
        bench.connect()
        bench.follow(POSITION, 30)
        obey = bench.drives[1]._value
        bench.drives[1]._value = lambda index, sub=0: 8 if index == 0x6060 else obey(index, sub)
        found = bench.until(lambda found: bool(found.faults[1]), TORQUE, cycles=60)
        assert "acts in mode 8, not in 10" in str(found.faults[1])
        assert not found.faults[0]


@pytest.mark.parametrize("anew", [False, True])
def test_an_epos4_that_missed_its_heartbeat_works_again(anew: bool) -> None:
    """S5: it keeps error 0x8130 until NMT resets its communication, then its control word."""
    with bench_of("cia402") as bench:
        bench.drives[1].keeps_fault = True
        bench.connect()
        bench.follow(POSITION, 30)
        bench.pass_time(5.0 * bench.timeout)
        assert bench.drives[1].state is State.FAULT
        if anew:
            bench.connect()
        for _ in range(200):
            for joint, fault in enumerate(bench.follow(OFF).faults):
                if fault:
                    bench.plant.clear_fault(joint)
        assert bench.drives[1].state is not State.FAULT
        assert not any(bench.follow(POSITION, 30).faults)
        assert law_of(bench.drives[1]) is POSITION


@pytest.mark.parametrize("driver", ["dynamixel", "feetech", "cia402"])
def test_a_silent_drive_costs_the_others_nothing(driver: str) -> None:
    """S10: clearing its fault waits for nobody; the other gets each of its set-points in time."""
    with bench_of(driver) as bench:
        bench.connect()
        bench.follow(POSITION, 30)
        bench.drives[0].silent = True
        at = bench.until(lambda found: bool(found.faults[0]), POSITION, cycles=200).position[1]
        for cycle in range(100):
            before = bench.time
            bench.plant.clear_fault(0)
            found = bench.follow(POSITION, position=float(at) + 2e-3 * cycle)
            assert bench.time - before < 2.5 * PERIOD
            assert not found.faults[1]
        assert bench.world.state[0, 1] - at > 0.1


@pytest.mark.parametrize("driver", ["dynamixel", "feetech"])
def test_a_silent_drive_delays_the_power_of_no_other(driver: str) -> None:
    """S10: questions to it took up to 0.3 s each, and the other "does not take power"."""
    with bench_of(driver) as bench:
        bench.connect()
        bench.drives[0].silent = True
        bench.until(lambda found: bool(found.faults[0]), SetPoint.OFF, cycles=200)
        bench.follow(SetPoint.OFF, 6)
        for cycle in range(20):
            before = bench.time
            assert not bench.follow(POSITION).faults[1]
            assert bench.time - before < 2.5 * PERIOD or cycle == 0
        assert law_of(bench.drives[1]) is POSITION


def test_cyclic_messages_of_an_odrive_are_no_second_drive() -> None:
    """As it is delivered it sends its estimates every 10 ms."""
    with bench_of("odrive_can") as bench:
        bench.connect()
        sent = [0.0]

        def cyclic(answers: Iterable[Frame]) -> Iterator[Frame]:
            yield from answers
            if bench.time - sent[0] >= 0.01:
                sent[0] = bench.time
                for drive in bench.drives:
                    yield drive.id << 5 | 0x09, drive._answer(0x09)

        bench.bus.from_drives = cyclic
        for _ in range(100):
            assert not any(bench.follow(VELOCITY, velocity=0.4).faults)
        assert (bench.world.state[1] > 0.2).all()


def test_the_mode_of_an_odrive_is_read_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """S8: where its endpoint is known; a mode that is not taken is a fault, one packet is none."""
    from control_board_ros.plants.odrive_can import frames as o
    from control_board_ros.plants.odrive_can import virtual

    known = {**o.KNOWN["0.6.11", "4.4"], o.LAW: o.Endpoint(77, "<B")}
    monkeypatch.setattr(virtual, "PARAMETERS", known)
    forms = {form: name for name, form in o.FORMS.items()}
    entries = {name: {"id": one.id, "type": forms[one.form]} for name, one in known.items()}
    file = tmp_path / "flat_endpoints.json"
    content = {"fw_version": "0.6.11-1", "hw_version": "4.4.58", "endpoints": entries}
    file.write_text(json.dumps(content), encoding="utf-8")
    with bench_of("odrive_can", endpoints=str(file)) as bench:
        bench.connect()
        bench.follow(POSITION, 20)
        lost = [1]

        def lose(sent: Iterable[Frame]) -> Iterator[Frame]:
            for frame in sent:
                if frame[0] == 2 << 5 | o.MODE and lost[0]:
                    lost[0] -= 1
                else:
                    yield frame

        bench.bus.to_drives = lose
        assert not any(bench.follow(VELOCITY, 40).faults)
        assert [law_of(drive) for drive in bench.drives] == [VELOCITY, VELOCITY]
        lost[0] = 10_000
        found = bench.until(lambda found: bool(found.faults[1]), TORQUE, cycles=80)
        assert "acts in mode 2, not in 1" in str(found.faults[1])
        assert not found.faults[0]


def test_the_supply_that_returns_moves_no_moteus() -> None:
    """S11: what the queue of the interface kept is two set-points, questions and stops."""
    with bench_of("moteus") as bench:
        bench.connect()
        bench.follow(POSITION, 30)
        kept: list[Frame] = []

        def keep(sent: Iterable[Frame]) -> Iterator[Frame]:
            kept.extend(sent)
            yield from ()

        bench.bus.to_drives = keep
        for cycle in range(200):  # the reference goes on, at 1 rad/s
            bench.follow(POSITION, position=PERIOD * cycle)
        bench.bus.to_drives = iter
        for drive in bench.drives:
            drive.reboot()
        before = bench.world.state[0].copy()
        for frame in kept:
            bench.time += 130e-6
            bench.bus.step([frame])
        bench.follow(OFF, 20)
        assert np.abs(bench.world.state[0] - before).max() < 2e-3


def test_power_from_a_queue_is_taken_back() -> None:
    """S11: an ENABLE that the queue kept over a restart finds a Damiao without its MIT mode."""
    with bench_of("mit_can") as bench:
        bench.connect()
        bench.follow(OFF, 5)
        kept: list[Frame] = []

        def keep(sent: Iterable[Frame]) -> Iterator[Frame]:
            for frame in sent:
                if kept or frame[1] == frames.ENABLE:
                    kept.append(frame)
                else:
                    yield frame

        bench.bus.to_drives = keep
        bench.follow(IMPEDANCE, 12)
        bench.bus.to_drives = iter
        for drive in bench.drives:
            drive.reboot()
        bench.arrive(bench.bus.step(kept))
        assert bench.drives[0].state == 1
        found = bench.follow(IMPEDANCE, 40)
        assert "restarted" in str(found.faults[0])
        assert law_of(bench.drives[0]) is OFF


def test_a_robstride_as_it_is_delivered_is_heard_and_watched() -> None:
    """Out of the box it has frames of its own; nothing was heard of it."""
    with bench_of("mit_can", model="rs02") as bench:
        bench.connect()
        assert [drive.parameters[robstride_private.CAN_TIMEOUT] for drive in bench.drives] == [
            2000, 2000,
        ]  # fmt: skip
        bench.follow(IMPEDANCE, 1000, position=0.3)
        np.testing.assert_allclose(bench.world.state[0], 0.3, atol=5e-3)
        bench.pass_time(0.11)
        assert [drive.state for drive in bench.drives] == [0, 0]
        assert all(bench.follow(IMPEDANCE, position=0.3).faults)


def test_a_robstride_that_restarts_without_power_is_set_up_again() -> None:
    """S8: its watchdog is lost with its supply; it is read before power, and just after it."""
    with bench_of("mit_can", model="rs02") as bench:
        bench.connect()
        bench.follow(OFF, 10)
        bench.drives[0].reboot()
        found = bench.until(lambda found: bool(found.faults[0]), IMPEDANCE, cycles=20)
        assert "drive restarted" in str(found.faults[0])
        assert not powered(bench.drives[0])
        for _ in range(50):
            bench.plant.clear_fault(0)
            found = bench.follow(OFF)
        assert not any(found.faults)
        bench.follow(IMPEDANCE, 10)
        assert bench.drives[0].parameters[robstride_private.CAN_TIMEOUT] == 2000


def test_a_robstride_tells_its_faults_in_full() -> None:
    """S6: in a frame that nobody asked for; the answers name few of them."""
    with bench_of("mit_can", model="rs02") as bench:
        bench.connect()
        bench.drives[1].fail(1 << 3)
        found = bench.until(lambda found: bool(found.faults[1]), OFF, cycles=5)
        assert str(found.faults[1]) == "8 over-voltage"
        bench.plant.clear_fault(1)
        bench.until(lambda found: not any(found.faults), OFF, cycles=5)


@pytest.mark.parametrize(
    ("firmware", "end"), [((0, 0, 2, 5), 12.5), ((0, 0, 2, 6), 12.57), ((1, 0, 0, 0), 12.57)]
)
def test_the_range_of_an_rs00_is_that_of_its_firmware(
    firmware: tuple[int, ...], end: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As its manual of 2026-04-28 says."""
    monkeypatch.setattr(virtual_robstride, "FIRMWARE", firmware)
    with bench_of("mit_can", model="rs00") as bench:
        bench.connect()
        (joint, _) = bench.plant.describe().joints
        assert joint.limits.upper == end
        assert joint.drive == f"RobStride RS00 {'.'.join(map(str, firmware))}"


def test_a_feetech_whose_count_wraps_says_so_with_its_register() -> None:
    """At the end of the turn that it counts; the next goal would go all the way back."""
    with bench_of("feetech") as bench:
        bench.drives[0].table.set(feetech.HOMING, 1)
        bench.connect()
        bench.world.state[0] = np.pi - 0.02
        assert not any(bench.follow(OFF, 5).faults)
        bench.world.state[0, 0] = np.pi + 0.02
        found = bench.until(lambda found: any(found.faults), OFF, cycles=5)
        assert "its count wrapped" in str(found.faults[0])
        assert "Homing_Offset (address 31, now 1)" in str(found.faults[0])
        assert not found.faults[1]
        bench.world.state[0, 0] = np.pi - 0.02
        for _ in range(10):
            bench.plant.clear_fault(0)
            found = bench.follow(OFF)
        assert not any(found.faults)
