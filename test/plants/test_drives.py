# SPDX-License-Identifier: Apache-2.0
"""What every driver in the box does with its drives: on their virtual twins, over the wire."""

from __future__ import annotations

import itertools
import json
import re
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_bench import TIMEOUT, Bench
from wire import wired

from control_board_ros.core.config.parts import Pid
from control_board_ros.core.terms.drives import OnSilence, SetPoint
from control_board_ros.core.terms.measurement import SetPoints
from control_board_ros.plants.cia402.objects import MAX_SPEED
from control_board_ros.plants.drives import can_frame, can_line
from control_board_ros.plants.dynamixel.virtual import checksum
from control_board_ros.plants.entry_points import DRIVERS as IN_THE_BOX
from control_board_ros.plants.errors import PlantSettingsError
from control_board_ros.plants.feetech.virtual import VirtualFeetech
from control_board_ros.plants.interface import DriveFault, Readings
from control_board_ros.plants.mit_can.damiao import VMAX
from control_board_ros.plants.odrive_can import frames as f
from control_board_ros.plants.virtual.can_bus import Frame, VirtualCan
from control_board_ros.testing.plant_contract import board_for, plant_contract

ROOT = Path(__file__).parents[2]
#: By name of a test: driver, and options with which it accepts all set-points that it can.
DRIVERS: dict[str, tuple[str, dict[str, str]]] = {
    "moteus": ("moteus", {"unwatched": "1"}),
    "dynamixel": ("dynamixel", {}),
    "mit_can": ("mit_can", {}),
    "robstride": ("mit_can", {"model": "rs02"}),
    "robstride_mit": ("mit_can", {"model": "rs02", "protocol": "mit", "unwatched": "1"}),
    "cia402": ("cia402", {}),
    "odrive_can": ("odrive_can", {}),
    "feetech": ("feetech", {"unwatched": "1"}),
}
MOUNTED = {"left.direction": "-1", "left.ratio": "2", "left.offset": "0.3"}
OFF, POSITION, VELOCITY = SetPoint.OFF, SetPoint.POSITION, SetPoint.VELOCITY
TORQUE, CURRENT, PWM, IMPEDANCE = (
    SetPoint.TORQUE, SetPoint.CURRENT, SetPoint.PWM, SetPoint.IMPEDANCE,
)  # fmt: skip

Make = Callable[..., Bench]
Change = Callable[[int, bytes], tuple[int, bytes]]


#: Answers in the midst of reading limits, of the one driver and of the other.
SLOW_ONES = range(7, 13, 2)


class Slow:
    """A wire on which some answers take longer than a driver waits for them."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        for frame in frames:
            self._count += 1
            if self._count in SLOW_ONES:
                time.sleep(1.2 * can_line.PATIENCE)
            yield frame


def in_name(shift: int, mask: int) -> Change:
    """The id is a part of the frame's own."""
    own, other = 2 << shift, 1 << shift
    return lambda name, data: (name & ~mask | other if name & mask == own else name, data)


def in_data(place: int, mask: int, end: Callable[[bytes], bytes] | None = None) -> Change:
    """The id is in a byte of the data, and in the end a checksum."""

    def change(name: int, data: bytes) -> tuple[int, bytes]:
        if data[place] & mask == 2:
            data = data[:place] + bytes([data[place] & ~mask | 1]) + data[place + 1 :]
            data = data if end is None else end(data)
        return name, data

    return change


#: How the second drive answers for the first, by name of a test.
ANSWERS: dict[str, Change] = {
    "moteus": in_name(8, 0x7F00),
    "odrive_can": in_name(5, 0x7E0),
    "cia402": in_name(0, 0x7F),
    "mit_can": lambda name, data: in_data(0, 0x0F)(0x11 if name == 0x12 else name, data),
    "robstride": in_name(8, 0xFF00),
    "robstride_mit": in_data(0, 0xFF),
    "dynamixel": in_data(
        4, 0xFF, lambda data: data[:-2] + checksum(data[:-2]).to_bytes(2, "little")
    ),
    "feetech": in_data(2, 0xFF, lambda data: data[:-1] + bytes([~sum(data[2:-1]) & 0xFF])),
}
TOGETHER = ("moteus", "odrive_can", "cia402", "mit_can", "robstride", "robstride_mit")


#: One of them all day, the others in make test-long.
SLOW = pytest.mark.slow
PARAMS = [pytest.param(name, marks=() if name == "moteus" else SLOW) for name in DRIVERS]


@pytest.fixture(params=PARAMS)
def make(request: pytest.FixtureRequest) -> Iterator[Make]:
    driver, options = DRIVERS[request.param]
    made = []

    def bench(**more: object) -> Bench:
        given = {**options, **MOUNTED, **more.pop("options", {})}
        made.append(Bench(driver, options=given, **more))
        return made[-1]

    yield bench
    for each in made:
        each.__exit__(None, None, None)


@pytest.fixture
def bench(make: Make) -> Bench:
    found = make()
    found.connect()
    return found


def halve_limit(drive: Any) -> None:
    """The velocity that is stored in a virtual drive as its largest."""
    if hasattr(drive, "conf"):
        key = next(k for k in ("servo.max_velocity", f.SPEED_LIMIT) if k in drive.stored)
        drive.stored[key] /= 2.0
    elif hasattr(drive, "registers"):
        drive.stored[VMAX] /= 2.0
    elif hasattr(drive, "stored"):
        drive.stored[MAX_SPEED] = 500
    elif hasattr(drive, "table"):
        table = import_module(f"{type(drive).__module__.rpartition('.')[0]}.table")
        item = getattr(table, "VELOCITY_LIMIT", None) or table.SPEED_LIMIT
        drive.table.set(item, 20)
    else:
        pytest.skip("its limits are those of its model")


def recover(bench: Bench) -> None:
    """As the board does: faults are reset while their joints are without power."""
    for _ in range(500):
        found = bench.follow(OFF)
        if healthy(found):
            return
        for joint, fault in enumerate(found.faults):
            if fault:
                bench.plant.clear_fault(joint)
    raise AssertionError(f"it stays: {found.faults}")


def needs(bench: Bench, kind: SetPoint) -> None:
    if kind not in bench.accepts:
        pytest.skip(f"it accepts no {kind.code}")


def watched(bench: Bench) -> bool:
    """Whether its drives have a watchdog."""
    return not isinstance(bench.drives[0], VirtualFeetech)


def healthy(found: Readings) -> bool:
    return not any(found.faults)


def named(bench: Bench, joint: int) -> Callable[[Readings], bool]:
    """A fault of this joint, and of this one only."""
    return lambda found: bool(found.faults[joint]) and not found.faults[1 - joint]


def contract(name: str) -> Callable[..., None]:
    benches: list[Bench] = []
    driver, options = DRIVERS[name]

    def made() -> object:
        while benches:
            benches.pop().__exit__(None, None, None)
        benches.append(Bench(driver, options=options))
        return benches[-1].plant

    def wait(seconds: float) -> None:
        benches[-1].pass_time(seconds)

    def fail(joint: int) -> None:
        benches[-1].fail(joint)

    return plant_contract(made, wait=wait, fail=fail)


test_moteus_keeps_the_contract = contract("moteus")
test_dynamixel_keeps_the_contract = pytest.mark.slow(contract("dynamixel"))
test_mit_can_keeps_the_contract = pytest.mark.slow(contract("mit_can"))
test_robstride_keeps_the_contract = pytest.mark.slow(contract("robstride"))
test_robstride_mit_keeps_the_contract = pytest.mark.slow(contract("robstride_mit"))
test_cia402_keeps_the_contract = pytest.mark.slow(contract("cia402"))
test_odrive_can_keeps_the_contract = pytest.mark.slow(contract("odrive_can"))
test_feetech_keeps_the_contract = pytest.mark.slow(contract("feetech"))


def test_a_pause_before_the_first_set_point_is_no_fault(make: Make) -> None:
    """S5: the board takes its time to start, longer than the drives' watchdog."""
    bench = make()
    bench.connect()
    bench.follow(SetPoint.OFF, 2)
    bench.pass_time(1.0)
    bench.until(lambda found: not any(found.faults), SetPoint.OFF, cycles=50)


def test_every_driver_is_tested_documented_and_an_extra() -> None:
    page, setup = (
        (ROOT / name).read_text("utf-8") for name in ("docs/howto/drives.md", "setup.py")
    )
    install = (ROOT / "docs/install.md").read_text("utf-8")
    assert {driver for driver, _ in DRIVERS.values()} == set(IN_THE_BOX)
    for name in IN_THE_BOX:
        assert f"\n## {name}\n" in page
        tables = "drives, rows of S1, judged by"
        assert page.count(f"\n| `{name}` |") == 3, f"{name}: {tables}"
        assert f'"{name}": {name.upper()},' in setup
        assert f"`{name}`" in install


def test_connecting_gives_no_power_and_reports_type_and_firmware(bench: Bench) -> None:
    """S4, N1."""
    found = bench.follow(OFF, 20)
    assert healthy(found)
    np.testing.assert_array_equal(bench.world.state, 0.0)
    for joint in bench.plant.describe().joints:
        assert joint.drive
        assert any(map(str.isdigit, joint.drive))


def test_a_position_is_reached_at_the_joint_whatever_direction_and_ratio(bench: Bench) -> None:
    """S1: units, direction, ratio, zero."""
    needs(bench, POSITION)
    found = bench.until(
        lambda found: (
            np.abs(bench.world.state[0] - 0.5).max() < 3e-3 and np.abs(found.velocity).max() < 0.02
        ),
        POSITION,
        position=0.5,
    )
    np.testing.assert_allclose(found.position, bench.world.state[0], atol=3e-3)
    assert healthy(found)


def test_a_velocity_is_held_at_the_joint(bench: Bench) -> None:
    """S1."""
    needs(bench, VELOCITY)
    bench.until(lambda _: np.abs(bench.world.state[1] - 0.4).max() < 0.02, VELOCITY, velocity=0.4)
    found = bench.follow(VELOCITY, 50, velocity=0.4)
    np.testing.assert_allclose(found.velocity, 0.4, atol=0.05)


def test_an_impedance_is_a_spring_and_a_damper(bench: Bench) -> None:
    """S1: released from rest it comes to the set-point; a feed-forward moves it by τ/k."""
    needs(bench, IMPEDANCE)
    spring = {"position": 0.2, "stiffness": 4.0, "damping": 1.0}
    bench.follow(IMPEDANCE, 1500, **spring)
    np.testing.assert_allclose(bench.world.state[0], 0.2, atol=5e-3)
    bench.follow(IMPEDANCE, 1500, torque=0.4, **spring)
    np.testing.assert_allclose(bench.world.state[0], 0.3, atol=7e-3)


def test_torque_accelerates_the_joint(bench: Bench) -> None:
    """S1: J dω/dt = τ less friction, either way round."""
    needs(bench, TORQUE)
    found = bench.follow(TORQUE, 50, torque=0.1)
    np.testing.assert_allclose(found.torque, 0.1, atol=0.02)
    assert (bench.world.state[1] > 0.05).all()
    np.testing.assert_allclose(bench.world.state[1, 0], bench.world.state[1, 1], rtol=0.2)


@pytest.mark.parametrize(("kind", "value"), [(CURRENT, 0.4), (PWM, 5.0)])
def test_current_and_pwm_drive_the_way_of_the_joint(
    bench: Bench, kind: SetPoint, value: float
) -> None:
    """S1."""
    needs(bench, kind)
    for sign in (1.0, -1.0):
        bench.follow(kind, 100, **{kind.code: sign * value})
        bench.until(
            lambda _, sign=sign: (sign * bench.world.state[1] > 0.01).all(),
            kind,
            **{kind.code: sign * value},
        )


def test_a_new_kind_of_set_point_comes_with_its_own_values(bench: Bench) -> None:
    """S3, M9: at rest no change of kind moves a joint."""
    at = bench.follow(OFF, 5).position
    for kind in (*bench.accepts, OFF, *bench.accepts):
        for _ in range(20):
            rows = {"position": float(at[0])} if np.ptp(at) < 1e-2 else {}
            bench.follow(kind, 1, **(rows or {"position": 0.0}))
    np.testing.assert_allclose(bench.world.state[0], 0.0, atol=5e-3)


def test_without_power_nothing_holds_the_joint(bench: Bench) -> None:
    """M10."""
    bench.follow(bench.accepts[0], 50)
    bench.follow(OFF, 20)
    with bench.world.lock:
        bench.world.state[1] = 1.0
    bench.follow(OFF, 10)
    assert (bench.world.state[1] > 0.8).all()


def test_a_fault_has_number_and_name_and_is_cleared_in_the_drive(bench: Bench) -> None:
    """S6, F3: a cause that persists comes back, until it is gone."""
    bench.follow(bench.accepts[0], 20)
    bench.fail(1, persists=True)
    found = bench.until(named(bench, 1), bench.accepts[0])
    fault = found.faults[1]
    assert isinstance(fault, DriveFault)
    assert fault.name
    assert "manual" not in fault.name
    bench.follow(OFF, 5)
    bench.plant.clear_fault(1)
    assert bench.follow(OFF, 10).faults[1], "it persists"
    bench.drives[1].persists = 0
    recover(bench)
    bench.follow(bench.accepts[0], 30)
    assert healthy(bench.follow(bench.accepts[0]))


def test_a_drive_without_frames_stops_by_its_own_watchdog(bench: Bench) -> None:
    """S5: reported when it answers again; only without power can the joint recover."""
    if not watched(bench):
        pytest.skip("it has no watchdog")
    kind = VELOCITY if VELOCITY in bench.accepts else IMPEDANCE
    asked = {"velocity": 0.4, "stiffness": 0.0, "damping": 2.0}
    bench.until(lambda _: (bench.world.state[1] > 0.3).all(), kind, **asked)
    bench.pass_time(25 * TIMEOUT)
    before = bench.world.state[0].copy()
    bench.pass_time(TIMEOUT)
    assert (bench.world.state[0] - before < 0.4 * TIMEOUT / 4).all()
    found = bench.until(lambda found: all(found.faults), kind, **asked)
    assert "watchdog" in str(found.faults[0])
    recover(bench)


def test_a_watchdog_trip_before_the_start_is_cleared(bench: Bench) -> None:
    """S5: a program that was killed is started again; nothing is left to clear."""
    bench.follow(bench.accepts[0], 20)
    bench.pass_time(25 * TIMEOUT)
    bench.connect()
    assert healthy(bench.follow(OFF, 10))
    bench.follow(bench.accepts[0], 30)
    assert healthy(bench.follow(bench.accepts[0]))


def test_a_drive_that_started_anew_does_not_go_on_by_itself(bench: Bench) -> None:
    """Nothing moves unasked: it stays without power until its fault is cleared."""
    kind = bench.accepts[0]
    bench.follow(kind, 30)
    bench.drives[1].reboot()
    bench.until(named(bench, 1), kind, position=0.3, velocity=0.3, torque=0.3)
    torque = [abs(bench.drives[1].torque) for _ in range(50) if bench.follow(kind, position=9.0)]
    assert max(torque[5:]) < 1e-6
    recover(bench)
    bench.follow(kind, 30)
    assert healthy(bench.follow(kind))


def test_a_drive_that_comes_back_with_other_limits_says_so(bench: Bench) -> None:
    """S4: a drive that is set up again is described again."""
    before = bench.plant.describe().joints
    bench.follow(bench.accepts[0], 30)
    halve_limit(bench.drives[1])
    bench.drives[1].reboot()
    bench.until(named(bench, 1), bench.accepts[0])
    recover(bench)
    after = bench.plant.describe().joints
    assert after[0] == before[0]
    assert after[1].limits != before[1].limits


def test_a_silent_drive_is_named_and_the_other_continues(make: Make) -> None:
    """B3: its last reading, with its age; then a fault; FORCE_IDLE works when it is back."""
    bench = make()
    bench.connect()
    kind = bench.accepts[0]
    bench.follow(kind, 20)
    bench.drives[1].silent = True
    bench.until(lambda found: found.ages[1] > 0.0, kind)
    found = bench.until(named(bench, 1), kind)
    assert f"no answer from id {bench.plant.axes[1].id} for" in str(found.faults[1])
    bench.drives[1].silent = False
    recover(bench)


def test_a_loop_that_stalls_is_no_silence_of_a_drive(make: Make) -> None:
    """The age of a reading is the time for which an answer has been owed."""
    bench = make()
    bench.connect()
    kind = bench.accepts[0]
    bench.follow(kind, 20)
    bench.drives[1].silent = True
    bench.time += 0.1
    found = bench.follow(kind)
    assert 0.0 < found.ages[1] < 0.1


def test_two_drives_with_one_id_are_reported(bench: Bench) -> None:
    """Also when one is plugged in while it runs."""
    other = bench.world_drive(bench.plant.axes[1])
    with bench.world.lock:
        bench.bus.drives.append(other)
    bench.until(lambda found: "two drives answer as id" in str(found.faults[1]), OFF, cycles=500)
    assert not bench.follow(OFF).faults[0]
    with pytest.raises(OSError, match="two drives answer as id"):
        bench.connect()


def test_a_drive_that_answers_for_another_is_reported(make: Make, request: Any) -> None:
    """Its own id is silent, the other's has two voices; neither moves, and both come back."""
    bench = make()
    bench.connect()
    kind = POSITION if POSITION in bench.accepts else IMPEDANCE
    bench.follow(kind, 30)
    before = bench.world.state[0].copy()
    name = request.node.callspec.params["make"]
    bench.bus.from_drives = partial(itertools.starmap, ANSWERS[name])
    found = bench.until(lambda found: bool(found.faults[1]), kind, cycles=500)
    assert f"no answer from id {bench.plant.axes[1].id}" in str(found.faults[1])
    if name in TOGETHER:  # where each is awaited by itself, a wrong id is no answer
        bench.until(lambda found: "two drives answer" in str(found.faults[0]), kind, cycles=500)
    assert np.abs(bench.world.state[0] - before).max() < 5e-3
    bench.bus.from_drives = iter
    recover(bench)
    bench.follow(kind, 30)
    assert healthy(bench.follow(kind))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dynamixel", "feetech"])
def test_a_late_answer_does_not_answer_the_next_request(name: str) -> None:
    """Packets of serial drives do not say what they answer: limits would be those of others."""
    driver, options = DRIVERS[name]
    with Bench(driver, options=options) as bench:
        bench.connect()
        known = [joint.limits for joint in bench.plant.describe().joints]
        bench.bus.from_drives = Slow()
        bench.connect()
        assert [joint.limits for joint in bench.plant.describe().joints] == known


def test_a_drive_that_is_not_there_is_reported_at_the_start(make: Make) -> None:
    """B3."""
    bench = make()
    bench.drives[0].silent = True
    with pytest.raises(OSError, match=r"left: no drive answers as id 1 on .*; look with: cbctl"):
        bench.connect()


#: Drivers that see a corrupted frame: the hardware of a CAN bus drops it, as a lost one.
SERIAL = ("dynamixel", "feetech")
#: One of either kind whose wire fails seldom, too.
SELDOM = ("moteus", "dynamixel")
WIRES = [
    pytest.param(name, what, share, marks=() if name == "moteus" else SLOW)
    for name in DRIVERS
    for what in ("lost", "late", "doubled", *["corrupted"] * (name in SERIAL))
    for share in (*[0.01] * (name in SELDOM), 0.1, *[1.0] * (what == "corrupted"))
]


@pytest.mark.parametrize(("make", "what", "share"), WIRES, indirect=["make"])
def test_a_bad_wire_moves_nothing_that_was_not_asked_for(
    make: Make, what: str, share: float
) -> None:
    """Frames of either way lost, late, doubled, corrupted: the joint follows, or is in fault."""
    bench = make()
    bench.connect()
    kind = POSITION if POSITION in bench.accepts else IMPEDANCE
    bench.follow(kind, 400, position=0.2)
    wires = wired(bench.bus)
    for wire in wires:
        setattr(wire, what, share)
    highest = 0.0
    for _ in range(150):
        bench.follow(kind, position=0.2)
        highest = max(highest, float(np.abs(bench.world.state[0] - 0.2).max()))
    assert highest < 0.25
    for wire in wires:
        setattr(wire, what, 0.0)
    recover(bench)


def test_a_cable_that_is_out_is_a_fault_until_it_is_in_again(make: Make) -> None:
    """B3: all frames lost."""
    bench = make()
    bench.connect()
    kind = bench.accepts[0]
    bench.follow(kind, 20)
    to_drives, _ = wired(bench.bus)
    to_drives.cut = True
    found = bench.until(lambda found: all(found.faults), kind, cycles=500)
    # A drive that reports unasked says itself that it hears nothing.
    assert re.search("no answer|watchdog: no command", str(found.faults[0]))
    to_drives.cut = False
    recover(bench)


def test_an_interface_that_leaves_the_bus_says_so_until_it_is_back(make: Make) -> None:
    """B3, S5: bus off; the drives' watchdogs act, and FORCE_IDLE works when it is back."""
    bench = make()
    if not isinstance(bench.bus, VirtualCan):
        pytest.skip("it is on no CAN bus")
    bench.connect()
    bench.follow(bench.accepts[0], 20)
    to_drives, from_drives = wired(bench.bus)
    to_drives.cut = from_drives.cut = True
    off = can_frame.frame()(arbitration_id=can_line.BUS_OFF, is_error_frame=True)
    bench.wire_end.received.append(off)  # as socketcan reports it
    with pytest.raises(OSError, match=r"bus direct is off: .* restart-ms"):
        bench.until(lambda _: False, bench.accepts[0], cycles=50)
    bench.pass_time(25 * TIMEOUT)
    if watched(bench):
        assert all(abs(drive.torque) < 1e-6 for drive in bench.drives)
    to_drives.cut = from_drives.cut = False
    bench.connect()
    recover(bench)


def test_an_exchange_in_parts_is_an_exchange(make: Make) -> None:
    """S10: on CAN set-points go to several buses before the answers of the first are awaited."""
    bench, apart = make(), make()
    for one in (bench, apart):
        one.connect()
    if not isinstance(bench.bus, VirtualCan):
        with pytest.raises(TypeError, match="no socket"):
            apart.plant.begin(SetPoints.off(2))
    else:
        apart.plant.exchange = lambda wanted: parts(apart.plant, wanted)  # type: ignore[method-assign]
    kind = bench.accepts[0]
    for _ in range(40):
        found = [one.follow(kind, position=0.1) for one in (bench, apart)]
        np.testing.assert_array_equal(found[0].position, found[1].position)
        assert found[0].faults == found[1].faults
    assert bench.plant.fileno() is None  # a bus of tests has no socket


def parts(plant: Any, wanted: SetPoints) -> Readings:
    """An exchange, part by part."""
    plant.begin(wanted)
    plant.read(plant.clock.now() + 1.0)
    found: Readings = plant.finish()
    return found


def test_a_scan_lists_the_drives_that_answer(make: Make) -> None:
    """Type, id, firmware, voltage, faults."""
    bench = make()
    bench.fail(1)
    bench.drives[1].step(1e-3, 0.0, 0.0)
    found = bench.scan()
    assert [drive.id for drive in found] == [axis.id for axis in bench.plant.axes]
    assert all(drive.type for drive in found)
    assert found[0].fault is None
    assert found[1].fault is not None


def test_release_removes_power_where_silence_is_free(bench: Bench) -> None:
    """S5, B5."""
    kind = bench.accepts[0]
    bench.follow(kind, 30)
    bench.plant.let_go()
    bench.pass_time(0.01)
    with bench.world.lock:
        bench.world.state[1] = 1.0
    bench.pass_time(0.02)
    assert (bench.world.state[1] > 0.8).all()


def test_position_gains_that_do_not_fit_an_mit_frame_are_refused() -> None:
    """S4: the board follows positions by k and d in the motor."""
    with Bench("mit_can") as bench:
        joints = board_for(bench.plant.describe()).joints
        stiff = replace(joints[0], position_pid=Pid(kp=600.0))
        bench.joints = (stiff, joints[1])
        with pytest.raises(
            PlantSettingsError, match=r"left: position_pid.kp=600.* \[left.ratio=1.1\]"
        ):
            bench.connect()
        bench.joints = joints
        bench.connect()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            {"model": "rs02", "protocol": "mit"},
            "left: no MIT frame sets the watchdog .* canTimeout .* unwatched=1",
        ),
        ({"model": "rs02", "protocol": "own"}, "left.protocol=own: private or mit is required"),
        ({"right.model": "rs99"}, "right.model=rs99: unknown; known: damiao, rs00, .*"),
        ({"model": "damio"}, r"left.model=damio: unknown; did you mean 'damiao'\?; known: "),
        ({"model": "rs02", "unwatched": "1", "scales": "1/2"}, "left.scales=1/2: .* is required"),
        ({"ids": "1,16"}, "right.id=16: 1 to 15 is required"),
    ],
)
def test_mit_motors_that_cannot_be_are_refused(options: dict[str, str], text: str) -> None:
    """S5: what the frames of a make cannot do, the user confirms."""
    with pytest.raises(PlantSettingsError, match=text):
        Bench("mit_can", options=options)


def test_both_makes_of_mit_motors_share_a_bus() -> None:
    """S1: each with its own scales, and its own scheme of ids."""
    with Bench(
        "mit_can",
        ("left", "right", "top"),
        {
            "right.model": "rs04",
            "top.model": "rs02",
            "top.protocol": "mit",
            "ids": "2 18 19",
            "unwatched": "1",
        },
    ) as bench:
        bench.connect()
        names = [joint.drive for joint in bench.plant.describe().joints]
        assert names == ["Damiao 5013", "RobStride RS04 0.2.3.17", "RobStride RS02"]
        bench.follow(IMPEDANCE, 1500, position=0.3, stiffness=8.0, damping=1.0)
        np.testing.assert_allclose(bench.world.state[0], 0.3, atol=5e-3)


def test_an_odrive_of_another_firmware_needs_its_own_table_of_parameters(tmp_path: Path) -> None:
    """S5: parameters are numbers that change from firmware to firmware."""
    known = {f.WATCHDOG_TIMEOUT: "float", f.WATCHDOG_ENABLED: "bool"}
    file = tmp_path / "flat_endpoints.json"
    table = {
        name: {"id": endpoint.id, "type": known.get(name, "float"), "access": "rw"}
        for name, endpoint in f.KNOWN["0.6.11", "4.4"].items()
    }
    about = {"fw_version": "0.6.11", "hw_version": "4.4.58", "endpoints": table}
    file.write_text(json.dumps(about))
    version = f.Version(2, "4.4", "0.6.11")
    assert f.endpoints(version, str(file)) == f.KNOWN["0.6.11", "4.4"]
    for other, given, text in (
        (version._replace(firmware="0.6.8"), "", "of firmware 0.6.8 .* endpoints=FILE"),
        (version._replace(firmware="0.6.8"), str(file), "is of firmware 0.6.11 .* has 0.6.8"),
        (version, str(tmp_path), "flat_endpoints.json of the drives' firmware is required"),
    ):
        with pytest.raises(PlantSettingsError, match=text):
            f.endpoints(other, given)


def test_a_canopen_drive_that_lacks_a_mode_or_a_unit_is_refused_with_the_way_out() -> None:
    """S1: what a drive does not say, its options do."""
    with Bench("cia402") as bench:
        drive = bench.drives[0]
        drive.node.object_dictionary[0x6502].default = 0x280
        with pytest.raises(PlantSettingsError, match="left: id 1 has no CSV; add 'modes=csp cst'"):
            bench.connect()
        drive.node.object_dictionary[0x6502].default = 0x380
        drive.node.object_dictionary[0x6076].default = 0
        with pytest.raises(PlantSettingsError, match=r"rated_torque .* add left.rated_torque="):
            bench.connect()
        drive.node.object_dictionary[0x1000].default = 401
        with pytest.raises(PlantSettingsError, match="id 1 has profile 401; 402"):
            bench.connect()


def test_a_motor_s_own_encoder_is_read_beside_the_joint_s() -> None:
    """Y5: of a gear that twists, both sides as the drive measures them, positive as the joint."""
    options = {"left.motor_counts": "131072", "left.direction": "-1", "right.motor_turns": "9"}
    with Bench("cia402", options=options) as bench:
        has = [joint.motor_encoder for joint in bench.plant.describe().joints]
        assert has == [True, True]
        bench.drives[0].gear, bench.drives[0].yielding = 50.0, 0.02
        bench.connect()
        found = bench.follow(TORQUE, 20, torque=0.5)
        motor, speed = found.motor_position, found.motor_velocity
        assert motor is not None
        assert speed is not None
        twist = motor / [50.0, 9.0] - found.position
        assert twist == pytest.approx([0.02 * 0.5, 0.0], abs=1e-3)
        assert np.isnan(speed[0])
        assert found.velocity is not None
        assert speed[1] == pytest.approx(9.0 * found.velocity[1])
        found = bench.follow(OFF, 3)
        assert found.motor_position is not None
        assert found.motor_position[0] == pytest.approx(50.0 * found.position[0], abs=0.05)
    with Bench("cia402") as bench:
        bench.connect()
        assert bench.follow(OFF).motor_position is None
    with pytest.raises(PlantSettingsError, match=r"left.motor_turns=-1: a number from 0"):
        Bench("cia402", options={"left.motor_turns": "-1"})


def test_a_canopen_drive_that_is_braked_holds_where_it_stopped() -> None:
    """S5: quick stop, until it answers again and is reset."""
    with Bench("cia402") as bench:
        bench.joints = tuple(
            replace(joint, on_silence=OnSilence.BRAKED)
            for joint in board_for(bench.plant.describe()).joints
        )
        bench.connect()
        bench.until(lambda _: (bench.world.state[1] > 0.3).all(), VELOCITY, velocity=0.4)
        bench.pass_time(10 * TIMEOUT)
        with bench.world.lock:
            bench.world.state[1] = 1.0
        bench.pass_time(10 * TIMEOUT)
        assert np.abs(bench.world.state[1]).max() < 0.02
        found = bench.until(lambda found: all(found.faults), VELOCITY, velocity=0.4)
        assert "watchdog" in str(found.faults[0])
        recover(bench)
